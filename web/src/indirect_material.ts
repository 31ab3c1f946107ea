// A MeshLambertMaterial that adds the light that has bounced: what lamps send straight is three's own, with its shadow
// maps, sharp at the pixel; what is read of surfels is looked up, at vertices or over an atlas.
import {
  Color,
  DoubleSide,
  MeshLambertMaterial,
  ShaderChunk,
  type IUniform,
  type Material,
  type MeshStandardMaterial,
  type Texture,
  type WebGLProgramParametersWithUniforms,
} from 'three';
import { copyNodes } from './node_edition.js';
import { chainHooks, diffuseParameters, replaceOnce } from './prt_material.js';

/** Receivers a row of the picture. */
export const pictureColumns = 2048;

/** What all materials of a file share. */
export interface IndirectUniforms extends Record<string, IUniform> {
  prtLight: IUniform<Texture>;
  /** 1 or 0: what is shown of lamps and of what surfaces send out by themselves. */
  prtDirect: IUniform<number>;
}

const vertexDeclarations = /* glsl */ `
#ifdef PRT_ATLAS
  attribute vec2 lambentPlace;
  varying vec2 vPrtFront;
  #ifdef PRT_TWO_SIDED
    attribute vec2 lambentPlaceBack;
    varying vec2 vPrtBack;
  #endif
#else
  attribute uint lambentReceiver;
  varying vec3 vPrtFront;
  #ifdef PRT_TWO_SIDED
    attribute uint lambentReceiverBack;
    varying vec3 vPrtBack;
  #endif
  uniform highp sampler2D prtLight;
  vec3 prtLookUp( const in uint receiver ) {
    if ( receiver == 0xffffffffu ) return vec3( 0.0 );
    int r = int( receiver );
    return texelFetch( prtLight, ivec2( r % ${pictureColumns}, r / ${pictureColumns} ), 0 ).rgb;
  }
#endif
`;
const vertexBody = /* glsl */ `
  #ifdef PRT_ATLAS
    vPrtFront = lambentPlace;
    #ifdef PRT_TWO_SIDED
      vPrtBack = lambentPlaceBack;
    #endif
  #else
    vPrtFront = prtLookUp( lambentReceiver );
    #ifdef PRT_TWO_SIDED
      vPrtBack = prtLookUp( lambentReceiverBack );
    #endif
  #endif
`;
const fragmentDeclarations = /* glsl */ `
uniform float prtDirect;
#ifdef PRT_ATLAS
  uniform highp sampler2D prtLight;
  varying vec2 vPrtFront;
  #ifdef PRT_TWO_SIDED
    varying vec2 vPrtBack;
  #endif
  // By hand, since graphics cards need not filter single floats.
  vec3 prtTexel( const in ivec2 at ) {
    return texelFetch( prtLight, clamp( at, ivec2( 0 ), textureSize( prtLight, 0 ) - 1 ), 0 ).rgb;
  }
  vec3 prtExitRadiance() {
    vec2 place = vPrtFront;
    #ifdef PRT_TWO_SIDED
      if ( ! gl_FrontFacing ) place = vPrtBack;
    #endif
    vec2 low = floor( place - 0.5 ), share = place - 0.5 - low;
    ivec2 at = ivec2( low );
    return mix( mix( prtTexel( at ), prtTexel( at + ivec2( 1, 0 ) ), share.x ),
                mix( prtTexel( at + ivec2( 0, 1 ) ), prtTexel( at + ivec2( 1, 1 ) ), share.x ), share.y );
  }
#else
  varying vec3 vPrtFront;
  #ifdef PRT_TWO_SIDED
    varying vec3 vPrtBack;
  #endif
  vec3 prtExitRadiance() {
    #ifdef PRT_TWO_SIDED
      if ( ! gl_FrontFacing ) return vPrtBack;
    #endif
    return vPrtFront;
  }
#endif
`;
const fragmentBody = /* glsl */ `
  reflectedLight.directDiffuse *= prtDirect;
  totalEmissiveRadiance *= prtDirect;
  reflectedLight.indirectDiffuse += diffuseColor.rgb * max( prtExitRadiance(), vec3( 0.0 ) );
`;

/** three's lights, falling off as KHR_lights_punctual has spots and without a limit near lamps, as lambent has both. */
const lights = (): string =>
  replaceOnce(
    replaceOnce(
      ShaderChunk.lights_pars_begin,
      'smoothstep( coneCosine, penumbraCosine, angleCosine )',
      'pow2( clamp( ( angleCosine - coneCosine ) / max( penumbraCosine - coneCosine, 1e-4 ), 0.0, 1.0 ) )',
    ),
    'max( pow( lightDistance, decayExponent ), 0.01 )',
    'max( pow( lightDistance, decayExponent ), 1e-18 )',
  );

type Glowing = Partial<Pick<MeshStandardMaterial, 'emissive' | 'emissiveIntensity'>>;

export class IndirectMaterial extends MeshLambertMaterial {
  /** What the surface sends out by itself. */
  readonly glow: Color;

  constructor(
    readonly shared: IndirectUniforms,
    readonly over: { atlas: boolean; twoSided: boolean },
    source: Material & Glowing,
  ) {
    super({
      ...diffuseParameters(source),
      ...(source.emissive && { emissive: source.emissive }),
      ...(source.emissiveIntensity !== undefined && { emissiveIntensity: source.emissiveIntensity }),
    });
    this.glow = this.emissive.clone();
    this.shadowSide = DoubleSide; // rays meet either side
    this.defines = { ...(over.atlas && { PRT_ATLAS: '' }), ...(over.twoSided && { PRT_TWO_SIDED: '' }) };
    chainHooks(
      this,
      (shader) => this.patch(shader),
      () => 'lambent indirect',
    );
  }

  override clone(): this {
    const made = new IndirectMaterial(this.shared, this.over, this).copy(this);
    copyNodes(this, made);
    return made as this;
  }

  private patch(shader: WebGLProgramParametersWithUniforms): void {
    Object.assign(shader.uniforms, this.shared);
    shader.vertexShader =
      vertexDeclarations +
      replaceOnce(shader.vertexShader, '#include <fog_vertex>', '#include <fog_vertex>' + vertexBody);
    const lit = replaceOnce(shader.fragmentShader, '#include <lights_pars_begin>', lights());
    shader.fragmentShader =
      fragmentDeclarations +
      replaceOnce(lit, '#include <lights_fragment_end>', '#include <lights_fragment_end>' + fragmentBody);
  }
}
