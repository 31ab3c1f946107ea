// Diffuse transfer over the texels of an atlas (docs/lightmaps.md): columns of harmonics, then of the scene's own lamps. Light is summed
// once into a half-float picture of the atlas, on the graphics card, when it changes; pixels look that up bilinearly.
import {
  Color, DataTexture, Float32BufferAttribute, LinearFilter, MeshBasicMaterial, NearestFilter, RedIntegerFormat, UnsignedIntType, type DataArrayTexture, type Material,
  type Mesh, type MeshStandardMaterial, type WebGLProgramParametersWithUniforms, type WebGLRenderer,
} from 'three';
import { blockTexture, packBlocks, type BlockLayout } from './block_texture.js';
import { LambentError } from './errors.js';
import { isIndex } from './glb.js';
import { readHeader, readReceivers, shareGeometry, type TransferHeader } from './header.js';
import type { BakedTransfer, TransferSource } from './kinds.js';
import type { Lighting } from './lighting.js';
import { LightSum, maxColumns } from './light_sum.js';
import { diffuseParameters, replaceOnce, useExitRadiance } from './prt_material.js';
import { shCount } from './sh.js';

const maxSide = 16384; // of an atlas; what a graphics card takes is less, mostly, and asked of it

const vertexDeclarations = /* glsl */ `
attribute vec2 lambentPlace;
varying vec2 vPrtFront;
#ifdef PRT_TWO_SIDED
  attribute vec2 lambentPlaceBack;
  varying vec2 vPrtBack;
#endif
`;
const vertexBody = /* glsl */ `
  vPrtFront = lambentPlace;
  #ifdef PRT_TWO_SIDED
    vPrtBack = lambentPlaceBack;
  #endif
`;
const fragmentDeclarations = /* glsl */ `
uniform highp sampler2D prtAtlas;
uniform vec3 prtEmission;
varying vec2 vPrtFront;
#ifdef PRT_TWO_SIDED
  varying vec2 vPrtBack;
#endif
vec3 prtExitRadiance() {
  vec2 place = vPrtFront;
  #ifdef PRT_TWO_SIDED
    if ( ! gl_FrontFacing ) place = vPrtBack;
  #endif
  return texture( prtAtlas, place / vec2( textureSize( prtAtlas, 0 ) ) ).rgb;
}
`;

class LightmapMaterial extends MeshBasicMaterial {
  constructor(readonly atlas: LightSum, twoSided: boolean, readonly emission: { value: Color }, source: Material, readonly gain?: { value: number }) {
    super(gain ? { side: source.side } : diffuseParameters(source));
    this.defines = { ...(twoSided && { PRT_TWO_SIDED: '' }), ...(gain && { PRT_FALSE_COLOR: '' }) };
    if (gain) this.toneMapped = false;
  }

  override onBeforeRender(renderer: WebGLRenderer): void {
    this.atlas.update(renderer);
  }

  override onBeforeCompile(shader: WebGLProgramParametersWithUniforms): void {
    Object.assign(shader.uniforms, { prtAtlas: { value: this.atlas.target.texture }, prtEmission: this.emission }, this.gain && { prtGain: this.gain });
    shader.vertexShader = vertexDeclarations + replaceOnce(shader.vertexShader, '#include <fog_vertex>', '#include <fog_vertex>' + vertexBody);
    shader.fragmentShader = useExitRadiance(shader.fragmentShader, fragmentDeclarations, this.gain !== undefined);
    if (!this.gain)
      shader.fragmentShader = replaceOnce(shader.fragmentShader, '#include <opaque_fragment>', 'outgoingLight += prtEmission;\n#include <opaque_fragment>');
  }

  override customProgramCacheKey(): string {
    return 'lambent lightmap'; // the rest is in the defines
  }
}

class LightmapTransfer implements BakedTransfer {
  readonly kind = 'diffuse';
  readonly order: number;
  readonly channels: number;
  readonly receivers: number;
  readonly fileBytes: number;
  readonly gpuBytes: number;
  readonly lamps = new Map<string, Color>();
  private readonly layout: BlockLayout;
  private readonly transfer: DataArrayTexture;
  private readonly atlas: LightSum;
  private readonly materials: LightmapMaterial[] = [];
  private readonly ofCoefficients = new Set<LightSum>();
  private readonly glow: { emission: { value: Color }; own: Color; lamp: string }[] = [];

  constructor(header: TransferHeader, groups: string[], values: ArrayBuffer, private readonly receiversOf: DataTexture, readonly meshes: Mesh[], owns: Material[]) {
    this.order = header.order, this.channels = header.channels, this.receivers = header.receivers, this.fileBytes = values.byteLength;
    for (const name of groups) this.lamps.set(name, new Color(1, 1, 1));
    const { layout, data } = packBlocks({ ...header, count: shCount(header.order) + groups.length }, values);
    this.layout = layout, this.transfer = blockTexture(layout, data);
    this.atlas = this.makeAtlas();
    const { width, height } = receiversOf.image;
    let gpuBytes = data.byteLength + 12 * width * height;
    meshes.forEach((mesh, i) => {
      const own = owns[i]! as Material & Partial<MeshStandardMaterial>, twoSided = mesh.geometry.hasAttribute('lambentPlaceBack');
      const emission = { value: new Color(0, 0, 0) };
      if (own.emissive) this.glow.push({ emission, own: own.emissive.clone().multiplyScalar(own.emissiveIntensity ?? 1), lamp: own.name });
      const material = new LightmapMaterial(this.atlas, twoSided, emission, own);
      material.vertexColors = mesh.geometry.hasAttribute('color');
      this.materials.push(material);
      mesh.material = material;
      gpuBytes += mesh.geometry.getAttribute('position').count * (twoSided ? 16 : 8);
    });
    this.gpuBytes = gpuBytes;
  }

  /** Exit radiance of white at every texel, under one light. */
  private makeAtlas(): LightSum {
    const { width, height } = this.receiversOf.image;
    return new LightSum({
      layout: this.layout, channels: this.channels, transfer: this.transfer, width, height, filter: LinearFilter, uniforms: { prtReceivers: { value: this.receiversOf } },
      what: { size: 'has an atlas', use: 'is a lightmap' },
      pick: `
uniform highp usampler2D prtReceivers;
uint prtPick( const in ivec2 texel, out int row ) {
  row = 0;
  return texelFetch( prtReceivers, texel, 0 ).r;
}`,
    });
  }

  check(renderer: WebGLRenderer): void {
    this.atlas.check(renderer);
  }

  relight(lighting: Lighting): void {
    const lamps = [...this.lamps];
    for (const atlas of this.ofCoefficients) atlas.refresh(); // a lost context has taken what was drawn
    this.atlas.set([...lighting.coefficients(this.order), ...lamps.flatMap(([, color]) => color.toArray())]);
    // One column is of all lamps together; else materials that glow have one of their name.
    for (const { emission, own, lamp } of this.glow) {
      const scale = lamps.length === 1 ? lamps[0]![1] : this.lamps.get(lamp);
      if (scale) emission.value.copy(own).multiply(scale);
      else emission.value.setRGB(0, 0, 0);
    }
  }

  coefficientMaterials(index: number, gain: { value: number }): Material[] {
    const atlas = this.makeAtlas();
    atlas.set(new Float64Array(3 * (shCount(this.order) + this.lamps.size)).fill(1, 3 * index, 3 * index + 3));
    this.ofCoefficients.add(atlas);
    const made = this.meshes.map((mesh, i) =>
      new LightmapMaterial(atlas, mesh.geometry.hasAttribute('lambentPlaceBack'), { value: new Color(0, 0, 0) }, this.materials[i]!, gain));
    let left = made.length;
    for (const material of made)
      material.addEventListener('dispose', () => {
        if (--left === 0) this.ofCoefficients.delete(atlas), atlas.dispose();
      });
    return made;
  }

  dispose(): void {
    for (const atlas of [this.atlas, ...this.ofCoefficients]) atlas.dispose();
    this.transfer.dispose(), this.receiversOf.dispose();
    for (const material of this.materials) material.dispose();
    for (const mesh of this.meshes) mesh.geometry.dispose();
  }
}

/** Two floats a vertex, in texels. */
async function readPlaces(source: TransferSource, view: unknown, vertices: number): Promise<Float32BufferAttribute> {
  if (!isIndex(view)) throw new LambentError('a part has no buffer view of places in the atlas');
  const bytes = await source.bufferView(view);
  if (bytes.byteLength !== 8 * vertices) throw new LambentError('a part does not have one place in the atlas a vertex');
  const places = new Float32Array(bytes);
  for (const x of places) if (!Number.isFinite(x)) throw new LambentError('a place in the atlas is not a finite number');
  return new Float32BufferAttribute(places, 2);
}

export async function loadLightmap(source: TransferSource): Promise<BakedTransfer> {
  const { extension } = source, header = readHeader(extension, 'texels');
  const groups = extension.transfer['groups'] ?? [], { width, height, texels } = extension.surface!;
  if (!Array.isArray(groups) || !groups.every((name) => typeof name === 'string')) throw new LambentError('"groups" is no list of names');
  const columns = shCount(header.order) + groups.length;
  if (columns > maxColumns) throw new LambentError(`has ${columns} columns of light over an atlas, where this version draws ${maxColumns}`);
  if (!isIndex(width, maxSide) || !isIndex(height, maxSide) || width < 1 || height < 1) throw new LambentError('the size of the atlas is out of range');
  const map = await readReceivers(source, texels, width * height, header.receivers, 'the atlas does not have one receiver a texel');
  const receivers = new DataTexture(map, width, height, RedIntegerFormat, UnsignedIntType);
  receivers.internalFormat = 'R32UI', receivers.minFilter = receivers.magFilter = NearestFilter, receivers.needsUpdate = true;
  const values = await source.bufferView(header.bufferView), meshes: Mesh[] = [], owns: Material[] = [];
  for (const part of extension.parts) {
    const mesh = source.mesh(part), geometry = shareGeometry(mesh.geometry), vertices = geometry.getAttribute('position').count;
    geometry.setAttribute('lambentPlace', await readPlaces(source, part.front, vertices));
    if (part.back !== undefined) geometry.setAttribute('lambentPlaceBack', await readPlaces(source, part.back, vertices));
    mesh.geometry = geometry;
    meshes.push(mesh), owns.push(await source.ownMaterial(part));
  }
  return new LightmapTransfer(header, groups, values, receivers, meshes, owns);
}
