// What zonal.ts has in GLSL, in nodes for WebGPURenderer: lobes that turn with their surface, summed at vertices.
import { Matrix3, Vector4, type Mesh, type Node, type NodeFrame } from 'three/webgpu';
import {
  attribute,
  determinant,
  dot,
  Fn,
  frontFacing,
  If,
  int,
  inverse,
  ivec2,
  ivec3,
  mat3,
  referenceBuffer,
  select,
  texture,
  textureLoad,
  transpose,
  uniform,
  uniformArray,
  varying,
  vec3,
} from 'three/tsl';
import { orthogonalPart } from './lobes.js';
import type { MaterialNodes, NodeLobeOptions, NodeLobes, NodeRest } from './node_edition.js';
import { nodeHarmonics } from './node_harmonics.js';
import { InstanceNodes } from './node_instances.js';
import { lit } from './node_lit.js';
import { loop } from './node_loop.js';
import { glossy, type RowReader } from './node_reflection.js';
import { pack, receiverAt } from './node_sum.js';
import { shBand, shCount } from './sh.js';
import { exactZonalBands } from './zonal.js';

type Int = Node<'int'>;
type Float = Node<'float'>;
type Vec3 = Node<'vec3'>;
type Mat3 = Node<'mat3'>;
type Vectors = ReturnType<typeof uniformArray<'vec4'>>;
/** Which the types do not know of vectors. */
interface Parts {
  element(i: Int): Float;
}
type Sum = (r: Int, row: Int, frame: Mat3) => Vec3;

const component = (of: Node<'vec4'>, k: number): Float => [of.x, of.y, of.z, of.w][k & 3]!;

/** Exit radiance of a receiver's row under a light (eq. 13). */
function sumOf({ layout, transfer, order, channels, lobes }: NodeLobeOptions, light: Vectors): Sum {
  const exact = exactZonalBands(order, lobes),
    upper = order - exact,
    quads = Math.ceil(shCount(order) / 4),
    rowQuads = layout.quads,
    stride = 3 + channels * upper,
    /** Coefficient k of the light, one channel or three. */
    lightAt = (c: number, k: number): Float => component(light.element(int(c * quads + (k >> 2))), k),
    lightOf = (k: number): Vec3 => vec3(lightAt(0, k), lightAt(1, k), lightAt(2, k));
  const shader = Fn(([r, row, frame]: [Int, Int, Mat3]) => {
    const line = r.div(int(layout.columns)),
      at = ivec3(
        r
          .bitAnd(int(layout.columns - 1))
          .mul(int(layout.texels))
          .add(row.mul(int(rowQuads))),
        line.bitAnd(int(layout.rows - 1)),
        line.div(int(layout.rows)),
      ).toVar();
    const texel = (k: Int): Node<'vec4'> => textureLoad(texture(transfer), ivec2(at.x.add(k), at.y)).depth(at.z),
      fixed = (k: number): Float => component(texel(int(k >> 2)), k),
      /** Value k, wherever it lies. */
      value = (k: Int): Float => (texel(k.shiftRight(int(2))) as unknown as Parts).element(k.bitAnd(int(3))),
      color = (of: (k: number) => Float, step: number): Vec3 =>
        channels === 3 ? vec3(of(0), of(step), of(2 * step)) : vec3(of(0));
    const sum = color(fixed, shCount(exact)).mul(lightOf(0)).toVar();
    if (exact > 1) {
      // The linear band is a vector in x, y, z for each channel: (-t_11, -t_1-1, t_10).
      const linear = [0, 1, 2].map((c) => {
        const from = channels === 3 ? 4 * c : 0,
          t = vec3(fixed(from + 3).negate(), fixed(from + 1).negate(), fixed(from + 2)),
          l = vec3(lightAt(c, 3).negate(), lightAt(c, 1).negate(), lightAt(c, 2));
        return dot(frame.mul(t), l);
      }) as [Float, Float, Float];
      sum.addAssign(vec3(...linear));
    }
    if (upper > 0)
      loop(int(lobes), 'lobe', (lobe) => {
        const first = lobe
            .mul(int(stride))
            .add(int(channels * shCount(exact)))
            .toVar(),
          there = (k: number): Float => value(first.add(int(k))),
          axis = vec3(there(0), there(1), there(2)).toVar(),
          size = axis.length().toVar(),
          n = frame.mul(select(size.greaterThan(0), axis.div(size.max(1e-30)), vec3(0, 0, 1))).toVar(),
          g = Array.from({ length: upper }, (_, l) => color((k) => there(3 + l + k), upper).toVar());
        nodeHarmonics(order, n, (index, y) => {
          const band = shBand(index) - exact;
          if (band >= 0) sum.addAssign(g[band]!.mul(lightOf(index).mul(y)));
        });
      });
    return sum;
  });
  return shader;
}

/** How a mesh stands now against the pose that was baked: a rotation of the world. */
function turnOf(inverseRest: Matrix3): Mat3 {
  const now = new Matrix3();
  return uniform(new Matrix3()).onObjectUpdate(({ object }: NodeFrame) =>
    orthogonalPart(now.setFromMatrix4((object as Mesh).matrixWorld).multiply(inverseRest)),
  );
}

/** The same of a skin, vertex by vertex. */
function skinTurn({ bones, count }: Extract<NodeRest, { bones: unknown }>): Mat3 {
  const size = bones.image.width;
  return Fn(() => {
    const index = attribute<'uvec4'>('skinIndex', 'uvec4'),
      weight = attribute<'vec4'>('skinWeight', 'vec4'),
      pose = referenceBuffer('skeleton.boneMatrices', 'mat4', count, null) as unknown as {
        element(i: Node<'uint'>): Node<'mat4'>;
      };
    const then = (i: Node<'uint'>): Mat3 => {
      const j = int(i).mul(int(4)).toVar(),
        column = (k: number): Vec3 =>
          (
            textureLoad(
              texture(bones),
              ivec2(j.mod(int(size)).add(int(k)), j.div(int(size))),
            ) as unknown as Node<'vec4'>
          ).xyz;
      return mat3(column(0), column(1), column(2));
    };
    const blend = (of: (i: Node<'uint'>) => Mat3): Mat3 =>
      [index.x, index.y, index.z, index.w]
        .map((i, k) => of(i).mul(component(weight, k)) as Mat3)
        .reduce((sum, m) => sum.add(m) as Mat3);
    const now = blend((i) => mat3(pose.element(i))),
      q = now.mul(inverse(blend(then)) as unknown as Mat3).toVar() as ReturnType<Mat3['toVar']>,
      flat = int(0).toVar(),
      columns = [0, 1, 2].map((k) => (q as unknown as { element(i: Int): Vec3 }).element(int(k))),
      scale = columns
        .map((v): Float => dot(v, v))
        .reduce((sum, v) => sum.add(v))
        .div(3)
        .sqrt();
    q.assign(q.mul(scale.max(1e-30).reciprocal()));
    // The orthogonal part of a gradient: Higham's iteration, whose error squares at each step.
    loop(int(6), 'step', () => {
      If(determinant(q).abs().lessThan(1e-6), () => {
        flat.assign(int(1));
      }).Else(() => {
        q.assign(q.add(transpose(inverse(q) as unknown as Mat3)).mul(0.5));
      });
    });
    return select(flat.equal(int(1)), mat3(1, 0, 0, 0, 1, 0, 0, 0, 1) as unknown as Mat3, q);
  })();
}

export class LobeNodes implements NodeLobes {
  private readonly light: Vector4[];
  private readonly peaks: Vector4[];
  private readonly hasPeaks = uniform(0);
  private readonly reader: RowReader;
  private readonly instances: InstanceNodes[] = [];

  constructor(private readonly options: NodeLobeOptions) {
    const quads = Math.ceil(shCount(options.order) / 4),
      vectors = (): Vector4[] => Array.from({ length: 3 * quads }, () => new Vector4(0, 0, 0, 0));
    this.light = vectors();
    this.peaks = vectors();
    const rest = sumOf(options, uniformArray<'vec4'>(this.light, 'vec4')),
      peak = sumOf(options, uniformArray<'vec4'>(this.peaks, 'vec4'));
    this.reader = {
      rest: (r, row, frame) => rest(r, row, frame!),
      peak: (r, row, frame) => peak(r, row, frame!),
      hasPeaks: this.hasPeaks,
    };
  }

  set(light: ArrayLike<number>, peaks: ArrayLike<number> | undefined): void {
    pack(this.light, light);
    pack(this.peaks, peaks ?? []);
    this.hasPeaks.value = peaks ? 1 : 0;
  }

  material(twoSided: boolean, rest: NodeRest): MaterialNodes {
    const frame = 'bones' in rest ? skinTurn(rest) : this.turnOf(rest.inverse),
      { last } = this.options;
    if (last) return glossy(last, this.reader, twoSided, frame);
    const front = this.at('lambentReceiver', frame),
      radiance = twoSided ? select(frontFacing, front, this.at('lambentReceiverBack', frame)) : front;
    return { colorNode: lit(radiance) };
  }

  dispose(): void {
    for (const { lights } of this.instances) lights.dispose();
  }

  private turnOf(inverse: Matrix3): Mat3 {
    const instances = new InstanceNodes(0, 0, { inverseOf: () => inverse });
    this.instances.push(instances);
    return instances.choose(
      () => instances.turn(),
      () => turnOf(inverse),
    );
  }

  private at(name: string, frame: Mat3): Vec3 {
    const { reader } = this;
    const radiance = Fn(() => {
      const { r: found, none } = receiverAt(name),
        r = found.toVar(),
        turn = frame.toVar(),
        sum = vec3(0).toVar();
      If(none.not(), () => {
        sum.assign(reader.rest(r, int(0), turn));
        // Light is not negative, nor is what a part of it gives (relight/dering.h).
        If(reader.hasPeaks.greaterThan(0.5), () => {
          sum.assign(sum.max(0).add(reader.peak(r, int(0), turn).max(0)));
        });
      });
      return sum;
    });
    return varying(radiance() as unknown as Vec3);
  }
}
