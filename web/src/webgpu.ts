// lambent-three/webgpu: what WebGPURenderer draws, on WebGPU and on its WebGL 2 backend.
//
//   loader.register((parser) => new LambentTransferPlugin(parser, nodes));
//
// T . light is drawn into a float picture, a texel a receiver, when the light changes, and only looked up until then.
import type { DataTexture, Node } from 'three/webgpu';
import { attribute, frontFacing, int, ivec2, select, texture, textureLoad, uniform, varying, vec3 } from 'three/tsl';
import { BlockNodes } from './block_nodes.js';
import { atlasRadiance } from './node_atlas.js';
import { bounced, lights } from './node_bounced.js';
import type { MaterialNodes, NodeEdition, NodeSum, NodeSurface, NodeTable } from './node_edition.js';
import { GlassNode } from './node_glass.js';
import { falseColor, lit, underLights } from './node_lit.js';
import { LobeNodes } from './node_lobes.js';
import { glossy, type RowReader } from './node_reflection.js';
import { shown } from './node_shown.js';
import { receiverAt, Sum, type Picture } from './node_sum.js';
import { ReliefNodes } from './node_transfer_texture.js';
import { UnshadowedNodes } from './node_unshadowed.js';
import { sumColumns } from './shown_sums.js';

function emitted({ emission, emissive }: NodeSurface): Node<'vec3'> {
  const color = uniform(emission.value) as unknown as Node<'vec3'>;
  if (!emissive) return color;
  const at = attribute<'vec2'>('lambentEmissivePlace', 'vec2'),
    place = (uniform(emissive.texture.matrix) as unknown as Node<'mat3'>).mul(vec3(at, 1));
  return color.mul((texture(emissive.texture, place.xy) as unknown as Node<'vec4'>).rgb);
}

/** Rows of a picture, and of its peaks'. */
function readRows({ picture, peakPicture, hasPeaks, options, instances }: Sum): RowReader {
  const from =
    (of: Picture, part: 0 | 1): RowReader['rest'] =>
    (r, row) => {
      const i = r.mul(int(options.rows ?? 1)).add(row),
        texel = ivec2(i.mod(int(sumColumns)), i.div(int(sumColumns)));
      return instances.choose(
        () => instances.sum(options, r, row, part),
        () => (textureLoad(of, texel) as unknown as Node<'vec4'>).rgb,
      );
    };
  return { rest: from(picture, 0), peak: from(peakPicture ?? picture, 1), hasPeaks: hasPeaks };
}

export const nodes: NodeEdition = {
  sum: (options) => new Sum(options),
  blocks: (options) => new BlockNodes(options),
  lobes: (options) => new LobeNodes(options),
  reflection(given, last, twoSided): MaterialNodes {
    const sum = given as Sum,
      instances = sum.instances;
    return glossy(
      last,
      readRows(sum),
      twoSided,
      instances.choose(
        () => instances.turn(),
        () => sum.turn,
      ),
    );
  },

  atVertices(sum: NodeSum, twoSided: boolean): Node<'vec4'> {
    const { picture, made, options, instances } = sum as Sum,
      known = made.get(twoSided);
    if (known) return known;
    const of = (name: string): Node<'vec3'> => {
      const { r, none } = receiverAt(name),
        texel = ivec2(r.mod(sumColumns), r.div(sumColumns));
      const value = instances.choose(
        () => instances.held(options, r),
        () => (textureLoad(picture, texel) as unknown as Node<'vec4'>).rgb,
      );
      return varying(select(none, vec3(0), value));
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
  shown: (of, over) => shown(of as Sum | NodeTable, over),
  numbers(of: DataTexture, twoSided: boolean): MaterialNodes {
    const at = (name: string): Node<'vec3'> => {
        const { r, none } = receiverAt(name),
          { width } = of.image,
          value = textureLoad(texture(of), ivec2(r.mod(int(width)), r.div(int(width)))) as unknown as Node<'vec4'>;
        return varying(select(none, vec3(0), vec3(value.r)));
      },
      front = at('lambentReceiver');
    return { colorNode: lit(twoSided ? select(frontFacing, front, at('lambentReceiverBack')) : front) };
  },
  falseColor,
  unshadowed: (order, indices) => new UnshadowedNodes(order, indices),
  relief: (options) => new ReliefNodes(options),
  underLights,
  bounced,
  lights,
  glass: (colour) => new GlassNode(colour as Node),
};
