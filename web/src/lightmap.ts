// Diffuse transfer over the texels of an atlas (docs/lightmaps.md): columns of harmonics, then of the scene's own
// lamps. Light is summed once into a half-float picture of the atlas, on the graphics card, when it changes; pixels
// look that up bilinearly. Directional lightmaps have several rows, one below the other, which pixels evaluate for the
// normal of the scene's normal map.
import {
  Color,
  DataTexture,
  Float32BufferAttribute,
  LinearFilter,
  MeshBasicMaterial,
  NearestFilter,
  RedIntegerFormat,
  UnsignedIntType,
  type BufferAttribute,
  type BufferGeometry,
  type DataArrayTexture,
  type InterleavedBufferAttribute,
  type Material,
  type Mesh,
  type Matrix3,
  type MeshStandardMaterial,
  type Texture,
  type WebGLProgramParametersWithUniforms,
} from 'three';
import { TransferValues, type BlockLayout } from './block_texture.js';
import { readStored, type StoredValues } from './clusters.js';
import { LambentError } from './errors.js';
import { isIndex, isViews } from './glb.js';
import {
  bandsOfLight,
  columnsOf,
  directionalRows,
  readHeader,
  readReceivers,
  shareGeometry,
  type Directional,
  type TransferHeader,
} from './header.js';
import type { BakedTransfer, TransferSource } from './kinds.js';
import type { Lighting, LightParts } from './lighting.js';
import { fragmentDeclarations, vertexBody, vertexDeclarations } from './lightmap_glsl.js';
import { afterAll, LightSum, LightSums, setPeaks } from './light_sum.js';
import {
  checkNodes,
  copyNodes,
  isNodeRenderer,
  setNodes,
  throughGlass,
  withoutNodes,
  type NodeEdition,
  type NodeSum,
  type Renderer,
} from './node_edition.js';
import { keepNormals } from './own_normals.js';
import { chainHooks, diffuseParameters, replaceOnce, useExitRadiance } from './prt_material.js';
import { drawFilter, type Drawn } from './see_through.js';
import { RestPose, TurnedSums, type TurnableLight } from './turned.js';

export const maxSide = 16384; // of an atlas; what a graphics card takes is less, mostly, and asked of it

/** A texture of the scene's own material, with the coordinates that it reads. */
interface Placed {
  texture: Texture;
  place: BufferAttribute | InterleavedBufferAttribute;
}
function placed(texture: Texture | null | undefined, geometry: BufferGeometry): Placed | undefined {
  const place = texture && geometry.getAttribute(texture.channel > 0 ? `uv${texture.channel}` : 'uv');
  if (!place) return undefined;
  texture.updateMatrix();
  return { texture, place };
}

/** What a part's surface adds to its lightmap. */
interface Surface {
  twoSided: boolean;
  emission: { value: Color };
  directional: Directional;
  normals?: Placed & { scale: number; tangents: boolean };
  emissive?: Placed;
}
/** Names the attributes that the shader reads, whichever set they are. */
function readSurface(
  geometry: BufferGeometry,
  own: Material & Partial<MeshStandardMaterial>,
  directional: Directional,
): Surface {
  const surface: Surface = {
    twoSided: geometry.hasAttribute('lambentPlaceBack'),
    emission: { value: new Color(0, 0, 0) },
    directional,
  };
  const normals = directional === 'none' ? undefined : placed(own.normalMap, geometry),
    emissive = placed(own.emissiveMap, geometry);
  if (normals) {
    geometry.setAttribute('lambentNormalPlace', normals.place);
    const tangents = geometry.hasAttribute('tangent');
    if (tangents) geometry.setAttribute('lambentTangent', geometry.getAttribute('tangent'));
    surface.normals = { ...normals, scale: own.normalScale?.x ?? 1, tangents };
  }
  if (emissive) {
    geometry.setAttribute('lambentEmissivePlace', emissive.place);
    surface.emissive = emissive;
  }
  return surface;
}

/** What is summed, and which texel is whose. */
interface AtlasValues {
  layout: BlockLayout;
  channels: 1 | 3;
  transfer: DataArrayTexture;
  receiversOf: DataTexture;
}

class LightmapMaterial extends MeshBasicMaterial {
  constructor(
    readonly atlas: TurnedSums<LightSums>,
    readonly values: AtlasValues,
    readonly directional: Directional,
    readonly surface: Surface,
    source: Material,
    readonly gain?: { value: number },
  ) {
    super(gain ? { side: source.side } : diffuseParameters(source));
    const { twoSided, normals, emissive } = surface,
      { layout, channels } = values;
    this.defines = {
      ...{ PRT_QUADS: layout.quads, PRT_TEXELS: layout.texels, PRT_COLUMNS: layout.columns, PRT_ROWS: layout.rows },
      PRT_CHANNELS: channels,
      PRT_ATLAS_ROWS: directionalRows[directional],
      ...(twoSided && { PRT_TWO_SIDED: '' }),
      ...(gain && { PRT_FALSE_COLOR: '' }),
      ...(directional !== 'none' && { PRT_DIRECTIONAL: '' }),
      ...(normals && { PRT_NORMAL_MAP: '' }),
      ...(normals?.tangents && { PRT_TANGENTS: '' }),
      ...(emissive && { PRT_EMISSIVE_MAP: '' }),
    };
    if (gain) this.toneMapped = false;
    chainHooks(
      this,
      (shader) => this.patch(shader),
      () => `lambent lightmap ${directional}`, // the rest is in the defines
    );
  }

  override clone(): this {
    const made = new LightmapMaterial(this.atlas, this.values, this.directional, this.surface, this, this.gain).copy(
      this,
    );
    copyNodes(this, made);
    return made as this;
  }

  override onBeforeRender(...drawn: Drawn): void {
    setPeaks(this, this.atlas.hasPeaks);
    this.atlas.update(drawn[0], drawn[4]);
    drawFilter(this, ...drawn);
  }

  private patch(shader: WebGLProgramParametersWithUniforms): void {
    const { emission, normals, emissive } = this.surface;
    Object.assign(
      shader.uniforms,
      {
        prtAtlas: this.atlas.rest,
        prtPeakAtlas: this.atlas.peaks,
        prtTurnBack: this.atlas.turnBack,
        prtEmission: emission,
        prtReceivers: { value: this.values.receiversOf },
      },
      this.atlas.instances?.uniforms(this.values.transfer),
      this.gain && { prtGain: this.gain },
      normals && {
        prtNormalMap: { value: normals.texture },
        prtNormalScale: { value: normals.scale },
        prtNormalTransform: { value: normals.texture.matrix },
      },
      emissive && {
        prtEmissiveMap: { value: emissive.texture },
        prtEmissiveTransform: { value: emissive.texture.matrix },
      },
    );
    shader.vertexShader =
      vertexDeclarations +
      replaceOnce(shader.vertexShader, '#include <fog_vertex>', '#include <fog_vertex>' + vertexBody);
    const isInstanced = (shader as { instancing?: boolean }).instancing === true;
    shader.fragmentShader = useExitRadiance(
      shader.fragmentShader,
      (isInstanced ? '#define USE_INSTANCING\n' : '') + fragmentDeclarations(this.directional),
      this.gain !== undefined,
    );
    if (!this.gain)
      shader.fragmentShader = replaceOnce(
        shader.fragmentShader,
        '#include <opaque_fragment>',
        'outgoingLight += prtEmitted();\n#include <opaque_fragment>',
      );
  }
}

class LightmapTransfer implements BakedTransfer {
  readonly kind = 'diffuse';
  readonly isDiffuse = true;
  readonly order: number;
  readonly columns: BakedTransfer['columns'];
  readonly channels: 1 | 3;
  readonly receivers: number;
  readonly fileBytes: number;
  readonly gpuBytes: number;
  readonly lamps = new Map<string, Color>();
  private readonly directional: Directional;
  private readonly values: TransferValues;
  readonly layout: BlockLayout;
  readonly transfer: DataArrayTexture;
  private readonly atlas: TurnedSums<LightSums>;
  private readonly materials: LightmapMaterial[] = [];
  private readonly ofCoefficients = new Set<TurnedSums<LightSums>>();
  private readonly sum: NodeSum | undefined; // for WebGPURenderer
  private readonly refusal: string | undefined; // why that does not draw this
  private readonly glow: { emission: { value: Color }; own: Color; lamp: string }[] = [];

  constructor(
    private readonly header: TransferHeader,
    { values, fileBytes }: StoredValues,
    readonly receiversOf: DataTexture,
    readonly meshes: Mesh[],
    owns: Material[],
    private readonly nodes?: NodeEdition,
    firstBands?: number,
  ) {
    this.order = bandsOfLight(header);
    this.columns = columnsOf(header);
    this.channels = header.channels;
    this.receivers = header.receivers;
    this.fileBytes = fileBytes;
    for (const name of header.groups) this.lamps.set(name, new Color(1, 1, 1));
    this.directional = header.directional;
    const rows = directionalRows[header.directional];
    this.values = new TransferValues(
      { ...header, count: header.columns, channels: rows * header.channels },
      values,
      firstBands,
    );
    const { layout, data, texture } = this.values;
    this.layout = layout;
    this.transfer = texture;
    const pose = new RestPose(meshes, true);
    this.atlas = this.makeAtlases(pose);
    const { width, height } = receiversOf.image;
    this.refusal = nodes ? undefined : withoutNodes;
    this.sum = this.makeNodes(pose);
    let gpuBytes = data.byteLength + this.atlas.main.rest.bytes + 4 * width * height + (this.sum?.bytes ?? 0);
    meshes.forEach((mesh, i) => {
      const own = owns[i]! as Material & Partial<MeshStandardMaterial>,
        surface = readSurface(mesh.geometry, own, header.directional);
      if (own.emissive)
        this.glow.push({
          emission: surface.emission,
          own: own.emissive.clone().multiplyScalar(own.emissiveIntensity ?? 1),
          lamp: own.name,
        });
      const material = new LightmapMaterial(this.atlas, this, header.directional, surface, own);
      keepNormals(own, material, own !== mesh.material && !mesh.geometry.hasAttribute('tangent'));
      material.vertexColors = mesh.geometry.hasAttribute('color');
      this.materials.push(material);
      setNodes(
        material,
        nodes && throughGlass(nodes, material, nodes.overAtlas(this.sum!, surface)),
        `The baked scene ${withoutNodes}.`,
      );
      mesh.material = material;
      gpuBytes += mesh.geometry.getAttribute('position').count * (surface.twoSided ? 16 : 8);
    });
    this.gpuBytes = gpuBytes;
  }

  private makeNodes(pose: RestPose): NodeSum | undefined {
    const { layout, transfer, channels, receivers, receiversOf, header } = this,
      { order } = header,
      rows = directionalRows[this.directional];
    return this.nodes?.sum({
      ...{ layout, transfer, channels, receivers, order, pose, rows, receiversOf },
      apart: !this.eachIsLight,
    });
  }
  private makeAtlases(pose?: RestPose): TurnedSums<LightSums> {
    return new TurnedSums(
      () => new LightSums(() => this.makeAtlas(), this.eachIsLight),
      this.header.order,
      pose,
      this.layout.quads,
    );
  }
  private get eachIsLight(): boolean {
    return this.directional === 'none' || this.directional === 'hl2';
  }

  /** Exit radiance of white at every texel, under one light. */
  private makeAtlas(): LightSum {
    const { width, height } = this.receiversOf.image,
      rows = directionalRows[this.directional];
    return new LightSum({
      layout: this.layout,
      channels: this.channels,
      transfer: this.transfer,
      width,
      height: rows * height,
      filter: LinearFilter,
      uniforms: { prtReceivers: { value: this.receiversOf } },
      what: { size: 'has an atlas', use: 'is a lightmap' },
      pick: `
uniform highp usampler2D prtReceivers;
uint prtPick( const in ivec2 texel, out int row ) {
  row = texel.y / ${height};
  return texelFetch( prtReceivers, ivec2( texel.x, texel.y % ${height} ), 0 ).r;
}`,
    });
  }

  check(renderer: Renderer): void {
    if (isNodeRenderer(renderer)) return checkNodes(renderer, this.refusal);
    this.atlas.main.rest.check(renderer);
  }

  relight(lighting: Lighting): void {
    const lamps = [...this.lamps];
    // The scene's own lamps are in none of the peaks.
    const own = lamps.flatMap(([, color]) => color.toArray()),
      withOwn = ({ rest, peaks }: LightParts): { rest: number[]; peaks: number[] | undefined } => ({
        rest: [...rest, ...own],
        peaks: peaks && [...peaks, ...own.map(() => 0)],
      });
    const parts = lighting.of(this.header, false, this.firstBands),
      { rest, peaks } = withOwn(parts),
      turned = parts.turned && ((turn: Matrix3): TurnableLight => withOwn(parts.turned!(turn)));
    this.atlas.set(rest, peaks, turned);
    this.sum?.set(rest, peaks, this.eachIsLight, turned);
    // One column is of all lamps together; else materials that glow have one of their name.
    for (const { emission, own, lamp } of this.glow) {
      const scale = lamps.length === 1 ? lamps[0]![1] : this.lamps.get(lamp);
      if (scale) emission.value.copy(own).multiply(scale);
      else emission.value.setRGB(0, 0, 0);
    }
  }

  get firstBands(): number | undefined {
    return this.values.firstBands;
  }
  refine(values: ArrayBuffer): void {
    this.values.refine(values);
  }

  coefficientMaterials(index: number, gain: { value: number }): Material[] {
    const atlas = this.makeAtlases(),
      light = new Float64Array(3 * this.header.columns).fill(1, 3 * index, 3 * index + 3),
      { nodes } = this,
      sum = this.makeNodes(new RestPose([]));
    atlas.set(light, undefined);
    sum?.set(light, undefined, false);
    this.ofCoefficients.add(atlas);
    const made = this.meshes.map(
      (_, i) =>
        new LightmapMaterial(
          atlas,
          this,
          this.directional,
          { ...this.materials[i]!.surface, emission: { value: new Color(0, 0, 0) } },
          this.materials[i]!,
          gain,
        ),
    );
    made.forEach((material) =>
      setNodes(material, nodes?.falseColor(nodes.overAtlas(sum!, material.surface), gain), `The view ${withoutNodes}.`),
    );
    afterAll(made, () => (this.ofCoefficients.delete(atlas), atlas.dispose(), sum?.dispose()));
    return made;
  }

  dispose(): void {
    for (const atlas of [this.atlas, ...this.ofCoefficients]) atlas.dispose();
    this.transfer.dispose();
    this.sum?.dispose();
    this.receiversOf.dispose();
    for (const material of this.materials) material.dispose();
    for (const mesh of this.meshes) mesh.geometry.dispose();
  }
}

/** Two floats a vertex, in texels. */
async function readPlaces(source: TransferSource, view: unknown, vertices: number): Promise<Float32BufferAttribute> {
  if (!isViews(view)) throw new LambentError('a part has no buffer view of places in the atlas');
  const bytes = await source.bufferView(view);
  if (bytes.byteLength !== 8 * vertices) throw new LambentError('a part does not have one place in the atlas a vertex');
  const places = new Float32Array(bytes);
  for (const x of places)
    if (!Number.isFinite(x)) throw new LambentError('a place in the atlas is not a finite number');
  return new Float32BufferAttribute(places, 2);
}

/** Meshes of parts over an atlas, with a place in it at each vertex, on one side or both. */
export async function readPlacedMeshes(source: TransferSource): Promise<Mesh[]> {
  const meshes: Mesh[] = [];
  for (const part of source.extension.parts) {
    const mesh = source.mesh(part),
      geometry = shareGeometry(mesh.geometry),
      vertices = geometry.getAttribute('position').count;
    geometry.setAttribute('lambentPlace', await readPlaces(source, part.front, vertices));
    if (part.back !== undefined)
      geometry.setAttribute('lambentPlaceBack', await readPlaces(source, part.back, vertices));
    mesh.geometry = geometry;
    meshes.push(mesh);
  }
  return meshes;
}

export async function loadLightmap(source: TransferSource): Promise<BakedTransfer> {
  const { extension } = source,
    header = readHeader(extension, 'texels');
  const { width, height, texels } = extension.surface!;
  if (!isIndex(width, maxSide) || !isIndex(height, maxSide) || width < 1 || height < 1)
    throw new LambentError('the size of the atlas is out of range');
  const map = await readReceivers(
    source,
    texels,
    width * height,
    header.receivers,
    'the atlas does not have one receiver a texel',
  );
  const receivers = new DataTexture(map, width, height, RedIntegerFormat, UnsignedIntType);
  receivers.internalFormat = 'R32UI';
  receivers.minFilter = receivers.magFilter = NearestFilter;
  receivers.needsUpdate = true;
  const rows = directionalRows[header.directional],
    values = await readStored(source, header, rows * header.channels * header.columns),
    meshes = await readPlacedMeshes(source),
    owns: Material[] = [];
  for (const part of extension.parts) owns.push(await source.ownMaterial(part));
  return new LightmapTransfer(header, values, receivers, meshes, owns, source.nodes, source.firstBands);
}
