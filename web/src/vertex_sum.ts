// T . light of receivers at vertices (light_sum.ts): a texel each, looked up in vertex shaders. In single floats; in
// half ones, where the graphics card draws into those alone; where it draws into neither the processor sums.
import {
  DataTexture,
  DataUtils,
  FloatType,
  NearestFilter,
  RGBAFormat,
  type DataArrayTexture,
  type Texture,
  type WebGLRenderer,
} from 'three';
import { glslInstances } from './instanced.js';
import type { BlockLayout } from './block_texture.js';
import { LightSum, LightSums } from './light_sum.js';
import { sumColumns as columns } from './shown_sums.js';
import type { Sums } from './turned.js';

/** GLSL: vec3 prtRadiance( uint receiver ), what there is in prtSums; of an instance, which has none, its sum. */
export const lookUpSums = /* glsl */ `
${glslInstances()}
#ifdef USE_INSTANCING
vec3 prtRadiance( const in uint receiver ) {
  if ( receiver == 0xffffffffu ) return vec3( 0.0 );
  vec3 rest = prtInstanceSum( int( receiver ), 0, 0 );
  if ( ! prtInstancePeaks ) return rest;
  return max( rest, vec3( 0.0 ) ) + max( prtInstanceSum( int( receiver ), 0, 1 ), vec3( 0.0 ) );
}
#else
uniform highp sampler2D prtSums;
#ifdef PRT_PEAKS
  uniform highp sampler2D prtPeakSums;
#endif
vec3 prtRadiance( const in uint receiver ) {
  if ( receiver == 0xffffffffu ) return vec3( 0.0 );
  ivec2 at = ivec2( int( receiver ) % ${columns}, int( receiver ) / ${columns} );
  vec3 sum = texelFetch( prtSums, at, 0 ).rgb;
  #ifdef PRT_PEAKS
    sum += texelFetch( prtPeakSums, at, 0 ).rgb; // both are held at 0 or above
  #endif
  return sum;
}
#endif
`;

export interface VertexSumOptions {
  layout: BlockLayout;
  channels: 1 | 3;
  transfer: DataArrayTexture;
  receivers: number;
}

interface Light {
  rest: ArrayLike<number>;
  peaks: ArrayLike<number> | undefined;
}

export class VertexSums implements Sums {
  private readonly sums: LightSums;
  private light: Light | undefined;
  /** Of the processor. */
  private table: DataTexture | undefined;
  private tableOf: Light | undefined;

  constructor(private readonly options: VertexSumOptions) {
    const { layout, channels, transfer, receivers } = options;
    this.sums = new LightSums(
      () =>
        new LightSum({
          layout,
          channels,
          transfer,
          width: Math.min(columns, receivers),
          height: Math.ceil(receivers / columns),
          filter: NearestFilter,
          single: true,
          what: { size: `has ${receivers.toLocaleString('en')} receivers, which take a texture`, use: 'is summed' },
          pick: `
uint prtPick( const in ivec2 texel, out int row ) {
  row = 0;
  int r = texel.y * ${columns} + texel.x;
  return r < ${receivers} ? uint( r ) : 0xffffffffu;
}`,
        }),
      true,
    );
  }

  get pictures(): { rest: Texture; peaks: Texture } {
    return this.table ? { rest: this.table, peaks: this.table } : this.sums.pictures;
  }

  get bytes(): number {
    return this.sums.rest.bytes;
  }
  get hasPeaks(): boolean {
    return this.sums.hasPeaks && !this.table; // the table has both
  }

  /** `light` is [column][3]. */
  set(rest: ArrayLike<number>, peaks: ArrayLike<number> | undefined): void {
    this.light = { rest, peaks };
    this.sums.set(rest, peaks);
  }

  /** Throws LambentError where the graphics card has no texture of that size. */
  check(renderer: WebGLRenderer): void {
    this.sums.rest.checkSize(renderer);
  }

  /** Before what shows it is drawn. */
  update(renderer: WebGLRenderer): void {
    if (this.sums.rest.isDrawnBy(renderer)) return this.sums.update(renderer);
    if (this.light && this.tableOf !== this.light) this.sumUp(this.light);
    this.tableOf = this.light;
  }

  private sumUp({ rest, peaks }: Light): void {
    const { width, height } = this.sums.rest.target,
      { layout, channels, transfer, receivers } = this.options,
      values = transfer.image.data as Uint16Array | Float32Array;
    const value =
      values instanceof Uint16Array ? (i: number) => DataUtils.fromHalfFloat(values[i]!) : (i: number) => values[i]!;
    this.table ??= new DataTexture(new Float32Array(4 * width * height), width, height, RGBAFormat, FloatType);
    const sums = this.table.image.data as Float32Array;
    for (let r = 0; r < receivers; ++r)
      for (let c = 0; c < 3; ++c) {
        const from = 4 * (layout.texels * r + (channels === 3 ? layout.quads * c : 0));
        let sum = 0,
          peak = 0;
        for (let k = 0; k < rest.length / 3; ++k) {
          const t = value(from + k);
          sum += t * rest[3 * k + c]!;
          if (peaks) peak += t * peaks[3 * k + c]!;
        }
        sums[4 * r + c] = peaks ? Math.max(sum, 0) + Math.max(peak, 0) : sum;
      }
    this.table.needsUpdate = true;
  }

  dispose(): void {
    this.sums.dispose();
    this.table?.dispose();
  }
}
