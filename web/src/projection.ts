// Projection of a lat-long map of radiance onto spherical harmonics: a sum over texel centres with exact solid angles,
// as `project_environment` of the C++ library does it (texels wider than a third of a degree are sampled at several
// points).
//
// The map's rows are circles about +Y, so with +Y as the pole the harmonics split into a factor a row and one a column:
// each row is summed against cos and sin(m phi) first, which costs 2n-1 products a texel and not n^2. A fixed rotation
// then takes the pole to +z.
import { legendre, shCount, shIndex } from './sh.js';
import { makeShRotation, rotateSh } from './sh_rotation.js';

/** Linear radiance, first row at the zenith, `channels` (3 or 4) numbers a texel of which the first three count. */
export interface LatLongMap {
  data: ArrayLike<number>;
  width: number;
  height: number;
  channels: number;
}

/** Exact solid angle of a texel in row y: (2 pi / width)(cos top - cos bottom), without cancellation near the poles. */
export function texelSolidAngle(y: number, width: number, height: number): number {
  return ((2 * Math.PI) / width) * 2 * Math.sin((Math.PI * (y + 0.5)) / height) * Math.sin((0.5 * Math.PI) / height);
}

// Takes (x, y, z) of the map's own frame, (z, x, y) of the world, to the world: row-major.
const poleToZ = [0, 1, 0, 0, 0, 1, 1, 0, 0];

/**
 * Cosine and sine of m times the azimuth from +Z towards +X, averaged over the points of each column: [2m], [2m + 1].
 */
function columnFactors(order: number, width: number, split: number): Float64Array[] {
  return Array.from({ length: 2 * order }, (_, k) => {
    const m = k >> 1,
      f = k % 2 ? Math.sin : Math.cos;
    return Float64Array.from({ length: width }, (_, x) => {
      let sum = 0;
      for (let i = 0; i < split; ++i)
        sum += f(m * (Math.PI / 2 - 2 * Math.PI * ((x * split + i + 0.5) / (width * split) - 0.5)));
      return sum / split;
    });
  });
}

/**
 * order^2 RGB coefficients, [coefficient][3]. Negative and non-finite texels count as 0, as they do for the
 * command-line tool.
 */
export function projectLatLong(map: LatLongMap, order: number): Float64Array {
  const own = projectAboutPole(map, order),
    light = new Float64Array(own.length);
  rotateSh(makeShRotation(order, poleToZ), own, light);
  return light;
}

/** The same with +Y as the pole: of harmonics at (z, x, y). */
export function projectAboutPole(map: LatLongMap, order: number): Float64Array {
  const { data, width, height, channels } = map;
  const split = Math.max(1, Math.ceil(1024 / width));
  const columns = columnFactors(order, width, split);
  const own = new Float64Array(3 * shCount(order));
  const row = new Float64Array(3 * width),
    moments = new Float64Array(6 * order);
  for (let y = 0; y < height; ++y) {
    for (let x = 0; x < width; ++x)
      for (let c = 0; c < 3; ++c) {
        const value = data[(y * width + x) * channels + c]!;
        row[3 * x + c] = value > 0 && value < Infinity ? value : 0;
      }
    for (let k = 0; k < 2 * order; ++k) {
      const factor = columns[k]!;
      let r = 0,
        g = 0,
        b = 0;
      for (let x = 0; x < width; ++x) {
        const f = factor[x]!;
        r += f * row[3 * x]!;
        g += f * row[3 * x + 1]!;
        b += f * row[3 * x + 2]!;
      }
      moments[3 * k] = r;
      moments[3 * k + 1] = g;
      moments[3 * k + 2] = b;
    }
    for (let s = 0; s < split; ++s) {
      const fine = y * split + s,
        angle = (Math.PI * (fine + 0.5)) / (height * split);
      const solidAngle = texelSolidAngle(fine, width * split, height * split) * split;
      const up = Math.cos(angle),
        radius = Math.sin(angle);
      let power = solidAngle; // times radius^m
      for (let m = 0; m < order; ++m, power *= radius) {
        let q1 = legendre.diagonal[m]!,
          q2 = 0;
        for (let l = m; l < order; ++l) {
          if (l > m) {
            const q = up * legendre.a(l, m) * q1 + legendre.b(l, m) * q2;
            q2 = q1;
            q1 = q;
          }
          for (let c = 0; c < 3; ++c) {
            own[3 * shIndex(l, m) + c]! += q1 * power * moments[6 * m + c]!;
            if (m > 0) own[3 * shIndex(l, -m) + c]! += q1 * power * moments[6 * m + 3 + c]!;
          }
        }
      }
    }
  }
  return own;
}
