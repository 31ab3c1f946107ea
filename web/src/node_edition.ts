// What WebGPURenderer draws: nodes in the place of GLSL. The package's root knows only what they are asked for, so that
// programs on WebGLRenderer do without three's node system; lambent-three/webgpu makes them.
import type {
  Color,
  DataArrayTexture,
  DataTexture,
  Material,
  Matrix3,
  Matrix4,
  Object3D,
  PointLight,
  SpotLight,
  Texture,
  Vector2,
  Vector4,
  WebGLRenderer,
} from 'three';
import type { BlockLayout } from './block_texture.js';
import { LambentError } from './errors.js';
import type { Directional } from './header.js';
import type { LastReflection } from './outgoing.js';
import { keepNormals } from './own_normals.js';
import type { ShownOver } from './shown_material.js';
import type { TransferTexture } from './transfer_texture.js';
import type { RestPose, TurnableLight } from './turned.js';

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
  /**
   * [column][3]; without peaks all of the light. With peaks both parts are held at 0 or above, where `holds`. `turned`
   * of light that is more than harmonics: TurnableLight's.
   */
  set(
    light: ArrayLike<number>,
    peaks: ArrayLike<number> | undefined,
    holds: boolean,
    turned?: TurnableLight['turned'],
  ): void;
  readonly bytes: number;
  dispose(): void;
}
/**
 * Values of receivers, and which texel is whose: row i of all rows at texel i, or as a texture says for the first row,
 * with the others below.
 */
export interface NodeSumOptions {
  layout: BlockLayout;
  transfer: DataArrayTexture;
  channels: 1 | 3;
  receivers: number;
  /** Of the light's harmonics, which come before lamps. */
  order: number;
  /** How meshes stood when they were baked: those that were turned have pictures of their own. */
  pose: RestPose;
  /** A receiver; 1 where it is not said. */
  rows?: number;
  /** Peaks are no light by themselves, row by row: they have a picture of their own, which what looks up adds. */
  apart?: boolean;
  receiversOf?: DataTexture;
}
/** What an atlas's surface shows beside its light. */
export interface NodeSurface {
  twoSided: boolean;
  emission: { value: Color };
  directional: Directional;
  normals?: { texture: Texture; scale: number; tangents: boolean };
  emissive?: { texture: Texture };
}
/** Zonal lobes, of each of a last reflection's rows where there is one. */
export interface NodeLobeOptions {
  layout: BlockLayout;
  transfer: DataArrayTexture;
  order: number;
  channels: 1 | 3;
  lobes: number;
  last?: LastReflection;
}
/** The pose that was baked: bones, as in three's own bone texture, or the inverse of the mesh's. */
export type NodeRest = { bones: DataTexture; count: number } | { inverse: Matrix3 };
export interface NodeLobes {
  /** [coefficient][3] */
  set(light: ArrayLike<number>, peaks: ArrayLike<number> | undefined): void;
  material(twoSided: boolean, rest: NodeRest): MaterialNodes;
  dispose(): void;
}
/** Nodes of a classic material, by the properties that WebGPURenderer takes them from. */
export interface MaterialNodes {
  colorNode?: { uuid: string };
  emissiveNode?: { uuid: string };
  /** Of materials that lights light. */
  setupLightingModel?: () => object;
  /** In place of all lighting. */
  setupLighting?: () => { uuid: string };
}
/** Light that has bounced, a texel a receiver or over an atlas (indirect.ts). */
export interface NodeBounced {
  picture: DataTexture;
  atlas: boolean;
  twoSided: boolean;
  direct: { value: number };
}

/** Visibility in blocks: records, receivers, and the light (blocks.ts). */
export interface NodeBlockOptions {
  sight: DataArrayTexture;
  places: DataTexture;
  /** What a mesh is lit by as it stands; of none, what those that stand as they were baked are. */
  standing(object?: Object3D): BlockStanding;
  cube: number;
  bits: number;
  receivers: number;
}
export interface BlockStanding {
  readonly light: Record<'sums' | 'coarse' | 'fine' | 'texels', { value: DataTexture }>;
  /** Another number where the light is another. */
  readonly version: number;
  /** From the world to where it was baked. */
  readonly place: Matrix4;
}
/** Its pictures, drawn when the light, the eye or the lobe has changed. */
export interface NodeBlocks {
  /** `model`: 0 none, 1 Phong, 2 GGX; `share`: of what is scattered evenly. */
  setLobe(
    model: number,
    share: number,
    lobe: { colour: { value: number }; width: { value: number }; samples: { value: Vector4 } },
  ): void;
  /** For `colorNode`. */
  atVertices(twoSided: boolean): { uuid: string };
  readonly bytes: number;
  dispose(): void;
}

/** A surface with nothing in its light's way (unshadowed_material.ts). */
export interface NodeUnshadowed {
  readonly nodes: MaterialNodes;
  /** [harmonic that counts][3] */
  set(light: ArrayLike<number>, peaks: ArrayLike<number> | undefined): void;
}
/** A texture of zonal lobes, and its table of the light's bands by direction, `width` by `height` a band. */
export interface NodeReliefOptions {
  transfer: TransferTexture;
  tile: Vector2;
  /** Of a table of grooves; may change at any time. */
  groove: { readonly depth: number; readonly width: number };
  width: number;
  height: number;
}
export interface NodeRelief {
  readonly nodes: MaterialNodes;
  /** [coefficient][3] */
  set(light: ArrayLike<number>): void;
  dispose(): void;
}

/** What the processor summed: of an object, as it stands when it is drawn. */
export interface NodeTable {
  first: DataTexture;
  of(object: Object3D): DataTexture;
}

export interface NodeEdition {
  sum(options: NodeSumOptions): NodeSum;
  /** For `colorNode` of a MeshBasicMaterial: its colour times the exit radiance of its vertices' receivers. */
  atVertices(sum: NodeSum, twoSided: boolean): { uuid: string };
  blocks(options: NodeBlockOptions): NodeBlocks;
  lobes(options: NodeLobeOptions): NodeLobes;
  /** Of rows that are summed, weighed by the view. */
  reflection(sum: NodeSum, last: LastReflection, twoSided: boolean): MaterialNodes;
  /** The same of places in an atlas, and what glows. */
  overAtlas(sum: NodeSum, surface: NodeSurface): MaterialNodes;
  /** Of sums in a picture, or in tables, for a MeshBasicMaterial. */
  shown(of: NodeSum | NodeTable, over: ShownOver): MaterialNodes;
  /** A number a receiver, as exit radiance. */
  numbers(of: DataTexture, twoSided: boolean): MaterialNodes;
  /** Exit radiance, signed, in false colour; +-1 / gain are the ends of the scale. */
  falseColor(nodes: MaterialNodes, gain: { value: number }): MaterialNodes;
  unshadowed(order: number, indices: readonly number[]): NodeUnshadowed;
  relief(options: NodeReliefOptions): NodeRelief;
  /** Of one that takes the program's lights, from those of one that does not. */
  underLights(nodes: MaterialNodes): MaterialNodes;
  /** Of a MeshLambertMaterial. */
  bounced(light: NodeBounced): MaterialNodes;
  /** Lights that fall off as lambent's do. */
  lights: LampMakers;
  /** `colour`, before which what is behind passes through the glass. */
  glass(colour: { uuid: string }): { uuid: string };
}
export interface LampMakers {
  point(): PointLight;
  spot(): SpotLight;
}

/**
 * WebGPURenderer takes the nodes of a classic material from properties of their names. Without nodes it would draw a
 * plain white surface: where it asks, `message` says why not. It tells such materials' programs, and the values they
 * read, apart by plain values alone: the nodes' numbers are one.
 */
export function setNodes(material: Material, nodes: MaterialNodes | undefined, message: string): void {
  const define = (name: string, descriptor: PropertyDescriptor): void =>
    void Object.defineProperty(material, name, { configurable: true, enumerable: true, ...descriptor });
  if (!nodes)
    return define('colorNode', {
      get: () => {
        throw new LambentError(message);
      },
    });
  for (const [name, value] of Object.entries(nodes) as [string, unknown][]) define(name, { value, writable: true });
  const key = [nodes.colorNode, nodes.emissiveNode, nodes.setupLighting?.()].map((node) => node?.uuid ?? '').join(' ');
  define('nodesKey', { value: key, writable: true });
}

export const nodeNames = ['colorNode', 'emissiveNode', 'setupLightingModel', 'setupLighting', 'nodesKey'] as const;

/** What of a material says whether it takes lights, and with which normals (under_lights.ts). */
const lightNames = ['type', 'isMeshBasicMaterial', 'isMeshLambertMaterial', 'flatShading'],
  normalNames = ['normalMap', 'normalScale', 'normalMapType'];

/** The nodes of a material for its clone, and what it has of lights. */
export function copyNodes(from: Material, to: Material): void {
  keepNormals(from, to);
  for (const name of [...nodeNames, ...lightNames, ...normalNames]) {
    const property = Object.getOwnPropertyDescriptor(from, name);
    if (property) Object.defineProperty(to, name, property);
  }
}

/** Nodes of a MeshBasicMaterial, which may be of glass. */
export function throughGlass(edition: NodeEdition, material: Material, nodes: MaterialNodes): MaterialNodes {
  const { colorNode } = nodes;
  return colorNode && material.userData['lambentGlass'] !== undefined
    ? { ...nodes, colorNode: edition.glass(colorNode) }
    : nodes;
}

export const withoutNodes =
  'was loaded for WebGLRenderer, and this is WebGPURenderer: give the plugin the nodes of lambent-three/webgpu, ' +
  'new LambentTransferPlugin(parser, nodes)';
/** The same of a material that a program makes. */
export const withoutEdition =
  'was made for WebGLRenderer, and this is WebGPURenderer: give its constructor the nodes of lambent-three/webgpu, too';

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
