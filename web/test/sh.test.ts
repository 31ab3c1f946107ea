import { describe, expect, it } from 'vitest';
import { Euler, Matrix3, Matrix4, Vector3 } from 'three';
import { projectLatLong, texelSolidAngle } from '../src/projection.ts';
import { clampedCosine, evaluateSh, maxShOrder, shBand, shCount, shIndex } from '../src/sh.ts';
import { makeShRotation, rotateSh } from '../src/sh_rotation.ts';
import { shWindow } from '../src/sh_window.ts';
import { irradianceIndices } from '../src/unshadowed_material.ts';
import { random } from './tool.ts';

const rounding = 1e-11; // doubles, sums of some hundred terms of size 1

/**
 * Integral over the sphere, exact for polynomials up to degree 63: Gauss-Legendre in z by Newton's method, even spacing
 * about it.
 */
function integrate(f: (x: number, y: number, z: number) => number): number {
  const nodes = 33,
    turns = 66;
  let sum = 0;
  for (let i = 0; i < nodes; ++i) {
    let z = Math.cos((Math.PI * (i + 0.75)) / (nodes + 0.5)),
      slope = 1;
    for (let step = 0; step < 50; ++step) {
      let p0 = 1,
        p1 = z;
      for (let k = 2; k <= nodes; ++k) [p0, p1] = [p1, ((2 * k - 1) * z * p1 - (k - 1) * p0) / k];
      slope = (nodes * (z * p1 - p0)) / (z * z - 1);
      z -= p1 / slope;
    }
    const weight = (2 / ((1 - z * z) * slope * slope)) * ((2 * Math.PI) / turns),
      r = Math.sqrt(1 - z * z);
    for (let j = 0; j < turns; ++j) {
      const phi = (2 * Math.PI * (j + 0.5)) / turns;
      sum += weight * f(r * Math.cos(phi), r * Math.sin(phi), z);
    }
  }
  return sum;
}

const skew = new Matrix4().makeRotationFromEuler(new Euler(0.7, -1.9, 2.4, 'YXZ'));
const rowMajor = (m: Matrix4): number[] => [...new Matrix3().setFromMatrix4(m).transpose().elements];

describe('spherical harmonics', () => {
  it('are orthonormal up to order 16', () => {
    // A random pair of vectors of coefficients: the integral of the product of their functions is their dot product.
    const next = random(3),
      a = Array.from({ length: 256 }, next),
      b = Array.from({ length: 256 }, next),
      y = new Float64Array(256);
    const product = integrate((x, yy, z) => {
      evaluateSh(16, x, yy, z, y);
      const f = y.reduce((s, v, i) => s + v * a[i]!, 0),
        g = y.reduce((s, v, i) => s + v * b[i]!, 0);
      return f * g;
    });
    expect(product).toBeCloseTo(
      a.reduce((s, v, i) => s + v * b[i]!, 0),
      9,
    );
  });

  it('have the sign and the closed forms of the first bands', () => {
    const y = new Float64Array(9),
      [x, yy, z] = [0.36, 0.48, 0.8];
    evaluateSh(3, x, yy, z, y);
    const k1 = Math.sqrt(3 / (4 * Math.PI)),
      k2 = Math.sqrt(15 / (4 * Math.PI));
    const closed = [
      Math.sqrt(1 / (4 * Math.PI)),
      -k1 * yy,
      k1 * z,
      -k1 * x,
      k2 * x * yy,
      -k2 * yy * z,
      Math.sqrt(5 / (16 * Math.PI)) * (3 * z * z - 1),
      -k2 * x * z,
      (k2 / 2) * (x * x - yy * yy),
    ];
    closed.forEach((value, i) => expect(y[i]).toBeCloseTo(value, 12));
  });

  it('know the clamped cosine', () => {
    for (let l = 0; l < 9; ++l) {
      // The l-th zonal coefficient of max(0, z) over sqrt((2l+1) / 4 pi) by Simpson's rule on [0, 1], where it is a
      // polynomial.
      const y = new Float64Array(shCount(l + 1)),
        steps = 2000;
      let sum = 0;
      for (let i = 0; i <= steps; ++i) {
        const z = i / steps;
        evaluateSh(l + 1, Math.sqrt(1 - z * z), 0, z, y);
        sum += (i === 0 || i === steps ? 1 : i % 2 ? 4 : 2) * z * y[shIndex(l, 0)]!;
      }
      const integral = (2 * Math.PI * sum) / (3 * steps);
      expect(clampedCosine(l)).toBeCloseTo(integral / Math.sqrt((2 * l + 1) / (4 * Math.PI)), 8);
    }
    expect(irradianceIndices(6)).toHaveLength(1 + 3 + 5 + 9);
  });

  it('turn as the functions do, about a skew axis, at every order', () => {
    const light = Float64Array.from({ length: 3 * 256 }, random(8)),
      turned = new Float64Array(3 * 256),
      y = new Float64Array(256);
    rotateSh(makeShRotation(maxShOrder, rowMajor(skew)), light, turned);
    const value = (c: Float64Array, d: Vector3, channel: number): number => {
      evaluateSh(16, d.x, d.y, d.z, y);
      return y.reduce((s, v, i) => s + v * c[3 * i + channel]!, 0);
    };
    const inverse = skew.clone().invert(),
      next = random(21);
    for (let i = 0; i < 200; ++i) {
      const d = new Vector3(next() - 0.5, next() - 0.5, next() - 0.5).normalize(),
        back = d.clone().applyMatrix4(inverse);
      for (let c = 0; c < 3; ++c) expect(Math.abs(value(turned, d, c) - value(light, back, c))).toBeLessThan(1e-10);
    }
  });
});

describe('projection of maps', () => {
  it('has solid angles that sum to the sphere', () => {
    let sum = 0;
    for (let y = 0; y < 31; ++y) sum += 57 * texelSolidAngle(y, 57, 31);
    expect(sum).toBeCloseTo(4 * Math.PI, 12);
    expect(texelSolidAngle(3, 57, 31)).toBeCloseTo(
      ((2 * Math.PI) / 57) * (Math.cos((3 * Math.PI) / 31) - Math.cos((4 * Math.PI) / 31)),
      12,
    );
  });

  it('is the plain double sum over texels and harmonics', () => {
    const width = 37,
      height = 19,
      order = 16,
      next = random(4),
      split = Math.ceil(1024 / width);
    const data = Float32Array.from({ length: width * height * 4 }, next);
    const fast = projectLatLong({ data, width, height, channels: 4 }, order);
    const slow = new Float64Array(3 * 256),
      y = new Float64Array(256);
    for (let j = 0; j < height * split; ++j)
      for (let i = 0; i < width * split; ++i) {
        const phi = 2 * Math.PI * ((i + 0.5) / (width * split) - 0.5),
          theta = (Math.PI * (j + 0.5)) / (height * split);
        evaluateSh(order, Math.sin(theta) * Math.cos(phi), Math.cos(theta), Math.sin(theta) * Math.sin(phi), y);
        const angle = texelSolidAngle(j, width * split, height * split),
          at = 4 * (Math.floor(j / split) * width + Math.floor(i / split));
        for (let k = 0; k < 256; ++k) for (let c = 0; c < 3; ++c) slow[3 * k + c]! += angle * y[k]! * data[at + c]!;
      }
    for (let k = 0; k < slow.length; ++k) expect(Math.abs(fast[k]! - slow[k]!)).toBeLessThan(rounding);
  });

  it('counts negative and endless texels as nothing', () => {
    const clean = Float32Array.from({ length: 32 * 16 * 3 }, random(9)),
      dirty = clean.slice();
    for (const [at, bad] of [
      [5, -1],
      [100, NaN],
      [333, Infinity],
    ] as const) {
      clean[at] = 0;
      dirty[at] = bad;
    }
    expect(projectLatLong({ data: dirty, width: 32, height: 16, channels: 3 }, 4)).toEqual(
      projectLatLong({ data: clean, width: 32, height: 16, channels: 3 }, 4),
    );
  });
});

describe('windows', () => {
  const sun = new Float64Array(3 * 36),
    y = new Float64Array(36);
  evaluateSh(6, 0.48, 0.6, 0.64, y);
  for (let i = 0; i < 36; ++i) sun.fill(y[i]!, 3 * i, 3 * i + 3);
  const lowest = (factors: number[]): number => {
    // By brute force over a grid of normals other than the window's own.
    let low = Infinity;
    for (let i = 0; i < 90; ++i)
      for (let j = 0; j < 180; ++j) {
        const t = (Math.PI * (i + 0.5)) / 90,
          p = (Math.PI * j) / 90;
        evaluateSh(6, Math.sin(t) * Math.cos(p), Math.sin(t) * Math.sin(p), Math.cos(t), y);
        low = Math.min(
          low,
          y.reduce((s, v, k) => s + v * sun[3 * k]! * factors[shBand(k)]! * clampedCosine(shBand(k)), 0),
        );
      }
    return low / ((sun[0]! / Math.sqrt(4 * Math.PI)) * Math.PI);
  };

  it('auto is the weakest under which irradiance does not go negative', () => {
    expect(lowest(shWindow('none', sun))).toBeLessThan(-0.01);
    const auto = shWindow('auto', sun),
      k = (1 / auto[1]! - 1) / 4;
    expect(lowest(auto)).toBeGreaterThan(-2e-3); // asked for: -1e-3 on its lattice
    expect(lowest(auto.map((_, l) => 1 / (1 + 0.8 * k * l * l * (l + 1) ** 2)))).toBeLessThan(-1e-3);
    expect(shWindow('auto', [1, 1, 1, ...new Array<number>(9).fill(0)])).toEqual([1, 1]);
  });

  it('Hann and Lanczos follow their formulas', () => {
    expect(shWindow('hann', sun)[3]).toBeCloseTo(0.5, 12);
    expect(shWindow('lanczos', sun)[3]).toBeCloseTo(2 / Math.PI, 12);
    expect(shWindow('none', sun)).toEqual([1, 1, 1, 1, 1, 1]);
  });
});
