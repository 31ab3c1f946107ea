// Windows against ringing, as factors a band (docs/theory.md).
import { clampedCosine, evaluateSh, luminance, shBand, shCount, shOrder } from './sh.js';

export const shWindows = ['auto', 'hann', 'lanczos', 'none'] as const;
export type ShWindow = (typeof shWindows)[number];

/**
 * Lowest luminance of the irradiance of a light over evenly spread normals, as a fraction of the mean, for windows
 * tried in turn.
 */
function irradianceProbe(light: ArrayLike<number>, order: number): (window: ArrayLike<number>) => number {
  // A Fibonacci lattice; spacing about 4 degrees, well under the finest lobe of order 16. Band sums are kept apart, so
  // that a window costs `order` operations a normal.
  const normals = 2048,
    bands = new Float64Array(normals * order),
    y = new Float64Array(shCount(order));
  const lum = Float64Array.from(
    y,
    (_, i) => luminance(light[3 * i]!, light[3 * i + 1]!, light[3 * i + 2]!) * clampedCosine(shBand(i)),
  );
  for (let i = 0; i < normals; ++i) {
    const z = 1 - (2 * i + 1) / normals,
      r = Math.sqrt(1 - z * z),
      phi = i * 2.39996323;
    evaluateSh(order, r * Math.cos(phi), r * Math.sin(phi), z, y);
    for (let k = 0; k < y.length; ++k) bands[i * order + shBand(k)]! += lum[k]! * y[k]!;
  }
  const mean = lum[0]! * Math.sqrt(1 / (4 * Math.PI));
  return (window) => {
    let lowest = Infinity;
    for (let i = 0; i < normals; ++i) {
      let sum = 0;
      for (let l = 0; l < order; ++l) sum += bands[i * order + l]! * window[l]!;
      lowest = Math.min(lowest, sum);
    }
    return mean > 0 ? lowest / mean : 0;
  };
}

/**
 * Factors w_l, l = 0 .. order-1, for a light of order^2 RGB coefficients. Hann (1 + cos(pi l / order)) / 2; Lanczos
 * sinc(pi l / order); `auto` the weakest 1 / (1 + k l^2 (l+1)^2) under which the luminance of unshadowed irradiance is
 * nowhere negative, to 1e-3 of its mean.
 */
export function shWindow(window: ShWindow, light: ArrayLike<number>): number[] {
  const order = shOrder(light.length / 3);
  const factors = (f: (l: number) => number): number[] => Array.from({ length: order }, (_, l) => (l === 0 ? 1 : f(l)));
  if (window === 'hann') return factors((l) => 0.5 * (1 + Math.cos((Math.PI * l) / order)));
  if (window === 'lanczos') return factors((l) => Math.sin((Math.PI * l) / order) / ((Math.PI * l) / order));
  if (window === 'none') return factors(() => 1);
  const laplacian = (k: number): number[] => factors((l) => 1 / (1 + k * l * l * (l + 1) ** 2));
  const tolerance = -1e-3;
  const lowest = irradianceProbe(light, order);
  if (lowest(laplacian(0)) >= tolerance) return laplacian(0);
  let low = 0,
    high = 1e-4;
  for (; high < 1e3 && lowest(laplacian(high)) < tolerance; high *= 4);
  for (let i = 0; i < 24; ++i) {
    const middle = 0.5 * (low + high);
    if (lowest(laplacian(middle)) >= tolerance) high = middle;
    else low = middle;
  }
  return laplacian(high);
}
