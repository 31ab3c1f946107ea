// Buffer views that `lambent export --web --pack` has packed (docs/file-format.md, "Packed for a browser"): numbers
// rounded to steps, told from what is near them, and coded by how often they are there. They come back as glTF has
// them.
import { LambentError } from './errors.js';
import { isIndex } from './glb.js';
import { toHalf } from './half.js';
import { huffmanDecode } from './huffman.js';

const most = 2 ** 31; // bytes of a view; what browsers take as one array is little more

const fail = (): never => {
  throw new LambentError('holds a packed buffer view that does not fit its description');
};

/** Bytes from the first to the last. */
class Stream {
  private at = 0;
  private readonly view: DataView;

  constructor(private readonly bytes: Uint8Array) {
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }
  byte(): number {
    return this.at < this.bytes.length ? this.bytes[this.at++]! : fail();
  }
  private word(): number {
    if (this.at + 4 > this.bytes.length) fail();
    this.at += 4;
    return this.view.getUint32(this.at - 4, true);
  }
  coded(): Uint8Array {
    const count = this.word(),
      length = this.word();
    if (this.at + length > this.bytes.length) fail();
    this.at += length;
    return huffmanDecode(this.bytes.subarray(this.at - length, this.at), count) ?? fail();
  }
  end(): void {
    if (this.at !== this.bytes.length) fail();
  }
}

/** Numbers 0, -1, 1, -2, ... as 0, 1, 2, 3, ...: below 252 a byte, else 251 + n and n bytes. */
function readNumbers(symbols: Uint8Array, out: Int32Array): void {
  let at = 0;
  for (let i = 0; i < out.length; ++i) {
    if (at >= symbols.length) fail();
    let folded = symbols[at++]!;
    if (folded > 251) {
      const n = folded - 251;
      if (at + n > symbols.length) fail();
      folded = 0;
      for (let k = 0; k < n; ++k) folded |= symbols[at++]! << (8 * k);
    }
    out[i] = (folded >>> 1) ^ -(folded & 1);
  }
  if (at !== symbols.length) fail();
}

function readIntegers(stream: Stream, count: number): Int32Array {
  const lag = stream.byte(),
    out = new Int32Array(count);
  if (lag > 3) fail();
  readNumbers(stream.coded(), out);
  if (lag > 0) for (let i = lag; i < count; ++i) out[i] = (out[i]! + out[i - lag]!) | 0;
  return out;
}

/** [row][group][column] as in the file's stream, columns in their order; `use` is given each column of a group. */
function readRows(
  stream: Stream,
  rows: number,
  groups: number,
  order: readonly number[],
  use: (group: number, column: number, values: Int32Array) => void,
): void {
  const parents = stream.coded();
  if (parents.length !== rows) fail();
  for (let r = 0; r < rows; ++r) if (parents[r]! > r) fail();
  const first = new Int32Array(rows),
    values = new Int32Array(rows);
  for (const c of order)
    for (let g = 0; g < groups; ++g) {
      const way = stream.byte();
      if (way > 3 || (g === 0 && way > 1)) fail();
      readNumbers(stream.coded(), values);
      if (way & 1)
        for (let r = 0; r < rows; ++r) if (parents[r]! > 0) values[r] = (values[r]! + values[r - parents[r]!]!) | 0;
      if (way & 2) for (let r = 0; r < rows; ++r) values[r] = (values[r]! + first[r]!) | 0;
      if (g === 0) first.set(values);
      use(g, c, values);
    }
}

/** Of transfer: its first bands and its lamps make a picture before the other columns are there. */
export interface FirstColumns {
  order: number;
  lamps: number;
  /** Of the packed view. */
  byteLength: number;
  /** There is no more than these. */
  alone: boolean;
}

interface Description {
  form: string;
  byteLength: number;
  rows: number;
  groups: number;
  columns: number;
  step: number;
  first: FirstColumns | undefined;
}

function readFirst(given: unknown, columns: number): FirstColumns | undefined {
  if (given === undefined) return undefined;
  const { order, lamps, byteLength, alone = false } = (given ?? {}) as Record<string, unknown>;
  if (!isIndex(order, 32) || order < 1 || !isIndex(lamps, columns) || order * order + lamps >= columns) return fail();
  if (!isIndex(byteLength, most) || typeof alone !== 'boolean') return fail();
  return { order, lamps, byteLength, alone };
}

/** The columns that are there, as they come. */
function columnOrder(columns: number, first: FirstColumns | undefined): number[] {
  const rising = Array.from({ length: columns }, (_, c) => c);
  if (!first) return rising;
  const bands = first.order ** 2,
    lamps = columns - first.lamps;
  return [...rising.slice(0, bands), ...rising.slice(lamps), ...(first.alone ? [] : rising.slice(bands, lamps))];
}

function readDescription(given: unknown): Description {
  const of = (typeof given === 'object' && given !== null ? given : {}) as Record<string, unknown>,
    { form, byteLength, rows = 0, groups = 1, columns = 1, step = 1 } = of;
  if (typeof form !== 'string' || typeof step !== 'number' || !Number.isFinite(step)) fail();
  if (!isIndex(byteLength, most) || !isIndex(rows, most) || !isIndex(groups, 4096) || !isIndex(columns, 1024))
    return fail();
  if (groups < 1 || columns < 1) fail();
  const first = readFirst(of['first'], columns);
  return { form: form as string, byteLength, rows, groups, columns, step: step as number, first };
}

/** What of a view comes first, where it says so; throws LambentError where that is nonsense. */
export const firstColumns = (given: unknown): FirstColumns | undefined => readDescription(given).first;

/**
 * The bytes that glTF knows of a packed view; `given` is what the view says of it. Columns that are not there yet are
 * zero.
 */
export function unpackView(bytes: ArrayBuffer, given: unknown): ArrayBuffer {
  const { form, byteLength, rows, groups, columns, step, first } = readDescription(given),
    order = columnOrder(columns, first),
    stream = new Stream(new Uint8Array(bytes));
  // A number takes a bit at least.
  const expects = (numbers: number): void => void (numbers > 8 * bytes.byteLength && fail());
  let out: Uint16Array | Uint32Array | Float32Array;
  if (form === 'u16' || form === 'u32') {
    const size = form === 'u16' ? 2 : 4;
    if (byteLength % size !== 0) fail();
    expects(byteLength / size);
    out = (form === 'u16' ? Uint16Array : Uint32Array).from(readIntegers(stream, byteLength / size));
  } else if (form === 'floats') {
    const count = byteLength / (4 * columns);
    if (!Number.isInteger(count)) fail();
    expects(count * columns);
    const floats = (out = new Float32Array(count * columns));
    readRows(stream, count, 1, order, (_, c, values) => {
      for (let r = 0; r < count; ++r) floats[r * columns + c] = values[r]! * step;
    });
  } else if (form === 'half blocks' || form === 'single blocks') {
    const width = groups * columns,
      length = Math.ceil(rows / 16) * 16 * width,
      half = form === 'half blocks';
    if (byteLength !== length * (half ? 2 : 4)) fail();
    expects(rows * groups * order.length);
    const blocks = (out = half ? new Uint16Array(length) : new Float32Array(length));
    readRows(stream, rows, groups, order, (g, c, values) => {
      for (let r = 0; r < rows; ++r) {
        const value = values[r]! * step;
        blocks[((r >> 4) * width + g * columns + c) * 16 + (r & 15)] = half ? toHalf(value) : value;
      }
    });
  } else return fail();
  stream.end();
  return out.buffer as ArrayBuffer;
}
