// Where direct light of leaves is looked at (bake/surfels.h, places_of_leaf): several places that a leaf stands for, so
// that their mean is what lies on its area, however near a lamp or a shadow's edge.
import type { Surfels } from './indirect_file.js';
import { frameAbout, hash, sobolOwen, squareToDisk } from './keyed_random.js';
import type { Rays } from './rays.js';

/** What rays meet: nine numbers a triangle each, and which of the surfels' materials it is, -1 for none of them. */
export interface SceneTriangles {
  positions: Float32Array;
  normals: Float32Array;
  materials: Int32Array;
}

const alike = 0.5, // cosine between normals of places that stand for one another
  apart = 3, // what lies beside a plane counts as so much farther
  reachShare = 0.8,
  triesAPlace = 3,
  rounding = 4e-7;

/** How far rays begin above a surface at (x, y, z). */
export const liftAt = (x: number, y: number, z: number, diagonal: number): number =>
  rounding * (Math.max(Math.abs(x), Math.abs(y), Math.abs(z)) + diagonal);

/** Six numbers a place: where rays to lamps begin, and the normal there. */
export type Places = Float64Array;

export class LeafPlaces {
  readonly leaves: number;
  readonly spacing: number;
  private readonly side: number; // of a cell; not so small that neighbours cannot be told apart
  private readonly heads: Int32Array;
  private readonly nexts: Int32Array;
  private readonly surfelDiagonal: number;
  private readonly found = new Float64Array(6);
  private readonly frame = new Float64Array(6);
  private readonly point: [number, number] = [0, 0];

  constructor(
    readonly rays: Rays,
    private readonly triangles: SceneTriangles,
    private readonly surfels: Surfels,
  ) {
    const n = (this.leaves = surfels.areas.length);
    this.spacing = surfels.spacings.at(-1)!;
    this.side = Math.max(this.spacing, surfels.positions.reduce((most, x) => Math.max(most, Math.abs(x)), 0) * 1e-9);
    let size = 64;
    while (size < 2 * n) size *= 2;
    this.heads = new Int32Array(size).fill(-1);
    this.nexts = new Int32Array(n);
    const low = [Infinity, Infinity, Infinity],
      high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < n; ++i) {
      const [x, y, z] = surfels.positions.subarray(3 * i, 3 * i + 3) as unknown as [number, number, number],
        head = this.headOf(this.cell(x), this.cell(y), this.cell(z));
      this.nexts[i] = this.heads[head]!;
      this.heads[head] = i;
      [x, y, z].forEach((p, k) => {
        low[k] = Math.min(low[k]!, p);
        high[k] = Math.max(high[k]!, p);
      });
    }
    this.surfelDiagonal = Math.hypot(...low.map((l, k) => high[k]! - l));
  }

  private cell(x: number): number {
    // Places far away have no surfel near them.
    return Math.floor(Math.min(Math.max(x / this.side, -1e12), 1e12));
  }
  private headOf(x: number, y: number, z: number): number {
    return (Math.imul(x, 73856093) ^ Math.imul(y, 19349663) ^ Math.imul(z, 83492791)) & (this.heads.length - 1);
  }

  /** The nearest leaf that can stand for a place: of its own material; of any, farther away. */
  leafAt(x: number, y: number, z: number, nx: number, ny: number, nz: number, material: number): number {
    for (const [reach, same] of [
      [1, material >= 0],
      [1.5, false],
      [4, false],
    ] as const) {
      const leaf = this.nearest(x, y, z, nx, ny, nz, same ? material : -1, reach * this.spacing);
      if (leaf >= 0) return leaf;
    }
    return -1;
  }
  private nearest(
    x: number,
    y: number,
    z: number,
    nx: number,
    ny: number,
    nz: number,
    material: number,
    reach: number,
  ): number {
    const { positions: p, normals: m, materials } = this.surfels;
    let best = -1,
      least = reach;
    for (let cz = this.cell(z - reach); cz <= this.cell(z + reach); ++cz)
      for (let cy = this.cell(y - reach); cy <= this.cell(y + reach); ++cy)
        for (let cx = this.cell(x - reach); cx <= this.cell(x + reach); ++cx)
          for (let i = this.heads[this.headOf(cx, cy, cz)]!; i >= 0; i = this.nexts[i]!) {
            if (material >= 0 && materials[i] !== material) continue;
            const at = 3 * i,
              mx = m[at]!,
              my = m[at + 1]!,
              mz = m[at + 2]!;
            if (nx * mx + ny * my + nz * mz < alike) continue;
            const dx = p[at]! - x,
              dy = p[at + 1]! - y,
              dz = p[at + 2]! - z,
              length = Math.hypot(nx + mx, ny + my, nz + mz),
              off = (dx * (nx + mx) + dy * (ny + my) + dz * (nz + mz)) / length,
              distance = Math.sqrt(Math.max(dx * dx + dy * dy + dz * dz + (apart * apart - 1) * off * off, 0));
            if (distance < least) [best, least] = [i, distance];
          }
    return best;
  }

  /** What is at the rays' last hit, into `found`; its material. */
  private surfaceHit(): number {
    const { rays, triangles, found } = this,
      { u, v } = rays,
      w = 1 - u - v,
      at = 9 * rays.triangle,
      p = triangles.positions,
      n = triangles.normals;
    for (let k = 0; k < 3; ++k) {
      found[k] = w * p[at + k]! + u * p[at + 3 + k]! + v * p[at + 6 + k]!;
      found[3 + k] = w * n[at + k]! + u * n[at + 3 + k]! + v * n[at + 6 + k]!;
    }
    const ax = p[at + 3]! - p[at]!,
      ay = p[at + 4]! - p[at + 1]!,
      az = p[at + 5]! - p[at + 2]!,
      bx = p[at + 6]! - p[at]!,
      by = p[at + 7]! - p[at + 1]!,
      bz = p[at + 8]! - p[at + 2]!;
    const face = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx] as const;
    let length = Math.hypot(found[3]!, found[4]!, found[5]!);
    if (!(length > 1e-20)) {
      found.set(face, 3);
      length = Math.hypot(...face) || 1;
    }
    const onFace = found[3]! * face[0] + found[4]! * face[1] + found[5]! * face[2] >= 0;
    const sign = (onFace ? 1 : -1) * (rays.front ? 1 : -1);
    for (let k = 3; k < 6; ++k) found[k]! *= sign / length;
    return triangles.materials[rays.triangle]!;
  }

  /** The surfel itself, lifted. */
  own(leaf: number, out: Places): void {
    const { positions: p, normals: n } = this.surfels,
      at = 3 * leaf,
      lift = liftAt(p[at]!, p[at + 1]!, p[at + 2]!, this.rays.diagonal);
    for (let k = 0; k < 3; ++k) {
      out[k] = p[at + k]! + n[at + k]! * lift;
      out[3 + k] = n[at + k]!;
    }
  }

  /**
   * Up to `most` places that it is the leaf of; the surfel itself where none else is found. Returns how many. A way
   * from a nearer surfel is not looked for, as bakes do: a place that rays find is seen from this leaf.
   */
  find(leaf: number, most: number, out: Places): number {
    const { rays, surfels, frame, point, found } = this,
      at = 3 * leaf,
      { positions: p, normals: n } = surfels,
      x = p[at]!,
      y = p[at + 1]!,
      z = p[at + 2]!,
      nx = n[at]!,
      ny = n[at + 1]!,
      nz = n[at + 2]!;
    const reach = reachShare * this.spacing,
      lift = liftAt(x, y, z, this.surfelDiagonal);
    rays.closest(x + nx * lift, y + ny * lift, z + nz * lift, nx, ny, nz, reach);
    const height = 0.5 * Math.min(reach, rays.distance),
      fx = x + nx * height,
      fy = y + ny * height,
      fz = z + nz * height;
    frameAbout(nx, ny, nz, frame);
    const key = hash(0x1eaf, leaf);
    let count = 0;
    for (let k = 0; k < triesAPlace * most && count < most; ++k) {
      sobolOwen(k, key, point);
      squareToDisk(point);
      const a = point[0] * reach,
        b = point[1] * reach,
        sx = frame[0]! * a + frame[3]! * b,
        sy = frame[1]! * a + frame[4]! * b,
        sz = frame[2]! * a + frame[5]! * b,
        far = Math.hypot(sx, sy, sz);
      if (far > 0 && rays.meets(fx, fy, fz, sx / far, sy / far, sz / far, far)) continue;
      if (rays.closest(fx + sx, fy + sy, fz + sz, -nx, -ny, -nz, 2 * height + reach) < 0) continue;
      const material = this.surfaceHit(),
        px = found[0]!,
        py = found[1]!,
        pz = found[2]!,
        mx = found[3]!,
        my = found[4]!,
        mz = found[5]!;
      if (this.leafAt(px, py, pz, mx, my, mz, material) !== leaf) continue;
      const up = liftAt(px, py, pz, rays.diagonal),
        to = 6 * count++;
      out[to] = px + mx * up;
      out[to + 1] = py + my * up;
      out[to + 2] = pz + mz * up;
      out.set(found.subarray(3), to + 3);
    }
    if (count > 0) return count;
    this.own(leaf, out);
    return 1;
  }
}
