// A MeshBasicMaterial whose "white" is the exit radiance of the vertex's receiver, transfer . light, so that colour, texture, vertex
// colours, fog, clipping, skinning and tone mapping are three's own.
import { MeshBasicMaterial, type Material, type WebGLProgramParametersWithUniforms, type DataArrayTexture, type MeshBasicMaterialParameters } from 'three';
import type { DiffuseLayout } from './diffuse_texture.js';

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
  return {
    name: source.name, side: source.side, transparent: source.transparent, opacity: source.opacity, alphaTest: source.alphaTest,
    depthWrite: source.depthWrite, depthTest: source.depthTest, vertexColors: source.vertexColors, visible: source.visible,
    ...(from.color && { color: from.color }), ...(from.map && { map: from.map }), ...(from.alphaMap && { alphaMap: from.alphaMap }),
  };
}

/** Uniforms that all materials of one file share. */
export interface PrtUniforms {
  /** diffuse_texture.ts */
  prtTransfer: { value: DataArrayTexture };
  /** 3 quads vec4: coefficients of red, then green, then blue, padded with zeros. */
  prtLight: { value: Float32Array };
}

export interface PrtOptions {
  layout: DiffuseLayout;
  channels: 1 | 3;
  /** Vertices have receivers on their back as well. */
  twoSided: boolean;
  /** Instead of light: transfer . light, signed, in false colour; +-1 / gain are the ends of the scale. */
  falseColor?: { gain: { value: number } };
}

const vertexDeclarations = /* glsl */ `
attribute uint lambentReceiver;
varying vec3 vPrtFront;
#ifdef PRT_TWO_SIDED
  attribute uint lambentReceiverBack;
  varying vec3 vPrtBack;
#endif
uniform highp sampler2DArray prtTransfer;
uniform vec4 prtLight[ 3 * PRT_QUADS ];

vec3 prtRadiance( const in uint receiver ) {
  if ( receiver == 0xffffffffu ) return vec3( 0.0 );
  int r = int( receiver );
  ivec3 at = ivec3( ( r & ( PRT_COLUMNS - 1 ) ) * PRT_TEXELS, ( r / PRT_COLUMNS ) & ( PRT_ROWS - 1 ), r / ( PRT_COLUMNS * PRT_ROWS ) );
  vec3 sum = vec3( 0.0 );
  for ( int k = 0; k < PRT_QUADS; ++ k ) {
    vec4 red = texelFetch( prtTransfer, at + ivec3( k, 0, 0 ), 0 );
    #if PRT_CHANNELS == 3
      vec4 green = texelFetch( prtTransfer, at + ivec3( PRT_QUADS + k, 0, 0 ), 0 );
      vec4 blue = texelFetch( prtTransfer, at + ivec3( 2 * PRT_QUADS + k, 0, 0 ), 0 );
    #else
      vec4 green = red, blue = red;
    #endif
    sum += vec3( dot( red, prtLight[ k ] ), dot( green, prtLight[ PRT_QUADS + k ] ), dot( blue, prtLight[ 2 * PRT_QUADS + k ] ) );
  }
  return sum;
}
`;

const vertexBody = /* glsl */ `
  vPrtFront = prtRadiance( lambentReceiver );
  #ifdef PRT_TWO_SIDED
    vPrtBack = prtRadiance( lambentReceiverBack );
  #endif
`;

// The scale runs from dark to bright, so that it is read without colour vision: navy -1, grey 0, pale yellow +1.
const fragmentDeclarations = /* glsl */ `
varying vec3 vPrtFront;
#ifdef PRT_TWO_SIDED
  varying vec3 vPrtBack;
#endif
#ifdef PRT_FALSE_COLOR
  uniform float prtGain;
  vec3 prtScale( const in float value ) {
    vec3 negative = mix( vec3( 0.212, 0.212, 0.212 ), vec3( 0.004, 0.013, 0.082 ), clamp( - value, 0.0, 1.0 ) );
    vec3 positive = mix( vec3( 0.212, 0.212, 0.212 ), vec3( 1.0, 0.871, 0.352 ), clamp( value, 0.0, 1.0 ) );
    return value < 0.0 ? negative : positive;
  }
#endif
vec3 prtExitRadiance() {
  #ifdef PRT_TWO_SIDED
    return gl_FrontFacing ? vPrtFront : vPrtBack;
  #else
    return vPrtFront;
  #endif
}
`;

export class PrtMaterial extends MeshBasicMaterial {
  constructor(
    readonly prtUniforms: PrtUniforms,
    readonly options: PrtOptions,
    parameters: MeshBasicMaterialParameters = {},
  ) {
    super(parameters);
    const { layout, channels, twoSided, falseColor } = options;
    this.defines = {
      PRT_QUADS: layout.quads, PRT_TEXELS: layout.texels, PRT_COLUMNS: layout.columns, PRT_ROWS: layout.rows, PRT_CHANNELS: channels,
      ...(twoSided && { PRT_TWO_SIDED: '' }), ...(falseColor && { PRT_FALSE_COLOR: '' }),
    };
    if (falseColor) this.toneMapped = false;
  }

  override onBeforeCompile(shader: WebGLProgramParametersWithUniforms): void {
    const { falseColor } = this.options;
    Object.assign(shader.uniforms, this.prtUniforms, falseColor && { prtGain: falseColor.gain });
    shader.vertexShader = vertexDeclarations + replaceOnce(shader.vertexShader, '#include <fog_vertex>', '#include <fog_vertex>' + vertexBody);
    shader.fragmentShader = fragmentDeclarations + replaceOnce(
      shader.fragmentShader, whiteLine, 'reflectedLight.indirectDiffuse += max( prtExitRadiance(), vec3( 0.0 ) );');
    if (falseColor)
      shader.fragmentShader = replaceOnce(shader.fragmentShader, '#include <opaque_fragment>',
        'outgoingLight = prtScale( prtGain * luminance( prtExitRadiance() ) );\n#include <opaque_fragment>');
  }

  override customProgramCacheKey(): string {
    return 'lambent diffuse'; // the rest is in the defines
  }
}
