// A MeshBasicMaterial that looks exit radiance up in a picture that was summed before: by receivers of its vertices,
// over an atlas, or as the picture itself, whose receivers are its pixels.
import { MeshBasicMaterial, type Material, type Texture, type WebGLProgramParametersWithUniforms } from 'three';
import { setPeaks } from './light_sum.js';
import { copyNodes } from './node_edition.js';
import { chainHooks, diffuseParameters, replaceOnce, useExitRadiance } from './prt_material.js';
import { drawFilter, type Drawn } from './see_through.js';
import { sumColumns, type ShownSums } from './shown_sums.js';

/** Where receivers lie. */
export type ShownOver =
  | { at: 'vertices'; twoSided: boolean }
  | { at: 'texels'; twoSided: boolean; width: number; height: number }
  /** Values are of what a pixel sees, its colour included; `coverage`: how much of it that fills. */
  | { at: 'view'; twoSided: false; width: number; height: number; coverage: Texture };

const vertexDeclarations = /* glsl */ `
#ifdef PRT_PLACED
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
  uniform highp sampler2D prtSums;
  vec3 prtLookUp( const in uint receiver ) {
    if ( receiver == 0xffffffffu ) return vec3( 0.0 );
    int r = int( receiver );
    return texelFetch( prtSums, ivec2( r % ${sumColumns}, r / ${sumColumns} ), 0 ).rgb;
  }
#endif
`;
const vertexBody = /* glsl */ `
  #ifdef PRT_PLACED
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
#ifdef PRT_PLACED
  uniform highp sampler2D prtSums;
  #ifdef PRT_PEAKS
    uniform highp sampler2D prtPeakSums;
  #endif
  #ifdef PRT_VIEW
    uniform highp sampler2D prtCoverage;
  #endif
  varying vec2 vPrtFront;
  #ifdef PRT_TWO_SIDED
    varying vec2 vPrtBack;
  #endif
  vec4 prtTexel( const in ivec2 place ) {
    ivec2 at = clamp( place, ivec2( 0 ), ivec2( PRT_WIDTH - 1, PRT_HEIGHT - 1 ) );
    float covered = 1.0;
    #ifdef PRT_VIEW
      covered = texelFetch( prtCoverage, at, 0 ).r;
      int i = at.y * PRT_WIDTH + at.x;
      at = ivec2( i % ${sumColumns}, i / ${sumColumns} );
    #endif
    vec3 value = texelFetch( prtSums, at, 0 ).rgb;
    #ifdef PRT_PEAKS
      value += texelFetch( prtPeakSums, at, 0 ).rgb;
    #endif
    return vec4( value, covered );
  }
  // By hand, since graphics cards need not filter single floats.
  vec4 prtHere() {
    vec2 place = vPrtFront;
    #ifdef PRT_TWO_SIDED
      if ( ! gl_FrontFacing ) place = vPrtBack;
    #endif
    vec2 low = floor( place - 0.5 ), share = place - 0.5 - low;
    ivec2 at = ivec2( low );
    return mix( mix( prtTexel( at ), prtTexel( at + ivec2( 1, 0 ) ), share.x ),
                mix( prtTexel( at + ivec2( 0, 1 ) ), prtTexel( at + ivec2( 1, 1 ) ), share.x ), share.y );
  }
  vec3 prtExitRadiance() {
    vec4 here = prtHere();
    return here.rgb / max( here.a, 1e-6 );
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

export class ShownMaterial extends MeshBasicMaterial {
  /** `gain`: signed, in false colour; +-1 / gain are the ends of the scale. */
  constructor(
    readonly sums: ShownSums,
    readonly over: ShownOver,
    source: Material,
    readonly gain?: { value: number },
  ) {
    super(gain ? { side: source.side, transparent: source.transparent } : diffuseParameters(source));
    this.defines = {
      ...(over.at !== 'vertices' && { PRT_PLACED: '', PRT_WIDTH: over.width, PRT_HEIGHT: over.height }),
      ...(over.at === 'view' && { PRT_VIEW: '' }),
      ...(over.twoSided && { PRT_TWO_SIDED: '' }),
      ...(gain && { PRT_FALSE_COLOR: '' }),
    };
    if (gain) this.toneMapped = false;
    chainHooks(
      this,
      (shader) => this.patch(shader),
      () => 'lambent shown', // the rest is in the defines
    );
  }

  override clone(): this {
    const made = new ShownMaterial(this.sums, this.over, this, this.gain).copy(this);
    copyNodes(this, made);
    return made as this;
  }

  override onBeforeRender(...drawn: Drawn): void {
    this.sums.update(drawn[0], drawn[4]);
    setPeaks(this, this.sums.hasPeaks);
    drawFilter(this, ...drawn);
  }

  private patch(shader: WebGLProgramParametersWithUniforms): void {
    const { sums, over, gain } = this;
    Object.assign(
      shader.uniforms,
      { prtSums: sums.rest, prtPeakSums: sums.peaks },
      over.at === 'view' && { prtCoverage: { value: over.coverage } },
      gain && { prtGain: gain },
    );
    shader.vertexShader =
      vertexDeclarations +
      replaceOnce(shader.vertexShader, '#include <fog_vertex>', '#include <fog_vertex>' + vertexBody);
    shader.fragmentShader = useExitRadiance(shader.fragmentShader, fragmentDeclarations, gain !== undefined);
    if (over.at === 'view')
      shader.fragmentShader = replaceOnce(
        shader.fragmentShader,
        '#include <opaque_fragment>',
        'diffuseColor.a *= prtHere().a;\n#include <opaque_fragment>',
      );
  }
}
