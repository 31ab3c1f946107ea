// The command-line tool, where it is built (LAMBENT_TOOL, or build/release/bin/lambent): the other half of every truth
// test.
import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';

export const toolPath =
  process.env['LAMBENT_TOOL'] ?? fileURLToPath(new URL('../../build/release/bin/lambent', import.meta.url));
export const haveTool = existsSync(toolPath);
if (!haveTool) console.warn(`skipped what compares with the tool: ${toolPath} is not built`);

/**
 * A new folder under build/web-tests, which scripts/web empties before and leaves after: a failed test's pictures can
 * be looked at.
 */
export function makeFolder(): string {
  const all = fileURLToPath(new URL('../../build/web-tests/', import.meta.url));
  mkdirSync(all, { recursive: true });
  return mkdtempSync(join(all, 'test-'));
}

export function lambent(...args: string[]): string {
  return execFileSync(toolPath, args, { encoding: 'utf8', stdio: ['ignore', 'pipe', 'pipe'], maxBuffer: 1 << 28 });
}

/** A picture; a PNG shows light as it is, unless `args` say otherwise. */
export function renderLinear(...args: string[]): string {
  const more = (name: string, value: string): string[] =>
    args.at(-1)!.endsWith('.exr') || args.some((a) => a.startsWith(name)) ? [] : [name, value];
  return lambent(
    'render',
    ...args.slice(0, 1),
    ...more('--exposure', '0'),
    ...more('--tone', 'none'),
    ...args.slice(1),
  );
}

export const lambentJson = (...args: string[]): unknown => JSON.parse(lambent(...args, '--json'));

/** Numbers in [0, 1) that are the same in every run. */
export function random(seed: number): () => number {
  let state = seed >>> 0;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return ((state >>> 8) + 0.5) / 2 ** 24;
  };
}

/** An .hdr of RGBE texels without runs; f gives mantissas and exponent of texel (x, y). */
export function writeHdr(
  path: string,
  width: number,
  height: number,
  f: (x: number, y: number) => [number, number, number, number],
): void {
  const texels = Buffer.alloc(4 * width * height);
  for (let y = 0; y < height; ++y) for (let x = 0; x < width; ++x) texels.set(f(x, y), 4 * (y * width + x));
  writeFileSync(
    path,
    Buffer.concat([Buffer.from(`#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y ${height} +X ${width}\n`), texels]),
  );
}

/** An asymmetric map: a bright warm blob, a broad cool one elsewhere, and unevenness of every texel. */
export function writeLopsidedHdr(path: string, width = 96, height = 48, seed = 5): void {
  const noise = random(seed);
  writeHdr(path, width, height, (x, y) => {
    const u = (x + 0.5) / width,
      v = (y + 0.5) / height;
    const warm = Math.exp(-((u - 0.81) ** 2 + (v - 0.3) ** 2) / 0.004),
      cool = Math.exp(-((u - 0.37) ** 2 + (v - 0.55) ** 2) / 0.03);
    const c = [3 * warm + 0.3 * cool + 0.05, 2 * warm + 0.6 * cool + 0.06, warm + 1.2 * cool + 0.04].map(
      (k) => k * (0.6 + 0.8 * noise()),
    );
    const exponent = Math.ceil(Math.log2(Math.max(...c)));
    const mantissa = c.map((k) => Math.max(1, Math.min(255, Math.floor(k * 2 ** (8 - exponent)))));
    return [mantissa[0]!, mantissa[1]!, mantissa[2]!, exponent + 128];
  });
}

interface PackedView {
  byteOffset?: number;
  byteLength: number;
  extensions?: { LAMBENT_transfer?: { form: string; byteLength: number; step?: number; first?: object } };
}
export interface PackedDocument {
  bufferViews: PackedView[];
  accessors: { bufferView: number; componentType: number }[];
  extensionsRequired?: string[];
  extensions: {
    LAMBENT_transfer: { transfer: { bufferView: number }; packed?: { error: number }; written: { byteLength: number } };
  };
}
/** Document and views of a .glb, packed or not. */
export function readPacked(path: string): { document: PackedDocument; view: (index: number) => ArrayBuffer } {
  const glb = readFileSync(path),
    length = glb.readUInt32LE(12),
    document = JSON.parse(glb.subarray(20, 20 + length).toString()) as PackedDocument;
  const view = (index: number): ArrayBuffer => {
    const { byteOffset = 0, byteLength } = document.bufferViews[index]!,
      begin = 28 + length + byteOffset;
    return Uint8Array.from(glb.subarray(begin, begin + byteLength)).buffer;
  };
  return { document, view };
}
