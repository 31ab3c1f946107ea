import { describe, expect, it } from 'vitest';
import {
  Bone,
  BufferGeometry,
  DoubleSide,
  Float32BufferAttribute,
  Matrix3,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  Quaternion,
  Raycaster,
  Skeleton,
  SkinnedMesh,
  Uint16BufferAttribute,
  Uint32BufferAttribute,
  Vector3,
  type DataTexture,
} from 'three';
import { describeLobes, lobeGeometry, lobePeak, pickVertex } from '../page/lobes.ts';
import { lobeValue, orthogonalPart, readLobes, surfaceFrame } from '../src/lobes.ts';
import { evaluateSh, shBand } from '../src/sh.ts';
import { zonalValues } from '../src/zonal.ts';
import { random } from './tool.ts';

const next = random(3);
const turn = new Quaternion().setFromAxisAngle(new Vector3(0.36, 0.48, 0.8), 1.2),
  rotation = new Matrix3().setFromMatrix4(new Matrix4().makeRotationFromQuaternion(turn));
const near = (a: Matrix3, b: Matrix3): void => a.elements.forEach((v, k) => expect(v).toBeCloseTo(b.elements[k]!, 6));

describe('a lobe', () => {
  const bands = [0, 0, 0.7, -0.4, 0.3, 0.1];

  it('has the value of its harmonics', () => {
    const s = new Vector3(2, -1, 3).normalize(),
      d = new Vector3(-1, 4, 2).normalize(),
      ys: number[] = [],
      yd: number[] = [];
    evaluateSh(6, s.x, s.y, s.z, ys);
    evaluateSh(6, d.x, d.y, d.z, yd);
    expect(lobeValue(bands, s.dot(d))).toBeCloseTo(
      ys.reduce((sum, y, k) => sum + bands[shBand(k)]! * y * yd[k]!, 0),
      12,
    );
  });

  for (const channels of [1, 3] as const)
    it(`is read from where the file has it, its energy the integral of its square: ${channels} channels`, () => {
      const order = 6,
        lobes = 4,
        exact = 2,
        values = Array.from({ length: zonalValues(order, lobes, channels) }, () => next() - 0.5);
      const read = readLobes(values, order, exact, lobes, channels),
        first = 4 * channels,
        stride = 3 + 4 * channels;
      expect(read).toHaveLength(lobes);
      read.forEach(({ axis, bands, energy }, i) => {
        const at = first + i * stride,
          given = new Vector3(...values.slice(at, at + 3));
        expect(axis.distanceTo(given.normalize())).toBeLessThan(1e-12);
        const g = (c: number): number => values[at + 3 + 4 * c]!;
        expect(bands.slice(0, 3)).toEqual([
          0,
          0,
          channels === 1 ? g(0) : expect.closeTo(0.2126 * g(0) + 0.7152 * g(1) + 0.0722 * g(2), 12),
        ]);
        let integral = 0;
        for (let j = 0; j < 2000; ++j) integral += (2 * Math.PI * lobeValue(bands, (j + 0.5) / 1000 - 1) ** 2) / 1000;
        expect(integral / energy).toBeCloseTo(1, 4);
      });
    });

  it('is drawn about +Y as far out as its value', () => {
    const position = lobeGeometry(bands, 3).getAttribute('position'),
      p = new Vector3();
    let most = 0;
    for (let k = 0; k < position.count; ++k) {
      const r = p.fromBufferAttribute(position, k).length();
      most = Math.max(most, r);
      if (r > 0.01) expect(r).toBeCloseTo(3 * Math.abs(lobeValue(bands, p.y / r)), 4);
    }
    expect(most).toBeCloseTo(3 * lobePeak(bands), 2);
  });

  it('is told in words, the strongest first', () => {
    const lobe = (
      energy: number,
      x: number,
      y: number,
      z: number,
    ): { axis: Vector3; bands: number[]; energy: number } => ({ axis: new Vector3(x, y, z), bands: [], energy });
    expect(describeLobes([lobe(0.01, 0, 1, 0), lobe(0.03, -0.6, -0.001, 0.8)])).toBe(
      '2 lobes of energy 0.04: 75 % about (−0.60, 0.00, 0.80); 25 % about (0.00, 1.00, 0.00)',
    );
    expect(describeLobes([lobe(0, 0, 0, 1)])).toBe('1 lobe of energy 0: 0 % about (0.00, 0.00, 1.00)');
  });
});

describe('the frame of a surface', () => {
  it('is the rotation of a stretched one, and the identity of a flat one', () => {
    const stretch = new Matrix3().set(2, 0.3, 0, 0.3, 1, 0.2, 0, 0.2, 0.5);
    near(orthogonalPart(rotation.clone().multiply(stretch)), rotation);
    // In units of any size.
    for (const size of [1e-4, 0.01, 300])
      near(orthogonalPart(rotation.clone().multiply(stretch).multiplyScalar(size)), rotation);
    near(orthogonalPart(new Matrix3().set(1, 0, 0, 0, 1, 0, 0, 0, 0)), new Matrix3());
  });

  it('is that of the bones against the pose that was baked', () => {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new Float32BufferAttribute([0, 0, 0, 1, 0, 0], 3));
    geometry.setAttribute('skinIndex', new Uint16BufferAttribute([0, 0, 0, 0, 1, 0, 0, 0], 4));
    geometry.setAttribute('skinWeight', new Float32BufferAttribute([1, 0, 0, 0, 1, 0, 0, 0], 4));
    const mesh = new SkinnedMesh(geometry),
      bones = [new Bone(), new Bone()];
    bones[1]!.rotation.y = 0.4; // already so in the pose that was baked
    for (const bone of bones) mesh.add(bone);
    mesh.updateMatrixWorld(true);
    mesh.bind(new Skeleton(bones, [new Matrix4(), new Matrix4()]));
    mesh.skeleton.update();
    const rest = {
      bones: { image: { data: Float32Array.from(mesh.skeleton.boneMatrices!) } } as unknown as DataTexture,
    };
    bones[1]!.quaternion.premultiply(turn);
    mesh.updateMatrixWorld(true);
    mesh.skeleton.update();
    near(surfaceFrame(mesh, 0, rest), new Matrix3());
    near(surfaceFrame(mesh, 1, rest), rotation);
  });
});

describe('picking', () => {
  const geometry = new BufferGeometry();
  geometry
    .setAttribute('position', new Float32BufferAttribute([0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0], 3))
    .setIndex([0, 1, 2, 1, 3, 2]);
  const mesh = new Mesh(geometry, new MeshBasicMaterial({ side: DoubleSide }));
  mesh.position.set(5, 0, 0);
  mesh.scale.setScalar(2);
  mesh.updateMatrixWorld(true);
  const from = (x: number, y: number, z: number): Raycaster =>
    new Raycaster(new Vector3(x, y, z), new Vector3(0, 0, -Math.sign(z)));

  it('finds the nearest vertex of what the ray meets first', () => {
    expect(pickVertex([mesh], from(5.2, 0.1, 3))).toEqual({ mesh, vertex: 0, back: false });
    expect(pickVertex([mesh], from(6.8, 0.3, 3))?.vertex).toBe(1);
    expect(pickVertex([mesh], from(6.9, 1.8, 3))?.vertex).toBe(3);
    expect(pickVertex([mesh], from(4.9, 0.1, 3))).toBeUndefined();
  });

  it('tells the back, where there are receivers on it', () => {
    expect(pickVertex([mesh], from(5.2, 0.1, -3))?.back).toBe(false);
    geometry.setAttribute('lambentReceiverBack', new Uint32BufferAttribute([0, 1, 2, 3], 1));
    expect(pickVertex([mesh], from(5.2, 0.1, -3))?.back).toBe(true);
    expect(pickVertex([mesh], from(5.2, 0.1, 3))?.back).toBe(false);
  });
});
