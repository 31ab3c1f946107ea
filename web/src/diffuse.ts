// Diffuse transfer (docs/file-format.md, kind "diffuse"): exit radiance = albedo * sum_i transfer_i light_i,
// at vertices, or over the texels of an atlas.
import { loadFixedView } from './fixed_view.js';
import { readHeader } from './header.js';
import type { TransferKind } from './kinds.js';
import { loadLightmap } from './lightmap.js';
import type { PrtShader } from './prt_material.js';
import { lookUpSums } from './vertex_sum.js';
import { VertexTransfer } from './vertex_transfer.js';

const shader: PrtShader = { key: 'diffuse', radiance: lookUpSums, turns: false, summed: true };

export const diffuseKind: TransferKind = {
  name: 'diffuse',
  load: async (source) => {
    if (source.extension.view !== undefined) return loadFixedView(source);
    if (source.extension.surface?.kind === 'texels') return loadLightmap(source);
    const header = readHeader(source.extension);
    return VertexTransfer.load(source, header, {
      kind: 'diffuse',
      count: header.columns,
      valueChannels: header.channels,
      shader,
    });
  },
};
