// Light in free space (docs/matrices.md): at the points of a lattice the radiance that arrives, as harmonics, for what
// the bake did not know. three's own lit materials take it through the addons LightProbeGrid and LightProbeGridWebGL,
// which follow the light as it is turned.
import {
  Color,
  Data3DTexture,
  DataUtils,
  HalfFloatType,
  LinearFilter,
  RGBAFormat,
  type Light,
  type Texture,
  type Vector3,
} from 'three';
import { block } from './block_texture.js';
import { LambentError } from './errors.js';
import { isIndex, isViews } from './glb.js';
import { toHalf } from './half.js';
import type { TransferSource } from './kinds.js';
import { readLobes, type LobeBasis } from './light_basis.js';
import type { Lighting } from './lighting.js';
import { clampedCosine, evaluateSh, maxShOrder, shBand, shCount, shIndex } from './sh.js';

const maxPoints = 64; // an axis
const probeBands = 3,
  slices = 7; // of a grid's atlas: 27 numbers, four a texel

/** What three's two grids of probes have alike. */
export interface ProbeGrid extends Light {
  width: number;
  height: number;
  depth: number;
  readonly resolution: Vector3;
  texture: Texture | null;
  updateBoundingBox(): void;
}
export type ProbeGridClass<Grid extends ProbeGrid> = new (
  width: number,
  height: number,
  depth: number,
  widthProbes: number,
  heightProbes: number,
  depthProbes: number,
) => Grid;

export interface LatticeHeader {
  min: readonly number[];
  max: readonly number[];
  points: readonly number[];
  /** Bands of the light that arrives. */
  order: number;
  channels: 1 | 3;
  precision: 'half' | 'single';
}

/** three.js keeps the index l(l+1)+m but not the Condon-Shortley sign. */
const sign = (index: number): number => ((index - shIndex(shBand(index), 0)) % 2 === 0 ? 1 : -1);

export class Lattice {
  readonly order: number;
  readonly points: readonly [number, number, number];
  /** Incident radiance, [point][coefficient][3], in lambent's convention; points as the file has them, x fastest. */
  readonly coefficients: Float32Array;
  private readonly count: number;
  private readonly values: Float32Array; // [block][row][channel][column][16]
  private readonly grids = new Map<ProbeGrid, Data3DTexture>();

  /**
   * `values` are the file's; `columns` those of the light: harmonics of `lightOrder` bands, lobes, the scene's lamps.
   * `valid`: 0 where a point lies inside something, and has its neighbours' light.
   */
  constructor(
    readonly header: LatticeHeader,
    readonly lightOrder: number,
    readonly columns: number,
    values: ArrayBuffer,
    readonly valid: Uint8Array,
    private readonly lobes?: LobeBasis,
  ) {
    const [nx, ny, nz] = header.points as [number, number, number],
      blocks = Math.ceil((nx * ny * nz) / block),
      length = blocks * shCount(header.order) * header.channels * columns * block;
    this.order = header.order;
    this.points = [nx, ny, nz];
    this.count = nx * ny * nz;
    if (values.byteLength !== length * (header.precision === 'half' ? 2 : 4))
      throw new LambentError(`holds ${values.byteLength} bytes of a lattice where its header makes ${length} numbers`);
    if (valid.length !== this.count) throw new LambentError('a lattice does not have one "valid" byte a point');
    this.values =
      header.precision === 'half'
        ? Float32Array.from(new Uint16Array(values), (bits) => DataUtils.fromHalfFloat(bits))
        : new Float32Array(values);
    this.coefficients = new Float32Array(3 * shCount(this.order) * this.count);
  }

  /** Where a point stands, in the axes of the baked scene. */
  position(index: number, target: Vector3): Vector3 {
    const [nx, ny] = this.points,
      { min, max } = this.header;
    const at = [index % nx, Math.floor(index / nx) % ny, Math.floor(index / (nx * ny))];
    return target.fromArray(
      at.map((i, k) => {
        const n = this.points[k]!;
        return min[k]! + (n > 1 ? i / (n - 1) : 0.5) * (max[k]! - min[k]!);
      }),
    );
  }

  /** `lamps`: a colour of each of the scene's own, in the order of the file. */
  relight(lighting: Lighting, lamps: Iterable<Color> = []): void {
    const { channels } = this.header,
      { columns, coefficients, values } = this,
      rows = shCount(this.order);
    const { rest, peaks } = lighting.of({ order: this.lightOrder, lobes: this.lobes }),
      light = new Float32Array(3 * columns);
    rest.forEach((v, i) => (light[i] = v + (peaks ? peaks[i]! : 0)));
    let lamp = rest.length / 3;
    for (const color of lamps) light.set(color.toArray(), 3 * lamp++);
    const sums = new Float32Array(block);
    for (let point = 0, at = 0; point < this.count; point += block) {
      const lanes = Math.min(block, this.count - point);
      for (let row = 0; row < rows; ++row)
        for (let c = 0; c < 3; ++c) {
          if (channels === 1 && c > 0) at -= columns * block; // the same transfer for each colour
          sums.fill(0);
          for (let column = 0; column < columns; ++column, at += block) {
            const l = light[3 * column + c]!;
            for (let lane = 0; lane < block; ++lane) sums[lane]! += l * values[at + lane]!;
          }
          for (let lane = 0; lane < lanes; ++lane) coefficients[3 * ((point + lane) * rows + row) + c] = sums[lane]!;
        }
    }
    for (const [grid, texture] of this.grids) this.fill(grid, texture);
  }

  /** Incident radiance at a place of the baked scene, [coefficient][3]; beyond the box that of its face. */
  radianceAt({ x, y, z }: Vector3, out = new Float64Array(3 * shCount(this.order))): Float64Array {
    const [nx, ny] = this.points,
      { coefficients } = this,
      size = out.length,
      tx = this.along(x, 0),
      ty = this.along(y, 1),
      tz = this.along(z, 2);
    out.fill(0);
    for (let corner = 0; corner < 8; ++corner) {
      const i = Math.floor(tx) + (corner & 1),
        j = Math.floor(ty) + ((corner >> 1) & 1),
        k = Math.floor(tz) + (corner >> 2);
      // No corner of weight 0 is looked at: beyond the last point there is none.
      const weight = (1 - Math.abs(tx - i)) * (1 - Math.abs(ty - j)) * (1 - Math.abs(tz - k));
      if (weight === 0) continue;
      const from = size * ((k * ny + j) * nx + i);
      for (let n = 0; n < size; ++n) out[n]! += weight * coefficients[from + n]!;
    }
    return out;
  }

  /** Where a coordinate lies between the points of an axis, which are the whole numbers. */
  private along(p: number, axis: 0 | 1 | 2): number {
    const { min, max } = this.header,
      extent = max[axis]! - min[axis]!;
    return extent > 0 ? Math.min(1, Math.max(0, (p - min[axis]!) / extent)) * (this.points[axis] - 1) : 0;
  }

  /** Irradiance of a surface there towards `normal`; exit radiance of a diffuse one is albedo / pi times it. */
  irradianceAt(position: Vector3, normal: Vector3, target = new Color()): Color {
    const radiance = this.radianceAt(position),
      rows = shCount(this.order),
      y = new Float64Array(rows),
      sum = [0, 0, 0];
    evaluateSh(this.order, normal.x, normal.y, normal.z, y);
    for (let i = 0; i < rows; ++i)
      for (let c = 0; c < 3; ++c) sum[c]! += clampedCosine(shBand(i)) * y[i]! * radiance[3 * i + c]!;
    return target.fromArray(sum.map((v) => Math.max(0, v)));
  }

  /**
   * A grid of three's, `LightProbeGridWebGL` for WebGLRenderer or `LightProbeGrid` for WebGPURenderer, to be added to
   * the scene: its lit materials take this light, by three bands, and follow relight(). Its probes stand in the middles
   * of cells, so that the box is half a cell larger on each side than the lattice's.
   */
  probeGrid<Grid extends ProbeGrid>(GridClass: ProbeGridClass<Grid>): Grid {
    const { min, max } = this.header,
      { points } = this;
    const [width, height, depth] = points.map((n, k) => ((max[k]! - min[k]!) * n) / Math.max(1, n - 1)) as [
      number,
      number,
      number,
    ];
    const grid = new GridClass(width, height, depth, ...points);
    grid.position.fromArray(points.map((_, k) => (min[k]! + max[k]!) / 2));
    grid.updateBoundingBox();
    const [nx, ny, nz] = points,
      texture = new Data3DTexture(new Uint16Array(4 * nx * ny * slices * (nz + 2)), nx, ny, slices * (nz + 2));
    texture.name = 'lambent probes';
    texture.format = RGBAFormat;
    texture.type = HalfFloatType;
    texture.minFilter = texture.magFilter = LinearFilter;
    texture.unpackAlignment = 1;
    grid.texture = texture;
    this.grids.set(grid, texture);
    this.fill(grid, texture);
    return grid;
  }

  /** Texel (x, y) of slice t (nz + 2) + 1 + z has numbers 4t .. 4t + 3 of 27; the first and last of a t are doubled. */
  private fill(grid: ProbeGrid, texture: Data3DTexture): void {
    const [nx, ny, nz] = this.points,
      data = texture.image.data as Uint16Array,
      rows = shCount(this.order),
      known = 3 * Math.min(rows, shCount(probeBands)),
      layer = 4 * nx * ny;
    for (let t = 0; t < slices; ++t)
      for (let slice = 0; slice < nz + 2; ++slice) {
        const z = Math.min(nz - 1, Math.max(0, slice - 1)),
          to = layer * (t * (nz + 2) + slice);
        if (slice === nz + 1) {
          data.copyWithin(to, to - layer, to);
          continue;
        }
        if (slice === 1) {
          data.copyWithin(to, to - layer, to);
          continue;
        }
        for (let i = 0; i < nx * ny; ++i)
          for (let k = 0; k < 4; ++k) {
            const number = 4 * t + k;
            if (number >= known) continue;
            const value = this.coefficients[3 * rows * (z * nx * ny + i) + number]!;
            data[to + 4 * i + k] = toHalf(sign(Math.floor(number / 3)) * value);
          }
      }
    texture.needsUpdate = true;
    grid.texture = texture;
  }

  dispose(): void {
    for (const [grid, texture] of this.grids) {
      grid.texture = null;
      texture.dispose();
    }
    this.grids.clear();
  }
}

const isPlace = (value: unknown): value is number[] =>
  Array.isArray(value) && value.length === 3 && value.every((v) => Number.isFinite(v));

/** The file's lattice, where it has one. */
export async function loadLattice(source: TransferSource): Promise<Lattice | undefined> {
  const { lattice, transfer } = source.extension;
  if (lattice === undefined) return undefined;
  const wrong = (): never => {
    throw new LambentError('holds a "lattice" that is none');
  };
  if (typeof lattice !== 'object' || lattice === null) return wrong();
  const { min, max, points, order, channels, precision, bufferView, valid } = lattice as Record<string, unknown>;
  const lightOrder = transfer['order'],
    groups = transfer['groups'] ?? [];
  if (!isPlace(min) || !isPlace(max) || min.some((v, k) => v > max[k]!)) return wrong();
  if (!isPlace(points) || !points.every((n) => isIndex(n, maxPoints) && n >= 1)) return wrong();
  if (!isIndex(order, maxShOrder) || order < 1 || !isIndex(lightOrder, maxShOrder)) return wrong();
  if ((channels !== 1 && channels !== 3) || (precision !== 'half' && precision !== 'single')) return wrong();
  if (!isViews(bufferView) || !isViews(valid) || !Array.isArray(groups)) return wrong();
  const lobes = readLobes(transfer, lightOrder);
  return new Lattice(
    { min, max, points, order, channels, precision },
    lightOrder,
    shCount(lightOrder) + (lobes?.lobes.length ?? 0) + groups.length,
    await source.bufferView(bufferView),
    new Uint8Array(await source.bufferView(valid)),
    lobes,
  );
}
