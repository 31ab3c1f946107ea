// Diffuse transfer (docs/file-format.md, kind "diffuse"): exit radiance = albedo * sum_i transfer_i light_i,
// at vertices, or over the texels of an atlas.
import { readHeader } from './header.js';
import type { TransferKind } from './kinds.js';
import { loadLightmap } from './lightmap.js';
import type { PrtShader } from './prt_material.js';
import { shCount } from './sh.js';
import { VertexTransfer } from './vertex_transfer.js';

const radiance = /* glsl */ `
vec3 prtRadiance( const in uint receiver ) {
  if ( receiver == 0xffffffffu ) return vec3( 0.0 );
  vec3 sum = vec3( 0.0 ), peaks = vec3( 0.0 );
  for ( int k = 0; k < PRT_QUADS; ++ k ) {
    vec4 red = prtValues( receiver, k );
    #if PRT_CHANNELS == 3
      vec4 green = prtValues( receiver, PRT_QUADS + k ), blue = prtValues( receiver, 2 * PRT_QUADS + k );
    #else
      vec4 green = red, blue = red;
    #endif
    sum += vec3( dot( red, prtLight[ k ] ), dot( green, prtLight[ PRT_QUADS + k ] ),
                 dot( blue, prtLight[ 2 * PRT_QUADS + k ] ) );
    #ifdef PRT_PEAKS
      peaks += vec3( dot( red, prtPeaks[ k ] ), dot( green, prtPeaks[ PRT_QUADS + k ] ),
                     dot( blue, prtPeaks[ 2 * PRT_QUADS + k ] ) );
    #endif
  }
  #ifdef PRT_PEAKS
    return prtHeld( sum, peaks );
  #else
    return sum;
  #endif
}
`;

const shader: PrtShader = { key: 'diffuse', radiance, turns: false, nodes: true };

export const diffuseKind: TransferKind = {
  name: 'diffuse',
  load: async (source) => {
    if (source.extension.surface?.kind === 'texels') return loadLightmap(source);
    const header = readHeader(source.extension);
    return VertexTransfer.load(source, header, {
      kind: 'diffuse',
      count: shCount(header.order),
      valueChannels: header.channels,
      shader,
    });
  },
};
