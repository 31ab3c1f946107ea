// T . light on the graphics card: a picture with a texel for each row of each receiver, drawn when the light changes
// and only looked up until then. Who makes one says which texel is whose.
import {
  Camera,
  FloatType,
  GLSL3,
  HalfFloatType,
  Mesh,
  PlaneGeometry,
  RawShaderMaterial,
  RGBAFormat,
  Scene,
  WebGLRenderTarget,
  type DataArrayTexture,
  type IUniform,
  type LinearFilter,
  type Material,
  type NearestFilter,
  type Texture,
  type WebGLRenderer,
} from 'three';
import type { BlockLayout } from './block_texture.js';
import { LambentError } from './errors.js';
import type { Sums } from './turned.js';

/** Compiles a material for light with peaks, or for light without. */
export function setPeaks(material: Material, on: boolean): void {
  const defines = (material.defines ??= {});
  if ('PRT_PEAKS' in defines === on) return;
  if (on) defines['PRT_PEAKS'] = '';
  else delete defines['PRT_PEAKS'];
  material.needsUpdate = true;
}

/** vec4 of uniforms in fragment shaders that WebGL 2 promises. */
const promised = 224; // limits.columns take 192

const vertexShader = 'in vec3 position;\nvoid main() { gl_Position = vec4( position, 1.0 ); }';
const fragmentShader = (pick: string): string => /* glsl */ `
precision highp float;
precision highp int;
uniform highp sampler2DArray prtTransfer;
uniform vec4 prtLight[ 3 * PRT_QUADS ];
#ifdef PRT_PEAKS
  uniform vec4 prtPeaks[ 3 * PRT_QUADS ];
#endif
uniform bool prtHolds;
out vec4 radiance;
${pick}
void main() {
  int row = 0;
  uint receiver = prtPick( ivec2( gl_FragCoord.xy ), row );
  radiance = vec4( 0.0, 0.0, 0.0, 1.0 );
  if ( receiver == 0xffffffffu ) return;
  int r = int( receiver );
  ivec3 at = ivec3( ( r & ( PRT_COLUMNS - 1 ) ) * PRT_TEXELS, ( r / PRT_COLUMNS ) & ( PRT_ROWS - 1 ),
                    r / ( PRT_COLUMNS * PRT_ROWS ) );
  at.x += row * PRT_CHANNELS * PRT_QUADS;
  vec3 peaks = vec3( 0.0 );
  for ( int k = 0; k < PRT_QUADS; ++ k ) {
    vec4 red = texelFetch( prtTransfer, at + ivec3( k, 0, 0 ), 0 ), green = red, blue = red;
    #if PRT_CHANNELS == 3
      green = texelFetch( prtTransfer, at + ivec3( PRT_QUADS + k, 0, 0 ), 0 );
      blue = texelFetch( prtTransfer, at + ivec3( 2 * PRT_QUADS + k, 0, 0 ), 0 );
    #endif
    radiance.rgb += vec3( dot( red, prtLight[ k ] ), dot( green, prtLight[ PRT_QUADS + k ] ),
                          dot( blue, prtLight[ 2 * PRT_QUADS + k ] ) );
    #ifdef PRT_PEAKS
      peaks += vec3( dot( red, prtPeaks[ k ] ), dot( green, prtPeaks[ PRT_QUADS + k ] ),
                     dot( blue, prtPeaks[ 2 * PRT_QUADS + k ] ) );
    #endif
  }
  // Light is not negative, nor is what a part of it gives (relight/dering.h).
  if ( prtHolds ) radiance.rgb = max( radiance.rgb, vec3( 0.0 ) ) + max( peaks, vec3( 0.0 ) );
}`;

export interface SumOptions {
  layout: BlockLayout;
  /** Of a row. */
  channels: number;
  transfer: DataArrayTexture;
  width: number;
  height: number;
  filter: typeof NearestFilter | typeof LinearFilter;
  /** In single floats, where the graphics card draws into those. */
  single?: boolean;
  /** GLSL: uint prtPick( ivec2 texel, out int row ), the receiver or 0xffffffffu, and what it reads. */
  pick: string;
  uniforms?: Record<string, IUniform>;
  /** Beginnings of sentences about what it is: "has an atlas" [of W x H texels], "is a lightmap" [, which needs]. */
  what: { size: string; use: string };
}

/** A picture in half floats, or in `single` ones, that is drawn anew when what it shows has changed. */
export class DrawnPicture {
  readonly target: WebGLRenderTarget;
  private readonly quad: Mesh<PlaneGeometry, RawShaderMaterial>;
  private readonly scene = new Scene();
  private readonly camera = new Camera();
  private version = 0;
  /** By renderer, which makes properties of its own again when a context has been lost: the version that it drew. */
  private readonly versions = new WeakMap<object, number>();

  constructor(
    width: number,
    height: number,
    filter: SumOptions['filter'],
    private readonly what: SumOptions['what'],
    drawing: { fragmentShader: string; defines: Record<string, number>; uniforms: Record<string, IUniform> },
    private readonly single = false,
  ) {
    this.target = new WebGLRenderTarget(width, height, {
      type: HalfFloatType,
      format: RGBAFormat,
      minFilter: filter,
      magFilter: filter,
      depthBuffer: false,
      generateMipmaps: false,
    });
    this.quad = new Mesh(
      new PlaneGeometry(2, 2),
      new RawShaderMaterial({ glslVersion: GLSL3, vertexShader, depthTest: false, depthWrite: false, ...drawing }),
    );
    this.quad.frustumCulled = false;
    this.scene.add(this.quad);
  }

  get bytes(): number {
    return (this.single ? 16 : 8) * this.target.width * this.target.height;
  }
  protected get material(): RawShaderMaterial {
    return this.quad.material;
  }

  /** Draws again: the light has changed. */
  refresh(): void {
    ++this.version;
  }

  /** Whether the graphics card draws into floats. */
  isDrawnBy({ extensions }: WebGLRenderer): boolean {
    return extensions.has('EXT_color_buffer_float') || extensions.has('EXT_color_buffer_half_float');
  }

  /** Throws LambentError where the graphics card has no texture of this size. */
  checkSize(renderer: WebGLRenderer): void {
    const { width, height } = this.target;
    if (Math.max(width, height) > renderer.capabilities.maxTextureSize)
      throw new LambentError(
        `${this.what.size} of ${width} x ${height} texels, ` +
          `where this graphics card takes ${renderer.capabilities.maxTextureSize}`,
      );
  }

  /** Throws LambentError where the graphics card cannot draw this. */
  check(renderer: WebGLRenderer): void {
    this.checkSize(renderer);
    if (!this.isDrawnBy(renderer))
      throw new LambentError(
        `${this.what.use}, which needs a graphics card that draws into half-float textures (EXT_color_buffer_float)`,
      );
  }

  /** Before what shows it is drawn; the renderer is left as it was. */
  update(renderer: WebGLRenderer): void {
    const card = renderer.properties;
    if (this.versions.get(card) === this.version) return;
    this.check(renderer);
    if (this.single && renderer.extensions.has('EXT_color_buffer_float')) this.target.texture.type = FloatType;
    this.versions.set(card, this.version);
    const before = renderer.getRenderTarget(),
      face = renderer.getActiveCubeFace(),
      level = renderer.getActiveMipmapLevel();
    renderer.setRenderTarget(this.target);
    renderer.render(this.scene, this.camera);
    renderer.setRenderTarget(before, face, level);
  }

  dispose(): void {
    this.target.dispose();
    this.quad.geometry.dispose();
    this.quad.material.dispose();
  }
}

/** Calls `done` when the last of the materials has been disposed of. */
export function afterAll(materials: Material[], done: () => void): void {
  let left = materials.length;
  for (const material of materials)
    material.addEventListener('dispose', () => {
      if (--left === 0) done();
    });
}

/** [coefficient][3] to red, green and blue in whole texels, as the uniform prtLight has them. */
export function packLight(out: Float32Array, light: ArrayLike<number>): void {
  const quads = out.length / 12;
  for (let k = 0; k < light.length / 3; ++k) for (let c = 0; c < 3; ++c) out[4 * quads * c + k] = light[3 * k + c]!;
}

/** T . light of one light, or of a part of it. */
export class LightSum extends DrawnPicture {
  readonly light: Float32Array;
  readonly peaks: Float32Array;
  private readonly holds: { value: boolean };

  constructor({ layout, channels, transfer, width, height, filter, single, pick, uniforms, what }: SumOptions) {
    const light = new Float32Array(12 * layout.quads),
      peaks = new Float32Array(12 * layout.quads),
      holds = { value: false };
    const drawing = {
      fragmentShader: fragmentShader(pick),
      defines: {
        PRT_QUADS: layout.quads,
        PRT_TEXELS: layout.texels,
        PRT_COLUMNS: layout.columns,
        PRT_ROWS: layout.rows,
        PRT_CHANNELS: channels,
      },
      uniforms: {
        prtTransfer: { value: transfer },
        prtLight: { value: light },
        prtPeaks: { value: peaks },
        prtHolds: holds,
        ...uniforms,
      },
    };
    super(width, height, filter, what, drawing, single);
    this.light = light;
    this.peaks = peaks;
    this.holds = holds;
  }

  /** Whether a light and its peaks are summed at once. */
  get takesPeaks(): boolean {
    return this.light.length / 2 + 1 <= promised;
  }

  /** `light` is [column][3]; `holds`: no number is less than 0, of the rest and of the `peaks`, which are added. */
  set(light: ArrayLike<number>, holds = false, peaks?: ArrayLike<number>): void {
    packLight(this.light, light);
    if (peaks) packLight(this.peaks, peaks);
    this.holds.value = holds;
    setPeaks(this.material, peaks !== undefined);
    this.refresh();
  }
}

/**
 * The two of a light: its rest, and its peaks where it has any, which what is drawn adds up; or one picture of both,
 * where they can be added before.
 */
export class LightSums implements Sums {
  readonly rest: LightSum;
  /** That of the peaks is that of the rest where there are none. */
  readonly pictures: { rest: Texture; peaks: Texture };
  private peaks: LightSum | undefined;
  hasPeaks = false;

  /** `eachIsLight`: so is every row, and is held at 0 or above by itself. */
  constructor(
    private readonly make: () => LightSum,
    private readonly eachIsLight: boolean,
  ) {
    this.rest = make();
    this.pictures = { rest: this.rest.target.texture, peaks: this.rest.target.texture };
  }

  /** `light` is [column][3]. */
  set(light: ArrayLike<number>, peaks: ArrayLike<number> | undefined): void {
    const { eachIsLight } = this,
      inOne = eachIsLight && this.rest.takesPeaks;
    this.hasPeaks = peaks !== undefined && !inOne;
    this.rest.set(light, eachIsLight && peaks !== undefined, inOne ? peaks : undefined);
    if (!this.hasPeaks || !peaks) return;
    this.peaks ??= this.make();
    this.peaks.set(peaks, eachIsLight);
    this.pictures.peaks = this.peaks.target.texture;
  }

  update(renderer: WebGLRenderer): void {
    this.rest.update(renderer);
    if (this.hasPeaks) this.peaks!.update(renderer);
  }

  dispose(): void {
    this.rest.dispose();
    this.peaks?.dispose();
  }
}
