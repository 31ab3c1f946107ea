// Factors (docs/file-format.md, "Transfer matrices"; relight/factors.h): visibility times cosine over pi in harmonics,
// of which the product with the light arrives at a receiver, in its frame and in the basis of its material's map. What
// the light is multiplied by is a matrix, X = W R P V with P_jik = C_ijk the integrals of three harmonics, R the turn
// into the frame and W the incident basis; it is unfolded while loading and drawn as such (matrix.ts).
import { DataUtils } from 'three';
import { block } from './block_texture.js';
import { checkUnfolded, storeHalves } from './clusters.js';
import { LambentError } from './errors.js';
import { readHeader, type TransferHeader } from './header.js';
import type { BakedTransfer, TransferKind, TransferSource } from './kinds.js';
import { gaussLegendre } from './light_basis.js';
import { checkRows, loadMatrix } from './matrix.js';
import { readOutgoing } from './outgoing.js';
import { evaluateSh, shBand, shCount, shIndex } from './sh.js';
import { makeShRotation } from './sh_rotation.js';

/** Bands of a map's incident basis, at most. */
const maxIncidentOrder = 8;

/** m of a harmonic. */
const azimuthal = (index: number): number => index - shIndex(shBand(index), 0);
/** Harmonics at height z along the meridian of +x: of -m, those of m. */
function alongMeridian(order: number, z: number): Float64Array {
  const y = new Float64Array(shCount(order));
  evaluateSh(order, Math.sqrt(Math.max(0, 1 - z * z)), 0, z, y);
  return y.map((v, i) => (azimuthal(i) < 0 ? y[shIndex(shBand(i), -azimuthal(i))]! : v));
}
/** What of harmonic m goes around: cos, and sin of -m. */
const around = (m: number, phi: number): number => (m < 0 ? Math.sin(-m * phi) : Math.cos(m * phi));

/** The integrals of three harmonics that are not 0: C_ijk of order a, b and c. */
export interface Tripling {
  i: Uint16Array;
  j: Uint16Array;
  k: Uint16Array;
  value: Float64Array;
}
export function makeTripling(a: number, b: number, c: number): Tripling {
  // Exact: polynomials in z of 2 count - 1 degrees, and frequencies below `steps`.
  const nodes = gaussLegendre(Math.ceil((a + b + c) / 2), -1, 1).map(({ x, weight }) => ({
      weight,
      y: alongMeridian(Math.max(a, b, c), x),
    })),
    steps = a + b + c,
    circles = new Map<string, number>();
  const circle = (m1: number, m2: number, m3: number): number => {
    const key = `${m1} ${m2} ${m3}`;
    let sum = circles.get(key);
    if (sum === undefined) {
      sum = 0;
      for (let t = 0; t < steps; ++t) {
        const phi = (2 * Math.PI * t) / steps;
        sum += ((2 * Math.PI) / steps) * around(m1, phi) * around(m2, phi) * around(m3, phi);
      }
      circles.set(key, sum);
    }
    return sum;
  };
  const found: number[][] = [];
  for (let i = 0; i < shCount(a); ++i)
    for (let j = 0; j < shCount(b); ++j) {
      const [l1, l2, m1, m2] = [shBand(i), shBand(j), azimuthal(i), azimuthal(j)];
      for (let l = Math.abs(l1 - l2); l <= Math.min(l1 + l2, c - 1); l += 2)
        for (const m of new Set([m1 + m2, m1 - m2, -m1 - m2, m2 - m1])) {
          if (Math.abs(m) > l) continue;
          const turn = circle(m1, m2, m);
          if (Math.abs(turn) < 1e-12) continue;
          const k = shIndex(l, m);
          let value = 0;
          for (const { weight, y } of nodes) value += weight * y[i]! * y[j]! * y[k]!;
          if (Math.abs(value * turn) > 1e-12) found.push([i, j, k, value * turn]);
        }
    }
  const indices = (n: number): Uint16Array => Uint16Array.from(found, (entry) => entry[n]!);
  return { i: indices(0), j: indices(1), k: indices(2), value: Float64Array.from(found, (entry) => entry[3]!) };
}

/**
 * Takes harmonics to the incident basis (basis/cosine_basis.h), row-major and lower: functions that are orthonormal
 * over the upper hemisphere under cos / pi, each of the harmonics up to its own.
 */
export function cosineBasis(order: number): Float64Array {
  const n = shCount(order),
    C = new Float64Array(n * n),
    W = new Float64Array(n * n);
  for (const { x, weight } of gaussLegendre(order + 1, 0, 1)) {
    const y = alongMeridian(order, x);
    for (let i = 0; i < n; ++i)
      for (let j = 0; j <= i; ++j)
        if (azimuthal(i) === azimuthal(j)) C[i * n + j]! += (azimuthal(i) === 0 ? 2 : 1) * weight * x * y[i]! * y[j]!;
  }
  // G = C C^T, in place; W = C^-1.
  for (let i = 0; i < n; ++i)
    for (let j = 0; j <= i; ++j) {
      let sum = C[i * n + j]!;
      for (let k = 0; k < j; ++k) sum -= C[i * n + k]! * C[j * n + k]!;
      C[i * n + j] = i === j ? Math.sqrt(sum) : sum / C[j * n + j]!;
    }
  for (let j = 0; j < n; ++j) {
    W[j * n + j] = 1 / C[j * n + j]!;
    for (let i = j + 1; i < n; ++i) {
      let sum = 0;
      for (let k = j; k < i; ++k) sum -= C[i * n + k]! * W[k * n + j]!;
      W[i * n + j] = sum / C[i * n + i]!;
    }
  }
  return W;
}

export interface Factors {
  /** Bands of the light, and of the incident basis. */
  light: number;
  incident: number;
  receivers: number;
  /** [block][(light + incident - 1)^2][16] */
  visibility: Float32Array;
  /** Of each receiver two texels: tangent and normal (outgoing.ts). */
  frames: Float32Array;
}

/** out[o ..] += f in[i ..]. */
function addRow(out: Float64Array, o: number, f: number, from: Float64Array, i: number, count: number): void {
  for (let c = 0; c < count; ++c) out[o + c]! += f * from[i + c]!;
}

/** [block][incident^2][light^2][16], half floats: what the file would have of the matrix. */
export function unfoldFactors({ light, incident, receivers, visibility, frames }: Factors): Uint16Array {
  const { i, j, k, value } = makeTripling(light, incident, light + incident - 1),
    W = cosineBasis(incident),
    to = Uint32Array.from(i, (column, e) => j[e]! * shCount(light) + column),
    [I, J, K] = [light, incident, light + incident - 1].map(shCount) as [number, number, number],
    out = new Uint16Array(Math.ceil(receivers / block) * I * J * block),
    [product, turned, values] = [0, 1, 2].map(() => new Float64Array(I * J)) as [
      Float64Array,
      Float64Array,
      Float64Array,
    ],
    halves = new Float32Array(I * J);
  const own = new Float64Array(9),
    frame = new Float64Array(9),
    V = new Float64Array(K);
  let blocks: Float64Array = new Float64Array(0);
  for (let r = 0; r < receivers; ++r) {
    const from = Math.floor(r / block) * K * block + (r % block);
    for (let n = 0; n < K; ++n) V[n] = visibility[from + n * block]!;
    product.fill(0);
    for (let e = 0; e < value.length; ++e) product[to[e]!]! += value[e]! * V[k[e]!]!;
    // Receivers of a flat surface follow one another, and share a frame.
    for (let n = 0; n < 3; ++n) {
      own[n] = frames[8 * r + n]!;
      own[6 + n] = frames[8 * r + 4 + n]!;
    }
    for (let n = 0; n < 3; ++n) {
      const [p, q] = [(n + 1) % 3, (n + 2) % 3] as [number, number];
      own[3 + n] = own[6 + p]! * own[q]! - own[6 + q]! * own[p]!;
    }
    if (r === 0 || own.some((v, n) => v !== frame[n])) {
      frame.set(own);
      blocks = makeShRotation(incident, own).blocks;
    }
    turned.fill(0);
    for (let l = 0, at = 0; l < incident; ++l)
      for (let row = l * l; row < (l + 1) ** 2; ++row)
        for (let n = l * l; n < (l + 1) ** 2; ++n) addRow(turned, row * I, blocks[at++]!, product, n * I, I);
    values.fill(0);
    for (let row = 0; row < J; ++row)
      for (let n = 0; n <= row; ++n) {
        const w = W[row * J + n]!;
        if (w !== 0) addRow(values, row * I, w, turned, n * I, I);
      }
    halves.set(values);
    storeHalves(halves, out, r);
  }
  return out;
}

async function load(source: TransferSource): Promise<BakedTransfer> {
  const header = readHeader(source.extension),
    { outgoing, rows } = readOutgoing(source.extension.transfer),
    { order: incident } = outgoing,
    light = header.order - incident + 1,
    { receivers } = header;
  if (outgoing.kind !== 'map' || incident > maxIncidentOrder || light < 1 || header.channels !== 1 || header.lobes)
    throw new LambentError(
      'holds factors of too few bands, or with a last reflection of another kind, or of more than one channel',
    );
  const matrix: TransferHeader = { ...header, order: light, columns: shCount(light), precision: 'half' };
  checkRows(matrix, rows);
  checkUnfolded(receivers, rows * matrix.columns);
  return loadMatrix(source, matrix, 'factors', async (last) => {
    const bytes = await source.bufferView(header.bufferView),
      length = Math.ceil(receivers / block) * shCount(header.order) * block,
      isHalf = header.precision === 'half';
    if (bytes.byteLength !== length * (isHalf ? 2 : 4))
      throw new LambentError(
        `holds ${bytes.byteLength} bytes of transfer where its header makes ${length * (isHalf ? 2 : 4)}`,
      );
    const visibility = isHalf
      ? Float32Array.from(new Uint16Array(bytes), (bits) => DataUtils.fromHalfFloat(bits))
      : new Float32Array(bytes);
    // Unfolded it would be the greatest half float.
    if (visibility.some((v) => !Number.isFinite(v))) throw new LambentError('holds factors that are not finite');
    const frames = last.frames.image.data as Float32Array,
      values = unfoldFactors({ light, incident, receivers, visibility, frames });
    return { values: values.buffer as ArrayBuffer, fileBytes: bytes.byteLength };
  });
}

export const factorsKind: TransferKind = { name: 'factors', load };
