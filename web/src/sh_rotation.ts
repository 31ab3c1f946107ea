// Rotation of spherical harmonics of any order, (Rf)(s) = f(R^-1 s): one dense block a band. Follows: J. Ivanic and K.
// Ruedenberg, "Rotation matrices for real spherical harmonics. Direct determination by recursion", J. Phys. Chem. 100
// (1996) with the corrections of 102 (1998). Their harmonics lack the Condon-Shortley sign: element (m, n) takes
// (-1)^(m+n) at the end.
import { shCount } from './sh.js';

/** Blocks of bands 0 .. order-1, row-major, one after another. */
export interface ShRotation {
  order: number;
  blocks: Float64Array;
}

/** A block of band l, addressed by m, n in [-l, l]. */
class Block {
  readonly values: Float64Array;
  constructor(readonly l: number) {
    this.values = new Float64Array((2 * l + 1) ** 2);
  }
  at(m: number, n: number): number {
    return this.values[(m + this.l) * (2 * this.l + 1) + n + this.l]!;
  }
  set(m: number, n: number, value: number): void {
    this.values[(m + this.l) * (2 * this.l + 1) + n + this.l] = value;
  }
}

/** P of their table 2: products of the first band with the band below. */
function p(i: number, a: number, n: number, l: number, first: Block, below: Block): number {
  if (n === l) return first.at(i, 1) * below.at(a, l - 1) - first.at(i, -1) * below.at(a, 1 - l);
  if (n === -l) return first.at(i, 1) * below.at(a, 1 - l) + first.at(i, -1) * below.at(a, l - 1);
  return first.at(i, 0) * below.at(a, n);
}

function element(l: number, m: number, n: number, first: Block, below: Block): number {
  const am = Math.abs(m),
    isZero = m === 0 ? 1 : 0;
  const denominator = Math.abs(n) < l ? (l + n) * (l - n) : 2 * l * (2 * l - 1);
  const u = Math.sqrt(((l + m) * (l - m)) / denominator);
  const v = 0.5 * Math.sqrt(((1 + isZero) * (l + am - 1) * (l + am)) / denominator) * (1 - 2 * isZero);
  const w = -0.5 * Math.sqrt(((l - am - 1) * (l - am)) / denominator) * (1 - isZero);
  const P = (i: number, a: number): number => p(i, a, n, l, first, below);
  let sum = 0;
  if (u !== 0) sum += u * P(0, m);
  if (v !== 0) {
    if (m === 0) sum += v * (P(1, 1) + P(-1, -1));
    else if (m > 0) sum += v * (m === 1 ? P(1, 0) * Math.SQRT2 : P(1, m - 1) - P(-1, 1 - m));
    else sum += v * (m === -1 ? P(-1, 0) * Math.SQRT2 : P(1, m + 1) + P(-1, -m - 1));
  }
  if (w !== 0) sum += w * (m > 0 ? P(1, m + 1) + P(-1, -m - 1) : P(1, m - 1) - P(-1, 1 - m));
  return sum;
}

/** R is row-major, 9 numbers: R[3 i + j] takes component j to component i. */
export function makeShRotation(order: number, R: ArrayLike<number>): ShRotation {
  let total = 0;
  for (let l = 0; l < order; ++l) total += (2 * l + 1) ** 2;
  const blocks = new Float64Array(total);
  const axis = [1, 2, 0]; // m = -1, 0, 1 are y, z, x
  const first = new Block(1);
  for (let m = -1; m <= 1; ++m) for (let n = -1; n <= 1; ++n) first.set(m, n, R[3 * axis[m + 1]! + axis[n + 1]!]!);
  let band = new Block(0),
    at = 0;
  band.set(0, 0, 1);
  for (let l = 0; l < order; ++l) {
    if (l === 1) band = first;
    if (l > 1) {
      const next = new Block(l);
      for (let m = -l; m <= l; ++m) for (let n = -l; n <= l; ++n) next.set(m, n, element(l, m, n, first, band));
      band = next;
    }
    for (let m = -l; m <= l; ++m)
      for (let n = -l; n <= l; ++n) blocks[at++] = (m + n) % 2 ? -band.at(m, n) : band.at(m, n);
  }
  return { order, blocks };
}

/** Rotates RGB coefficients, [coefficient][3]; `out` is another array of order^2 * 3. */
export function rotateSh(rotation: ShRotation, light: ArrayLike<number>, out: Float64Array | Float32Array): void {
  if (light.length < 3 * shCount(rotation.order)) throw new RangeError('the light has fewer bands than the rotation');
  let at = 0;
  for (let l = 0; l < rotation.order; ++l) {
    const n = 2 * l + 1,
      base = l * l;
    for (let row = 0; row < n; ++row, at += n) {
      let r = 0,
        g = 0,
        b = 0;
      for (let k = 0; k < n; ++k) {
        const f = rotation.blocks[at + k]!,
          i = 3 * (base + k);
        r += f * light[i]!;
        g += f * light[i + 1]!;
        b += f * light[i + 2]!;
      }
      const o = 3 * (base + row);
      out[o] = r;
      out[o + 1] = g;
      out[o + 2] = b;
    }
  }
}
