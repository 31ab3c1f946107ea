// Real spherical harmonics: orthonormal, with the Condon-Shortley sign, coefficient index l(l+1)+m, at raw (x, y, z)
// with +z as the pole. ORDER n means n bands, l = 0 .. n-1, and n^2 coefficients (docs/conventions.md). Source: P.-P.
// Sloan, "Stupid spherical harmonics tricks" (2008); normalised Legendre recurrences, with sin^m cos/sin(m phi) taken
// from powers of (x + iy), so that no angle is computed.

export const maxShOrder = 16;
/** Bands that the recurrences are tabled for: of light that lobes are cut out of. */
export const tabledOrder = 48;

export const shCount = (order: number): number => order * order;
export const shIndex = (l: number, m: number): number => l * (l + 1) + m;
export const shBand = (index: number): number => Math.floor(Math.sqrt(index));

/** Order of a vector of so many coefficients; throws where that is no square from 1 to 256. */
export function shOrder(count: number): number {
  const order = Math.round(Math.sqrt(count));
  if (order < 1 || order > maxShOrder || order * order !== count)
    throw new RangeError(`${count} coefficients are no whole number of bands`);
  return order;
}

/**
 * Factors of the recurrences for q(l, m), the normalised Legendre function divided by sin^m: q(m, m) = diagonal[m],
 * q(l, m) = a(l, m) z q(l-1, m) + b(l, m) q(l-2, m). The sign and the root of 2 are in the diagonal.
 */
export interface LegendreFactors {
  diagonal: number[];
  a(l: number, m: number): number;
  b(l: number, m: number): number;
}

export const legendre: LegendreFactors = (() => {
  const diagonal: number[] = [];
  let q = Math.sqrt(1 / (4 * Math.PI));
  for (let m = 0; m < tabledOrder; ++m) {
    diagonal.push(q * (m > 0 ? Math.SQRT2 : 1) * (m % 2 ? -1 : 1));
    q *= Math.sqrt((2 * m + 3) / (2 * m + 2));
  }
  const a = (l: number, m: number): number => Math.sqrt((4 * l * l - 1) / (l * l - m * m));
  const b = (l: number, m: number): number =>
    l > m + 1 ? -Math.sqrt(((2 * l + 1) * ((l - 1) ** 2 - m * m)) / ((2 * l - 3) * (l * l - m * m))) : 0;
  const table = (f: (l: number, m: number) => number): Float64Array => {
    const values = new Float64Array(tabledOrder * tabledOrder);
    for (let l = 1; l < tabledOrder; ++l) for (let m = 0; m < l; ++m) values[l * tabledOrder + m] = f(l, m);
    return values;
  };
  const tableA = table(a),
    tableB = table(b);
  return { diagonal, a: (l, m) => tableA[l * tabledOrder + m]!, b: (l, m) => tableB[l * tabledOrder + m]! };
})();

/** Values of the first order^2 harmonics at the unit direction (x, y, z), into out. */
export function evaluateSh(
  order: number,
  x: number,
  y: number,
  z: number,
  out: Float64Array | Float32Array | number[],
): void {
  let c = 1,
    s = 0; // real and imaginary part of (x + iy)^m
  for (let m = 0; m < order; ++m) {
    let q1 = legendre.diagonal[m]!,
      q2 = 0;
    for (let l = m; l < order; ++l) {
      if (l > m) {
        const q = z * legendre.a(l, m) * q1 + legendre.b(l, m) * q2;
        q2 = q1;
        q1 = q;
      }
      out[shIndex(l, m)] = q1 * c;
      if (m > 0) out[shIndex(l, -m)] = q1 * s;
    }
    const next = c * x - s * y;
    s = c * y + s * x;
    c = next;
  }
}

/** Convolution with the clamped cosine multiplies band l by this: pi, 2 pi/3, pi/4, 0, -pi/24, 0, pi/64, ... */
export function clampedCosine(l: number): number {
  if (l === 0) return Math.PI;
  if (l === 1) return (2 * Math.PI) / 3;
  if (l % 2) return 0;
  let central = 1; // l! / (2^l (l/2)!^2)
  for (let k = 1; k <= l / 2; ++k) central *= (2 * k - 1) / (2 * k);
  return ((2 * Math.PI * ((l / 2) % 2 ? 1 : -1)) / ((l + 2) * (l - 1))) * central;
}

export const luminance = (r: number, g: number, b: number): number => 0.2126 * r + 0.7152 * g + 0.0722 * b;
