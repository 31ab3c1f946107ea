// The part of an environment that is too sharp for n bands: what rings (docs/deringing.md). As light/peaks.h.
import { texelSolidAngle, type LatLongMap } from './projection.js';
import { luminance } from './sh.js';

/**
 * The map with its peaks cut off: no texel is more luminous than what the brightest 1 / order^2 of the sphere exceeds.
 * Brighter texels keep their hue. Negative and non-finite texels are 0. Three channels.
 */
export function withoutPeaks({ data, width, height, channels }: LatLongMap, order: number): LatLongMap {
  const cut = new Float64Array(3 * width * height),
    bright = new Float32Array(width * height);
  for (let i = 0; i < bright.length; ++i) {
    for (let c = 0; c < 3; ++c) {
      const value = data[i * channels + c]!;
      cut[3 * i + c] = value > 0 && value < Infinity ? value : 0;
    }
    bright[i] = luminance(cut[3 * i]!, cut[3 * i + 1]!, cut[3 * i + 2]!);
  }
  // The highest luminance that more than that share of the sphere has or exceeds: bit by bit, since floats that are not
  // negative are in the order of their bits.
  const bits = new Uint32Array(bright.buffer),
    angles = Float64Array.from({ length: height }, (_, y) => texelSolidAngle(y, width, height));
  const sphereAtLeast = (least: number): number => {
    let sum = 0;
    for (let y = 0, i = 0; y < height; ++y) {
      let count = 0;
      for (const end = i + width; i < end; ++i) count += bits[i]! >= least ? 1 : 0;
      sum += count * angles[y]!;
    }
    return sum;
  };
  let most = 0;
  for (let bit = 2 ** 30; bit >= 1; bit /= 2)
    if (sphereAtLeast(most + bit) > (4 * Math.PI) / (order * order)) most += bit;
  const limit = new Float32Array(Uint32Array.of(most).buffer)[0]!;
  for (let i = 0; i < bright.length; ++i)
    if (bright[i]! > limit) for (let c = 0; c < 3; ++c) cut[3 * i + c]! *= limit / bright[i]!;
  return { data: cut, width, height, channels: 3 };
}
