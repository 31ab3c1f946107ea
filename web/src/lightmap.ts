// Diffuse transfer over the texels of an atlas (docs/lightmaps.md): columns of harmonics, then of the scene's own lamps. Light is summed
// once into a half-float picture of the atlas, on the graphics card, when it changes; pixels look that up bilinearly.
import {
  Camera, Color, DataTexture, Float32BufferAttribute, GLSL3, HalfFloatType, LinearFilter, Mesh, MeshBasicMaterial, NearestFilter, PlaneGeometry, RawShaderMaterial,
  RedIntegerFormat, RGBAFormat, Scene, UnsignedIntType, WebGLRenderTarget, type DataArrayTexture, type Material, type MeshStandardMaterial,
  type WebGLProgramParametersWithUniforms, type WebGLRenderer,
} from 'three';
import { blockTexture, packBlocks, type BlockLayout } from './block_texture.js';
import { LambentError } from './errors.js';
import { isIndex } from './glb.js';
import { readHeader, readReceivers, shareGeometry, type TransferHeader } from './header.js';
import type { BakedTransfer, TransferSource } from './kinds.js';
import type { Lighting } from './lighting.js';
import { diffuseParameters, replaceOnce, useExitRadiance } from './prt_material.js';
import { shCount } from './sh.js';

const maxColumns = 256; // uniforms: 192 vec4 of the 224 that WebGL 2 promises
const maxSide = 16384; // of an atlas; what a graphics card takes is less, mostly, and asked of it

const atlasVertex = 'in vec3 position;\nvoid main() { gl_Position = vec4( position, 1.0 ); }';
const atlasFragment = /* glsl */ `
precision highp float;
precision highp int;
uniform highp sampler2DArray prtTransfer;
uniform highp usampler2D prtReceivers;
uniform vec4 prtLight[ 3 * PRT_QUADS ];
out vec4 radiance;
void main() {
  uint receiver = texelFetch( prtReceivers, ivec2( gl_FragCoord.xy ), 0 ).r;
  radiance = vec4( 0.0, 0.0, 0.0, 1.0 );
  if ( receiver == 0xffffffffu ) return;
  int r = int( receiver );
  ivec3 at = ivec3( ( r & ( PRT_COLUMNS - 1 ) ) * PRT_TEXELS, ( r / PRT_COLUMNS ) & ( PRT_ROWS - 1 ), r / ( PRT_COLUMNS * PRT_ROWS ) );
  for ( int k = 0; k < PRT_QUADS; ++ k ) {
    vec4 red = texelFetch( prtTransfer, at + ivec3( k, 0, 0 ), 0 ), green = red, blue = red;
    #if PRT_CHANNELS == 3
      green = texelFetch( prtTransfer, at + ivec3( PRT_QUADS + k, 0, 0 ), 0 );
      blue = texelFetch( prtTransfer, at + ivec3( 2 * PRT_QUADS + k, 0, 0 ), 0 );
    #endif
    radiance.rgb += vec3( dot( red, prtLight[ k ] ), dot( green, prtLight[ PRT_QUADS + k ] ), dot( blue, prtLight[ 2 * PRT_QUADS + k ] ) );
  }
}`;

/** Exit radiance of white at every texel, under one light. */
class Atlas {
  readonly light: Float32Array;
  readonly target: WebGLRenderTarget;
  private readonly quad: Mesh<PlaneGeometry, RawShaderMaterial>;
  private readonly scene = new Scene();
  private readonly camera = new Camera();
  private changed = true;

  constructor(layout: BlockLayout, channels: number, transfer: DataArrayTexture, receivers: DataTexture) {
    this.light = new Float32Array(12 * layout.quads);
    const { width, height } = receivers.image;
    this.target = new WebGLRenderTarget(width, height, {
      type: HalfFloatType, format: RGBAFormat, minFilter: LinearFilter, magFilter: LinearFilter, depthBuffer: false, generateMipmaps: false,
    });
    const material = new RawShaderMaterial({
      glslVersion: GLSL3, vertexShader: atlasVertex, fragmentShader: atlasFragment, depthTest: false, depthWrite: false,
      defines: { PRT_QUADS: layout.quads, PRT_TEXELS: layout.texels, PRT_COLUMNS: layout.columns, PRT_ROWS: layout.rows, PRT_CHANNELS: channels },
      uniforms: { prtTransfer: { value: transfer }, prtReceivers: { value: receivers }, prtLight: { value: this.light } },
    });
    this.quad = new Mesh(new PlaneGeometry(2, 2), material);
    this.quad.frustumCulled = false;
    this.scene.add(this.quad);
  }

  /** `light` is [column][3]. */
  set(light: ArrayLike<number>): void {
    const quads = this.light.length / 12;
    for (let k = 0; k < light.length / 3; ++k) for (let c = 0; c < 3; ++c) this.light[4 * quads * c + k] = light[3 * k + c]!;
    this.changed = true;
  }

  refresh(): void {
    this.changed = true;
  }

  check(renderer: WebGLRenderer): void {
    const { width, height } = this.target;
    if (Math.max(width, height) > renderer.capabilities.maxTextureSize)
      throw new LambentError(`has an atlas of ${width} x ${height} texels, where this graphics card takes ${renderer.capabilities.maxTextureSize}`);
    if (!renderer.extensions.has('EXT_color_buffer_float') && !renderer.extensions.has('EXT_color_buffer_half_float'))
      throw new LambentError('is a lightmap, which needs a graphics card that draws into half-float textures (EXT_color_buffer_float)');
  }

  /** Before what shows it is drawn; the renderer is left as it was. */
  update(renderer: WebGLRenderer): void {
    if (!this.changed) return;
    this.check(renderer);
    this.changed = false;
    const before = renderer.getRenderTarget(), face = renderer.getActiveCubeFace(), level = renderer.getActiveMipmapLevel();
    renderer.setRenderTarget(this.target);
    renderer.render(this.scene, this.camera);
    renderer.setRenderTarget(before, face, level);
  }

  dispose(): void {
    this.target.dispose(), this.quad.geometry.dispose(), this.quad.material.dispose();
  }
}

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
  constructor(readonly atlas: Atlas, twoSided: boolean, readonly emission: { value: Color }, source: Material, readonly gain?: { value: number }) {
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
  private readonly atlas: Atlas;
  private readonly materials: LightmapMaterial[] = [];
  private readonly ofCoefficients = new Set<Atlas>();
  private readonly glow: { emission: { value: Color }; own: Color; lamp: string }[] = [];

  constructor(header: TransferHeader, groups: string[], values: ArrayBuffer, private readonly receiversOf: DataTexture, readonly meshes: Mesh[], owns: Material[]) {
    this.order = header.order, this.channels = header.channels, this.receivers = header.receivers, this.fileBytes = values.byteLength;
    for (const name of groups) this.lamps.set(name, new Color(1, 1, 1));
    const { layout, data } = packBlocks({ ...header, count: shCount(header.order) + groups.length }, values);
    this.layout = layout, this.transfer = blockTexture(layout, data);
    this.atlas = new Atlas(layout, this.channels, this.transfer, receiversOf);
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
    const atlas = new Atlas(this.layout, this.channels, this.transfer, this.receiversOf);
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
