// Diffuse transfer in Haar wavelets (docs/wavelets.md; docs/file-format.md, kind "wavelets"): sparse columns, which the
// processor sums into a texture for those terms of the light that change most; meshes look that up.
//
// Budget: in memory the file's bytes, 4 a column and chunk of 4,096 receivers, 16 a column; on the graphics card 16
// bytes a receiver or texel of an atlas, 4 a vertex (8 where surfaces have two sides).
import type { Color, Material, Mesh } from 'three';
import { maxCube } from './cube.js';
import { LambentError } from './errors.js';
import { isIndex, isViews } from './glb.js';
import { readFixedView, type FixedPicture, type FixedView } from './fixed_view.js';
import { HaarColumns, type HaarHeader } from './haar.js';
import { HaarSums, type Atlas } from './haar_sums.js';
import { noReceiver, readReceivers } from './header.js';
import { axesOf, isDrawn, type BakedTransfer, type TransferKind, type TransferSource } from './kinds.js';
import type { Lighting } from './lighting.js';
import { maxSide, readPlacedMeshes } from './lightmap.js';
import { checkNodes, isNodeRenderer, setNodes, throughGlass, withoutNodes, type Renderer } from './node_edition.js';
import { keepNormals } from './own_normals.js';
import { ShownMaterial, type ShownOver } from './shown_material.js';
import { RestPose } from './turned.js';
import { bindPart } from './vertex_transfer.js';

/** Of columns that are summed while a hand turns the light: what fits a frame. */
const quickBytes = 4e6;

/** Where receivers lie, and the meshes that show them. */
interface Placed {
  meshes: Mesh[];
  owns: Material[];
  atlas?: Atlas;
  view?: FixedPicture;
}

class WaveletTransfer implements BakedTransfer {
  readonly kind = 'wavelets';
  readonly order = 0;
  readonly channels: 1 | 3;
  readonly receivers: number;
  readonly fileBytes: number;
  readonly gpuBytes: number;
  readonly isDiffuse: boolean;
  readonly view?: FixedView;
  readonly meshes: Mesh[];
  readonly lamps?: Map<string, Color>;
  terms = 0;
  private readonly sums: HaarSums;
  private readonly materials: ShownMaterial[] = [];
  private readonly refusal: string | undefined;

  constructor(
    private readonly stored: HaarColumns,
    fileBytes: number,
    { meshes, owns, atlas, view }: Placed,
    { nodes }: TransferSource,
  ) {
    this.channels = stored.channels;
    this.receivers = stored.receivers;
    this.fileBytes = fileBytes;
    this.meshes = meshes;
    this.isDiffuse = view === undefined;
    if (view) this.view = view.view;
    const sums = (this.sums = new HaarSums(stored, atlas, new RestPose(view ? [] : meshes))),
      { width, height } = sums.size;
    this.refusal = nodes ? undefined : withoutNodes;
    let gpuBytes = 16 * width * height;
    meshes.forEach((mesh, i) => {
      const own = owns[i]!,
        { geometry } = mesh,
        twoSided = geometry.hasAttribute(atlas ? 'lambentPlaceBack' : 'lambentReceiverBack'),
        over: ShownOver =
          view?.over ?? (atlas ? { at: 'texels', twoSided, width, height } : { at: 'vertices', twoSided }),
        material = new ShownMaterial(sums, over, own);
      gpuBytes += geometry.getAttribute('position').count * (atlas ? 8 : 4) * (twoSided ? 2 : 1);
      keepNormals(own, material, own !== mesh.material && !geometry.hasAttribute('tangent'));
      if (atlas) material.vertexColors = geometry.hasAttribute('color');
      setNodes(
        material,
        nodes && throughGlass(nodes, material, nodes.shown({ first: sums.main.texture, of: (o) => sums.of(o) }, over)),
        `The baked scene ${withoutNodes}.`,
      );
      this.materials.push(material);
      mesh.material = material;
    });
    this.gpuBytes = gpuBytes;
  }

  check(renderer: Renderer): void {
    if (isNodeRenderer(renderer)) return checkNodes(renderer, this.refusal);
    const { maxTextureSize, maxVertexTextures } = renderer.capabilities,
      { width, height } = this.sums.size;
    if (Math.max(width, height) > maxTextureSize)
      throw new LambentError(
        `has ${this.receivers.toLocaleString('en')} receivers, which take a texture of ${width} x ${height} texels, ` +
          `where this graphics card takes ${maxTextureSize}`,
      );
    const wanted = Math.max(
      ...this.meshes.map(
        (mesh) =>
          Number(mesh.geometry.hasAttribute('lambentReceiver')) +
          Number('isSkinnedMesh' in mesh) +
          Number(Object.keys(mesh.geometry.morphAttributes).length > 0),
      ),
    );
    if (maxVertexTextures < wanted)
      throw new LambentError(
        `is looked up in vertex shaders, which must read textures, ${wanted} at once; ` +
          `this graphics card reads ${maxVertexTextures} there`,
      );
  }

  relight(lighting: Lighting): void {
    this.sums.set(lighting.cubes(this.stored.size), this.terms, lighting.quick ? quickBytes : Infinity);
  }

  dispose(): void {
    this.sums.dispose();
    for (const material of this.materials) material.dispose();
    for (const mesh of this.meshes) mesh.geometry.dispose();
  }
}

function readHeader({ cube, channels = 1, receivers }: Record<string, unknown>): HaarHeader {
  if (!isIndex(cube, maxCube) || cube < 16 || (cube & (cube - 1)) !== 0)
    throw new LambentError('"cube" must be 16, 32, 64, 128 or 256');
  if (channels !== 1 && channels !== 3) throw new LambentError('"channels" must be 1 or 3');
  if (!isIndex(receivers, noReceiver - 1) || receivers < 1) throw new LambentError('"receivers" is out of range');
  return { size: cube, channels, receivers };
}

async function readAtlas(source: TransferSource, receivers: number): Promise<Atlas> {
  const { width, height, texels } = source.extension.surface!;
  if (!isIndex(width, maxSide) || !isIndex(height, maxSide) || width < 1 || height < 1)
    throw new LambentError('the size of the atlas is out of range');
  const message = 'the atlas does not have one receiver a texel';
  return { width, height, map: await readReceivers(source, texels, width * height, receivers, message) };
}

async function place(source: TransferSource, receivers: number): Promise<Placed> {
  const { extension } = source;
  if (extension.view !== undefined) {
    const view = await readFixedView(source, receivers);
    return { meshes: [view.mesh], owns: [view.mesh.material as Material], view };
  }
  const atlas = extension.surface?.kind === 'texels' ? await readAtlas(source, receivers) : undefined,
    meshes = atlas
      ? await readPlacedMeshes(source)
      : await Promise.all(extension.parts.map((part) => bindPart(source, part, receivers))),
    owns: Material[] = [];
  for (const part of extension.parts)
    owns.push(atlas ? await source.ownMaterial(part) : (source.mesh(part).material as Material));
  return { meshes, owns, ...(atlas && { atlas }) };
}

async function load(source: TransferSource): Promise<BakedTransfer> {
  const { extension } = source,
    { bufferView, lengths, steps } = extension.transfer;
  if (!isDrawn(extension))
    throw new LambentError(
      `holds ${axesOf(extension).join(', ')}, which this version does not draw; "lambent render" does`,
    );
  const header = readHeader(extension.transfer);
  if (!isViews(bufferView) || !isViews(lengths) || !isViews(steps))
    throw new LambentError('"bufferView", "lengths" or "steps" is missing');
  const [data, counts, sizes] = [
    await source.bufferView(bufferView),
    await source.bufferView(lengths),
    await source.bufferView(steps),
  ];
  if (sizes.byteLength % 4 !== 0) throw new LambentError('"steps" does not hold floats');
  const columns = new HaarColumns(header, new Uint8Array(data), new Uint8Array(counts), new Float32Array(sizes));
  return new WaveletTransfer(columns, data.byteLength, await place(source, header.receivers), source);
}

export const waveletsKind: TransferKind = { name: 'wavelets', load };
