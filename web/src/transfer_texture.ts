// Transfer as a texture of zonal lobes (`lambent patch`, .lpt; docs/zonal.md) on any mesh with texture coordinates:
// relief that shades itself, still or bending. Follows: Sloan, Luna and Snyder, "Local, Deformable Precomputed Radiance
// Transfer" (2005), sections 5 and 6: each pixel takes the exact bands bilinearly and the lobes of the nearest texel,
// turns them into its own frame, and looks the light's bands up by direction (eq. 24 and 25).
//
// Budget: as a vertex has in block_texture.ts, a texel for a receiver; 8 * 128 * 64 * (order - 2) bytes for the table,
// drawn on the graphics card when the light changes.
import {
  LinearFilter,
  MeshBasicMaterial,
  RepeatWrapping,
  Vector2,
  type DataArrayTexture,
  type MeshBasicMaterialParameters,
  type WebGLProgramParametersWithUniforms,
  type WebGLRenderer,
} from 'three';
import {
  checkNodes,
  isNodeRenderer,
  setNodes,
  withoutEdition,
  type NodeEdition,
  type NodeRelief,
  type Renderer,
} from './node_edition.js';
import { blockTexture, packBlocks, type BlockLayout } from './block_texture.js';
import { LambentError } from './errors.js';
import { glslHarmonics } from './glsl_harmonics.js';
import type { Lighting } from './lighting.js';
import { DrawnPicture, packLight } from './light_sum.js';
import { replaceOnce, useExitRadiance } from './prt_material.js';
import { maxShOrder, shBand, shCount } from './sh.js';
import { exactZonalBands, maxLobes, zonalSum, zonalValues } from './zonal.js';

const maxSide = 4096,
  tableWidth = 128,
  tableHeight = 64;

export interface TransferTexture {
  width: number;
  height: number;
  order: number;
  lobes: number;
  channels: 1 | 3;
  /**
   * 0: a texture. Above: a table of grooves, columns places across one from border to border, rows depths from none to
   * this one, in widths of the groove.
   */
  grooveDepth: number;
  layout: BlockLayout;
  texture: DataArrayTexture;
}

/** The bytes of a .lpt file (transfer/zonal_texture.h). Throws LambentError, one sentence, where they are none. */
export function readTransferTexture(bytes: ArrayBuffer): TransferTexture {
  const view = new DataView(bytes),
    magic = bytes.byteLength >= 64 ? new TextDecoder('latin1').decode(new Uint8Array(bytes, 0, 8)) : '';
  if (!magic.startsWith('LMBTLPT'))
    throw new LambentError('is not a texture of zonal lobes (make one with "lambent patch")');
  if (magic === 'LMBTLPT2')
    throw new LambentError('is seen from views (`patch --views`), which "lambent render" alone draws');
  if (magic !== 'LMBTLPT1') throw new LambentError('is a texture of zonal lobes of another version');
  const [width, height, order, lobes, channels, valueBytes] = [0, 1, 2, 3, 4, 5].map((k) =>
    view.getUint32(8 + 4 * k, true),
  ) as [number, number, number, number, number, number];
  const isTable = view.getUint32(32, true),
    grooveDepth = isTable === 1 ? view.getFloat32(36, true) : 0;
  if (isTable > 1) throw new LambentError('is of a kind that is not known to this program');
  const within = (x: number, most: number): boolean => x >= 1 && x <= most;
  if (!within(width, maxSide) || !within(height, maxSide))
    throw new LambentError('its width or height is out of range');
  if (!within(order, maxShOrder) || !within(lobes, maxLobes) || (channels !== 1 && channels !== 3))
    throw new LambentError('its order, lobes or channels are out of range');
  if (valueBytes !== 2 && valueBytes !== 4) throw new LambentError('its precision is not known to this program');
  if (isTable && !(grooveDepth > 0 && grooveDepth <= 10 && width > 1 && height > 1))
    throw new LambentError('its grooves have no depth, or too few places');
  const header = {
    count: zonalValues(order, lobes, channels),
    channels: 1,
    precision: valueBytes === 2 ? 'half' : 'single',
    receivers: width * height,
  } as const;
  const { layout, data } = packBlocks(header, bytes.slice(64));
  return { width, height, order, lobes, channels, grooveDepth, layout, texture: blockTexture(layout, data) };
}

const vertexDeclarations = /* glsl */ `
varying vec3 vPrtPosition, vPrtNormal;
varying vec2 vPrtPlace;
`;
const vertexBody = /* glsl */ `
  vPrtPosition = ( modelMatrix * vec4( transformed, 1.0 ) ).xyz;
  #ifdef USE_SKINNING
    vPrtNormal = transpose( inverse( mat3( modelMatrix ) ) ) * objectNormal;
  #else
    vPrtNormal = transpose( inverse( mat3( modelMatrix ) ) ) * normal;
  #endif
  vPrtPlace = uv;
`;

/** Of eq. 24: the light's band l at each direction, azimuth by polar angle, bands below each other. */
const tableShader = (order: number, exact: number): string => /* glsl */ `
precision highp float;
uniform vec4 prtLight[ 3 * PRT_LIGHT_QUADS ];
out vec4 band;
vec3 prtLightAt( const in int k ) {
  int quad = k >> 2, at = k & 3;
  return vec3( prtLight[ quad ][ at ], prtLight[ PRT_LIGHT_QUADS + quad ][ at ],
               prtLight[ 2 * PRT_LIGHT_QUADS + quad ][ at ] );
}
void main() {
  ivec2 at = ivec2( gl_FragCoord.xy );
  int l = ${exact} + at.y / ${tableHeight};
  float phi = 6.28318531 * float( at.x ) / ${tableWidth}.0;
  float theta = 3.14159265 * float( at.y % ${tableHeight} ) / ${tableHeight - 1}.0;
  vec3 n = vec3( sin( theta ) * cos( phi ), sin( theta ) * sin( phi ), cos( theta ) ), sum = vec3( 0.0 );
  ${glslHarmonics(order, (index, y) =>
    shBand(index) < exact ? '' : `if ( l == ${shBand(index)} ) sum += ( ${y} ) * prtLightAt( ${index} );`,
  )}
  band = vec4( sum, 1.0 );
}`;

/** GLSL: prtFrame and v[], of a texture. */
const textureBody = ({ order, lobes, channels, width, height }: TransferTexture): string => {
  const exactValues = channels * shCount(exactZonalBands(order, lobes));
  return /* glsl */ `
  // The frame of the texture's directions: along +u, along -v, outward; left-handed where the texture is mirrored.
  vec2 ux = dFdx( vPrtPlace ), uy = dFdy( vPrtPlace );
  float area = ux.x * uy.y - ux.y * uy.x;
  vec3 along = px * uy.y - py * ux.y, down = py * ux.x - px * uy.x;
  if ( area < 0.0 ) along = - along, down = - down;
  along -= n * dot( n, along );
  if ( area != 0.0 && dot( along, along ) > 0.0 ) {
    along = normalize( along );
    vec3 up = cross( n, along );
    prtFrame = mat3( along, dot( up, down ) > 0.0 ? - up : up, n );
  } else prtFrame = prtFrameAbout( n );
  vec2 place = fract( vPrtPlace * prtTile ) * vec2( ${width}.0, ${height}.0 );
  vec2 corner = floor( place - 0.5 ), f = place - 0.5 - corner;
  ivec2 c = ivec2( corner ), nearest = ivec2( place );
  for ( int k = 0; k < PRT_QUADS; ++ k ) v[ k ] = prtTexel( nearest, k );
  for ( int k = 0; k < ${Math.ceil(exactValues / 4)}; ++ k ) {
    vec4 mean = prtMean( c, f, k );
    ${
      exactValues % 4 === 0
        ? 'v[ k ] = mean;'
        : `bvec4 exact = lessThan( ivec4( 4 * k ) + ivec4( 0, 1, 2, 3 ), ivec4( ${exactValues} ) );
    v[ k ] = mix( v[ k ], mean, vec4( exact ) );`
    }
  }`;
};

/** The same of a table of grooves, which lie side by side across the direction of the tile (section 4.2). */
const grooveBody = ({ width, height }: TransferTexture): string => /* glsl */ `
  // Right-handed: across the groove, in the plane of the normal, the way its place grows.
  float phase = dot( vPrtPlace, prtTile ), x = ( fract( phase ) - 0.5 ) / prtGroove.x, depth = prtGroove.y;
  vec3 area = cross( px, py ), across = dFdx( phase ) * cross( py, area ) + dFdy( phase ) * cross( area, px );
  across -= n * dot( n, across );
  float size = length( across );
  prtFrame = prtFrameAbout( n );
  if ( size > 0.0 ) {
    across /= size;
    prtFrame = mat3( across, cross( n, across ), n );
  }
  if ( ! ( abs( x ) < 0.5 ) ) x = 0.5, depth = 0.0; // the plane between grooves
  vec2 place = clamp( vec2( x + 0.5, depth ), 0.0, 1.0 ) * vec2( ${width - 1}.0, ${height - 1}.0 );
  ivec2 c = min( ivec2( place ), ivec2( ${width - 2}, ${height - 2} ) );
  // All numbers: lobes correspond over the table.
  for ( int k = 0; k < PRT_QUADS; ++ k ) v[ k ] = prtMean( c, place - vec2( c ), k );`;

const fragmentDeclarations = (transfer: TransferTexture): string => {
  const { order, lobes, channels, layout, width, height } = transfer,
    bands = order - exactZonalBands(order, lobes);
  return /* glsl */ `
#define PRT_QUADS ${layout.quads}
uniform highp sampler2DArray prtTransfer;
uniform highp sampler2D prtTable;
uniform vec2 prtTile;
uniform vec2 prtGroove; // width, of a repetition; depth, of the table's deepest
uniform vec4 prtLight[ 3 * ${Math.ceil(shCount(order) / 4)} ];
varying vec3 vPrtPosition, vPrtNormal;
varying vec2 vPrtPlace;
mat3 prtFrame = mat3( 1.0 );
vec3 prtBand( const in vec3 n, const in int l ) {
  vec2 at = vec2( atan( n.y, n.x ) * ${0.5 / Math.PI},
                  acos( clamp( n.z, - 1.0, 1.0 ) ) * ${(tableHeight - 1) / Math.PI} );
  float y = ( at.y + float( ${tableHeight} * l ) + 0.5 ) / ${tableHeight * Math.max(1, bands)}.0;
  return textureLod( prtTable, vec2( at.x + ${0.5 / tableWidth}, y ), 0.0 ).rgb;
}
${zonalSum(order, lobes, channels, { table: true })}
vec4 prtTexel( const in ivec2 place, const in int k ) {
  ivec2 p = ivec2( ( place.x + ${width} ) % ${width}, ( place.y + ${height} ) % ${height} );
  int r = p.y * ${width} + p.x;
  ivec3 at = ivec3( ( r & ${layout.columns - 1} ) * ${layout.texels}, ( r / ${layout.columns} ) & ${layout.rows - 1},
                    r / ${layout.columns * layout.rows} );
  return texelFetch( prtTransfer, at + ivec3( k, 0, 0 ), 0 );
}
vec4 prtMean( const in ivec2 c, const in vec2 f, const in int k ) {
  return mix( mix( prtTexel( c, k ), prtTexel( c + ivec2( 1, 0 ), k ), f.x ),
              mix( prtTexel( c + ivec2( 0, 1 ), k ), prtTexel( c + ivec2( 1, 1 ), k ), f.x ), f.y );
}
// The normal's frame where texture coordinates do not tell: frame_about() of the C++ library.
mat3 prtFrameAbout( const in vec3 n ) {
  float side = n.z < 0.0 ? - 1.0 : 1.0, a = - 1.0 / ( side + n.z ), b = n.x * n.y * a;
  return mat3( vec3( 1.0 + side * n.x * n.x * a, side * b, - side * n.x ),
               vec3( b, side + n.y * n.y * a, - n.y ), n );
}
vec3 prtExitRadiance() {
  vec3 px = dFdx( vPrtPosition ), py = dFdy( vPrtPosition ), n = normalize( vPrtNormal );
  if ( ! gl_FrontFacing ) n = - n;
  vec4 v[ PRT_QUADS ];
  ${transfer.grooveDepth > 0 ? grooveBody(transfer) : textureBody(transfer)}
  return prtSum( v );
}
`;
};

/**
 * What shows a transfer texture: white is its exit radiance, and all else a MeshBasicMaterial's own. Meshes need
 * texture coordinates and normals.
 */
export class TransferTextureMaterial extends MeshBasicMaterial {
  /**
   * Repetitions of the texture over the unit of texture coordinates. Grooves run where its product with those is
   * constant.
   */
  readonly tile = new Vector2(1, 1);
  /** Of a table of grooves: depth in widths of a groove, up to the table's; width in repetitions, (0, 1]. */
  readonly groove: { depth: number; width: number };
  private readonly grooveNow = new Vector2(1, 1);
  private readonly light: Float32Array;
  private readonly table: DrawnPicture;
  private readonly relief: NodeRelief | undefined; // for WebGPURenderer

  /** `nodes`, of lambent-three/webgpu: WebGPURenderer draws it, too. */
  constructor(
    readonly transfer: TransferTexture,
    parameters: MeshBasicMaterialParameters = {},
    nodes?: NodeEdition,
  ) {
    super(parameters);
    this.groove = { depth: transfer.grooveDepth, width: 1 };
    this.relief = nodes?.relief({
      transfer,
      tile: this.tile,
      groove: this.groove,
      width: tableWidth,
      height: tableHeight,
    });
    setNodes(this, this.relief?.nodes, `This surface ${withoutEdition}.`);
    const { order, lobes } = transfer,
      exact = exactZonalBands(order, lobes),
      quads = Math.ceil(shCount(order) / 4);
    this.light = new Float32Array(12 * quads);
    this.table = new DrawnPicture(
      tableWidth,
      tableHeight * Math.max(1, order - exact),
      LinearFilter,
      { size: 'takes a table', use: 'is lit by a table of directions' },
      {
        fragmentShader: tableShader(order, exact),
        defines: { PRT_LIGHT_QUADS: quads },
        uniforms: { prtLight: { value: this.light } },
      },
    );
    this.table.target.texture.wrapS = RepeatWrapping;
    this.defines = { PRT_TRANSFER_TEXTURE: '' };
  }

  /** Shows it under this light. A few hundred bytes of uniforms; the table is drawn before the next frame. */
  relight(lighting: Lighting): void {
    const light = lighting.coefficients(this.transfer.order);
    packLight(this.light, light);
    this.relief?.set(light);
    this.table.refresh();
  }

  /** Throws LambentError where the graphics card lacks what this is drawn with. */
  check(renderer: Renderer): void {
    if (isNodeRenderer(renderer)) return checkNodes(renderer, this.relief ? undefined : withoutEdition);
    this.table.check(renderer);
  }

  override onBeforeRender(renderer: WebGLRenderer): void {
    this.grooveNow.set(this.groove.width, this.groove.depth / (this.transfer.grooveDepth || 1));
    this.table.update(renderer);
  }

  override onBeforeCompile(shader: WebGLProgramParametersWithUniforms): void {
    Object.assign(shader.uniforms, {
      prtTransfer: { value: this.transfer.texture },
      prtTable: { value: this.table.target.texture },
      prtTile: { value: this.tile },
      prtGroove: { value: this.grooveNow },
      prtLight: { value: this.light },
    });
    shader.vertexShader =
      vertexDeclarations +
      replaceOnce(shader.vertexShader, '#include <fog_vertex>', '#include <fog_vertex>' + vertexBody);
    shader.fragmentShader = useExitRadiance(shader.fragmentShader, fragmentDeclarations(this.transfer), false);
  }

  override customProgramCacheKey(): string {
    const { order, lobes, channels, width, height, grooveDepth } = this.transfer;
    return `lambent transfer texture ${order} ${lobes} ${channels} ${width} ${height} ${grooveDepth > 0}`;
  }

  override dispose(): void {
    this.table.dispose();
    this.relief?.dispose();
    super.dispose();
  }
}
