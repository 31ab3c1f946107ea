// Clusters unfold to the values that they stand for: by hand, and of a whole rank to the dense bake that they are made
// of; broken ones are refused in a sentence.
import { join } from 'node:path';
import { DataUtils } from 'three';
import { describe, expect, it } from 'vitest';
import { checkUnfolded, readStored, unfoldClusters } from '../src/clusters.ts';
import type { TransferExtension } from '../src/glb.ts';
import { writeRoom } from '../e2e/scenes.ts';
import { readHeader } from '../src/header.ts';
import { limits, type TransferSource } from '../src/kinds.ts';
import { haveTool, lambent, makeFolder, readPacked } from './tool.ts';

const half = (values: number[]): Uint16Array => Uint16Array.from(values, (v) => DataUtils.toHalfFloat(v));
const floats = (values: Uint16Array): number[] => Array.from(values, (bits) => DataUtils.fromHalfFloat(bits));

describe('clusters', () => {
  it('are a mean and weighted components, in blocks of 16', () => {
    const clusterOf = new Uint16Array(18).fill(1);
    clusterOf[17] = 0;
    const out = floats(
      unfoldClusters({
        rank: 1,
        values: 2,
        vectors: Float32Array.of(1, 2, 0.5, -0.25, 10, 20, 1, 0),
        clusterOf,
        weights: half(Array.from({ length: 18 }, (_, r) => r - 4)),
      }),
    );
    expect(out.length).toBe(2 * 2 * 16);
    for (let r = 0; r < 17; ++r)
      expect([0, 1].map((k) => out[32 * (r >> 4) + 16 * k + (r & 15)])).toEqual([10 + r - 4, 20]);
    expect([out[32 + 1], out[32 + 16 + 1]]).toEqual([1 + 13 * 0.5, 2 - 13 * 0.25]);
    expect(out.slice(34, 48).every((v) => v === 0)).toBe(true);
  });

  it('hold what half floats do', () => {
    const one = { rank: 0, values: 1, clusterOf: new Uint16Array(1), weights: new Uint16Array(0) };
    expect(floats(unfoldClusters({ ...one, vectors: Float32Array.of(1e6) }))[0]).toBe(65504);
    expect(floats(unfoldClusters({ ...one, vectors: Float32Array.of(-1e6) }))[0]).toBe(-65504);
  });

  it('are unfolded to so many bytes at most', () => {
    checkUnfolded(2 ** 20, 256);
    expect(() => checkUnfolded(2 ** 20 + 1, 256)).toThrow(/1,048,577 receivers of 256 values, more than 512 MiB/);
    expect(limits.unfolded).toBe(512 * 2 ** 20);
  });

  const header = {
    ...{ kind: 'diffuse', basis: 'sh', order: 1, channels: 1, precision: 'half', receivers: 3, bufferView: 0 },
    cpca: { clusters: 2, rank: 1, clusterOf: 1, weights: 2 },
  };
  const good = [
    Float32Array.of(1, 2, 3, 4).buffer,
    Uint16Array.of(0, 1, 1).buffer,
    half([0, 0.5, 1]).buffer as ArrayBuffer,
  ];
  const read = (more: object = {}, views: ArrayBuffer[] = good): Promise<number[]> => {
    const extension = { version: 1, transfer: { ...header, ...more }, parts: [] } as TransferExtension,
      source = { extension, bufferView: (index: number) => Promise.resolve(views[index]) } as unknown as TransferSource;
    return (async () => {
      const { values, fileBytes } = await readStored(source, readHeader(extension), 1);
      expect(fileBytes).toBe(16 + 6 + 6);
      return floats(new Uint16Array(values)).slice(0, 3);
    })();
  };
  const refused: [string, object, ArrayBuffer[], RegExp][] = [
    [
      'a cluster that is not there',
      {},
      [good[0]!, Uint16Array.of(0, 2, 1).buffer, good[2]!],
      /cluster 2 does not exist/,
    ],
    ['too few weights', {}, [good[0]!, good[1]!, half([0, 1]).buffer as ArrayBuffer], /"weights" holds 4 .* makes 6/],
    ['too few clusters of receivers', {}, [good[0]!, Uint16Array.of(0).buffer, good[2]!], /"clusterOf" holds 2/],
    ['too few vectors', {}, [Float32Array.of(1).buffer, good[1]!, good[2]!], /"bufferView" holds 4 .* makes 16/],
    ['a vector of no number', {}, [Float32Array.of(1, NaN, 3, 4).buffer, good[1]!, good[2]!], /not finite/],
    [
      'a weight of no number',
      {},
      [good[0]!, good[1]!, Uint16Array.of(0, 0x7e00, 0x3c00).buffer],
      /weight is not finite/,
    ],
    ['an endless weight', {}, [good[0]!, good[1]!, Uint16Array.of(0, 0, 0xfc00).buffer], /weight is not fin/],
    ['no clusters', { cpca: { ...header.cpca, clusters: 0 } }, good, /"clusters" is out of range/],
    ['a rank of no number', { cpca: { ...header.cpca, rank: '1' } }, good, /"rank" is out of range/],
    ['no weights', { cpca: { ...header.cpca, weights: undefined } }, good, /no "weights"/],
    ['nothing', { cpca: null }, good, /"clusters" is out of range/],
    ['more than is unfolded', { receivers: 2 ** 29 }, good, /more than 512 MiB/],
    ['single floats', { precision: 'single' }, good, /not half/],
  ];
  it('are read from a file', async () => expect(await read()).toEqual([1, 5, 7]));
  for (const [what, more, views, sentence] of refused)
    it(`of ${what} are refused`, () => expect(read(more, views)).rejects.toThrow(sentence));
});

describe.skipIf(!haveTool)('clusters of the tool', () => {
  it('of a whole rank are the dense bake', async () => {
    const folder = makeFolder(),
      [dense, few] = ['dense.glb', 'few.glb'].map((name) => join(folder, name)) as [string, string];
    lambent(
      'bake',
      writeRoom(folder),
      '--samples',
      '64',
      '--order',
      '3',
      '--bounces',
      '1',
      '--precision',
      'single',
      '-o',
      dense,
    );
    lambent('compress', dense, '--cpca', '2,9', '-o', few);
    const [one, two] = [dense, few].map((path) => {
      const { document, view } = readPacked(path),
        extension = document.extensions.LAMBENT_transfer as unknown as TransferExtension;
      return { extension, bufferView: (index: number) => Promise.resolve(view(index)) } as unknown as TransferSource;
    }) as [TransferSource, TransferSource];
    const header = readHeader(two.extension),
      count = 9 * header.channels,
      truth = new Float32Array(await one.bufferView(readHeader(one.extension).bufferView)),
      { values } = await readStored(two, header, count),
      found = floats(new Uint16Array(values));
    expect(found.length).toBe(truth.length);
    // Weights, of components of unit length, and values are halves: 11 bits of the largest.
    const [largest, error] = truth.reduce<[number, number]>(
      ([most, worst], v, i) => [Math.max(most, Math.abs(v)), Math.max(worst, Math.abs(v - found[i]!))],
      [0, 0],
    );
    expect(error).toBeLessThan(largest / 500);
  });
});
