// What takes the picture away from the page: its address, a file, the whole screen.
import { get, say, showProblem } from './dom.js';
import type { Viewer } from './viewer.js';

export interface Shared {
  /** Of the scene. */
  name: string;
  address: string;
  /** Whether who follows the address sees the same: nothing was opened from a file. */
  whole: boolean;
}

export function connectSharing(viewer: Viewer, shared: () => Shared): void {
  get('link').addEventListener('click', () => void copyLink(shared()));
  get('save').addEventListener('click', () => void savePicture(viewer, shared().name));
  const full = get('full');
  full.hidden = !document.fullscreenEnabled;
  full.addEventListener('click', () => {
    const change = document.fullscreenElement
      ? document.exitFullscreen()
      : document.documentElement.requestFullscreen();
    change.catch(() => say('The browser does not give this page the whole screen.'));
  });
  document.addEventListener('fullscreenchange', () =>
    full.setAttribute('aria-pressed', String(document.fullscreenElement !== null)),
  );
}

async function copyLink({ address, whole }: Shared): Promise<void> {
  try {
    await navigator.clipboard.writeText(address);
    say(whole ? 'The link is copied.' : 'The link is copied, but does not hold the files that were opened here.');
  } catch {
    say('The browser does not let this page copy: the address bar has the link.'); // no https, say
  }
}

async function savePicture(viewer: Viewer, name: string): Promise<void> {
  const picture = await viewer.picture();
  if (!picture) return showProblem('The browser makes no file of the picture.');
  const link = document.createElement('a');
  link.href = URL.createObjectURL(picture);
  link.download = `${name.replace(/\.[^.]*$/, '') || 'lambent'}.png`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
