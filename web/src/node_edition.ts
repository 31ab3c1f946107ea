// What WebGPURenderer draws: nodes in the place of GLSL. The package's root knows only what they are asked for, so that
// programs on WebGLRenderer do without three's node system; lambent-three/webgpu makes them.
import type { Color, DataArrayTexture, DataTexture, Material, Texture, Vector3, WebGLRenderer } from 'three';
import type { BlockLayout } from './block_texture.js';
import { LambentError } from './errors.js';

/** WebGPURenderer, with either of its backends, as far as it is asked what it can do. */
export interface NodeRenderer {
  readonly isWebGPURenderer: boolean;
  readonly backend: object;
}
export type Renderer = WebGLRenderer | NodeRenderer;
export const isNodeRenderer = (renderer: Renderer): renderer is NodeRenderer =>
  'isWebGPURenderer' in renderer && renderer.isWebGPURenderer;

/** T . light as a picture, drawn once for each light. */
export interface NodeSum {
  /** [column][3]; without peaks all of the light. With peaks both parts are held at 0 or above, where `holds`. */
  set(light: ArrayLike<number>, peaks: ArrayLike<number> | undefined, holds: boolean): void;
  readonly bytes: number;
  dispose(): void;
}
/** Values of receivers, and which texel is whose: receiver number i at texel i, or as a texture says. */
export interface NodeSumOptions {
  layout: BlockLayout;
  transfer: DataArrayTexture;
  channels: 1 | 3;
  receivers: number;
  receiversOf?: DataTexture;
}
/** What an atlas's surface shows beside its light. */
export interface NodeSurface {
  twoSided: boolean;
  emission: { value: Color };
  emissive?: { texture: Texture };
}

/** Visibility in blocks: records, receivers, and the light (blocks.ts). */
export interface NodeBlockOptions {
  sight: DataArrayTexture;
  places: DataTexture;
  light: Record<'sums' | 'coarse' | 'texels', { value: DataTexture }>;
  cube: number;
  bits: number;
  receivers: number;
}
/** Its pictures, drawn when the light, the eye or the lobe has changed. */
export interface NodeBlocks {
  /** The light is another. */
  refresh(): void;
  /** `model`: 0 none, 1 Phong, 2 GGX; `share`: of what is scattered evenly. */
  setLobe(
    model: number,
    share: number,
    lobe: { colour: { value: number }; width: { value: number }; samples: { value: Vector3 } },
  ): void;
  /** For `colorNode`. */
  atVertices(twoSided: boolean): { uuid: string };
  readonly bytes: number;
  dispose(): void;
}

export interface NodeEdition {
  sum(options: NodeSumOptions): NodeSum;
  /** For `colorNode` of a MeshBasicMaterial: its colour times the exit radiance of its vertices' receivers. */
  atVertices(sum: NodeSum, twoSided: boolean): { uuid: string };
  blocks(options: NodeBlockOptions): NodeBlocks;
  /** The same of places in an atlas, and what glows. */
  overAtlas(sum: NodeSum, surface: NodeSurface): { uuid: string };
}

/**
 * WebGPURenderer takes the nodes of a classic material from properties of their names. Without nodes it would draw a
 * plain white surface: where it asks, `message` says why not. It tells such materials' programs, and the values they
 * read, apart by plain values alone: the node's number is one.
 */
export function setNodes(material: Material, node: { uuid: string } | undefined, message: string): void {
  const define = (name: string, descriptor: PropertyDescriptor): void =>
    void Object.defineProperty(material, name, { configurable: true, enumerable: true, ...descriptor });
  if (!node)
    return define('colorNode', {
      get: () => {
        throw new LambentError(message);
      },
    });
  define('colorNode', { value: node, writable: true });
  define('colorNodeKey', { value: node.uuid, writable: true });
}

export const withoutNodes =
  'was loaded for WebGLRenderer, and this is WebGPURenderer: give the plugin the nodes of lambent-three/webgpu, ' +
  'new LambentTransferPlugin(parser, nodes)';
export const onlyGlsl = (what: string): string =>
  `is ${what}, which WebGPURenderer does not draw in this version; WebGLRenderer does`;
/** Glass takes a draw of its own, which hooks of WebGLRenderer make. */
export const glassRefusal = (material: Material): string | undefined =>
  material.userData['lambentGlass'] === undefined ? undefined : onlyGlsl('seen through coloured glass');

/** Throws LambentError where WebGPURenderer does not draw what it is given; asks it once it has begun. */
export function checkNodes({ backend }: NodeRenderer, refusal: string | undefined): void {
  if (refusal !== undefined) throw new LambentError(refusal);
  const { isWebGLBackend, extensions } = backend as {
    isWebGLBackend?: boolean;
    extensions?: { has(name: string): boolean };
  };
  if (isWebGLBackend && extensions && !extensions.has('EXT_color_buffer_float'))
    throw new LambentError(
      'is summed into a picture, which needs a graphics card that draws into float textures (EXT_color_buffer_float)',
    );
}
