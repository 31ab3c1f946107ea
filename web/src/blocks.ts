// Visibility in blocks (docs/blocks.md; docs/file-format.md, kind "blocks"): sharp shadows of light that turns, of
// materials that change. Records lie as they are in a texture. What a surface scatters evenly is drawn into a picture,
// a texel a receiver, when the light changes (block_sum.ts: where the card is a program, summed by this one); what its
// lobe reflects into another one, when the light, the eye or the material does. Meshes look both up.
//
// Budget: the file's bytes, 32 a receiver for its place and normal, 16 for each picture; of the light 48 bytes a texel
// of the cube, 32 more and 768 a block where materials shine.
import {
  DataArrayTexture,
  DataTexture,
  FloatType,
  MeshBasicMaterial,
  NearestFilter,
  RedIntegerFormat,
  RGBAFormat,
  UnsignedIntType,
  Vector3,
  type IUniform,
  type Material,
  type Mesh,
  type Texture,
  type WebGLRenderer,
  type WebGLProgramParametersWithUniforms,
} from 'three';
import { isSoftware, sumBlocks, type BlockSumOptions } from './block_sum.js';
import { BlockLight, widestBlock } from './block_light.js';
import { placeReceivers } from './block_places.js';
import { blockTolerance, diffuseOf, lobeOf, samplesOf, type Reflection } from './block_reflection.js';
import { wordColumns, diffuseShader, glossShader, pictureColumns } from './block_shader.js';
import { checkRecords, recordBegins } from './block_records.js';
import { blockSide, cubeBlocks, maxCube } from './cube.js';
import { LambentError } from './errors.js';
import { isIndex, isViews } from './glb.js';
import { noReceiver } from './header.js';
import type { BakedTransfer, TransferKind, TransferSource } from './kinds.js';
import type { Lighting } from './lighting.js';
import { DrawnPicture } from './light_sum.js';
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
  even: EvenPicture;
  gloss: DrawnPicture;
  light: BlockLight;
  reflection: { value: Reflection };
  eye: Vector3;
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
    const [renderer, , camera] = drawn,
      { even, gloss, reflection, eye } = this.shared,
      shines = reflection.value.model !== 'diffuse';
    even.update(renderer);
    if (shines) {
      const now = new Vector3().setFromMatrixPosition(camera.matrixWorld);
      if (!now.equals(eye)) {
        eye.copy(now);
        gloss.refresh();
      }
      gloss.update(renderer);
    }
    const defines = (this.defines ??= {});
    if ('PRT_SHINES' in defines !== shines) {
      if (shines) defines['PRT_SHINES'] = '';
      else delete defines['PRT_SHINES'];
      this.needsUpdate = true;
    }
    drawFilter(this, ...drawn);
  }

  private patch(shader: WebGLProgramParametersWithUniforms): void {
    const { even, gloss, share } = this.shared;
    Object.assign(shader.uniforms, { prtEven: even.shown, prtShine: { value: gloss.target.texture }, prtShare: share });
    shader.vertexShader =
      vertexDeclarations +
      replaceOnce(shader.vertexShader, '#include <fog_vertex>', '#include <fog_vertex>' + vertexBody);
    shader.fragmentShader = useExitRadiance(shader.fragmentShader, glossFragmentDeclarations, false, true);
  }
}

/** A picture of receivers. */
class ReceiverPicture extends DrawnPicture {
  constructor(
    receivers: number,
    fragmentShader: string,
    defines: Record<string, number>,
    uniforms: Record<string, IUniform>,
  ) {
    super(
      Math.min(pictureColumns, receivers),
      Math.ceil(receivers / pictureColumns),
      NearestFilter,
      { size: `has ${receivers.toLocaleString('en')} receivers, which take a texture`, use: 'is shaded' },
      { fragmentShader, defines, uniforms },
      true,
    );
  }
  /** Compiles it with others. */
  define(defines: Record<string, number>): void {
    Object.assign((this.material.defines ??= {}), defines);
    this.material.needsUpdate = true;
  }
}

/** Exit radiance of white: drawn by the graphics card, or summed by the processor. */
class EvenPicture {
  /** What there is now. */
  readonly shown: { value: Texture };
  private table: DataTexture | undefined;
  private isStale = true;

  constructor(
    readonly drawn: ReceiverPicture,
    private readonly options: BlockSumOptions,
  ) {
    this.shown = { value: drawn.target.texture };
  }

  get bytes(): number {
    return this.drawn.bytes;
  }
  refresh(): void {
    this.isStale = true;
    this.drawn.refresh();
  }
  update(renderer: WebGLRenderer): void {
    if (!isSoftware(renderer) && this.drawn.isDrawnBy(renderer)) return this.drawn.update(renderer);
    const { width, height } = this.drawn.target;
    if (!this.table) {
      this.table = new DataTexture(new Float32Array(4 * width * height), width, height, RGBAFormat, FloatType);
      this.shown.value = this.table;
    }
    if (!this.isStale) return;
    this.isStale = false;
    sumBlocks(this.options, this.table.image.data as Float32Array);
    this.table.needsUpdate = true;
  }
  dispose(): void {
    this.drawn.dispose();
    this.table?.dispose();
  }
}

interface Header {
  cube: number;
  bits: number;
  receivers: number;
}

class BlocksTransfer implements BakedTransfer {
  readonly kind = 'blocks';
  readonly order = 0;
  readonly channels = 1;
  readonly receivers: number;
  readonly fileBytes: number;
  private readonly sight: DataArrayTexture;
  private readonly places: DataTexture;
  private readonly light: BlockLight;
  private readonly gloss: ReceiverPicture;
  private readonly shared: Shared;
  private readonly widest: number;
  private readonly lobe = { colour: { value: 0 }, width: { value: 1 }, samples: { value: new Vector3() } };
  private readonly materials = new Map<string, BlocksMaterial>();
  private readonly vertexBytes: number;

  private readonly nodes: NodeBlocks | undefined; // for WebGPURenderer
  /** Why WebGPURenderer does not draw this. */
  private readonly refusal: string | undefined;

  constructor(
    { cube, bits, receivers }: Header,
    records: Uint8Array,
    begins: Float64Array,
    readonly meshes: Mesh[],
    nodes?: NodeEdition,
  ) {
    this.receivers = receivers;
    this.fileBytes = records.byteLength;
    this.sight = recordTexture(records);
    this.places = placeReceivers(meshes, receivers, begins);
    this.light = new BlockLight(cube);
    this.widest = widestBlock(cube);
    const defines = {
      PRT_BITS: bits,
      PRT_CUBE: cube,
      PRT_BLOCKS: cubeBlocks(cube),
      PRT_FLAG_BYTES: flagBytes(cube),
      PRT_RECEIVERS: receivers,
      PRT_MODEL: 0,
      PRT_TOLERANCE: blockTolerance,
    };
    const { sums, coarse, texels } = this.light,
      uniforms = { prtSight: { value: this.sight }, prtReceivers: { value: this.places }, prtBlockSums: sums },
      eye = new Vector3(Infinity, 0, 0);
    const diffuse = new ReceiverPicture(receivers, diffuseShader, defines, uniforms);
    this.gloss = new ReceiverPicture(
      receivers,
      glossShader,
      { ...defines },
      {
        ...uniforms,
        prtCoarse: coarse,
        prtBlockTexels: texels,
        prtEye: { value: eye },
        prtColour: this.lobe.colour,
        prtWidth: this.lobe.width,
        prtSamples: this.lobe.samples,
      },
    );
    const reflection: Shared['reflection'] = { value: { model: 'diffuse' } };
    const even = new EvenPicture(diffuse, {
      records,
      places: this.places.image.data as Float32Array,
      begins,
      sums: sums.value.image.data as Float32Array,
      cube,
      bits,
    });
    this.shared = { even, gloss: this.gloss, light: this.light, reflection, eye, share: { value: 1 } };
    const { sight, places, light } = this;
    this.nodes = nodes?.blocks({ sight, places, light, cube, bits, receivers });
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
    const { sight, places, light, shared, gloss } = this,
      bytes = (of: DataArrayTexture | DataTexture): number => (of.image.data as Uint8Array | Float32Array).byteLength;
    return (
      bytes(sight) +
      bytes(places) +
      light.bytes +
      shared.even.bytes +
      (this.reflection.model === 'diffuse' ? 0 : gloss.bytes) +
      (this.nodes?.bytes ?? 0) +
      this.vertexBytes
    );
  }

  get reflection(): Reflection {
    return this.shared.reflection.value;
  }
  set reflection(value: Reflection) {
    const { shared, lobe, gloss } = this;
    shared.reflection.value = value;
    shared.share.value = diffuseOf(value);
    if (value.model === 'diffuse') {
      this.nodes?.setLobe(0, 1, lobe);
      return;
    }
    this.light.gloss();
    const { colour, width } = lobeOf(value),
      { one, nodes, all } = samplesOf(value, this.widest);
    lobe.colour.value = colour;
    lobe.width.value = width;
    lobe.samples.value.set(one, nodes, all);
    const model = value.model === 'phong' ? 1 : 2;
    gloss.define({ PRT_MODEL: model });
    gloss.refresh();
    this.nodes?.setLobe(model, shared.share.value, lobe);
  }

  check(renderer: Renderer): void {
    if (isNodeRenderer(renderer)) return checkNodes(renderer, this.refusal);
    this.shared.even.drawn.checkSize(renderer);
    if (this.reflection.model !== 'diffuse') this.gloss.check(renderer);
    const { maxTextureSize, maxVertexTextures } = renderer.capabilities,
      { width, height } = this.light.sums.value.image,
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
    this.light.set(lighting.onCube(this.light.size));
    this.shared.even.refresh();
    this.gloss.refresh();
    this.nodes?.refresh();
  }

  dispose(): void {
    this.nodes?.dispose();
    this.sight.dispose();
    this.places.dispose();
    this.light.dispose();
    this.shared.even.dispose();
    this.gloss.dispose();
    for (const material of this.materials.values()) material.dispose();
    for (const mesh of this.meshes) mesh.geometry.dispose();
  }
}

const flagBytes = (cube: number): number => Math.ceil(cubeBlocks(cube) / 4);

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
