// Visibility in blocks (docs/blocks.md; docs/file-format.md, kind "blocks"): sharp shadows of light that turns, of
// materials that change. Records lie as they are in a texture. What a surface scatters evenly is drawn into a
// picture, a texel a receiver, when the light changes; what its lobe reflects into another one, when the light, the eye
// or the material does. Meshes look both up.
//
// Budget: the file's bytes, 32 a receiver for its place and normal, 16 for each picture; of the light 48 bytes a texel
// of the cube, 80 more and 960 a block where materials shine.
import {
  DataArrayTexture,
  DataTexture,
  FloatType,
  Matrix3,
  MeshBasicMaterial,
  NearestFilter,
  RedIntegerFormat,
  RGBAFormat,
  UnsignedIntType,
  Vector3,
  type IUniform,
  type Material,
  type Mesh,
  type SkinnedMesh,
  type WebGLProgramParametersWithUniforms,
} from 'three';
import { BlockLight, widestBlock } from './block_light.js';
import { blockTolerance, diffuseOf, lobeOf, samplesOf, type Reflection } from './block_reflection.js';
import { wordColumns, diffuseShader, glossShader, pictureColumns, receiverColumns } from './block_shader.js';
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
  glassRefusal,
  isNodeRenderer,
  setNodes,
  withoutNodes,
  type NodeBlocks,
  type NodeEdition,
  type Renderer,
} from './node_edition.js';
import { glossFragmentDeclarations, glossVaryings } from './outgoing.js';
import { chainHooks, copyNodes, diffuseParameters, replaceOnce, useExitRadiance } from './prt_material.js';
import { drawFilter, type Drawn } from './see_through.js';
import { bindPart } from './vertex_transfer.js';

/** What all meshes of one file share. */
interface Shared {
  diffuse: DrawnPicture;
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
      { diffuse, gloss, reflection, eye } = this.shared,
      shines = reflection.value.model !== 'diffuse';
    diffuse.update(renderer);
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
    const { diffuse, gloss, share } = this.shared;
    Object.assign(shader.uniforms, {
      prtEven: { value: diffuse.target.texture },
      prtShine: { value: gloss.target.texture },
      prtShare: share,
    });
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
  private refusal: string | undefined;

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
    this.shared = { diffuse, gloss: this.gloss, light: this.light, reflection, eye, share: { value: 1 } };
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
      this.refusal ??= glassRefusal(material);
      setNodes(
        material,
        this.refusal === undefined ? this.nodes!.atVertices(twoSided) : undefined,
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
      shared.diffuse.bytes +
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
    this.shared.diffuse.check(renderer);
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
    this.shared.diffuse.refresh();
    this.gloss.refresh();
    this.nodes?.refresh();
  }

  dispose(): void {
    this.nodes?.dispose();
    this.sight.dispose();
    this.places.dispose();
    this.light.dispose();
    this.shared.diffuse.dispose();
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

/** Places and unit normals of vertices in the world; normals on the side that the triangles' fronts are on. */
function surfaceOf(mesh: Mesh): { positions: Float32Array; normals: Float32Array } {
  mesh.updateWorldMatrix(true, false);
  const { geometry, matrixWorld } = mesh,
    count = geometry.getAttribute('position').count,
    [positions, normals, fronts] = [
      new Float32Array(3 * count),
      new Float32Array(3 * count),
      new Float32Array(3 * count),
    ],
    turn = new Matrix3().getNormalMatrix(matrixWorld),
    own = geometry.getAttribute('normal'),
    skin = 'isSkinnedMesh' in mesh ? (mesh as SkinnedMesh) : undefined,
    [p, n, a, b, c] = Array.from({ length: 5 }, () => new Vector3()) as [Vector3, Vector3, Vector3, Vector3, Vector3];
  if (!own) throw new LambentError('has a mesh without normals, which visibility in blocks was baked for');
  for (let v = 0; v < count; ++v) {
    mesh.getVertexPosition(v, p);
    n.fromBufferAttribute(own, v);
    if (skin) {
      a.fromBufferAttribute(geometry.getAttribute('position'), v);
      n.add(a);
      n.copy(skin.applyBoneTransform(v, n)).sub(skin.applyBoneTransform(v, a));
    }
    p.applyMatrix4(matrixWorld).toArray(positions, 3 * v);
    n.applyMatrix3(turn)
      .normalize()
      .toArray(normals, 3 * v);
  }
  const corners = geometry.index?.count ?? count,
    isMirrored = matrixWorld.determinant() < 0;
  for (let i = 0; i + 2 < corners; i += 3) {
    const at = [0, 1, 2].map((k) => geometry.index?.getX(i + k) ?? i + k);
    [a, b, c].forEach((corner, k) => corner.fromArray(positions, 3 * at[k]!));
    b.sub(a)
      .cross(c.sub(a))
      .multiplyScalar(isMirrored ? -1 : 1);
    for (const v of at) for (let k = 0; k < 3; ++k) fronts[3 * v + k]! += b.getComponent(k);
  }
  for (let v = 0; v < 3 * count; v += 3) {
    const along = normals[v]! * fronts[v]! + normals[v + 1]! * fronts[v + 1]! + normals[v + 2]! * fronts[v + 2]!;
    if (along < 0) for (let k = 0; k < 3; ++k) normals[v + k] = -normals[v + k]!;
  }
  return { positions, normals };
}

/**
 * Two texels a receiver: its place and the lower 24 bits of where its record begins, its normal and the upper ones.
 * As the scene stands now, which is as it was baked.
 */
function placeReceivers(meshes: readonly Mesh[], receivers: number, begins: Float64Array): DataTexture {
  const height = Math.ceil(receivers / receiverColumns),
    data = new Float32Array(8 * receiverColumns * height),
    done = new Uint8Array(receivers);
  for (let r = 0; r < receivers; ++r) {
    data[8 * r + 3] = begins[r]! % 2 ** 24;
    data[8 * r + 7] = Math.floor(begins[r]! / 2 ** 24);
  }
  for (const mesh of meshes) {
    const { positions, normals } = surfaceOf(mesh);
    for (const [name, sign] of [
      ['lambentReceiver', 1],
      ['lambentReceiverBack', -1],
    ] as const) {
      if (!mesh.geometry.hasAttribute(name)) continue;
      const map = mesh.geometry.getAttribute(name);
      for (let v = 0; v < map.count; ++v) {
        const r = map.getX(v);
        if (r === noReceiver || done[r]) continue;
        done[r] = 1;
        data.set(positions.subarray(3 * v, 3 * v + 3), 8 * r);
        for (let k = 0; k < 3; ++k) data[8 * r + 4 + k] = sign * normals[3 * v + k]!;
      }
    }
  }
  const made = new DataTexture(data, 2 * receiverColumns, height, RGBAFormat, FloatType);
  made.name = 'lambent receivers';
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
