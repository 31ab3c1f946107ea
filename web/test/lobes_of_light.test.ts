// Light on lobes: numbers that the C++ library finds for a map (ProjectLobes.AreThoseThatThePageIsHeldAgainst), closed
// forms, and lobes of a file that are none.
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { Euler, Matrix3, Matrix4, Quaternion, Vector3 } from 'three';
import { describe, expect, it } from 'vitest';
import { Lighting, projectLatLong, type LatLongMap } from '../src/index.ts';
import { LobeBasis, lobeMoments, lobeScale, readLobes, type LobeKind } from '../src/light_basis.ts';
import { LobeIntegrals, overTexels } from '../src/lobe_integrals.ts';

interface Case {
  lobeKind: LobeKind;
  order: number;
  lobes: number[][];
  coefficients: number[][];
}
const { cases } = JSON.parse(
  readFileSync(fileURLToPath(new URL('../../tests/golden/lobes_of_light.json', import.meta.url)), 'utf8'),
) as { cases: Case[] };

/** The map that those are of. */
function formula(): LatLongMap {
  const [width, height] = [96, 48],
    data = new Float32Array(3 * width * height);
  for (let y = 0; y < height; ++y)
    for (let x = 0; x < width; ++x) {
      const v = ((7 * x + 13 * y) % 17) / 17,
        isSun = x >= 70 && x < 73 && y >= 12 && y < 14;
      data.set(isSun ? [40, 30, 20] : [0.2 + v, 0.3 + 0.5 * v, 0.1 + ((5 * x + 3 * y) % 11) / 11], 3 * (y * width + x));
    }
  return { data, width, height, channels: 3 };
}
const lightingOf = (window: Lighting['window'] = 'none'): Lighting => {
  const lighting = Lighting.fromMap(formula());
  const [yaw, pitch, roll] = [40, -25, 70].map((d) => (d * Math.PI) / 180) as [number, number, number];
  lighting.rotation.setFromEuler(new Euler(pitch, yaw, roll, 'YXZ'));
  lighting.window = window;
  return lighting;
};
const largest = (values: Iterable<number>): number => [...values].reduce((m, v) => Math.max(m, Math.abs(v)), 0);
const difference = (a: ArrayLike<number>, b: ArrayLike<number>): number => largest(Array.from(a, (v, i) => v - b[i]!));

describe('light on lobes', () => {
  for (const given of cases)
    it(`is what C++ makes of it: ${given.lobes.length} of ${given.lobeKind} beside order ${given.order}`, () => {
      const basis = readLobes({ ...given }, given.order)!,
        { rest, peaks } = lightingOf().partsOf(basis),
        truth = given.coefficients.flat();
      expect(peaks).toBeUndefined();
      expect(rest.length).toBe(truth.length);
      console.log(`${given.lobeKind}: ${(difference(rest, truth) / largest(truth)).toExponential(1)} of the largest`);
      // Bands leave out 3e-5 of a lobe, and texels are integrated to 1e-5; C++ has its numbers in floats.
      expect(difference(rest, truth)).toBeLessThan(3e-4 * largest(truth));
    });

  it('has deringed peaks where lobes are bands in other words, which add up as harmonics do', () => {
    const given = cases.find(({ lobeKind }) => lobeKind === 'band_limited')!,
      basis = readLobes({ ...given }, 0)!,
      lighting = lightingOf('auto'),
      { rest, peaks } = lighting.partsOf(basis),
      sh = lighting.parts(4);
    expect(basis.bands).toBe(4);
    expect(peaks).toBeDefined();
    // Back to harmonics: a lobe is its scale over s^2 times the sum of y(axis) y.
    const s = 4,
      y = (k: number): Float64Array => {
        const one = new LobeBasis(0, 'band_limited', [basis.lobes[k]!]);
        const G = new LobeBasis(s, 'band_limited', one.lobes).gram(s);
        return G.slice(0, 17 * 16).filter((_, i) => i % 17 === 16);
      };
    for (const [lobes, bands] of [
      [rest, sh.rest],
      [peaks!, sh.peaks!],
    ] as const) {
      const again = new Float64Array(48);
      basis.lobes.forEach((_, k) =>
        y(k).forEach((v, i) => [0, 1, 2].forEach((c) => (again[3 * i + c]! += v * lobes[3 * k + c]!))),
      );
      expect(difference(again, bands)).toBeLessThan(1e-6 * largest(bands));
    }
  });

  it('has peaks beside harmonics, most of all where a lamp has left its lobe', () => {
    const map = formula(),
      sun = map.data as Float32Array;
    for (let i = 0; i < sun.length; ++i) if (sun[i]! >= 20) sun[i]! *= 20;
    // About the middle of the texels that are bright.
    const theta = (Math.PI * 13) / 48,
      phi = 2 * Math.PI * (71.5 / 96 - 0.5),
      axis = [Math.sin(theta) * Math.cos(phi), Math.cos(theta), Math.sin(theta) * Math.sin(phi)] as const,
      basis = new LobeBasis(4, 'von_mises_fisher', [{ axis, sharpness: 300 }]),
      lighting = Lighting.fromMap(map);
    // In its lobe the sun leaves little to the harmonics, which no window softens.
    const stands = lighting.partsOf(basis).peaks!,
      glossy = lighting.partsOf(basis, true).peaks!;
    expect(difference(stands, glossy)).toBe(0);
    const inHarmonics = stands[0]!;
    lighting.rotation.setFromAxisAngle(new Vector3(0, 1, 0), 1.5);
    const { rest, peaks, turned } = lighting.partsOf(basis);
    expect(peaks).toBeDefined();
    expect(inHarmonics).toBeLessThan(0.4 * peaks![0]!);
    lighting.window = 'none';
    const all = lighting.partsOf(basis).rest;
    expect(
      difference(
        rest.map((v, i) => v + peaks![i]!),
        all,
      ),
    ).toBeLessThan(1e-9 * largest(all));
    // The peaks are the sun's: its light in harmonics, next to nothing of the lobe.
    const sh = lighting.parts(4).rest;
    lighting.window = 'auto';
    const bands = lighting.parts(4).peaks!;
    expect(difference(peaks!.subarray(0, 48), bands)).toBeLessThan(0.02 * largest(bands));
    expect(largest(sh)).toBeGreaterThan(0);
    // In axes turned back to where the lobe is they are still told apart, as all that is drawn at once must be.
    const back = new Matrix3().setFromMatrix4(new Matrix4().makeRotationY(1.5));
    expect(turned!(back).peaks).toBeDefined();
    const soft = lighting.partsOf(basis, true).peaks!;
    expect(Math.abs(soft[45]!)).toBeLessThan(0.6 * Math.abs(peaks![45]!));
    expect(soft[48]).toBeCloseTo(peaks![48]!, 9);
  });

  it('in axes that were turned is the light turned back', () => {
    const turn = new Matrix3().setFromMatrix4(
        new Matrix4().makeRotationFromQuaternion(new Quaternion().setFromAxisAngle(new Vector3(0.48, -0.6, 0.64), 1.1)),
      ),
      back = new Quaternion().setFromRotationMatrix(new Matrix4().setFromMatrix3(turn)).invert();
    for (const given of cases) {
      const basis = readLobes({ ...given }, given.order)!,
        lighting = lightingOf(),
        turned = lighting.partsOf(basis).turned!(turn).rest;
      lighting.rotation.premultiply(back);
      const truth = lighting.partsOf(basis).rest;
      expect(difference(turned, truth)).toBeLessThan(1e-6 * largest(truth));
    }
  });

  it('of a basis is what it is made of: one lobe alone', () => {
    // A narrow disc about the axis: L = 1 there, and the integral of a lobe of unit norm in closed form.
    for (const kind of ['von_mises_fisher', 'compact', 'cosine_power'] as const)
      for (const s of [6, 40, 400]) {
        const I = lobeMoments(kind, s, 1)[0]!,
          whole = 2 * Math.PI * lobeScale(kind, s) * I,
          flat = { data: new Float32Array(3 * 64 * 32).fill(1), width: 64, height: 32, channels: 3 },
          axis = [0.48, -0.6, 0.64] as const,
          basis = new LobeBasis(0, kind, [{ axis, sharpness: s }]),
          texels = new Float64Array(3);
        overTexels(flat, kind, { axis, sharpness: s }, texels);
        expect(texels[0]! / whole).toBeCloseTo(1, 4);
        expect(new LobeIntegrals(flat, basis).about([axis])[1]! / whole).toBeCloseTo(1, 4);
      }
  });

  it('by bands and by texels is the same', () => {
    const map = formula(),
      axis = [0.36, 0.48, -0.8] as const;
    for (const [kind, sharpness] of [
      ['von_mises_fisher', 12],
      ['compact', 9],
      ['cosine_power', 12],
      ['compact', 38.4],
    ] as const) {
      const bands = new LobeIntegrals(map, new LobeBasis(0, kind, [{ axis, sharpness }])).about([axis]),
        texels = new Float64Array(3);
      overTexels(map, kind, { axis, sharpness }, texels);
      // The harmonics of a map this coarse are sums over 11 x 11 points of each texel; 48 bands leave 1e-3 of the last.
      expect(difference(bands, texels)).toBeLessThan((sharpness > 12 ? 1e-3 : 2e-4) * largest(texels));
    }
  });

  it('costs little while a hand turns it', () => {
    const axes = Array.from({ length: 64 }, (_, i) => {
      const z = 1 - (2 * i + 1) / 64,
        r = Math.sqrt(1 - z * z);
      return { axis: [r * Math.cos(2.4 * i), r * Math.sin(2.4 * i), z], sharpness: 9.6 } as const;
    });
    const basis = new LobeBasis(0, 'von_mises_fisher', axes),
      lighting = lightingOf();
    lighting.partsOf(basis);
    const before = process.cpuUsage();
    for (let i = 0; i < 20; ++i) {
      lighting.rotation.premultiply(new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), 0.01));
      lighting.partsOf(basis);
    }
    const { user, system } = process.cpuUsage(before);
    console.log(`64 lobes: ${((user + system) / 20_000).toFixed(2)} ms a turn`);
    expect(user + system).toBeLessThan(20 * 50_000);
  });

  it('leaves the map that is projected alone', () => {
    const map = formula();
    expect(difference(projectLatLong(map, 4), Lighting.fromMap(map, 4).radiance)).toBe(0);
  });

  for (const [what, lobes, lobeKind, sentence] of [
    ['no unit axis', [[0, 0.5, 0.5, 20]], 'compact', /no unit axis/],
    ['a sharpness that is none', [[0, 0, 1, -1]], 'von_mises_fisher', /sharpness out of range/],
    ['bands that are no whole number', [[0, 0, 1, 2.5]], 'band_limited', /sharpness out of range/],
    ['three numbers', [[0, 0, 1]], 'compact', /not four numbers/],
    ['no numbers', [[0, 0, 1, '3']], 'compact', /not four numbers/],
    ['another kind', [[0, 0, 1, 3]], 'gaussian', /kind of lobes/],
    ['no list', 3, 'compact', /no list/],
  ] as const)
    it(`of ${what} is refused`, () => expect(() => readLobes({ lobes, lobeKind }, 2)).toThrow(sentence));
});
