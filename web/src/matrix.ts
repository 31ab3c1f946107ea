// Transfer matrices (docs/matrices.md; docs/file-format.md, kind "matrix"): radiance = sum over rows (a(wo) + colour b(wo)) X, X = T . light.
// X is drawn into a picture when the light changes (light_sum.ts); each frame the vertex shader weighs its rows by the view, in the frame of its
// receiver: by a look-up in the material's map (map, svd), or by harmonics of the outgoing direction.
//
// Budget a receiver: the transfer (packed as in block_texture.ts: rows * channels * ceil(order^2 / 4) * 8 bytes in half floats), 8 bytes a row for X,
// 32 for its frame and map; and 8 bytes a row and node of each map, 4 bytes a vertex (8 where surfaces have two sides).
import {
  ClampToEdgeWrapping, DataTexture, FloatType, HalfFloatType, LinearFilter, MeshBasicMaterial, NearestFilter, RGBAFormat, type DataArrayTexture, type Material, type Mesh,
  type WebGLProgramParametersWithUniforms, type WebGLRenderer,
} from 'three';
import { blockTexture, packBlocks, type BlockLayout } from './block_texture.js';
import { LambentError } from './errors.js';
import { isIndex } from './glb.js';
import { glslHarmonics } from './glsl_harmonics.js';
import { readHeader, type TransferHeader } from './header.js';
import type { BakedTransfer, TransferKind, TransferSource } from './kinds.js';
import type { Lighting } from './lighting.js';
import { afterAll, LightSum } from './light_sum.js';
import { diffuseParameters, replaceOnce, useExitRadiance } from './prt_material.js';
import { maxShOrder, shCount } from './sh.js';
import { bindPart } from './vertex_transfer.js';

const rowWidth = 2048, mapWidth = 4096;
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
  const { across, width, height } = mapLayout(grid, maps, rows), out = new Uint16Array(4 * width * height);
  for (let m = 0, from = 0; m < maps; ++m)
    for (let y = 0; y < grid; ++y)
      for (let x = 0; x < grid; ++x)
        for (let r = 0; r < rows; ++r, from += 4) {
          const tile = m * rows + r, to = 4 * ((Math.floor(tile / across) * grid + y) * width + (tile % across) * grid + x);
          for (let c = 0; c < 4; ++c) out[to + c] = values[from + c]!;
        }
  return out;
}

/** GLSL that adds to gloss (a X) and coloured (b X), given r, `wo` in the receiver's frame and its `view_map`. */
function weighRows({ kind, order, hasB }: Outgoing): string {
  const n = shCount(order);
  if (kind === 'map' || kind === 'svd')
    return `
  vec2 place = prtSquare( wo ) * float( PRT_GRID - 1 ) + 0.5;
  vec2 size = vec2( textureSize( prtMaps, 0 ) );
  for ( int row = 0; row < PRT_SUM_ROWS; ++ row ) {
    int tile = view_map * PRT_SUM_ROWS + row;
    vec4 w = textureLod( prtMaps, ( vec2( float( tile % PRT_ACROSS ), float( tile / PRT_ACROSS ) ) * float( PRT_GRID ) + place ) / size, 0.0 );
    vec3 x = prtRow( r, row );
    gloss += w.rgb * x, coloured += w.a * x;
  }`;
  if (kind === 'phong')
    return `
  vec3 n = vec3( - wo.xy, wo.z );
  ${glslHarmonics(order, (i, y) => `gloss += ( ${y} ) * prtRow( r, ${i} );`)}
  gloss += prtRow( r, ${n} );
  ${hasB ? `coloured += prtRow( r, ${n + 1} );` : ''}`;
  const scale = kind === 'hsh' ? `${Math.SQRT2} * ` : '';
  return `
  vec3 n = ${kind === 'hsh' ? 'vec3( 2.0 * sqrt( wo.z / ( 1.0 + wo.z ) ) * wo.xy, 2.0 * wo.z - 1.0 )' : 'wo'};
  ${glslHarmonics(order, (i, y) => `gloss += ( ${scale}${y} ) * prtRow( r, ${i} );${hasB ? ` coloured += ( ${scale}${y} ) * prtRow( r, ${n + i} );` : ''}`)}`;
}

const vertexDeclarations = (outgoing: Outgoing): string => /* glsl */ `
attribute uint lambentReceiver;
varying vec3 vPrtFront, vPrtGloss;
#ifdef PRT_TWO_SIDED
  attribute uint lambentReceiverBack;
  varying vec3 vPrtBack, vPrtBackGloss;
#endif
uniform highp sampler2D prtRows;
uniform highp sampler2D prtFrames;
uniform highp sampler2D prtMaps;
vec3 prtRow( const in int r, const in int row ) {
  int i = r * PRT_SUM_ROWS + row;
  return texelFetch( prtRows, ivec2( i % ${rowWidth}, i / ${rowWidth} ), 0 ).rgb;
}
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
void prtReflect( const in uint receiver, const in vec3 view, out vec3 gloss, out vec3 coloured ) {
  gloss = coloured = vec3( 0.0 );
  if ( receiver == 0xffffffffu ) return;
  int r = int( receiver ), i = 2 * r;
  vec4 tangent = texelFetch( prtFrames, ivec2( i % ${rowWidth}, i / ${rowWidth} ), 0 );
  vec3 normal = texelFetch( prtFrames, ivec2( ( i + 1 ) % ${rowWidth}, ( i + 1 ) / ${rowWidth} ), 0 ).xyz;
  vec3 wo = vec3( dot( tangent.xyz, view ), dot( cross( normal, tangent.xyz ), view ), dot( normal, view ) );
  if ( wo.z < 0.0 ) wo = dot( wo.xy, wo.xy ) > 0.0 ? vec3( normalize( wo.xy ), 0.0 ) : vec3( 0.0, 0.0, 1.0 );
  int view_map = int( tangent.w );
  ${weighRows(outgoing)}
}
`;

const vertexBody = /* glsl */ `
  vec3 prtView = isOrthographic ? vec3( viewMatrix[ 0 ][ 2 ], viewMatrix[ 1 ][ 2 ], viewMatrix[ 2 ][ 2 ] )
                                : normalize( cameraPosition - ( modelMatrix * vec4( transformed, 1.0 ) ).xyz );
  prtReflect( lambentReceiver, prtView, vPrtGloss, vPrtFront );
  #ifdef PRT_TWO_SIDED
    prtReflect( lambentReceiverBack, prtView, vPrtBackGloss, vPrtBack );
  #endif
`;

const fragmentDeclarations = /* glsl */ `
varying vec3 vPrtFront, vPrtGloss;
#ifdef PRT_TWO_SIDED
  varying vec3 vPrtBack, vPrtBackGloss;
  vec3 prtExitRadiance() { return gl_FrontFacing ? vPrtFront : vPrtBack; }
  vec3 prtGloss() { return gl_FrontFacing ? vPrtGloss : vPrtBackGloss; }
#else
  vec3 prtExitRadiance() { return vPrtFront; }
  vec3 prtGloss() { return vPrtGloss; }
#endif
`;

/** Textures that all materials of one file share. */
interface Shared {
  outgoing: Outgoing;
  rows: number;
  frames: DataTexture;
  maps: DataTexture;
}

class MatrixMaterial extends MeshBasicMaterial {
  constructor(readonly sum: LightSum, readonly shared: Shared, twoSided: boolean, source: Material, readonly gain?: { value: number }) {
    super(gain ? { side: source.side } : diffuseParameters(source));
    const { outgoing, rows } = shared;
    this.defines = {
      PRT_SUM_ROWS: rows, PRT_GRID: outgoing.grid, PRT_ACROSS: mapLayout(outgoing.grid, outgoing.maps, rows).across,
      ...(twoSided && { PRT_TWO_SIDED: '' }), ...(gain && { PRT_FALSE_COLOR: '' }),
    };
    if (gain) this.toneMapped = false;
  }

  override onBeforeRender(renderer: WebGLRenderer): void {
    this.sum.update(renderer);
  }

  override onBeforeCompile(shader: WebGLProgramParametersWithUniforms): void {
    const { outgoing, frames, maps } = this.shared;
    Object.assign(shader.uniforms, { prtRows: { value: this.sum.target.texture }, prtFrames: { value: frames }, prtMaps: { value: maps } }, this.gain && { prtGain: this.gain });
    shader.vertexShader = vertexDeclarations(outgoing) + replaceOnce(shader.vertexShader, '#include <fog_vertex>', '#include <fog_vertex>' + vertexBody);
    shader.fragmentShader = useExitRadiance(shader.fragmentShader, fragmentDeclarations, this.gain !== undefined, true);
  }

  override customProgramCacheKey(): string {
    const { kind, order, hasB } = this.shared.outgoing;
    return `lambent matrix ${kind} ${order} ${hasB}`; // the rest is in the defines
  }
}

class MatrixTransfer implements BakedTransfer {
  readonly kind = 'matrix';
  readonly order: number;
  readonly channels: number;
  readonly receivers: number;
  readonly fileBytes: number;
  readonly gpuBytes: number;
  private readonly layout: BlockLayout;
  private readonly transfer: DataArrayTexture;
  private readonly sum: LightSum;
  private readonly materials = new Map<string, MatrixMaterial>();
  private readonly ofCoefficients = new Set<LightSum>();

  constructor(header: TransferHeader, private readonly shared: Shared, values: ArrayBuffer, readonly meshes: Mesh[]) {
    this.order = header.order, this.channels = header.channels, this.receivers = header.receivers, this.fileBytes = values.byteLength;
    const { layout, data } = packBlocks({ ...header, count: shCount(header.order), channels: shared.rows * header.channels }, values);
    this.layout = layout, this.transfer = blockTexture(layout, data);
    this.sum = this.makeSum();
    const { frames, maps } = shared;
    let gpuBytes = data.byteLength + this.sum.bytes + frames.image.data!.byteLength + maps.image.data!.byteLength;
    for (const mesh of meshes) {
      const twoSided = mesh.geometry.hasAttribute('lambentReceiverBack'), source = mesh.material as Material, key = `${source.uuid} ${twoSided}`;
      gpuBytes += mesh.geometry.getAttribute('position').count * (twoSided ? 8 : 4);
      const material = this.materials.get(key) ?? new MatrixMaterial(this.sum, shared, twoSided, source);
      this.materials.set(key, material);
      mesh.material = material;
    }
    this.gpuBytes = gpuBytes;
  }

  private makeSum(): LightSum {
    const { rows } = this.shared, texels = rows * this.receivers;
    return new LightSum({
      layout: this.layout, channels: this.channels, transfer: this.transfer, width: rowWidth, height: Math.ceil(texels / rowWidth), filter: NearestFilter,
      what: { size: `has ${this.receivers.toLocaleString('en')} receivers of ${rows} rows, which take a texture`, use: 'is glossy' },
      pick: `
uint prtPick( const in ivec2 texel, out int row ) {
  int i = texel.y * ${rowWidth} + texel.x;
  row = i % ${rows};
  return i < ${texels} ? uint( i / ${rows} ) : 0xffffffffu;
}`,
    });
  }

  check(renderer: WebGLRenderer): void {
    this.sum.check(renderer);
    const { maxTextureSize, maxVertexTextures } = renderer.capabilities;
    for (const { image } of [this.shared.frames, this.shared.maps])
      if (Math.max(image.width, image.height) > maxTextureSize)
        throw new LambentError(`takes a texture of ${image.width} x ${image.height} texels, where this graphics card takes ${maxTextureSize}`);
    const wanted = Math.max(...this.meshes.map((mesh) => 3 + Number('isSkinnedMesh' in mesh) + Number(Object.keys(mesh.geometry.morphAttributes).length > 0)));
    if (maxVertexTextures < wanted)
      throw new LambentError(`is relit in vertex shaders, which must read textures, ${wanted} at once; this graphics card reads ${maxVertexTextures} there`);
  }

  relight(lighting: Lighting): void {
    for (const sum of this.ofCoefficients) sum.refresh();
    this.sum.set(lighting.coefficients(this.order));
  }

  coefficientMaterials(index: number, gain: { value: number }): Material[] {
    const sum = this.makeSum();
    sum.set(new Float64Array(3 * shCount(this.order)).fill(1, 3 * index, 3 * index + 3));
    this.ofCoefficients.add(sum);
    const made = this.meshes.map((mesh) => new MatrixMaterial(sum, this.shared, mesh.geometry.hasAttribute('lambentReceiverBack'), mesh.material as Material, gain));
    afterAll(made, () => (this.ofCoefficients.delete(sum), sum.dispose()));
    return made;
  }

  dispose(): void {
    for (const sum of [this.sum, ...this.ofCoefficients]) sum.dispose();
    this.transfer.dispose(), this.shared.frames.dispose(), this.shared.maps.dispose();
    for (const material of this.materials.values()) material.dispose();
    for (const mesh of this.meshes) mesh.geometry.dispose();
  }
}

const isKind = (value: unknown): value is Outgoing['kind'] => kinds.some((kind) => kind === value);

/** What a matrix has beside its header; refuses what does not fit. */
export function readOutgoing(transfer: TransferSource['extension']['transfer']): { outgoing: Outgoing; rows: number; views: Record<string, unknown> } {
  const { rows, outgoing: given } = transfer;
  if (typeof given !== 'object' || given === null) throw new LambentError('holds a matrix and no "outgoing"');
  const views = given as Record<string, unknown>, { kind, order, hasB, grid, mapCount } = views;
  if (!isKind(kind)) throw new LambentError(`holds the outgoing basis "${String(kind)}", which this version does not know`);
  if (!isIndex(order, maxShOrder) || order < 1) throw new LambentError('the outgoing "order" is out of range');
  if (!isIndex(rows, 2 * maxShOrder * maxShOrder) || rows < 1) throw new LambentError('"rows" is out of range');
  const isMapped = kind === 'map' || kind === 'svd';
  if (isMapped && (!isIndex(grid, 256) || grid < 2 || !isIndex(mapCount, 65535) || mapCount < 1)) throw new LambentError('view maps have no size');
  const outgoing: Outgoing = { kind, order, hasB: hasB !== false, grid: isMapped ? (grid as number) : 2, maps: isMapped ? (mapCount as number) : 0 };
  if (outgoingRows(outgoing, rows) !== rows) throw new LambentError('"rows" does not fit the outgoing basis');
  return { outgoing, rows, views };
}

function texture(data: Float32Array | Uint16Array, width: number, height: number, filter: typeof NearestFilter | typeof LinearFilter): DataTexture {
  const made = new DataTexture(data, width, height, RGBAFormat, data instanceof Uint16Array ? HalfFloatType : FloatType);
  made.minFilter = made.magFilter = filter, made.wrapS = made.wrapT = ClampToEdgeWrapping, made.generateMipmaps = false;
  made.needsUpdate = true;
  return made;
}

async function load(source: TransferSource): Promise<BakedTransfer> {
  const header = readHeader(source.extension), { outgoing, rows, views } = readOutgoing(source.extension.transfer), { receivers } = header;
  if (rows * header.channels * Math.ceil(shCount(header.order) / 4) > 2048)
    throw new LambentError(`has ${rows} rows of order ${header.order}, more than textures hold; "lambent render" draws it`);
  const view = async (name: string, bytes: number): Promise<ArrayBuffer> => {
    const index = views[name];
    if (!isIndex(index)) throw new LambentError(`the last reflection has no "${name}"`);
    const found = await source.bufferView(index);
    if (found.byteLength !== bytes) throw new LambentError(`the last reflection's "${name}" holds ${found.byteLength} bytes where its header makes ${bytes}`);
    return found;
  };
  const frames = new Float32Array(await view('frames', 24 * receivers)), isMapped = outgoing.maps > 0;
  const mapOf = isMapped ? new Uint16Array(await view('mapOf', 2 * receivers)) : undefined;
  for (const m of mapOf ?? []) if (m >= outgoing.maps) throw new LambentError(`view map ${m} does not exist`);
  const placed = new Float32Array(4 * rowWidth * Math.ceil((2 * receivers) / rowWidth));
  for (let r = 0; r < receivers; ++r) {
    placed.set(frames.subarray(6 * r, 6 * r + 3), 8 * r), placed.set(frames.subarray(6 * r + 3, 6 * r + 6), 8 * r + 4);
    placed[8 * r + 3] = mapOf?.[r] ?? 0;
  }
  let maps = texture(new Uint16Array(4), 1, 1, NearestFilter);
  if (isMapped) {
    const { grid, maps: count } = outgoing, { width, height } = mapLayout(grid, count, rows);
    maps = texture(packMaps(grid, count, rows, new Uint16Array(await view('maps', 8 * count * grid * grid * rows))), width, height, LinearFilter);
  }
  const shared: Shared = { outgoing, rows, frames: texture(placed, rowWidth, placed.length / 4 / rowWidth, NearestFilter), maps };
  const values = await source.bufferView(header.bufferView);
  const meshes = await Promise.all(source.extension.parts.map((part) => bindPart(source, part, receivers)));
  return new MatrixTransfer(header, shared, values, meshes);
}

export const matrixKind: TransferKind = { name: 'matrix', load };
