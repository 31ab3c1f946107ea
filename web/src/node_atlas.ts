// What lightmap_glsl.ts has in GLSL, in nodes for WebGPURenderer: places in the atlas, rows by the normal map's normal.
import type { Node } from 'three/webgpu';
import {
  attribute,
  cross,
  dFdx,
  dFdy,
  float,
  Fn,
  frontFacing,
  If,
  int,
  ivec2,
  length,
  mix,
  modelNormalMatrix,
  modelWorldMatrix,
  normalGeometry,
  normalize,
  normalLocal,
  positionWorld,
  select,
  sign,
  texture,
  textureLoad,
  transpose,
  uniform,
  varying,
  vec2,
  vec3,
  vec4,
} from 'three/tsl';
import { directionalRows, type Directional } from './header.js';
import type { NodeSurface } from './node_edition.js';
import { nodeHarmonics } from './node_harmonics.js';
import type { Picture, Sum } from './node_sum.js';

type Vec2 = Node<'vec2'>;
type Vec3 = Node<'vec3'>;
type Rows = (row: number) => Vec3;

/** E(n) / pi of the rows at a pixel, n the bent normal and N the surface's own, on the side that is seen. */
function evaluate(kind: Directional, row: Rows, N: Vec3, n: Vec3): Vec3 {
  if (kind === 'none') return row(0);
  if (kind === 'vector')
    return n.x
      .mul(row(0))
      .add(n.y.mul(row(1)))
      .add(n.z.mul(row(2)))
      .max(0);
  if (kind !== 'hl2') {
    const sum = vec3(0).toVar();
    nodeHarmonics(Number(kind[3]), n, (i, y) => void sum.addAssign(row(i).mul(y)));
    return sum.max(0);
  }
  // Half-Life 2's directions in the frame about the surface's normal (frame_about of core/vec.h).
  const side = select(N.z.lessThan(0), float(-1), float(1)).toVar(),
    a = float(-1).div(side.add(N.z)).toVar(),
    b = N.x.mul(N.y).mul(a).toVar();
  const tangent = vec3(side.mul(N.x).mul(N.x).mul(a).add(1), side.mul(b), side.negate().mul(N.x)),
    bitangent = vec3(b, side.add(N.y.mul(N.y).mul(a)), N.y.negate()),
    along = vec3(n.dot(tangent), n.dot(bitangent), n.dot(N)).toVar();
  const third = 1 / Math.sqrt(3),
    axes: [number, number, number][] = [
      [-1 / Math.sqrt(6), -1 / Math.sqrt(2), third],
      [-1 / Math.sqrt(6), 1 / Math.sqrt(2), third],
      [Math.sqrt(2 / 3), 0, third],
    ];
  const weights = axes.map((axis) => {
      const cosine = along.dot(vec3(...axis)).max(0);
      return cosine.mul(cosine).toVar();
    }) as Node<'float'>[],
    total = weights.reduce((sum, w) => sum.add(w)).toVar();
  return weights
    .map((w, i): Vec3 => row(i).mul(w))
    .reduce((sum, v) => sum.add(v))
    .div(total.max(1e-30));
}

/** The part of v that is square to n, as a unit vector; zero where v is nearly along n. */
function squareTo(v: Vec3, n: Vec3): Vec3 {
  const unit = v.div(length(v).max(1e-30)).toVar(),
    t = unit.sub(n.mul(unit.dot(n))).toVar();
  return select(length(t).greaterThan(0.01), normalize(t), vec3(0));
}

/** From a mesh into the world. */
interface Frame {
  normal: Vec3;
  tangent: (of: Vec3) => Vec3;
}
const ofMesh = (): Frame => ({
  normal: (modelNormalMatrix as unknown as Node<'mat3'>).mul(normalGeometry as unknown as Vec3),
  tangent: (of) => (modelWorldMatrix as unknown as Node<'mat4'>).mul(vec4(of, 0)).xyz,
});
/** three has turned an instance's local normal, and not what we call a tangent. */
const ofInstance = ({ instances }: Sum): Frame => ({
  normal: (modelNormalMatrix as unknown as Node<'mat3'>).mul(normalLocal as unknown as Vec3),
  tangent: (of) => instances.turn().mul(instances.rest.mul(of)),
});

/** The normal of the front turned to its face's side, and what the normal map makes of it (scene/reflection.cpp). */
function normals(
  surface: NodeSurface,
  side: Node<'float'>,
  { normal, tangent }: Frame = ofMesh(),
): { n: Vec3; bent: Vec3 } {
  const position = positionWorld as unknown as Vec3,
    px = dFdx(position).toVar(),
    py = dFdy(position).toVar(),
    own = varying(normal).normalize().toVar(),
    n = select(side.mul(own.dot(cross(px, py))).lessThan(0), own.negate(), own).toVar();
  if (!surface.normals) return { n, bent: n };
  const { texture: map, scale, tangents } = surface.normals,
    at = attribute<'vec2'>('lambentNormalPlace', 'vec2'),
    place = varying((uniform(map.matrix) as unknown as Node<'mat3'>).mul(vec3(at, 1)).xy).toVar(),
    ux = dFdx(place).toVar(),
    uy = dFdy(place).toVar(),
    area = ux.x.mul(uy.y).sub(ux.y.mul(uy.x)).toVar();
  const found = px.mul(uy.y).sub(py.mul(ux.y)).mul(sign(area)),
    drawn = vec4(found, select(side.mul(area).lessThan(0), float(1), float(-1)));
  let t = squareTo(drawn.xyz, n),
    hand: Node<'float'> = drawn.w;
  if (tangents) {
    const given = attribute<'vec4'>('lambentTangent', 'vec4'),
      turned = varying(tangent(given.xyz)),
      known = squareTo(turned, n).toVar(),
      w = varying(given.w).toVar(),
      bad = length(known).equal(0).or(w.equal(0));
    t = select(bad, t, known);
    hand = select(bad, hand, w);
  }
  const along = t.toVar(),
    texel = (texture(map, place) as unknown as Node<'vec4'>).xyz.mul(2).sub(1).toVar(),
    y = select(hand.greaterThan(0), texel.y, texel.y.negate()).mul(scale),
    turned = along.mul(texel.x.mul(scale)).add(cross(n, along).mul(y)).add(n.mul(texel.z));
  return { n, bent: select(length(along).greaterThan(0), normalize(turned), n).toVar() };
}

/** Exit radiance of white. */
export function atlasRadiance(sum: Sum, surface: NodeSurface): Vec3 {
  return sum.instances.choose(
    () => ofInstances(sum, surface),
    () => ofPicture(sum, surface),
  );
}

/** Where the surface's light lies in the atlas, on the side that is seen. */
function placeOf({ twoSided }: NodeSurface): Vec2 {
  const of = (name: string): Vec2 => varying(attribute<'vec2'>(name, 'vec2')),
    front = of('lambentPlace');
  return twoSided ? select(frontFacing, front, of('lambentPlaceBack')) : front;
}

/** Rows of an instance, each of whose texels is summed where it is looked up. */
function ofInstances(of: Sum, surface: NodeSurface): Vec3 {
  const { instances, options, whose, hasPeaks } = of,
    { directional } = surface,
    { width, height } = options.receiversOf!.image,
    isLight = directional === 'none' || directional === 'hl2',
    at = placeOf(surface);
  return Fn(() => {
    const place = at.toVar(),
      low = place.sub(0.5).floor().toVar(),
      share = place.sub(0.5).sub(low).toVar();
    const texel = (x: number, y: number, row: number, part: 0 | 1): Vec3 => {
      const where = ivec2(low.add(vec2(x, y)).clamp(vec2(0, 0), vec2(width - 1, height - 1))),
        r = int(textureLoad(texture(whose), where).r).toVar(),
        known = select(r.lessThan(int(0)), int(0), r).toVar(),
        value = isLight
          ? instances.part(options, known, int(row), part)
          : instances.sum(options, known, int(row), part);
      return select(r.lessThan(int(0)), vec3(0), value);
    };
    const rows =
      (part: 0 | 1): Rows =>
      (row) =>
        mix(
          mix(texel(0, 0, row, part), texel(1, 0, row, part), share.x),
          mix(texel(0, 1, row, part), texel(1, 1, row, part), share.x),
          share.y,
        ).toVar();
    const side = select(frontFacing, float(1), float(-1)).toVar(),
      { n, bent } = directional === 'none' ? { n: vec3(0), bent: vec3(0) } : normals(surface, side, ofInstance(of)),
      back = transpose(instances.turn()),
      N = back.mul(n.mul(side)).toVar(),
      towards = back.mul(bent.mul(side)).toVar(),
      sum = evaluate(directional, rows(0), N, towards).toVar();
    If(hasPeaks.greaterThan(0.5), () => void sum.addAssign(evaluate(directional, rows(1), N, towards)));
    return sum;
  })();
}

function ofPicture({ picture, peakPicture, hasPeaks, options, turnBack }: Sum, surface: NodeSurface): Vec3 {
  const { directional } = surface,
    rows = directionalRows[directional],
    { width, height } = options.receiversOf!.image;
  const at = placeOf(surface);
  const radiance = Fn(() => {
    const place = at.toVar();
    // Rows lie below each other.
    const read =
      (from: Picture): Rows =>
      (row) =>
        (
          from
            .sample(place.add(vec2(0, height * row)).div(vec2(width, rows * height)))
            .level(float(0)) as unknown as Node<'vec4'>
        ).rgb.toVar();
    if (directional === 'none') return read(picture)(0);
    const side = select(frontFacing, float(1), float(-1)).toVar(),
      { n, bent } = normals(surface, side),
      // Rows are in the axes of the bake.
      N = turnBack.mul(n.mul(side)).toVar(),
      towards = turnBack.mul(bent.mul(side)).toVar();
    const sum = evaluate(directional, read(picture), N, towards).toVar();
    if (peakPicture)
      If(hasPeaks.greaterThan(0.5), () => void sum.addAssign(evaluate(directional, read(peakPicture), N, towards)));
    return sum;
  });
  return radiance();
}
