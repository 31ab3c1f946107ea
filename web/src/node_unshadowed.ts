// What unshadowed_material.ts has in GLSL, in nodes for WebGPURenderer: irradiance by a vertex's normal alone.
import { Vector4, type Node } from 'three/webgpu';
import {
  Fn,
  frontFacing,
  int,
  mat3,
  modelNormalMatrix,
  normalLocal,
  select,
  uniform,
  uniformArray,
  varying,
  vec3,
} from 'three/tsl';
import { lit } from './node_lit.js';
import type { MaterialNodes, NodeUnshadowed } from './node_edition.js';
import { nodeHarmonics } from './node_harmonics.js';
import { shBand } from './sh.js';

type Vec3 = Node<'vec3'>;

/** Of normals along and against which odd harmonics count: columns of even, odd, and of the peaks'. */
export class UnshadowedNodes implements NodeUnshadowed {
  readonly nodes: MaterialNodes;
  private readonly rest: Vector4[];
  private readonly peaks: Vector4[];
  private readonly hasPeaks = uniform(0);

  /** `indices` of the harmonics that irradiance has. */
  constructor(order: number, indices: readonly number[]) {
    const vectors = (): Vector4[] => indices.map(() => new Vector4());
    this.rest = vectors();
    this.peaks = vectors();
    const place = new Map(indices.map((index, at) => [index, at])),
      lights = [this.rest, this.peaks].map((of) => uniformArray<'vec4'>(of, 'vec4'));
    const sums = Fn(() => {
      const n = (modelNormalMatrix as unknown as Node<'mat3'>)
          .mul(normalLocal as unknown as Vec3)
          .normalize()
          .toVar() as unknown as Vec3,
        parts = [0, 1, 2, 3].map(() => vec3(0).toVar());
      nodeHarmonics(order, n, (index, value) => {
        const at = place.get(index);
        if (at !== undefined)
          lights.forEach((light, i) =>
            parts[2 * i + (shBand(index) % 2)]!.addAssign(light.element(int(at)).xyz.mul(value)),
          );
      });
      const [even, odd, evenPeaks, oddPeaks] = parts as unknown as [Vec3, Vec3, Vec3, Vec3],
        side = (rest: Vec3, peaks: Vec3): Vec3 =>
          select(this.hasPeaks.greaterThan(0.5), rest.max(0).add(peaks.max(0)), rest);
      return mat3(side(even.add(odd), evenPeaks.add(oddPeaks)), side(even.sub(odd), evenPeaks.sub(oddPeaks)), vec3(0));
    });
    const both = sums().toVar() as unknown as { element(i: Node<'int'>): Vec3 },
      of = (i: number): Vec3 => varying(both.element(int(i)));
    this.nodes = { colorNode: lit(select(frontFacing, of(0), of(1))) };
  }

  /** [index][3] */
  set(rest: ArrayLike<number>, peaks: ArrayLike<number> | undefined): void {
    const put = (to: Vector4[], from: ArrayLike<number> | undefined): void =>
      to.forEach((v, i) => v.set(from?.[3 * i] ?? 0, from?.[3 * i + 1] ?? 0, from?.[3 * i + 2] ?? 0, 0));
    put(this.rest, rest);
    put(this.peaks, peaks);
    this.hasPeaks.value = peaks ? 1 : 0;
  }
}
