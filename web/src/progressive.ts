// Files that `lambent export --web --pack` has packed, drawn before all of them is there: all but transfer comes first,
// then transfer's first bands and the scene's lamps, then the other bands (docs/file-format.md, "Packed for a
// browser"). One request, read as it comes, which any server answers.
import { LoaderUtils } from 'three';
import type { GLTF, GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { LambentError } from './errors.js';
import { extensionName, isIndex } from './glb.js';
import { firstColumns, unpackView } from './packed_views.js';
import { bakedScene } from './plugin.js';

type Json = Record<string, unknown>;
const isObject = (of: unknown): of is Json => typeof of === 'object' && of !== null && !Array.isArray(of);

interface TransferView {
  document: Json;
  /** What the buffer view of the transfer says. */
  view: Json;
  packed: Json;
  begin: number;
  length: number;
  /** Where the binary chunk begins in the file. */
  binary: number;
}

const glbMagic = 0x46546c67,
  jsonChunk = 0x4e4f534a,
  binaryChunk = 0x004e4942;

/** The packed transfer of a file whose JSON is there, where all else lies before it; undefined of any other file. */
function transferView(head: Uint8Array): TransferView | undefined {
  const words = new DataView(head.buffer, head.byteOffset),
    length = words.getUint32(12, true);
  let document: unknown;
  try {
    document = JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(head.subarray(20, 20 + length)));
  } catch {
    return undefined; // said by who reads the whole
  }
  if (!isObject(document) || !isObject(document['extensions'])) return undefined;
  const extension = document['extensions'][extensionName],
    views = document['bufferViews'];
  if (!isObject(extension) || !isObject(extension['transfer']) || !Array.isArray(views)) return undefined;
  const view: unknown = views[Number(extension['transfer']['bufferView'])],
    packed = isObject(view) && isObject(view['extensions']) ? view['extensions'][extensionName] : undefined;
  if (!isObject(view) || !isObject(packed)) return undefined;
  const endOf = (of: unknown): number =>
    isObject(of) ? Number(of['byteOffset'] ?? 0) + Number(of['byteLength']) : Infinity;
  const { byteOffset: begin = 0, byteLength } = view;
  if (!isIndex(begin) || !isIndex(byteLength)) return undefined;
  if (!views.every((of) => of === view || endOf(of) <= begin)) return undefined;
  return { document, view, packed, begin, length: byteLength, binary: 28 + length };
}

/** A .glb of a document and so many bytes of its binary chunk. */
function joinGlb(document: Json, binary: Uint8Array): ArrayBuffer {
  const text = new TextEncoder().encode(JSON.stringify(document)),
    jsonLength = Math.ceil(text.length / 4) * 4,
    binaryLength = Math.ceil(binary.length / 4) * 4,
    glb = new Uint8Array(28 + jsonLength + binaryLength),
    words = new DataView(glb.buffer);
  [glbMagic, 2, glb.length, jsonLength, jsonChunk].forEach((word, i) => words.setUint32(4 * i, word, true));
  glb.set(text, 20);
  glb.fill(0x20, 20 + text.length, 20 + jsonLength);
  words.setUint32(20 + jsonLength, binaryLength, true);
  words.setUint32(24 + jsonLength, binaryChunk, true);
  glb.set(binary, 28 + jsonLength);
  return glb.buffer;
}

/** A file as it comes. */
class Incoming {
  done = 0;
  private buffer = new Uint8Array(1 << 16);
  private view: TransferView | undefined;
  private isRead = false; // the JSON

  push(piece: Uint8Array): void {
    if (this.done + piece.length > this.buffer.length) {
      const larger = new Uint8Array(Math.max(2 * this.buffer.length, this.done + piece.length));
      larger.set(this.buffer.subarray(0, this.done));
      this.buffer = larger;
    }
    this.buffer.set(piece, this.done);
    this.done += piece.length;
  }
  private word(at: number): number {
    return new DataView(this.buffer.buffer).getUint32(at, true);
  }
  /** As a .glb says it of itself; undefined of other files. */
  get total(): number | undefined {
    return this.done >= 12 && this.word(0) === glbMagic ? this.word(8) : undefined;
  }
  get whole(): ArrayBuffer {
    return this.buffer.buffer.slice(0, this.done);
  }

  private get transfer(): TransferView | undefined {
    if (this.isRead || this.done < 20 || this.total === undefined || this.word(16) !== jsonChunk) return this.view;
    if (this.done < 20 + this.word(12)) return undefined;
    this.isRead = true;
    return (this.view = transferView(this.buffer.subarray(0, this.done)));
  }

  /** What can be drawn now as a file of its own, and of how many bands it is. */
  first(): { bytes: ArrayBuffer; bands: number } | undefined {
    const { transfer } = this;
    if (!transfer) return undefined;
    const { document, view, packed, begin, length, binary } = transfer;
    let bands: number, bytes: number;
    try {
      const first = firstColumns(packed);
      if (!first || first.alone || first.byteLength >= length) return undefined;
      bands = first.order;
      bytes = begin + first.byteLength;
    } catch {
      return undefined; // said by who reads the whole
    }
    if (this.done < binary + bytes) return undefined;
    const cut = structuredClone(document),
      cutView = (cut['bufferViews'] as Json[])[(document['bufferViews'] as Json[]).indexOf(view)]!,
      extension = (cut['extensions'] as Record<string, Json>)[extensionName]!,
      cutPacked = (cutView['extensions'] as Record<string, Json>)[extensionName]!;
    cutView['byteLength'] = bytes - begin;
    cutPacked['first'] = { ...(packed['first'] as Json), alone: true };
    for (const of of [(cut['buffers'] as Json[] | undefined)?.[0], extension['written']])
      if (isObject(of)) of['byteLength'] = bytes;
    return { bytes: joinGlb(cut, this.buffer.subarray(binary, binary + bytes)), bands };
  }

  /** The transfer, all of which is there. */
  values(): ArrayBuffer {
    const { binary, begin, length, packed } = this.transfer!;
    return unpackView(this.buffer.slice(binary + begin, binary + begin + length).buffer, packed);
  }
}

/** A file, or what can be drawn before the rest of it. */
export interface FirstPart {
  /** A .glb or .gltf that can be loaded. */
  bytes: ArrayBuffer;
  /** Where it is not all: of how many bands it is, and the values of the transfer once they are there. */
  bands?: number;
  rest?: Promise<ArrayBuffer>;
}

const count = (bytes: number): string => bytes.toLocaleString('en');

/** Told how many bytes are there, and the share of all, 0 where that is not known. */
export type Progress = (bytes: number, share: number) => void;

/**
 * Reads a file until it can be drawn, and goes on reading; with `whole` until it is all there. Rejects, as `rest` does,
 * with LambentError where the connection breaks.
 */
export async function readProgressive(answer: Response, onProgress?: Progress, whole = false): Promise<FirstPart> {
  const reader = answer.body!.getReader(),
    length = Number(answer.headers.get('content-length') ?? 0),
    incoming = new Incoming();
  /** Until `enough` of it is there; whether there is more. */
  const read = async <T>(enough: () => T | undefined): Promise<T | undefined> => {
    for (;;) {
      const found = enough();
      if (found !== undefined) return found;
      const piece = await reader.read().catch((error: unknown) => {
        if (error instanceof Error && error.name === 'AbortError') throw error;
        throw brokenOff(incoming.done, incoming.total ?? length);
      });
      if (piece.done) return undefined;
      incoming.push(piece.value);
      const total = incoming.total ?? length;
      onProgress?.(incoming.done, total > 0 ? Math.min(1, incoming.done / total) : 0);
    }
  };
  const end = async (): Promise<void> => {
    await read(() => undefined);
    const total = incoming.total ?? length;
    if (incoming.done < total) throw brokenOff(incoming.done, total);
  };
  const first = whole ? undefined : await read(() => incoming.first());
  if (!first) {
    await end();
    return { bytes: incoming.whole };
  }
  const rest = end().then(() => incoming.values());
  rest.catch(() => undefined); // whoever waits for it is told
  return { ...first, rest };
}

const brokenOff = (done: number, total: number): LambentError =>
  new LambentError(`broke off after ${count(done)}${total > 0 ? ` of ${count(total)}` : ''} bytes`);

export interface ProgressiveOptions {
  /**
   * As soon as the scene can be drawn: of how many bands it is then, and of how many in the end. Where a file is not
   * packed, or has no more than its first bands, once it is there.
   */
  onFirst?: (gltf: GLTF, bands: number, of: number) => void;
  onProgress?: Progress;
  signal?: AbortSignal;
}

/**
 * Loads a file by a GLTFLoader with the plugin, so that it can be drawn before all of it is there: the scene that
 * onFirst() is given has the other bands when the promise is fulfilled, with the light of its last relight(). Rejects
 * with LambentError where there is no such file or the connection breaks; what onFirst() was given stays as it is.
 */
export async function loadProgressive(
  loader: GLTFLoader,
  url: string,
  { onFirst, onProgress, signal }: ProgressiveOptions = {},
): Promise<GLTF> {
  const answer = await fetch(url, signal ? { signal } : {}).catch((error: unknown) => {
    if (error instanceof Error && error.name === 'AbortError') throw error;
    throw new LambentError(`${url} cannot be reached`);
  });
  if (!answer.ok || !answer.body) throw new LambentError(`${url} cannot be had: the server says ${answer.status}`);
  const named = (error: unknown): never => {
    throw error instanceof LambentError ? new LambentError(`${url} ${error.message}`) : error;
  };
  const { bytes, bands, rest } = await readProgressive(answer, onProgress).catch(named),
    gltf = await loader.parseAsync(bytes, LoaderUtils.extractUrlBase(url)),
    baked = bakedScene(gltf),
    order = baked?.transfer.order ?? 0;
  onFirst?.(gltf, bands ?? order, order);
  if (!rest) return gltf;
  baked!.refine(await rest.catch(named));
  return gltf;
}
