// A MeshBasicMaterial whose "white" is the exit radiance of the vertex's receiver, transfer . light, so that colour,
// texture, vertex colours, fog, clipping, skinning and tone mapping are three's own.
import {
  MeshBasicMaterial,
  type DataArrayTexture,
  type DataTexture,
  type Material,
  type Matrix3,
  type MeshBasicMaterialParameters,
  type WebGLProgramParametersWithUniforms,
} from 'three';
import type { BlockLayout } from './block_texture.js';
import { checkInstances, isInstanced } from './instanced.js';
import { setPeaks } from './light_sum.js';
import { copyNodes } from './node_edition.js';
import { drawFilter, glassParameters, type Drawn } from './see_through.js';
import { glossFragmentDeclarations, glossVaryings, glossVertexBody } from './outgoing.js';
import type { TurnedSums } from './turned.js';
import type { VertexSums } from './vertex_sum.js';

/** Replaces one piece of a shader of three's; fails loudly where another version of three has no such piece. */
export function replaceOnce(shader: string, piece: string, by: string): string {
  const at = shader.indexOf(piece);
  if (at < 0) throw new Error(`this version of three.js has no "${piece}" where lambent-three builds on it`);
  return shader.slice(0, at) + by + shader.slice(at + piece.length);
}

export const whiteLine = 'reflectedLight.indirectDiffuse += vec3( 1.0 );';

/** Copies what a diffuse surface has from a material of three's own. */
export function diffuseParameters(source: Material): MeshBasicMaterialParameters {
  const from = source as Partial<MeshBasicMaterial> & Material;
  const own: MeshBasicMaterialParameters = {
    name: source.name,
    side: source.side,
    transparent: source.transparent,
    opacity: source.opacity,
    alphaTest: source.alphaTest,
    depthWrite: source.depthWrite,
    depthTest: source.depthTest,
    vertexColors: source.vertexColors,
    visible: source.visible,
    ...(from.color && { color: from.color }),
    ...(from.map && { map: from.map }),
    ...(from.alphaMap && { alphaMap: from.alphaMap }),
  };
  return glassParameters(source, own);
}

/** Uniforms that all materials of one file share. */
export interface PrtUniforms {
  /** block_texture.ts */
  prtTransfer: { value: DataArrayTexture };
  /** 3 ceil(order^2 / 4) vec4: coefficients of red, then green, then blue, padded with zeros. */
  prtLight: { value: Float32Array };
  /** The same of the light's peaks; prtLight is the rest then. */
  prtPeaks: { value: Float32Array };
  /** Whether there are any; no shader's. */
  prtHasPeaks: { value: boolean };
  [name: string]: { value: unknown };
}

/** What a kind of transfer adds to the vertex shader. */
export interface PrtShader {
  /** Of programs: the same for the same GLSL. */
  key: string;
  /**
   * Defines vec3 prtRadiance( uint receiver ), from prtValues( receiver, k ), prtLight and prtFrame, and where there is
   * PRT_PEAKS prtPeaks; with `gloss`, prtReflect in its place (outgoing.ts).
   */
  radiance: string;
  gloss?: boolean;
  /** Whether prtFrame is asked for. */
  turns: boolean;
  /**
   * Whether values are those of transfer . light and nothing else: they are summed when the light changes, `radiance`
   * looks the sums up (vertex_sum.ts), and nodes draw the same.
   */
  summed?: boolean;
  defines?: Record<string, number>;
}

export interface PrtOptions {
  order: number;
  layout: BlockLayout;
  channels: 1 | 3;
  shader: PrtShader;
  /**
   * The pose that was baked, where the kind turns: bone matrices, four texels a bone as in three's own bone texture, or
   * the inverse of the mesh's.
   */
  rest?: { bones: DataTexture } | { inverse: Matrix3 };
  /** Vertices have receivers on their back as well. */
  twoSided: boolean;
  /** Instead of light: transfer . light, signed, in false colour; +-1 / gain are the ends of the scale. */
  falseColor?: { gain: { value: number } };
  /** With a shader that is summed. */
  sums?: TurnedSums<VertexSums>;
}

const vertexDeclarations = /* glsl */ `
attribute uint lambentReceiver;
varying vec3 vPrtFront;
#ifdef PRT_TWO_SIDED
  attribute uint lambentReceiverBack;
  varying vec3 vPrtBack;
#endif
#ifndef PRT_SUMMED
uniform highp sampler2DArray prtTransfer;
uniform vec4 prtLight[ 3 * PRT_LIGHT_QUADS ];
#ifdef PRT_PEAKS
  uniform vec4 prtPeaks[ 3 * PRT_LIGHT_QUADS ];
#endif
// Light is not negative, nor is what a part of it gives (relight/dering.h).
vec3 prtHeld( const in vec3 rest, const in vec3 peaks ) {
  return max( rest, vec3( 0.0 ) ) + max( peaks, vec3( 0.0 ) );
}

// Values 4k .. 4k + 3 of a receiver.
vec4 prtValues( const in uint receiver, const in int k ) {
  int r = int( receiver );
  ivec3 at = ivec3( ( r & ( PRT_COLUMNS - 1 ) ) * PRT_TEXELS, ( r / PRT_COLUMNS ) & ( PRT_ROWS - 1 ),
                    r / ( PRT_COLUMNS * PRT_ROWS ) );
  return texelFetch( prtTransfer, at + ivec3( k, 0, 0 ), 0 );
}
#endif

#ifdef PRT_TURNS
  // How the surface stands now against the pose that was baked: a rotation of the world.
  mat3 prtFrame = mat3( 1.0 );
  #ifdef USE_SKINNING
    uniform highp sampler2D prtRestBones;
    mat3 prtRestBone( const in float i ) {
      int size = textureSize( prtRestBones, 0 ).x, j = int( i ) * 4, x = j % size, y = j / size;
      return mat3( texelFetch( prtRestBones, ivec2( x, y ), 0 ).xyz,
                   texelFetch( prtRestBones, ivec2( x + 1, y ), 0 ).xyz,
                   texelFetch( prtRestBones, ivec2( x + 2, y ), 0 ).xyz );
    }
  #else
    uniform mat3 prtRestInverse;
  #endif
  // The orthogonal part of a gradient of any size: Higham's iteration, whose error squares at each step. Flat gradients
  // keep the axes.
  mat3 prtOrthogonal( const in mat3 gradient ) {
    float size = sqrt( ( dot( gradient[ 0 ], gradient[ 0 ] ) + dot( gradient[ 1 ], gradient[ 1 ] ) +
                         dot( gradient[ 2 ], gradient[ 2 ] ) ) / 3.0 );
    mat3 q = gradient / max( size, 1e-30 );
    for ( int i = 0; i < 6; ++ i ) {
      if ( abs( determinant( q ) ) < 1e-6 ) return mat3( 1.0 );
      q = 0.5 * ( q + transpose( inverse( q ) ) );
    }
    return q;
  }
#endif
`;

const turnBody = /* glsl */ `
  #ifdef PRT_TURNS
    #ifdef USE_SKINNING
      mat3 prtNow = skinWeight.x * mat3( boneMatX ) + skinWeight.y * mat3( boneMatY ) +
                    skinWeight.z * mat3( boneMatZ ) + skinWeight.w * mat3( boneMatW );
      mat3 prtThen = skinWeight.x * prtRestBone( skinIndex.x ) + skinWeight.y * prtRestBone( skinIndex.y )
                   + skinWeight.z * prtRestBone( skinIndex.z ) + skinWeight.w * prtRestBone( skinIndex.w );
      prtFrame = prtOrthogonal( prtNow * inverse( prtThen ) );
    #else
      mat3 prtNow = mat3( modelMatrix );
      #ifdef USE_INSTANCING
        prtNow = prtNow * mat3( instanceMatrix );
      #endif
      prtFrame = prtOrthogonal( prtNow * prtRestInverse );
    #endif
  #endif
`;

const radianceBody = /* glsl */ `
  vPrtFront = prtRadiance( lambentReceiver );
  #ifdef PRT_TWO_SIDED
    vPrtBack = prtRadiance( lambentReceiverBack );
  #endif
`;

// The scale runs from dark to bright, so that it is read without colour vision: navy -1, grey 0, pale yellow +1.
export const falseColorScale = /* glsl */ `
#ifdef PRT_FALSE_COLOR
  uniform float prtGain;
  vec3 prtScale( const in float value ) {
    vec3 negative = mix( vec3( 0.212, 0.212, 0.212 ), vec3( 0.004, 0.013, 0.082 ), clamp( - value, 0.0, 1.0 ) );
    vec3 positive = mix( vec3( 0.212, 0.212, 0.212 ), vec3( 1.0, 0.871, 0.352 ), clamp( value, 0.0, 1.0 ) );
    return value < 0.0 ? negative : positive;
  }
#endif
`;

const fragmentDeclarations = /* glsl */ `
varying vec3 vPrtFront;
#ifdef PRT_TWO_SIDED
  varying vec3 vPrtBack;
#endif
vec3 prtExitRadiance() {
  #ifdef PRT_TWO_SIDED
    return gl_FrontFacing ? vPrtFront : vPrtBack;
  #else
    return vPrtFront;
  #endif
}
`;

/**
 * three's own fragment shader with prtExitRadiance() for white. `addsGloss`: and with prtGloss(), which base colour
 * does not tint; then both may be negative, and only their sum is clamped, that of the light's peaks by itself.
 */
export function useExitRadiance(
  fragmentShader: string,
  declarations: string,
  falseColor: boolean,
  addsGloss = false,
): string {
  const radiance = addsGloss ? 'prtExitRadiance()' : 'max( prtExitRadiance(), vec3( 0.0 ) )';
  // Under the program's lights (under_lights.ts), of which what is sent straight counts and nothing else.
  const takesLights = !fragmentShader.includes(whiteLine) && fragmentShader.includes('#define LAMBERT'),
    direct = `#include <lights_fragment_end>
  vec3 prtDirect = reflectedLight.directDiffuse;
  reflectedLight.directDiffuse = vec3( 0.0 );
  reflectedLight.indirectDiffuse = diffuseColor.rgb * ${radiance};`;
  const lit =
    falseColorScale +
    declarations +
    (takesLights
      ? replaceOnce(fragmentShader, '#include <lights_fragment_end>', direct)
      : replaceOnce(fragmentShader, whiteLine, `reflectedLight.indirectDiffuse += ${radiance};`));
  const gloss = `#ifdef PRT_PEAKS
    outgoingLight = max( outgoingLight + prtGloss(), vec3( 0.0 ) ) +
                    max( diffuseColor.rgb * prtPeakExitRadiance() + prtPeakGloss(), vec3( 0.0 ) );
  #else
    outgoingLight = max( outgoingLight + prtGloss(), vec3( 0.0 ) );
  #endif`;
  const last = falseColor
    ? `outgoingLight = prtScale( prtGain * luminance( prtExitRadiance()${addsGloss ? ' + prtGloss()' : ''} ) );`
    : addsGloss
      ? gloss
      : takesLights
        ? 'outgoingLight += prtDirect;'
        : '';
  return last ? replaceOnce(lit, '#include <opaque_fragment>', `${last}\n#include <opaque_fragment>`) : lit;
}

type Compile = Material['onBeforeCompile'];

/**
 * Puts `patch` before whatever a program sets as onBeforeCompile, and `key` before its customProgramCacheKey. A hook
 * that calls the one that it replaces, as is usual, does not patch again.
 */
export function chainHooks(
  material: Material,
  patch: (shader: WebGLProgramParametersWithUniforms) => void,
  key: () => string,
): void {
  const patched = new WeakSet<object>();
  let compile: Compile | undefined, cacheKey: (() => string) | undefined;
  Object.defineProperties(material, {
    onBeforeCompile: {
      configurable: true,
      get: (): Compile => {
        const own = compile;
        return (shader, renderer) => {
          if (!patched.has(shader)) patch(shader);
          patched.add(shader);
          own?.call(material, shader, renderer);
        };
      },
      set: (hook: Compile) => (compile = hook),
    },
    customProgramCacheKey: {
      configurable: true,
      get: () => {
        const own = cacheKey ?? (() => compile?.toString() ?? '');
        return () => `${key()} ${own.call(material)}`;
      },
      set: (hook: () => string) => (cacheKey = hook),
    },
  });
}

export class PrtMaterial extends MeshBasicMaterial {
  constructor(
    readonly prtUniforms: PrtUniforms,
    readonly options: PrtOptions,
    parameters: MeshBasicMaterialParameters = {},
  ) {
    super(parameters);
    const { order, layout, channels, twoSided, falseColor, shader } = options;
    this.defines = {
      PRT_LIGHT_QUADS: Math.ceil((order * order) / 4),
      PRT_QUADS: layout.quads,
      PRT_TEXELS: layout.texels,
      PRT_COLUMNS: layout.columns,
      PRT_ROWS: layout.rows,
      PRT_CHANNELS: channels,
      ...(twoSided && { PRT_TWO_SIDED: '' }),
      ...(falseColor && { PRT_FALSE_COLOR: '' }),
      ...(shader.turns && { PRT_TURNS: '' }),
      ...(shader.summed && { PRT_SUMMED: '' }),
      ...shader.defines,
    };
    if (falseColor) this.toneMapped = false;
    chainHooks(
      this,
      (shader) => this.patch(shader),
      () => `lambent ${shader.key}`, // the rest is in the defines
    );
  }

  /** Under the same light, which relight() turns for both. */
  override clone(): this {
    const made = new PrtMaterial(this.prtUniforms, this.options).copy(this);
    copyNodes(this, made);
    return made as this;
  }

  override onBeforeRender(...drawn: Drawn): void {
    const { sums, rest } = this.options,
      object = drawn[4];
    sums?.update(drawn[0], object);
    if (rest && 'inverse' in rest && isInstanced(object)) checkInstances(object, rest.inverse);
    setPeaks(this, sums ? sums.hasPeaks : this.prtUniforms.prtHasPeaks.value);
    drawFilter(this, ...drawn);
  }

  private patch(shader: WebGLProgramParametersWithUniforms): void {
    const { falseColor, rest, sums, shader: kind } = this.options;
    Object.assign(
      shader.uniforms,
      sums ? { prtSums: sums.rest, prtPeakSums: sums.peaks } : this.prtUniforms,
      sums?.instances?.uniforms(this.prtUniforms.prtTransfer.value),
      falseColor && { prtGain: falseColor.gain },
      rest && ('bones' in rest ? { prtRestBones: { value: rest.bones } } : { prtRestInverse: { value: rest.inverse } }),
    );
    const declarations = vertexDeclarations + (kind.gloss ? glossVaryings : '') + kind.radiance,
      body = turnBody + (kind.gloss ? glossVertexBody : radianceBody);
    shader.vertexShader =
      declarations + replaceOnce(shader.vertexShader, '#include <fog_vertex>', '#include <fog_vertex>' + body);
    shader.fragmentShader = useExitRadiance(
      shader.fragmentShader,
      kind.gloss ? glossFragmentDeclarations : fragmentDeclarations,
      falseColor !== undefined,
      kind.gloss,
    );
  }
}
