// lambent-three/webgpu: what WebGPURenderer draws, on WebGPU and on its WebGL 2 backend.
//
//   loader.register((parser) => new LambentTransferPlugin(parser, nodes));
//
// T . light is drawn into a float picture, a texel a receiver, when the light changes, and only looked up until then.
import {
  DataTexture,
  FloatType,
  HalfFloatType,
  LinearFilter,
  NearestFilter,
  RedIntegerFormat,
  UnsignedIntType,
  Vector4,
  type Node,
} from 'three/webgpu';
import {
  attribute,
  Fn,
  frontFacing,
  int,
  ivec2,
  Loop,
  materialColor,
  rtt,
  screenCoordinate,
  select,
  texture,
  textureLoad,
  uint,
  uniform,
  uniformArray,
  varying,
  vec2,
  vec3,
  vec4,
} from 'three/tsl';
import { BlockNodes } from './block_nodes.js';
import type { NodeEdition, NodeSum, NodeSumOptions, NodeSurface } from './node_edition.js';

const columns = 2048; // receivers a row of the picture

class Sum implements NodeSum {
  readonly picture: ReturnType<typeof rtt>;
  /** By whether surfaces have two sides. */
  readonly made = new Map<boolean, Node<'vec4'>>();
  private readonly light: Vector4[];
  private readonly peaks: Vector4[];
  private readonly whose: DataTexture | undefined;
  private readonly holds = uniform(0);

  constructor({ layout, transfer, channels, receivers, receiversOf }: NodeSumOptions) {
    const { quads } = layout,
      vectors = (): Vector4[] => Array.from({ length: 3 * quads }, () => new Vector4(0, 0, 0, 0));
    this.light = vectors();
    this.peaks = vectors();
    const light = uniformArray<'vec4'>(this.light, 'vec4'),
      peaks = uniformArray<'vec4'>(this.peaks, 'vec4'),
      { holds } = this;
    // WebGPU has names of its own for what WebGL's texture is.
    const whose =
      receiversOf && new DataTexture(receiversOf.image.data, receiversOf.image.width, receiversOf.image.height);
    if (whose) {
      whose.format = RedIntegerFormat;
      whose.type = UnsignedIntType;
      whose.needsUpdate = true;
    }
    this.whose = whose;
    const exit = Fn(() => {
      const texel = ivec2(screenCoordinate).toVar();
      // What is drawn beyond the last receiver is not looked up.
      const receiver = whose ? int(textureLoad(texture(whose), texel).r) : texel.y.mul(columns).add(texel.x);
      const r = receiver.toVar(); // -1: none
      const x = r.bitAnd(layout.columns - 1).mul(layout.texels),
        row = r.div(layout.columns),
        y = row.bitAnd(layout.rows - 1),
        layer = row.div(layout.rows);
      const at = ivec2(x, y).toVar(),
        slice = layer.toVar(),
        rest = vec3(0).toVar(),
        peak = vec3(0).toVar();
      Loop({ start: 0, end: quads, type: 'int', condition: '<' }, ({ i }: { i: Node<'int'> }) => {
        const read = (c: number): Node<'vec4'> =>
          textureLoad(texture(transfer), at.add(ivec2(i.add(c * quads), 0))).depth(slice);
        const red = read(0).toVar(),
          green = channels === 3 ? read(1).toVar() : red,
          blue = channels === 3 ? read(2).toVar() : red;
        const meet = (of: typeof light): Node<'vec3'> =>
          vec3(red.dot(of.element(i)), green.dot(of.element(i.add(quads))), blue.dot(of.element(i.add(2 * quads))));
        rest.addAssign(meet(light));
        peak.addAssign(meet(peaks));
      });
      const sum = select(holds.greaterThan(0.5), rest.max(0).add(peak.max(0)), rest.add(peak));
      return vec4(select(r.lessThan(0), vec3(0), sum), 1);
    });
    const [width, height] = receiversOf
      ? [receiversOf.image.width, receiversOf.image.height]
      : [Math.min(columns, receivers), Math.ceil(receivers / columns)];
    const filter = receiversOf ? LinearFilter : NearestFilter;
    this.picture = rtt(exit(), width, height, {
      // Half floats where pixels look between texels, which not every device does with single ones.
      type: receiversOf ? HalfFloatType : FloatType,
      minFilter: filter,
      magFilter: filter,
      depthBuffer: false,
      generateMipmaps: false,
      autoUpdate: false,
    });
    // For every picture that is asked for, not only once between two of the screen's.
    this.picture.updateBeforeType = 'render';
    this.picture.name = 'lambent sum';
    this.bytes = (receiversOf ? 8 : 16) * width * height;
  }
  readonly bytes: number;

  set(light: ArrayLike<number>, peaks: ArrayLike<number> | undefined, holds: boolean): void {
    pack(this.light, light);
    pack(this.peaks, peaks ?? []);
    this.holds.value = peaks && holds ? 1 : 0;
    this.picture.textureNeedsUpdate = true;
  }

  dispose(): void {
    this.picture.dispose();
    this.whose?.dispose();
  }
}

/** [column][3] to red, green and blue in whole vectors; zero where there are no more. */
function pack(out: Vector4[], light: ArrayLike<number>): void {
  const quads = out.length / 3;
  for (let c = 0; c < 3; ++c)
    for (let k = 0; k < 4 * quads; ++k) out[c * quads + (k >> 2)]!.setComponent(k & 3, light[3 * k + c] ?? 0);
}

/** With the alpha of a texture, where there is one. */
function lit(radiance: Node<'vec3'>, emitted?: Node<'vec3'>): Node<'vec4'> {
  const color = vec4(materialColor as unknown as Node<'vec4'>),
    light = color.rgb.mul(radiance.max(0));
  return vec4(emitted ? light.add(emitted) : light, color.a);
}

export const nodes: NodeEdition = {
  sum: (options) => new Sum(options),
  blocks: (options) => new BlockNodes(options),

  atVertices(sum: NodeSum, twoSided: boolean): Node<'vec4'> {
    const { picture, made } = sum as Sum,
      known = made.get(twoSided);
    if (known) return known;
    const of = (name: string): Node<'vec3'> => {
      const receiver = attribute<'uint'>(name, 'uint'),
        none = receiver.equal(uint(0xffffffff)),
        r = int(select(none, uint(0), receiver)),
        texel = ivec2(r.mod(columns), r.div(columns));
      const value = textureLoad(picture, texel) as unknown as Node<'vec4'>;
      return varying(select(none, vec3(0), value.rgb));
    };
    const front = of('lambentReceiver');
    const node = lit(twoSided ? select(frontFacing, front, of('lambentReceiverBack')) : front);
    made.set(twoSided, node);
    return node;
  },

  overAtlas(sum: NodeSum, { twoSided, emission, emissive }: NodeSurface): Node<'vec4'> {
    const { picture } = sum as Sum;
    const { width, height } = picture.renderTarget!;
    const of = (name: string): Node<'vec3'> => {
      const own = attribute<'vec2'>(name, 'vec2'),
        place = varying(own);
      return (picture.sample(place.div(vec2(width, height))) as unknown as Node<'vec4'>).rgb;
    };
    const front = of('lambentPlace'),
      radiance = twoSided ? select(frontFacing, front, of('lambentPlaceBack')) : front;
    let emitted = uniform(emission.value) as unknown as Node<'vec3'>;
    if (emissive) {
      const own = attribute<'vec2'>('lambentEmissivePlace', 'vec2'),
        place = vec3(own, 1);
      const at = (uniform(emissive.texture.matrix) as unknown as Node<'mat3'>).mul(place);
      emitted = emitted.mul((texture(emissive.texture, at.xy) as unknown as Node<'vec4'>).rgb);
    }
    return lit(radiance, emitted);
  },
};
