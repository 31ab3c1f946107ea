// What block_shader.ts has in GLSL, in nodes for WebGPURenderer: visibility in blocks times light (times a lobe), a
// texel a receiver.
import {
  FloatType,
  NearestFilter,
  Vector3,
  Vector4,
  type Node,
  type NodeFrame,
  type RenderTarget,
  type Texture,
  type TextureNode,
} from 'three/webgpu';
import {
  attribute,
  bool,
  dot,
  float,
  Fn,
  frontFacing,
  If,
  int,
  ivec2,
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
import { cardinalFunctions } from './block_light.js';
import { directionOf, fineDirection, lobeValue, nodeDirection } from './block_lobe_nodes.js';
import { blockTolerance } from './block_reflection.js';
import { fineBetween, fineShare, pictureColumns, receiverColumns, wordColumns } from './block_shader.js';
import { cubeBlocks } from './cube.js';
import type { BlockStanding, NodeBlocks, NodeBlockOptions } from './node_edition.js';
import { loop } from './node_loop.js';

type Int = Node<'int'>;
type Uint = Node<'uint'>;
type Vec3 = Node<'vec3'>;
type Texels = TextureNode<'vec4'>;

interface Changes {
  count: Uint;
  where: Uint;
}

/** Records, receivers and the light, as nodes. */
class Reader {
  private readonly sight: Texels;
  private readonly places: Texels;
  readonly sums: Texels;
  readonly coarse: Texels;
  readonly fine: Texels;
  readonly texels: Texels;

  constructor(readonly options: NodeBlockOptions) {
    const { sight, places } = options,
      { light } = options.standing(),
      node = (of: Texture): Texels => texture(of);
    this.sight = node(sight);
    this.places = node(places);
    this.sums = node(light.sums.value);
    this.coarse = node(light.coarse.value);
    this.fine = node(light.fine.value);
    this.texels = node(light.texels.value);
  }

  /** The light's textures are others for what stands elsewhere, and where surfaces have begun to shine. */
  follow({ light: { sums, coarse, fine, texels } }: BlockStanding): void {
    this.sums.value = sums.value;
    this.coarse.value = coarse.value;
    this.fine.value = fine.value;
    this.texels.value = texels.value;
  }

  byte(at: Uint): Uint {
    const place = ivec2(
      int(at.shiftRight(uint(2)).bitAnd(uint(wordColumns - 1))),
      int(at.shiftRight(uint(13)).bitAnd(uint(2047))),
    );
    const word = uint(textureLoad(this.sight, place).depth(int(at.shiftRight(uint(24)))).r);
    return word.shiftRight(at.bitAnd(uint(3)).mul(uint(8))).bitAnd(uint(255));
  }
  texel(of: Texels, x: Int, y: Int): Vec3 {
    return (textureLoad(of, ivec2(x, y)) as unknown as Node<'vec4'>).xyz;
  }
  /** Irradiance of what three texels hold. */
  meet(of: Texels, x: Int, b: Int, n: Vec3): Vec3 {
    const channel = (c: number): Node<'float'> => dot(this.texel(of, x.add(int(c)), b), n);
    return vec3(channel(0), channel(1), channel(2));
  }
  receiver(): { p: Vec3; n: Vec3; begin: Uint } {
    const at = ivec2(screenCoordinate).toVar(),
      number = at.y.mul(int(pictureColumns)).add(at.x).toVar(),
      last = int(this.options.receivers - 1),
      r = select(number.lessThan(last), number, last).toVar(),
      place = ivec2(r.mod(int(receiverColumns)).mul(int(2)), r.div(int(receiverColumns))).toVar();
    const load = (x: number): Node<'vec4'> => textureLoad(this.places, place.add(ivec2(x, 0))).toVar();
    const p = load(0),
      n = load(1);
    return {
      p: p.xyz,
      n: n.xyz,
      begin: uint(p.w)
        .bitOr(uint(n.w).shiftLeft(uint(24)))
        .toVar(),
    };
  }
  level(c: Changes, i: Int): Node<'float'> {
    return this.options.bits === 1
      ? float(int(1).sub(i.bitAnd(int(1))))
      : float(this.byte(c.where.add(c.count).add(uint(i))));
  }
  get scale(): number {
    return 1 / (2 ** this.options.bits - 1);
  }
  /** For each block that is seen. */
  blocks(begin: Uint, body: (b: Int, clear: Node<'bool'>, c: Changes) => void): void {
    const { cube, bits } = this.options,
      blocks = cubeBlocks(cube),
      at = begin.add(uint(Math.ceil(blocks / 4))).toVar(),
      flags = uint(0).toVar();
    loop(int(blocks), 'b', (b) => {
      If(b.bitAnd(int(3)).equal(int(0)), () => {
        flags.assign(this.byte(begin.add(uint(b.shiftRight(int(2))))));
      }).Else(() => {
        flags.assign(flags.shiftRight(uint(2)));
      });
      const sight = flags.bitAnd(uint(3)).toVar();
      If(sight.notEqual(uint(0)), () => {
        const count = uint(0).toVar(),
          where = uint(0).toVar();
        If(sight.equal(uint(2)), () => {
          count.assign(this.byte(at));
          at.addAssign(uint(1));
          If(count.greaterThan(uint(127)), () => {
            count.assign(count.bitAnd(uint(127)).bitOr(this.byte(at).shiftLeft(uint(7))));
            at.addAssign(uint(1));
          });
          where.assign(at);
          at.addAssign(count.mul(uint(bits === 1 ? 1 : 2)));
        });
        body(b, sight.equal(uint(1)), { count, where });
      });
    });
  }
  /** Line 9: light summed over what is seen of a block. */
  addSeen(
    sum: ReturnType<Vec3['toVar']>,
    factor: Node<'float'>,
    b: Int,
    clear: Node<'bool'>,
    c: Changes,
    n: Vec3,
  ): void {
    If(clear, () => {
      sum.addAssign(this.meet(this.sums, int(0), b, n).mul(factor));
    }).Else(() => {
      const before = float(0).toVar();
      loop(int(c.count), 'i', (i) => {
        const after = this.level(c, i).toVar(),
          t = int(this.byte(c.where.add(uint(i))));
        sum.addAssign(
          this.meet(this.sums, t.mul(int(3)), b, n).mul(after.sub(before).mul(float(this.scale)).mul(factor)),
        );
        before.assign(after);
      });
    });
  }
}

/** Exit radiance of white by Lambert's law. */
const evenNode = (from: Reader): (() => Node<'vec4'>) =>
  Fn(() => {
    const { n, begin } = from.receiver(),
      sum = vec3(0).toVar();
    from.blocks(begin, (b, clear, c) => from.addSeen(sum, float(1), b, clear, c, n));
    return vec4(sum.mul(1 / Math.PI), 1);
  });

/** What the lobe is; of `model` 1 Phong's, of 2 GGX. */
interface Lobe {
  colour: { value: number };
  width: { value: number };
  samples: { value: Vector4 };
}

/** Exit radiance towards the eye by the lobe alone. */
function shineNode(from: Reader, eye: Node<'vec3'>, model: Int, lobe: Record<keyof Lobe, Node>): () => Node<'vec4'> {
  const colour = lobe.colour as unknown as Node<'float'>,
    width = lobe.width as unknown as Node<'float'>,
    samplesAt = lobe.samples as unknown as Node<'vec4'>,
    { cube } = from.options,
    cardinal = cardinalFunctions(4),
    atMiddle = [0, 1, 2, 3].map((i) => (cardinal[16 * i + 7]! + cardinal[16 * i + 8]!) / 2),
    between = uniformArray<'vec4'>(
      fineBetween.map((of) => new Vector4().fromArray([...of])),
      'vec4',
    );
  return Fn(() => {
    const { p, n, begin } = from.receiver(),
      wo = eye.sub(p).normalize().toVar(),
      cosO = dot(n, wo).toVar(),
      mirror = n.mul(cosO.mul(2)).sub(wo).toVar(),
      sum = vec3(0).toVar();
    const valueOf = (wi: Vec3): Node<'float'> => lobeValue({ model, colour, width, n, wo, cosO, mirror }, wi);
    const node = (b: Int, i: Int): Vec3 => nodeDirection(cube, b, i),
      fineNode = (b: Int, i: Int): Vec3 => fineDirection(cube, b, i);
    // Light times lobe over texels first .. first + count - 1 of a block.
    const addRun = (b: Int, first: Int, count: Int, share: Node<'float'>): void =>
      loop(count, 't', (t) => {
        const x = first.add(t).mul(int(2)).toVar(),
          e = from.texel(from.texels, x.add(int(1)), b).toVar();
        If(e.x.add(e.y).add(e.z).greaterThan(0), () => {
          const d = from.texel(from.texels, x, b).toVar();
          sum.addAssign(e.mul(valueOf(d).mul(dot(n, d)).mul(share)));
        });
      });
    If(cosO.greaterThan(1e-6), () => {
      from.blocks(begin, (b, clear, c) => {
        const towards = directionOf(cube, b, vec2(8, 8)).toVar(),
          along = dot(mirror, towards).toVar(),
          samples = int(0).toVar(),
          middle = float(0).toVar();
        If(along.greaterThan(samplesAt.w), () => void samples.assign(int(4)))
          .ElseIf(along.greaterThan(samplesAt.z), () => void samples.assign(int(3)))
          .ElseIf(along.greaterThan(samplesAt.y), () => void samples.assign(int(2)))
          .ElseIf(along.greaterThan(samplesAt.x), () => void samples.assign(int(1)));
        If(samples.greaterThan(int(0)).and(samples.lessThan(int(4))), () => void middle.assign(valueOf(towards)));
        If(samples.greaterThan(int(1)).and(clear.not()), () => void samples.assign(int(4)));
        // How far values at 64 nodes are from those at the 16, by rows: less these first.
        const off = [0, 1, 2, 3].map(() => vec4(0).toVar()),
          isAsked = bool(
            model
              .equal(int(2))
              .and(samples.greaterThan(int(0)))
              .and(samples.lessThan(int(4))),
          );
        If(isAsked, () => {
          const least = middle.toVar(),
            most = middle.toVar(),
            back = float(0).toVar();
          // Of each node, how much of a block's middle it makes.
          const [outer, inner] = [float(atMiddle[0]), float(atMiddle[1])];
          const weight = (k: Int): Node<'float'> => select(k.equal(int(1)).or(k.equal(int(2))), inner, outer);
          loop(int(16), 'j', (j) => {
            const value = valueOf(node(b, j)).toVar();
            least.assign(least.min(value));
            most.assign(most.max(value));
            back.addAssign(value.mul(weight(j.bitAnd(int(3)))).mul(weight(j.shiftRight(int(2)))));
            const column = j.bitAnd(int(3)),
              at = (k: number): Node<'float'> => select(column.equal(int(k)), value, float(0)),
              row = vec4(at(0), at(1), at(2), at(3)).toVar();
            off.forEach((of, k) => of.subAssign(select(j.shiftRight(int(2)).equal(int(k)), row, vec4(0))));
          });
          If(most.sub(least).mul(Math.PI).greaterThanEqual(blockTolerance), () => {
            const near = back
              .sub(middle)
              .abs()
              .mul(Math.PI)
              .lessThan(0.25 * blockTolerance);
            If(samples.lessThan(int(3)), () => {
              samples.assign(select(near.and(most.lessThan(least.mul(2))), int(2), int(3)));
            });
          }).ElseIf(clear.not().and(dot(n, towards).lessThanEqual(0)), () => void samples.assign(int(4)));
        });
        If(samples.equal(int(3)).and(clear), () => {
          // A texel that has much of the light is told by all samples alone.
          const first = textureLoad(from.fine, ivec2(int(0), b)) as unknown as Node<'vec4'>;
          If(first.w.greaterThan(0.5), () => void samples.assign(int(4))).ElseIf(model.equal(int(2)), () => {
            loop(int(64), 'j', (j) => {
              const value = valueOf(fineNode(b, j)).toVar(),
                across = between
                  .element(j.bitAnd(int(7)))
                  .mul(value)
                  .toVar(),
                down = between.element(j.shiftRight(int(3))).toVar();
              [down.x, down.y, down.z, down.w].forEach((by, k) => off[k]!.addAssign(across.mul(by)));
            });
            const most = off.reduce((all: Node<'vec4'>, of) => all.max(of.abs()), vec4(0)).toVar();
            If(
              most.x
                .max(most.y)
                .max(most.z)
                .max(most.w)
                .mul(Math.PI)
                .greaterThanEqual(fineShare * blockTolerance),
              () => void samples.assign(int(4)),
            );
          });
        });
        If(samples.equal(int(1)), () => from.addSeen(sum, middle, b, clear, c, n))
          .ElseIf(samples.greaterThan(int(1)).and(clear.not()), () =>
            loop(int(c.count), 'i', (i) => {
              const level = from.level(c, i).toVar();
              If(level.greaterThan(0), () => {
                const first = int(from.byte(c.where.add(uint(i)))).toVar(),
                  end = int(256).toVar();
                If(i.add(int(1)).lessThan(int(c.count)), () => {
                  end.assign(int(from.byte(c.where.add(uint(i)).add(uint(1)))));
                });
                addRun(b, first, end.sub(first), level.mul(from.scale));
              });
            }),
          )
          .ElseIf(samples.equal(int(4)), () => addRun(b, int(0), int(256), float(1)))
          .ElseIf(samples.equal(int(3)), () =>
            loop(int(64), 'j', (j) => {
              sum.addAssign(from.meet(from.fine, j.mul(int(3)), b, n).mul(valueOf(fineNode(b, j))));
            }),
          )
          .ElseIf(samples.equal(int(2)), () =>
            loop(int(16), 'j', (j) => {
              sum.addAssign(from.meet(from.coarse, j.mul(int(3)), b, n).mul(valueOf(node(b, j))));
            }),
          );
      });
    });
    return vec4(sum, 1);
  });
}

type Picture = ReturnType<typeof rtt>;
function picture(of: Node<'vec4'>, receivers: number, name: string): Picture {
  const made = rtt(of, Math.min(pictureColumns, receivers), Math.ceil(receivers / pictureColumns), {
    type: FloatType,
    minFilter: NearestFilter,
    magFilter: NearestFilter,
    depthBuffer: false,
    generateMipmaps: false,
    autoUpdate: false,
  });
  made.updateBeforeType = 'object'; // what stands elsewhere has pictures of its own
  made.name = name;
  return made;
}

/** Pictures for what stands alike, and what they show. */
interface Drawn {
  even: RenderTarget;
  shine: RenderTarget;
  evenOf: number;
  shineOf: string;
}

/** Pictures of receivers, and what meshes look up in them. */
export class BlockNodes implements NodeBlocks {
  private readonly reader: Reader;
  private readonly even: Picture;
  private readonly shine: Picture;
  private readonly made = new Map<boolean, Node<'vec4'>>();
  private readonly eye = new Vector3();
  private readonly drawn = new Map<BlockStanding, Drawn>();
  private lobes = 0;
  private readonly share = uniform(1);
  private readonly model = uniform(0, 'int');
  private readonly shines = uniform(0);
  private readonly lobe = { colour: uniform(0), width: uniform(1), samples: uniform(new Vector4()) };

  constructor(options: NodeBlockOptions) {
    const reader = (this.reader = new Reader(options)),
      { receivers } = options;
    this.even = picture(evenNode(reader)(), receivers, 'lambent even');
    const eye = uniform(this.eye) as unknown as Vec3;
    this.shine = picture(shineNode(reader, eye, this.model, this.lobe)(), receivers, 'lambent shine');
    this.drawn.set(options.standing(), {
      even: this.even.renderTarget!,
      shine: this.shine.renderTarget!,
      evenOf: -1,
      shineOf: '',
    });
    const begin = (made: Picture, draw: (frame: NodeFrame, stands: BlockStanding, drawn: Drawn) => boolean): void => {
      const drawNow = made.updateBefore.bind(made);
      made.updateBefore = (frame: NodeFrame): undefined => {
        const stands = options.standing(frame.object!),
          drawn = this.drawnOf(stands);
        if (!draw(frame, stands, drawn)) return;
        reader.follow(stands);
        made.textureNeedsUpdate = true;
        drawNow(frame);
      };
    };
    begin(this.even, (_, { version }, drawn) => {
      this.even.renderTarget = drawn.even;
      const is = drawn.evenOf !== version;
      drawn.evenOf = version;
      return is;
    });
    // Before a frame that looks it up, from where that frame is seen; of surfaces that do not shine never.
    begin(this.shine, (frame, { version, place }, drawn) => {
      this.shine.renderTarget = drawn.shine;
      if (this.shines.value === 0) return false;
      this.eye.setFromMatrixPosition(frame.camera!.matrixWorld).applyMatrix4(place);
      const of = `${version} ${this.lobes} ${this.eye.toArray().join(' ')}`,
        is = drawn.shineOf !== of;
      drawn.shineOf = of;
      return is;
    });
  }

  private drawnOf(stands: BlockStanding): Drawn {
    let drawn = this.drawn.get(stands);
    if (!drawn) {
      const { even, shine } = this.drawn.get(this.reader.options.standing())!;
      this.drawn.set(stands, (drawn = { even: even.clone(), shine: shine.clone(), evenOf: -1, shineOf: '' }));
    }
    return drawn;
  }

  get bytes(): number {
    const { width, height } = this.drawn.get(this.reader.options.standing())!.even;
    return 32 * width * height;
  }

  setLobe(model: number, share: number, lobe: Lobe): void {
    this.model.value = model;
    this.share.value = share;
    this.shines.value = model === 0 ? 0 : 1;
    this.lobe.colour.value = lobe.colour.value;
    this.lobe.width.value = lobe.width.value;
    this.lobe.samples.value.copy(lobe.samples.value);
    ++this.lobes;
  }

  atVertices(twoSided: boolean): Node<'vec4'> {
    const known = this.made.get(twoSided);
    if (known) return known;
    const of = (from: Picture, name: string): Vec3 => {
      const receiver = attribute<'uint'>(name, 'uint'),
        none = receiver.equal(uint(0xffffffff)),
        r = int(select(none, uint(0), receiver)),
        value = textureLoad(from, ivec2(r.mod(pictureColumns), r.div(pictureColumns))) as unknown as Node<'vec4'>;
      return varying(select(none, vec3(0), value.rgb));
    };
    const side = (from: Picture): Vec3 => {
      const front = of(from, 'lambentReceiver');
      return twoSided ? select(frontFacing, front, of(from, 'lambentReceiverBack')) : front;
    };
    const color = vec4(materialColor as unknown as Node<'vec4'>),
      light = color.rgb.mul(side(this.even)).mul(this.share).add(side(this.shine).mul(this.shines));
    const node = vec4(light.max(0), color.a);
    this.made.set(twoSided, node);
    return node;
  }

  dispose(): void {
    for (const { even, shine } of this.drawn.values()) for (const target of [even, shine]) target.dispose();
    this.even.dispose();
    this.shine.dispose();
  }
}
