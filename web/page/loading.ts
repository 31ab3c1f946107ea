// Everything that comes from files: the manifest beside the page, baked scenes, environments. Errors are sentences.
import {
  DataTexture,
  FloatType,
  HalfFloatType,
  LinearFilter,
  LoaderUtils,
  LoadingManager,
  RepeatWrapping,
  RGBAFormat,
  Vector3,
  type Texture,
} from 'three';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
import { GLTFLoader, type GLTF } from 'three/addons/loaders/GLTFLoader.js';
import { HDRLoader } from 'three/addons/loaders/HDRLoader.js';
import {
  checkBakedFile,
  extensionName,
  LambentError,
  LambentTransferPlugin,
  latLongMap,
  Lighting,
  type LatLongMap,
} from '../src/index.js';
import { toHalf } from '../src/half.js';
import { readProgressive, type FirstPart, type Progress } from '../src/progressive.js';
import { skyMap, sunDirection, type Sky } from './sky.js';

/** lambent.json beside the page, as `lambent view` and `lambent export` write it; paths are relative to it. */
export interface Manifest {
  name: string;
  baked: string;
  compare?: string;
  reference?: string;
  environments: { name: string; file: string }[];
  /** Objects that may be put into the scene, and those that stand in it to begin with, as the address has them. */
  inserts?: { name: string; file: string }[];
  insert?: string[];
  camera?: number[];
  rotate?: number[];
  exposure?: number | 'auto';
  tone?: string;
}

export interface EnvironmentFile {
  name: string;
  lighting: Lighting;
  background: DataTexture; // first row at the zenith
  sun: Vector3; // towards the brightest texel
}

/** The manifest, or undefined where the page stands alone. */
export async function loadManifest(): Promise<Manifest | undefined> {
  const answer = await fetch('lambent.json', { cache: 'no-store' }).catch(() => undefined);
  if (!answer?.ok) return undefined;
  try {
    return (await answer.json()) as Manifest;
  } catch {
    return undefined; // a host that answers everything with its own page
  }
}

/** A file, or what of it can be drawn first, telling how much has come; with `whole` all of it. */
export async function fetchFile(path: string, onProgress: Progress, whole = true): Promise<FirstPart> {
  const answer = await fetch(path).catch(() => {
    throw new LambentError('cannot be reached: is "lambent view" still running?');
  });
  if (!answer.ok || !answer.body) throw new LambentError(`cannot be had: the server says ${answer.status}`);
  return readProgressive(answer, onProgress, whole);
}

/** Says what is shown of a file whose rest did not come. */
export const firstAlone = (error: unknown, bands: number, of: number): LambentError =>
  new LambentError(
    `${error instanceof Error ? error.message : String(error)}: what is shown are its first ${bands} bands of ${of}`,
  );

/** Where the files are that a .gltf names: beside a file of the server's, by its address, or opened with it. */
export type Beside = string | readonly File[];

function gltfLoader(beside: Beside, opened: string[]): GLTFLoader {
  const manager = new LoadingManager();
  if (typeof beside !== 'string')
    manager.setURLModifier((url) => {
      if (/^(blob|data):/.test(url)) return url;
      const name = decodeURIComponent(url.slice(url.lastIndexOf('/') + 1)),
        file = beside.find((f) => f.name === name);
      if (!file) throw new LambentError(`names ${name}, which was not opened with it: choose all its files at once`);
      opened.push(URL.createObjectURL(file));
      return opened.at(-1)!;
    });
  return new GLTFLoader(manager);
}

async function read(bytes: ArrayBuffer, beside: Beside, plugin: boolean): Promise<GLTF> {
  const opened: string[] = [],
    loader = gltfLoader(beside, opened);
  if (plugin) loader.register((parser) => new LambentTransferPlugin(parser));
  try {
    return await loader.parseAsync(bytes, typeof beside === 'string' ? LoaderUtils.extractUrlBase(beside) : '');
  } finally {
    for (const url of opened) URL.revokeObjectURL(url);
  }
}

/** Refuses what src/lambent/pipeline/browser.cpp refuses of whole files, in the same words. */
function checkForPage(document: unknown): void {
  const extension = (document as { extensions: Record<string, { shells?: unknown }> }).extensions[extensionName];
  if (extension?.shells !== undefined)
    throw new LambentError(
      'holds the shadow field of an object, which the web page does not draw: `lambent render --place` and ' +
        '`lambent view --window --place` put it over a baked scene',
    );
}

/** A baked scene; its BakedScene is in gltf.userData.lambent. */
export async function readBaked(bytes: ArrayBuffer, beside: Beside = ''): Promise<GLTF> {
  checkForPage(checkBakedFile(bytes));
  try {
    return await read(bytes, beside, true);
  } catch (error) {
    if (error instanceof LambentError) throw error;
    throw new LambentError(`cannot be read: ${error instanceof Error ? error.message : String(error)}`);
  }
}

/** The scene of a file without what we know of it, as any viewer has it. */
export const readPlain = (bytes: ArrayBuffer, beside: Beside = ''): Promise<GLTF> => read(bytes, beside, false);

/** Linear radiance of an .hdr or .exr, told apart by content. */
export function readMap(bytes: ArrayBuffer): LatLongMap {
  const head = new Uint8Array(bytes, 0, Math.min(4, bytes.byteLength));
  const isExr = head.length === 4 && head[0] === 0x76 && head[1] === 0x2f && head[2] === 0x31 && head[3] === 0x01;
  const isHdr = head.length >= 2 && head[0] === 0x23 && head[1] === 0x3f;
  if (!isExr && !isHdr) throw new LambentError('is no environment: .hdr or .exr is wanted');
  let read: object;
  try {
    read = isExr
      ? new EXRLoader().setDataType(FloatType).parse(bytes)
      : new HDRLoader().setDataType(FloatType).parse(bytes);
  } catch (error) {
    throw new LambentError(`cannot be read: ${error instanceof Error ? error.message : String(error)}`);
  }
  const { data, width, height } = read as { data: ArrayLike<number>; width: number; height: number };
  // What their own load() makes of it: .hdr has its first row at the top, .exr at the bottom.
  const map = latLongMap({ image: { data, width, height }, type: FloatType, flipY: isHdr } as unknown as Texture);
  // A mantissa counts 256ths; three's loader takes it for 255ths.
  return isHdr ? { ...map, data: Float32Array.from(map.data, (v) => (v * 255) / 256) } : map;
}

/** Half floats, clamped to what those hold; first row at the top. */
export function mapTexture(map: LatLongMap): DataTexture {
  const data = new Uint16Array(4 * map.width * map.height);
  for (let i = 0; i < map.width * map.height; ++i)
    for (let c = 0; c < 4; ++c) {
      const value = c < map.channels ? map.data[i * map.channels + c]! : 1;
      data[4 * i + c] = toHalf(value > 0 ? value : 0);
    }
  const texture = new DataTexture(data, map.width, map.height, RGBAFormat, HalfFloatType);
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.wrapS = RepeatWrapping;
  texture.generateMipmaps = false;
  texture.needsUpdate = true;
  return texture;
}

export const makeEnvironment = (name: string, map: LatLongMap): EnvironmentFile => ({
  name,
  lighting: Lighting.fromMap(map),
  background: mapTexture(map),
  sun: brightest(map),
});

/** Direction of the brightest texel. */
export function brightest({ data, width, height, channels }: LatLongMap): Vector3 {
  let best = 0,
    peak = -1;
  for (let i = 0; i < width * height; ++i) {
    const y = 0.2126 * data[i * channels]! + 0.7152 * data[i * channels + 1]! + 0.0722 * data[i * channels + 2]!;
    if (y > peak) [peak, best] = [y, i];
  }
  const phi = 2 * Math.PI * (((best % width) + 0.5) / width - 0.5),
    theta = (Math.PI * (Math.floor(best / width) + 0.5)) / height;
  return new Vector3(Math.sin(theta) * Math.cos(phi), Math.cos(theta), Math.sin(theta) * Math.sin(phi));
}

/** A sky of the page's own. */
export const makeSky = (name: string, sky: Sky): EnvironmentFile => ({
  ...makeEnvironment(name, skyMap(sky)),
  sun: new Vector3().fromArray(sunDirection(sky)),
});
