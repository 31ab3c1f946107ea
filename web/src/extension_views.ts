// Where the extension's JSON names buffer views (docs/schema/LAMBENT_transfer.schema.json), so that they can be carried
// into another file, and told from those that anything else of the file uses.
import { LambentError } from './errors.js';

export const viewKeys: readonly string[] = [
  'albedos',
  'areas',
  'bufferView',
  'clusterOf',
  'coded',
  'coverage',
  'directions',
  'fitErrors',
  'frames',
  'lengths',
  'mapOf',
  'maps',
  'materials',
  'normals',
  'parents',
  'places',
  'positions',
  'scales',
  'steps',
  'surfels',
  'texels',
  'valid',
  'weights',
];
/** Numbers that name nothing. */
export const plainKeys: readonly string[] = [
  'bits',
  'bytes',
  'channels',
  'clusters',
  'cube',
  'entries',
  'error',
  'fov',
  'gatherLevel',
  'grid',
  'height',
  'incidentOrder',
  'lobeCount',
  'mapCount',
  'order',
  'radius',
  'rank',
  'receivers',
  'rows',
  'side',
  'version',
  'width',
];

/**
 * The extension without its parts, the map to its input's vertices, and what it says of the document that it was
 * written into, with place(v) for each buffer view v. Throws LambentError at a number of a name that
 * is in neither list, since it could be a view.
 */
export function replaceViews(
  extension: Readonly<Record<string, unknown>>,
  place: (view: number) => number,
): Record<string, unknown> {
  const entry = ([key, value]: [string, unknown]): [string, unknown] => {
    if (key === 'provenance' || key === 'extras') return [key, value];
    if (viewKeys.includes(key) && Array.isArray(value)) return [key, value.map((view) => place(view as number))];
    if (typeof value !== 'number' || plainKeys.includes(key)) return [key, walk(value)];
    if (!viewKeys.includes(key))
      throw new LambentError(`holds a number "${key}", which this version does not know: is there a newer one?`);
    return [key, place(value)];
  };
  const walk = (value: unknown): unknown => {
    if (Array.isArray(value)) return value.map(walk);
    return typeof value === 'object' && value !== null ? Object.fromEntries(Object.entries(value).map(entry)) : value;
  };
  return walk({ ...extension, parts: undefined, written: undefined, inputVertices: undefined }) as Record<
    string,
    unknown
  >;
}

interface Document {
  bufferViews?: unknown;
  buffers?: unknown;
  accessors?: unknown;
  images?: unknown;
}

const objects = (list: unknown): Record<string, unknown>[] =>
  Array.isArray(list) ? list.filter((o): o is Record<string, unknown> => typeof o === 'object' && o !== null) : [];

/**
 * Whether the document has other views or bytes than it was written with, or views that the extension names are
 * missing, or are those of accessors or images: tools that do not know the extension drop its views and number the
 * others anew.
 */
export function isOutOfPlace(document: Document, extension: Readonly<Record<string, unknown>>): boolean {
  const count = Array.isArray(document.bufferViews) ? document.bufferViews.length : 0,
    taken = new Set([...objects(document.accessors), ...objects(document.images)].map((o) => o['bufferView']));
  const isWrong = (view: unknown): boolean =>
    Array.isArray(view) ? view.some(isWrong) : typeof view === 'number' && (view >= count || taken.has(view));
  const walk = (value: unknown): boolean => {
    if (typeof value !== 'object' || value === null) return false;
    return Object.entries(value).some(([key, inner]) =>
      viewKeys.includes(key) || key === 'front' || key === 'back' || key === 'input'
        ? isWrong(inner) || walk(inner)
        : key !== 'provenance' && key !== 'extras' && walk(inner),
    );
  };
  const written = objects([extension['written']])[0] ?? {},
    bytes = objects(document.buffers)[0]?.['byteLength'],
    differs = (stated: unknown, found: unknown): boolean => typeof stated === 'number' && stated !== found;
  return differs(written['bufferViews'], count) || differs(written['byteLength'], bytes) || walk(extension);
}
