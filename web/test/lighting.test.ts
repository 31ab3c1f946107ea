// Lighting against the command-line tool, which shares no code with it, and against three.js's own probe.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import {
  DataTexture,
  DataUtils,
  Euler,
  FloatType,
  HalfFloatType,
  LightProbe,
  MathUtils,
  Quaternion,
  RGBAFormat,
  Vector3,
} from 'three';
import { describe, expect, it } from 'vitest';
import { readMap } from '../page/loading.ts';
import { Lighting, projectLatLong, withoutPeaks, type LatLongMap } from '../src/index.ts';
import { haveTool, lambentJson, makeFolder, random, writeLopsidedHdr } from './tool.ts';

const degrees = [40, -25, 70] as const;
const turn = (): Quaternion =>
  new Quaternion().setFromEuler(
    new Euler(
      ...([degrees[1], degrees[0], degrees[2]].map((d) => MathUtils.degToRad(d)) as [number, number, number]),
      'YXZ',
    ),
  );
const readFile = (path: string): ArrayBuffer => new Uint8Array(readFileSync(path)).buffer;
const read = (path: string): Lighting => {
  const light = Lighting.fromMap(readMap(readFile(path)));
  light.window = 'none';
  return light;
};

interface EnvJson {
  coefficients: number[][];
  window: number[];
}
/** Largest difference over the largest coefficient. */
function difference(ours: ArrayLike<number>, theirs: EnvJson): number {
  const flat = theirs.coefficients.flat(),
    size = Math.max(...flat.map(Math.abs));
  expect(ours.length).toBe(flat.length);
  return Math.max(...flat.map((v, i) => Math.abs(v - ours[i]!))) / size;
}
const single = 3e-6; // the tool keeps coefficients and turns them in single precision

describe.skipIf(!haveTool)('lighting agrees with lambent env', () => {
  const folder = makeFolder(),
    map = join(folder, 'light.hdr');
  writeLopsidedHdr(map);

  it('at order 16', () => {
    expect(difference(read(map).coefficients(16), lambentJson('env', map, '--order', '16') as EnvJson)).toBeLessThan(
      single,
    );
  });
  it('turned about a skew axis, at orders 6 and 11', () => {
    const light = read(map);
    light.rotation.copy(turn());
    for (const order of [6, 11])
      expect(
        difference(
          light.coefficients(order),
          lambentJson('env', map, '--order', String(order), '--env-rotate', degrees.join()) as EnvJson,
        ),
      ).toBeLessThan(single);
  });
  for (const window of ['hann', 'lanczos', 'auto'] as const)
    it(`with the window ${window}`, () => {
      const light = read(map);
      light.window = window;
      // `auto` is found on one lattice here and there, in double and in single precision, to 24 halvings of an
      // interval.
      expect(
        difference(light.coefficients(6), lambentJson('env', map, '--order', '6', '--window', window) as EnvJson),
      ).toBeLessThan(window === 'auto' ? 1e-4 : single);
    });
  it('as a three.js probe', () => {
    const light = read(map);
    light.rotation.copy(turn());
    const probe = light.toLightProbe().sh.coefficients.flatMap((c) => c.toArray());
    expect(
      difference(
        probe,
        lambentJson('env', map, '--order', '3', '--env-rotate', degrees.join(), '--convention', 'three') as EnvJson,
      ),
    ).toBeLessThan(single);
  });
});

describe('lighting', () => {
  const next = random(12),
    texels = Float32Array.from({ length: 64 * 32 * 4 }, next);

  it('reads float and half textures, either way up', () => {
    const make = (data: Float32Array | Uint16Array, flipY: boolean): DataTexture => {
      const texture = new DataTexture(
        data,
        64,
        32,
        RGBAFormat,
        data instanceof Float32Array ? FloatType : HalfFloatType,
      );
      texture.flipY = flipY;
      return texture;
    };
    const rows = Array.from({ length: 32 }, (_, y) => texels.slice(256 * y, 256 * (y + 1))).reverse(),
      upside = new Float32Array(texels.length);
    rows.forEach((row, y) => upside.set(row, 256 * y));
    const top = Lighting.fromEquirectangular(make(texels, true), 6).coefficients(6);
    expect(Lighting.fromEquirectangular(make(upside, false), 6).coefficients(6)).toEqual(top);
    const half = Lighting.fromEquirectangular(
      make(
        Uint16Array.from(texels, (v) => DataUtils.toHalfFloat(v)),
        true,
      ),
      6,
    ).coefficients(6);
    // Half's rounding, 2^-11 each, on a total of 2 pi.
    half.forEach((v, i) => expect(Math.abs(v - top[i]!)).toBeLessThan(2e-3));
  });

  it('goes through a three.js probe and back', () => {
    const light = new Lighting(Array.from({ length: 27 }, next));
    light.window = 'none';
    const back = Lighting.fromLightProbe(light.toLightProbe(new LightProbe(undefined, 1)));
    back.window = 'none';
    back.coefficients(3).forEach((v, i) => expect(v).toBeCloseTo(light.coefficients(3)[i]!, 12));
  });

  it('gives three.js the irradiance that it has: pi times the mean over the cosine lobe, no other factor', () => {
    // One band up and down: L = 1 + d.y, so irradiance on a plane facing +Y is pi + 2 pi / 3.
    const light = Lighting.fromEquirectangular(
      new DataTexture(
        Float32Array.from(
          { length: 256 * 128 * 4 },
          (_, i) => 1 + Math.cos((Math.PI * (Math.floor(i / 1024) + 0.5)) / 128),
        ),
        256,
        128,
        RGBAFormat,
        FloatType,
      ),
      3,
    );
    light.rotation.setFromAxisAngle(new Vector3(1, 0, 0), Math.PI); // the data's first row is the lowest: turn it up
    const E = light.toLightProbe().sh.getIrradianceAt(new Vector3(0, 1, 0), new Vector3());
    expect(E.x).toBeCloseTo(Math.PI + (2 * Math.PI) / 3, 3);
  });

  it('pads with zeros beyond its bands, and cuts to `bands`', () => {
    const light = new Lighting(Array.from({ length: 27 }, next));
    light.window = 'none';
    expect([...light.coefficients(5).slice(27)].every((v) => v === 0)).toBe(true);
    light.bands = 2;
    expect([...light.coefficients(3).slice(12)].every((v) => v === 0)).toBe(true);
    expect(light.coefficients(3).slice(0, 12)).not.toContain(0);
  });

  it('refuses what is no light', () => {
    expect(() => new Lighting([1, 2, NaN])).toThrow(/finite/);
    expect(() => new Lighting(new Array<number>(6).fill(1))).toThrow();
    expect(() => readMap(new TextEncoder().encode('no picture').buffer)).toThrow(/\.hdr or \.exr/);
    expect(() => readMap(new TextEncoder().encode('#?RADIANCE\n\n-Y 4 +X 8\n').buffer)).toThrow(/cannot be read/);
  });
});

describe('peaks', () => {
  /** Unevenness, and a sun of six texels where `sun` is more than 0. */
  const map = (sun: number): LatLongMap => {
    const data = new Float32Array(3 * 64 * 32);
    for (let y = 0; y < 32; ++y)
      for (let x = 0; x < 64; ++x) {
        const g = (((7 * x + 3 * y) % 16) + 4) / 16,
          isSun = sun > 0 && x >= 40 && x < 43 && y >= 9 && y < 11;
        data.set(isSun ? [400, 300, 200 + x].map((v) => sun * v) : [g, g / 2, 1.25 - g / 2], 3 * (64 * y + x));
      }
    return { data, width: 64, height: 32, channels: 3 };
  };

  // What without_peaks and project_environment of the C++ library print for this map: the sun's middle texel, and
  // coefficients by index.
  it.each([
    [
      3,
      [0.872065663, 0.654049277, 0.525419593],
      {
        0: [2.53894329, 1.2724241, 3.14499521],
        1: [-0.00311865658, -0.00438674074, 0.00530144991],
        3: [-0.00259795948, -0.00382236135, 0.00464065094],
        8: [-0.00059558131, -0.000645741762, 0.000742761826],
      },
    ],
    [
      6,
      [0.914187193, 0.685640395, 0.55079776],
      {
        0: [2.55163598, 1.27891314, 3.1520381],
        1: [-0.00366492197, -0.00479644025, 0.00497232471],
        3: [-0.00308548519, -0.00418800581, 0.00434702449],
        35: [0.000740791147, 0.00114581699, -0.00119576044],
      },
    ],
  ])('are cut off as by the C++ library, %i bands', (order, sun, coefficients) => {
    const cut = withoutPeaks(map(1), order),
      light = projectLatLong(cut, order);
    sun.forEach((v, c) => expect(cut.data[3 * (64 * 9 + 41) + c]).toBeCloseTo(v, 6));
    for (const [k, values] of Object.entries(coefficients))
      values.forEach((v, c) => expect(Math.abs(light[3 * Number(k) + c]! - v)).toBeLessThan(1e-6));
  });

  it('and the rest are all of the light; those for glossy surfaces are windowed', () => {
    const light = Lighting.fromMap(map(1), 6);
    light.rotation.copy(turn());
    light.intensity = 2;
    const { rest, peaks } = light.parts(6),
      soft = light.parts(6, true);
    light.window = 'none';
    const whole = light.coefficients(6);
    expect(light.parts(6)).toEqual({ rest: whole, peaks: undefined });
    light.window = 'lanczos';
    expect(light.parts(6)).toEqual({ rest: light.coefficients(6), peaks: undefined });
    whole.forEach((v, i) => expect(rest[i]! + peaks![i]!).toBeCloseTo(v, 10));
    expect(soft.rest).toEqual(rest);
    // Index 9 .. 15 are band 3 of 6: sinc(pi / 2).
    soft.peaks!.slice(27, 48).forEach((v, i) => expect(v).toBeCloseTo((peaks![27 + i]! * 2) / Math.PI, 10));
  });

  it('are those of the bands in use, and none where they are little of the light', () => {
    const light = Lighting.fromMap(map(1), 6),
      of = (order: number): number => light.parts(order).rest[0]!;
    expect(of(6)).toBeCloseTo(2.55163598, 6);
    expect(of(3)).toBeCloseTo(2.53894329, 6);
    light.bands = 3;
    expect(of(6)).toBeCloseTo(2.53894329, 6);
    // Above the rest, these suns have 4 and 6 % of the light.
    for (const sun of [0, 0.02]) expect(Lighting.fromMap(map(sun), 6).parts(6).peaks).toBeUndefined();
    expect(Lighting.fromMap(map(0.03), 6).parts(6).peaks).toBeDefined();
    expect(new Lighting(projectLatLong(map(1), 6)).parts(6).peaks).toBeUndefined(); // which a map alone tells
  });

  it('are, of transfer whose first bands alone are there, those of as many bands in use', () => {
    for (const window of ['auto', 'hann', 'none'] as const)
      for (const glossy of [false, true]) {
        const light = Lighting.fromMap(map(1), 6);
        light.window = window;
        const first = light.parts(6, glossy, 3),
          all = light.parts(6, glossy);
        light.bands = 3;
        expect(first).toEqual(light.parts(6, glossy));
        expect(first).not.toEqual(all);
      }
  });
});
