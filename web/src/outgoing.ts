// The last reflection (docs/matrices.md; docs/file-format.md, "outgoing"): radiance = sum over rows (a(wo) + colour
// b(wo)) X, X = T . light, in the frame of each receiver: by a look-up in the material's map (map, svd), or by
// harmonics of the outgoing direction. Rows are of a matrix (matrix.ts) or of lobes (zonal.ts).
//
// Budget: 32 bytes a receiver for its frame and map, and 8 bytes a row and node of each map.
import {
  ClampToEdgeWrapping,
  DataTexture,
  FloatType,
  HalfFloatType,
  LinearFilter,
  NearestFilter,
  RGBAFormat,
  type WebGLRenderer,
} from 'three';
import { LambentError } from './errors.js';
import { isIndex, isViews } from './glb.js';
import { glslHarmonics } from './glsl_harmonics.js';
import type { TransferSource } from './kinds.js';
import { maxShOrder, shCount } from './sh.js';

/** Texels a row of what is stored receiver by receiver. */
export const rowWidth = 2048;
const mapWidth = 4096;
const kinds = ['map', 'svd', 'sh', 'hemisphere', 'hsh', 'phong'] as const;

export interface Outgoing {
  kind: (typeof kinds)[number];
  order: number;
  hasB: boolean;
  /** map, svd: nodes a side, and maps. */
  grid: number;
  maps: number;
}

/** Rows that the outgoing basis makes; those of maps are the header's. */
export function outgoingRows({ kind, order, hasB }: Outgoing, rows: number): number {
  if (kind === 'map' || kind === 'svd') return rows;
  return kind === 'phong' ? shCount(order) + 1 + Number(hasB) : shCount(order) * (hasB ? 2 : 1);
}

/** Tiles of one map's row each, side by side and then below: texels of all, width and height. */
export function mapLayout(grid: number, maps: number, rows: number): { across: number; width: number; height: number } {
  const across = Math.min(maps * rows, Math.floor(mapWidth / grid));
  return { across, width: across * grid, height: Math.ceil((maps * rows) / across) * grid };
}

/** [map][y][x][row][4] to tiles. */
export function packMaps(grid: number, maps: number, rows: number, values: Uint16Array): Uint16Array {
  const { across, width, height } = mapLayout(grid, maps, rows),
    out = new Uint16Array(4 * width * height);
  for (let m = 0, from = 0; m < maps; ++m)
    for (let y = 0; y < grid; ++y)
      for (let x = 0; x < grid; ++x)
        for (let r = 0; r < rows; ++r, from += 4) {
          const tile = m * rows + r,
            to = 4 * ((Math.floor(tile / across) * grid + y) * width + (tile % across) * grid + x);
          for (let c = 0; c < 4; ++c) out[to + c] = values[from + c]!;
        }
  return out;
}

/**
 * GLSL that adds to gloss (a X) and coloured (b X), given r, `wo` in the receiver's frame and its `view_map`; `row`
 * gives X.
 */
function weighRows({ kind, order, hasB }: Outgoing, row: string): string {
  const n = shCount(order);
  if (kind === 'map' || kind === 'svd')
    return `
  vec2 place = prtSquare( wo ) * float( PRT_GRID - 1 ) + 0.5;
  vec2 size = vec2( textureSize( prtMaps, 0 ) );
  for ( int row = 0; row < PRT_SUM_ROWS; ++ row ) {
    int tile = view_map * PRT_SUM_ROWS + row;
    vec2 corner = vec2( float( tile % PRT_ACROSS ), float( tile / PRT_ACROSS ) ) * float( PRT_GRID );
    vec4 w = textureLod( prtMaps, ( corner + place ) / size, 0.0 );
    vec3 x = ${row}( r, row );
    gloss += w.rgb * x, coloured += w.a * x;
  }`;
  if (kind === 'phong')
    return `
  vec3 n = vec3( - wo.xy, wo.z );
  ${glslHarmonics(order, (i, y) => `gloss += ( ${y} ) * ${row}( r, ${i} );`)}
  gloss += ${row}( r, ${n} );
  ${hasB ? `coloured += ${row}( r, ${n + 1} );` : ''}`;
  const scale = kind === 'hsh' ? `${Math.SQRT2} * ` : '';
  return `
  vec3 n = ${kind === 'hsh' ? 'vec3( 2.0 * sqrt( wo.z / ( 1.0 + wo.z ) ) * wo.xy, 2.0 * wo.z - 1.0 )' : 'wo'};
  ${glslHarmonics(order, (i, y) => {
    const gloss = `gloss += ( ${scale}${y} ) * ${row}( r, ${i} );`;
    return hasB ? `${gloss} coloured += ( ${scale}${y} ) * ${row}( r, ${n + i} );` : gloss;
  })}`;
}

const reflect = (outgoing: Outgoing, turns: boolean, name: string, row: string): string => /* glsl */ `
void ${name}( const in uint receiver, const in vec3 view, out vec3 gloss, out vec3 coloured ) {
  gloss = coloured = vec3( 0.0 );
  if ( receiver == 0xffffffffu ) return;
  int r = int( receiver ), i = 2 * r;
  vec4 tangent = texelFetch( prtFrames, ivec2( i % ${rowWidth}, i / ${rowWidth} ), 0 );
  vec3 normal = texelFetch( prtFrames, ivec2( ( i + 1 ) % ${rowWidth}, ( i + 1 ) / ${rowWidth} ), 0 ).xyz;
  vec3 wo = view * ( ${turns ? 'prtFrame * ' : ''}mat3( tangent.xyz, cross( normal, tangent.xyz ), normal ) );
  if ( wo.z < 0.0 ) wo = dot( wo.xy, wo.xy ) > 0.0 ? vec3( normalize( wo.xy ), 0.0 ) : vec3( 0.0, 0.0, 1.0 );
  int view_map = int( tangent.w );
  ${weighRows(outgoing, row)}
}`;

/**
 * GLSL: prtReflect( receiver, view, out gloss, out coloured ), from vec3 prtRow( receiver, row ); with `turns`, frames
 * turned by prtFrame. Where there is PRT_PEAKS, prtPeakReflect from prtPeakRow as well.
 */
export const glslReflect = (outgoing: Outgoing, turns: boolean): string => /* glsl */ `
uniform highp sampler2D prtFrames;
uniform highp sampler2D prtMaps;
// Of the upper hemisphere onto the disk and on to the unit square, equal areas (Shirley and Chiu).
vec2 prtSquare( const in vec3 wo ) {
  float flat2 = dot( wo.xy, wo.xy ), radius = sqrt( max( 1.0 - wo.z, 0.0 ) );
  vec2 d = flat2 > 0.0 ? wo.xy * ( radius * inversesqrt( flat2 ) ) : vec2( 0.0 );
  if ( d == vec2( 0.0 ) ) return vec2( 0.5 );
  vec2 ab;
  if ( abs( d.x ) > abs( d.y ) ) ab.x = sign( d.x ) * radius, ab.y = ab.x * 1.2732395447 * atan( d.y / d.x );
  else ab.y = sign( d.y ) * radius, ab.x = ab.y * 1.2732395447 * atan( d.x / d.y );
  return clamp( 0.5 * ( ab + 1.0 ), 0.0, 1.0 );
}
${reflect(outgoing, turns, 'prtReflect', 'prtRow')}
#ifdef PRT_PEAKS
  ${reflect(outgoing, turns, 'prtPeakReflect', 'prtPeakRow')}
#endif
`;

export const glossVaryings = /* glsl */ `
varying vec3 vPrtGloss;
#ifdef PRT_TWO_SIDED
  varying vec3 vPrtBackGloss;
#endif
#ifdef PRT_PEAKS
  varying vec3 vPrtPeak, vPrtPeakGloss;
  #ifdef PRT_TWO_SIDED
    varying vec3 vPrtBackPeak, vPrtBackPeakGloss;
  #endif
#endif
`;

export const glossVertexBody = /* glsl */ `
  vec4 prtPlace = vec4( transformed, 1.0 );
  #ifdef USE_INSTANCING
    prtPlace = instanceMatrix * prtPlace;
  #endif
  vec3 prtView = isOrthographic ? vec3( viewMatrix[ 0 ][ 2 ], viewMatrix[ 1 ][ 2 ], viewMatrix[ 2 ][ 2 ] )
                                : normalize( cameraPosition - ( modelMatrix * prtPlace ).xyz );
  #ifdef PRT_TURN_BACK
    #ifdef USE_INSTANCING
      prtView = transpose( prtInstanceTurn() ) * prtView;
    #else
      prtView = prtTurnBack * prtView;
    #endif
  #endif
  prtReflect( lambentReceiver, prtView, vPrtGloss, vPrtFront );
  #ifdef PRT_TWO_SIDED
    prtReflect( lambentReceiverBack, prtView, vPrtBackGloss, vPrtBack );
  #endif
  #ifdef PRT_PEAKS
    prtPeakReflect( lambentReceiver, prtView, vPrtPeakGloss, vPrtPeak );
    #ifdef PRT_TWO_SIDED
      prtPeakReflect( lambentReceiverBack, prtView, vPrtBackPeakGloss, vPrtBackPeak );
    #endif
  #endif
`;

export const glossFragmentDeclarations = /* glsl */ `
varying vec3 vPrtFront, vPrtGloss;
#ifdef PRT_TWO_SIDED
  varying vec3 vPrtBack, vPrtBackGloss;
  vec3 prtExitRadiance() { return gl_FrontFacing ? vPrtFront : vPrtBack; }
  vec3 prtGloss() { return gl_FrontFacing ? vPrtGloss : vPrtBackGloss; }
#else
  vec3 prtExitRadiance() { return vPrtFront; }
  vec3 prtGloss() { return vPrtGloss; }
#endif
#ifdef PRT_PEAKS
  varying vec3 vPrtPeak, vPrtPeakGloss;
  #ifdef PRT_TWO_SIDED
    varying vec3 vPrtBackPeak, vPrtBackPeakGloss;
    vec3 prtPeakExitRadiance() { return gl_FrontFacing ? vPrtPeak : vPrtBackPeak; }
    vec3 prtPeakGloss() { return gl_FrontFacing ? vPrtPeakGloss : vPrtBackPeakGloss; }
  #else
    vec3 prtPeakExitRadiance() { return vPrtPeak; }
    vec3 prtPeakGloss() { return vPrtPeakGloss; }
  #endif
#endif
`;

/** What all materials of one file share. */
export interface LastReflection {
  outgoing: Outgoing;
  rows: number;
  frames: DataTexture;
  maps: DataTexture;
}

export const reflectionDefines = ({ outgoing, rows }: LastReflection): Record<string, number> => ({
  PRT_SUM_ROWS: rows,
  PRT_GRID: outgoing.grid,
  PRT_ACROSS: mapLayout(outgoing.grid, outgoing.maps, rows).across,
});
export const reflectionUniforms = ({ frames, maps }: LastReflection): Record<string, { value: DataTexture }> => ({
  prtFrames: { value: frames },
  prtMaps: { value: maps },
});
export const reflectionKey = ({ outgoing: { kind, order, hasB } }: LastReflection): string =>
  `${kind} ${order} ${hasB}`; // the rest is in the defines
export const reflectionBytes = ({ frames, maps }: LastReflection): number =>
  frames.image.data!.byteLength + maps.image.data!.byteLength;

export function checkReflection(
  { frames, maps }: LastReflection,
  { capabilities: { maxTextureSize } }: WebGLRenderer,
): void {
  for (const { image } of [frames, maps])
    if (Math.max(image.width, image.height) > maxTextureSize)
      throw new LambentError(
        `takes a texture of ${image.width} x ${image.height} texels, where this graphics card takes ${maxTextureSize}`,
      );
}

const isKind = (value: unknown): value is Outgoing['kind'] => kinds.some((kind) => kind === value);

/** What a matrix has beside its header; refuses what does not fit. */
export function readOutgoing(transfer: TransferSource['extension']['transfer']): {
  outgoing: Outgoing;
  rows: number;
  views: Record<string, unknown>;
} {
  const given = transfer['outgoing'];
  if (typeof given !== 'object' || given === null) throw new LambentError('holds a matrix and no "outgoing"');
  const views = given as Record<string, unknown>,
    { kind, order, hasB, grid, mapCount } = views,
    // Factors are multiplied by the light, to rows of the map's basis.
    rows = transfer.kind === 'factors' ? Number(order) ** 2 : transfer['rows'];
  if (!isKind(kind))
    throw new LambentError(`holds the outgoing basis "${String(kind)}", which this version does not know`);
  if (!isIndex(order, maxShOrder) || order < 1) throw new LambentError('the outgoing "order" is out of range');
  if (!isIndex(rows, 2 * maxShOrder * maxShOrder) || rows < 1) throw new LambentError('"rows" is out of range');
  if (hasB !== undefined && typeof hasB !== 'boolean') throw new LambentError('"hasB" is neither true nor false');
  const isMapped = kind === 'map' || kind === 'svd';
  if (isMapped && (!isIndex(grid, 256) || grid < 2 || !isIndex(mapCount, 65535) || mapCount < 1))
    throw new LambentError('view maps have no size');
  const outgoing: Outgoing = {
    kind,
    order,
    hasB: hasB !== false,
    grid: isMapped ? (grid as number) : 2,
    maps: isMapped ? (mapCount as number) : 0,
  };
  if (outgoingRows(outgoing, rows) !== rows) throw new LambentError('"rows" does not fit the outgoing basis');
  return { outgoing, rows, views };
}

function texture(
  data: Float32Array | Uint16Array,
  width: number,
  height: number,
  filter: typeof NearestFilter | typeof LinearFilter,
): DataTexture {
  const made = new DataTexture(
    data,
    width,
    height,
    RGBAFormat,
    data instanceof Uint16Array ? HalfFloatType : FloatType,
  );
  made.minFilter = made.magFilter = filter;
  made.wrapS = made.wrapT = ClampToEdgeWrapping;
  made.generateMipmaps = false;
  made.needsUpdate = true;
  return made;
}

/** Reads frames and view maps. */
export async function loadLastReflection(source: TransferSource, receivers: number): Promise<LastReflection> {
  const { outgoing, rows, views } = readOutgoing(source.extension.transfer);
  const view = async (name: string, bytes: number): Promise<ArrayBuffer> => {
    const index = views[name];
    if (!isViews(index)) throw new LambentError(`the last reflection has no "${name}"`);
    const found = await source.bufferView(index);
    if (found.byteLength !== bytes)
      throw new LambentError(
        `the last reflection's "${name}" holds ${found.byteLength} bytes where its header makes ${bytes}`,
      );
    return found;
  };
  const frames = new Float32Array(await view('frames', 24 * receivers)),
    isMapped = outgoing.maps > 0;
  const mapOf = isMapped ? new Uint16Array(await view('mapOf', 2 * receivers)) : undefined;
  for (const m of mapOf ?? []) if (m >= outgoing.maps) throw new LambentError(`view map ${m} does not exist`);
  const placed = new Float32Array(4 * rowWidth * Math.ceil((2 * receivers) / rowWidth));
  for (let r = 0; r < receivers; ++r) {
    placed.set(frames.subarray(6 * r, 6 * r + 3), 8 * r);
    placed.set(frames.subarray(6 * r + 3, 6 * r + 6), 8 * r + 4);
    placed[8 * r + 3] = mapOf?.[r] ?? 0;
  }
  let maps = texture(new Uint16Array(4), 1, 1, NearestFilter);
  if (isMapped) {
    const { grid, maps: count } = outgoing,
      { width, height } = mapLayout(grid, count, rows);
    maps = texture(
      packMaps(grid, count, rows, new Uint16Array(await view('maps', 8 * count * grid * grid * rows))),
      width,
      height,
      LinearFilter,
    );
  }
  return { outgoing, rows, frames: texture(placed, rowWidth, placed.length / 4 / rowWidth, NearestFilter), maps };
}
