// The light of a cube in the forms that blocks are multiplied by, as textures. Source: locally-adaptive-products,
// section 4; relight/products.h has the same in C++. Sums keep energy times direction, so that their dot product with a
// normal is irradiance.
//
//   sums     texel (3 t + c, block): channel c summed from texel t to the block's end
//   coarse   texel (3 i + c, block): channel c times the cardinal function of node i, of 4 x 4 a block
//   fine     the same of 8 x 8, at Chebyshev's points; w of the first: 1 where a texel has much of all light
//   texels   texel (2 t, block): direction of texel t; (2 t + 1, block): its energy
import { DataTexture, FloatType, NearestFilter, RGBAFormat } from 'three';
import { blockSide, blockTexels, cubeBlocks, cubeDirection, type CubeLight } from './cube.js';

export const nodes = 4; // a side of a block

/**
 * Cardinal functions of so many nodes along a side, [node][texel]: 1 at their own node, 0 at others, sums of as many
 * cosines cos(pi k (x + 1/2) / 16) as there are nodes (eq. 4). The cosines are orthogonal over the nodes, so that the
 * inverse is their transpose.
 */
export function cardinalFunctions(count: number): Float64Array {
  const out = new Float64Array(count * blockSide);
  for (let node = 0; node < count; ++node)
    for (let x = 0; x < blockSide; ++x)
      for (let k = 0; k < count; ++k)
        out[node * blockSide + x]! +=
          ((k === 0 ? 1 : 2) / count) *
          Math.cos((Math.PI * k * (node + 0.5)) / count) *
          Math.cos((Math.PI * k * (x + 0.5)) / blockSide);
  return out;
}

/** Where along a side of a block, in texels, so many nodes of a fine one are: Chebyshev's points. */
export const fineNodes = 8;
export const finePlace = (node: number): number => 8 * (1 - Math.cos((Math.PI * (node + 0.5)) / fineNodes));
/** Lagrange's polynomial of a fine node, at x texels. */
export function fineCardinal(node: number, x: number): number {
  let out = 1;
  for (let i = 0; i < fineNodes; ++i) if (i !== node) out *= (x - finePlace(i)) / (finePlace(node) - finePlace(i));
  return out;
}
/** Of the light, in one texel: only a sample of each texel tells what a lobe makes of it. */
const sharpShare = 1e-3;

/** The largest angle from the middle of a block to a corner of it, radians. */
export function widestBlock(size: number): number {
  let least = 1;
  for (let x = 0; x < size; x += blockSide)
    for (let y = 0; y < size; y += blockSide) {
      const middle = cubeDirection(size, 0, x + 8, y + 8);
      for (const i of [0, 16])
        for (const j of [0, 16]) {
          const d = cubeDirection(size, 0, x + i, y + j);
          least = Math.min(least, middle[0] * d[0] + middle[1] * d[1] + middle[2] * d[2]);
        }
    }
  return Math.acos(least);
}

function texture(name: string, width: number, height: number): DataTexture {
  const made = new DataTexture(new Float32Array(4 * width * height), width, height, RGBAFormat, FloatType);
  made.name = name;
  made.minFilter = made.magFilter = NearestFilter;
  made.generateMipmaps = false;
  made.needsUpdate = true;
  return made;
}
const dataOf = (of: DataTexture): Float32Array => of.image.data as Float32Array;

export class BlockLight {
  readonly sums: { value: DataTexture };
  /** Of glossy materials; a texel alone until gloss() is asked for. */
  readonly coarse: { value: DataTexture };
  readonly fine: { value: DataTexture };
  readonly texels: { value: DataTexture };
  private readonly blocks: number;
  private light: CubeLight | undefined;
  private isGlossy = false;

  constructor(readonly size: number) {
    this.blocks = cubeBlocks(size);
    this.sums = { value: texture('lambent block sums', 3 * blockTexels, this.blocks) };
    this.coarse = { value: texture('lambent block nodes', 1, 1) };
    this.fine = { value: texture('lambent block fine nodes', 1, 1) };
    this.texels = { value: texture('lambent block texels', 1, 1) };
  }

  get bytes(): number {
    return [this.sums, this.coarse, this.fine, this.texels].reduce(
      (all, { value }) => all + dataOf(value).byteLength,
      0,
    );
  }

  set(light: CubeLight): void {
    this.light = light;
    const { energy, direction } = light,
      out = dataOf(this.sums.value),
      sum = new Float64Array(9);
    for (let b = 0; b < this.blocks; ++b) {
      sum.fill(0);
      for (let t = blockTexels; t-- > 0;) {
        const at = 3 * (b * blockTexels + t);
        for (let c = 0; c < 3; ++c)
          for (let k = 0; k < 3; ++k) out[4 * (at + c) + k] = sum[3 * c + k]! += energy[at + c]! * direction[at + k]!;
      }
    }
    this.sums.value.needsUpdate = true;
    if (this.isGlossy) this.fillGloss();
  }

  /** From now on what glossy materials look up is there as well. */
  gloss(): void {
    if (this.isGlossy) return;
    this.isGlossy = true;
    for (const of of [this.coarse, this.fine, this.texels]) of.value.dispose();
    this.fine.value = texture('lambent block fine nodes', 3 * fineNodes * fineNodes, this.blocks);
    this.coarse.value = texture('lambent block nodes', 3 * nodes * nodes, this.blocks);
    this.texels.value = texture('lambent block texels', 2 * blockTexels, this.blocks);
    if (this.light) this.fillGloss();
  }

  private fillGloss(): void {
    const { energy, direction } = this.light!,
      texels = dataOf(this.texels.value);
    for (let i = 0; i < energy.length; i += 3)
      for (let k = 0; k < 3; ++k) {
        texels[(8 * i) / 3 + k] = direction[i + k]!;
        texels[(8 * i) / 3 + 4 + k] = energy[i + k]!;
      }
    this.fold(dataOf(this.coarse.value), nodes, cardinalFunctions(nodes));
    const polynomials = new Float64Array(fineNodes * blockSide),
      fine = dataOf(this.fine.value);
    for (let i = 0; i < polynomials.length; ++i)
      polynomials[i] = fineCardinal(Math.floor(i / blockSide), (i % blockSide) + 0.5);
    this.fold(fine, fineNodes, polynomials);
    const largest = (texel: number): number => Math.max(energy[texel]!, energy[texel + 1]!, energy[texel + 2]!);
    let all = 0;
    for (let i = 0; i < energy.length; i += 3) all += largest(i);
    for (let b = 0; b < this.blocks; ++b) {
      let most = 0;
      for (let t = 0; t < blockTexels; ++t) most = Math.max(most, largest(3 * (b * blockTexels + t)));
      fine[12 * b * fineNodes * fineNodes + 3] = most > sharpShare * all ? 1 : 0;
    }
    for (const of of [this.coarse, this.fine, this.texels]) of.value.needsUpdate = true;
  }

  /** Energy times direction times the cardinal functions of so many nodes a side, along columns and then rows. */
  private fold(out: Float32Array, side: number, cardinal: Float64Array): void {
    const { energy, direction } = this.light!,
      along = new Float64Array(9 * side);
    out.fill(0);
    for (let b = 0; b < this.blocks; ++b)
      for (let y = 0; y < blockSide; ++y) {
        along.fill(0);
        let isDark = true;
        for (let x = 0; x < blockSide; ++x) {
          const from = 3 * (b * blockTexels + y * blockSide + x);
          for (let c = 0; c < 3; ++c) {
            const e = energy[from + c]!;
            if (e === 0) continue;
            isDark = false;
            for (let k = 0; k < 3; ++k) {
              const m = e * direction[from + k]!;
              for (let i = 0; i < side; ++i) along[9 * i + 3 * c + k]! += cardinal[i * blockSide + x]! * m;
            }
          }
        }
        if (isDark) continue;
        for (let j = 0; j < side; ++j) {
          const w = cardinal[j * blockSide + y]!;
          for (let i = 0; i < side; ++i)
            for (let m = 0; m < 9; ++m)
              out[4 * (3 * ((b * side + j) * side + i) + Math.floor(m / 3)) + (m % 3)]! += w * along[9 * i + m]!;
        }
      }
  }

  dispose(): void {
    for (const of of [this.sums, this.coarse, this.fine, this.texels]) of.value.dispose();
  }
}
