// What shown_material.ts has in GLSL, in nodes for WebGPURenderer.
import { type Node, type NodeFrame } from 'three/webgpu';
import {
  attribute,
  Fn,
  frontFacing,
  int,
  ivec2,
  mix,
  select,
  texture,
  textureLoad,
  varying,
  vec2,
  vec3,
  vec4,
} from 'three/tsl';
import type { MaterialNodes, NodeTable } from './node_edition.js';
import { lit } from './node_lit.js';
import { receiverAt, Sum } from './node_sum.js';
import type { ShownOver } from './shown_material.js';
import { sumColumns } from './shown_sums.js';

type Vec3 = Node<'vec3'>;
type Vec4 = Node<'vec4'>;
type Read = (texel: Node<'ivec2'>) => Vec3;

function reader(of: Sum | NodeTable): Read {
  if (of instanceof Sum) return (texel) => (textureLoad(of.picture, texel) as unknown as Vec4).rgb;
  const values = texture(of.first).onObjectUpdate(({ object }: NodeFrame) => of.of(object!));
  return (texel) => (textureLoad(values, texel) as unknown as Vec4).rgb;
}

const texelOf = (i: Node<'int'>): Node<'ivec2'> => ivec2(i.mod(int(sumColumns)), i.div(int(sumColumns)));

/** Bilinear by hand, since graphics cards need not filter single floats; of a view, with how much is covered. */
function placed(read: Read, over: Exclude<ShownOver, { at: 'vertices' }>): Vec4 {
  const { width, height } = over,
    of = (name: string): Node<'vec2'> => varying(attribute<'vec2'>(name, 'vec2')),
    front = of('lambentPlace'),
    at = over.twoSided ? select(frontFacing, front, of('lambentPlaceBack')) : front;
  return Fn(() => {
    const place = at.toVar(),
      low = place.sub(0.5).floor().toVar(),
      share = place.sub(0.5).sub(low).toVar();
    const texel = (x: number, y: number): Vec4 => {
      const where = ivec2(low.add(vec2(x, y)).clamp(vec2(0, 0), vec2(width - 1, height - 1))).toVar();
      if (over.at === 'texels') return vec4(read(where), 1);
      const covered = (textureLoad(texture(over.coverage), where) as unknown as Vec4).r;
      return vec4(read(texelOf(where.y.mul(int(width)).add(where.x))), covered);
    };
    return mix(mix(texel(0, 0), texel(1, 0), share.x), mix(texel(0, 1), texel(1, 1), share.x), share.y);
  })();
}

export function shown(of: Sum | NodeTable, over: ShownOver): MaterialNodes {
  const read = reader(of);
  if (over.at === 'vertices') {
    const side = (name: string): Vec3 => {
        const { r, none } = receiverAt(name);
        return varying(select(none, vec3(0), read(texelOf(r))));
      },
      front = side('lambentReceiver');
    return { colorNode: lit(over.twoSided ? select(frontFacing, front, side('lambentReceiverBack')) : front) };
  }
  const here = placed(read, over).toVar();
  return { colorNode: over.at === 'texels' ? lit(here.rgb) : lit(here.rgb.div(here.a.max(1e-6)), here.a) };
}
