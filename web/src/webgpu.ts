// lambent-three/webgpu: what WebGPURenderer draws, on WebGPU and on its WebGL 2 backend.
//
//   loader.register((parser) => new LambentTransferPlugin(parser, nodes));
//
// T . light is drawn into a float picture, a texel a receiver, when the light changes, and only looked up until then.
import type { Node } from 'three/webgpu';
import {
  attribute,
  frontFacing,
  int,
  ivec2,
  materialColor,
  select,
  texture,
  textureLoad,
  uniform,
  varying,
  vec3,
  vec4,
} from 'three/tsl';
import { BlockNodes } from './block_nodes.js';
import { atlasRadiance } from './node_atlas.js';
import { bounced, lights } from './node_bounced.js';
import type { MaterialNodes, NodeEdition, NodeSum, NodeSurface } from './node_edition.js';
import { GlassNode } from './node_glass.js';
import { LobeNodes } from './node_lobes.js';
import { glossy, type RowReader } from './node_reflection.js';
import { receiverAt, Sum, sumColumns, type Picture } from './node_sum.js';

/** With the alpha of a texture, where there is one. */
function lit(radiance: Node<'vec3'>): Node<'vec4'> {
  const color = vec4(materialColor as unknown as Node<'vec4'>);
  return vec4(color.rgb.mul(radiance.max(0)), color.a);
}

function emitted({ emission, emissive }: NodeSurface): Node<'vec3'> {
  const color = uniform(emission.value) as unknown as Node<'vec3'>;
  if (!emissive) return color;
  const at = attribute<'vec2'>('lambentEmissivePlace', 'vec2'),
    place = (uniform(emissive.texture.matrix) as unknown as Node<'mat3'>).mul(vec3(at, 1));
  return color.mul((texture(emissive.texture, place.xy) as unknown as Node<'vec4'>).rgb);
}

/** Rows of a picture, and of its peaks'. */
function readRows({ picture, peakPicture, hasPeaks, options: { rows = 1 } }: Sum): RowReader {
  const from =
    (of: Picture): RowReader['rest'] =>
    (r, row) => {
      const i = r.mul(int(rows)).add(row),
        texel = ivec2(i.mod(int(sumColumns)), i.div(int(sumColumns)));
      return (textureLoad(of, texel) as unknown as Node<'vec4'>).rgb;
    };
  return { rest: from(picture), peak: from(peakPicture ?? picture), hasPeaks: hasPeaks };
}

export const nodes: NodeEdition = {
  sum: (options) => new Sum(options),
  blocks: (options) => new BlockNodes(options),
  lobes: (options) => new LobeNodes(options),
  reflection: (sum, last, twoSided) => glossy(last, readRows(sum as Sum), twoSided, (sum as Sum).turn),

  atVertices(sum: NodeSum, twoSided: boolean): Node<'vec4'> {
    const { picture, made } = sum as Sum,
      known = made.get(twoSided);
    if (known) return known;
    const of = (name: string): Node<'vec3'> => {
      const { r, none } = receiverAt(name),
        texel = ivec2(r.mod(sumColumns), r.div(sumColumns));
      const value = textureLoad(picture, texel) as unknown as Node<'vec4'>;
      return varying(select(none, vec3(0), value.rgb));
    };
    const front = of('lambentReceiver');
    const node = lit(twoSided ? select(frontFacing, front, of('lambentReceiverBack')) : front);
    made.set(twoSided, node);
    return node;
  },

  overAtlas: (sum: NodeSum, surface: NodeSurface): MaterialNodes => ({
    colorNode: lit(atlasRadiance(sum as Sum, surface)),
    emissiveNode: emitted(surface),
  }),
  bounced,
  lights,
  glass: (colour) => new GlassNode(colour as Node),
};
