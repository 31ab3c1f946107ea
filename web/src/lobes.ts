// Zonal lobes on the processor, for who wants to look at them: what the shader of zonal.ts reads and turns.
import { Matrix3, Matrix4, Vector3, type DataTexture, type Mesh, type SkinnedMesh } from 'three';
import { luminance, shCount } from './sh.js';

export interface Lobe {
  /** Of length 1, in the world. */
  axis: Vector3;
  /** The coefficient of each band, colours as luminance; 0 in the bands that are stored as they are. */
  bands: number[];
  /** Integral of the lobe's square over all directions. */
  energy: number;
}

/** Legendre polynomials P_0 .. P_(count-1) at `x`. */
function legendrePolynomials(count: number, x: number): number[] {
  const p = [1, x];
  for (let l = 2; l < count; ++l) p.push(((2 * l - 1) * x * p[l - 1]! - (l - 1) * p[l - 2]!) / l);
  return p.slice(0, count);
}

/** The lobe's value at a direction whose cosine with the axis is given: sum_m y_lm(axis) y_lm(d) = (2l+1)/4pi P_l. */
export function lobeValue(bands: readonly number[], cosine: number): number {
  const p = legendrePolynomials(bands.length, cosine);
  return bands.reduce((sum, g, l) => sum + ((g * (2 * l + 1)) / (4 * Math.PI)) * p[l]!, 0);
}

/**
 * Lobes as they were baked, out of the values of one receiver (zonal.ts has their layout); `exact` bands are none of
 * theirs.
 */
export function readLobes(
  values: ArrayLike<number>,
  order: number,
  exact: number,
  lobes: number,
  channels: 1 | 3,
): Lobe[] {
  const upper = order - exact,
    first = channels * shCount(exact);
  return Array.from({ length: lobes }, (_, i) => {
    const at = first + i * (3 + channels * upper),
      axis = new Vector3(values[at], values[at + 1], values[at + 2]);
    if (axis.lengthSq() > 0) axis.normalize();
    else axis.set(0, 0, 1);
    const bands = Array.from({ length: order }, (_, l) => {
      if (l < exact) return 0;
      const g = (c: number): number => values[at + 3 + c * upper + l - exact]!;
      return channels === 3 ? luminance(g(0), g(1), g(2)) : g(0);
    });
    return { axis, bands, energy: bands.reduce((sum, g, l) => sum + (g * g * (2 * l + 1)) / (4 * Math.PI), 0) };
  });
}

/** prtOrthogonal() of the shader: the orthogonal part of a gradient of any size, the identity where it is flat. */
export function orthogonalPart(gradient: Matrix3): Matrix3 {
  const q = gradient.clone(),
    size = Math.hypot(...q.elements) / Math.sqrt(3);
  if (size > 0) q.multiplyScalar(1 / size);
  for (let i = 0; i < 6; ++i) {
    if (Math.abs(q.determinant()) < 1e-6) return new Matrix3();
    const other = q.clone().invert().transpose();
    q.elements.forEach((value, k) => (q.elements[k] = 0.5 * (value + other.elements[k]!)));
  }
  return q;
}

/** prtFrame of the shader: how the surface stands at a vertex, against the pose that was baked. */
export function surfaceFrame(mesh: Mesh, vertex: number, rest: { bones: DataTexture } | { inverse: Matrix3 }): Matrix3 {
  if ('inverse' in rest) return orthogonalPart(new Matrix3().setFromMatrix4(mesh.matrixWorld).multiply(rest.inverse));
  const { skeleton } = mesh as SkinnedMesh,
    index = mesh.geometry.getAttribute('skinIndex'),
    weight = mesh.geometry.getAttribute('skinWeight');
  const blend = (matrices: ArrayLike<number>): Matrix3 => {
    const sum = new Matrix3().multiplyScalar(0),
      bone = new Matrix3();
    for (let j = 0; j < 4; ++j) {
      bone.setFromMatrix4(
        new Matrix4().fromArray(
          Array.from({ length: 16 }, (_, k) => matrices[16 * index.getComponent(vertex, j) + k]!),
        ),
      );
      bone.elements.forEach((value, k) => (sum.elements[k]! += weight.getComponent(vertex, j) * value));
    }
    return sum;
  };
  return orthogonalPart(blend(skeleton.boneMatrices!).multiply(blend(rest.bones.image.data as Float32Array).invert()));
}
