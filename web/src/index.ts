import { blocksKind } from './blocks.js';
import { diffuseKind } from './diffuse.js';
import { factorsKind } from './factors.js';
import { indirectKind } from './indirect.js';
import { registerTransferKind } from './kinds.js';
import { matrixKind } from './matrix.js';
import { waveletsKind } from './wavelets.js';
import { zonalKind } from './zonal.js';

registerTransferKind(diffuseKind);
registerTransferKind(zonalKind);
registerTransferKind(matrixKind);
registerTransferKind(factorsKind);
registerTransferKind(blocksKind);
registerTransferKind(indirectKind);
registerTransferKind(waveletsKind);

export type { Reflection } from './block_reflection.js';
export { cubeLight, type CubeLight } from './cube.js';
export { LambentError, NoTransferError } from './errors.js';
export type { FixedView } from './fixed_view.js';
export { checkBakedFile, extensionName } from './glb.js';
export type { IndirectControls } from './indirect.js';
export { Insert } from './insert.js';
export type { IndirectTimes } from './indirect_light.js';
export {
  knownKinds,
  limits,
  registerTransferKind,
  type BakedTransfer,
  type TransferKind,
  type TransferSource,
} from './kinds.js';
export { Lattice, type LatticeHeader, type ProbeGrid, type ProbeGridClass } from './lattice.js';
export { latLongMap, Lighting, type LightParts } from './lighting.js';
export { lobeValue, type Lobe } from './lobes.js';
export {
  formatColor,
  formatLamp,
  lampKinds,
  lampNumbers,
  namesLamp,
  parseLamp,
  parseNamedColor,
  type Lamp,
  type LampKind,
  type Rgb,
} from './moving_lamps.js';
export type { NodeEdition, NodeRenderer, Renderer } from './node_edition.js';
export { bakedScene, LambentTransferPlugin, type BakedScene } from './plugin.js';
export { withoutPeaks } from './peaks.js';
export { loadProgressive, type ProgressiveOptions } from './progressive.js';
export { projectLatLong, texelSolidAngle, type LatLongMap } from './projection.js';
export { diffuseParameters, PrtMaterial } from './prt_material.js';
export { anySeeThrough } from './see_through.js';
export { clampedCosine, evaluateSh, maxShOrder, shBand, shCount, shIndex } from './sh.js';
export { makeShRotation, rotateSh, type ShRotation } from './sh_rotation.js';
export { shWindow, shWindows, type ShWindow } from './sh_window.js';
export { readTransferTexture, TransferTextureMaterial, type TransferTexture } from './transfer_texture.js';
export { UnshadowedMaterial } from './unshadowed_material.js';
