// Transfer in clusters (docs/file-format.md, "Clusters"): a receiver's is its cluster's mean and a weighted sum of the
// cluster's components. It is unfolded while loading, to the blocks that dense transfer has in the file (half floats),
// and drawn as that is: what is small is what travels.
//
// Budget: the graphics card's of dense transfer (block_texture.ts); while loading as much again.
import { DataUtils } from 'three';
import { block } from './block_texture.js';
import { LambentError } from './errors.js';
import { isIndex, isViews } from './glb.js';
import { toHalf } from './half.js';
import type { TransferHeader } from './header.js';
import { limits, type TransferSource } from './kinds.js';

const maxClusters = 65535,
  maxRank = 64;

export interface Clusters {
  rank: number;
  /** Values of a receiver: [row][channel][column]. */
  values: number;
  /** [cluster][1 + rank][values]: a mean and components. */
  vectors: Float32Array;
  clusterOf: Uint16Array;
  /** Halves, [receiver][rank]. */
  weights: Uint16Array;
}

/** Throws LambentError where transfer of so many receivers and values, in half floats, is more than is unfolded. */
export function checkUnfolded(receivers: number, values: number): void {
  if (2 * receivers * values > limits.unfolded)
    throw new LambentError(
      `has ${receivers.toLocaleString('en')} receivers of ${values.toLocaleString('en')} values, ` +
        `more than ${limits.unfolded / 2 ** 20} MiB once unfolded; "lambent render" draws it`,
    );
}

/** Blocks of 16 receivers, [block][value][16], half floats: what the file would have of dense transfer. */
export function unfoldClusters({ rank, values, vectors, clusterOf, weights }: Clusters): Uint16Array {
  const receivers = clusterOf.length,
    out = new Uint16Array(Math.ceil(receivers / block) * values * block),
    sum = new Float32Array(values);
  for (let r = 0; r < receivers; ++r) {
    const mean = clusterOf[r]! * (1 + rank) * values;
    sum.set(vectors.subarray(mean, mean + values));
    for (let i = 0; i < rank; ++i) {
      const w = DataUtils.fromHalfFloat(weights[r * rank + i]!),
        from = mean + (1 + i) * values;
      for (let k = 0; k < values; ++k) sum[k]! += w * vectors[from + k]!;
    }
    storeHalves(sum, out, r);
  }
  return out;
}

/** Values of receiver `r` into blocks. */
export function storeHalves(values: Float32Array, out: Uint16Array, r: number): void {
  let to = Math.floor(r / block) * values.length * block + (r % block);
  for (let k = 0; k < values.length; ++k, to += block) out[to] = toHalf(values[k]!);
}

/** Values of dense transfer, or of clusters unfolded to them, and the bytes that the file has of it. */
export interface StoredValues {
  values: ArrayBuffer;
  fileBytes: number;
}

/** `values` of a receiver: rows times channels times columns. Throws LambentError where clusters are broken. */
export async function readStored(
  source: TransferSource,
  header: TransferHeader,
  values: number,
): Promise<StoredValues> {
  const { cpca } = source.extension.transfer;
  if (cpca === undefined) {
    const dense = await source.bufferView(header.bufferView);
    return { values: dense, fileBytes: dense.byteLength };
  }
  const { clusters, rank, clusterOf, weights } = (typeof cpca === 'object' ? (cpca ?? {}) : {}) as Record<
    string,
    unknown
  >;
  if (!isIndex(clusters, maxClusters) || clusters < 1) throw new LambentError('"clusters" is out of range');
  if (!isIndex(rank, maxRank)) throw new LambentError('"rank" is out of range');
  if (header.precision !== 'half') throw new LambentError('holds clusters whose "precision" is not half');
  checkUnfolded(header.receivers, values);
  const view = async (name: string, index: unknown, bytes: number): Promise<ArrayBuffer> => {
    if (!isViews(index)) throw new LambentError(`clusters have no "${name}"`);
    const found = await source.bufferView(index);
    if (found.byteLength !== bytes)
      throw new LambentError(`clusters' "${name}" holds ${found.byteLength} bytes where its header makes ${bytes}`);
    return found;
  };
  const read = {
    vectors: new Float32Array(await view('bufferView', header.bufferView, 4 * clusters * (1 + rank) * values)),
    clusterOf: new Uint16Array(await view('clusterOf', clusterOf, 2 * header.receivers)),
    weights: new Uint16Array(await view('weights', weights, 2 * header.receivers * rank)),
  };
  for (const v of read.vectors) if (!Number.isFinite(v)) throw new LambentError("a cluster's vector is not finite");
  // Unfolded it would be the greatest half float.
  if (read.weights.some((w) => (w & 0x7c00) === 0x7c00)) throw new LambentError("a cluster's weight is not finite");
  for (const k of read.clusterOf) if (k >= clusters) throw new LambentError(`cluster ${k} does not exist`);
  return {
    values: unfoldClusters({ rank, values, ...read }).buffer as ArrayBuffer,
    fileBytes: read.vectors.byteLength + read.clusterOf.byteLength + read.weights.byteLength,
  };
}
