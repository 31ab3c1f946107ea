// Directions in a block and a lobe's BRDF there, in nodes: what block_shader.ts has in GLSL.
import type { Node } from 'three/webgpu';
import { cross, dot, float, If, int, mix, select, vec2, vec3 } from 'three/tsl';
import { fineNodes } from './block_light.js';

type Int = Node<'int'>;
type Vec3 = Node<'vec3'>;

/** The unit direction of a place in a block, in its texels. */
export function directionOf(cube: number, b: Int, place: Node<'vec2'>): Vec3 {
  const side = cube / 16,
    face = b.div(int(side * side)),
    row = b.div(int(side)).mod(int(side)),
    column = b.mod(int(side)),
    corner = vec2(float(column.mul(int(16))), float(row.mul(int(16)))),
    uv = corner
      .add(place)
      .mul(2 / cube)
      .sub(1),
    u = uv.x,
    v = uv.y,
    one = float(1);
  const on = [
    vec3(one, v.negate(), u.negate()),
    vec3(one.negate(), v.negate(), u),
    vec3(u, one, v),
    vec3(u, one.negate(), v.negate()),
    vec3(u, v.negate(), one),
    vec3(u.negate(), v.negate(), one.negate()),
  ] as Vec3[];
  return on.reduceRight((rest, d, i) => select(face.equal(int(i)), d, rest)).normalize();
}

/** Of node `i`, of 4 x 4. */
export const nodeDirection = (cube: number, b: Int, i: Int): Vec3 =>
  directionOf(
    cube,
    b,
    vec2(float(i.bitAnd(int(3)).mul(int(4)).add(int(2))), float(i.shiftRight(int(2)).mul(int(4)).add(int(2)))),
  );

/** Of 8 x 8, at Chebyshev's points. */
export function fineDirection(cube: number, b: Int, i: Int): Vec3 {
  const along = (k: Int): Node<'float'> => {
    const angle = float(k)
      .add(0.5)
      .mul(Math.PI / fineNodes);
    return float(1).sub(angle.cos()).mul(8);
  };
  return directionOf(cube, b, vec2(along(i.bitAnd(int(7))), along(i.shiftRight(int(3)))));
}

/** Of `model` 1 Phong's, of 2 GGX; seen from `wo`. */
export interface LobeNodes {
  model: Int;
  colour: Node<'float'>;
  width: Node<'float'>;
  n: Vec3;
  wo: Vec3;
  cosO: Node<'float'>;
  mirror: Vec3;
}

/** The BRDF towards wi. */
export function lobeValue({ model, colour, width, n, wo, cosO, mirror }: LobeNodes, wi: Vec3): Node<'float'> {
  const value = float(0).toVar();
  If(model.equal(int(1)), () => {
    const c = dot(mirror, wi).clamp(0, 1).toVar();
    If(c.greaterThan(1e-30), () => {
      value.assign(
        colour
          .mul(width.add(2))
          .mul(1 / (2 * Math.PI))
          .mul(c.pow(width)),
      );
    });
  }).Else(() => {
    const cosI = dot(n, wi).toVar();
    If(cosI.greaterThan(1e-6), () => {
      const sumOf = wi.add(wo).toVar(),
        across = dot(sumOf, sumOf).max(1e-12).sqrt().toVar(),
        h = sumOf.div(across).toVar(),
        a2 = width.mul(width).toVar(),
        hz = dot(n, h).max(1e-6).toVar(),
        slope = cross(n, h).toVar(),
        s = dot(slope, slope).div(a2).add(hz.mul(hz)).toVar();
      const root = (c: Node<'float'>): Node<'float'> =>
        a2
          .mul(float(1).sub(c.mul(c)))
          .add(c.mul(c))
          .sqrt()
          .mul(0.5);
      const masking = cosO.mul(root(cosI)).add(cosI.mul(root(cosO))),
        shape = float(1 / (4 * Math.PI)).div(a2.mul(s).mul(s).mul(masking)),
        q = float(1).sub(across.mul(0.5)).max(0).toVar();
      value.assign(shape.mul(mix(colour, float(1), q.mul(q).mul(q).mul(q).mul(q))));
    });
  });
  return value;
}
