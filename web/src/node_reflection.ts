// What outgoing.ts has in GLSL, in nodes for WebGPURenderer: rows of a last reflection, weighed by the view.
import { Vector4, type Camera, type Node, type NodeFrame } from 'three/webgpu';
import {
  array,
  cross,
  diffuseColor,
  dot,
  float,
  Fn,
  frontFacing,
  If,
  int,
  ivec2,
  mat4,
  materialColor,
  positionLocal,
  modelWorldMatrix,
  select,
  sign,
  texture,
  textureLoad,
  uniform,
  varying,
  vec2,
  vec3,
  vec4,
} from 'three/tsl';
import { nodeHarmonics } from './node_harmonics.js';
import { showAs } from './node_lit.js';
import { loop } from './node_loop.js';
import type { MaterialNodes } from './node_edition.js';
import { receiverAt } from './node_sum.js';
import { mapLayout, rowWidth, type LastReflection } from './outgoing.js';
import { shCount } from './sh.js';

type Int = Node<'int'>;
type Float = Node<'float'>;
type Vec3 = Node<'vec3'>;
type Mat3 = Node<'mat3'>;

/** Of a receiver and row, T . light; of the light's peaks, where they count. */
export interface RowReader {
  rest(r: Int, row: Int, frame: Mat3 | undefined): Vec3;
  peak(r: Int, row: Int, frame: Mat3 | undefined): Vec3;
  readonly hasPeaks: Float;
}

/** Of the upper hemisphere onto the disk and on to the unit square, equal areas (Shirley and Chiu). */
function square(wo: Vec3): Node<'vec2'> {
  const flat = dot(wo.xy, wo.xy).toVar(),
    radius = wo.z.oneMinus().max(0).sqrt().toVar(),
    d = wo.xy.mul(radius.div(flat.max(1e-30).sqrt())).toVar(),
    ab = vec2(0).toVar();
  If(flat.greaterThan(0), () => {
    If(d.x.abs().greaterThan(d.y.abs()), () => {
      const a = sign(d.x).mul(radius).toVar();
      ab.assign(vec2(a, a.mul(4 / Math.PI).mul(d.y.div(d.x).atan())));
    }).Else(() => {
      const b = sign(d.y).mul(radius).toVar();
      ab.assign(vec2(b.mul(4 / Math.PI).mul(d.x.div(d.y).atan()), b));
    });
  });
  return ab.add(1).mul(0.5).clamp(0, 1);
}

interface Sums {
  gloss: ReturnType<Vec3['toVar']>;
  coloured: ReturnType<Vec3['toVar']>;
}

/** An array, which three's types do not know. */
interface Weights {
  toVar(): { element(i: Int): Float };
}

/** Adds to gloss (a X) and coloured (b X). */
function weighRows(
  { outgoing, rows, maps }: LastReflection,
  wo: Vec3,
  map: Int,
  x: (row: Int) => Vec3,
  to: Sums,
): void {
  const { kind, order, hasB, grid } = outgoing,
    n = shCount(order);
  if (kind === 'map' || kind === 'svd') {
    const { across, width, height } = mapLayout(grid, outgoing.maps, rows),
      place = square(wo)
        .mul(grid - 1)
        .add(0.5)
        .toVar();
    loop(int(rows), 'row', (i) => {
      const tile = map.mul(rows).add(i).toVar(),
        corner = vec2(float(tile.mod(int(across))), float(tile.div(int(across)))).mul(grid),
        at = corner.add(place).div(vec2(width, height)),
        w = (texture(maps, at).level(float(0)) as unknown as Node<'vec4'>).toVar(),
        value = x(i).toVar();
      to.gloss.addAssign(value.mul(w.rgb));
      to.coloured.addAssign(value.mul(w.a));
    });
    return;
  }
  const isPhong = kind === 'phong',
    scale = kind === 'hsh' ? Math.SQRT2 : 1,
    stretch = wo.z.div(wo.z.add(1)).max(0).sqrt().mul(2),
    along = vec3(isPhong ? wo.xy.negate() : wo.xy, wo.z),
    at = kind === 'hsh' ? vec3(wo.xy.mul(stretch), wo.z.mul(2).sub(1)) : along,
    weights: Float[] = [];
  nodeHarmonics(order, at.toVar(), (i, y) => void (weights[i] = y.mul(scale)));
  if (isPhong) weights.push(float(1));
  const all = (array(weights as never) as unknown as Weights).toVar();
  loop(int(weights.length), 'row', (i) => {
    const weight = all.element(i).toVar();
    to.gloss.addAssign(x(i).mul(weight));
    if (hasB && !isPhong) to.coloured.addAssign(x(i.add(int(n))).mul(weight));
  });
  if (hasB && isPhong) to.coloured.addAssign(x(int(n + 1)));
}

/** Where the eye is, or, where that is far away (w = 0), the way to it. */
const eye = uniform(new Vector4()).onObjectUpdate(({ camera }: NodeFrame) => {
  const { elements } = camera!.matrixWorld,
    isFlat = (camera as Camera & { isOrthographicCamera?: boolean }).isOrthographicCamera === true;
  return new Vector4().fromArray(elements, isFlat ? 8 : 12).setW(isFlat ? 0 : 1);
}) as unknown as Node<'vec4'>;

/** At a vertex: columns gloss and coloured of the rest, and of the peaks. */
function reflected(last: LastReflection, reader: RowReader, name: string, frame: Mat3 | undefined): Node<'mat4'> {
  return Fn(() => {
    const { r: found, none } = receiverAt(name),
      r = found.toVar(),
      zero = (): Vec3 => vec3(0),
      rest: Sums = { gloss: zero().toVar(), coloured: zero().toVar() },
      peak: Sums = { gloss: zero().toVar(), coloured: zero().toVar() };
    If(none.not(), () => {
      const load = (i: Int): Node<'vec4'> =>
          textureLoad(texture(last.frames), ivec2(i.mod(int(rowWidth)), i.div(int(rowWidth)))).toVar(),
        tangent = load(r.mul(2)),
        own = load(r.mul(2).add(1)).xyz.toVar(),
        turn = (v: Vec3): Vec3 => (frame ? frame.mul(v) : v),
        position = (modelWorldMatrix as unknown as Node<'mat4'>).mul(vec4(positionLocal as unknown as Vec3, 1)).xyz,
        view = eye.xyz.sub(position.mul(eye.w)).normalize().toVar();
      const seen = vec3(
          view.dot(turn(tangent.xyz)),
          view.dot(turn(cross(own, tangent.xyz))),
          view.dot(turn(own)),
        ).toVar(),
        across = dot(seen.xy, seen.xy).toVar(),
        level = vec3(seen.xy.div(across.max(1e-30).sqrt()), 0),
        below = select(across.greaterThan(0), level, vec3(0, 0, 1)),
        wo = select(seen.z.lessThan(0), below, seen).toVar(),
        map = int(tangent.w).toVar();
      weighRows(last, wo, map, (row) => reader.rest(r, row, frame), rest);
      If(reader.hasPeaks.greaterThan(0.5), () => {
        weighRows(last, wo, map, (row) => reader.peak(r, row, frame), peak);
      });
    });
    return mat4(vec4(rest.gloss, 0), vec4(rest.coloured, 0), vec4(peak.gloss, 0), vec4(peak.coloured, 0));
  })();
}

/** Light towards the eye: gloss, which the surface's colour does not tint, and what it does; each part held at 0. */
export function glossy(last: LastReflection, reader: RowReader, twoSided: boolean, frame?: Mat3): MaterialNodes {
  const side = (name: string): Vec3[] => {
    const all = reflected(last, reader, name, frame).toVar() as unknown as { element(i: Int): Node<'vec4'> };
    return [0, 1, 2, 3].map((i) => varying(all.element(int(i)).xyz));
  };
  const front = side('lambentReceiver'),
    back = twoSided ? side('lambentReceiverBack') : front,
    [gloss, coloured, peakGloss, peakColoured] = front.map((v, i) =>
      twoSided ? select(frontFacing, v, back[i]) : v,
    ) as [Vec3, Vec3, Vec3, Vec3],
    tint = (diffuseColor as unknown as Node<'vec4'>).rgb,
    light = tint.mul(coloured).add(gloss).max(0).add(tint.mul(peakColoured).add(peakGloss).max(0));
  const colorNode = vec4(materialColor as unknown as Node<'vec4'>);
  showAs(colorNode, coloured.add(gloss));
  return { colorNode, setupLighting: () => light };
}
