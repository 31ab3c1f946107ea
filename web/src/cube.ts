// The sphere of directions as the six faces of a cube, each in blocks of 16 x 16 texels, and an environment on it:
// every texel with exactly what it receives. Source: locally-adaptive-products, section 4; the same as basis/cubemap.h
// and light/cube_light.h of the C++ library.
import type { LatLongMap } from './projection.js';
import { texelSolidAngle } from './projection.js';

export const blockSide = 16;
export const blockTexels = 256;
export const maxCube = 256;

export const cubeBlocks = (size: number): number => 6 * (size / blockSide) ** 2;
/** Texels are stored [block][row][column], blocks [face][block row][block column]. */
export function cubeTexel(size: number, face: number, column: number, row: number): number {
  const side = size / blockSide,
    block = (face * side + (row >> 4)) * side + (column >> 4);
  return blockTexels * block + 16 * (row & 15) + (column & 15);
}

/** By face: its axis, and how the direction changes with u and v, both over [-1, 1]. */
const faces = [
  [1, 0, 0, 0, 0, -1, 0, -1, 0],
  [-1, 0, 0, 0, 0, 1, 0, -1, 0],
  [0, 1, 0, 1, 0, 0, 0, 0, 1],
  [0, -1, 0, 1, 0, 0, 0, 0, -1],
  [0, 0, 1, 1, 0, 0, 0, -1, 0],
  [0, 0, -1, -1, 0, 0, 0, -1, 0],
] as const;

/** The unit direction of a place on a face, in texels. */
export function cubeDirection(size: number, face: number, x: number, y: number): [number, number, number] {
  const f = faces[face]!,
    u = (2 * x) / size - 1,
    v = (2 * y) / size - 1;
  const at = (k: number): number => f[k]! + u * f[k + 3]! + v * f[k + 6]!,
    inverse = 1 / Math.sqrt(u * u + v * v + 1);
  return [at(0) * inverse, at(1) * inverse, at(2) * inverse];
}

/** Integrals over each texel. */
export interface CubeLight {
  size: number;
  /** [texel][r, g, b]: of radiance. */
  energy: Float32Array;
  /** [texel][x, y, z]: where in the texel its energy comes from; its centre where it is dark. */
  direction: Float32Array;
}

/** A convex polygon on a face, in texels: a quad, cut by at most two lines a side and once more by each of two. */
class Polygon {
  readonly x = new Float64Array(16);
  readonly y = new Float64Array(16);
  count = 0;

  add(x: number, y: number): void {
    this.x[this.count] = x;
    this.y[this.count++] = y;
  }
  copy({ x, y, count }: Polygon): this {
    for (let i = 0; i < count; ++i) {
      this.x[i] = x[i]!;
      this.y[i] = y[i]!;
    }
    this.count = count;
    return this;
  }
}

/** What of a polygon lies below and above a column's or a row's edge. */
function cut(p: Polygon, alongX: boolean, place: number, low: Polygon, high: Polygon): void {
  low.count = high.count = 0;
  const along = alongX ? p.x : p.y,
    { x, y, count } = p;
  for (let i = 0; i < count; ++i) {
    const j = i + 1 === count ? 0 : i + 1,
      below = along[i]! <= place;
    (below ? low : high).add(x[i]!, y[i]!);
    if (below === along[j]! <= place) continue;
    const t = (place - along[i]!) / (along[j]! - along[i]!),
      atX = alongX ? place : x[i]! + (x[j]! - x[i]!) * t,
      atY = alongX ? y[i]! + (y[j]! - y[i]!) * t : place;
    low.add(atX, atY);
    high.add(atX, atY);
  }
}

const maxParts = 64;

/** Cuts texels of a map along those of a cube. */
class Cutter {
  /** Of the last texel that was cut: texels of the cube, solid angles to scale, directions. */
  readonly texel = new Int32Array(maxParts);
  readonly solidAngle = new Float64Array(maxParts);
  readonly direction = new Float64Array(3 * maxParts);
  count = 0;
  total = 0;
  private readonly whole = new Polygon();
  private readonly right = new Polygon();
  private readonly column = new Polygon();
  private readonly lower = new Polygon();
  private readonly cell = new Polygon();
  private readonly rest = new Polygon();

  constructor(private readonly size: number) {}

  private add(face: number, column: number, row: number, p: Polygon): void {
    if (p.count < 3 || this.count === maxParts) return;
    const { x, y } = p,
      x0 = x[0]!,
      y0 = y[0]!;
    let twice = 0,
      cx = 0,
      cy = 0;
    for (let i = 1; i + 1 < p.count; ++i) {
      const ax = x[i]! - x0,
        ay = y[i]! - y0,
        bx = x[i + 1]! - x0,
        by = y[i + 1]! - y0,
        area = Math.abs(ax * by - ay * bx);
      twice += area;
      cx += area * (ax + bx);
      cy += area * (ay + by);
    }
    if (!(twice > 0)) return;
    const third = 1 / (3 * twice),
      u = ((x0 + cx * third) * 2) / this.size - 1,
      v = ((y0 + cy * third) * 2) / this.size - 1,
      inverse = 1 / Math.sqrt(u * u + v * v + 1),
      f = faces[face]!;
    const i = this.count++;
    this.texel[i] = cubeTexel(this.size, face, column, row);
    for (let k = 0; k < 3; ++k) this.direction[3 * i + k] = (f[k]! + u * f[k + 3]! + v * f[k + 6]!) * inverse;
    this.total += this.solidAngle[i] = 0.5 * twice * inverse ** 3;
  }

  /** The polygon along the grid of a face, which it meets in these columns and rows. */
  private alongGrid(face: number, p: Polygon, x0: number, x1: number, y0: number, y1: number): void {
    const { right, column, lower, cell, rest } = this;
    right.copy(p);
    for (let x = x0; x <= x1; ++x) {
      if (x < x1) cut(rest.copy(right), true, x + 1, column, right);
      lower.copy(x < x1 ? column : right);
      for (let y = y0; y < y1; ++y) {
        cut(rest.copy(lower), false, y + 1, cell, lower);
        this.add(face, x, y, cell);
      }
      this.add(face, x, y1, lower);
    }
  }

  /** A texel whose corners lie on several faces: on each that it may touch, what lies within the face. */
  private overEdges(d: ArrayLike<number>, corners: readonly number[]): void {
    const { size, whole, cell, rest } = this;
    for (let face = 0; face < 6; ++face) {
      const f = faces[face]!;
      const along = (c: number, k: number): number =>
        f[k]! * d[3 * c]! + f[k + 1]! * d[3 * c + 1]! + f[k + 2]! * d[3 * c + 2]!;
      if (corners.some((c) => along(c, 0) <= 0.4)) continue; // on the face it would be 0.577 at least
      whole.count = 0;
      for (const c of corners)
        whole.add(((along(c, 3) / along(c, 0) + 1) * size) / 2, ((along(c, 6) / along(c, 0) + 1) * size) / 2);
      for (const alongX of [true, false]) {
        cut(whole, alongX, size, cell, rest);
        cut(cell, alongX, 0, rest, whole);
      }
      if (whole.count < 3) continue;
      const used = (at: Float64Array): Float64Array => at.subarray(0, whole.count),
        clamp = (v: number): number => Math.max(0, Math.min(size - 1, Math.floor(v))),
        [xs, ys] = [used(whole.x), used(whole.y)];
      this.alongGrid(
        face,
        whole,
        clamp(Math.min(...xs)),
        clamp(Math.max(...xs)),
        clamp(Math.min(...ys)),
        clamp(Math.max(...ys)),
      );
    }
  }

  /** The texel between four corners of the map, in order around it. */
  cut(map: Corners, a: number, b: number, c: number, e: number): void {
    const { direction: d, face, column, row, x, y } = map,
      onFace = face[a]!;
    this.count = this.total = 0;
    if (onFace !== face[b] || onFace !== face[c] || onFace !== face[e]) this.overEdges(d, [a, b, c, e]);
    else {
      const x0 = Math.min(column[a]!, column[b]!, column[c]!, column[e]!),
        x1 = Math.max(column[a]!, column[b]!, column[c]!, column[e]!),
        y0 = Math.min(row[a]!, row[b]!, row[c]!, row[e]!),
        y1 = Math.max(row[a]!, row[b]!, row[c]!, row[e]!);
      if (x0 !== x1 || y0 !== y1) {
        const { whole } = this;
        whole.count = 0;
        whole.add(x[a]!, y[a]!);
        whole.add(x[b]!, y[b]!);
        whole.add(x[c]!, y[c]!);
        whole.add(x[e]!, y[e]!);
        this.alongGrid(onFace, whole, x0, x1, y0, y1);
      }
    }
    if (this.count > 0) return;
    // Within one texel of the cube, or too thin to have an area.
    this.texel[0] = cubeTexel(this.size, onFace, column[a]!, row[a]!);
    for (let k = 0; k < 3; ++k)
      this.direction[k] = 0.25 * (d[3 * a + k]! + d[3 * b + k]! + d[3 * c + k]! + d[3 * e + k]!);
    this.count = this.total = this.solidAngle[0] = 1;
  }
}

/** Corners of a map's texels, two rows of them, and where they meet the cube. */
class Corners {
  readonly direction: Float64Array;
  readonly face: Int32Array;
  readonly x: Float64Array; // on the face, in texels
  readonly y: Float64Array;
  readonly column: Int32Array;
  readonly row: Int32Array;

  constructor(
    private readonly size: number,
    count: number,
  ) {
    this.direction = new Float64Array(3 * count);
    [this.face, this.column, this.row] = [new Int32Array(count), new Int32Array(count), new Int32Array(count)];
    [this.x, this.y] = [new Float64Array(count), new Float64Array(count)];
  }

  set(i: number, dx: number, dy: number, dz: number): void {
    const { direction, size } = this,
      ax = Math.abs(dx),
      ay = Math.abs(dy),
      az = Math.abs(dz);
    direction[3 * i] = dx;
    direction[3 * i + 1] = dy;
    direction[3 * i + 2] = dz;
    const face = ax >= ay && ax >= az ? (dx > 0 ? 0 : 1) : ay >= az ? (dy > 0 ? 2 : 3) : dz > 0 ? 4 : 5,
      f = faces[face],
      inverse = 1 / Math.max(ax, ay, az),
      u = (f[3] * dx + f[4] * dy + f[5] * dz) * inverse,
      v = (f[6] * dx + f[7] * dy + f[8] * dz) * inverse;
    this.face[i] = face;
    this.x[i] = ((u + 1) * size) / 2;
    this.y[i] = ((v + 1) * size) / 2;
    this.column[i] = Math.min(Math.floor(this.x[i]), size - 1);
    this.row[i] = Math.min(Math.floor(this.y[i]), size - 1);
  }
}

/** 3 x 3, row-major: takes directions of the map to the world. */
export function cubeLight(map: LatLongMap, size: number, turn: ArrayLike<number>): CubeLight {
  const { data, width, height, channels } = map,
    split = Math.max(1, Math.ceil((4 * size) / width)), // so small that the arcs of their parallels are straight
    fine = width * split,
    rows = height * split,
    stride = fine + 1;
  const energy = new Float64Array(18 * size * size),
    moment = new Float64Array(18 * size * size);
  const corners = new Corners(size, 2 * stride),
    cutter = new Cutter(size),
    { texel, solidAngle, direction } = cutter;
  const meridians = new Float64Array(3 * stride); // on the equator, turned
  for (let x = 0; x <= fine; ++x) {
    const phi = 2 * Math.PI * (x / fine - 0.5);
    for (let k = 0; k < 3; ++k) meridians[3 * x + k] = turn[3 * k]! * Math.cos(phi) + turn[3 * k + 2]! * Math.sin(phi);
  }
  const put = (row: number): void => {
    const theta = (Math.PI * row) / rows,
      sine = Math.sin(theta),
      cosine = Math.cos(theta),
      at = (row % 2) * stride;
    for (let x = 0; x <= fine; ++x)
      corners.set(
        at + x,
        sine * meridians[3 * x]! + cosine * turn[1]!,
        sine * meridians[3 * x + 1]! + cosine * turn[4]!,
        sine * meridians[3 * x + 2]! + cosine * turn[7]!,
      );
  };
  put(0);
  for (let y = 0; y < rows; ++y) {
    put(y + 1);
    const above = (y % 2) * stride,
      below = stride - above,
      area = texelSolidAngle(y, fine, rows),
      from = Math.floor(y / split) * width;
    for (let x = 0; x < fine; ++x) {
      const at = (from + Math.floor(x / split)) * channels,
        r = held(data[at]!),
        g = held(data[at + 1]!),
        b = held(data[at + 2]!),
        all = r + g + b;
      if (all === 0) continue;
      cutter.cut(corners, above + x, above + x + 1, below + x + 1, below + x);
      const scale = area / cutter.total;
      for (let i = 0; i < cutter.count; ++i) {
        const to = 3 * texel[i]!,
          share = solidAngle[i]! * scale;
        energy[to]! += share * r;
        energy[to + 1]! += share * g;
        energy[to + 2]! += share * b;
        for (let k = 0; k < 3; ++k) moment[to + k]! += share * all * direction[3 * i + k]!;
      }
    }
  }
  return { size, energy: Float32Array.from(energy), direction: directions(size, moment) };
}

/** Negative and non-finite texels count as 0, as they do for the command-line tool. */
const held = (value: number): number => (value > 0 && value < Infinity ? value : 0);

function directions(size: number, moment: Float64Array): Float32Array {
  const out = new Float32Array(moment.length);
  for (let face = 0; face < 6; ++face)
    for (let row = 0; row < size; ++row)
      for (let column = 0; column < size; ++column) {
        const at = 3 * cubeTexel(size, face, column, row),
          length = Math.hypot(moment[at]!, moment[at + 1]!, moment[at + 2]!);
        if (length > 0) for (let k = 0; k < 3; ++k) out[at + k] = moment[at + k]! / length;
        else out.set(cubeDirection(size, face, column + 0.5, row + 0.5), at);
      }
  return out;
}

/** A map with n x n texels made one, energy kept, no wider than that; as it is where its sides do not divide. */
export function reducedMap(map: LatLongMap, most: number): LatLongMap {
  const { data, width, height, channels } = map;
  let factor = Math.max(1, Math.ceil(width / most));
  while (factor < width && (width % factor || height % factor)) ++factor;
  if (factor === 1 || factor >= Math.min(width, height)) return map;
  const w = width / factor,
    h = height / factor,
    out = new Float32Array(3 * w * h);
  for (let y = 0; y < height; ++y) {
    const to = Math.floor(y / factor),
      weight = texelSolidAngle(y, width, height) / texelSolidAngle(to, w, h);
    for (let x = 0; x < width; ++x)
      for (let c = 0; c < 3; ++c)
        out[3 * (to * w + Math.floor(x / factor)) + c]! += weight * held(data[(y * width + x) * channels + c]!);
  }
  return { data: out, width: w, height: h, channels: 3 };
}
