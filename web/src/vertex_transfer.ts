// Transfer at vertices, whatever its kind: a texture of every receiver's values, receivers as attributes, and light as
// uniforms, of vertex shaders or of what sums it up once a light (vertex_sum.ts).
import {
  DataTexture,
  DataUtils,
  FloatType,
  Matrix3,
  RedFormat,
  RGBAFormat,
  Uint32BufferAttribute,
  type DataArrayTexture,
  type Material,
  type Mesh,
  type Object3D,
  type SkinnedMesh,
} from 'three';
import { TransferValues } from './block_texture.js';
import { readStored, type StoredValues } from './clusters.js';
import { LambentError } from './errors.js';
import type { TransferExtension } from './glb.js';
import { bandsOfLight, columnsOf, noReceiver, readReceivers, shareGeometry, type TransferHeader } from './header.js';
import type { BakedTransfer, TransferSource } from './kinds.js';
import type { Lighting } from './lighting.js';
import {
  checkNodes,
  isNodeRenderer,
  setNodes,
  throughGlass,
  withoutNodes,
  type MaterialNodes,
  type NodeEdition,
  type NodeLobes,
  type NodeRest,
  type NodeSum,
  type Renderer,
} from './node_edition.js';
import { afterAll, packLight } from './light_sum.js';
import { surfaceFrame, type Lobe } from './lobes.js';
import { keepNormals } from './own_normals.js';
import { checkReflection, reflectionBytes, reflectionUniforms, type LastReflection } from './outgoing.js';
import { diffuseParameters, PrtMaterial, type PrtOptions, type PrtShader, type PrtUniforms } from './prt_material.js';
import { shCount } from './sh.js';
import { RestPose, TurnedSums } from './turned.js';
import { VertexSums, type VertexSumOptions } from './vertex_sum.js';

/** The part's mesh, its vertices with their receivers. */
export async function bindPart(
  source: TransferSource,
  part: TransferExtension['parts'][number],
  receivers: number,
): Promise<Mesh> {
  const mesh = source.mesh(part),
    geometry = shareGeometry(mesh.geometry),
    vertices = geometry.getAttribute('position').count;
  const add = async (name: string, view: unknown): Promise<void> => {
    const map = await readReceivers(source, view, vertices, receivers, 'a part does not have one receiver a vertex');
    geometry.setAttribute(name, new Uint32BufferAttribute(map, 1));
  };
  await add('lambentReceiver', part.front);
  if (part.back !== undefined) await add('lambentReceiverBack', part.back);
  mesh.geometry = geometry;
  return mesh;
}

/**
 * Bone matrices as they stand on loading (world matrices are up to date), which is the pose that was baked; laid out as
 * three's bone texture.
 */
function restBones(mesh: SkinnedMesh): DataTexture {
  mesh.skeleton.update();
  const matrices = mesh.skeleton.boneMatrices!,
    bones = mesh.skeleton.bones.length;
  const size = Math.max(4, Math.ceil(Math.sqrt(4 * bones) / 4) * 4),
    data = new Float32Array(4 * size * size);
  data.set(matrices.subarray(0, 16 * bones));
  const texture = new DataTexture(data, size, size, RGBAFormat, FloatType);
  texture.needsUpdate = true;
  return texture;
}

/** What kinds are drawn from by WebGPURenderer. */
interface NodeValues {
  sum?: NodeSum | undefined;
  lobes?: NodeLobes | undefined;
}

const errorWidth = 2048;
function errorTexture(errors: Float32Array): DataTexture {
  const height = Math.ceil(errors.length / errorWidth),
    data = new Float32Array(errorWidth * height);
  data.set(errors);
  const texture = new DataTexture(data, errorWidth, height, RedFormat, FloatType);
  texture.needsUpdate = true;
  return texture;
}
/** In place of a kind's own: the error of the receiver's fit. */
const errorShader = ({ turns }: PrtShader): PrtShader => ({
  key: 'fit error',
  turns,
  radiance: `
uniform highp sampler2D prtErrors;
vec3 prtRadiance( const in uint receiver ) {
  if ( receiver == 0xffffffffu ) return vec3( 0.0 );
  int r = int( receiver );
  return vec3( texelFetch( prtErrors, ivec2( r % ${errorWidth}, r / ${errorWidth} ), 0 ).r );
}
`,
});

/** Matrices, fog, morph targets and what else a MeshBasicMaterial has in its vertex shader. */
const ownUniforms = 32;

/** How a kind lays out and reads the values of a receiver. */
export interface VertexKind {
  kind: string;
  /** Values in the file a receiver: [channel][count]; rows of a last reflection count as channels. */
  count: number;
  valueChannels: number;
  shader: PrtShader;
  /** One number a receiver, where there are any: how far its values are from what they were fitted to. */
  fitErrors?: Float32Array;
  /** With a shader that is glossy. */
  last?: LastReflection;
  /** Where values are lobes: how many, of a receiver or of each of its rows. */
  lobeCount?: number;
  /** Where the values of a receiver are lobes. */
  readLobes?: (values: ArrayLike<number>) => Lobe[];
}

export class VertexTransfer implements BakedTransfer {
  readonly kind: string;
  readonly isDiffuse: boolean;
  readonly order: number;
  readonly columns: BakedTransfer['columns'];
  readonly channels: number;
  readonly receivers: number;
  readonly fileBytes: number;
  readonly gpuBytes: number;
  readonly lobesAt?: NonNullable<BakedTransfer['lobesAt']>;
  readonly fitErrorMaterials?: NonNullable<BakedTransfer['fitErrorMaterials']>;
  readonly coefficientsOf?: NonNullable<BakedTransfer['coefficientsOf']>;
  private readonly light: TransferHeader;
  private readonly last: LastReflection | undefined;
  private errors: DataTexture | undefined;
  private readonly values: TransferValues;
  private readonly texture: DataArrayTexture;
  private readonly bones = new Map<string, DataTexture>(); // by skeleton
  private readonly uniforms: PrtUniforms;
  private readonly optionsOf: PrtOptions[] = [];
  private readonly materials = new Map<string, PrtMaterial>();
  private readonly quads: number; // of the light, a channel
  private readonly summing: VertexSumOptions | undefined; // of a shader that is summed
  private readonly sums: TurnedSums<VertexSums> | undefined; // for WebGLRenderer
  private readonly ofCoefficients = new Set<TurnedSums<VertexSums>>();
  private readonly makeNodes: ((pose?: RestPose) => NodeValues) | undefined; // for WebGPURenderer
  private readonly sum: NodeSum | undefined;
  private readonly lobes: NodeLobes | undefined;
  /** Why WebGPURenderer does not draw this. */
  private readonly refusal: string | undefined;

  private constructor(
    header: TransferHeader,
    { kind, count, valueChannels, shader, readLobes, fitErrors, last, lobeCount }: VertexKind,
    { values, fileBytes }: StoredValues,
    readonly meshes: Mesh[],
    private readonly nodes?: NodeEdition,
    firstBands?: number,
  ) {
    this.kind = kind;
    this.isDiffuse = last === undefined;
    this.order = bandsOfLight(header);
    this.columns = columnsOf(header);
    this.light = header;
    this.channels = header.channels;
    this.receivers = header.receivers;
    this.fileBytes = fileBytes;
    this.values = new TransferValues(
      { count, channels: valueChannels, precision: header.precision, receivers: header.receivers },
      values,
      firstBands,
    );
    const { layout, data, texture } = this.values;
    this.last = last;
    this.quads = shader.summed ? layout.quads : Math.ceil(shCount(header.order) / 4);
    this.texture = texture;
    this.uniforms = {
      prtTransfer: { value: this.texture },
      prtLight: { value: new Float32Array(12 * this.quads) },
      prtPeaks: { value: new Float32Array(12 * this.quads) },
      prtHasPeaks: { value: false },
      ...(last && reflectionUniforms(last)),
    };
    this.refusal = nodes ? undefined : withoutNodes;
    const summing = { layout, transfer: this.texture, channels: header.channels, receivers: header.receivers };
    if (shader.summed) {
      this.summing = summing;
      const pose = new RestPose(meshes, true);
      this.sums = new TurnedSums(() => new VertexSums(summing), header.order, pose, layout.quads);
      this.makeNodes = (of = pose): NodeValues => ({ sum: nodes?.sum({ ...summing, order: header.order, pose: of }) });
    } else if (lobeCount !== undefined)
      this.makeNodes = (): NodeValues => ({
        lobes: nodes?.lobes({
          ...{ layout, transfer: this.texture, order: header.order, channels: header.channels, lobes: lobeCount },
          ...(last && { last }),
        }),
      });
    ({ sum: this.sum, lobes: this.lobes } = this.makeNodes?.() ?? {});
    let gpuBytes =
      data.byteLength + (last ? reflectionBytes(last) : 0) + (this.sums?.main.bytes ?? 0) + (this.sum?.bytes ?? 0);
    for (const mesh of meshes) {
      const twoSided = mesh.geometry.hasAttribute('lambentReceiverBack');
      const rest = shader.turns ? this.restOf(mesh) : undefined;
      const vertices = mesh.geometry.getAttribute('position').count;
      const options: PrtOptions = {
        order: header.order,
        layout,
        channels: header.channels,
        shader,
        twoSided,
        ...(rest && { rest }),
        ...(this.sums && { sums: this.sums }),
      };
      gpuBytes += vertices * (twoSided ? 8 : 4);
      this.optionsOf.push(options);
      // Meshes of one material share its edition, unless each turns by itself.
      const source = mesh.material as Material,
        key = `${source.uuid} ${twoSided} ${rest ? mesh.uuid : ''}`;
      const material = this.materials.get(key) ?? new PrtMaterial(this.uniforms, options, diffuseParameters(source));
      this.materials.set(key, material);
      keepNormals(source, material);
      setNodes(
        material,
        nodes && throughGlass(nodes, material, this.nodesFor(nodes, mesh, options)),
        `The baked scene ${this.refusal}.`,
      );
      mesh.material = material;
    }
    this.gpuBytes = gpuBytes;
    if (fitErrors)
      this.fitErrorMaterials = (gain) => {
        const uniforms = {
          ...this.uniforms,
          prtHasPeaks: { value: false },
          prtErrors: { value: (this.errors ??= errorTexture(fitErrors)) },
        };
        const made = meshes.map(
          (mesh, i) =>
            new PrtMaterial(
              uniforms,
              { ...this.optionsOf[i]!, shader: errorShader(shader), falseColor: { gain } },
              { side: (mesh.material as Material).side },
            ),
        );
        this.inFalseColor(made, gain, (i) => nodes!.numbers(this.errors!, this.optionsOf[i]!.twoSided));
        return made;
      };
    if (kind === 'diffuse' && !header.lobes)
      this.coefficientsOf = (receiver, out) => {
        for (let c = 0, to = 0; c < valueChannels; ++c)
          for (let k = 0; k < count; ++k, ++to) {
            const value = data[4 * (layout.texels * receiver + c * layout.quads) + k]!; // block_texture.ts
            out[to] = data instanceof Uint16Array ? DataUtils.fromHalfFloat(value) : value;
          }
      };
    if (readLobes)
      this.lobesAt = (mesh, vertex, back) => {
        const receiver = mesh.geometry.getAttribute(back ? 'lambentReceiverBack' : 'lambentReceiver').getX(vertex);
        if (receiver === noReceiver) return undefined;
        const stride = 4 * layout.texels,
          values = Array.from(data.subarray(stride * receiver, stride * receiver + count)); // block_texture.ts
        const lobes = readLobes(
          data instanceof Uint16Array ? values.map((bits) => DataUtils.fromHalfFloat(bits)) : values,
        );
        const frame = surfaceFrame(mesh, vertex, this.optionsOf[meshes.indexOf(mesh)]!.rest!);
        for (const lobe of lobes) lobe.axis.applyMatrix3(frame);
        return lobes;
      };
  }

  private nodesFor(
    nodes: NodeEdition,
    mesh: Mesh,
    { twoSided, rest }: Pick<PrtOptions, 'twoSided' | 'rest'>,
    { sum, lobes }: NodeValues = { sum: this.sum, lobes: this.lobes },
  ): MaterialNodes {
    if (sum) return { colorNode: nodes.atVertices(sum, twoSided) };
    const pose: NodeRest =
      'bones' in rest! ? { bones: rest.bones, count: (mesh as SkinnedMesh).skeleton.bones.length } : rest!;
    return lobes!.material(twoSided, pose);
  }

  /** Dresses materials for WebGPURenderer. */
  private inFalseColor(made: Material[], gain: { value: number }, of: (i: number) => MaterialNodes): void {
    const { nodes } = this;
    made.forEach((material, i) => setNodes(material, nodes?.falseColor(of(i), gain), `The view ${withoutNodes}.`));
  }

  private restOf(mesh: Mesh): NonNullable<PrtOptions['rest']> {
    let root: Object3D = mesh;
    while (root.parent) root = root.parent;
    root.updateMatrixWorld(true);
    const skinned = mesh as SkinnedMesh;
    if (!skinned.isSkinnedMesh) return { inverse: new Matrix3().setFromMatrix4(mesh.matrixWorld).invert() };
    const bones = this.bones.get(skinned.skeleton.uuid) ?? restBones(skinned);
    this.bones.set(skinned.skeleton.uuid, bones);
    return { bones };
  }

  /** Reads values and receivers, and dresses the meshes. */
  static async load(source: TransferSource, header: TransferHeader, kind: VertexKind): Promise<VertexTransfer> {
    const values = await readStored(source, header, kind.valueChannels * kind.count);
    const meshes = await Promise.all(source.extension.parts.map((part) => bindPart(source, part, header.receivers)));
    return new VertexTransfer(header, kind, values, meshes, source.nodes, source.firstBands);
  }

  check(renderer: Renderer): void {
    if (isNodeRenderer(renderer)) return checkNodes(renderer, this.refusal);
    if (this.last) checkReflection(this.last, renderer);
    this.sums?.main.check(renderer);
    // Light and its peaks, and what three has of its own.
    const uniforms = 6 * this.quads + ownUniforms;
    if (!this.sums && renderer.capabilities.maxVertexUniforms < uniforms)
      throw new LambentError(
        `is lit by ${this.order} bands, which take ${uniforms} uniforms in vertex shaders; ` +
          `this graphics card has ${renderer.capabilities.maxVertexUniforms} there`,
      );
    // Transfer or its sums, those of the light's peaks, frames and view maps, bones as they are and as they were, and
    // three's own of morph targets. All else is within what WebGL 2 promises.
    const wanted = Math.max(
      ...this.meshes.map(
        (mesh) =>
          (this.sums?.hasPeaks ? 2 : 1) +
          (this.last ? 2 : 0) +
          ('isSkinnedMesh' in mesh ? 1 + Number(this.bones.size > 0) : 0) +
          Number(Object.keys(mesh.geometry.morphAttributes).length > 0),
      ),
    );
    if (renderer.capabilities.maxVertexTextures < wanted)
      throw new LambentError(
        `is relit in vertex shaders, which must read textures, ${wanted} at once; ` +
          `this graphics card reads ${renderer.capabilities.maxVertexTextures} there`,
      );
  }

  relight(lighting: Lighting): void {
    const { rest, peaks, turned } = lighting.of(this.light, this.last !== undefined, this.firstBands);
    packLight(this.uniforms.prtLight.value, rest);
    if (peaks) packLight(this.uniforms.prtPeaks.value, peaks);
    this.uniforms.prtHasPeaks.value = peaks !== undefined; // materials take it when they are drawn
    this.sums?.set(rest, peaks, turned);
    this.sum?.set(rest, peaks, true, turned);
    this.lobes?.set(rest, peaks);
  }

  get firstBands(): number | undefined {
    return this.values.firstBands;
  }
  refine(values: ArrayBuffer): void {
    this.values.refine(values);
  }

  coefficientMaterials(index: number, gain: { value: number }): Material[] {
    const light = new Float64Array(3 * this.light.columns).fill(1, 3 * index, 3 * index + 3);
    const { summing } = this,
      sums =
        summing && new TurnedSums(() => new VertexSums(summing), this.light.order, undefined, summing.layout.quads);
    sums?.set(light, undefined);
    if (sums) this.ofCoefficients.add(sums);
    const uniforms = {
      ...this.uniforms,
      prtHasPeaks: { value: false },
      prtLight: { value: new Float32Array(12 * this.quads) },
    };
    packLight(uniforms.prtLight.value, light);
    const made = this.meshes.map(
      (mesh, i) =>
        new PrtMaterial(
          uniforms,
          { ...this.optionsOf[i]!, falseColor: { gain }, ...(sums && { sums }) },
          { side: (mesh.material as Material).side },
        ),
    );
    if (sums) afterAll(made, () => (this.ofCoefficients.delete(sums), sums.dispose()));
    const values = this.nodes ? (this.makeNodes?.(new RestPose([], true)) ?? {}) : {};
    values.sum?.set(light, undefined, false);
    values.lobes?.set(light, undefined);
    afterAll(made, () => (values.sum ?? values.lobes)?.dispose());
    this.inFalseColor(made, gain, (i) => this.nodesFor(this.nodes!, this.meshes[i]!, this.optionsOf[i]!, values));
    return made;
  }

  dispose(): void {
    this.texture.dispose();
    this.sum?.dispose();
    this.lobes?.dispose();
    this.sums?.dispose();
    for (const sums of this.ofCoefficients) sums.dispose();
    this.errors?.dispose();
    this.last?.frames.dispose();
    this.last?.maps.dispose();
    for (const texture of this.bones.values()) texture.dispose();
    for (const material of this.materials.values()) material.dispose();
    for (const mesh of this.meshes) mesh.geometry.dispose();
  }
}
