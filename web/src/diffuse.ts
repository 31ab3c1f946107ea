// Diffuse transfer (docs/file-format.md, kind "diffuse"): exit radiance = albedo * sum_i transfer_i light_i.
import { BufferGeometry, DataArrayTexture, FloatType, HalfFloatType, NearestFilter, RGBAFormat, Uint32BufferAttribute, type Material, type Mesh } from 'three';
import { packDiffuse, type DiffuseHeader } from './diffuse_texture.js';
import { LambentError } from './errors.js';
import { isIndex, type TransferExtension } from './glb.js';
import type { BakedTransfer, TransferKind, TransferSource } from './kinds.js';
import type { Lighting } from './lighting.js';
import { diffuseParameters, PrtMaterial, type PrtOptions, type PrtUniforms } from './prt_material.js';
import { maxShOrder, shCount } from './sh.js';

const noReceiver = 0xffffffff;

function readHeader(transfer: TransferExtension['transfer']): DiffuseHeader & { bufferView: number } {
  const { basis, order, channels, precision, receivers, bufferView } = transfer;
  if (basis !== 'sh') throw new LambentError(`holds light in the basis "${String(basis)}", which this version does not know`);
  if (precision !== 'half' && precision !== 'single') throw new LambentError('"precision" must be half or single');
  if (!isIndex(order, maxShOrder) || order < 1) throw new LambentError('"order" is out of range');
  if (channels !== 1 && channels !== 3) throw new LambentError('"channels" is out of range');
  if (!isIndex(receivers, noReceiver - 1) || receivers < 1) throw new LambentError('"receivers" is out of range');
  if (!isIndex(bufferView)) throw new LambentError('"bufferView" is missing');
  return { order, channels, precision, receivers, bufferView };
}

/** One u32 a vertex, all of them receivers or none. */
async function readReceivers(source: TransferSource, view: unknown, vertices: number, receivers: number): Promise<Uint32Array> {
  if (!isIndex(view)) throw new LambentError('a part has no buffer view of receivers');
  const bytes = await source.bufferView(view);
  if (bytes.byteLength !== 4 * vertices) throw new LambentError('a part does not have one receiver a vertex');
  const map = new Uint32Array(bytes);
  for (const r of map) if (r !== noReceiver && r >= receivers) throw new LambentError(`receiver ${r} is out of range`);
  return map;
}

/** The mesh gets a geometry of its own, which shares all attributes, since nodes that share a mesh have receivers of their own. */
async function bindPart(source: TransferSource, part: TransferExtension['parts'][number], receivers: number): Promise<Mesh> {
  const mesh = source.mesh(part);
  const shared = mesh.geometry, geometry = new BufferGeometry();
  const vertices = shared.getAttribute('position').count;
  geometry.name = shared.name, geometry.index = shared.index, geometry.userData = shared.userData;
  geometry.groups = shared.groups, geometry.drawRange = shared.drawRange;
  geometry.morphAttributes = shared.morphAttributes, geometry.morphTargetsRelative = shared.morphTargetsRelative;
  geometry.boundingBox = shared.boundingBox, geometry.boundingSphere = shared.boundingSphere;
  for (const [name, attribute] of Object.entries(shared.attributes)) geometry.setAttribute(name, attribute);
  const add = async (name: string, view: unknown): Promise<void> =>
    void geometry.setAttribute(name, new Uint32BufferAttribute(await readReceivers(source, view, vertices, receivers), 1));
  await add('lambentReceiver', part.front);
  if (part.back !== undefined) await add('lambentReceiverBack', part.back);
  mesh.geometry = geometry;
  return mesh;
}

class DiffuseTransfer implements BakedTransfer {
  readonly kind = 'diffuse';
  readonly order: number;
  readonly channels: number;
  readonly receivers: number;
  readonly fileBytes: number;
  readonly gpuBytes: number;
  private readonly texture: DataArrayTexture;
  private readonly uniforms: PrtUniforms;
  private readonly optionsOf: PrtOptions[] = [];
  private readonly materials = new Map<string, PrtMaterial>();
  private readonly quads: number;

  constructor(header: DiffuseHeader, values: ArrayBuffer, readonly meshes: Mesh[]) {
    this.order = header.order, this.channels = header.channels, this.receivers = header.receivers, this.fileBytes = values.byteLength;
    const { layout, data } = packDiffuse(header, values);
    this.quads = layout.quads;
    this.texture = new DataArrayTexture(data, layout.width, layout.height, layout.layers);
    this.texture.name = 'lambent transfer';
    this.texture.format = RGBAFormat, this.texture.type = header.precision === 'half' ? HalfFloatType : FloatType;
    this.texture.minFilter = this.texture.magFilter = NearestFilter, this.texture.generateMipmaps = false;
    this.texture.needsUpdate = true;
    this.uniforms = { prtTransfer: { value: this.texture }, prtLight: { value: new Float32Array(12 * layout.quads) } };
    let gpuBytes = data.byteLength;
    for (const mesh of meshes) {
      const twoSided = mesh.geometry.hasAttribute('lambentReceiverBack');
      const vertices = mesh.geometry.getAttribute('position').count, options = { layout, channels: header.channels, twoSided };
      gpuBytes += vertices * (twoSided ? 8 : 4);
      this.optionsOf.push(options);
      // Meshes of one material share its edition.
      const source = mesh.material as Material, key = `${source.uuid} ${twoSided}`;
      const material = this.materials.get(key) ?? new PrtMaterial(this.uniforms, options, diffuseParameters(source));
      this.materials.set(key, material);
      mesh.material = material;
    }
    this.gpuBytes = gpuBytes;
  }

  relight(lighting: Lighting): void {
    this.fill(this.uniforms.prtLight.value, lighting.coefficients(this.order));
  }

  coefficientMaterials(index: number, gain: { value: number }): Material[] {
    const light = new Float64Array(3 * shCount(this.order)).fill(1, 3 * index, 3 * index + 3);
    const uniforms = { prtTransfer: this.uniforms.prtTransfer, prtLight: { value: new Float32Array(12 * this.quads) } };
    this.fill(uniforms.prtLight.value, light);
    return this.meshes.map((mesh, i) => new PrtMaterial(uniforms, { ...this.optionsOf[i]!, falseColor: { gain } }, { side: (mesh.material as Material).side }));
  }

  dispose(): void {
    this.texture.dispose();
    for (const material of this.materials.values()) material.dispose();
    for (const mesh of this.meshes) mesh.geometry.dispose();
  }

  /** [coefficient][3] to red, green and blue in whole texels. */
  private fill(out: Float32Array, light: ArrayLike<number>): void {
    for (let k = 0; k < shCount(this.order); ++k) for (let c = 0; c < 3; ++c) out[4 * this.quads * c + k] = light[3 * k + c]!;
  }
}

export const diffuseKind: TransferKind = {
  name: 'diffuse',
  async load(source) {
    const header = readHeader(source.extension.transfer);
    const values = await source.bufferView(header.bufferView);
    const meshes = await Promise.all(source.extension.parts.map((part) => bindPart(source, part, header.receivers)));
    return new DiffuseTransfer(header, values, meshes);
  },
};
