// Distant light as coefficients of radiance, that can be turned without another projection.
import { DataUtils, FloatType, HalfFloatType, LightProbe, Matrix4, Quaternion, type Texture } from 'three';
import { LambentError } from './errors.js';
import { projectLatLong, type LatLongMap } from './projection.js';
import { maxShOrder, shBand, shCount, shIndex, shOrder } from './sh.js';
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

export class Lighting {
  /** Turns the light: radiance from d becomes that from rotation * d. */
  readonly rotation = new Quaternion();
  /** Against ringing. */
  window: ShWindow = 'none';
  /** Bands to use of those there are. */
  bands: number;
  /** Multiplies radiance. */
  intensity = 1;

  readonly order: number;
  private windowFactors: { key: string; factors: number[] } | undefined;

  /** `radiance`: order^2 RGB coefficients, [coefficient][3], in lambent's convention (docs/conventions.md). */
  constructor(readonly radiance: ArrayLike<number>) {
    this.order = this.bands = shOrder(radiance.length / 3);
    for (let i = 0; i < radiance.length; ++i)
      if (!Number.isFinite(radiance[i]!)) throw new LambentError('a light coefficient is not a finite number');
  }

  /** From an equirectangular texture in memory, as three's HDRLoader and EXRLoader make it; `order` bands are kept. */
  static fromEquirectangular(texture: Texture, order = maxShOrder): Lighting {
    return new Lighting(projectLatLong(latLongMap(texture), order));
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

  /** order^2 RGB coefficients, turned, windowed and scaled; zero beyond the bands in use. */
  coefficients(order: number): Float64Array {
    const n = Math.max(1, Math.min(order, this.bands, this.order));
    const light = new Float64Array(3 * shCount(order));
    rotateSh(this.rotationOf(n), this.radiance, light);
    const factors = this.factors(n);
    for (let i = 0; i < 3 * shCount(n); ++i) light[i]! *= factors[shBand(Math.floor(i / 3))]! * this.intensity;
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
    const e = new Matrix4().makeRotationFromQuaternion(this.rotation).elements; // column-major
    return makeShRotation(n, [e[0], e[4], e[8], e[1], e[5], e[9], e[2], e[6], e[10]]);
  }
}
