// The GLTFLoader plugin: `new GLTFLoader().register((parser) => new LambentTransferPlugin(parser))`. A file with our
// extension comes with `gltf.userData.lambent`, a BakedScene; files without it are left alone.
import type { Material, Mesh, Object3D } from 'three';
import type { GLTF, GLTFLoaderPlugin, GLTFParser } from 'three/addons/loaders/GLTFLoader.js';
import { LambentError } from './errors.js';
import { extensionName, isIndex, transferExtension, type TransferExtension, type Views } from './glb.js';
import { transferKind, type BakedTransfer, type TransferSource } from './kinds.js';
import { loadLattice, type Lattice } from './lattice.js';
import type { Lighting } from './lighting.js';
import type { NodeEdition } from './node_edition.js';
import { firstColumns, unpackView } from './packed_views.js';
import { takeLights } from './under_lights.js';

export interface BakedScene {
  transfer: BakedTransfer;
  /** What the bake was told and what it reported. */
  provenance: unknown;
  /** Light in free space, where the file was baked with a lattice; relight() sees to it, too. */
  lattice: Lattice | undefined;
  relight(lighting: Lighting): void;
  /**
   * All values of a transfer of which the first bands are there (loadProgressive()); takes the light of the last
   * relight() anew.
   */
  refine(values: ArrayBuffer): void;
  /**
   * Whether the program's directional lights, points and spots light the surfaces, too, with their shadow maps; what
   * they send is not in the bake, and does not bounce. Throws LambentError where surfaces are not diffuse.
   */
  takeLights(on?: boolean): void;
  dispose(): void;
}

/** The baked scene of a loaded file, or undefined. */
export const bakedScene = (gltf: { userData: Record<string, unknown> }): BakedScene | undefined =>
  gltf.userData['lambent'] as BakedScene | undefined;

interface Association {
  nodes?: number;
  primitives?: number;
}

/** Meshes by node and primitive. */
function findMeshes(gltf: GLTF, parser: GLTFParser): Map<string, Mesh> {
  const meshes = new Map<string, Mesh>();
  const of = (object: Object3D): Association | undefined => parser.associations.get(object);
  for (const scene of gltf.scenes)
    scene.traverse((object) => {
      const primitive = of(object)?.primitives;
      if (!(object as Mesh).isMesh || primitive === undefined) return;
      let owner: Object3D | null = object;
      while (owner && of(owner)?.nodes === undefined) owner = owner.parent;
      if (owner) meshes.set(`${of(owner)!.nodes} ${primitive}`, object as Mesh);
    });
  return meshes;
}

/** One after another. */
function joined(pieces: readonly ArrayBuffer[]): ArrayBuffer {
  const length = pieces.reduce((sum, piece) => sum + piece.byteLength, 0);
  let bytes: Uint8Array<ArrayBuffer>;
  try {
    bytes = new Uint8Array(length);
  } catch {
    throw new LambentError(`holds ${length.toLocaleString('en')} bytes in one piece, which is more than a browser has`);
  }
  let at = 0;
  for (const piece of pieces) {
    bytes.set(new Uint8Array(piece), at);
    at += piece.byteLength;
  }
  return bytes.buffer;
}

/** Bytes of a document's buffer views, whichever files they are in. */
export const viewReader =
  (parser: { json: object; getDependency(type: string, index: number): Promise<unknown> }) =>
  async (views: Views): Promise<ArrayBuffer> => {
    const count = (parser.json as Document).bufferViews?.length ?? 0,
      pieces: ArrayBuffer[] = [];
    for (const index of typeof views === 'number' ? [views] : views) {
      if (index >= count) throw new LambentError(`buffer view ${index} does not exist`);
      pieces.push((await parser.getDependency('bufferView', index)) as ArrayBuffer);
    }
    return pieces.length === 1 ? pieces[0]! : joined(pieces);
  };

interface BufferView {
  buffer: number;
  byteOffset?: number;
  byteLength: number;
  extensions?: Record<string, unknown>;
}
interface Document {
  asset?: { generator?: string };
  extensions?: Record<string, unknown>;
  bufferViews?: BufferView[];
  materials?: unknown[];
  nodes?: { mesh?: number }[];
  meshes?: { primitives?: { extensions?: Record<string, unknown> }[] }[];
}

/** Our extension of a primitive, by "node primitive"; empty where it has none. */
function primitiveOf(document: Document, key: string): Record<string, unknown> {
  const [node, primitive] = key.split(' ').map(Number) as [number, number];
  const extension =
    document.meshes?.[document.nodes?.[node]?.mesh ?? -1]?.primitives?.[primitive]?.extensions?.[extensionName];
  return typeof extension === 'object' && extension !== null ? (extension as Record<string, unknown>) : {};
}

/** Of how many bands the transfer is, where the others are to come. */
function firstBandsOf(document: Document, { transfer }: TransferExtension): number | undefined {
  const packed = document.bufferViews?.[Number(transfer['bufferView'])]?.extensions?.[extensionName],
    first = packed === undefined ? undefined : firstColumns(packed);
  return first?.alone ? first.order : undefined;
}

export class LambentTransferPlugin implements GLTFLoaderPlugin {
  readonly name = extensionName;

  /** `nodes`, of lambent-three/webgpu: WebGPURenderer draws the scene, too. */
  constructor(
    private readonly parser: GLTFParser,
    private readonly nodes?: NodeEdition,
  ) {}

  /** Packed ones as glTF has them; null of others, which three reads. */
  loadBufferView(index: number): Promise<ArrayBuffer> | null {
    const view = (this.parser.json as Document).bufferViews?.[index],
      packed = view?.extensions?.[extensionName];
    if (!view || packed === undefined) return null;
    return (async () => {
      const buffer = (await this.parser.getDependency('buffer', view.buffer)) as ArrayBuffer,
        begin = view.byteOffset ?? 0;
      return unpackView(buffer.slice(begin, begin + view.byteLength), packed);
    })();
  }

  async afterRoot(gltf: GLTF): Promise<void> {
    const document = this.parser.json as Document;
    if (document.extensions?.[extensionName] === undefined) return;
    const extension = transferExtension(document);
    const meshes = findMeshes(gltf, this.parser);
    const first = firstBandsOf(document, extension);
    const source: TransferSource = {
      extension,
      ...(first !== undefined && { firstBands: first }),
      generator: document.asset?.generator,
      nodes: this.nodes,
      bufferView: viewReader(this.parser),
      showInstead: (mesh) => {
        gltf.scene.clear();
        gltf.scene.add(mesh);
        gltf.animations.length = 0;
      },
      mesh: ({ node, primitive }: TransferExtension['parts'][number]) => {
        const mesh = meshes.get(`${node} ${primitive}`);
        if (!mesh) throw new LambentError(`node ${node}, primitive ${primitive} has transfer but no mesh`);
        return mesh;
      },
      ownMaterial: async (part) => {
        const own = primitiveOf(document, `${part.node} ${part.primitive}`)['ownMaterial'];
        if (own === undefined) return source.mesh(part).material as Material;
        if (!isIndex(own, (document.materials?.length ?? 0) - 1))
          throw new LambentError('a primitive\'s "ownMaterial" does not exist');
        return (await this.parser.getDependency('material', own)) as Material;
      },
    };
    // What other viewers are shown of backs is drawn by the parts themselves.
    for (const [key, mesh] of meshes) if (primitiveOf(document, key)['viewerOnly'] === true) mesh.visible = false;
    const transfer = await transferKind(extension.transfer.kind)!.load(source);
    const lattice = await loadLattice(source);
    let last: Lighting | undefined;
    const baked: BakedScene = {
      transfer,
      lattice,
      provenance: extension.provenance,
      relight: (lighting) => {
        last = lighting;
        transfer.relight(lighting);
        lattice?.relight(lighting, transfer.lamps?.values());
      },
      refine: (values) => {
        if (!transfer.refine) throw new LambentError(`holds transfer of kind ${transfer.kind}, which comes whole`);
        transfer.refine(values);
        if (last) baked.relight(last);
      },
      takeLights: (on = true) => takeLights(transfer, this.nodes, on),
      dispose: () => {
        transfer.dispose();
        lattice?.dispose();
      },
    };
    gltf.userData['lambent'] = baked;
  }
}
