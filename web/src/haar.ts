// Haar wavelets of light on a cube, and sparse columns of transfer in them (docs/wavelets.md; docs/file-format.md, kind
// "wavelets"). Source: Ng, Ramamoorthi, Hanrahan 2003; the same as basis/haar.h, transfer/haar_transfer.h and
// relight/relight_haar.h of the C++ library.
import { cubeTexel, type CubeLight } from './cube.js';
import { LambentError } from './errors.js';

/** Receivers side by side that have their entries together; tiles that have theirs. */
const tile = 64;
const chunk = 64 * tile;
/** Of a column's tiles, a bit each. */
const tilesBytes = 8;

/** The Morton index of each pixel of a square, row by row. */
function mortonIndices(size: number): Uint32Array {
  const out = new Uint32Array(size * size);
  for (let i = 0; i < out.length; ++i) {
    const x = i % size,
      y = Math.floor(i / size);
    for (let bit = 0; 1 << bit < size; ++bit)
      out[i]! |= (((x >> bit) & 1) << (2 * bit)) | (((y >> bit) & 1) << (2 * bit + 1));
  }
  return out;
}
const morton = new Map<number, Uint32Array>();

/**
 * Coefficients of size x size pixels, row by row, on a square of area 1: the mean, then three a square, squares level
 * by level along a Morton curve. `size` is a power of two.
 */
export function haarTransform(size: number, pixels: ArrayLike<number>): Float64Array {
  const indices = morton.get(size) ?? mortonIndices(size),
    means = new Float64Array(size * size),
    out = new Float64Array(size * size);
  morton.set(size, indices);
  for (let i = 0; i < means.length; ++i) means[indices[i]!] = pixels[i]!;
  for (let side = size / 2; side >= 1; side /= 2) {
    const scale = 0.25 / side,
      first = side * side; // 1 + 3 squares of the levels above
    for (let i = 0; i < side * side; ++i) {
      const [a, b, c, d] = [means[4 * i]!, means[4 * i + 1]!, means[4 * i + 2]!, means[4 * i + 3]!];
      out[first + 3 * i] = scale * (a - b + c - d);
      out[first + 3 * i + 1] = scale * (a + b - c - d);
      out[first + 3 * i + 2] = scale * (a - b - c + d);
      means[i] = 0.25 * (a + b + c + d);
    }
  }
  out[0] = means[0]!;
  return out;
}

/** [face][coefficient][r, g, b]: so that products with columns sum to those of texels. */
export function haarOfLight({ size, energy }: CubeLight): Float32Array {
  const area = size * size,
    out = new Float32Array(18 * area),
    face = new Float64Array(area);
  for (let f = 0; f < 6; ++f)
    for (let c = 0; c < 3; ++c) {
      for (let i = 0; i < area; ++i) face[i] = energy[3 * cubeTexel(size, f, i % size, Math.floor(i / size)) + c]!;
      haarTransform(size, face).forEach((v, k) => (out[3 * (f * area + k) + c] = Math.fround(v) * area));
    }
  return out;
}

export interface HaarHeader {
  /** Of the cube, texels a side of a face: a power of two. */
  size: number;
  channels: 1 | 3;
  receivers: number;
}

/** What of the light is used: columns of the transfer, rising, each of red, green and blue times its step. */
export interface HaarTerms {
  columns: Uint32Array;
  values: Float32Array;
  /** Of the light. */
  count: number;
}

const fail = (why: string): never => {
  throw new LambentError(`holds broken wavelets: ${why}`);
};

/** Where each column begins, chunk after chunk, and the end of the last. */
function columnBegins(lengths: Uint8Array, count: number, bytes: number): Uint32Array {
  // A length takes a byte at least.
  if (count > lengths.length) fail('there are fewer lengths than columns');
  const begins = new Uint32Array(count + 1);
  let at = 0,
    end = 0;
  for (let i = 0; i < count; ++i) {
    let digit = 128;
    for (let scale = 1; digit >= 128; scale *= 128) {
      if (at >= lengths.length) fail('there are fewer lengths than columns');
      digit = lengths[at++]!;
      end += (digit & 127) * scale;
      if (scale > 2 ** 28 || end > bytes) fail('a column is longer than what is there');
    }
    begins[i + 1] = end;
  }
  if (at !== lengths.length) fail('there are more lengths than columns');
  if (end !== bytes) fail(`${bytes} bytes are there, and lengths make ${end}`);
  return begins;
}

export class HaarColumns {
  readonly size: number;
  readonly channels: 1 | 3;
  readonly receivers: number;
  /** Of one channel. */
  readonly width: number;
  /** Bytes of each column, of all receivers. */
  readonly bytes: Float64Array;
  private readonly chunks: number;
  private readonly begins: Uint32Array;
  private readonly signed: Int8Array;
  /** Root of the sum of squares of each column: how much a unit of light in it changes receivers. */
  private readonly norms: Float32Array;

  /** Throws LambentError where columns are not what they promise. */
  constructor(
    { size, channels, receivers }: HaarHeader,
    private readonly data: Uint8Array,
    lengths: Uint8Array,
    private readonly steps: Float32Array,
  ) {
    this.size = size;
    this.channels = channels;
    this.receivers = receivers;
    this.width = 6 * size * size;
    this.chunks = Math.ceil(receivers / chunk);
    const columns = channels * this.width;
    if (steps.length !== columns) fail(`${steps.length} steps are there for ${columns} columns`);
    for (const step of steps) if (!(step >= 0 && step < Infinity)) fail('the step of a column is no number from 0');
    this.begins = columnBegins(lengths, this.chunks * columns, data.length);
    this.signed = new Int8Array(data.buffer, data.byteOffset, data.length);
    this.bytes = new Float64Array(columns);
    const squares = new Float64Array(columns);
    for (let k = 0; k < this.chunks; ++k)
      for (let c = 0; c < columns; ++c) {
        squares[c]! += this.check(k, c);
        this.bytes[c]! += this.begins[k * columns + c + 1]! - this.begins[k * columns + c]!;
      }
    this.norms = Float32Array.from(squares, (sum, c) => Math.fround(Math.sqrt(sum)) * steps[c]!);
  }

  get columns(): number {
    return this.channels * this.width;
  }

  /** Throws where a column's tiles do not end where it does, or name other receivers; its values' squares. */
  private check(k: number, column: number): number {
    const { data, signed, begins, columns } = this,
      end = begins[k * columns + column + 1]!,
      receivers = Math.min(chunk, this.receivers - k * chunk);
    let at = begins[k * columns + column]!,
      squares = 0;
    if (at === end) return 0;
    const lies = (): never => fail(`column ${column} is not as long as its tiles say, or goes beyond the receivers`);
    if (end - at <= tilesBytes) lies();
    const tiles = at;
    at += tilesBytes;
    for (let t = 0; t < tile; ++t) {
      if (!((data[tiles + (t >> 3)]! >> (t & 7)) & 1)) continue;
      const here = Math.min(tile, receivers - t * tile);
      if (here <= 0 || at === end) lies();
      const count = data[at++]!;
      if ((count ? 2 * count : tile) > end - at) lies();
      if (count === 0) for (let i = 0; i < here; ++i) squares += signed[at + i]! ** 2;
      for (let i = 0, before = -1; i < count; ++i) {
        const r = data[at + 2 * i]!;
        if (r >= here || r <= before) lies();
        before = r;
        squares += signed[at + 2 * i + 1]! ** 2;
      }
      at += count ? 2 * count : tile;
    }
    if (at !== end) lies();
    return squares;
  }

  /**
   * The `count` terms (0: all that are not 0) that change receivers most, of light by haarOfLight(); of these the
   * largest whose columns have no more than `bytes` together.
   */
  terms(light: Float32Array, count: number, bytes = Infinity): HaarTerms {
    const { width, channels, norms } = this,
      weights = new Float32Array(width);
    for (let k = 0; k < width; ++k) {
      let sum = 0;
      for (let c = 0; c < 3; ++c) sum += (light[3 * k + c]! * norms[channels === 3 ? c * width + k : k]!) ** 2;
      weights[k] = Math.sqrt(sum);
    }
    let chosen = this.largest(weights, count);
    if (bytes < Infinity) chosen = this.within(chosen, weights, bytes);
    const columns = new Uint32Array(channels * chosen.length),
      values = new Float32Array(3 * columns.length);
    for (let c = 0; c < channels; ++c)
      chosen.forEach((k, i) => {
        const at = c * chosen.length + i,
          column = (columns[at] = c * width + k),
          step = this.steps[column]!;
        if (channels === 3) values[3 * at + c] = light[3 * k + c]! * step;
        else for (let j = 0; j < 3; ++j) values[3 * at + j] = light[3 * k + j]! * step;
      });
    return { columns, values, count: chosen.length };
  }

  /** Rising; of equal weights the first. */
  private largest(weights: Float32Array, count: number): Uint32Array {
    const all = weights.reduce((n, w) => n + Number(w > 0), 0);
    let least = 0,
      ties = Infinity;
    if (count > 0 && count < all) {
      const sorted = Float32Array.from(weights).sort();
      least = sorted[sorted.length - count]!;
      ties = count - sorted.reduce((n, w) => n + Number(w > least), 0);
    }
    const out = new Uint32Array(least > 0 ? count : all);
    let at = 0;
    weights.forEach((w, k) => {
      if (w > least || (w === least && w > 0 && ties-- > 0)) out[at++] = k;
    });
    return out;
  }

  private within(chosen: Uint32Array, weights: Float32Array, bytes: number): Uint32Array {
    const { width, channels } = this,
      size = (k: number): number => {
        let sum = 0;
        for (let c = 0; c < channels; ++c) sum += this.bytes[c * width + k]!;
        return sum;
      };
    let left = bytes;
    if (chosen.reduce((sum, k) => sum + size(k), 0) <= bytes) return chosen;
    const kept = Array.from(chosen)
      .sort((a, b) => weights[b]! - weights[a]! || a - b)
      .filter((k) => (left -= size(k)) >= 0);
    return Uint32Array.from(kept).sort();
  }

  /** T . light, held at 0 or above, since few terms ring: to [receiver][r, g, b, -]. */
  sum({ columns: woken, values }: HaarTerms, out: Float32Array): void {
    const { chunks, columns, begins, receivers } = this;
    out.fill(0, 0, 4 * receivers);
    for (let k = 0; k < chunks; ++k)
      for (let i = 0; i < woken.length; ++i) {
        const at = k * columns + woken[i]!;
        if (begins[at] === begins[at + 1]) continue;
        this.add(begins[at]!, k * chunk, values[3 * i]!, values[3 * i + 1]!, values[3 * i + 2]!, out);
      }
    for (let i = 0; i < 4 * receivers; ++i) if (!(out[i]! > 0)) out[i] = 0;
  }

  /** A column of a chunk whose first receiver this is. */
  private add(begin: number, first: number, r: number, g: number, b: number, out: Float32Array): void {
    const { data, signed, receivers } = this;
    let at = begin + tilesBytes;
    for (let t = 0; t < tile; ++t) {
      if (!((data[begin + (t >> 3)]! >> (t & 7)) & 1)) continue;
      const base = 4 * (first + t * tile),
        count = data[at++]!;
      if (count === 0) {
        const here = Math.min(tile, receivers - first - t * tile);
        for (let i = 0, to = base; i < here; ++i, to += 4) {
          const q = signed[at + i]!;
          if (q === 0) continue;
          out[to]! += q * r;
          out[to + 1]! += q * g;
          out[to + 2]! += q * b;
        }
        at += tile;
      }
      for (let i = 0; i < count; ++i, at += 2) {
        const to = base + 4 * data[at]!,
          q = signed[at + 1]!;
        out[to]! += q * r;
        out[to + 1]! += q * g;
        out[to + 2]! += q * b;
      }
    }
  }
}
