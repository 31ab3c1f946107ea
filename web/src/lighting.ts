// Distant light as coefficients of radiance, that can be turned without another projection.
import { DataUtils, FloatType, HalfFloatType, LightProbe, Matrix3, Matrix4, Quaternion, type Texture } from 'three';
import { cubeLight, reducedMap, type CubeLight } from './cube.js';
import { LambentError } from './errors.js';
import type { LobeBasis } from './light_basis.js';
import { LobeIntegrals } from './lobe_integrals.js';
import { withoutPeaks } from './peaks.js';
import { projectLatLong, type LatLongMap } from './projection.js';
import { evaluateSh, luminance, maxShOrder, shBand, shCount, shIndex, shOrder } from './sh.js';
import { makeShRotation, rotateSh, type ShRotation } from './sh_rotation.js';
import { shWindow, type ShWindow } from './sh_window.js';

/** three.js keeps the index l(l+1)+m but not the Condon-Shortley sign. */
const oddM = (index: number): boolean => (index - shIndex(shBand(index), 0)) % 2 !== 0;

let halfTable: Float32Array | undefined;
function halfToFloat(half: ArrayLike<number>): Float32Array {
  halfTable ??= Float32Array.from({ length: 65536 }, (_, i) => DataUtils.fromHalfFloat(i));
  const table = halfTable;
  return Float32Array.from(half, (h) => table[h]!);
}

/** The texels of a texture as three's loaders of .hdr and .exr leave it, float or half, first row at the zenith. */
export function latLongMap(texture: Texture): LatLongMap {
  const image = texture.image as { data?: ArrayLike<number>; width: number; height: number } | null | undefined;
  const isFloat = texture.type === FloatType;
  if (!image?.data || !(image.width > 0 && image.height > 0) || !(isFloat || texture.type === HalfFloatType))
    throw new LambentError(
      'an environment must be a float or half-float data texture, as HDRLoader and EXRLoader make',
    );
  const { width, height } = image,
    channels = image.data.length / (width * height);
  if (channels !== 3 && channels !== 4) throw new LambentError('an environment must have three or four channels');
  const data = isFloat ? image.data : halfToFloat(image.data);
  if (texture.flipY) return { data, width, height, channels };
  // The first row in memory is the lowest.
  const row = width * channels,
    flipped = new Float32Array(data.length);
  for (let y = 0; y < height; ++y)
    for (let i = 0; i < row; ++i) flipped[y * row + i] = data[(height - 1 - y) * row + i]!;
  return { data: flipped, width, height, channels };
}

/** With less of all light in them, peaks ring too little to be seen. */
const leastSharp = 0.05;

const upright = [1, 0, 0, 0, 1, 0, 0, 0, 1];
/** A product of matrices, row-major. */
const times = (a: ArrayLike<number>, b: ArrayLike<number>): number[] =>
  upright.map((_, i) => [0, 1, 2].reduce((sum, k) => sum + a[i - (i % 3) + k]! * b[3 * k + (i % 3)]!, 0));

/**
 * Least-squares coefficients, [column][3], of a light that was turned by R, row-major: by its harmonics, of which n
 * bands are used, and its integrals against lobes.
 */
function fitted(
  columns: LobeBasis,
  radiance: ArrayLike<number>,
  integrals: LobeIntegrals,
  n: number,
  R: number[],
): Float64Array {
  const { order, lobes } = columns,
    q = new Float64Array(3 * (shCount(n) + lobes.length)),
    light = new Float64Array(3 * columns.count);
  if (n > 0) rotateSh(makeShRotation(n, R), radiance, q);
  // The light turned by R meets a lobe as the light itself meets the lobe turned back.
  const back = lobes.map(({ axis: [x, y, z] }) => {
    const to = (c: number): number => R[c]! * x + R[3 + c]! * y + R[6 + c]! * z;
    return [to(0), to(1), to(2)] as const;
  });
  q.set(integrals.about(back), 3 * shCount(n));
  for (let c = 0; c < 3; ++c)
    columns
      .solve(
        n,
        q.filter((_, i) => i % 3 === c),
      )
      .forEach((v, i) => (light[3 * (i < shCount(n) ? i : i - shCount(n) + shCount(order)) + c] = v));
  return light;
}

/** Texels around the equator of a map that is put on a cube, at most. */
const widestOnCube = 2048;

/** What coefficients are of, where there is no map: the radiance that they add up to. */
function mapOf(radiance: ArrayLike<number>, order: number): LatLongMap {
  const [width, height] = [128, 64],
    data = new Float32Array(3 * width * height),
    harmonics = new Float64Array(shCount(order));
  for (let y = 0; y < height; ++y)
    for (let x = 0; x < width; ++x) {
      const theta = (Math.PI * (y + 0.5)) / height,
        phi = 2 * Math.PI * ((x + 0.5) / width - 0.5),
        sine = Math.sin(theta);
      evaluateSh(order, sine * Math.cos(phi), Math.cos(theta), sine * Math.sin(phi), harmonics);
      for (let i = 0; i < harmonics.length; ++i)
        for (let c = 0; c < 3; ++c) data[3 * (y * width + x) + c]! += harmonics[i]! * radiance[3 * i + c]!;
    }
  return { data, width, height, channels: 3 };
}

/** Light as transfer takes it: [coefficient][3]. Both parts are light, and neither may be negative where it arrives. */
export interface LightParts {
  /** All of the light; of one that has peaks, the rest of it. */
  rest: Float64Array;
  /** What is too sharp for the bands, and rings; undefined where that is left as it is, or is little. */
  peaks: Float64Array | undefined;
}
/** Light of columns that stand still where light turns, as well. */
export interface TurnableParts extends LightParts {
  /** The same light in axes that were turned so. Not of harmonics alone, which are turned as they are. */
  turned?: (turn: Matrix3) => LightParts;
}

export class Lighting {
  /** Turns the light: radiance from d becomes that from rotation * d. */
  readonly rotation = new Quaternion();
  /** Against ringing; `auto` keeps it from shadows as well, where the light comes from a map (docs/deringing.md). */
  window: ShWindow = 'auto';
  /** Bands to use of those there are. */
  bands: number;
  /** Multiplies radiance. */
  intensity = 1;
  /** For light that a hand is turning: onCube() takes a map no finer than the cube, a quarter of the work and less. */
  quick = false;

  readonly order: number;
  private windowFactors: { key: string; factors: number[] } | undefined;
  private narrow: { most: number; map: LatLongMap } | undefined;
  private cube: { key: string; light: CubeLight } | undefined;
  private readonly restOf = new Map<number, Float64Array | undefined>();
  private readonly integralsOf = new WeakMap<LobeBasis, LobeIntegrals>();
  /** Of the map's peaks in so many bands. */
  private readonly sharpOf = new WeakMap<LobeBasis, { bands: number; integrals: LobeIntegrals }>();

  /**
   * `radiance`: order^2 RGB coefficients, [coefficient][3], in lambent's convention (docs/conventions.md). `map`: what
   * they are of, which coefficients alone do not tell.
   */
  constructor(
    readonly radiance: ArrayLike<number>,
    private readonly map?: LatLongMap,
  ) {
    this.order = this.bands = shOrder(radiance.length / 3);
    for (let i = 0; i < radiance.length; ++i)
      if (!Number.isFinite(radiance[i]!)) throw new LambentError('a light coefficient is not a finite number');
  }

  /** From an equirectangular texture in memory, as three's HDRLoader and EXRLoader make it; `order` bands are kept. */
  static fromEquirectangular(texture: Texture, order = maxShOrder): Lighting {
    return Lighting.fromMap(latLongMap(texture), order);
  }

  static fromMap(map: LatLongMap, order = maxShOrder): Lighting {
    return new Lighting(projectLatLong(map, order), map);
  }

  /** From a three.js probe: three bands, its intensity included. */
  static fromLightProbe(probe: LightProbe): Lighting {
    const sh = probe.sh.coefficients;
    return new Lighting(sh.flatMap((c, i) => [c.x, c.y, c.z].map((v) => v * probe.intensity * (oddM(i) ? -1 : 1))));
  }

  /** The first three bands, turned and windowed, for three's own materials. */
  toLightProbe(probe = new LightProbe()): LightProbe {
    const light = this.coefficients(3);
    probe.sh.coefficients.forEach((c, i) => c.fromArray(Array.from(light), 3 * i).multiplyScalar(oddM(i) ? -1 : 1));
    return probe;
  }

  /**
   * order^2 RGB coefficients, turned, windowed and scaled; zero beyond the bands in use. For open surfaces: `auto`
   * is as weak a window as keeps those from going dark.
   */
  coefficients(order: number, most = order): Float64Array {
    const n = this.bandsOf(Math.min(order, most));
    return this.turned(this.radiance, this.rotationOf(n), this.factors(n), order);
  }

  /**
   * The same for what knows its shadows: `auto` takes peaks apart where there are any. `glossy`, of surfaces that
   * reflect a part of the sky at a time: those peaks get a Lanczos window. `most` bands of transfer are there: beyond
   * them light is zero.
   */
  parts(order: number, glossy = false, most = order): LightParts {
    return this.partsIn(this.matrix(), order, glossy, most);
  }

  /**
   * The same for columns that are harmonics and lobes: [column][3]. A window is of the harmonics. `auto` takes peaks
   * apart where lobes leave much of them to the harmonics, as where a lamp has left its lobe; lobes that are harmonics
   * in other words are lit as those would be.
   */
  partsOf(columns: LobeBasis, glossy = false): TurnableParts {
    const rotation = this.matrix(),
      { intensity, window } = this,
      { order, bands } = columns;
    let at: (R: number[]) => LightParts;
    if (bands > 0) {
      const parts = this.partsIn(rotation, bands, false, bands);
      at = (R) => ({ rest: columns.ofBands(parts.rest, R), peaks: parts.peaks && columns.ofBands(parts.peaks, R) });
      return { ...at(upright), turned: (turn) => at(turn.elements) }; // column-major: of its inverse
    }
    const n = order > 0 ? this.bandsOf(order) : 0,
      harmonics = 3 * shCount(n),
      integrals =
        this.integralsOf.get(columns) ?? new LobeIntegrals(this.map ?? mapOf(this.radiance, this.order), columns),
      factors = n > 0 && window !== 'auto' ? this.factors(n) : new Array<number>(n).fill(1),
      rest = window === 'auto' && this.map && n > 1 ? this.rest(n) : undefined,
      light = (of: ArrayLike<number>): number => luminance(of[0]!, of[1]!, of[2]!);
    this.integralsOf.set(columns, integrals);
    const peaksAt = rest && ((R: number[]) => this.sharpAt(columns, rest, n, R)),
      first = peaksAt?.(rotation),
      left = first ? Math.abs(light(first)) : 0,
      holds = left > leastSharp * light(this.radiance),
      // Of a lamp that has left its lobe, as of peaks without lobes.
      softens = glossy && rest !== undefined && left >= 0.5 * (light(this.radiance) - light(rest));
    at = (R) => {
      const all = fitted(columns, this.radiance, integrals, n, R),
        sharp = holds ? peaksAt?.(R) : undefined;
      for (let i = 0; i < harmonics; ++i) all[i]! *= factors[shBand(Math.floor(i / 3))]!;
      if (sharp) all.forEach((v, i) => (all[i] = v - sharp[i]!));
      if (sharp && softens) {
        const soft = shWindow('lanczos', sharp.slice(0, harmonics));
        for (let i = 0; i < harmonics; ++i) sharp[i]! *= soft[shBand(Math.floor(i / 3))]!;
      }
      return { rest: all.map((v) => v * intensity), peaks: sharp?.map((v) => v * intensity) };
    };
    return { ...at(rotation), turned: (turn) => at(times(turn.elements, rotation)) };
  }

  /** The map's peaks in n bands as all columns hold them, turned by R; `rest` is what they leave of the harmonics. */
  private sharpAt(columns: LobeBasis, rest: Float64Array, n: number, R: number[]): Float64Array {
    const peaks = rest.map((v, i) => this.radiance[i]! - v);
    return fitted(columns, peaks, this.sharp(columns, n), n, R);
  }

  /** Integrals of the map's peaks in n bands. */
  private sharp(columns: LobeBasis, n: number): LobeIntegrals {
    const known = this.sharpOf.get(columns);
    if (known?.bands === n) return known.integrals;
    const { data, width, height } = withoutPeaks(this.map!, n),
      { data: all, channels } = this.map!,
      left = Float64Array.from(data, (v, i) => {
        const value = all[Math.floor(i / 3) * channels + (i % 3)]!;
        return value > 0 && value < Infinity ? value - v : 0;
      }),
      integrals = new LobeIntegrals({ data: left, width, height, channels: 3 }, columns);
    this.sharpOf.set(columns, { bands: n, integrals });
    return integrals;
  }

  /** Of either: lobes where there are any. */
  of(columns: { order: number; lobes: LobeBasis | undefined }, glossy = false, most = columns.order): TurnableParts {
    return columns.lobes ? this.partsOf(columns.lobes, glossy) : this.parts(columns.order, glossy, most);
  }

  private partsIn(R: number[], order: number, glossy: boolean, most: number): LightParts {
    const n = this.bandsOf(Math.min(order, most));
    if (this.window !== 'auto' || !this.map || n < 2) return { rest: this.coefficients(order, most), peaks: undefined };
    const whole = new Array<number>(n).fill(1),
      rotation = makeShRotation(n, R),
      rest = this.rest(n);
    if (!rest) return { rest: this.turned(this.radiance, rotation, whole, order), peaks: undefined };
    const peaks = rest.map((v, i) => this.radiance[i]! - v);
    return {
      rest: this.turned(rest, rotation, whole, order),
      peaks: this.turned(peaks, rotation, glossy ? shWindow('lanczos', peaks) : whole, order),
    };
  }

  /** Radiance without its peaks in n bands, not turned; undefined where too little of the light is in them. */
  private rest(n: number): Float64Array | undefined {
    if (!this.restOf.has(n)) {
      const rest = projectLatLong(withoutPeaks(this.map!, n), n),
        light = (of: ArrayLike<number>): number => luminance(of[0]!, of[1]!, of[2]!);
      this.restOf.set(n, light(this.radiance) - light(rest) > leastSharp * light(this.radiance) ? rest : undefined);
    }
    return this.restOf.get(n);
  }

  /**
   * On a cube of so many texels a side, turned and scaled: for what sees light as it is, without bands or a window.
   * Maps wider than 2048 texels are reduced to that.
   */
  onCube(size: number): CubeLight {
    return this.cubes(size)();
  }

  /** The same of the light as it is now, at any later time; of what was turned by `turn`, in its own axes. */
  cubes(size: number): (turn?: Matrix3) => CubeLight {
    const most = this.quick ? 4 * size : widestOnCube,
      key = `${size} ${most} ${this.rotation.toArray().join(' ')} ${this.intensity}`;
    if (this.narrow?.most !== most)
      this.narrow = { most, map: reducedMap(this.map ?? mapOf(this.radiance, this.order), most) };
    const { map } = this.narrow,
      { intensity } = this,
      rotation = this.matrix();
    return (turn) => {
      if (!turn && this.cube?.key === key) return this.cube.light;
      const now = new Matrix3().fromArray(rotation).transpose(), // fromArray is column-major
        light = cubeLight(map, size, turn ? now.premultiply(turn.clone().transpose()).transpose().toArray() : rotation);
      for (let i = 0; i < light.energy.length; ++i) light.energy[i]! *= intensity;
      if (!turn) this.cube = { key, light };
      return light;
    };
  }

  private bandsOf(order: number): number {
    return Math.max(1, Math.min(order, this.bands, this.order));
  }

  private turned(
    radiance: ArrayLike<number>,
    rotation: ShRotation,
    factors: ArrayLike<number>,
    order: number,
  ): Float64Array {
    const light = new Float64Array(3 * shCount(order));
    rotateSh(rotation, radiance, light);
    for (let i = 0; i < 3 * shCount(factors.length); ++i)
      light[i]! *= factors[shBand(Math.floor(i / 3))]! * this.intensity;
    return light;
  }

  /** Window factors of the first n bands. They do not depend on the rotation. */
  factors(n: number): number[] {
    const key = `${this.window} ${n}`;
    if (this.windowFactors?.key !== key)
      this.windowFactors = { key, factors: shWindow(this.window, Array.from(this.radiance).slice(0, 3 * shCount(n))) };
    return this.windowFactors.factors;
  }

  private rotationOf(n: number): ShRotation {
    return makeShRotation(n, this.matrix());
  }
  /** Row-major. */
  private matrix(): number[] {
    const e = new Matrix4().makeRotationFromQuaternion(this.rotation).elements; // column-major
    return [e[0], e[4], e[8], e[1], e[5], e[9], e[2], e[6], e[10]];
  }
}
