// Light in free space: by closed forms, by three's own formula out of the grids that it is given, and by the probes
// that the command-line tool writes for three.js.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { DataUtils, SphericalHarmonics3, Vector3, type Data3DTexture } from 'three';
import { LightProbeGridWebGL } from 'three/addons/lighting/LightProbeGridWebGL.js';
import { describe, expect, it } from 'vitest';
import { readMap } from '../page/loading.ts';
import { writeRoom } from '../e2e/scenes.ts';
import { checkBakedFile, evaluateSh, Lattice, Lighting, shCount, type LatticeHeader } from '../src/index.ts';
import { loadLattice } from '../src/lattice.ts';
import type { TransferExtension } from '../src/glb.ts';
import type { TransferSource } from '../src/kinds.ts';
import { haveTool, lambent, makeFolder, random, writeLopsidedHdr } from './tool.ts';

const header: LatticeHeader = {
  min: [-1, 0, 2],
  max: [2, 1, 4],
  points: [4, 3, 5],
  order: 3,
  channels: 1,
  precision: 'single',
};
const count = 60,
  n = shCount(3);

/** A lattice whose point p takes `share(p)` of all light, unshadowed. */
function open(share: (point: number) => number): Lattice {
  const values = new Float32Array(Math.ceil(count / 16) * 16 * n * n);
  for (let p = 0; p < count; ++p)
    for (let i = 0; i < n; ++i) values[(((p >> 4) * n + i) * n + i) * 16 + (p & 15)] = share(p);
  return new Lattice(header, 3, n, values.buffer, new Uint8Array(count).fill(1));
}
const directions = Array.from({ length: 40 }, (_, i) => {
  const z = 1 - (2 * i + 1) / 40,
    r = Math.sqrt(1 - z * z);
  return new Vector3(r * Math.cos(2.4 * i), r * Math.sin(2.4 * i), z);
});
const middle = new Vector3(0.3, 0.4, 3.1);

/** What three makes of a grid's atlas at a probe. */
function probe(grid: LightProbeGridWebGL, x: number, y: number, slice: number): SphericalHarmonics3 {
  const { data, width, height } = (grid.texture as Data3DTexture).image as {
      data: Uint16Array;
      width: number;
      height: number;
    },
    nz = grid.resolution.z;
  const numbers = Array.from({ length: 27 }, (_, k) =>
    DataUtils.fromHalfFloat(data[4 * (((k >> 2) * (nz + 2) + slice) * width * height + y * width + x) + (k & 3)]!),
  );
  return new SphericalHarmonics3().fromArray(numbers);
}

describe('a lattice', () => {
  it('under a constant sky gives pi times its radiance, whichever way a surface looks', () => {
    const lattice = open(() => 1);
    const light = new Lighting([2, 3, 4, ...new Array<number>(24).fill(0)].map((v) => v * Math.sqrt(4 * Math.PI)));
    lattice.relight(light);
    for (const normal of directions) {
      const { r, g, b } = lattice.irradianceAt(middle, normal);
      [r / 2, g / 3, b / 4].forEach((v) => expect(v).toBeCloseTo(Math.PI, 5));
    }
  });

  it('under three bands of a single direction gives their closed form', () => {
    const towards = new Vector3(0.48, -0.6, 0.64),
      y = new Float64Array(n);
    evaluateSh(3, towards.x, towards.y, towards.z, y);
    const lattice = open(() => 1);
    const light = new Lighting([...y].flatMap((v) => [v, v, v]));
    light.window = 'none';
    lattice.relight(light);
    for (const normal of directions) {
      // sum of A_l (2l+1) / 4 pi P_l
      const c = normal.dot(towards),
        expected = 1 / 4 + c / 2 + (5 / 16) * (1.5 * c * c - 0.5);
      expect(lattice.irradianceAt(middle, normal).g).toBeCloseTo(Math.max(0, expected), 5);
    }
  });

  it('is trilinear between its points, and beyond them that of its faces', () => {
    const at = new Vector3(),
      places = open(() => 1),
      ramp = (p: Vector3): number => 3 + p.x - 0.5 * p.y + 2 * p.z;
    const lattice = open((p) => ramp(places.position(p, at)));
    lattice.relight(new Lighting([1, 1, 1, ...new Array<number>(24).fill(0)]));
    const value = (p: Vector3): number => lattice.radianceAt(p)[1]!;
    for (const p of [new Vector3(-1, 0, 2), middle, new Vector3(1.9, 0.99, 3.7), new Vector3(2, 1, 4)])
      expect(value(p)).toBeCloseTo(ramp(p), 4);
    expect(value(new Vector3(5, 0.5, 1))).toBeCloseTo(ramp(new Vector3(2, 0.5, 2)), 4);
  });

  it("fills three's grid: its probes where our points are, its formula our irradiance, following the light", () => {
    const noise = random(7),
      shares = Array.from({ length: count }, () => 0.5 + noise());
    const lattice = open((p) => shares[p]!),
      grid = lattice.probeGrid(LightProbeGridWebGL),
      version = grid.texture!.version;
    lattice.relight(new Lighting(Array.from({ length: 27 }, (_, i) => (i < 3 ? 4 : noise() - 0.5))));
    expect(grid.texture!.version).toBeGreaterThan(version);
    expect(grid.texture!.image).toMatchObject({ width: 4, height: 3, depth: 7 * (5 + 2) });
    expect(grid.boundingBox.min.toArray().map((v) => +v.toFixed(6))).toEqual([-1.5, -0.25, 1.75]);
    const place = new Vector3(),
      theirs = new Vector3(),
      found = new Vector3();
    for (let p = 0; p < count; ++p) {
      const [x, y, z] = [p % 4, Math.floor(p / 4) % 3, Math.floor(p / 12)] as const;
      lattice.position(p, place);
      expect(grid.getProbePosition(x, y, z, theirs).distanceTo(place)).toBeLessThan(1e-6);
      for (const normal of directions.slice(0, 8)) {
        probe(grid, x, y, 1 + z).getIrradianceAt(normal, found);
        expect(Math.abs(found.y / lattice.irradianceAt(place, normal).g - 1)).toBeLessThan(0.002);
      }
    }
    expect(probe(grid, 2, 1, 0)).toEqual(probe(grid, 2, 1, 1));
    expect(probe(grid, 2, 1, 6)).toEqual(probe(grid, 2, 1, 5));
    lattice.dispose();
    expect(grid.texture).toBeNull();
  });

  it('follows a turn of the light in a moment: 256 probes', () => {
    const values = new Float32Array(16 * 16 * 9 * 3 * 36).fill(0.1),
      many = { ...header, points: [8, 4, 8], channels: 3 as const };
    const lattice = new Lattice(many, 6, 36, values.buffer, new Uint8Array(256)),
      light = new Lighting(new Float64Array(108).fill(0.1));
    lattice.probeGrid(LightProbeGridWebGL);
    const times = Array.from({ length: 8 }, () => {
      const begin = performance.now();
      lattice.relight(light);
      return performance.now() - begin;
    });
    console.log(`256 probes of order 6 in colour follow a turn in ${Math.min(...times).toFixed(2)} ms`);
    expect(Math.min(...times)).toBeLessThan(20);
  });

  it('refuses what is none', async () => {
    const source = (lattice: unknown): TransferSource =>
      ({
        extension: { lattice, transfer: { kind: 'diffuse', order: 3 } },
        bufferView: () => new ArrayBuffer(8),
      }) as never;
    expect(await loadLattice(source(undefined))).toBeUndefined();
    const good = { ...header, bufferView: 0, valid: 1 };
    for (const bad of [3, { ...good, points: [0, 1, 1] }, { ...good, min: [3, 0, 0] }, { ...good, order: 99 }])
      await expect(loadLattice(source(bad))).rejects.toThrow(/holds a "lattice" that is none/);
    await expect(loadLattice(source(good))).rejects.toThrow(/8 bytes of a lattice/);
  });
});

describe.skipIf(!haveTool)("a file's lattice", () => {
  const light = (folder: string, lamps: boolean): string[] =>
    lamps ? ['--light', `sh:3+lamps:2@${join(folder, 'light.hdr')}`] : ['--order', '4'];
  it.each([false, true])('is lit as the command-line tool lights its probes for three.js; lamps: %s', async (lamps) => {
    const folder = makeFolder(),
      at = (name: string): string => join(folder, name);
    writeLopsidedHdr(at('light.hdr'));
    const room = writeRoom(folder);
    const bake = [
      '--samples',
      '16',
      '--bounces',
      '1',
      ...light(folder, lamps),
      '--lattice',
      '4,3,5',
      '--lattice-order',
      '3',
    ];
    lambent('bake', room, ...bake, '-o', at('free.glb'));
    lambent('bake', room, '--receivers', 'texels', '--texels-per-unit', '1', '--samples', '4', '-o', at('flat.glb'));
    lambent(
      ...['export', at('flat.glb'), '--three', at('room'), '--sky-columns'],
      ...['--probes', at('free.glb'), '--env', at('light.hdr')],
    );
    const { positions, sh } = JSON.parse(readFileSync(at('room.probes.json'), 'utf8')) as Record<string, number[]>;
    const file = new Uint8Array(readFileSync(at('free.glb'))).buffer,
      json = new DataView(file).getUint32(12, true),
      document = checkBakedFile(file) as {
        extensions: { LAMBENT_transfer: TransferExtension };
        bufferViews: { byteOffset: number; byteLength: number }[];
      };
    const lattice = (await loadLattice({
      extension: document.extensions.LAMBENT_transfer,
      bufferView: (view: number) => {
        const { byteOffset = 0, byteLength } = document.bufferViews[view]!,
          from = 20 + json + 8 + byteOffset;
        return Promise.resolve(file.slice(from, from + byteLength));
      },
    } as unknown as TransferSource))!;
    lattice.relight(Lighting.fromMap(readMap(new Uint8Array(readFileSync(at('light.hdr'))).buffer)));
    const grid = lattice.probeGrid(LightProbeGridWebGL),
      place = new Vector3(),
      size = Math.max(...sh!.map(Math.abs));
    let worst = 0;
    for (let p = 0; p < count; ++p) {
      lattice.position(p, place);
      expect(place.distanceTo(new Vector3().fromArray(positions!, 3 * p))).toBeLessThan(1e-5);
      probe(grid, p % 4, Math.floor(p / 4) % 3, 1 + Math.floor(p / 12))
        .toArray()
        .forEach((v, i) => (worst = Math.max(worst, Math.abs(v - sh![27 * p + i]!) / size)));
    }
    console.log(
      `probes of ${count} points, against the tool's: ${(100 * worst).toFixed(3)} % of the largest number apart`,
    );
    expect(worst).toBeLessThan(0.001);
    // And what three's grid keeps, as a file.
    lambent('export', at('free.glb'), '--three-probes', at('grid'), '--env', at('light.hdr'));
    const bytes = new Uint8Array(readFileSync(at('grid.probes.bin'))).buffer,
      about = JSON.parse(readFileSync(at('grid.probes.json'), 'utf8')) as Record<string, number[]>,
      values = (bits: Uint16Array): number[] => Array.from(bits, (v) => DataUtils.fromHalfFloat(v)),
      theirs = values(new Uint16Array(bytes)),
      ours = values(grid.texture!.image.data as Uint16Array);
    expect(theirs.length).toBe(ours.length);
    theirs.forEach((v, i) => expect(Math.abs(v - ours[i]!)).toBeLessThan(size * 0.001));
    expect(about['resolution']).toEqual([4, 3, 5]);
    expect(
      new Vector3(grid.width, grid.height, grid.depth).distanceTo(new Vector3().fromArray(about['size']!)),
    ).toBeLessThan(1e-5);
    expect(grid.position.distanceTo(new Vector3().fromArray(about['position']!))).toBeLessThan(1e-5);
  });
});
