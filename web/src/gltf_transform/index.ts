// LAMBENT_transfer for glTF Transform (@gltf-transform/core): keeps a bake while its functions change the file. Values
// are carried as they are. Which receiver a vertex has is a vertex attribute while the document is open, so that it
// follows whatever reorders, drops, splits or joins vertices; what cannot follow is refused on writing.
import {
  type Accessor,
  Extension,
  PropertyType,
  type Mesh,
  type Node,
  type Primitive,
  type ReaderContext,
  type Root,
  type WriterContext,
} from '@gltf-transform/core';
import { LambentError } from '../errors.js';
import { isOutOfPlace, replaceViews } from '../extension_views.js';
import { extensionName, rewritten, type Views } from '../glb.js';
import { Part, Transfer, type TransferData } from './properties.js';

/** The vertex attributes of an open document; files do not have them. */
export const sideSemantics = { front: '_LAMBENT_FRONT', back: '_LAMBENT_BACK' } as const;
type Side = keyof typeof sideSemantics;
const sides = ['front', 'back'] as const;
const noReceiver = 0xffffffff;

interface Extensions {
  extensions?: Record<string, unknown>;
}
type FilePart = Record<'node' | 'primitive', number | undefined> & Record<Side, Views | undefined>;
interface Held {
  side: Side;
  name: string;
  values: Uint32Array;
}
interface WrittenPart {
  node: Node;
  primitive: number;
  front: Uint8Array;
  back: Uint8Array | undefined;
}

const fail = (message: string): never => {
  throw new LambentError(`${extensionName}: ${message}`);
};
const isObject = (value: unknown): value is Record<string, unknown> =>
  typeof value === 'object' && value !== null && !Array.isArray(value);
const bytesOf = (a: Uint32Array): Uint8Array => new Uint8Array(a.buffer, a.byteOffset, a.byteLength);
const wordsOf = (bytes: Uint8Array): Uint32Array =>
  bytes.byteLength % 4 === 0 ? new Uint32Array(bytes.slice().buffer) : fail(rewritten);
function concatenated(pieces: readonly Uint8Array[]): Uint8Array {
  const out = new Uint8Array(pieces.reduce((sum, piece) => sum + piece.byteLength, 0));
  let at = 0;
  for (const piece of pieces) {
    out.set(piece, at);
    at += piece.byteLength;
  }
  return out;
}
const hasTriangles = (primitive: Primitive): boolean => primitive.getMode() >= 4; // triangles, strips and fans
const vertexCount = (primitive: Primitive): number => primitive.getAttribute('POSITION')?.getCount() ?? 0;
const partOf = (primitive: Primitive): Part | null => primitive.getExtension<Part>(extensionName);
const indicesOf = (primitive: Primitive): Uint32Array =>
  Uint32Array.from((primitive.getIndices()?.getArray() ?? []) as ArrayLike<number>);
const equal = (a: Uint32Array, b: Uint32Array): boolean => a.length === b.length && a.every((v, i) => v === b[i]);

/** FNV-1a of the JSON and of the first megabyte. */
function fingerprintOf(text: string, views: readonly Uint8Array[]): string {
  let hash = 0x811c9dc5;
  const add = (byte: number): void => void (hash = Math.imul(hash ^ byte, 0x01000193) >>> 0);
  for (let i = 0; i < text.length; ++i) add(text.charCodeAt(i) & 255);
  for (const view of views) view.subarray(0, 1 << 20).forEach(add);
  return `bake ${hash.toString(16)}`;
}

/** Nodes with a mesh that the default scene shows; of a document without scenes, all. */
function shownNodes(root: Root): Node[] {
  const scene = root.getDefaultScene() ?? root.listScenes()[0],
    nodes: Node[] = [];
  if (scene) scene.traverse((node) => nodes.push(node));
  else nodes.push(...root.listNodes());
  return nodes.filter((node) => node.getMesh());
}

export class LambentTransfer extends Extension {
  static override readonly EXTENSION_NAME = extensionName;
  override readonly extensionName = extensionName;
  override readonly prereadTypes = [PropertyType.BUFFER];
  override readonly prewriteTypes = [PropertyType.BUFFER];
  // Installed before anything is laid out: the attributes leave the document then, before other extensions see them.
  override readonly writeDependencies = ['lambent.parts'];

  private readonly detached = new Map<Primitive, Held[]>();
  private written: WrittenPart[] = [];
  private readonly views = new Map<Uint8Array, Uint8Array>(); // as they are, and padded

  /** Before accessors are read, whose bytes are others in such a file. */
  override preread(context: ReaderContext): this {
    const extension = (context.jsonDoc.json as Extensions).extensions?.[extensionName];
    if (isObject(extension) && extension['packed'] !== undefined)
      return fail('is packed for browsers (lambent export --web --pack): read the file that it was made from');
    return this;
  }

  override read(context: ReaderContext): this {
    const json = context.jsonDoc.json as Extensions,
      extension = json.extensions?.[extensionName];
    if (extension === undefined) {
      this.document.getLogger().warn(`${extensionName}: ${rewritten}`);
      return this;
    }
    if (!isObject(extension) || extension['version'] !== 1 || !isObject(extension['transfer']))
      return fail('is of a version that is not known here; this program reads version 1');
    if (isOutOfPlace(context.jsonDoc.json, extension)) return fail(rewritten);
    const { transfer, surface } = extension as { transfer: Record<string, unknown>; surface?: { kind?: unknown } },
      parts = (Array.isArray(extension['parts']) ? extension['parts'] : fail('holds no list of "parts"')) as FilePart[];
    const bytes = (view: Views | undefined): Uint8Array =>
      typeof view === 'object'
        ? concatenated(view.map((piece) => bytes(piece)))
        : (context.bufferViews[view ?? -1] ?? fail(rewritten));
    const views: Uint8Array[] = [];
    const header = replaceViews(extension, (view) => views.push(bytes(view)) - 1);
    const kind = extension['view'] !== undefined ? 'view' : (surface?.kind ?? 'vertices');
    if (kind !== 'vertices' && kind !== 'texels' && kind !== 'patches' && kind !== 'view')
      return fail('holds receivers over something that is not known here');

    const root = this.document.getRoot(),
      defs = this.ownMeshes(context, parts),
      fingerprint = fingerprintOf(JSON.stringify(extension), views);
    for (const [mesh, index] of defs) this.readPrimitives(context, mesh, index);
    for (const part of parts) {
      const primitive = context.nodes[part.node ?? -1]?.getMesh()?.listPrimitives()[part.primitive ?? -1];
      if (!primitive) return fail(`node ${part.node}, primitive ${part.primitive} has transfer but no mesh`);
      const values = sides.map((side) => (part[side] === undefined ? undefined : wordsOf(bytes(part[side]))));
      if (kind === 'patches') this.holdPatches(primitive, values[0] ?? fail(rewritten), values[1]);
      else
        sides.forEach((side, i) => {
          if (values[i]) this.attach(primitive, side, values[i], fingerprint);
        });
    }
    const data: TransferData = {
      json: header,
      views,
      receivers: typeof transfer['receivers'] === 'number' ? transfer['receivers'] : 0,
      surface: kind,
      fingerprint,
      used: kind === 'vertices' ? this.countUsed() : 0,
      isWhole: kind !== 'view' && this.bare().length === 0,
      hasLook:
        parts.length > 0 && [...defs.keys()].some((mesh) => mesh.listPrimitives().some((p) => partOf(p)?.ownMaterial)),
    };
    const property = new Transfer(this.document.getGraph());
    property.data = data;
    root.setExtension(extensionName, property);
    return this;
  }

  /** Nodes that share a mesh have receivers of their own: each gets its own mesh, over the same accessors. */
  private ownMeshes(context: ReaderContext, parts: FilePart[]): Map<Mesh, number> {
    const owner = new Map<Mesh, Node>(),
      defs = new Map<Mesh, number>();
    for (const node of new Set(parts.map((part) => context.nodes[part.node ?? -1]))) {
      let mesh = node?.getMesh();
      if (!node || !mesh) continue;
      const index = context.meshes.indexOf(mesh);
      if (owner.has(mesh)) {
        mesh = mesh.clone();
        for (const primitive of mesh.listPrimitives()) mesh.removePrimitive(primitive).addPrimitive(primitive.clone());
        node.setMesh(mesh);
      }
      owner.set(mesh, node);
      defs.set(mesh, index);
    }
    return defs;
  }

  private readPrimitives(context: ReaderContext, mesh: Mesh, index: number): void {
    const defs = context.jsonDoc.json.meshes?.[index]?.primitives ?? [];
    mesh.listPrimitives().forEach((primitive, i) => {
      const json = (defs[i] as Extensions | undefined)?.extensions?.[extensionName];
      if (!isObject(json)) return;
      const { ownMaterial, ...rest } = json,
        part = this.partFor(primitive);
      part.data = { ...part.data, json: rest };
      if (typeof ownMaterial === 'number')
        part.ownMaterial = context.materials[ownMaterial] ?? fail('a primitive\'s "ownMaterial" does not exist');
    });
  }

  private partFor(primitive: Primitive): Part {
    const known = partOf(primitive);
    if (known) return known;
    const part = new Part(this.document.getGraph());
    const texcoords = primitive.listSemantics().filter((name) => name.startsWith('TEXCOORD_'));
    part.data = { json: {}, texcoords, patches: undefined };
    primitive.setExtension(extensionName, part);
    return part;
  }

  private holdPatches(primitive: Primitive, front: Uint32Array, back: Uint32Array | undefined): void {
    const part = this.partFor(primitive),
      patches = { front, back, vertices: vertexCount(primitive), indices: indicesOf(primitive) };
    part.data = { ...part.data, patches };
  }

  private attach(primitive: Primitive, side: Side, values: Uint32Array, name: string): void {
    const count = vertexCount(primitive),
      size = values.length / count;
    if (size !== 1 && size !== 2)
      fail(`a primitive has ${count} vertices and ${values.length} receivers: ${rewritten}`);
    const buffer = this.document.getRoot().listBuffers()[0] ?? this.document.createBuffer();
    const accessor = this.document.createAccessor(name, buffer).setType(size === 1 ? 'SCALAR' : 'VEC2');
    primitive.setAttribute(sideSemantics[side], accessor.setArray(values));
  }

  /** Triangles that are shown and have no receivers, in words. */
  private bare(): string[] {
    return shownNodes(this.document.getRoot()).flatMap((node) =>
      node
        .getMesh()!
        .listPrimitives()
        .flatMap((primitive, i) => {
          const part = partOf(primitive);
          const has =
            primitive.getAttribute(sideSemantics.front) ?? part?.data.patches ?? part?.data.json['viewerOnly'];
          return has || !hasTriangles(primitive) ? [] : [nameOf(node, i)];
        }),
    );
  }

  /** Receivers that vertices name. */
  private countUsed(): number {
    const used = new Set<number>();
    for (const mesh of this.document.getRoot().listMeshes())
      for (const primitive of mesh.listPrimitives())
        for (const side of sides)
          for (const r of (primitive.getAttribute(sideSemantics[side])?.getArray() ?? []) as number[]) used.add(r);
    return used.size;
  }

  /** The start of a write. */
  override install(): this {
    this.restore();
    const root = this.document.getRoot(),
      data = root.getExtension<Transfer>(extensionName)?.data,
      primitives = new Set(root.listMeshes().flatMap((mesh) => mesh.listPrimitives()));
    const carriers = [...primitives].filter((p) => sides.some((side) => p.getAttribute(sideSemantics[side])));
    this.views.clear();
    this.written = [];
    if (!data) return carriers.length > 0 ? fail('a mesh has receivers of a bake that this document has not') : this;
    if (root.listExtensionsUsed().some((extension) => extension.extensionName === 'KHR_draco_mesh_compression'))
      return fail('Draco puts vertices into another order when it writes them; compress with meshopt');
    const used = data.surface === 'vertices' ? this.countUsed() : 0;
    if (used < data.used)
      this.document
        .getLogger()
        .warn(
          `${extensionName}: ${data.used - used} of ${data.used} receivers have no vertex any more, and light is ` +
            'coarser between those that are left (simplify() looks at the shape alone)',
        );
    const bare = data.isWhole ? this.bare() : [];
    if (bare.length > 0)
      return fail(
        `${bare[0]} has lost its receivers: it was made or replaced by something that drops vertex attributes`,
      );
    for (const node of root.listNodes())
      node
        .getMesh()
        ?.listPrimitives()
        .forEach((primitive, i) => this.gather(data, node, primitive, i));
    for (const view of [...data.views, ...this.written.flatMap((part) => [part.front, part.back])])
      if (view) this.views.set(view, padded(view));
    if (root.listBuffers().length === 0) this.document.createBuffer();
    this.detach(carriers);
    return this;
  }

  private gather(data: TransferData, node: Node, primitive: Primitive, index: number): void {
    const name = nameOf(node, index),
      part = partOf(primitive);
    const lost = part?.data.texcoords.find((set) => !primitive.getAttribute(set));
    if (part?.ownMaterial && lost)
      fail(
        `${name} has lost ${lost}, which its own material or its lightmap reads: keep unused attributes ` +
          '(prune({ keepAttributes: true }), gltf-transform optimize --prune-attributes false)',
      );
    const patches = part?.data.patches;
    if (patches) {
      if (vertexCount(primitive) !== patches.vertices || !equal(indicesOf(primitive), patches.indices))
        fail(`${name} has other triangles now, and its receivers are triangles: bake again`);
      const { front, back } = patches;
      this.written.push({ node, primitive: index, front: bytesOf(front), back: back && bytesOf(back) });
      return;
    }
    const [front, back] = sides.map((side) => {
      const accessor = primitive.getAttribute(sideSemantics[side]);
      return accessor ? checkedSide(accessor, data, name, vertexCount(primitive)) : undefined;
    });
    if (!front) return;
    if (node.getExtension('EXT_mesh_gpu_instancing'))
      fail(`${name} is drawn in many places by EXT_mesh_gpu_instancing, and has the light of one`);
    if (data.hasLook && !part?.ownMaterial)
      fail(`${name} has lost its own material: it was joined or replaced (leave out join())`);
    this.written.push({ node, primitive: index, front, back });
  }

  /** Accessors that are in the document are written: these are not in it meanwhile. */
  private detach(carriers: Primitive[]): void {
    const accessors = new Set<Accessor>();
    for (const primitive of carriers) {
      const own = sides.flatMap((side): Held[] => {
        const accessor = primitive.getAttribute(sideSemantics[side]);
        if (!accessor) return [];
        accessors.add(accessor);
        return [{ side, name: accessor.getName(), values: accessor.getArray() as Uint32Array }];
      });
      this.detached.set(primitive, own);
    }
    for (const accessor of accessors) accessor.dispose();
  }

  /** Back into the document what a write has taken out. */
  private restore(): void {
    for (const [primitive, own] of this.detached)
      for (const { side, name, values } of own) this.attach(primitive, side, values, name);
    this.detached.clear();
  }

  override prewrite(context: WriterContext): this {
    const buffer = this.document.getRoot().listBuffers()[0];
    if (!buffer || this.views.size === 0) return this;
    const others = context.otherBufferViews.get(buffer) ?? [];
    others.push(...this.views.values());
    context.otherBufferViews.set(buffer, others);
    return this;
  }

  override write(context: WriterContext): this {
    const root = this.document.getRoot(),
      json = context.jsonDoc.json,
      data = root.getExtension<Transfer>(extensionName)?.data;
    if (data) {
      const place = (view: Uint8Array): number => {
        const index = context.otherBufferViewsIndexMap.get(this.views.get(view)!)!,
          def = json.bufferViews![index]!;
        def.byteLength = view.byteLength;
        return (def.byteOffset ?? 0) % 4 === 0 ? index : fail('another extension has put its data at an odd place');
      };
      const parts = this.written.map((part) => ({
        node: context.nodeIndexMap.get(part.node),
        primitive: part.primitive,
        front: place(part.front),
        ...(part.back && { back: place(part.back) }),
      }));
      const extension = { ...replaceViews(data.json, (view) => place(data.views[view]!)), parts };
      json.extensions = { ...json.extensions, [extensionName]: extension };
      for (const mesh of root.listMeshes())
        mesh.listPrimitives().forEach((primitive, i) => {
          const part = partOf(primitive),
            def = json.meshes![context.meshIndexMap.get(mesh)!]!.primitives[i]! as Extensions;
          if (!part || (Object.keys(part.data.json).length === 0 && !part.ownMaterial)) return;
          const own = part.ownMaterial && { ownMaterial: context.materialIndexMap.get(part.ownMaterial) };
          def.extensions = { ...def.extensions, [extensionName]: { ...part.data.json, ...own } };
        });
    }
    this.restore();
    this.written = [];
    this.views.clear();
    return this;
  }
}

function nameOf(node: Node, primitive: number): string {
  const name = node.getName() || node.getMesh()?.getName();
  return `primitive ${primitive} of ${name ? `"${name}"` : 'a node without a name'}`;
}

function padded(view: Uint8Array): Uint8Array {
  const out = new Uint8Array(Math.ceil(view.byteLength / 4) * 4);
  out.set(view);
  return out;
}

/** The values of a side; refuses what a transform has made of them. */
function checkedSide(accessor: Accessor, data: TransferData, name: string, vertices: number): Uint8Array {
  const values = accessor.getArray() as unknown;
  if (accessor.getName() !== data.fingerprint) fail(`${name} has receivers of another bake: documents were merged`);
  if (!(values instanceof Uint32Array))
    return fail(
      `${name} has receivers that were turned into other numbers (by dequantize(), say: leave ${accessorNames} out)`,
    );
  const size = data.surface === 'texels' ? 2 : 1;
  if (values.length !== size * vertices) fail(`${name} has ${vertices} vertices and ${values.length / size} receivers`);
  if (size === 1 && values.some((r) => r !== noReceiver && r >= data.receivers))
    fail(`${name} has a receiver out of range`);
  return bytesOf(values);
}
const accessorNames = Object.values(sideSemantics).join(' and ');
