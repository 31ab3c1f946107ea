// What instanced.ts has in GLSL, in nodes for WebGPURenderer: instances of an InstancedMesh, each in light of its own.
import {
  Matrix3,
  type DataArrayTexture,
  type Node,
  type NodeBuilder,
  type NodeFrame,
  type Object3D,
} from 'three/webgpu';
import { Fn, instanceIndex, int, ivec2, mat3, select, texture, textureLoad, uniform, vec3 } from 'three/tsl';
import type { BlockLayout } from './block_texture.js';
import { InstancedLights, instanceLayout, isInstanced } from './instanced.js';
import { loop } from './node_loop.js';

type Int = Node<'int'>;
type Vec3 = Node<'vec3'>;
type Mat3 = Node<'mat3'>;

/** A function of nodes that are made for one object; three's types do not know that it is told which. */
export function ofObject<T extends 'vec3' | 'mat3'>(make: (object: Object3D) => Node<T>): Node<T> {
  const told = Fn as unknown as (body: (builder: NodeBuilder) => Node<T>) => () => Node<T>;
  return told((builder) => make(builder.object))();
}

export class InstanceNodes {
  readonly lights: InstancedLights;
  private readonly values: Parameters<typeof textureLoad>[0];
  /** From the mesh that was baked into the world, without its place. */
  readonly rest: Mat3;
  private readonly hasPeaks = uniform(0);

  /** `quads` 0: turns alone. */
  constructor(
    order: number,
    private readonly quads: number,
    pose: { inverseOf(object: Object3D): Matrix3 | undefined },
  ) {
    this.lights = new InstancedLights(order, quads, pose);
    this.rest = uniform(new Matrix3()).onObjectUpdate(
      ({ object }: NodeFrame) => pose.inverseOf(object!)?.clone().invert() ?? new Matrix3(),
    );
    this.values = texture(this.lights.instances.value).onObjectUpdate(({ object }: NodeFrame) =>
      this.lights.of(object!),
    );
  }

  set(...[light, peaks, turned]: Parameters<InstancedLights['set']>): void {
    this.lights.set(light, peaks, turned);
    this.hasPeaks.value = peaks ? 1 : 0;
  }

  private at(k: Int): Node<'vec4'> {
    const { texels, across } = instanceLayout(this.quads),
      i = int(instanceIndex);
    return textureLoad(this.values, ivec2(i.mod(int(across)).mul(int(texels)).add(k), i.div(int(across))));
  }

  /** From the axes of the bake into the world. */
  turn(): Mat3 {
    const column = (k: number): Vec3 => this.at(int(6 * this.quads + k)).xyz;
    return mat3(column(0), column(1), column(2));
  }

  /** Transfer . light of a receiver's row; part 1 is of the light's peaks. */
  sum({ layout, transfer, channels }: Values, r: Int, row: Int, part: 0 | 1): Vec3 {
    const { quads } = this,
      line = r.div(int(layout.columns)),
      at = ivec2(
        r
          .bitAnd(int(layout.columns - 1))
          .mul(int(layout.texels))
          .add(row.mul(int(channels * quads))),
        line.bitAnd(int(layout.rows - 1)),
      ).toVar(),
      slice = line.div(int(layout.rows)).toVar(),
      sum = vec3(0).toVar();
    loop(int(quads), `quad${part}`, (k) => {
      const read = (c: number): Node<'vec4'> =>
          textureLoad(texture(transfer), at.add(ivec2(k.add(int(c * quads)), int(0)))).depth(slice),
        light = (c: number): Node<'vec4'> => this.at(k.add(int((3 * part + c) * quads))),
        red = read(0).toVar(),
        green = channels === 3 ? read(1).toVar() : red,
        blue = channels === 3 ? read(2).toVar() : red;
      sum.addAssign(vec3(red.dot(light(0)), green.dot(light(1)), blue.dot(light(2))));
    });
    return sum;
  }

  /** The same of light that is held at 0 or above, where it has peaks. */
  part(values: Values, r: Int, row: Int, part: 0 | 1): Vec3 {
    const sum = this.sum(values, r, row, part);
    return select(this.hasPeaks.greaterThan(0.5), sum.max(0), sum);
  }

  /** The same of light that has peaks or none, each part held at 0 or above where there are some. */
  held(values: Values, r: Int): Vec3 {
    const rest = this.sum(values, r, int(0), 0),
      peak = this.sum(values, r, int(0), 1);
    return select(this.hasPeaks.greaterThan(0.5), rest.max(0).add(peak.max(0)), rest);
  }

  /** What an instance is lit by, and what all else is. */
  choose<T extends 'vec3' | 'mat3'>(instance: () => Node<T>, other: () => Node<T>): Node<T> {
    return ofObject((object) => (isInstanced(object) ? instance() : other()));
  }

  dispose(): void {
    this.lights.dispose();
  }
}

interface Values {
  layout: BlockLayout;
  transfer: DataArrayTexture;
  channels: 1 | 3;
}
