// Files of the server's as they come: how far they are, and a picture before the last of a packed one is there.
import { LambentError } from '../src/index.js';
import type { FirstPart } from '../src/progressive.js';
import { get, megabytes, sentence, showLoading, showProblem } from './dom.js';
import { fetchFile, firstAlone } from './loading.js';
import type { Viewer } from './viewer.js';

/** The file as it comes, and what says how far it is; once there is a picture, of how many bands that is. */
function fetchNamed(name: string, file: string, whole: boolean): { part: Promise<FirstPart>; say: () => void } {
  let [done, share] = [0, 0];
  const say = (): void => {
    const bands = document.body.dataset['bands'],
      so = done > 0 ? `: ${megabytes(done)}` : '';
    showLoading(`Loading ${name}${so}${bands ? `, drawn by ${bands} bands` : ''}`, share);
  };
  say();
  const told = (...now: [number, number]): void => {
    [done, share] = now;
    say();
  };
  const part = fetchFile(file, told, whole).catch((error: unknown) => {
    throw new LambentError(sentence(name, error));
  });
  return { part, say };
}
export const fetchWhole = async (name: string, file: string): Promise<ArrayBuffer> =>
  (await fetchNamed(name, file, true).part).bytes;

/**
 * Opens a scene as soon as it can be drawn, and gives it its other bands when they are there; says so where they do not
 * come.
 */
export async function openAsItComes(
  viewer: Viewer,
  name: string,
  file: string,
  open: (bytes: ArrayBuffer, isAll: boolean) => Promise<void>,
): Promise<void> {
  const { part, say } = fetchNamed(name, file, false),
    { bytes, bands, rest } = await part;
  await open(bytes, !rest);
  const scene = viewer.bakedScene;
  if (!rest || !scene) return;
  const { order } = scene.transfer;
  document.body.dataset['bands'] = `${bands} of ${order}`;
  say();
  try {
    const values = await rest;
    if (viewer.bakedScene !== scene) return; // another was opened meanwhile
    scene.refine(values);
    viewer.changeLight();
  } catch (error) {
    showProblem(sentence(name, firstAlone(error, bands!, order)));
  } finally {
    delete document.body.dataset['bands'];
    get('loading').hidden = true;
  }
}
