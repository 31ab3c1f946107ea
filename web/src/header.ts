// What every kind reads alike: the header, receivers, and geometries that carry them (docs/file-format.md).
import { BufferGeometry } from 'three';
import { LambentError } from './errors.js';
import { isIndex, isViews, type TransferExtension, type Views } from './glb.js';
import { axesOf, isDrawn, limits, type BakedTransfer, type TransferSource } from './kinds.js';
import { readLobes, type LobeBasis } from './light_basis.js';
import { maxShOrder, shCount } from './sh.js';

export const noReceiver = 0xffffffff;

export interface TransferHeader {
  order: number;
  channels: 1 | 3;
  precision: 'half' | 'single';
  receivers: number;
  bufferView: Views;
  directional: Directional;
  /** Harmonics of `order` and lobes of light, where there are any. */
  lobes: LobeBasis | undefined;
  /** Names of the scene's own lamps. */
  groups: string[];
  /** Of the light: harmonics, lobes and lamps. */
  columns: number;
}

/** Rows of a lightmap for the normals of a normal map (docs/lightmaps.md). */
export const directionalRows = { none: 1, 'sh:2': 4, 'sh:3': 9, hl2: 3, vector: 3 } as const;
export type Directional = keyof typeof directionalRows;
const isDirectional = (value: unknown): value is Directional =>
  typeof value === 'string' && Object.hasOwn(directionalRows, value);

/** What every kind has in its header; refuses by name what this version does not draw. */
export function readHeader(
  extension: TransferExtension,
  surfaceKind: 'vertices' | 'texels' | 'view' = 'vertices',
): TransferHeader {
  const { transfer, surface, view } = extension;
  const { basis, order, channels, precision, receivers, bufferView, groups = [], directional } = transfer;
  const text = (value: unknown): string => (typeof value === 'string' ? value : 'something else'),
    where = view !== undefined ? 'view' : text(surface?.kind ?? 'vertices');
  const isMore = (list: unknown): boolean => list !== undefined && !(Array.isArray(list) && list.length === 0);
  if (basis !== 'sh')
    throw new LambentError(`holds light in the basis "${String(basis)}", which this version does not know`);
  if (!Array.isArray(groups) || !groups.every((name) => typeof name === 'string'))
    throw new LambentError('"groups" is no list of names');
  if (isMore(groups) && surfaceKind !== 'texels')
    throw new LambentError(
      `holds the light of the scene's own lamps at ${surfaceKind === 'view' ? 'pixels' : 'vertices'}, ` +
        'where this version draws it over an atlas; ' +
        '"lambent render" draws it',
    );
  if (directional !== undefined && (surfaceKind !== 'texels' || !isDirectional(directional)))
    throw new LambentError(
      `holds directional light ("${text(directional)}"), which this version does not draw ` +
        `${isDirectional(directional) ? 'but over an atlas' : 'at all'}; "lambent render" does`,
    );
  if (where !== surfaceKind)
    throw new LambentError(
      `holds transfer over ${where}, where this version draws vertices and, for diffuse transfer, texels; ` +
        '"lambent render" draws it',
    );
  if (!isDrawn(extension))
    throw new LambentError(
      `holds ${axesOf(extension).join(', ')}, which this version does not draw; "lambent render" does`,
    );
  if (precision !== 'half' && precision !== 'single') throw new LambentError('"precision" must be half or single');
  if (!isIndex(order, maxShOrder) || (order < 1 && !isMore(groups) && !isMore(transfer['lobes'])))
    throw new LambentError('"order" is out of range');
  if (channels !== 1 && channels !== 3) throw new LambentError('"channels" is out of range');
  if (!isIndex(receivers, noReceiver - 1) || receivers < 1) throw new LambentError('"receivers" is out of range');
  if (!isViews(bufferView)) throw new LambentError('"bufferView" is missing');
  const lobes = readLobes(transfer, order),
    columns = shCount(order) + (lobes?.lobes.length ?? 0) + groups.length;
  if (columns > limits.columns)
    throw new LambentError(`has ${columns} columns of light, where this version draws ${limits.columns}`);
  return {
    order,
    channels,
    precision,
    receivers,
    bufferView,
    directional: isDirectional(directional) ? directional : 'none',
    lobes,
    groups,
    columns,
  };
}

/** Bands of light that count: those of harmonics, or that lobes are in other words. */
export const bandsOfLight = ({ order, lobes }: TransferHeader): number => order || (lobes?.bands ?? 0);
/** What BakedTransfer says of columns. */
export const columnsOf = ({ order, lobes }: TransferHeader): BakedTransfer['columns'] =>
  lobes && { harmonics: shCount(order), lobes: lobes.lobes.length };

/** `count` of u32, all of them receivers or none; `message` where there are not so many. */
export async function readReceivers(
  source: TransferSource,
  view: unknown,
  count: number,
  receivers: number,
  message: string,
): Promise<Uint32Array> {
  if (!isViews(view)) throw new LambentError('a part has no buffer view of receivers');
  const bytes = await source.bufferView(view);
  if (bytes.byteLength !== 4 * count) throw new LambentError(message);
  const map = new Uint32Array(bytes);
  for (const r of map) if (r !== noReceiver && r >= receivers) throw new LambentError(`receiver ${r} is out of range`);
  return map;
}

/** A geometry of its own, which shares all attributes, since nodes that share a mesh have receivers of their own. */
export function shareGeometry(shared: BufferGeometry): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.name = shared.name;
  geometry.index = shared.index;
  geometry.userData = shared.userData;
  geometry.groups = shared.groups;
  geometry.drawRange = shared.drawRange;
  geometry.morphAttributes = shared.morphAttributes;
  geometry.morphTargetsRelative = shared.morphTargetsRelative;
  geometry.boundingBox = shared.boundingBox;
  geometry.boundingSphere = shared.boundingSphere;
  for (const [name, attribute] of Object.entries(shared.attributes)) geometry.setAttribute(name, attribute);
  return geometry;
}
