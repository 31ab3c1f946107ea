// Lighting against the command-line tool, which shares no code with it, and against three.js's own probe.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import {
  DataTexture,
  DataUtils,
  Euler,
  FloatType,
  HalfFloatType,
  LightProbe,
  MathUtils,
  Quaternion,
  RGBAFormat,
  Vector3,
} from 'three';
import { describe, expect, it } from 'vitest';
import { readMap } from '../page/loading.ts';
import { Lighting, projectLatLong } from '../src/index.ts';
import { haveTool, lambentJson, makeFolder, random, writeLopsidedHdr } from './tool.ts';

const degrees = [40, -25, 70] as const;
const turn = (): Quaternion =>
  new Quaternion().setFromEuler(
    new Euler(
      ...([degrees[1], degrees[0], degrees[2]].map((d) => MathUtils.degToRad(d)) as [number, number, number]),
      'YXZ',
    ),
  );
const readFile = (path: string): ArrayBuffer => new Uint8Array(readFileSync(path)).buffer;
const read = (path: string): Lighting => new Lighting(projectLatLong(readMap(readFile(path)), 16));

interface EnvJson {
  coefficients: number[][];
  window: number[];
}
/** Largest difference over the largest coefficient. */
function difference(ours: ArrayLike<number>, theirs: EnvJson): number {
  const flat = theirs.coefficients.flat(),
    size = Math.max(...flat.map(Math.abs));
  expect(ours.length).toBe(flat.length);
  return Math.max(...flat.map((v, i) => Math.abs(v - ours[i]!))) / size;
}
const single = 3e-6; // the tool keeps coefficients and turns them in single precision

describe.skipIf(!haveTool)('lighting agrees with lambent env', () => {
  const folder = makeFolder(),
    map = join(folder, 'light.hdr');
  writeLopsidedHdr(map);

  it('at order 16', () => {
    expect(difference(read(map).coefficients(16), lambentJson('env', map, '--order', '16') as EnvJson)).toBeLessThan(
      single,
    );
  });
  it('turned about a skew axis, at orders 6 and 11', () => {
    const light = read(map);
    light.rotation.copy(turn());
    for (const order of [6, 11])
      expect(
        difference(
          light.coefficients(order),
          lambentJson('env', map, '--order', String(order), '--env-rotate', degrees.join()) as EnvJson,
        ),
      ).toBeLessThan(single);
  });
  for (const window of ['hann', 'lanczos', 'auto'] as const)
    it(`with the window ${window}`, () => {
      const light = read(map);
      light.window = window;
      // `auto` is found on one lattice here and there, in double and in single precision, to 24 halvings of an
      // interval.
      expect(
        difference(light.coefficients(6), lambentJson('env', map, '--order', '6', '--window', window) as EnvJson),
      ).toBeLessThan(window === 'auto' ? 1e-4 : single);
    });
  it('as a three.js probe', () => {
    const light = read(map);
    light.rotation.copy(turn());
    const probe = light.toLightProbe().sh.coefficients.flatMap((c) => c.toArray());
    expect(
      difference(
        probe,
        lambentJson('env', map, '--order', '3', '--env-rotate', degrees.join(), '--convention', 'three') as EnvJson,
      ),
    ).toBeLessThan(single);
  });
});

describe('lighting', () => {
  const next = random(12),
    texels = Float32Array.from({ length: 64 * 32 * 4 }, next);

  it('reads float and half textures, either way up', () => {
    const make = (data: Float32Array | Uint16Array, flipY: boolean): DataTexture => {
      const texture = new DataTexture(
        data,
        64,
        32,
        RGBAFormat,
        data instanceof Float32Array ? FloatType : HalfFloatType,
      );
      texture.flipY = flipY;
      return texture;
    };
    const rows = Array.from({ length: 32 }, (_, y) => texels.slice(256 * y, 256 * (y + 1))).reverse(),
      upside = new Float32Array(texels.length);
    rows.forEach((row, y) => upside.set(row, 256 * y));
    const top = Lighting.fromEquirectangular(make(texels, true), 6).coefficients(6);
    expect(Lighting.fromEquirectangular(make(upside, false), 6).coefficients(6)).toEqual(top);
    const half = Lighting.fromEquirectangular(
      make(
        Uint16Array.from(texels, (v) => DataUtils.toHalfFloat(v)),
        true,
      ),
      6,
    ).coefficients(6);
    // Half's rounding, 2^-11 each, on a total of 2 pi.
    half.forEach((v, i) => expect(Math.abs(v - top[i]!)).toBeLessThan(2e-3));
  });

  it('goes through a three.js probe and back', () => {
    const light = new Lighting(Array.from({ length: 27 }, next)),
      back = Lighting.fromLightProbe(light.toLightProbe(new LightProbe(undefined, 1)));
    back.coefficients(3).forEach((v, i) => expect(v).toBeCloseTo(light.coefficients(3)[i]!, 12));
  });

  it('gives three.js the irradiance that it has: pi times the mean over the cosine lobe, no other factor', () => {
    // One band up and down: L = 1 + d.y, so irradiance on a plane facing +Y is pi + 2 pi / 3.
    const light = Lighting.fromEquirectangular(
      new DataTexture(
        Float32Array.from(
          { length: 256 * 128 * 4 },
          (_, i) => 1 + Math.cos((Math.PI * (Math.floor(i / 1024) + 0.5)) / 128),
        ),
        256,
        128,
        RGBAFormat,
        FloatType,
      ),
      3,
    );
    light.rotation.setFromAxisAngle(new Vector3(1, 0, 0), Math.PI); // the data's first row is the lowest: turn it up
    const E = light.toLightProbe().sh.getIrradianceAt(new Vector3(0, 1, 0), new Vector3());
    expect(E.x).toBeCloseTo(Math.PI + (2 * Math.PI) / 3, 3);
  });

  it('pads with zeros beyond its bands, and cuts to `bands`', () => {
    const light = new Lighting(Array.from({ length: 27 }, next));
    expect([...light.coefficients(5).slice(27)].every((v) => v === 0)).toBe(true);
    light.bands = 2;
    expect([...light.coefficients(3).slice(12)].every((v) => v === 0)).toBe(true);
    expect(light.coefficients(3).slice(0, 12)).not.toContain(0);
  });

  it('refuses what is no light', () => {
    expect(() => new Lighting([1, 2, NaN])).toThrow(/finite/);
    expect(() => new Lighting(new Array<number>(6).fill(1))).toThrow();
    expect(() => readMap(new TextEncoder().encode('no picture').buffer)).toThrow(/\.hdr or \.exr/);
    expect(() => readMap(new TextEncoder().encode('#?RADIANCE\n\n-Y 4 +X 8\n').buffer)).toThrow(/cannot be read/);
  });
});
