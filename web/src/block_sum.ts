// Visibility in blocks times light on the processor: where the graphics card is a program, which fetches texels many
// times slower than this adds, and where it draws into no floats.
import type { WebGLRenderer } from 'three';
import { blockTexels, cubeBlocks } from './cube.js';

const software = /swiftshader|llvmpipe|softpipe|software|basic render/i;
const known = new WeakMap<object, boolean>();

/** Whether the graphics card is a program, as far as the browser says. */
export function isSoftware(renderer: WebGLRenderer): boolean {
  let is = known.get(renderer);
  if (is === undefined) {
    const gl = renderer.getContext(),
      info = gl.getExtension('WEBGL_debug_renderer_info');
    is = software.test(String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER)));
    known.set(renderer, is);
  }
  return is;
}

export interface BlockSumOptions {
  /** Records, which have been checked. */
  records: Uint8Array;
  /** Eight numbers a receiver: place, -, normal, - (blocks.ts). */
  places: Float32Array;
  begins: Float64Array;
  /** block_light.ts */
  sums: Float32Array;
  cube: number;
  bits: number;
}

/** Exit radiance of white by Lambert's law, four numbers a receiver. */
export function sumBlocks({ records, places, begins, sums, cube, bits }: BlockSumOptions, out: Float32Array): void {
  const blocks = cubeBlocks(cube),
    flags = Math.ceil(blocks / 4),
    scale = 1 / (2 ** bits - 1);
  for (let r = 0; r + 1 < begins.length; ++r) {
    const begin = begins[r]!;
    let at = begin + flags;
    // Light times direction is added up first, and meets the normal once.
    let [rx, ry, rz, gx, gy, gz, bx, by, bz] = [0, 0, 0, 0, 0, 0, 0, 0, 0];
    for (let b = 0; b < blocks; ++b) {
      const sight = (records[begin + (b >> 2)]! >> (2 * (b & 3))) & 3;
      if (sight === 0) continue;
      let count = 1,
        where = 0;
      if (sight === 2) {
        count = records[at++]!;
        if (count > 127) count = (count & 127) + 128 * records[at++]!;
        where = at;
        at += bits === 1 ? count : 2 * count;
      }
      let before = 0;
      for (let i = 0; i < count; ++i) {
        const after = sight === 1 ? 1 : bits === 1 ? 1 - (i & 1) : scale * records[where + count + i]!,
          step = after - before,
          s = 12 * (blockTexels * b + (sight === 1 ? 0 : records[where + i]!));
        before = after;
        rx += step * sums[s]!;
        ry += step * sums[s + 1]!;
        rz += step * sums[s + 2]!;
        gx += step * sums[s + 4]!;
        gy += step * sums[s + 5]!;
        gz += step * sums[s + 6]!;
        bx += step * sums[s + 8]!;
        by += step * sums[s + 9]!;
        bz += step * sums[s + 10]!;
      }
    }
    const x = places[8 * r + 4]! / Math.PI,
      y = places[8 * r + 5]! / Math.PI,
      z = places[8 * r + 6]! / Math.PI;
    out[4 * r] = rx * x + ry * y + rz * z;
    out[4 * r + 1] = gx * x + gy * y + gz * z;
    out[4 * r + 2] = bx * x + by * y + bz * z;
  }
}
