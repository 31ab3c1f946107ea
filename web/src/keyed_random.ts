// Random numbers keyed by what they are for (core/random.h, core/sampling.h): the same as lambent's own, so that the
// page looks at the same places. Sources: B. Burley, "Practical hash-based Owen scrambling", 2020; P. Shirley and
// K. Chiu, "A low distortion map between disk and square", 1997.

// 64 bits as two halves, since numbers hold 53.
let high = 0,
  low = 0;

function multiply(byHigh: number, byLow: number): void {
  const a0 = low & 0xffff,
    a1 = low >>> 16,
    b0 = byLow & 0xffff,
    b1 = byLow >>> 16;
  const middle = a1 * b0 + ((a0 * b0) >>> 16),
    carry = (middle & 0xffff) + a0 * b1;
  const over = a1 * b1 + Math.floor(middle / 65536) + Math.floor(carry / 65536);
  high = (over + Math.imul(high, byLow) + Math.imul(low, byHigh)) | 0;
  low = Math.imul(low, byLow);
}
function shiftXor(by: number): void {
  const shifted = (low >>> by) | (high << (32 - by));
  high ^= high >>> by;
  low ^= shifted;
}
function mix(): void {
  shiftXor(30);
  multiply(0xbf58476d, 0x1ce4e5b9);
  shiftXor(27);
  multiply(0x94d049bb, 0x133111eb);
  shiftXor(31);
}
function add(byHigh: number, byLow: number): void {
  const sum = (low >>> 0) + byLow;
  low = sum | 0;
  high = (high + byHigh + (sum > 0xffffffff ? 1 : 0)) | 0;
}

/** The lower half of hash64(a, b), of numbers below 2^32. */
export function hash(a: number, b: number): number {
  high = 0;
  low = a | 0;
  add(0x9e3779b9, 0x7f4a7c15);
  mix();
  const [ah, al] = [high, low];
  high = 0;
  low = b | 0;
  add(0xd1b54a32, 0xd192ed03);
  high ^= ah;
  low ^= al;
  mix();
  return low >>> 0;
}

function reverseBits(x: number): number {
  x = (x << 16) | (x >>> 16);
  x = ((x & 0x00ff00ff) << 8) | ((x >>> 8) & 0x00ff00ff);
  x = ((x & 0x0f0f0f0f) << 4) | ((x >>> 4) & 0x0f0f0f0f);
  x = ((x & 0x33333333) << 2) | ((x >>> 2) & 0x33333333);
  return ((x & 0x55555555) << 1) | ((x >>> 1) & 0x55555555);
}
function owen(x: number, seed: number): number {
  x = (reverseBits(x) + seed) | 0;
  x ^= Math.imul(x, 0x6c50b47c);
  x ^= Math.imul(x, 0xb82f1e52);
  x ^= Math.imul(x, 0xc7afe638);
  x ^= Math.imul(x, 0x8d22f6e6);
  return reverseBits(x);
}
function secondSobol(index: number): number {
  let x = 0;
  for (let v = 0x80000000, i = index; i; i >>>= 1, v ^= v >>> 1) if (i & 1) x ^= v;
  return x;
}
const unit = (bits: number): number => (bits >>> 8) * 2 ** -24;

/** Point `index` of the scrambled Sobol' sequence of a seed, into `out`. */
export function sobolOwen(index: number, seed: number, out: [number, number]): void {
  out[0] = unit(owen(reverseBits(index), hash(seed, 1)));
  out[1] = unit(owen(secondSobol(index), hash(seed, 2)));
}

/** Of the unit square, in place. */
export function squareToDisk(u: [number, number]): void {
  const a = 2 * u[0] - 1,
    b = 2 * u[1] - 1;
  if (a === 0 && b === 0) return void (u[0] = u[1] = 0);
  const [r, phi] = a * a > b * b ? [a, (Math.PI / 4) * (b / a)] : [b, Math.PI / 2 - (Math.PI / 4) * (a / b)];
  u[0] = r * Math.cos(phi);
  u[1] = r * Math.sin(phi);
}

/** Two unit vectors square to a third, one after another, into `out` (frame_about() of core/vec.h). */
export function frameAbout(x: number, y: number, z: number, out: Float64Array): void {
  const sign = z < 0 || Object.is(z, -0) ? -1 : 1,
    a = -1 / (sign + z),
    b = x * y * a;
  out[0] = 1 + sign * x * x * a;
  out[1] = sign * b;
  out[2] = -sign * x;
  out[3] = b;
  out[4] = sign + y * y * a;
  out[5] = -y;
}
