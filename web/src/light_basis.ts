// Lobes of light beside harmonics (docs/light-bases.md): columns that are functions of the angle to an axis, which
// stand where they were baked. Light has coefficients c = G^-1 q of all columns, q_i the integral of light times
// column i and G_ij that of two columns: as basis/directional.h and light/project.h.
import { LambentError } from './errors.js';
import { evaluateSh, maxShOrder, shBand, shCount } from './sh.js';
import { makeShRotation, rotateSh } from './sh_rotation.js';
import { pseudoInverse } from './symmetric.js';

export const lobeKinds = ['cosine_power', 'von_mises_fisher', 'compact', 'band_limited'] as const;
export type LobeKind = (typeof lobeKinds)[number];

export interface LightLobe {
  /** Unit. */
  axis: readonly [number, number, number];
  sharpness: number;
}

/** At an angle of this cosine to the axis; at most 1. */
export function lobeAt(kind: LobeKind, s: number, cosine: number): number {
  switch (kind) {
    case 'cosine_power':
      return cosine > 0 ? cosine ** s : 0;
    case 'von_mises_fisher':
      return Math.exp(s * (cosine - 1));
    case 'compact':
      return Math.max(0, 1 - (s * (1 - cosine)) / 3) ** 3;
    case 'band_limited':
      return evaluateLegendre(
        Array.from({ length: s }, (_, l) => (2 * l + 1) / (s * s)),
        cosine,
      );
  }
}

/** Makes the integral of the lobe's square 1. */
export function lobeScale(kind: LobeKind, s: number): number {
  const whole = 2 * Math.PI;
  switch (kind) {
    case 'cosine_power':
      return Math.sqrt((2 * s + 1) / whole);
    case 'von_mises_fisher':
      return Math.sqrt((2 * s) / (whole * -Math.expm1(-4 * s)));
    case 'compact':
      return Math.sqrt((7 * s) / (3 * whole));
    case 'band_limited':
      return s / Math.sqrt(2 * whole);
  }
}

/** The angle beyond which there is nothing of it, or less than a part in 10^6 of its peak and of its integral. */
export function lobeReach(kind: LobeKind, s: number): number {
  switch (kind) {
    case 'cosine_power':
      return Math.acos(Math.exp(-14 / s));
    case 'von_mises_fisher':
      return Math.acos(Math.max(-1, 1 - 14 / s));
    case 'compact':
      return Math.acos(Math.max(-1, 1 - 3 / s));
    case 'band_limited':
      return Math.PI;
  }
}

/** The sum over l of c[l] P_l(x). */
export function evaluateLegendre(c: ArrayLike<number>, x: number): number {
  let p0 = 1,
    p1 = x,
    sum = 0;
  for (let l = 0; l < c.length; ++l) {
    sum += c[l]! * p0;
    const next = ((2 * l + 3) * x * p1 - (l + 1) * p0) / (l + 2);
    p0 = p1;
    p1 = next;
  }
  return sum;
}

/** Gauss's nodes and weights over [from, to]; exact for polynomials of degree 2 count - 1. */
export function gaussLegendre(count: number, from: number, to: number): { x: number; weight: number }[] {
  const half = (to - from) / 2,
    middle = (from + to) / 2;
  return Array.from({ length: count }, (_, i) => {
    let x = Math.cos((Math.PI * (i + 0.75)) / (count + 0.5)),
      slope = 1;
    for (let step = 0; step < 100; ++step) {
      let p0 = 1,
        p1 = x;
      for (let l = 1; l < count; ++l) [p0, p1] = [p1, ((2 * l + 1) * x * p1 - l * p0) / (l + 1)];
      slope = (count * (x * p1 - p0)) / (x * x - 1);
      const change = p1 / slope;
      x -= change;
      if (Math.abs(change) < 1e-15) break;
    }
    return { x: middle - half * x, weight: (2 * half) / ((1 - x * x) * slope * slope) };
  });
}

/** Legendre moments of the unscaled lobe, the integral over [-1, 1] of it times P_l, l < count. */
export function lobeMoments(kind: LobeKind, s: number, count: number): Float64Array {
  const I = new Float64Array(count);
  if (kind === 'band_limited') return I.fill(2 / (s * s), 0, Math.min(count, s));
  if (kind === 'compact') {
    for (const { x, weight } of gaussLegendre((count >> 1) + 2, 1 - 3 / s, 1)) {
      const value = weight * lobeAt(kind, s, x);
      let p0 = 1,
        p1 = x;
      for (let l = 0; l < count; ++l) {
        I[l]! += value * p0;
        const next = ((2 * l + 3) * x * p1 - (l + 1) * p0) / (l + 2);
        p0 = p1;
        p1 = next;
      }
    }
    return I;
  }
  if (kind === 'cosine_power') {
    I[0] = 1 / (s + 1);
    if (count > 1) I[1] = 1 / (s + 2);
    for (let l = 2; l < count; ++l) I[l] = (I[l - 2]! * (s - l + 2)) / (s + l + 1);
    return I;
  }
  // 2 exp(-s) times the modified spherical Bessel functions i_l(s): downwards, from where they are negligible (Miller).
  let above = 0,
    at = 1e-280;
  for (let l = Math.max(count, Math.floor(s)) + 40 + Math.floor(8 * Math.sqrt(s)); l > 0; --l) {
    const below = above + ((2 * l + 1) / s) * at;
    above = at;
    at = below;
    if (l - 1 < count) I[l - 1] = at;
    if (at <= 1e200) continue;
    above *= 1e-200;
    at *= 1e-200;
    for (let k = l - 1; k < count; ++k) I[k]! *= 1e-200;
  }
  const scale = -Math.expm1(-2 * s) / s / I[0]!;
  return I.map((v) => v * scale);
}

const dot = (a: readonly number[], b: readonly number[]): number => a[0]! * b[0]! + a[1]! * b[1]! + a[2]! * b[2]!;

// Terms of the sum over l for two lobes (basis/directional.cpp).
const momentsNeeded = (kind: LobeKind, sharpest: number): number =>
  kind === 'band_limited' ? maxShOrder : 640 + Math.floor((kind === 'compact' ? 30 : 6) * Math.sqrt(sharpest));

/** The integral of the product of two unscaled lobes, by their moments. */
function lobeProduct(kind: LobeKind, p: LightLobe, q: LightLobe, Ip: Float64Array, Iq: Float64Array): number {
  if (kind === 'von_mises_fisher') {
    // exp((s a + s' b).d - s - s') is a lobe about the sum.
    const sum = p.sharpness + q.sharpness,
      k = Math.hypot(...[0, 1, 2].map((i) => p.sharpness * p.axis[i]! + q.sharpness * q.axis[i]!));
    return k < 1e-6 ? 4 * Math.PI * Math.exp(-sum) : (2 * Math.PI * Math.exp(k - sum) * -Math.expm1(-2 * k)) / k;
  }
  const x = Math.min(1, Math.max(-1, dot(p.axis, q.axis)));
  if (kind === 'compact' && Math.acos(x) >= lobeReach(kind, p.sharpness) + lobeReach(kind, q.sharpness)) return 0;
  return (
    Math.PI *
    evaluateLegendre(
      Ip.map((v, l) => (2 * l + 1) * v * Iq[l]!),
      x,
    )
  );
}

/** Harmonics of `order`, none where it is 0, and then lobes of unit norm. */
export class LobeBasis {
  /** Moments of each; lobes of one sharpness share them. */
  private readonly moments = new Map<number, Float64Array>();
  private readonly solvers = new Map<number, (q: Float64Array) => Float64Array>();

  constructor(
    readonly order: number,
    readonly kind: LobeKind,
    readonly lobes: readonly LightLobe[],
  ) {}

  get count(): number {
    return shCount(this.order) + this.lobes.length;
  }

  /** Bands that all of it lies in, where it is lobes alone that are of so many; else 0: it holds more than bands do. */
  get bands(): number {
    if (this.order > 0 || this.kind !== 'band_limited') return 0;
    return Math.max(...this.lobes.map(({ sharpness }) => sharpness));
  }

  momentsOf(sharpness: number): Float64Array {
    const count = momentsNeeded(this.kind, Math.max(...this.lobes.map((lobe) => lobe.sharpness)));
    const found = this.moments.get(sharpness) ?? lobeMoments(this.kind, sharpness, count);
    this.moments.set(sharpness, found);
    return found;
  }

  /** G of `harmonics` and the scaled lobes, row-major. */
  gram(order: number): Float64Array {
    const { kind, lobes } = this,
      harmonics = shCount(order),
      n = harmonics + lobes.length,
      G = new Float64Array(n * n),
      y = new Float64Array(Math.max(1, harmonics)),
      none = new Float64Array(0);
    const set = (i: number, j: number, value: number): void => void (G[i * n + j] = G[j * n + i] = value);
    const momentsOf = (lobe: LightLobe): Float64Array =>
      kind === 'von_mises_fisher' ? none : this.momentsOf(lobe.sharpness);
    for (let i = 0; i < n; ++i) set(i, i, 1);
    lobes.forEach((p, k) => {
      const scale = lobeScale(kind, p.sharpness);
      if (order > 0) {
        const I = lobeMoments(kind, p.sharpness, order);
        evaluateSh(order, ...p.axis, y);
        for (let i = 0; i < harmonics; ++i) set(i, harmonics + k, 2 * Math.PI * scale * I[shBand(i)]! * y[i]!);
      }
      lobes.slice(0, k).forEach((q, j) => {
        const product = lobeProduct(kind, p, q, momentsOf(p), momentsOf(q));
        set(harmonics + k, harmonics + j, scale * lobeScale(kind, q.sharpness) * product);
      });
    });
    return G;
  }

  /**
   * Of lobes that are `bands` in other words: coefficients, [lobe][3], of light in so many bands, [coefficient][3],
   * that was turned by R, row-major.
   */
  ofBands(light: ArrayLike<number>, R: ArrayLike<number>): Float64Array {
    const { kind, lobes, bands } = this,
      sh = new Float64Array(3 * shCount(bands)),
      y = new Float64Array(shCount(bands)),
      out = new Float64Array(3 * lobes.length);
    rotateSh(makeShRotation(bands, R), light, sh);
    for (let c = 0; c < 3; ++c) {
      const q = Float64Array.from(lobes, ({ axis, sharpness: s }) => {
        evaluateSh(s, ...axis, y);
        let value = 0;
        for (let i = 0; i < shCount(s); ++i) value += sh[3 * i + c]! * y[i]!;
        return (value * 4 * Math.PI * lobeScale(kind, s)) / (s * s);
      });
      this.solve(0, q).forEach((v, k) => (out[3 * k + c] = v));
    }
    return out;
  }

  /** Coefficients of harmonics of `order` and the lobes, from the integrals against each. */
  solve(order: number, integrals: Float64Array): Float64Array {
    let solver = this.solvers.get(order);
    if (!solver) this.solvers.set(order, (solver = makeSolver(this.gram(order), shCount(order))));
    return solver(integrals);
  }
}

/**
 * Harmonics are orthonormal, so that G is solved for the lobes alone: S = H - P^T P, by Cholesky. Where lobes are
 * nearly what the others add up to, by G's pseudo-inverse, which leaves out eigenvalues at or below 10^-10 of the
 * greatest.
 */
function makeSolver(G: Float64Array, harmonics: number): (q: Float64Array) => Float64Array {
  const n = Math.sqrt(G.length),
    lobes = n - harmonics,
    P = (i: number, k: number): number => G[i * n + harmonics + k]!,
    L = new Float64Array(lobes * lobes);
  let least = 1;
  for (let i = 0; i < lobes; ++i)
    for (let j = 0; j <= i; ++j) {
      let sum = G[(harmonics + i) * n + harmonics + j]!;
      for (let h = 0; h < harmonics; ++h) sum -= P(h, i) * P(h, j);
      for (let k = 0; k < j; ++k) sum -= L[i * lobes + k]! * L[j * lobes + k]!;
      if (i === j) {
        least = Math.min(least, sum);
        L[i * lobes + i] = Math.sqrt(Math.max(sum, 1e-300));
      } else L[i * lobes + j] = sum / L[j * lobes + j]!;
    }
  if (least < 1e-8) {
    const dual = pseudoInverse(G, n, 1e-10);
    return (q) =>
      Float64Array.from({ length: n }, (_, i) => {
        let sum = 0;
        for (let j = 0; j < n; ++j) sum += dual[i * n + j]! * q[j]!;
        return sum;
      });
  }
  return (q) => {
    const c = Float64Array.from(q),
      x = c.subarray(harmonics);
    for (let i = 0; i < lobes; ++i) {
      for (let h = 0; h < harmonics; ++h) x[i]! -= P(h, i) * q[h]!;
      for (let k = 0; k < i; ++k) x[i]! -= L[i * lobes + k]! * x[k]!;
      x[i]! /= L[i * lobes + i]!;
    }
    for (let i = lobes - 1; i >= 0; --i) {
      for (let k = i + 1; k < lobes; ++k) x[i]! -= L[k * lobes + i]! * x[k]!;
      x[i]! /= L[i * lobes + i]!;
    }
    for (let h = 0; h < harmonics; ++h) for (let k = 0; k < lobes; ++k) c[h]! -= P(h, k) * x[k]!;
    return c;
  };
}

const isKind = (value: unknown): value is LobeKind => lobeKinds.some((kind) => kind === value);

function isSharpness(kind: LobeKind, s: number): boolean {
  if (kind === 'compact') return s >= 1.5 && s <= 1024;
  if (kind === 'band_limited') return s >= 1 && s <= maxShOrder && Number.isInteger(s);
  return s >= (kind === 'cosine_power' ? 1 : 1e-3 * (1 - 1e-6)) && s <= 1e5;
}

/** Lobes of a file's light, beside harmonics of `order`; undefined where it has none. Throws LambentError. */
export function readLobes(
  transfer: { lobes?: unknown; lobeKind?: unknown; [key: string]: unknown },
  order: number,
): LobeBasis | undefined {
  const { lobes, lobeKind } = transfer;
  if (lobes === undefined || (Array.isArray(lobes) && lobes.length === 0)) return undefined;
  if (!Array.isArray(lobes)) throw new LambentError('"lobes" is no list');
  if (!isKind(lobeKind)) throw new LambentError('holds a kind of lobes that this version does not know');
  return new LobeBasis(
    order,
    lobeKind,
    lobes.map((lobe: unknown) => {
      if (!Array.isArray(lobe) || lobe.length !== 4 || !lobe.every((v) => Number.isFinite(v)))
        throw new LambentError('a lobe of light is not four numbers');
      const [x, y, z, sharpness] = lobe as [number, number, number, number],
        length = Math.hypot(x, y, z);
      if (!(Math.abs(length - 1) < 1e-4) || !isSharpness(lobeKind, sharpness))
        throw new LambentError('a lobe of light has no unit axis, or a sharpness out of range');
      return { axis: [x / length, y / length, z / length], sharpness } as const;
    }),
  );
}
