// The wipe's line and the lobes' pointer.
import { MathUtils } from 'three';
import { get } from './dom.js';
import type { Viewer } from './viewer.js';

/** `move` gets the share of the width that lies left of the line, which `share` tells. */
export function connectWipe(share: () => number, move: (share: number) => void): void {
  const wipe = get('wipe'),
    to = (x: number): void => move(MathUtils.clamp(x, 0, 1));
  wipe.addEventListener('pointerdown', (e) => wipe.setPointerCapture(e.pointerId));
  wipe.addEventListener('pointermove', (e) => wipe.hasPointerCapture(e.pointerId) && to(e.clientX / innerWidth));
  wipe.addEventListener('keydown', (e) => {
    const step = { ArrowLeft: -0.02, ArrowRight: 0.02, Home: -1, End: 1 }[e.key];
    if (step !== undefined) {
      to(share() + step);
      e.preventDefault();
    }
  });
}

/** The sheet of hands and keys, by its button and the key ?. */
export function connectHelp(): void {
  const help = get<HTMLDialogElement>('help');
  get('help-open').addEventListener('click', () => help.showModal());
  get('help-close').addEventListener('click', () => help.close());
  addEventListener('keydown', (e) => {
    if (e.key === '?' && !help.open) help.showModal();
  });
}

/** A double click, or the key L under the pointer, in the picture's middle where there is none. */
export function connectLobes(viewer: Viewer): void {
  const picture = get('picture');
  let at: { x: number; y: number } | undefined;
  const pick = (x: number, y: number): void => {
    if (!viewer.hasLobes) return;
    get('lobes').textContent = viewer.pickLobes(x, y) ?? '';
    get('hint').hidden = true; // the words stand in its place
  };
  picture.addEventListener('pointermove', (e) => (at = { x: e.offsetX, y: e.offsetY }));
  picture.addEventListener('pointerleave', () => (at = undefined));
  picture.addEventListener('dblclick', (e) => pick(e.offsetX, e.offsetY));
  picture.addEventListener('keydown', (e) => {
    if (e.key.toLowerCase() === 'l' && !e.ctrlKey && !e.metaKey && !e.altKey)
      pick(at?.x ?? picture.clientWidth / 2, at?.y ?? picture.clientHeight / 2);
    else if (e.key === 'Escape') {
      viewer.clearLobes();
      get('lobes').textContent = '';
    }
  });
}
