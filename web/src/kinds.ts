// The kinds of transfer that a file may hold. A new one is one entry here and one module.
import type { Color, Material, Mesh } from 'three';
import type { Reflection } from './block_reflection.js';
import type { FixedView } from './fixed_view.js';
import type { TransferExtension, Views } from './glb.js';
import type { IndirectControls } from './indirect.js';
import type { Lighting } from './lighting.js';
import type { Lobe } from './lobes.js';
import type { NodeEdition, Renderer } from './node_edition.js';

/** What a kind is given to read itself from. */
export interface TransferSource {
  extension: TransferExtension;
  /** Bytes of a buffer view, or of several one after another; rejects where there is none. */
  bufferView(views: Views): Promise<ArrayBuffer>;
  /** Draws this in place of the document's scene. */
  showInstead(mesh: Mesh): void;
  /** The mesh that draws a part. Throws LambentError where the file has none. */
  mesh(part: TransferExtension['parts'][number]): Mesh;
  /**
   * The scene's own material of a part whose mesh wears one for other viewers; its mesh's material where it does not.
   */
  ownMaterial(part: TransferExtension['parts'][number]): Promise<Material>;
  /** asset.generator of the document. */
  generator?: string | undefined;
  /** For WebGPURenderer. */
  nodes?: NodeEdition | undefined;
  /** Dense transfer: so many bands (and the scene's lamps) are there, the others are zero and are to come. */
  firstBands?: number;
}

/** The transfer of one file, bound to its meshes. */
export interface BakedTransfer {
  readonly kind: string;
  /** Bands of the light that count; 0 where it is lamps, or lobes that are not of bands, alone. */
  readonly order: number;
  readonly channels: number;
  readonly receivers: number;
  /** Columns of the light before the scene's own lamps, where some are lobes: `order`^2 harmonics, else. */
  readonly columns?: { harmonics: number; lobes: number } | undefined;
  /** In the file, and what the same takes on the graphics card, receiver indices included. */
  readonly fileBytes: number;
  readonly gpuBytes: number;
  /** Meshes whose material is ours now. */
  readonly meshes: Mesh[];
  /** Whether surfaces scatter evenly, so that lights of the program may count beside what was baked. */
  readonly isDiffuse?: boolean;
  /** Throws LambentError where the graphics card lacks what this is drawn with. */
  check(renderer: Renderer): void;
  /** Shows the meshes under this light. Writes a few hundred bytes of uniforms and nothing else. */
  relight(lighting: Lighting): void;
  /** Of transfer whose other bands are to come: how many are there. */
  readonly firstBands?: number | undefined;
  /**
   * Dense transfer: all values, in place of those of its first bands; counts at the next relight(). Materials that show
   * a coefficient are to be made anew.
   */
  refine?(values: ArrayBuffer): void;
  /**
   * The scene's own lamps, where the file has them: a colour that scales each, by name. Counts at the next relight().
   */
  readonly lamps?: Map<string, Color>;
  /**
   * Materials that show one coefficient of transfer in false colour, one a mesh in the order of `meshes`; `gain` is a
   * shared uniform. Made on demand; the caller disposes of them. Not where transfer has no coefficients.
   */
  readonly coefficientMaterials?: (index: number, gain: { value: number }) => Material[];
  /** Visibility in blocks: what all surfaces are made of. Counts at the next frame. */
  reflection?: Reflection;
  /** Of wavelets: how many of the light's are used, those that change most; 0: all. Counts at the next relight(). */
  terms?: number;
  /** Of a fixed view: the camera that was baked in, whose picture the only mesh is. */
  readonly view?: FixedView | undefined;
  /** Direct to indirect light: lamps that move, and paint. */
  readonly indirect?: IndirectControls;
  /**
   * Where the file has the errors of a fit: materials that show them in false colour, as coefficientMaterials() does.
   */
  readonly fitErrorMaterials?: (gain: { value: number }) => Material[];
  /**
   * Zonal transfer: the lobes of a vertex as the surface stands now, or of its back; undefined where it has no
   * receiver.
   */
  readonly lobesAt?: (mesh: Mesh, vertex: number, back: boolean) => Lobe[] | undefined;
  /**
   * Diffuse transfer at vertices by harmonics alone: what a receiver makes of the light, [channel][order^2], once all
   * bands are there.
   */
  readonly coefficientsOf?: (receiver: number, out: Float64Array) => void;
  dispose(): void;
}

/**
 * What the page draws: store, meaning of the rows, placement. src/lambent/pipeline/browser.cpp holds the same, and a
 * test compares the two.
 */
export const drawn = [
  ['dense', 'diffuse', 'vertices'],
  ['dense', 'diffuse', 'texels'],
  ['dense', 'directional', 'texels'],
  ['dense', 'outgoing', 'vertices'],
  ['clusters', 'diffuse', 'vertices'],
  ['clusters', 'diffuse', 'texels'],
  ['clusters', 'directional', 'texels'],
  ['clusters', 'outgoing', 'vertices'],
  ['factors', 'outgoing', 'vertices'],
  ['lobes', 'diffuse', 'vertices'],
  ['lobes', 'outgoing', 'vertices'],
  ['blocks', 'sight', 'vertices'],
  ['surfels', 'diffuse', 'vertices'],
  ['surfels', 'diffuse', 'texels'],
  ['dense', 'pixels', 'view'],
  ['wavelets', 'diffuse', 'vertices'],
  ['wavelets', 'diffuse', 'texels'],
  ['wavelets', 'pixels', 'view'],
] as const;

/**
 * Of what is drawn: columns of light; lobes of all rows of a receiver; of a matrix, texels a receiver; lamps
 * that move, each with a shadow map, and lights and glowing materials of the scene's own beside them; bytes that
 * clusters and factors are unfolded to; objects that are put into a scene, and vertices of one of them.
 */
export const limits = {
  columns: 256,
  lobes: 64,
  texels: 2048,
  lamps: 8,
  ownLamps: 64,
  unfolded: 536870912,
  inserts: 8,
  insertVertices: 262144,
} as const;

/** Store, meaning and placement of a file's transfer, as the table has them. */
export function axesOf({ transfer, surface, view }: TransferExtension): [store: string, rows: string, where: string] {
  const stores: Record<string, string> = {
    zonal: 'lobes',
    factors: 'factors',
    blocks: 'blocks',
    indirect: 'surfels',
    wavelets: 'wavelets',
  };
  const isDirectional = transfer['directional'] !== undefined && transfer['directional'] !== 'none';
  return [
    transfer['cpca'] !== undefined ? 'clusters' : (stores[transfer.kind] ?? 'dense'),
    view !== undefined
      ? 'pixels'
      : transfer.kind === 'blocks'
        ? 'sight'
        : transfer['outgoing'] !== undefined
          ? 'outgoing'
          : isDirectional
            ? 'directional'
            : 'diffuse',
    view !== undefined ? 'view' : typeof surface?.kind === 'string' ? surface.kind : 'vertices',
  ];
}
export const isDrawn = (extension: TransferExtension): boolean => {
  const axes = axesOf(extension);
  return drawn.some((kind) => kind.every((name, i) => name === axes[i]));
};

export interface TransferKind {
  name: string;
  load(source: TransferSource): Promise<BakedTransfer>;
}

const kinds = new Map<string, TransferKind>();
export const registerTransferKind = (kind: TransferKind): void => void kinds.set(kind.name, kind);
export const transferKind = (name: string): TransferKind | undefined => kinds.get(name);
export const knownKinds = (): string[] => [...kinds.keys()];
