// Visibility in blocks times light (times a lobe), a texel a receiver, in GLSL. Source: locally-adaptive-products,
// Algorithm 1; the light as block_light.ts has it, records as docs/file-format.md has them.
import { cardinalFunctions, fineCardinal, fineNodes, finePlace } from './block_light.js';

export const receiverColumns = 1024; // of the texture of receivers, two texels each
export const wordColumns = 2048; // of the texture of records, four bytes a word
export const pictureColumns = 2048;

/** What both pictures read. */
const reading = /* glsl */ `
precision highp float;
precision highp int;
uniform highp usampler2DArray prtSight;
uniform highp sampler2D prtReceivers;
uniform highp sampler2D prtBlockSums;
out vec4 radiance;

uint prtByte( const in uint at ) {
  ivec3 word = ivec3( int( ( at >> 2 ) & ${wordColumns - 1}u ), int( ( at >> 13 ) & 2047u ), int( at >> 24 ) );
  return ( texelFetch( prtSight, word, 0 ).r >> ( 8u * ( at & 3u ) ) ) & 255u;
}
// Irradiance of what three texels of sums hold.
vec3 prtMeet( highp sampler2D from, const in int x, const in int block, const in vec3 n ) {
  return vec3( dot( texelFetch( from, ivec2( x, block ), 0 ).xyz, n ),
               dot( texelFetch( from, ivec2( x + 1, block ), 0 ).xyz, n ),
               dot( texelFetch( from, ivec2( x + 2, block ), 0 ).xyz, n ) );
}

struct Changes { int count; uint where; uint levels; };
// Of the next mixed block, which begins at \`at\`; that moves on to the one after.
Changes prtChanges( inout uint at ) {
  uint count = prtByte( at ++ );
  if ( count > 127u ) count = ( count & 127u ) | ( prtByte( at ++ ) << 7 );
  Changes c = Changes( int( count ), at, at + count );
  at += PRT_BITS == 1 ? count : 2u * count;
  return c;
}
int prtLevel( const in Changes c, const in int i ) {
  return PRT_BITS == 1 ? 1 - ( i & 1 ) : int( prtByte( c.levels + uint( i ) ) );
}
const float prtScale = 1.0 / float( ( 1 << PRT_BITS ) - 1 );
// Line 9: light summed over what is seen of a block.
vec3 prtSeen( const in Changes c, const in int block, const in vec3 n ) {
  vec3 sum = vec3( 0.0 );
  int before = 0;
  for ( int i = 0; i < c.count; ++ i ) {
    int after = prtLevel( c, i );
    sum += float( after - before ) * prtScale *
           prtMeet( prtBlockSums, 3 * int( prtByte( c.where + uint( i ) ) ), block, n );
    before = after;
  }
  return sum;
}
`;

/** The receiver of a texel: its number, place, normal and where its record begins. */
const receiver = /* glsl */ `
  int r = int( gl_FragCoord.y ) * ${pictureColumns} + int( gl_FragCoord.x );
  radiance = vec4( 0.0, 0.0, 0.0, 1.0 );
  if ( r >= PRT_RECEIVERS ) return;
  ivec2 place = ivec2( 2 * ( r % ${receiverColumns} ), r / ${receiverColumns} );
  vec4 p = texelFetch( prtReceivers, place, 0 ), n = texelFetch( prtReceivers, place + ivec2( 1, 0 ), 0 );
  uint begin = uint( p.w ) | ( uint( n.w ) << 24 ), at = begin + uint( PRT_FLAG_BYTES ), flags = 0u;
`;
/** For each block that is seen: \`sight\`, 1 clear or 2 mixed. */
const eachBlock = /* glsl */ `
  for ( int b = 0; b < PRT_BLOCKS; ++ b ) {
    flags = ( b & 3 ) == 0 ? prtByte( begin + uint( b >> 2 ) ) : flags >> 2;
    uint sight = flags & 3u;
    if ( sight == 0u ) continue;
`;

/** Exit radiance of white by Lambert's law. */
export const diffuseShader = /* glsl */ `
${reading}
void main() {
  ${receiver}
  vec3 sum = vec3( 0.0 );
  ${eachBlock}
    sum += sight == 1u ? prtMeet( prtBlockSums, 0, b, n.xyz ) : prtSeen( prtChanges( at ), b, n.xyz );
  }
  radiance.rgb = sum * ${1 / Math.PI};
}`;

// Of each node, how much of a block's middle it makes, along one side.
const cardinal = cardinalFunctions(4);
const atMiddle = [0, 1, 2, 3].map((i) => (cardinal[16 * i + 7]! + cardinal[16 * i + 8]!) / 2);

/** Of each of the eight fine nodes along a side, how much of the lobe at the four others it makes. */
export const fineBetween: readonly (readonly number[])[] = Array.from({ length: fineNodes }, (_, node) =>
  [2, 6, 10, 14].map((x) => fineCardinal(node, x)),
);
/** Of the tolerance, what values at 64 nodes may miss at the 16. */
export const fineShare = 0.5;

/** Exit radiance towards the eye by the lobe alone. */
export const glossShader = /* glsl */ `
${reading}
uniform highp sampler2D prtCoarse;
uniform highp sampler2D prtFine;
uniform highp sampler2D prtBlockTexels;
uniform vec3 prtEye;
uniform float prtColour; // Phong's specular, or f0
uniform float prtWidth; // exponent, or alpha
uniform vec4 prtSamples; // cosines: one, nodes, fine, all

vec3 prtWo, prtMirror, prtNormal;
float prtCosO;

// The direction of a place in a block, in its texels.
vec3 prtDirection( const in int b, const in vec2 place ) {
  int side = PRT_CUBE / 16, face = b / ( side * side ), row = ( b / side ) % side, column = b % side;
  vec2 uv = ( vec2( float( 16 * column ), float( 16 * row ) ) + place ) * ( 2.0 / float( PRT_CUBE ) ) - 1.0;
  vec3 d = face == 0 ? vec3( 1.0, - uv.y, - uv.x ) : face == 1 ? vec3( - 1.0, - uv.y, uv.x )
         : face == 2 ? vec3( uv.x, 1.0, uv.y ) : face == 3 ? vec3( uv.x, - 1.0, - uv.y )
         : face == 4 ? vec3( uv.x, - uv.y, 1.0 ) : vec3( - uv.x, - uv.y, - 1.0 );
  return normalize( d );
}
vec3 prtNode( const in int b, const in int i ) {
  return prtDirection( b, vec2( float( 4 * ( i & 3 ) + 2 ), float( 4 * ( i >> 2 ) + 2 ) ) );
}

const float prtFinePlaces[ 8 ] = float[ 8 ]( ${Array.from({ length: fineNodes }, (_, i) => finePlace(i)).join(', ')} );
vec3 prtFineNode( const in int b, const in int i ) {
  return prtDirection( b, vec2( prtFinePlaces[ i & 7 ], prtFinePlaces[ i >> 3 ] ) );
}

// The lobe's BRDF.
float prtLobe( const in vec3 wi ) {
  #if PRT_MODEL == 1
    // Lafortune and Willems 1994.
    float c = clamp( dot( prtMirror, wi ), 0.0, 1.0 );
    return c > 1e-30 ? prtColour * ( prtWidth + 2.0 ) * ${1 / (2 * Math.PI)} * pow( c, prtWidth ) : 0.0;
  #else
    // Walter et al. 2007, Heitz 2014, Schlick's Fresnel.
    float cosI = dot( prtNormal, wi );
    if ( cosI <= 1e-6 ) return 0.0;
    vec3 h = wi + prtWo;
    float across = sqrt( max( dot( h, h ), 1e-12 ) );
    h /= across;
    float a2 = prtWidth * prtWidth, hz = max( dot( prtNormal, h ), 1e-6 );
    vec3 slope = cross( prtNormal, h );
    float s = dot( slope, slope ) / a2 + hz * hz;
    float rootI = 0.5 * sqrt( a2 * ( 1.0 - cosI * cosI ) + cosI * cosI ),
          rootO = 0.5 * sqrt( a2 * ( 1.0 - prtCosO * prtCosO ) + prtCosO * prtCosO );
    float lobe = ${1 / (4 * Math.PI)} / ( a2 * s * s * ( prtCosO * rootI + cosI * rootO ) );
    float q = max( 1.0 - 0.5 * across, 0.0 ), q2 = q * q;
    return lobe * mix( prtColour, 1.0, q2 * q2 * q );
  #endif
}

// Light times lobe over texels first .. end - 1 of a block.
vec3 prtRun( const in int b, const in int first, const in int end ) {
  vec3 sum = vec3( 0.0 );
  for ( int t = first; t < end; ++ t ) {
    vec3 e = texelFetch( prtBlockTexels, ivec2( 2 * t + 1, b ), 0 ).rgb;
    if ( e == vec3( 0.0 ) ) continue;
    vec3 d = texelFetch( prtBlockTexels, ivec2( 2 * t, b ), 0 ).xyz;
    sum += prtLobe( d ) * dot( prtNormal, d ) * e;
  }
  return sum;
}
vec3 prtRuns( const in Changes c, const in int b ) {
  vec3 sum = vec3( 0.0 );
  for ( int i = 0; i < c.count; ++ i ) {
    int level = prtLevel( c, i );
    if ( level == 0 ) continue;
    int first = int( prtByte( c.where + uint( i ) ) ),
        end = i + 1 < c.count ? int( prtByte( c.where + uint( i + 1 ) ) ) : 256;
    sum += float( level ) * prtScale * prtRun( b, first, end );
  }
  return sum;
}

mat4 prtValues; // at 16 nodes, [row][column]
// 1, 16 or more samples (1, 2, 3) for models of which nothing is known but values: 1 where they are alike, 16 where
// those give the middle's value back.
int prtByValues( const in int b, const in float middle ) {
  const float w[ 4 ] = float[ 4 ]( ${atMiddle.join(', ')} );
  float least = middle, most = middle, back = 0.0;
  for ( int i = 0; i < 16; ++ i ) {
    float value = prtLobe( prtNode( b, i ) );
    prtValues[ i >> 2 ][ i & 3 ] = value;
    least = min( least, value );
    most = max( most, value );
    back += value * w[ i & 3 ] * w[ i >> 2 ];
  }
  if ( ${Math.PI} * ( most - least ) < PRT_TOLERANCE ) return 1;
  return ${Math.PI} * abs( back - middle ) < 0.25 * PRT_TOLERANCE && most < 2.0 * least ? 2 : 3;
}

// Whether values at 64 nodes give back those at the 16, which lie between them.
bool prtIsFine( const in int b ) {
  const vec4 between[ 8 ] = vec4[ 8 ]( ${fineBetween.map((v) => `vec4( ${v.join(', ')} )`).join(', ')} );
  mat4 off = - prtValues;
  for ( int i = 0; i < 64; ++ i )
    off += prtLobe( prtFineNode( b, i ) ) * outerProduct( between[ i & 7 ], between[ i >> 3 ] );
  float most = 0.0;
  for ( int i = 0; i < 16; ++ i ) most = max( most, abs( off[ i >> 2 ][ i & 3 ] ) );
  return ${Math.PI} * most < ${fineShare} * PRT_TOLERANCE;
}

void main() {
  ${receiver}
  prtNormal = n.xyz;
  prtWo = normalize( prtEye - p.xyz );
  prtCosO = dot( prtNormal, prtWo );
  if ( ! ( prtCosO > 1e-6 ) ) return;
  prtMirror = 2.0 * prtCosO * prtNormal - prtWo;
  vec3 sum = vec3( 0.0 );
  ${eachBlock}
    bool clear = sight == 1u;
    Changes c = Changes( 0, 0u, 0u );
    if ( ! clear ) c = prtChanges( at );
    vec3 towards = prtDirection( b, vec2( 8.0 ) );
    float along = dot( prtMirror, towards ), middle = 0.0;
    int samples = along > prtSamples.w ? 4 : along > prtSamples.z ? 3 : along > prtSamples.y ? 2
                : along > prtSamples.x ? 1 : 0;
    if ( samples == 0 ) continue;
    if ( samples < 4 ) middle = prtLobe( towards );
    if ( samples > 1 && ! clear ) samples = 4;
    #if PRT_MODEL == 2
      if ( samples < 4 ) samples = max( samples, prtByValues( b, middle ) );
      // Samples below the horizon say nothing about the block's part above it.
      if ( ! clear && samples == 1 && dot( prtNormal, towards ) <= 0.0 ) samples = 4;
    #endif
    if ( samples == 3 && clear ) {
      // A texel that has much of the light is told by all samples alone.
      if ( texelFetch( prtFine, ivec2( 0, b ), 0 ).w > 0.5 ) samples = 4;
      #if PRT_MODEL == 2
        else if ( ! prtIsFine( b ) ) samples = 4;
      #endif
    }
    if ( samples == 1 ) {
      sum += middle * ( clear ? prtMeet( prtBlockSums, 0, b, prtNormal ) : prtSeen( c, b, prtNormal ) );
    } else if ( ! clear ) {
      sum += prtRuns( c, b );
    } else if ( samples == 4 ) {
      sum += prtRun( b, 0, 256 );
    } else if ( samples == 3 ) {
      for ( int i = 0; i < 64; ++ i ) sum += prtLobe( prtFineNode( b, i ) ) * prtMeet( prtFine, 3 * i, b, prtNormal );
    } else {
      for ( int i = 0; i < 16; ++ i ) sum += prtLobe( prtNode( b, i ) ) * prtMeet( prtCoarse, 3 * i, b, prtNormal );
    }
  }
  radiance.rgb = sum;
}`;
