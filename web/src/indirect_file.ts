// Direct-to-indirect transport as files keep it (docs/file-format.md, kind "indirect"; baked/indirect_codec.cpp). All
// that a file says is checked: a tree without cycles, nodes and surfels that exist, rows that see no more than a
// hemisphere.
import { DataUtils } from 'three';
import { LambentError } from './errors.js';
import { isIndex, isViews } from './glb.js';
import { noReceiver } from './header.js';
import { huffmanDecode } from './huffman.js';
import type { TransferSource } from './kinds.js';

/** Surfels that a receiver reads, at most. */
export const kernelSlots = 8;
const maxSurfels = 1 << 22,
  maxLevels = 16,
  kernelStep = 1 / 64;

/** Points on surfaces, level by level: level l is the first counts[l] of them; the last has them all, the leaves. */
export interface Surfels {
  counts: number[];
  /** Of each level, and of one more: nodes are the surfels of level 0, then those of level 1, ... */
  firstNode: number[];
  spacings: number[];
  positions: Float32Array;
  normals: Float32Array;
  /** What leaves weigh in means. */
  areas: Float32Array;
  albedos: Float32Array;
  /** Into `names`: a wall is repainted by its name. */
  materials: Uint32Array;
  names: string[];
  /** Of levels 1 and up, one after another: the surfel of the level above. */
  parents: Uint32Array;
}

/** Rows over nodes: entries first[r] ... first[r + 1], each a node and its share of the hemisphere. */
export interface NodeRows {
  first: Uint32Array;
  nodes: Uint32Array;
  shares: Float32Array;
}

export interface IndirectOperator {
  surfels: Surfels;
  gatherLevel: number; // its surfels have rows
  gathering: number;
  rows: NodeRows;
  receivers: number;
  /** Kernels, [receiver][kernelSlots]: gathering surfels and weights, 0 where a slot is not used. */
  readSurfels: Uint32Array;
  readWeights: Float32Array;
  /** What storing rows so has lost, relative. */
  error: number;
  fileBytes: number;
}

type Json = Readonly<Record<string, unknown>>;
const isObject = (value: unknown): value is Json =>
  typeof value === 'object' && value !== null && !Array.isArray(value);
const broken = (what: string): LambentError => new LambentError(`holds direct-to-indirect light whose ${what}`);

/** Reads views, and counts their bytes. */
class Reader {
  bytes = 0;
  constructor(private readonly source: TransferSource) {}

  async view(object: Json, key: string): Promise<Uint8Array> {
    const views = object[key];
    if (!isViews(views)) throw broken(`"${key}" is missing`);
    const bytes = new Uint8Array(await this.source.bufferView(views));
    this.bytes += bytes.length;
    return bytes;
  }
  /** `count` numbers of `size` bytes each. */
  async numbers(object: Json, key: string, count: number, size: number): Promise<DataView> {
    const bytes = await this.view(object, key);
    if (bytes.length !== count * size)
      throw broken(`"${key}" takes ${bytes.length.toLocaleString('en')} bytes and not ${count * size}`);
    return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }
  async floats(object: Json, key: string, count: number): Promise<Float32Array> {
    const view = await this.numbers(object, key, count, 4);
    return Float32Array.from({ length: count }, (_, i) => view.getFloat32(4 * i, true));
  }
  async halves(object: Json, key: string, count: number): Promise<Float32Array> {
    const view = await this.numbers(object, key, count, 2);
    return Float32Array.from({ length: count }, (_, i) => DataUtils.fromHalfFloat(view.getUint16(2 * i, true)));
  }
  async indices(object: Json, key: string, count: number, size: number): Promise<Uint32Array> {
    const view = await this.numbers(object, key, count, size);
    const at =
      size === 1
        ? (i: number) => view.getUint8(i)
        : size === 2
          ? (i: number) => view.getUint16(2 * i, true)
          : (i: number) => view.getUint32(4 * i, true);
    return Uint32Array.from({ length: count }, (_, i) => at(i));
  }
  /** Bytes, coded by how often each is there, or as they are. */
  async coded(object: Json, key: string): Promise<Uint8Array> {
    const member = object[key];
    if (!isObject(member)) return this.view(object, key);
    const count = member['bytes'];
    if (!isIndex(count)) throw broken(`"bytes" of "${key}" is no number`);
    const decoded = huffmanDecode(await this.view(member, 'coded'), count);
    if (!decoded) throw broken(`"${key}" is broken`);
    return decoded;
  }
}

const indexBytes = (limit: number): number => (limit <= 256 ? 1 : limit <= 65536 ? 2 : 4);

function numberList(object: Json, key: string, count: number): number[] {
  const list = object[key];
  if (!Array.isArray(list) || list.length !== count || !list.every((n) => Number.isFinite(n)))
    throw broken(`"${key}" is not a list of ${count} numbers`);
  return list as number[];
}

/** Base-128 integers of bytes, as far as 32 bits. */
class Integers {
  at = 0;
  constructor(
    private readonly bytes: Uint8Array,
    private readonly error: LambentError,
  ) {}
  next(): number {
    let value = 0;
    for (let scale = 1; ; scale *= 128) {
      if (this.at >= this.bytes.length || scale > 2 ** 28) throw this.error;
      const byte = this.bytes[this.at++]!;
      value += (byte & 127) * scale;
      if (byte < 128) break;
    }
    if (value > 0xffffffff) throw this.error;
    return value;
  }
  byte(): number {
    if (this.at >= this.bytes.length) throw this.error;
    return this.bytes[this.at++]!;
  }
  get left(): number {
    return this.bytes.length - this.at;
  }
}

/** Rows over `nodes` nodes; their shares sum to a hemisphere at most, so that bounces do not grow without end. */
async function readRows(read: Reader, object: Json, rows: number, nodes: number): Promise<NodeRows> {
  const { entries } = object,
    error = broken('rows are broken');
  const packed = await read.coded(object, 'bufferView'),
    weights = await read.coded(object, 'weights'),
    scales = await read.floats(object, 'scales', rows);
  if (!isIndex(entries, 0x7fffffff) || weights.length !== entries || packed.length < entries) throw error;
  const out = { first: new Uint32Array(rows + 1), nodes: new Uint32Array(entries), shares: new Float32Array(entries) },
    from = new Integers(packed, error);
  let at = 0;
  for (let r = 0; r < rows; ++r) {
    const count = from.next(),
      scale = scales[r]!;
    if (count > entries - at) throw error;
    let node = 0,
      sum = 0;
    for (let e = 0; e < count; ++e, ++at) {
      const step = from.next();
      node += step;
      if (node >= nodes || (e > 0 && step === 0)) throw broken(`node ${node} does not exist, or stands out of order`);
      const share = weights[at]! * weights[at]! * scale;
      out.nodes[at] = node;
      out.shares[at] = share;
      sum += share;
    }
    if (!(scale >= 0) || !(sum <= 1.001)) throw broken(`row ${r} sees more than a hemisphere`);
    out.first[r + 1] = at;
  }
  if (from.left > 0 || at !== entries) throw error;
  return out;
}

function unfoldOctahedron(x: number, y: number, out: Float32Array, at: number): void {
  const z = 1 - Math.abs(x) - Math.abs(y),
    over = Math.max(-z, 0),
    a = x - Math.sign(x) * over,
    b = y - Math.sign(y) * over,
    length = Math.hypot(a, b, z) || 1;
  out[at] = a / length;
  out[at + 1] = b / length;
  out[at + 2] = z / length;
}

/** Places of 21 bits an axis in a box, normals in the octahedral map, areas the upper halves of floats. */
async function readPacked(read: Reader, object: Json, s: Surfels, n: number): Promise<void> {
  const last = 2 ** 21 - 1,
    min = numberList(object, 'min', 3),
    max = numberList(object, 'max', 3),
    places = await read.numbers(object, 'places', n, 8),
    directions = await read.numbers(object, 'directions', n, 4),
    areas = await read.numbers(object, 'weights', n, 2),
    bits = new DataView(new ArrayBuffer(4));
  for (let i = 0; i < n; ++i) {
    const low = places.getUint32(8 * i, true),
      high = places.getUint32(8 * i + 4, true);
    const at = [low & last, (low >>> 21) | ((high & 0x3ff) << 11), (high >>> 10) & last];
    for (let k = 0; k < 3; ++k)
      s.positions[3 * i + k] = at[k] === last ? max[k]! : min[k]! + ((max[k]! - min[k]!) * at[k]!) / last;
    const x = directions.getUint16(4 * i, true),
      y = directions.getUint16(4 * i + 2, true);
    unfoldOctahedron((2 * x) / 65535 - 1, (2 * y) / 65535 - 1, s.normals, 3 * i);
    bits.setUint32(0, areas.getUint16(2 * i, true) * 65536);
    s.areas[i] = bits.getFloat32(0);
  }
  s.materials = await read.indices(object, 'materials', n, indexBytes(s.names.length));
  // Surfels that the level above has too are their own parents, and not in the file.
  const levels = s.counts.length,
    added = await read.indices(object, 'parents', n - s.counts[0]!, indexBytes(levels > 1 ? s.counts[levels - 2]! : 1));
  for (let l = 1; l < levels; ++l) {
    const first = s.firstNode[l]! - s.counts[0]!,
      above = s.counts[l - 1]!;
    for (let i = 0; i < s.counts[l]!; ++i) s.parents[first + i] = i < above ? i : added[i - s.counts[0]!]!;
  }
}

/** As files of older builds have them: single floats, and all parents; areas as lambent rounds them then. */
async function readWhole(read: Reader, object: Json, s: Surfels, n: number): Promise<void> {
  s.positions = await read.floats(object, 'positions', 3 * n);
  s.normals = await read.floats(object, 'normals', 3 * n);
  s.areas = await read.floats(object, 'areas', n);
  const bits = new Uint32Array(s.areas.buffer);
  for (let i = 0; i < n; ++i) bits[i] = (bits[i]! + 0x7fff + ((bits[i]! >>> 16) & 1)) & 0xffff0000;
  s.materials = await read.indices(object, 'materials', n, Math.max(2, indexBytes(s.names.length)));
  s.parents = await read.indices(object, 'parents', s.parents.length, 4);
}

async function readSurfels(read: Reader, object: Json): Promise<Surfels> {
  const { levels: counts, names } = object;
  if (
    !Array.isArray(counts) ||
    counts.length < 1 ||
    counts.length > maxLevels ||
    !counts.every((n, l) => isIndex(n, maxSurfels) && n >= (l > 0 ? (counts[l - 1] as number) : 1))
  )
    throw broken('"levels" is no rising list of numbers of surfels');
  if (!Array.isArray(names) || !names.every((name) => typeof name === 'string'))
    throw broken('"names" is no list of materials');
  const levels = counts as number[],
    n = levels.at(-1)!,
    firstNode = [0];
  for (const count of levels) firstNode.push(firstNode.at(-1)! + count);
  const spacings = numberList(object, 'spacings', levels.length);
  if (!spacings.every((s, l) => s > 0 && (l === 0 || s <= spacings[l - 1]!)))
    throw broken('"spacings" are out of range');
  // Before anything is made that a file could make large.
  const albedos = await read.halves(object, 'albedos', 3 * n);
  const s: Surfels = {
    counts: levels,
    firstNode,
    spacings,
    positions: new Float32Array(3 * n),
    normals: new Float32Array(3 * n),
    areas: new Float32Array(n),
    albedos,
    materials: new Uint32Array(0),
    names,
    parents: new Uint32Array(firstNode.at(-1)! - levels[0]!),
  };
  await (object['places'] !== undefined ? readPacked : readWhole)(read, object, s, n);
  checkSurfels(s, n);
  return s;
}

function checkSurfels(s: Surfels, n: number): void {
  for (let l = 1, at = 0; l < s.counts.length; ++l)
    for (let i = 0; i < s.counts[l]!; ++i, ++at) {
      const parent = s.parents[at]!;
      if (parent >= s.counts[l - 1]!) throw broken(`parent ${parent} does not exist on level ${l - 1}`);
      if (i < s.counts[l - 1]! && parent !== i) throw broken(`surfel ${i} is not its own parent on level ${l - 1}`);
    }
  const { positions: p, normals: m, albedos: a, areas } = s;
  for (let i = 0; i < n; ++i) {
    const far = Math.max(Math.abs(p[3 * i]!), Math.abs(p[3 * i + 1]!), Math.abs(p[3 * i + 2]!)),
      length = Math.hypot(m[3 * i]!, m[3 * i + 1]!, m[3 * i + 2]!),
      color = [a[3 * i]!, a[3 * i + 1]!, a[3 * i + 2]!];
    if (s.materials[i]! >= s.names.length) throw broken(`surfel ${i} has no material`);
    if (
      !(far <= 1e9) ||
      !(Math.abs(length - 1) < 1e-2) ||
      !(areas[i]! > 0 && areas[i]! < Infinity) ||
      !color.every((c) => c >= 0 && c <= 1)
    )
      throw broken(`surfel ${i} has a place, normal, area or albedo out of range`);
  }
}

interface KernelTable {
  surfels: Uint32Array;
  weights: Float32Array;
}

/** Kernels of neighbours along a curve, which have most of their surfels in common. */
function unpackKernels(bytes: Uint8Array, receivers: number, gathering: number): KernelTable {
  const error = broken('kernels of receivers are broken');
  if (receivers > bytes.length / 2) throw error; // two bytes each at least
  const from = new Integers(bytes, error),
    surfels = new Uint32Array(receivers * kernelSlots),
    weights = new Float32Array(receivers * kernelSlots);
  let before: number[] = [];
  for (let r = 0; r < receivers; ++r) {
    const again = from.byte(),
      others = from.byte();
    if (again >> before.length || others > kernelSlots) throw error;
    const all = before.filter((_, i) => (again >> i) & 1);
    if (all.length + others > kernelSlots) throw error;
    for (let i = 0, surfel = 0; i < others; ++i) {
      surfel += from.next();
      if (surfel >= gathering) throw broken(`receiver ${r} reads surfel ${surfel}, which has no row`);
      all.push(surfel);
    }
    all.sort((a, b) => a - b);
    for (let i = 0; i < all.length; ++i) {
      surfels[kernelSlots * r + i] = all[i]!;
      weights[kernelSlots * r + i] = ((from.byte() << 24) >> 24) * kernelStep;
    }
    before = all;
  }
  if (from.left > 0) throw error;
  return { surfels, weights };
}

async function readKernels(read: Reader, object: Json, receivers: number, gathering: number): Promise<KernelTable> {
  if (object['bufferView'] !== undefined)
    return unpackKernels(await read.coded(object, 'bufferView'), receivers, gathering);
  // Of older builds.
  const slots = receivers * kernelSlots,
    surfels = await read.indices(object, 'surfels', slots, Math.max(2, indexBytes(gathering))),
    weights = await read.halves(object, 'weights', slots);
  for (const s of surfels) if (s >= gathering) throw broken(`kernels read surfel ${s}, which has no row`);
  for (const w of weights) if (!(Math.abs(w) <= 8)) throw broken('kernels have a weight out of range');
  const steps = (w: number): number => Math.sign(w) * Math.min(127, Math.round(Math.abs(w) / kernelStep));
  weights.forEach((w, i) => (weights[i] = steps(w) * kernelStep));
  return { surfels, weights };
}

/** The operator of a file; throws LambentError where anything of it is out of range. */
export async function readOperator(source: TransferSource): Promise<IndirectOperator> {
  const { transfer } = source.extension,
    { receivers, surfels: object, kernels, gatherLevel, error } = transfer,
    read = new Reader(source);
  if (!isIndex(receivers, noReceiver - 1) || receivers < 1) throw new LambentError('"receivers" is out of range');
  if (!isObject(object) || !isObject(kernels)) throw broken('"surfels" or "kernels" is missing');
  const surfels = await readSurfels(read, object);
  if (!isIndex(gatherLevel, surfels.counts.length - 1)) throw broken('gathering level does not exist');
  const gathering = surfels.counts[gatherLevel]!,
    rows = await readRows(read, transfer, gathering, surfels.firstNode.at(-1)!),
    table = await readKernels(read, kernels, receivers, gathering);
  return {
    surfels,
    gatherLevel,
    gathering,
    rows,
    receivers,
    readSurfels: table.surfels,
    readWeights: table.weights,
    error: typeof error === 'number' ? error : 0,
    fileBytes: read.bytes,
  };
}
