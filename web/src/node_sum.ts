// T . light in nodes, for WebGPURenderer: a float picture, a texel a row of each receiver, drawn when the light changes
// and only looked up until then.
import {
  Matrix3,
  DataTexture,
  FloatType,
  HalfFloatType,
  LinearFilter,
  NearestFilter,
  RedIntegerFormat,
  UnsignedIntType,
  Vector4,
  type Node,
  type NodeFrame,
  type Object3D,
  type RenderTarget,
} from 'three/webgpu';
import {
  attribute,
  Fn,
  int,
  ivec2,
  rtt,
  screenCoordinate,
  select,
  texture,
  textureLoad,
  uint,
  uniform,
  uniformArray,
  vec3,
  vec4,
} from 'three/tsl';
import { InstanceNodes } from './node_instances.js';
import { loop } from './node_loop.js';
import type { NodeSum, NodeSumOptions } from './node_edition.js';
import { isInstanced } from './instanced.js';
import { sumColumns } from './shown_sums.js';
import { Alike, lightIn, type TurnableLight } from './turned.js';

export type Picture = ReturnType<typeof rtt>;
type Vectors = ReturnType<typeof uniformArray<'vec4'>>;

const vectors = (quads: number): Vector4[] => Array.from({ length: 3 * quads }, () => new Vector4(0, 0, 0, 0));

/** [column][3] to red, green and blue in whole vectors; zero where there are no more. */
export function pack(out: Vector4[], light: ArrayLike<number>): void {
  const quads = out.length / 3;
  for (let c = 0; c < 3; ++c)
    for (let k = 0; k < 4 * quads; ++k) out[c * quads + (k >> 2)]!.setComponent(k & 3, light[3 * k + c] ?? 0);
}

/** WebGPU has names of its own for what WebGL's texture is. */
function namedAnew(of: DataTexture | undefined): DataTexture | undefined {
  if (!of) return undefined;
  const whose = new DataTexture(of.image.data, of.image.width, of.image.height);
  whose.format = RedIntegerFormat;
  whose.type = UnsignedIntType;
  whose.needsUpdate = true;
  return whose;
}

/** The receiver of the texel that is drawn (-1: none) and its row. */
function pick({ receiversOf, rows = 1 }: NodeSumOptions, whose: DataTexture | undefined): [Node<'int'>, Node<'int'>] {
  const texel = ivec2(screenCoordinate).toVar();
  if (whose && receiversOf) {
    const { height } = receiversOf.image;
    return [
      int(textureLoad(texture(whose), ivec2(texel.x, texel.y.mod(int(height)))).r).toVar(),
      texel.y.div(int(height)).toVar(),
    ];
  }
  // What is drawn beyond the last receiver is not looked up.
  const i = texel.y.mul(sumColumns).add(texel.x).toVar();
  return [i.div(int(rows)).toVar(), i.mod(int(rows)).toVar()];
}

type Light = Omit<TurnableLight, 'turned'>;
/** Of a mesh that was turned: the light as it stands in the axes of the bake. */
interface Turned {
  how: readonly number[];
  of: Light | undefined;
  light: Light;
  targets: Map<Picture, RenderTarget>;
}

const upright = new Matrix3();

export class Sum implements NodeSum {
  readonly picture: Picture;
  /** Where peaks are apart; one texel until there are any. */
  readonly peakPicture: Picture | undefined;
  /** 1 where they count. */
  readonly hasPeaks = uniform(0);
  /** Nodes that look it up, by whether surfaces have two sides. */
  readonly made = new Map<boolean, Node<'vec4'>>();
  /** Of the mesh that is drawn, from the axes of the bake into the world, and back. */
  readonly turn: Node<'mat3'>;
  readonly turnBack: Node<'mat3'>;
  /** Of instances, whose light their vertices sum. */
  readonly instances: InstanceNodes;
  private light: TurnableLight = { rest: [], peaks: undefined };
  private readonly turned = new Alike<Turned>(() => ({
    how: [],
    of: undefined,
    light: this.light,
    targets: new Map(),
  }));
  /** The light that a picture shows. */
  private readonly shown = new WeakMap<RenderTarget, Light>();
  private readonly mains: RenderTarget[] = [];
  /** Of an atlas. */
  readonly whose: DataTexture | undefined;
  private readonly holds = uniform(0);
  private readonly width: number;
  private readonly height: number;

  constructor(readonly options: NodeSumOptions) {
    const { layout, receivers, receiversOf, rows = 1, apart = false } = options,
      { quads } = layout;
    this.whose = namedAnew(receiversOf);
    [this.width, this.height] = receiversOf
      ? [receiversOf.image.width, rows * receiversOf.image.height]
      : [Math.min(sumColumns, rows * receivers), Math.ceil((rows * receivers) / sumColumns)];
    this.picture = this.draw(apart ? ['rest'] : ['rest', 'peaks'], quads, 'lambent sum');
    if (apart) this.peakPicture = this.draw(['peaks'], quads, 'lambent peaks');
    this.instances = new InstanceNodes(options.order, quads, options.pose);
    const turn = ({ object }: NodeFrame): Matrix3 => options.pose.turnOf(object!) ?? upright,
      back = new Matrix3();
    this.turn = uniform(new Matrix3()).onObjectUpdate(turn);
    this.turnBack = uniform(new Matrix3()).onObjectUpdate((frame: NodeFrame) => back.copy(turn(frame)).transpose());
  }

  get bytes(): number {
    const { receiversOf, rows = 1 } = this.options;
    return (receiversOf || rows > 1 ? 8 : 16) * this.width * this.height;
  }

  /** A picture of transfer times each of these lights; of two, each is held at 0 or above where `holds` says. */
  private draw(parts: (keyof Light)[], quads: number, name: string): Picture {
    const { options, whose, holds } = this,
      { layout, transfer, channels, receiversOf, rows = 1 } = options,
      values = parts.map(() => vectors(quads)),
      lights = values.map((of): Vectors => uniformArray<'vec4'>(of, 'vec4'));
    const exit = Fn(() => {
      const [r, row] = pick(options, whose);
      const x = r.bitAnd(layout.columns - 1).mul(layout.texels),
        line = r.div(layout.columns);
      const at = ivec2(x.add(row.mul(channels * quads)), line.bitAnd(layout.rows - 1)).toVar(),
        slice = line.div(layout.rows).toVar(),
        sums = lights.map(() => vec3(0).toVar());
      loop(int(quads), 'i', (i) => {
        const read = (c: number): Node<'vec4'> =>
          textureLoad(texture(transfer), at.add(ivec2(i.add(c * quads), 0))).depth(slice);
        const red = read(0).toVar(),
          green = channels === 3 ? read(1).toVar() : red,
          blue = channels === 3 ? read(2).toVar() : red;
        lights.forEach((of, k) =>
          sums[k]!.addAssign(
            vec3(red.dot(of.element(i)), green.dot(of.element(i.add(quads))), blue.dot(of.element(i.add(2 * quads)))),
          ),
        );
      });
      const [rest, peak] = sums as unknown as [Node<'vec3'>, Node<'vec3'>?],
        sum = peak ? select(holds.greaterThan(0.5), rest.max(0).add(peak.max(0)), rest.add(peak)) : rest;
      return vec4(select(r.lessThan(0), vec3(0), sum), 1);
    });
    const filter = receiversOf ? LinearFilter : NearestFilter,
      [width, height] = name === 'lambent peaks' ? [1, 1] : [this.width, this.height];
    const made = rtt(exit(), width, height, {
      // Half floats where pixels look between texels, which not every device does with single ones.
      type: receiversOf || rows > 1 ? HalfFloatType : FloatType,
      minFilter: filter,
      magFilter: filter,
      depthBuffer: false,
      generateMipmaps: false,
      autoUpdate: false,
    });
    made.name = name;
    const main = made.renderTarget!,
      draw = made.updateBefore.bind(made);
    this.mains.push(main);
    // For every mesh: one that was turned looks at a picture of its own.
    made.updateBeforeType = 'object';
    made.updateBefore = (frame: NodeFrame): undefined => {
      if (isInstanced(frame.object!)) return;
      const turned = this.turnedOf(frame.object!),
        light = turned?.light ?? this.light;
      made.renderTarget = main;
      if (parts.every((part) => light[part] === undefined)) return;
      if (turned) {
        made.renderTarget = turned.targets.get(made) ?? main.clone();
        turned.targets.set(made, made.renderTarget);
      }
      if (this.shown.get(made.renderTarget) === light) return;
      this.shown.set(made.renderTarget, light);
      parts.forEach((part, i) => pack(values[i]!, light[part] ?? []));
      made.textureNeedsUpdate = true;
      draw(frame);
    };
    return made;
  }

  private turnedOf(object: Object3D): Turned | undefined {
    const { light, options } = this,
      turn = options.pose.turnOf(object);
    if (!turn) return undefined;
    const { how, made } = this.turned.get(object, turn.elements);
    if (made.of === light && made.how === how) return made;
    made.light = lightIn(turn, light, options.order);
    made.how = how;
    made.of = light;
    return made;
  }

  set(...[light, peaks, holds, turned]: Parameters<NodeSum['set']>): void {
    this.light = { rest: light, peaks, turned };
    this.instances.set(light, peaks, turned);
    this.holds.value = peaks && holds ? 1 : 0;
    this.hasPeaks.value = peaks ? 1 : 0;
    if (peaks) for (const main of this.mains) main.setSize(this.width, this.height);
  }

  dispose(): void {
    for (const main of this.mains) main.dispose();
    for (const { targets } of this.turned.all) for (const target of targets.values()) target.dispose();
    this.turned.clear();
    this.instances.dispose();
    this.picture.dispose();
    this.peakPicture?.dispose();
    this.whose?.dispose();
  }
}

/** The receiver of a vertex: its number, 0 where it has none, and whether it has none. */
export function receiverAt(name: string): { r: Node<'int'>; none: Node<'bool'> } {
  const receiver = attribute<'uint'>(name, 'uint'),
    none = receiver.equal(uint(0xffffffff));
  return { r: int(select(none, uint(0), receiver)), none };
}
