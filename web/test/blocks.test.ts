import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { Matrix3, Vector3 } from 'three';
import { describe, expect, it } from 'vitest';
import { BlockLight, cardinalFunctions, fineCardinal, finePlace, widestBlock } from '../src/block_light.ts';
import { checkRecords, recordBegins } from '../src/block_records.ts';
import { samplesOf } from '../src/block_reflection.ts';
import { cubeBlocks, cubeDirection, cubeLight, cubeTexel, reducedMap, type CubeLight } from '../src/cube.ts';
import { Lighting } from '../src/index.ts';
import { formatReflection, parseReflection } from '../page/surface.ts';
import { texelSolidAngle } from '../src/projection.ts';
import { random } from './tool.ts';

const upright = [1, 0, 0, 0, 1, 0, 0, 0, 1],
  skew = [0.36, 0.48, -0.8, -0.8, 0.6, 0, 0.48, 0.64, 0.6];

describe('light on a cube', () => {
  it('keeps all of a map, wherever that is turned', () => {
    const next = random(7),
      [width, height] = [48, 24],
      data = Float32Array.from({ length: 3 * width * height }, () => next() ** 8);
    let truth = 0;
    for (let y = 0; y < height; ++y)
      for (let x = 0; x < width; ++x) truth += texelSolidAngle(y, width, height) * data[3 * (y * width + x)]!;
    for (const map of [{ data, width, height, channels: 3 }, reducedMap({ data, width, height, channels: 3 }, 12)])
      for (const turn of [upright, skew]) {
        let sum = 0;
        cubeLight(map, 16, turn).energy.forEach((e, i) => (sum += i % 3 === 0 ? e : 0));
        expect(sum / truth).toBeCloseTo(1, 5);
      }
  });

  it('is even where the sky is, by the solid angle of each texel', () => {
    const size = 32,
      { energy } = cubeLight(
        { data: new Float32Array(3 * 96 * 48).fill(1), width: 96, height: 48, channels: 3 },
        size,
        skew,
      );
    const corner = (u: number, v: number): number => Math.atan2(u * v, Math.sqrt(u * u + v * v + 1));
    for (let face = 0; face < 6; ++face)
      for (let y = 0; y < size; ++y)
        for (let x = 0; x < size; ++x) {
          const [a, b, c, d] = [x, x + 1, y, y + 1].map((t) => (2 * t) / size - 1) as [number, number, number, number],
            angle = corner(b, d) - corner(a, d) - corner(b, c) + corner(a, c);
          expect(energy[3 * cubeTexel(size, face, x, y)]! / angle).toBeCloseTo(1, 2);
        }
  });

  it('knows where in a texel a sun stands', () => {
    const [width, height] = [512, 256],
      data = new Float32Array(3 * width * height),
      [x, y] = [301, 77];
    data.fill(1, 3 * (y * width + x), 3 * (y * width + x) + 3);
    const { energy, direction } = cubeLight({ data, width, height, channels: 3 }, 16, upright);
    const phi = 2 * Math.PI * ((x + 0.5) / width - 0.5),
      theta = (Math.PI * (y + 0.5)) / height,
      sun = [Math.sin(theta) * Math.cos(phi), Math.cos(theta), Math.sin(theta) * Math.sin(phi)];
    const moment = [0, 1, 2].map((k) =>
        direction.reduce((sum, d, i) => sum + (i % 3 === k ? d * energy[i - k]! : 0), 0),
      ),
      along = [0, 1, 2].reduce((sum, k) => sum + moment[k]! * sun[k]!, 0);
    expect(1 - along / Math.hypot(...moment)).toBeLessThan(1e-6);
  });

  it('of what was turned is as it was, turned back', () => {
    const lighting = new Lighting([1, 1, 1, 0.3, 0.2, 0.1, -0.2, 0.1, 0.3, 0.5, 0.4, 0.2]),
      turn = new Matrix3().set(...(skew as Parameters<Matrix3['set']>));
    lighting.rotation.set(0.5, 0.1, -0.7, 0.5);
    const light = lighting.cubes(32),
      momentOf = ({ energy, direction }: CubeLight): Vector3[] =>
        [0, 1, 2].map((c) => {
          const sum = new Vector3();
          for (let i = 0; i < energy.length; i += 3)
            sum.addScaledVector(new Vector3().fromArray(direction, i), energy[i + c]!);
          return sum;
        }),
      now = momentOf(light());
    momentOf(light(turn)).forEach((m, c) => {
      expect(m.distanceTo(now[c]!) / m.length()).toBeGreaterThan(0.1);
      expect(m.applyMatrix3(turn).distanceTo(now[c]!) / m.length()).toBeLessThan(1e-3);
    });
  });

  it('of coefficients is the radiance that they add up to', () => {
    const lighting = new Lighting([1, 0.5, 0.25].map((v) => v * Math.sqrt(4 * Math.PI)));
    lighting.intensity = 2;
    const { energy } = lighting.onCube(16),
      sums = [0, 0, 0];
    energy.forEach((e, i) => (sums[i % 3]! += e / (4 * Math.PI)));
    [2, 1, 0.5].forEach((v, c) => expect(sums[c]).toBeCloseTo(v, 4));
  });
});

describe('forms of light in blocks', () => {
  it('cardinal functions are 1 together, and at their own node alone', () => {
    for (const count of [1, 2, 4]) {
      const c = cardinalFunctions(count);
      for (let x = 0; x < 16; ++x)
        expect(Array.from({ length: count }, (_, i) => c[16 * i + x]!).reduce((a, b) => a + b)).toBeCloseTo(1, 12);
    }
    // Between texels 1 and 2 lies the first of four nodes; cosines are even there to their curvature.
    const c = cardinalFunctions(4);
    [1, 0, 0, 0].forEach((v, i) => expect((c[16 * i + 1]! + c[16 * i + 2]!) / 2).toBeCloseTo(v, 1));
  });

  it('fine nodes interpolate polynomials of degree 7 exactly, which lie denser at a side', () => {
    expect(finePlace(0)).toBeCloseTo(8 - 8 * Math.cos(Math.PI / 16), 12);
    for (let power = 0; power < 9; ++power) {
      let most = 0;
      for (let x = 0.5; x < 16; ++x) {
        let sum = 0;
        for (let i = 0; i < 8; ++i) sum += (finePlace(i) / 8 - 1) ** power * fineCardinal(i, x);
        most = Math.max(most, Math.abs(sum - (x / 8 - 1) ** power));
      }
      if (power < 8) expect(most).toBeLessThan(1e-12);
      else expect(most).toBeGreaterThan(1e-3);
    }
  });

  it('sums end where blocks do, and their first is all of a block', () => {
    const light = new BlockLight(16),
      next = random(3),
      energy = Float32Array.from({ length: 3 * 256 * 6 }, () => next());
    const direction = new Float32Array(energy.length);
    for (let i = 0; i < energy.length; i += 3)
      direction.set(cubeDirection(16, Math.floor(i / 768), ((i / 3) % 16) + 0.5, (Math.floor(i / 48) % 16) + 0.5), i);
    light.gloss();
    light.set({ size: 16, energy, direction });
    const sums = light.sums.value.image.data as Float32Array,
      coarse = light.coarse.value.image.data as Float32Array,
      fine = light.fine.value.image.data as Float32Array;
    for (let b = 0; b < 6; ++b)
      for (let c = 0; c < 3; ++c)
        for (let k = 0; k < 3; ++k) {
          let all = 0,
            last = 0;
          for (let t = 0; t < 256; ++t) {
            last = energy[3 * (256 * b + t) + c]! * direction[3 * (256 * b + t) + k]!;
            all += last;
          }
          expect(sums[4 * (768 * b + c) + k]).toBeCloseTo(all, 3);
          expect(sums[4 * (768 * b + 765 + c) + k]).toBeCloseTo(last, 5);
          let nodes = 0; // cardinal functions are 1 together
          for (let i = 0; i < 16; ++i) nodes += coarse[4 * (3 * (16 * b + i) + c) + k]!;
          expect(nodes).toBeCloseTo(all, 3);
          // Of what is linear across a block, all of it comes back; of each node its own share.
          let slope = 0,
            truth = 0;
          for (let i = 0; i < 64; ++i)
            slope += finePlace(i % 8) * finePlace(i >> 3) ** 2 * fine[4 * (3 * (64 * b + i) + c) + k]!;
          for (let t = 0; t < 256; ++t)
            truth +=
              ((t % 16) + 0.5) *
              ((t >> 4) + 0.5) ** 2 *
              energy[3 * (256 * b + t) + c]! *
              direction[3 * (256 * b + t) + k]!;
          expect(slope / truth).toBeCloseTo(1, 4);
        }
    // 1,536 texels have less than a thousandth each, unless one has much more.
    const sharp = (): number[] => [0, 1, 2, 3, 4, 5].map((b) => fine[4 * 3 * 64 * b + 3]!);
    expect(sharp()).toEqual([0, 0, 0, 0, 0, 0]);
    energy.fill(1);
    light.set({ size: 16, energy, direction });
    expect(sharp()).toEqual([0, 0, 0, 0, 0, 0]);
    energy[3 * (256 * 4 + 77) + 1] = 2;
    light.set({ size: 16, energy, direction });
    expect(sharp()).toEqual([0, 0, 0, 0, 1, 0]);
  });

  it('samples are more where a lobe is narrower', () => {
    const widest = widestBlock(64);
    expect(samplesOf({ model: 'diffuse' }, widest).one).toBeGreaterThan(1);
    const wide = samplesOf({ model: 'phong', diffuse: 0, specular: 0.5, exponent: 8 }, widest),
      narrow = samplesOf({ model: 'phong', diffuse: 0, specular: 0.5, exponent: 500 }, widest);
    expect(wide.all).toBeGreaterThan(1); // never
    expect(narrow.all).toBeLessThan(1);
    for (const { one, nodes, fine, all } of [wide, narrow])
      expect(one <= nodes && nodes <= fine && fine <= all).toBe(true);
    // What 16 samples miss, 64 have for the most part: Phong 50 asks for no more.
    const usual = samplesOf({ model: 'phong', diffuse: 0.3, specular: 0.5, exponent: 50 }, widest);
    expect(usual.fine).toBeLessThan(1);
    expect(usual.all).toBeGreaterThan(1);
    const ggx = (roughness: number): number[] => {
      const { fine, all } = samplesOf({ model: 'ggx', roughness, f0: 0.5 }, widest);
      return [fine, all].map((cosine) => Number(cosine <= 1));
    };
    expect([0.6, 0.4, 0.25].map(ggx)).toEqual([
      [0, 0],
      [1, 0],
      [1, 1],
    ]);
  });
});

/** The bytes of a golden file's view. */
function golden(name: string): { view: (index: number) => Uint8Array; transfer: Record<string, number> } {
  const bytes = readFileSync(fileURLToPath(new URL(`../../tests/golden/${name}.glb`, import.meta.url))),
    length = bytes.readUInt32LE(12);
  const json = JSON.parse(bytes.toString('utf8', 20, 20 + length)) as {
    bufferViews: { byteOffset?: number; byteLength: number }[];
    extensions: { LAMBENT_transfer: { transfer: Record<string, number> } };
  };
  return {
    transfer: json.extensions.LAMBENT_transfer.transfer,
    view: (index) => {
      const { byteOffset = 0, byteLength } = json.bufferViews[index]!;
      return Uint8Array.from(bytes.subarray(28 + length + byteOffset, 28 + length + byteOffset + byteLength));
    },
  };
}

describe('records of visibility', () => {
  for (const name of ['blocks', 'blocks_bits']) {
    const { view, transfer } = golden(name),
      records = view(transfer['bufferView']!),
      lengths = view(transfer['lengths']!),
      receivers = transfer['receivers']!,
      blocks = cubeBlocks(transfer['cube']!),
      bits = transfer['bits']!;
    const begins = recordBegins(lengths, receivers, records.length);

    it(`of ${name} are whole`, () => expect(() => checkRecords(records, begins, blocks, bits)).not.toThrow());

    it(`of ${name} that are broken are refused, and never read past`, () => {
      expect(() => recordBegins(lengths.subarray(1), receivers, records.length)).toThrow(/lengths/);
      expect(() => recordBegins(lengths, receivers, records.length - 1)).toThrow(/bytes of visibility/);
      expect(() => recordBegins(new Uint8Array(lengths.length).fill(255), receivers, records.length)).toThrow(
        /lengths/,
      );
      const next = random(11);
      let refused = 0;
      for (let i = 0; i < 300; ++i) {
        const broken = records.slice();
        broken[Math.floor(next() * broken.length)]! ^= 1 << Math.floor(8 * next());
        try {
          checkRecords(broken, begins, blocks, bits);
        } catch (error) {
          expect(String(error)).toMatch(/holds broken visibility, at receiver \d+/);
          ++refused;
        }
      }
      expect(refused).toBeGreaterThan(20);
      const flags = records.slice();
      flags[0] = 255;
      expect(() => checkRecords(flags, begins, blocks, bits)).toThrow(/broken visibility, at receiver 0/);
    });
  }
});

describe('a surface in the address', () => {
  it('comes back as it went', () => {
    for (const text of ['diffuse', 'phong:diffuse=0.3,specular=0.5,exponent=50', 'ggx:roughness=0.4,f0=0.6'])
      expect(formatReflection(parseReflection(text)!)).toBe(text);
  });
  it('keeps energy, and is nothing where it is nonsense', () => {
    expect(parseReflection('phong:diffuse=0.8,specular=0.9,exponent=1e9')).toEqual({
      model: 'phong',
      diffuse: 0.8,
      specular: expect.closeTo(0.2, 9) as number,
      exponent: 2000,
    });
    expect(parseReflection('velvet')).toBeUndefined();
    expect(parseReflection('')).toBeUndefined();
  });
});
