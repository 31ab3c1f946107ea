// Visibility in blocks (docs/blocks.md; docs/file-format.md, kind "blocks"): sharp shadows of light that turns, of
// materials that change. Records lie as they are in a texture. What a surface scatters evenly is drawn into a picture,
// a texel a receiver, when the light changes (block_sum.ts: where the card is a program, summed by this one); what its
// lobe reflects into another one, when the light, the eye or the material does. Meshes look both up.
//
// Budget: the file's bytes, 32 a receiver for its place and normal, 16 for each picture; of the light 48 bytes a texel
// of the cube, 32 more and 3,840 a block where materials shine.
import {
  DataArrayTexture,
  DataTexture,
  MeshBasicMaterial,
  NearestFilter,
  RedIntegerFormat,
  UnsignedIntType,
  Vector4,
  type Material,
  type Mesh,
  type WebGLProgramParametersWithUniforms,
} from 'three';
import { widestBlock } from './block_light.js';
import { placeReceivers } from './block_places.js';
import { diffuseOf, lobeOf, samplesOf, type Reflection } from './block_reflection.js';
import { BlockShading, type BlocksHeader } from './block_shading.js';
import { wordColumns, pictureColumns } from './block_shader.js';
import { checkRecords, recordBegins } from './block_records.js';
import { blockSide, cubeBlocks, maxCube } from './cube.js';
import { LambentError } from './errors.js';
import { isIndex, isViews } from './glb.js';
import { noReceiver } from './header.js';
import type { BakedTransfer, TransferKind, TransferSource } from './kinds.js';
import type { Lighting } from './lighting.js';
import {
  checkNodes,
  copyNodes,
  isNodeRenderer,
  setNodes,
  throughGlass,
  withoutNodes,
  type NodeBlocks,
  type NodeEdition,
  type Renderer,
} from './node_edition.js';
import { glossFragmentDeclarations, glossVaryings } from './outgoing.js';
import { chainHooks, diffuseParameters, replaceOnce, useExitRadiance } from './prt_material.js';
import { drawFilter, type Drawn } from './see_through.js';
import { bindPart } from './vertex_transfer.js';

/** What all meshes of one file share. */
interface Shared {
  shading: BlockShading;
  reflection: { value: Reflection };
  share: { value: number };
}

const vertexDeclarations = /* glsl */ `
attribute uint lambentReceiver;
varying vec3 vPrtFront;
#ifdef PRT_TWO_SIDED
  attribute uint lambentReceiverBack;
  varying vec3 vPrtBack;
#endif
${glossVaryings}
uniform highp sampler2D prtEven;
uniform highp sampler2D prtShine;
uniform float prtShare;
void prtLookUp( const in uint receiver, out vec3 even, out vec3 shine ) {
  even = shine = vec3( 0.0 );
  if ( receiver == 0xffffffffu ) return;
  ivec2 at = ivec2( int( receiver ) % ${pictureColumns}, int( receiver ) / ${pictureColumns} );
  even = prtShare * texelFetch( prtEven, at, 0 ).rgb;
  #ifdef PRT_SHINES
    shine = texelFetch( prtShine, at, 0 ).rgb;
  #endif
}
`;
const vertexBody = /* glsl */ `
  prtLookUp( lambentReceiver, vPrtFront, vPrtGloss );
  #ifdef PRT_TWO_SIDED
    prtLookUp( lambentReceiverBack, vPrtBack, vPrtBackGloss );
  #endif
`;

class BlocksMaterial extends MeshBasicMaterial {
  constructor(
    readonly shared: Shared,
    readonly twoSided: boolean,
    parameters: ReturnType<typeof diffuseParameters> = {},
  ) {
    super(parameters);
    this.defines = twoSided ? { PRT_TWO_SIDED: '' } : {};
    chainHooks(
      this,
      (shader) => this.patch(shader),
      () => 'lambent blocks',
    );
  }

  override clone(): this {
    const made = new BlocksMaterial(this.shared, this.twoSided).copy(this);
    copyNodes(this, made);
    return made as this;
  }

  override onBeforeRender(...drawn: Drawn): void {
    const [renderer, , camera, , object] = drawn,
      { shading, reflection } = this.shared,
      shines = reflection.value.model !== 'diffuse';
    shading.update(renderer, camera, object);
    const defines = (this.defines ??= {});
    if ('PRT_SHINES' in defines !== shines) {
      if (shines) defines['PRT_SHINES'] = '';
      else delete defines['PRT_SHINES'];
      this.needsUpdate = true;
    }
    drawFilter(this, ...drawn);
  }

  private patch(shader: WebGLProgramParametersWithUniforms): void {
    const { shading, share } = this.shared;
    Object.assign(shader.uniforms, { prtEven: shading.even, prtShine: shading.shine, prtShare: share });
    shader.vertexShader =
      vertexDeclarations +
      replaceOnce(shader.vertexShader, '#include <fog_vertex>', '#include <fog_vertex>' + vertexBody);
    shader.fragmentShader = useExitRadiance(shader.fragmentShader, glossFragmentDeclarations, false, true);
  }
}

class BlocksTransfer implements BakedTransfer {
  readonly kind = 'blocks';
  readonly order = 0;
  readonly channels = 1;
  readonly receivers: number;
  readonly fileBytes: number;
  private readonly sight: DataArrayTexture;
  private readonly places: DataTexture;
  private readonly shading: BlockShading;
  private readonly shared: Shared;
  private readonly widest: number;
  private readonly lobe = { colour: { value: 0 }, width: { value: 1 }, samples: { value: new Vector4() } };
  private readonly materials = new Map<string, BlocksMaterial>();
  private readonly vertexBytes: number;

  private readonly nodes: NodeBlocks | undefined; // for WebGPURenderer
  /** Why WebGPURenderer does not draw this. */
  private readonly refusal: string | undefined;

  constructor(
    { cube, bits, receivers }: BlocksHeader,
    records: Uint8Array,
    begins: Float64Array,
    readonly meshes: Mesh[],
    nodes?: NodeEdition,
  ) {
    this.receivers = receivers;
    this.fileBytes = records.byteLength;
    this.sight = recordTexture(records);
    this.places = placeReceivers(meshes, receivers, begins);
    this.widest = widestBlock(cube);
    const { sight, places, lobe } = this,
      header = { cube, bits, receivers };
    this.shading = new BlockShading({ header, records, begins, sight, places, lobe }, meshes);
    this.shared = { shading: this.shading, reflection: { value: { model: 'diffuse' } }, share: { value: 1 } };
    this.nodes = nodes?.blocks({ sight, places, standing: (o) => this.shading.standing(o), ...header });
    this.refusal = nodes ? undefined : withoutNodes;
    let vertexBytes = 0;
    for (const mesh of meshes) {
      const twoSided = mesh.geometry.hasAttribute('lambentReceiverBack'),
        source = mesh.material as Material,
        key = `${source.uuid} ${twoSided}`;
      vertexBytes += mesh.geometry.getAttribute('position').count * (twoSided ? 8 : 4);
      const material = this.materials.get(key) ?? new BlocksMaterial(this.shared, twoSided, diffuseParameters(source));
      this.materials.set(key, material);
      setNodes(
        material,
        nodes && throughGlass(nodes, material, { colorNode: this.nodes!.atVertices(twoSided) }),
        `The baked scene ${this.refusal}.`,
      );
      mesh.material = material;
    }
    this.vertexBytes = vertexBytes;
  }

  get gpuBytes(): number {
    const { sight, places } = this,
      { light, even, gloss } = this.shading.main,
      bytes = (of: DataArrayTexture | DataTexture): number => (of.image.data as Uint8Array | Float32Array).byteLength;
    return (
      bytes(sight) +
      bytes(places) +
      light.bytes +
      even.bytes +
      (this.reflection.model === 'diffuse' ? 0 : gloss.bytes) +
      (this.nodes?.bytes ?? 0) +
      this.vertexBytes
    );
  }

  get reflection(): Reflection {
    return this.shared.reflection.value;
  }
  set reflection(value: Reflection) {
    const { shared, lobe } = this;
    shared.reflection.value = value;
    shared.share.value = diffuseOf(value);
    if (value.model === 'diffuse') {
      this.shading.setModel(0);
      this.nodes?.setLobe(0, 1, lobe);
      return;
    }
    const { colour, width } = lobeOf(value),
      { one, nodes, fine, all } = samplesOf(value, this.widest);
    lobe.colour.value = colour;
    lobe.width.value = width;
    lobe.samples.value.set(one, nodes, fine, all);
    const model = value.model === 'phong' ? 1 : 2;
    this.shading.setModel(model);
    this.nodes?.setLobe(model, shared.share.value, lobe);
  }

  check(renderer: Renderer): void {
    if (isNodeRenderer(renderer)) return checkNodes(renderer, this.refusal);
    const { light, even, gloss } = this.shading.main;
    even.drawn.checkSize(renderer);
    if (this.reflection.model !== 'diffuse') gloss.check(renderer);
    const { maxTextureSize, maxVertexTextures } = renderer.capabilities,
      { width, height } = light.sums.value.image,
      most = Math.max(width, height, wordColumns, this.places.image.height);
    if (maxTextureSize < most)
      throw new LambentError(`takes textures of ${most} texels a side; this graphics card has ${maxTextureSize}`);
    const wanted = Math.max(
      ...this.meshes.map(
        (mesh) => 2 + Number('isSkinnedMesh' in mesh) + Number(Object.keys(mesh.geometry.morphAttributes).length > 0),
      ),
    );
    if (maxVertexTextures < wanted)
      throw new LambentError(
        `is looked up in vertex shaders, which must read textures, ${wanted} at once; ` +
          `this graphics card reads ${maxVertexTextures} there`,
      );
  }

  relight(lighting: Lighting): void {
    this.shading.set(lighting.cubes(this.shading.main.light.size));
  }

  dispose(): void {
    this.nodes?.dispose();
    this.sight.dispose();
    this.places.dispose();
    this.shading.dispose();
    for (const material of this.materials.values()) material.dispose();
    for (const mesh of this.meshes) mesh.geometry.dispose();
  }
}

/** Records as they are in the file, four bytes a word. */
function recordTexture(records: Uint8Array): DataArrayTexture {
  const rows = Math.ceil(records.length / (4 * wordColumns)),
    height = Math.min(rows, 2048),
    layers = Math.ceil(rows / height);
  if (layers > 256)
    throw new LambentError(`holds ${records.length.toLocaleString('en')} bytes of visibility, more than textures hold`);
  const words = new Uint32Array(wordColumns * height * layers);
  new Uint8Array(words.buffer).set(records);
  const made = new DataArrayTexture(words, wordColumns, height, layers);
  made.name = 'lambent visibility';
  made.format = RedIntegerFormat;
  made.type = UnsignedIntType;
  made.minFilter = made.magFilter = NearestFilter;
  made.generateMipmaps = false;
  made.needsUpdate = true;
  return made;
}

async function load(source: TransferSource): Promise<BakedTransfer> {
  const { cube, bits, receivers, bufferView, lengths } = source.extension.transfer;
  if (!isIndex(cube, maxCube) || cube < blockSide || cube % blockSide !== 0)
    throw new LambentError('"cube" is no multiple of 16 up to 256');
  if (!isIndex(bits, 8) || bits < 1) throw new LambentError('"bits" is out of range');
  if (!isIndex(receivers, noReceiver - 1) || receivers < 1) throw new LambentError('"receivers" is out of range');
  if (!isViews(bufferView) || !isViews(lengths)) throw new LambentError('"bufferView" or "lengths" is missing');
  const records = new Uint8Array(await source.bufferView(bufferView)),
    begins = recordBegins(new Uint8Array(await source.bufferView(lengths)), receivers, records.length);
  checkRecords(records, begins, cubeBlocks(cube), bits);
  const meshes = await Promise.all(source.extension.parts.map((part) => bindPart(source, part, receivers)));
  return new BlocksTransfer({ cube, bits, receivers }, records, begins, meshes, source.nodes);
}

export const blocksKind: TransferKind = { name: 'blocks', load };
