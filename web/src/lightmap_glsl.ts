// What a lightmap's material adds to three's shaders: places in the atlas, rows by the normal map's normal, emission.
import { glslHarmonics } from './glsl_harmonics.js';
import { type Directional } from './header.js';
import { glslInstances } from './instanced.js';

export const vertexDeclarations = /* glsl */ `
#ifdef USE_INSTANCING
  flat varying highp int vPrtInstance;
#endif
attribute vec2 lambentPlace;
varying vec2 vPrtFront;
#ifdef PRT_TWO_SIDED
  attribute vec2 lambentPlaceBack;
  varying vec2 vPrtBack;
#endif
#ifdef PRT_DIRECTIONAL
  varying vec3 vPrtNormal, vPrtPosition;
#endif
#ifdef PRT_NORMAL_MAP
  attribute vec2 lambentNormalPlace;
  varying vec2 vPrtNormalPlace;
  uniform mat3 prtNormalTransform;
  #ifdef PRT_TANGENTS
    attribute vec4 lambentTangent;
    varying vec4 vPrtTangent;
  #endif
#endif
#ifdef PRT_EMISSIVE_MAP
  attribute vec2 lambentEmissivePlace;
  varying vec2 vPrtEmissivePlace;
  uniform mat3 prtEmissiveTransform;
#endif
`;
export const vertexBody = /* glsl */ `
  mat4 prtWorld = modelMatrix;
  #ifdef USE_INSTANCING
    vPrtInstance = gl_InstanceID;
    prtWorld = modelMatrix * instanceMatrix;
  #endif
  vPrtFront = lambentPlace;
  #ifdef PRT_TWO_SIDED
    vPrtBack = lambentPlaceBack;
  #endif
  #ifdef PRT_DIRECTIONAL
    vPrtNormal = transpose( inverse( mat3( prtWorld ) ) ) * normal;
    vPrtPosition = ( prtWorld * vec4( position, 1.0 ) ).xyz;
  #endif
  #ifdef PRT_NORMAL_MAP
    vPrtNormalPlace = ( prtNormalTransform * vec3( lambentNormalPlace, 1.0 ) ).xy;
    #ifdef PRT_TANGENTS
      vPrtTangent = vec4( mat3( prtWorld ) * lambentTangent.xyz, lambentTangent.w );
    #endif
  #endif
  #ifdef PRT_EMISSIVE_MAP
    vPrtEmissivePlace = ( prtEmissiveTransform * vec3( lambentEmissivePlace, 1.0 ) ).xy;
  #endif
`;
/**
 * E(n) / pi of the rows at a pixel, n the bent normal and N the surface's own, on the side that is seen
 * (transfer/directional.cpp).
 */
const evaluations: Record<Directional, string> = {
  none: '', // not asked for
  'sh:2': '',
  'sh:3': '', // below
  vector: `
  return max( n.x * prtRowAt( atlas, place, 0 ) + n.y * prtRowAt( atlas, place, 1 ) + n.z * prtRowAt( atlas, place, 2 ),
              vec3( 0.0 ) );`,
  hl2: `
  // Half-Life 2's directions in the frame about the surface's normal (frame_about of core/vec.h).
  float side = N.z < 0.0 ? - 1.0 : 1.0, a = - 1.0 / ( side + N.z ), b = N.x * N.y * a;
  mat3 frame = mat3( vec3( 1.0 + side * N.x * N.x * a, side * b, - side * N.x ),
                     vec3( b, side + N.y * N.y * a, - N.y ), N );
  mat3 axes = mat3( - 0.40824829, - 0.70710678, 0.57735027, - 0.40824829, 0.70710678, 0.57735027,
                    0.81649658, 0.0, 0.57735027 );
  vec3 cosines = max( n * ( frame * axes ), vec3( 0.0 ) );
  vec3 w = cosines * cosines;
  float total = w.x + w.y + w.z;
  if ( ! ( total > 0.0 ) ) return vec3( 0.0 );
  return ( w.x * prtRowAt( atlas, place, 0 ) + w.y * prtRowAt( atlas, place, 1 ) + w.z * prtRowAt( atlas, place, 2 ) ) /
         total;`,
};
const evaluation = (kind: Directional): string =>
  kind !== 'sh:2' && kind !== 'sh:3'
    ? evaluations[kind]
    : `vec3 sum = vec3( 0.0 );
  ${glslHarmonics(Number(kind[3]), (i, y) => `sum += ( ${y} ) * prtRowAt( atlas, place, ${i} );`)}
  return max( sum, vec3( 0.0 ) );`;

/** Rows of an instance, each of whose texels is summed where it is looked up. */
const ofInstances = (kind: Directional): string => /* glsl */ `
#ifdef USE_INSTANCING
flat varying highp int vPrtInstance;
${glslInstances('vPrtInstance')}
uniform highp usampler2D prtReceivers;
vec3 prtInstanceTexel( const in ivec2 at, const in int row, const in int part ) {
  uint receiver = texelFetch( prtReceivers, clamp( at, ivec2( 0 ), textureSize( prtReceivers, 0 ) - 1 ), 0 ).r;
  if ( receiver == 0xffffffffu ) return vec3( 0.0 );
  vec3 sum = prtInstanceSum( int( receiver ), row, part );
  ${kind === 'none' || kind === 'hl2' ? 'if ( prtInstancePeaks ) sum = max( sum, vec3( 0.0 ) );' : ''}
  return sum;
}
vec3 prtInstanceRow( const in vec2 place, const in int row, const in int part ) {
  vec2 low = floor( place - 0.5 ), share = place - 0.5 - low;
  ivec2 at = ivec2( low );
  return mix( mix( prtInstanceTexel( at, row, part ), prtInstanceTexel( at + ivec2( 1, 0 ), row, part ), share.x ),
              mix( prtInstanceTexel( at + ivec2( 0, 1 ), row, part ),
                   prtInstanceTexel( at + ivec2( 1, 1 ), row, part ), share.x ), share.y );
}
#ifdef PRT_DIRECTIONAL
  vec3 prtEvaluateInstance( const in int part, const in vec2 place, const in vec3 N, const in vec3 n ) {
    ${evaluation(kind).replaceAll(/prtRowAt\( atlas, place, (\d+) \)/g, 'prtInstanceRow( place, $1, part )')}
  }
#endif
#endif
`;

export const fragmentDeclarations = (kind: Directional): string => /* glsl */ `
${ofInstances(kind)}
uniform highp sampler2D prtAtlas;
#ifdef PRT_PEAKS
  uniform highp sampler2D prtPeakAtlas;
#endif
uniform vec3 prtEmission;
varying vec2 vPrtFront;
#ifdef PRT_TWO_SIDED
  varying vec2 vPrtBack;
#endif
#ifdef PRT_DIRECTIONAL
  varying vec3 vPrtNormal, vPrtPosition;
#endif
#ifdef PRT_NORMAL_MAP
  uniform sampler2D prtNormalMap;
  uniform float prtNormalScale;
  varying vec2 vPrtNormalPlace;
  #ifdef PRT_TANGENTS
    varying vec4 vPrtTangent;
  #endif
#endif
#ifdef PRT_EMISSIVE_MAP
  uniform sampler2D prtEmissiveMap;
  varying vec2 vPrtEmissivePlace;
#endif
// Rows lie below each other.
vec3 prtRowAt( highp sampler2D atlas, const in vec2 place, const in int row ) {
  vec2 size = vec2( textureSize( atlas, 0 ) );
  return texture( atlas, ( place + vec2( 0.0, size.y / float( PRT_ATLAS_ROWS ) * float( row ) ) ) / size ).rgb;
}
#ifdef PRT_DIRECTIONAL
  uniform mat3 prtTurnBack;
  vec3 prtEvaluate( highp sampler2D atlas, const in vec2 place, const in vec3 N, const in vec3 n ) {
    ${evaluation(kind)}
  }
  // The part of v that is square to n, as a unit vector; zero where v is nearly along n.
  vec3 prtSquareTo( const in vec3 v, const in vec3 n ) {
    float size = length( v );
    if ( ! ( size > 0.0 ) ) return vec3( 0.0 );
    vec3 t = v / size - n * dot( v / size, n );
    return length( t ) > 0.01 ? normalize( t ) : vec3( 0.0 );
  }
#endif
vec3 prtExitRadiance() {
  vec2 place = vPrtFront;
  #ifdef PRT_TWO_SIDED
    if ( ! gl_FrontFacing ) place = vPrtBack;
  #endif
  #if defined( USE_INSTANCING ) && ! defined( PRT_DIRECTIONAL )
    vec3 sum = prtInstanceRow( place, 0, 0 );
    if ( prtInstancePeaks ) sum += prtInstanceRow( place, 0, 1 );
    return sum;
  #elif ! defined( PRT_DIRECTIONAL )
    vec3 sum = prtRowAt( prtAtlas, place, 0 );
    #ifdef PRT_PEAKS
      sum += prtRowAt( prtPeakAtlas, place, 0 );
    #endif
    return sum;
  #else
    // Of the front: the normal, turned to its face's side, and what the normal map makes of it (scene/reflection.cpp).
    vec3 px = dFdx( vPrtPosition ), py = dFdy( vPrtPosition ), n = normalize( vPrtNormal );
    float side = gl_FrontFacing ? 1.0 : - 1.0;
    if ( side * dot( n, cross( px, py ) ) < 0.0 ) n = - n;
    vec3 bent = n;
    #ifdef PRT_NORMAL_MAP
      vec4 along = vec4( 0.0 );
      #ifdef PRT_TANGENTS
        along = vPrtTangent;
      #endif
      vec3 t = prtSquareTo( along.xyz, n );
      if ( t == vec3( 0.0 ) || along.w == 0.0 ) {
        vec2 ux = dFdx( vPrtNormalPlace ), uy = dFdy( vPrtNormalPlace );
        float area = ux.x * uy.y - ux.y * uy.x;
        along = vec4( ( px * uy.y - py * ux.y ) * sign( area ), side * area < 0.0 ? 1.0 : - 1.0 );
        t = prtSquareTo( along.xyz, n );
      }
      if ( t != vec3( 0.0 ) ) {
        vec3 texel = 2.0 * texture( prtNormalMap, vPrtNormalPlace ).xyz - 1.0;
        texel.xy *= prtNormalScale;
        bent = normalize( t * texel.x + cross( n, t ) * ( along.w > 0.0 ? texel.y : - texel.y ) + n * texel.z );
      }
    #endif
    #ifdef USE_INSTANCING
      mat3 back = transpose( prtInstanceTurn() );
      n = back * ( side * n ), bent = back * ( side * bent );
      vec3 total = prtEvaluateInstance( 0, place, n, bent );
      if ( prtInstancePeaks ) total += prtEvaluateInstance( 1, place, n, bent );
      return total;
    #endif
    n = prtTurnBack * ( side * n ), bent = prtTurnBack * ( side * bent ); // rows are in the axes of the bake
    vec3 sum = prtEvaluate( prtAtlas, place, n, bent );
    #ifdef PRT_PEAKS
      sum += prtEvaluate( prtPeakAtlas, place, n, bent );
    #endif
    return sum;
  #endif
}
vec3 prtEmitted() {
  #ifdef PRT_EMISSIVE_MAP
    return prtEmission * texture( prtEmissiveMap, vPrtEmissivePlace ).rgb;
  #else
    return prtEmission;
  #endif
}
`;
