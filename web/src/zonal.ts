// Zonal lobes (docs/zonal.md, docs/file-format.md, kind "zonal"): t_lm = sum_i y_lm(axis_i) g_il, so that exit radiance
// is sum_i sum_l g_il sum_m L_lm y_lm(axis_i). Follows: Sloan, Luna and Snyder, "Local, Deformable Precomputed Radiance
// Transfer" (2005), eq. 13. At vertices the inner sums are made at the axis, without loops; pixels of a transfer
// texture look them up in a table of the light, eq. 25 (transfer_texture.ts).
import { LambentError } from './errors.js';
import { isIndex, isViews } from './glb.js';
import { glslHarmonics } from './glsl_harmonics.js';
import { readHeader } from './header.js';
import { limits, type TransferKind } from './kinds.js';
import { readLobes } from './lobes.js';
import { glslReflect, loadLastReflection, reflectionDefines, reflectionKey, type LastReflection } from './outgoing.js';
import type { PrtShader } from './prt_material.js';
import { shBand, shCount } from './sh.js';
import { VertexTransfer } from './vertex_transfer.js';

export const maxLobes = 8;

/** Bands that are stored as they are: `exact_zonal_bands` of the C++ library. */
export const exactZonalBands = (order: number, lobes: number): number => Math.min(order, lobes >= 3 ? 2 : 1);

/**
 * Values a receiver: [channel][exact coefficient], then for each lobe its axis and [channel][band that is not exact].
 */
export function zonalValues(order: number, lobes: number, channels: number): number {
  const exact = exactZonalBands(order, lobes);
  return channels * shCount(exact) + lobes * (3 + channels * (order - exact));
}

/**
 * GLSL: vec3 prtSum( vec4 v[ PRT_QUADS ] ), exit radiance of the values of one receiver under prtLight, turned by
 * prtFrame. `table`: lobes by the look-up vec3 prtBand( vec3 direction, int band ), counted from the first that is not
 * exact, in place of harmonics at their axes. `peaks`: prtPeakSum under prtPeaks.
 */
export function zonalSum(order: number, lobes: number, channels: 1 | 3, { table = false, peaks = false } = {}): string {
  const exact = exactZonalBands(order, lobes),
    upper = order - exact,
    lightQuads = Math.ceil(shCount(order) / 4);
  const [array, sumName, lobeName] = peaks
    ? ['prtPeaks', 'prtPeakSum', 'prtPeakLobe']
    : ['prtLight', 'prtSum', 'prtLobe'];
  const swizzle = (k: number): string => 'xyzw'[k & 3]!;
  const value = (k: number): string => `v[ ${k >> 2} ].${swizzle(k)}`;
  /** Coefficient k of the light, three channels. */
  const light = (k: number): string =>
    `vec3( ${[0, 1, 2].map((c) => `${array}[ ${lightQuads * c + (k >> 2)} ].${swizzle(k)}`).join(', ')} )`;
  /** Value k, or those of three channels that lie `stride` apart. */
  const color = (k: number, stride: number): string =>
    `vec3( ${[0, 1, 2].map((c) => value(k + (channels === 3 ? c * stride : 0))).join(', ')} )`;
  const lines: string[] = [`sum += ${color(0, shCount(exact))} * ${light(0)};`];
  if (exact > 1) {
    // The linear band is a vector in x, y, z for each channel: (-t_11, -t_1-1, t_10).
    for (let c = 0; c < 3; ++c) {
      const at = channels === 3 ? 4 * c : 0,
        of = (k: number): string => `${array}[ ${lightQuads * c + (k >> 2)} ].${swizzle(k)}`;
      lines.push(
        `sum[ ${c} ] += dot( prtFrame * vec3( - ${value(at + 3)}, - ${value(at + 1)}, ${value(at + 2)} ),
                     vec3( - ${of(3)}, - ${of(1)}, ${of(2)} ) );`,
      );
    }
  }
  const first = channels * shCount(exact),
    stride = 3 + channels * upper;
  for (let i = 0; i < lobes && upper > 0; ++i) {
    const at = first + i * stride;
    const coefficients = Array.from({ length: upper }, (_, l) => `g[ ${l} ] = ${color(at + 3 + l, upper)};`).join(' ');
    lines.push(
      `axis = vec3( ${value(at)}, ${value(at + 1)}, ${value(at + 2)} ); ${coefficients}`,
      `sum += ${lobeName}( axis, g );`,
    );
  }
  const lobe =
    upper === 0
      ? ''
      : `
vec3 ${lobeName}( const in vec3 axis, const in vec3 g[ ${upper} ] ) {
  float size = length( axis );
  vec3 n = prtFrame * ( size > 0.0 ? axis / size : vec3( 0.0, 0.0, 1.0 ) ), sum = vec3( 0.0 );
  ${
    table
      ? Array.from({ length: upper }, (_, l) => `sum += g[ ${l} ] * prtBand( n, ${l} );`).join('\n  ')
      : glslHarmonics(order, (index, y) =>
          shBand(index) < exact ? '' : `sum += g[ ${shBand(index) - exact} ] * ( ${y} * ${light(index)} );`,
        )
  }
  return sum;
}`;
  return `${lobe}
vec3 ${sumName}( const in vec4 v[ PRT_QUADS ] ) {
  vec3 sum = vec3( 0.0 )${upper > 0 ? `, axis, g[ ${upper} ]` : ''};
  ${lines.join('\n  ')}
  return sum;
}
`;
}

const zonalSums = (order: number, lobes: number, channels: 1 | 3): string => `
${zonalSum(order, lobes, channels)}
#ifdef PRT_PEAKS
  ${zonalSum(order, lobes, channels, { peaks: true })}
#endif`;

export const zonalShader = (order: number, lobes: number, channels: 1 | 3): PrtShader => ({
  key: `zonal ${order} ${lobes} ${channels}`,
  turns: true,
  radiance: `${zonalSums(order, lobes, channels)}
vec3 prtRadiance( const in uint receiver ) {
  if ( receiver == 0xffffffffu ) return vec3( 0.0 );
  vec4 v[ PRT_QUADS ];
  for ( int k = 0; k < PRT_QUADS; ++ k ) v[ k ] = prtValues( receiver, k );
  #ifdef PRT_PEAKS
    return prtHeld( prtSum( v ), prtPeakSum( v ) );
  #else
    return prtSum( v );
  #endif
}
`,
});

/** Lobes for every row of a last reflection (eq. 16). */
const glossyShader = (order: number, lobes: number, channels: 1 | 3, last: LastReflection): PrtShader => ({
  key: `zonal ${order} ${lobes} ${channels} ${reflectionKey(last)}`,
  turns: true,
  gloss: true,
  defines: reflectionDefines(last),
  radiance: `${zonalSums(order, lobes, channels)}
vec3 prtRow( const in int r, const in int row ) {
  vec4 v[ PRT_QUADS ];
  for ( int k = 0; k < PRT_QUADS; ++ k ) v[ k ] = prtValues( uint( r ), row * PRT_QUADS + k );
  return prtSum( v );
}
#ifdef PRT_PEAKS
  vec3 prtPeakRow( const in int r, const in int row ) {
    vec4 v[ PRT_QUADS ];
    for ( int k = 0; k < PRT_QUADS; ++ k ) v[ k ] = prtValues( uint( r ), row * PRT_QUADS + k );
    return prtPeakSum( v );
  }
#endif
${glslReflect(last.outgoing, true)}`,
});

export const zonalKind: TransferKind = {
  name: 'zonal',
  load: async (source) => {
    const header = readHeader(source.extension),
      lobes = source.extension.transfer['lobeCount'];
    if (header.lobes) throw new LambentError('holds zonal transfer of light that is more than harmonics');
    if (!isIndex(lobes, maxLobes) || lobes < 1) throw new LambentError('"lobeCount" is out of range');
    const { order, channels } = header,
      errors = source.extension.transfer['fitErrors'];
    let fitErrors: Float32Array | undefined;
    if (errors !== undefined) {
      if (!isViews(errors)) throw new LambentError('"fitErrors" is no buffer view');
      const bytes = await source.bufferView(errors);
      if (bytes.byteLength !== 4 * header.receivers)
        throw new LambentError('there is not one error of a fit for each receiver');
      fitErrors = new Float32Array(bytes);
      if (!fitErrors.every(Number.isFinite)) throw new LambentError('the error of a fit is not finite');
    }
    if (source.extension.transfer['outgoing'] !== undefined) {
      const last = await loadLastReflection(source, header.receivers);
      if (last.rows * lobes > limits.lobes)
        throw new LambentError(
          `has ${last.rows} rows of ${lobes} lobes, where this version draws ${limits.lobes} lobes in all; ` +
            '"lambent render" draws it',
        );
      return VertexTransfer.load(source, header, {
        kind: 'zonal',
        count: zonalValues(order, lobes, channels),
        valueChannels: last.rows,
        last,
        lobeCount: lobes,
        shader: glossyShader(order, lobes, channels, last),
        ...(fitErrors && { fitErrors }),
      });
    }
    return VertexTransfer.load(source, header, {
      kind: 'zonal',
      count: zonalValues(order, lobes, channels),
      valueChannels: 1,
      lobeCount: lobes,
      shader: zonalShader(order, lobes, channels),
      ...(fitErrors && { fitErrors }),
      readLobes: (values) => readLobes(values, order, exactZonalBands(order, lobes), lobes, channels),
    });
  },
};
