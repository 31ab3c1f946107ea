// Factors unfold to the matrix that they stand for: integrals of three harmonics and the incident basis by closed
// forms, and the matrix bake of the same rays by the tool.
import { join } from 'node:path';
import { DataUtils } from 'three';
import { describe, expect, it } from 'vitest';
import { writeRoom } from '../e2e/scenes.ts';
import { cosineBasis, factorsKind, makeTripling, unfoldFactors } from '../src/factors.ts';
import type { TransferExtension } from '../src/glb.ts';
import { readHeader } from '../src/header.ts';
import type { TransferSource } from '../src/kinds.ts';
import { gaussLegendre } from '../src/light_basis.ts';
import { evaluateSh, shCount } from '../src/sh.ts';
import { haveTool, lambent, makeFolder, random, readPacked } from './tool.ts';

const floats = (bytes: ArrayBuffer): number[] =>
  Array.from(new Uint16Array(bytes), (bits) => DataUtils.fromHalfFloat(bits));

describe('factors', () => {
  it('have the integrals of three harmonics', () => {
    const [a, b, c] = [3, 4, 6],
      { i, j, k, value } = makeTripling(a, b, c),
      next = random(4),
      [f, g] = [a, b].map((n) => Float64Array.from({ length: shCount(n) }, () => next() - 0.5)) as [
        Float64Array,
        Float64Array,
      ],
      product = new Float64Array(shCount(c));
    value.forEach((v, e) => (product[k[e]!]! += v * f[i[e]!]! * g[j[e]!]!));
    const y = new Float64Array(shCount(c));
    for (const [x, up, z] of [
      [0.48, -0.6, 0.64],
      [0, 0, 1],
      [-0.8, 0.6, 0],
    ] as const) {
      evaluateSh(c, x, up, z, y);
      const of = (values: Float64Array): number => values.reduce((sum, v, n) => sum + v * y[n]!, 0);
      expect(of(product)).toBeCloseTo(of(f) * of(g), 10);
    }
  });

  it('have functions that are orthonormal under the cosine', () => {
    const order = 4,
      n = shCount(order),
      W = cosineBasis(order),
      gram = new Float64Array(n * n),
      y = new Float64Array(n);
    for (const { x: z, weight } of gaussLegendre(10, 0, 1))
      for (let t = 0; t < 20; ++t) {
        const phi = (2 * Math.PI * t) / 20,
          radius = Math.sqrt(1 - z * z);
        evaluateSh(order, radius * Math.cos(phi), radius * Math.sin(phi), z, y);
        const own = Array.from({ length: n }, (_, i) => y.reduce((sum, v, k) => sum + W[i * n + k]! * v, 0));
        for (let i = 0; i < n; ++i)
          for (let j = 0; j < n; ++j) gram[i * n + j]! += ((weight * z) / 10) * own[i]! * own[j]!;
      }
    for (let i = 0; i < n; ++i) for (let j = 0; j < n; ++j) expect(gram[i * n + j]).toBeCloseTo(i === j ? 1 : 0, 10);
  });

  const transfer = {
    ...{ kind: 'factors', basis: 'sh', order: 5, channels: 1, precision: 'half', receivers: 1, bufferView: 0 },
    outgoing: { kind: 'map', order: 2, grid: 2, mapCount: 1, frames: 1, maps: 2, mapOf: 3 },
  };
  const views = [new ArrayBuffer(2 * 25 * 16), new ArrayBuffer(24), new ArrayBuffer(8 * 4 * 4), new ArrayBuffer(2)];
  const load = (more: object, given = views): Promise<unknown> =>
    factorsKind.load({
      extension: { version: 1, transfer: { ...transfer, ...more }, parts: [] } as unknown as TransferExtension,
      bufferView: (index: number) => Promise.resolve(given[index]),
    } as unknown as TransferSource);
  it('are read', async () => expect(await load({})).toMatchObject({ kind: 'factors', order: 4, receivers: 1 }));
  for (const [what, more, sentence] of [
    ['too few bands', { order: 1 }, /too few bands/],
    ['three channels', { channels: 3 }, /more than one channel/],
    ['another last reflection', { outgoing: { ...transfer.outgoing, kind: 'sh', hasB: false } }, /another kind/],
    ['another length', { receivers: 17 }, /holds 24 bytes where its header makes 408/],
    ['other bands', { order: 6 }, /holds 800 bytes of transfer where its header makes 1152/],
    ['more than is unfolded', { order: 9, receivers: 2 ** 27 }, /more than 512 MiB/],
    ['no last reflection', { outgoing: undefined }, /factors, diffuse, vertices/],
  ] as const)
    it(`of ${what} are refused`, () => expect(load(more)).rejects.toThrow(sentence));

  it('that are no finite numbers are refused', () => {
    const endless = new Uint16Array(25 * 16);
    endless[3] = 0x7c00;
    return expect(load({}, [endless.buffer, ...views.slice(1)])).rejects.toThrow(/factors that are not finite/);
  });
});

describe.skipIf(!haveTool)('factors of the tool', () => {
  it('are the matrix of the same rays', () => {
    const folder = makeFolder(),
      scene = writeRoom(folder),
      at = (name: string): string => join(folder, name),
      common = ['--transfer', 'matrix', '--samples', '64', '--order', '3', '--incident-order', '3'];
    lambent(
      'bake',
      scene,
      ...common,
      '--view-map',
      '8',
      '--precision',
      'single',
      '--bounces',
      '0',
      '-o',
      at('matrix.glb'),
    );
    lambent(
      'bake',
      scene,
      ...common,
      '--view-map',
      '8',
      '--precision',
      'single',
      '--denoise',
      'off',
      '--factors',
      '-o',
      at('factors.glb'),
    );
    const [matrix, factors] = ['matrix', 'factors'].map((name) => {
      const { document, view } = readPacked(at(`${name}.glb`)),
        extension = document.extensions.LAMBENT_transfer as unknown as TransferExtension;
      return { header: readHeader(extension), outgoing: extension.transfer['outgoing'] as { frames: number }, view };
    }) as [Read, Read];
    const { receivers } = factors.header,
      six = new Float32Array(factors.view(factors.outgoing.frames)),
      frames = new Float32Array(8 * receivers);
    for (let r = 0; r < receivers; ++r) {
      frames.set(six.subarray(6 * r, 6 * r + 3), 8 * r);
      frames.set(six.subarray(6 * r + 3, 6 * r + 6), 8 * r + 4);
    }
    const visibility = new Float32Array(factors.view(factors.header.bufferView as number)),
      truth = new Float32Array(matrix.view(matrix.header.bufferView as number)),
      before = process.cpuUsage(),
      found = floats(unfoldFactors({ light: 3, incident: 3, receivers, visibility, frames }).buffer as ArrayBuffer);
    console.log(`${receivers} receivers of 9 x 9: ${process.cpuUsage(before).user / 1000} ms`);
    expect(found.length).toBe(truth.length);
    const [largest, error] = truth.reduce<[number, number]>(
      ([most, worst], v, n) => [Math.max(most, Math.abs(v)), Math.max(worst, Math.abs(v - found[n]!))],
      [0, 0],
    );
    console.log(`${(error / largest).toExponential(1)} of the largest apart`);
    expect(error).toBeLessThan(largest / 1000); // halves
  });
});
interface Read {
  header: ReturnType<typeof readHeader>;
  outgoing: { frames: number };
  view: (index: number) => ArrayBuffer;
}
