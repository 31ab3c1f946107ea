// Direct light at the leaves: of lamps that move a scalar a leaf each, so that colours and switches take no ray; of the
// scene's own glowing surfaces a scalar a leaf and name. Worked through in pieces, as far as a frame has time.
import { hash, sobolOwen } from './keyed_random.js';
import type { LeafPlaces } from './leaf_places.js';
import { directLight, isSamePlace, keyOf, type PlacedLamp } from './moving_lamps.js';

const places = 4, // that a leaf is lit at, where there is time
  placesNear = 64, // where a lamp is within three spacings
  near = 3,
  lampSamples = 8, // towards a sphere, over a leaf's places
  glowSamples = 8, // towards each name that glows, at each place
  piece = 64; // leaves between two looks at the clock

/** Leaves to come, round and round. */
class Sweep {
  next = 0;
  left = 0;
  go(leaves: number, until: number, run: (leaf: number) => void): void {
    while (this.left > 0) {
      for (let n = Math.min(piece, this.left); n > 0; --n, --this.left) {
        run(this.next);
        this.next = (this.next + 1) % leaves;
      }
      if (performance.now() > until) return;
    }
  }
}

/** Of one lamp: what it gave leaves where it stood last. */
export class LampLight {
  readonly light: Float32Array;
  private fine: Float32Array | undefined; // taken over when it is whole
  private readonly sweep = new Sweep();
  private state: 'coarse' | 'due' | 'fine' | 'done' = 'coarse';

  constructor(
    private readonly leaves: LeafLight,
    private lamp: PlacedLamp,
  ) {
    this.light = new Float32Array(leaves.count);
    this.sweep.left = leaves.count;
  }

  /** Whether it stands elsewhere now, so that light has to be looked for. */
  move(lamp: PlacedLamp): boolean {
    if (isSamePlace(this.lamp, lamp)) return false;
    this.lamp = lamp;
    this.state = 'coarse';
    this.sweep.left = this.leaves.count;
    return true;
  }
  get isCoarse(): boolean {
    return this.state === 'coarse';
  }
  get isDone(): boolean {
    return this.state === 'done';
  }

  /** Whether light that shows has changed; `finely`: and nothing is moving. */
  go(until: number, finely: boolean): boolean {
    const { leaves, lamp, sweep } = this;
    if (this.state === 'coarse') {
      sweep.go(leaves.count, until, (leaf) => (this.light[leaf] = leaves.coarsely(lamp, leaf)));
      if (sweep.left === 0) this.state = 'due';
      return true;
    }
    if (this.state === 'due' && finely) {
      this.state = 'fine';
      this.fine ??= new Float32Array(leaves.count);
      sweep.left = leaves.count;
    }
    if (this.state !== 'fine' || !finely) return false;
    const fine = this.fine!;
    sweep.go(leaves.count, until, (leaf) => (fine[leaf] = leaves.finely(lamp, leaf)));
    if (sweep.left > 0) return false;
    this.light.set(fine);
    this.fine = undefined;
    this.state = 'done';
    return true;
  }
}

/** A triangle that glows, of the scene's own: corners, and what it weighs beside others of its name. */
export interface GlowingTriangle {
  corners: ArrayLike<number>;
  twoSided: boolean;
}
export interface Glow {
  name: string;
  triangles: GlowingTriangle[];
  /** Of each triangle, its radiance; of all of them the largest. */
  radiance: Float32Array;
}

/** Of a name that glows: [leaf][3], exit radiance of white. */
export class GlowLight {
  readonly light: Float32Array;
  private readonly sweep = new Sweep();
  private readonly shares: Float64Array; // rising, of samples
  private readonly point: [number, number] = [0, 0];

  constructor(
    private readonly leaves: LeafLight,
    readonly glow: Glow,
    private readonly seed: number,
  ) {
    this.light = new Float32Array(3 * leaves.count);
    this.sweep.left = leaves.count;
    let sum = 0;
    this.shares = Float64Array.from(glow.triangles, ({ corners }, i) => {
      const brightest = Math.max(...glow.radiance.subarray(3 * i, 3 * i + 3));
      return (sum += areaOf(corners) * brightest);
    });
  }
  get isDone(): boolean {
    return this.sweep.left === 0;
  }
  go(until: number): boolean {
    if (this.sweep.left === 0) return false;
    this.sweep.go(this.leaves.count, until, (leaf) => this.lightLeaf(leaf));
    return this.sweep.left === 0;
  }

  private lightLeaf(leaf: number): void {
    const { leaves, glow, shares, point, light } = this,
      total = shares.at(-1)!,
      { rays } = leaves.places,
      count = leaves.placesOf(leaf),
      from = leaves.found;
    const sum = [0, 0, 0];
    for (let k = 0; k < count; ++k) {
      const [x, y, z, nx, ny, nz] = from.subarray(6 * k, 6 * k + 6) as unknown as number[] as [
        number,
        number,
        number,
        number,
        number,
        number,
      ];
      const key = hash(hash(this.seed, leaf), k);
      for (let s = 0; s < glowSamples; ++s) {
        sobolOwen(s, key, point);
        const target = point[0] * total,
          t = firstAbove(shares, target),
          low = t > 0 ? shares[t - 1]! : 0,
          root = Math.sqrt(Math.min(Math.max((target - low) / (shares[t]! - low), 0), 1)),
          u = 1 - root,
          v = point[1] * root,
          { corners: c, twoSided } = glow.triangles[t]!;
        const to = [0, 1, 2].map((i) => (1 - u - v) * c[i]! + u * c[3 + i]! + v * c[6 + i]!) as [
          number,
          number,
          number,
        ];
        const wx = to[0] - x,
          wy = to[1] - y,
          wz = to[2] - z,
          far = Math.hypot(wx, wy, wz),
          cosine = (nx * wx + ny * wy + nz * wz) / far;
        if (!(cosine > 0)) continue;
        const face = crossOf(c),
          facing = -(face[0] * wx + face[1] * wy + face[2] * wz) / (far * Math.hypot(...face));
        if (!(twoSided ? facing !== 0 : facing > 0)) continue;
        if (rays.meets(x, y, z, wx / far, wy / far, wz / far, far * (1 - 1e-3))) continue;
        const radiance = glow.radiance.subarray(3 * t, 3 * t + 3),
          density = Math.max(...radiance) / total; // of samples, per area
        const weight = (cosine * Math.abs(facing)) / (Math.PI * far * far * density * glowSamples * count);
        for (let i = 0; i < 3; ++i) sum[i]! += weight * radiance[i]!;
      }
    }
    light.set(sum, 3 * leaf);
  }
}

function crossOf(c: ArrayLike<number>): [number, number, number] {
  const a = [0, 1, 2].map((i) => c[3 + i]! - c[i]!) as [number, number, number],
    b = [0, 1, 2].map((i) => c[6 + i]! - c[i]!) as [number, number, number];
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}
export const areaOf = (corners: ArrayLike<number>): number => 0.5 * Math.hypot(...crossOf(corners));

/** The first of rising numbers above a target; the last where none is. */
function firstAbove(rising: Float64Array, target: number): number {
  let low = 0,
    high = rising.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (rising[middle]! > target) high = middle;
    else low = middle + 1;
  }
  return low;
}

export class LeafLight {
  readonly count: number;
  /** Of placesOf(): six numbers a place. */
  readonly found = new Float64Array(6 * placesNear);
  private readonly kept: Float32Array; // [leaf][places][6]: their offsets from the surfel, and normals
  private readonly counts: Uint8Array; // of places that are kept; 0: none yet

  constructor(
    readonly places: LeafPlaces,
    private readonly positions: Float32Array,
  ) {
    this.count = places.leaves;
    this.kept = new Float32Array(6 * places.leaves * placesOfLeaf);
    this.counts = new Uint8Array(places.leaves);
  }

  /** Its places, into `found`; how many. */
  placesOf(leaf: number): number {
    const { found, kept, counts, positions } = this,
      at = 6 * placesOfLeaf * leaf;
    if (counts[leaf] === 0) {
      counts[leaf] = this.places.find(leaf, placesOfLeaf, found);
      for (let i = 0; i < 6 * counts[leaf]; ++i)
        kept[at + i] = i % 6 < 3 ? found[i]! - positions[3 * leaf + (i % 6)]! : found[i]!;
      return counts[leaf];
    }
    for (let i = 0; i < 6 * counts[leaf]!; ++i)
      found[i] = kept[at + i]! + (i % 6 < 3 ? positions[3 * leaf + (i % 6)]! : 0);
    return counts[leaf]!;
  }

  coarsely(lamp: PlacedLamp, leaf: number): number {
    const f = this.found;
    this.places.own(leaf, f);
    return directLight(this.places.rays, lamp, f[0]!, f[1]!, f[2]!, f[3]!, f[4]!, f[5]!, 1, keyOf(leaf, 0));
  }

  finely(lamp: PlacedLamp, leaf: number): number {
    const { found: f, positions: p, places } = this,
      isNear =
        lamp.kind !== 'sun' && Math.hypot(...lamp.place.map((x, k) => x - p[3 * leaf + k]!)) < near * places.spacing,
      count = isNear ? places.find(leaf, placesNear, f) : this.placesOf(leaf),
      samples = Math.max(1, Math.floor(lampSamples / count));
    let sum = 0;
    for (let k = 0; k < count; ++k) {
      const i = 6 * k;
      sum += directLight(
        places.rays,
        lamp,
        f[i]!,
        f[i + 1]!,
        f[i + 2]!,
        f[i + 3]!,
        f[i + 4]!,
        f[i + 5]!,
        samples,
        keyOf(leaf, k),
      );
    }
    return sum / count;
  }
}
const placesOfLeaf = places;
