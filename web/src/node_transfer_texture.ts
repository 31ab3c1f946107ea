// What transfer_texture.ts has in GLSL, in nodes for WebGPURenderer: zonal lobes of a texture, pixel by pixel.
import { HalfFloatType, LinearFilter, RepeatWrapping, Vector2, Vector4, type Node } from 'three/webgpu';
import {
  attribute,
  cross,
  dFdx,
  dFdy,
  dot,
  float,
  Fn,
  frontFacing,
  If,
  int,
  ivec2,
  length,
  mat3,
  mix,
  modelNormalMatrix,
  normalLocal,
  normalize,
  positionWorld,
  rtt,
  screenCoordinate,
  select,
  texture,
  textureLoad,
  uniform,
  uniformArray,
  varying,
  vec2,
  vec3,
  vec4,
} from 'three/tsl';
import { lit } from './node_lit.js';
import type { MaterialNodes, NodeRelief, NodeReliefOptions } from './node_edition.js';
import { nodeHarmonics } from './node_harmonics.js';
import { loop } from './node_loop.js';
import { pack, type Picture } from './node_sum.js';
import { shBand, shCount } from './sh.js';
import { exactZonalBands } from './zonal.js';

type Int = Node<'int'>;
type Float = Node<'float'>;
type Vec2 = Node<'vec2'>;
type Vec3 = Node<'vec3'>;
type Vec4 = Node<'vec4'>;
type Mat3 = Node<'mat3'>;
type Vectors = ReturnType<typeof uniformArray<'vec4'>>;

const component = (of: Vec4, k: number): Float => [of.x, of.y, of.z, of.w][k & 3]!;

/** Coefficient k of the light. */
const lightAt = (light: Vectors, quads: number, k: number): Vec3 =>
  vec3(...([0, 1, 2].map((c) => component(light.element(int(c * quads + (k >> 2))), k)) as [Float, Float, Float]));

/** Of eq. 24: the light's band l at each direction, azimuth by polar angle, bands below each other. */
function table({ transfer, width, height }: NodeReliefOptions, light: Vectors): Picture {
  const { order, lobes } = transfer,
    exact = exactZonalBands(order, lobes),
    quads = Math.ceil(shCount(order) / 4);
  const bands = Fn(() => {
    const at = ivec2(screenCoordinate).toVar(),
      l = at.y.div(int(height)).add(int(exact)).toVar(),
      phi = float(at.x)
        .mul((2 * Math.PI) / width)
        .toVar(),
      theta = float(at.y.mod(int(height)))
        .mul(Math.PI / (height - 1))
        .toVar(),
      n = vec3(theta.sin().mul(phi.cos()), theta.sin().mul(phi.sin()), theta.cos()).toVar(),
      sum = vec3(0).toVar();
    nodeHarmonics(order, n, (index, y) => {
      const band = shBand(index);
      if (band >= exact) sum.addAssign(select(l.equal(int(band)), lightAt(light, quads, index).mul(y), vec3(0)));
    });
    return vec4(sum, 1);
  });
  const made = rtt(bands(), width, height * Math.max(1, order - exact), {
    type: HalfFloatType,
    minFilter: LinearFilter,
    magFilter: LinearFilter,
    wrapS: RepeatWrapping,
    depthBuffer: false,
    generateMipmaps: false,
    autoUpdate: false,
  });
  made.name = 'lambent table';
  return made;
}

/** Where the pixel is, as it changes over the picture, and its normal to the side that is seen. */
function surfaceHere(): { px: Vec3; py: Vec3; n: Vec3 } {
  const position = positionWorld as unknown as Vec3,
    own = varying((modelNormalMatrix as unknown as Mat3).mul(normalLocal as unknown as Vec3)) as unknown as Vec3;
  return {
    px: dFdx(position).toVar(),
    py: dFdy(position).toVar(),
    n: own
      .normalize()
      .mul(select(frontFacing, float(1), float(-1)))
      .toVar(),
  };
}

/** The first two axes of the normal's frame where texture coordinates do not tell: frame_about() of the C++ library. */
function axesAbout(n: Vec3): [Vec3, Vec3] {
  const side = select(n.z.lessThan(0), float(-1), float(1)).toVar(),
    a = float(-1).div(side.add(n.z)).toVar(),
    b = n.x.mul(n.y).mul(a).toVar();
  return [
    vec3(side.mul(n.x).mul(n.x).mul(a).add(1), side.mul(b), side.negate().mul(n.x)).toVar(),
    vec3(b, side.add(n.y.mul(n.y).mul(a)), n.y.negate()).toVar(),
  ];
}

/** The frame of the texture's directions: along +u, along -v, outward; left-handed where the texture is mirrored. */
function frameAt(place: Vec2): Mat3 {
  const { px, py, n } = surfaceHere(),
    ux = dFdx(place).toVar(),
    uy = dFdy(place).toVar(),
    area = ux.x.mul(uy.y).sub(ux.y.mul(uy.x)).toVar(),
    hand = select(area.lessThan(0), float(-1), float(1)).toVar(),
    found = px.mul(uy.y).sub(py.mul(ux.y)).mul(hand).toVar(),
    down = py.mul(ux.x).sub(px.mul(uy.x)).mul(hand).toVar(),
    along = found.sub(n.mul(dot(n, found))).toVar(),
    [x, y] = axesAbout(n);
  If(area.notEqual(0).and(dot(along, along).greaterThan(0)), () => {
    x.assign(normalize(along));
    const up = cross(n, x).toVar();
    y.assign(select(dot(up, down).greaterThan(0), up.negate(), up));
  });
  return mat3(x, y, n);
}

/** Of grooves: across them, in the plane of the normal, the way their place grows; right-handed. */
function grooveFrameAt(phase: Float): Mat3 {
  const { px, py, n } = surfaceHere(),
    area = cross(px, py).toVar(),
    found = cross(py, area)
      .mul(dFdx(phase))
      .add(cross(area, px).mul(dFdy(phase)))
      .toVar(),
    across = found.sub(n.mul(dot(n, found))).toVar(),
    size = length(across).toVar(),
    [x, y] = axesAbout(n);
  If(size.greaterThan(0), () => {
    x.assign(across.div(size));
    y.assign(cross(n, x));
  });
  return mat3(x, y, n);
}

/** Quads of a texel, whose place may lie beyond the texture by its size. */
const texelOf =
  ({ layout, width, height, texture: values }: NodeReliefOptions['transfer']) =>
  (at: Node<'ivec2'>): ((k: Int) => Vec4) => {
    const wrapped = (x: Int, size: number): Int => x.add(int(size)).mod(int(size)),
      r = wrapped(at.y, height).mul(int(width)).add(wrapped(at.x, width)).toVar(),
      line = r.div(int(layout.columns)).toVar(),
      first = ivec2(
        r.bitAnd(int(layout.columns - 1)).mul(int(layout.texels)),
        line.bitAnd(int(layout.rows - 1)),
      ).toVar(),
      slice = line.div(int(layout.rows)).toVar();
    return (k) => textureLoad(texture(values), first.add(ivec2(k, int(0)))).depth(slice);
  };

/** Of a pixel, in a texture or a table of grooves. */
interface Place {
  frame: Mat3;
  corner: Vec2;
  f: Vec2;
  lobesAt?: Vec2;
}

export class ReliefNodes implements NodeRelief {
  readonly nodes: MaterialNodes;
  private readonly light: Vector4[];
  private readonly table: Picture;

  constructor(private readonly options: NodeReliefOptions) {
    const quads = Math.ceil(shCount(options.transfer.order) / 4);
    this.light = Array.from({ length: 3 * quads }, () => new Vector4(0, 0, 0, 0));
    const light = uniformArray<'vec4'>(this.light, 'vec4');
    this.table = table(options, light);
    this.nodes = { colorNode: lit(this.radiance(light, quads)) };
  }

  /** The texel below and left of a place, how far it lies from there, and the one whose lobes count. */
  private inTexture(uv: Vec2): Place {
    const { transfer, tile } = this.options,
      frame = frameAt(uv).toVar() as unknown as Mat3,
      place = uv.mul(uniform(tile)).fract().mul(vec2(transfer.width, transfer.height)).toVar(),
      corner = place.sub(0.5).floor().toVar();
    return { frame, corner, f: place.sub(0.5).sub(corner).toVar(), lobesAt: place };
  }
  private inGroove(uv: Vec2): Place {
    const { transfer, tile, groove } = this.options,
      { width, height, grooveDepth } = transfer,
      value = new Vector2(1, 1),
      now = uniform(value).onRenderUpdate(() => value.set(groove.width, groove.depth / grooveDepth)) as unknown as Vec2,
      phase = dot(uv, uniform(tile)).toVar() as unknown as Float,
      frame = grooveFrameAt(phase).toVar() as unknown as Mat3,
      x = phase.fract().sub(0.5).div(now.x).toVar(),
      // Between grooves it is the plane.
      isIn = x.abs().lessThan(0.5),
      at = vec2(select(isIn, x.add(0.5), float(1)), select(isIn, now.y, float(0))),
      place = at
        .clamp(0, 1)
        .mul(vec2(width - 1, height - 1))
        .toVar(),
      corner = place
        .floor()
        .min(vec2(width - 2, height - 2))
        .toVar();
    return { frame, corner, f: place.sub(corner).toVar() };
  }

  private radiance(light: Vectors, quads: number): Vec3 {
    const { transfer, width: across, height: down } = this.options,
      { order, lobes, channels, grooveDepth } = transfer,
      grooves = grooveDepth > 0,
      exact = exactZonalBands(order, lobes),
      upper = order - exact,
      exactCount = shCount(exact),
      stride = 3 + channels * upper;
    const bandAt = (n: Vec3, l: number): Vec3 => {
      const x = n.y.atan(n.x).mul(0.5 / Math.PI),
        y = n.z
          .clamp(-1, 1)
          .acos()
          .mul((down - 1) / Math.PI);
      const at = vec2(x.add(0.5 / across), y.add(down * l + 0.5).div(down * upper));
      return (this.table.sample(at).level(float(0)) as unknown as Vec4).rgb;
    };
    const made = Fn(() => {
      const uv = varying(attribute<'vec2'>('uv', 'vec2')).toVar() as unknown as Vec2,
        texel = texelOf(transfer),
        { frame, corner, f, lobesAt } = grooves ? this.inGroove(uv) : this.inTexture(uv),
        near = (x: number, y: number): ((k: Int) => Vec4) => texel(ivec2(corner).add(ivec2(x, y)).toVar()),
        corners = [near(0, 0), near(1, 0), near(0, 1), near(1, 1)] as const,
        mean = (k: Int): Vec4 => {
          const [a, b, c, d] = corners.map((of) => of(k)) as [Vec4, Vec4, Vec4, Vec4];
          return mix(mix(a, b, f.x), mix(c, d, f.x), f.y);
        },
        nearest = texel(ivec2(lobesAt ?? corner).toVar());
      // The exact bands bilinearly; lobes of the nearest texel, or where they correspond as well.
      const means = Array.from(
          { length: grooves ? transfer.layout.texels : Math.ceil((channels * exactCount) / 4) },
          (_, k) => mean(int(k)).toVar(),
        ),
        fixed = (k: number): Float => component(means[k >> 2]!, k),
        sum = vec3(fixed(0), fixed(channels === 3 ? exactCount : 0), fixed(channels === 3 ? 2 * exactCount : 0))
          .mul(lightAt(light, quads, 0))
          .toVar();
      if (exact > 1) {
        // The linear band is a vector in x, y, z for each channel: (-t_11, -t_1-1, t_10).
        const along = (of: (k: number) => Float): Vec3 => vec3(of(3).negate(), of(1).negate(), of(2)),
          linear = [0, 1, 2].map((c) =>
            dot(
              frame.mul(along((k) => fixed((channels === 3 ? 4 * c : 0) + k))),
              along((k) => component(light.element(int(c * quads)), k)),
            ),
          ) as [Float, Float, Float];
        sum.addAssign(vec3(...linear));
      }
      const addLobe = (value: (k: number) => Float): void => {
        const axis = vec3(value(0), value(1), value(2)).toVar(),
          size = length(axis).toVar(),
          n = frame
            .mul(select(size.greaterThan(0), axis.div(size.max(1e-30)), vec3(0, 0, 1)))
            .toVar() as unknown as Vec3;
        for (let l = 0; l < upper; ++l) {
          const g =
            channels === 3 ? vec3(value(3 + l), value(3 + upper + l), value(3 + 2 * upper + l)) : vec3(value(3 + l));
          sum.addAssign(g.mul(bandAt(n, l)));
        }
      };
      const first = channels * exactCount;
      if (grooves && upper > 0) for (let i = 0; i < lobes; ++i) addLobe((k) => fixed(first + i * stride + k));
      else if (upper > 0)
        loop(int(lobes), 'lobe', (lobe) => {
          const begin = lobe.mul(int(stride)).add(int(first)).toVar();
          addLobe((k) => {
            const i = begin.add(int(k)).toVar();
            return (nearest(i.shiftRight(int(2))) as unknown as { element(i: Int): Float }).element(i.bitAnd(int(3)));
          });
        });
      return sum;
    });
    return made();
  }

  /** [coefficient][3] */
  set(light: ArrayLike<number>): void {
    pack(this.light, light);
    this.table.textureNeedsUpdate = true;
  }

  dispose(): void {
    this.table.renderTarget?.dispose();
    this.table.dispose();
  }
}
