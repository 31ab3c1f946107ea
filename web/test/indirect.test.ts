// Direct to indirect light: the file, the operator, rays and lamps, without a picture. What the relighter of lambent
// gives of the golden file is in tests/golden/indirect_values.json, which a test of its own keeps true.
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { describe, expect, it } from 'vitest';
import { bakedScene, LambentError, LambentTransferPlugin, type IndirectControls } from '../src/index.ts';
import { huffmanDecode } from '../src/huffman.ts';
import { readOperator } from '../src/indirect_file.ts';
import { IndirectSolve } from '../src/indirect_solve.ts';
import { hash } from '../src/keyed_random.ts';
import type { TransferSource } from '../src/kinds.ts';
import { directLight, formatLamp, parseLamp, parseNamedColor, placeLamp } from '../src/moving_lamps.ts';
import { Rays } from '../src/rays.ts';
import { random } from './tool.ts';

const repository = fileURLToPath(new URL('../../', import.meta.url)),
  golden = (name: string): Buffer => readFileSync(`${repository}tests/golden/${name}`),
  packed = (): Buffer => readFileSync(`${repository}fuzz/corpus_baked/indirect_packed.glb`);

interface Document {
  bufferViews: { byteOffset?: number; byteLength: number }[];
  extensions: { LAMBENT_transfer: TransferSource['extension'] };
}
/** A source over a .glb; `change` may have its way with the document and the bytes. */
function sourceOf(glb: Buffer, change?: (document: Document, bytes: Uint8Array) => void): TransferSource {
  const length = glb.readUInt32LE(12),
    document = JSON.parse(glb.subarray(20, 20 + length).toString()) as Document,
    bytes = Uint8Array.from(glb.subarray(28 + length));
  change?.(document, bytes);
  const extension = document.extensions.LAMBENT_transfer;
  return {
    extension,
    bufferView: (views: unknown) => {
      const { byteOffset = 0, byteLength } = document.bufferViews[views as number]!;
      return Promise.resolve(bytes.slice(byteOffset, byteOffset + byteLength).buffer);
    },
  } as unknown as TransferSource;
}

async function open(glb: Buffer): Promise<IndirectControls> {
  Object.assign(globalThis, { self: globalThis });
  const gltf = await new GLTFLoader()
    .register((parser) => new LambentTransferPlugin(parser))
    .parseAsync(Uint8Array.from(glb).buffer, '');
  return bakedScene(gltf)!.transfer.indirect!;
}

describe('numbers that are keyed', () => {
  // The same in numbers of any size.
  const mask = (1n << 64n) - 1n;
  function mix(x: bigint): bigint {
    x = ((x ^ (x >> 30n)) * 0xbf58476d1ce4e5b9n) & mask;
    x = ((x ^ (x >> 27n)) * 0x94d049bb133111ebn) & mask;
    return x ^ (x >> 31n);
  }
  const truth = (a: number, b: number): number =>
    Number(
      mix(mix((BigInt(a) + 0x9e3779b97f4a7c15n) & mask) ^ ((BigInt(b) + 0xd1b54a32d192ed03n) & mask)) & 0xffffffffn,
    );
  it('are those of 64 bits', () => {
    const next = random(4);
    for (let i = 0; i < 500; ++i) {
      const [a, b] = [Math.floor(2 ** 32 * next()), Math.floor(2 ** (32 * next()))];
      expect(hash(a, b)).toBe(truth(a, b));
    }
  });
});

describe('coded bytes', () => {
  // Byte 7 by 0, 8 by 10, 9 by 11.
  const header = new Uint8Array(128);
  header[3] = 1 << 4;
  header[4] = 2 | (2 << 4);
  const coded = (...bytes: number[]): Uint8Array => Uint8Array.from([...header, ...bytes]);
  it('are read', () => expect([...huffmanDecode(coded(0b01011010), 5)!]).toEqual([7, 8, 9, 7, 8]));
  it('take all bits, and no more', () => {
    expect(huffmanDecode(coded(0b01011010), 6)).toBeUndefined(); // the last is not whole
    expect(huffmanDecode(coded(0b01011010), 4)).toBeUndefined(); // 10 is left
    expect(huffmanDecode(coded(0b01011010, 0), 5)).toBeUndefined();
    expect(huffmanDecode(coded(), 1)).toBeUndefined();
    expect(huffmanDecode(coded(), 0)).toEqual(new Uint8Array(0));
    expect(huffmanDecode(header.subarray(0, 127), 0)).toBeUndefined();
    expect(huffmanDecode(coded(0), 1e9)).toBeUndefined();
  });
  it('are refused where lengths make no code', () => {
    const wrong = coded(0);
    wrong[5] = 1; // a third half of all codes
    expect(huffmanDecode(wrong, 1)).toBeUndefined();
  });
});

describe('rays', () => {
  it('meet what each triangle by itself says', () => {
    const next = random(8),
      n = 300,
      triangles = new Float32Array(9 * n);
    for (let t = 0; t < n; ++t) {
      const at = [next(), next(), next()];
      for (let k = 0; k < 9; ++k) triangles[9 * t + k] = at[k % 3]! + 0.3 * (next() - 0.5);
    }
    const rays = new Rays(triangles);
    let met = 0;
    for (let i = 0; i < 400; ++i) {
      const from = [3 * next() - 1, 3 * next() - 1, 3 * next() - 1] as const,
        to = [next(), next(), next()],
        length = Math.hypot(...to.map((x, k) => x - from[k]!)),
        d = to.map((x, k) => (x - from[k]!) / length) as [number, number, number];
      let nearest = Infinity,
        best = -1;
      for (let t = 0; t < n; ++t) {
        const alone = new Rays(triangles.slice(9 * t, 9 * t + 9));
        alone.closest(...from, ...d, Infinity);
        if (alone.distance < nearest) [nearest, best] = [alone.distance, t];
      }
      expect(rays.closest(...from, ...d, Infinity)).toBe(best);
      expect(rays.distance).toBe(nearest);
      expect(rays.meets(...from, ...d, Infinity)).toBe(best >= 0);
      expect(rays.meets(...from, ...d, nearest * 0.999)).toBe(false);
      met += Number(best >= 0);
    }
    expect(met).toBeGreaterThan(200);
  });
});

describe('lamps', () => {
  const free = new Rays(new Float32Array(9)); // nothing is met
  it('are written as --lamp is', () => {
    for (const text of [
      'point@1,2,3=4,5,6',
      'sphere@-1,0,2.5,0.1=9,9,9',
      'spot@0,1,0,0,0,0,40=1,2,3',
      'sun@40,30=5,5,5',
    ])
      expect(formatLamp(parseLamp(text))).toBe(text);
    expect(parseLamp('point@0,0,0=2').color).toEqual([2, 2, 2]);
    expect(parseNamedColor('a=b=0.1,0.2,0.3')).toEqual({ name: 'a=b', color: [0.1, 0.2, 0.3] });
    for (const text of [
      'point@1,2=3',
      'sphere@0,0,0,0=1',
      'spot@0,0,0,0,0,0,30=1',
      'spot@0,0,0,0,1,0,95=1',
      'sun@0,91=1',
      'point@0,0,nan=1',
      'point@0,0,1e10=1',
      'point@0,0,0=-1',
      'point@0,0,0=',
      'lamp@0,0,0=1',
      'point@0,0,0=1,2',
    ])
      expect(() => parseLamp(text), text).toThrow(LambentError);
  });
  it('light a white surface by their formulas', () => {
    const at = (text: string, samples = 1): number =>
      directLight(free, placeLamp(parseLamp(text)), 0, 0, 0, 0, 1, 0, samples, 5);
    expect(at('point@0,2,0=1')).toBeCloseTo(1 / (4 * Math.PI), 9);
    expect(at('point@2,2,0=1')).toBeCloseTo(Math.SQRT1_2 / (8 * Math.PI), 9);
    expect(at('point@0,-2,0=1')).toBe(0);
    expect(at('sun@0,30=1')).toBeCloseTo(0.5 / Math.PI, 9);
    expect(at('spot@0,2,0,0,0,0,20=1')).toBeCloseTo(1 / (4 * Math.PI), 9);
    expect(at('spot@0,2,0,2,2,0,20=1')).toBe(0);
    // Half way of its rim, in cosines: a quarter.
    const angle = Math.acos((Math.cos(Math.PI / 3) + Math.cos(Math.PI / 6)) / 2);
    expect(at(`spot@0,1,0,${Math.tan(angle)},0,0,60=1`)).toBeCloseTo(0.25 / Math.PI, 6);
    // A sphere above the horizon: L sin^2, times the cosine.
    expect(at('sphere@0,2,0,0.5=1', 64)).toBeCloseTo(1 / 16, 4);
    expect(at('sphere@0,0.1,0,0.5=1')).toBe(0); // inside
  });
});

describe('the operator', () => {
  const values = JSON.parse(golden('indirect_values.json').toString()) as Record<'baked' | 'painted', number[][]>;
  const farthest = (solve: IndirectSolve, truth: number[][]): number => {
    const out = new Float32Array(4 * truth.length);
    solve.read(out);
    return Math.max(...truth.flatMap((rgb, r) => rgb.map((v, c) => Math.abs(v - out[4 * r + c]!))));
  };
  it('gives what the relighter gives, baked and repainted', async () => {
    const operator = await readOperator(sourceOf(golden('indirect.glb'))),
      solve = new IndirectSolve(operator),
      leaves = operator.surfels.areas.length;
    const direct = Float32Array.from({ length: 3 * leaves }, (_, i) => (Math.floor(i / 3) % [5, 7, 11][i % 3]!) / 4);
    const run = (): void => {
      for (let k = 0; k < 60 && solve.residual > 1e-6; ++k) solve.step(direct);
    };
    run();
    expect(values.baked.length).toBe(operator.receivers);
    expect(Math.max(...values.baked.flat())).toBeGreaterThan(0.3);
    expect(farthest(solve, values.baked)).toBeLessThan(2e-5);
    expect(solve.bounces).toBeLessThan(25); // and not one by one
    solve.paint(Float32Array.from({ length: 3 * leaves }, (_, i) => [0.3, 0.9, 0][i % 3]!));
    run();
    expect(farthest(solve, values.painted)).toBeLessThan(2e-5);
    // Twice the light from where it stands, and none at all.
    for (let i = 0; i < direct.length; ++i) direct[i]! *= 2;
    solve.restart();
    run();
    expect(
      farthest(
        solve,
        values.painted.map((v) => v.map((x) => 2 * x)),
      ),
    ).toBeLessThan(4e-5);
    solve.restart();
    direct.fill(0);
    run();
    expect(Math.max(...solve.x)).toBe(0);
  });

  it('is read as newer files have it, too', async () => {
    const operator = await readOperator(sourceOf(packed()));
    expect(operator.receivers).toBeGreaterThan(0);
    const solve = new IndirectSolve(operator),
      direct = new Float32Array(3 * operator.surfels.areas.length).fill(1);
    for (let k = 0; k < 40; ++k) solve.step(direct);
    expect(Math.max(...solve.x)).toBeGreaterThan(0.01);
    expect(solve.residual).toBeLessThan(1e-5);
  });
});

describe('strangers’ files', () => {
  type Transfer = Record<string, unknown> & { surfels: Record<string, unknown>; kernels: Record<string, unknown> };
  const transfer = (d: Document): Transfer => d.extensions.LAMBENT_transfer.transfer as unknown as Transfer;
  const refused = async (change: (document: Document, bytes: Uint8Array) => void, glb = packed()): Promise<void> =>
    expect(readOperator(sourceOf(glb, change))).rejects.toThrow(LambentError);
  const viewOf = (d: Document, view: unknown): [number, number] => {
    const v = d.bufferViews[view as number]!;
    return [v.byteOffset ?? 0, v.byteLength];
  };

  it('are refused in a sentence: lists, numbers, lengths', async () => {
    await refused((d) => (transfer(d).surfels['levels'] = [8, 4]));
    await refused((d) => (transfer(d).surfels['levels'] = [1e12]));
    await refused((d) => (transfer(d).surfels['levels'] = []));
    await refused((d) => (transfer(d).surfels['spacings'] = [NaN]));
    await refused((d) => (transfer(d).surfels['names'] = 'grey'));
    await refused((d) => (transfer(d)['gatherLevel'] = 99));
    await refused((d) => (transfer(d)['entries'] = 1e9));
    await refused((d) => (transfer(d)['receivers'] = 4e9));
    await refused((d) => delete (transfer(d) as Partial<Transfer>).kernels);
    await refused((d) => ((transfer(d)['weights'] as Record<string, unknown>)['bytes'] = 4e9));
  });
  it('are refused where a child is out of range, a cycle is made or a stream is cut', async () => {
    const old = golden('indirect.glb'); // all parents are in it
    await refused((d, bytes) => {
      const [at] = viewOf(d, transfer(d).surfels['parents']);
      new DataView(bytes.buffer).setUint32(at, 5, true); // not its own parent
    }, old);
    await refused((d, bytes) => {
      const [at, length] = viewOf(d, transfer(d).surfels['parents']);
      new DataView(bytes.buffer).setUint32(at + length - 4, 1e6, true);
    }, old);
    const views: ((t: Transfer) => unknown)[] = [
      (t) => t.surfels['places'],
      (t) => t.surfels['albedos'],
      (t) => t['scales'],
      (t) => (t['bufferView'] as Record<string, unknown>)['coded'],
      (t) => (t['weights'] as Record<string, unknown>)['coded'],
      (t) => (t.kernels['bufferView'] as Record<string, unknown>)['coded'],
    ];
    for (const view of views) await refused((d) => --d.bufferViews[view(transfer(d)) as number]!.byteLength);
    await refused((d, bytes) => {
      const [at, length] = viewOf(d, transfer(d)['scales']);
      bytes.fill(0x50, at, at + length); // a row that sees far more than a hemisphere
    });
  });
  it('never hang or crash: bytes at random', async () => {
    const next = random(77);
    let read = 0;
    for (let i = 0; i < 400; ++i) {
      const glb = i % 2 ? packed() : golden('indirect.glb');
      const source = sourceOf(glb, (_, bytes) => {
        for (let k = 0; k < 1 + 3 * next(); ++k) bytes[Math.floor(next() * bytes.length)] = Math.floor(256 * next());
      });
      try {
        const solve = new IndirectSolve(await readOperator(source)),
          direct = new Float32Array(3 * solve.operator.surfels.areas.length).fill(1);
        for (let k = 0; k < 5; ++k) solve.step(direct);
        expect(solve.x.every((v) => Number.isFinite(v))).toBe(true);
        ++read;
      } catch (error) {
        expect(error).toBeInstanceOf(LambentError);
      }
    }
    expect(read).toBeGreaterThan(50);
    expect(read).toBeLessThan(400);
  });
});

describe('a scene under lamps', () => {
  it('follows a lamp step by step to what it is lit to at once; lamps add up, paint can be taken off', async () => {
    const scene = await open(golden('indirect.glb')),
      values = (): Float32Array => {
        scene.settle();
        return (scene as unknown as { light: { values: Float32Array } }).light.values.slice();
      };
    const apart = (a: Float32Array, b: Float32Array): number =>
      Math.sqrt(a.reduce((sum, v, i) => sum + (v - b[i]!) ** 2, 0) / b.reduce((sum, v) => sum + v * v, 0));
    const lamp = parseLamp('point@1,1.2,1=10'),
      other = parseLamp('sphere@0.6,1.5,1.3,0.1=3,20,3');
    scene.movingLamps = [lamp];
    const one = values();
    expect(Math.max(...one)).toBeGreaterThan(0.05);
    scene.movingLamps = [other];
    const two = values();
    scene.movingLamps = [lamp, other];
    expect(
      apart(
        values(),
        one.map((v, i) => v + two[i]!),
      ),
    ).toBeLessThan(2e-3);
    scene.movingLamps = [{ ...lamp, off: true }, other];
    expect(apart(values(), two)).toBeLessThan(2e-3);
    for (let k = 4; k >= 0; --k) {
      scene.movingLamps = [parseLamp(`point@${1 + 0.05 * k},1.2,1=10`)];
      for (let i = 0; i < 3; ++i) scene.update(0);
    }
    expect(apart(values(), one)).toBeLessThan(2e-3);
    scene.paint('red', [0, 0, 0.9]);
    const blue = values();
    expect(apart(blue, one)).toBeGreaterThan(0.02);
    scene.paint('red', undefined);
    expect(apart(values(), one)).toBeLessThan(2e-3);
    scene.movingLamps = [];
    expect(Math.max(...values())).toBe(0);
    expect(() => (scene.movingLamps = new Array(9).fill(lamp) as never)).toThrow(/9 lamps.*8/);
    expect(() => scene.paint('none', [1, 1, 1])).toThrow(LambentError);
    expect(() => scene.scaleOwn('none', [1, 1, 1])).toThrow(LambentError);
  });
  it('is lit where spacings are as small as a file can say', async () => {
    const glb = golden('indirect.glb'),
      text = glb.subarray(20, 20 + glb.readUInt32LE(12)).toString(),
      tiny = text.replace(/"spacings":\[([^\]]*)\]/, (all, list: string) =>
        `"spacings":[${list
          .split(',')
          .map(() => '1e-30')
          .join(',')}]`.padEnd(all.length),
      );
    expect(tiny.length).toBe(text.length);
    glb.write(tiny, 20);
    const scene = await open(glb);
    scene.movingLamps = [parseLamp('point@1,1.2,1=10')];
    scene.settle();
    expect(scene.times.count).toBeGreaterThan(0);
  });
  it('is refused by name where it has what the page does not draw', async () => {
    await expect(open(golden('indirect_texels.glb'))).rejects.toThrow(/directional, at texels/);
  });
});
