// The outside of a baked file: is it a whole glTF, and does it hold transfer that we know? Asked before three's loader
// is, whose messages are for developers.
import { LambentError, NoTransferError } from './errors.js';
import { isOutOfPlace } from './extension_views.js';
import { knownKinds, transferKind } from './kinds.js';

export const extensionName = 'LAMBENT_transfer';
/** Said of files whose transfer another tool has dropped or taken out of place. */
export const rewritten = `was rewritten by a tool that does not know ${extensionName}; bake again`;

/** The root extension (docs/file-format.md), as far as every kind has it. */
export interface TransferExtension {
  version: number;
  transfer: { kind: string; [key: string]: unknown };
  /** Where receivers lie; absent: at vertices. */
  surface?: { kind: unknown; [key: string]: unknown };
  /** A fixed view: receivers are the pixels of a picture. */
  view?: unknown;
  /** Light in free space. */
  lattice?: unknown;
  parts: { node: number; primitive: number; front?: Views; back?: Views; [key: string]: unknown }[];
  provenance?: unknown;
}

const isObject = (value: unknown): value is Record<string, unknown> =>
  typeof value === 'object' && value !== null && !Array.isArray(value);
export const isIndex = (value: unknown, limit = 0xffffffff): value is number =>
  typeof value === 'number' && Number.isInteger(value) && value >= 0 && value <= limit;

/** A buffer view by its number, or several, one after another: data too long for one file. */
export type Views = number | readonly number[];
export const isViews = (value: unknown): value is Views =>
  isIndex(value) || (Array.isArray(value) && value.length > 0 && value.every((view) => isIndex(view)));

/** Whether a document without our extension still names it: something has dropped the rest. */
const hasTraces = (document: Record<string, unknown>): boolean =>
  [document['extensionsUsed'], document['meshes']].some((part) => JSON.stringify(part ?? '').includes(extensionName));

/**
 * The extension of a glTF document. Throws NoTransferError where it is missing or its data is, LambentError where it is
 * of another version, or of a kind we do not know.
 */
export function transferExtension(document: unknown): TransferExtension {
  const extensions = isObject(document) ? document['extensions'] : undefined;
  const extension = isObject(extensions) ? extensions[extensionName] : undefined;
  if (!isObject(document) || !isObject(extension))
    throw new NoTransferError(
      isObject(document) && hasTraces(document)
        ? rewritten
        : 'is not a baked file: it has no LAMBENT_transfer extension (make one with "lambent bake"; again, where ' +
            'another tool has rewritten it)',
    );
  if (extension['version'] !== 1)
    throw new LambentError(`was baked with file version ${String(extension['version'])}; this program reads version 1`);
  const transfer = extension['transfer'],
    parts = extension['parts'];
  if (!isObject(transfer) || typeof transfer['kind'] !== 'string')
    throw new LambentError('holds no "transfer" with a kind');
  if (!transferKind(transfer['kind']))
    throw new LambentError(
      `holds transfer of kind "${transfer['kind']}", which this version does not know ` +
        `(it knows ${knownKinds().join(', ')})`,
    );
  if (!Array.isArray(parts) || !parts.every((p) => isObject(p) && isIndex(p['node']) && isIndex(p['primitive'])))
    throw new LambentError('holds no list of "parts"');
  if (extension['surface'] !== undefined && !isObject(extension['surface']))
    throw new LambentError('holds a "surface" that is none');
  if (isOutOfPlace(document, extension)) throw new NoTransferError(rewritten);
  return extension as unknown as TransferExtension;
}

function parse(text: Uint8Array): unknown {
  try {
    return JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(text));
  } catch {
    throw new LambentError('holds JSON that cannot be read');
  }
}

/** Checks the container, .glb or .gltf, and the extension; returns the glTF document. */
export function checkBakedFile(bytes: ArrayBuffer): unknown {
  if (bytes.byteLength === 0) throw new LambentError('is empty');
  const view = new DataView(bytes);
  if (bytes.byteLength < 4 || view.getUint32(0, true) !== 0x46546c67) {
    if (!/^\s*\{/.test(new TextDecoder().decode(new Uint8Array(bytes, 0, Math.min(64, bytes.byteLength)))))
      throw new LambentError('is not a glTF (.glb or .gltf)');
    const document = parse(new Uint8Array(bytes));
    transferExtension(document);
    return document;
  }
  const length = bytes.byteLength >= 12 ? view.getUint32(8, true) : Infinity;
  if (bytes.byteLength < 20 || length > bytes.byteLength)
    throw new LambentError(
      `is cut off: ${bytes.byteLength.toLocaleString('en')} bytes of ` +
        `${Number.isFinite(length) ? length.toLocaleString('en') : 'more'} are there`,
    );
  if (view.getUint32(4, true) !== 2) throw new LambentError(`is a GLB of version ${view.getUint32(4, true)}, not 2`);
  const jsonLength = view.getUint32(12, true);
  if (view.getUint32(16, true) !== 0x4e4f534a || jsonLength > length - 20)
    throw new LambentError('does not begin with its JSON chunk');
  const document = parse(new Uint8Array(bytes, 20, jsonLength));
  transferExtension(document);
  return document;
}
