// What a file holds, and what a frame takes: shown where they are asked for.
import type { BakedScene } from '../src/index.js';
import { get, megabytes } from './dom.js';

/** Of the file; of none, nothing. */
export function showStatistics(baked?: BakedScene): void {
  get('statistics-box').hidden = !baked;
  const rows = baked ? rowsOf(baked) : [];
  get('statistics').replaceChildren(
    ...rows.flatMap(([term, text]) => {
      const dt = document.createElement('dt'),
        dd = document.createElement('dd');
      dt.textContent = term;
      dd.textContent = text;
      return [dt, dd];
    }),
  );
}

function rowsOf({ transfer: t, provenance }: BakedScene): [string, string][] {
  const rows: [string, string][] = [
    [
      'Transfer',
      t.reflection ? 'visibility in blocks' : `${t.kind}, order ${t.order}, ${t.channels === 3 ? 'colour' : 'grey'}`,
    ],
    ['Receivers', t.receivers.toLocaleString('en')],
    ['Vertices', t.meshes.reduce((n, m) => n + m.geometry.getAttribute('position').count, 0).toLocaleString('en')],
    ['In the file', megabytes(t.fileBytes)],
    ['On the graphics card', megabytes(t.gpuBytes)],
    ...(t.lamps?.size ? [['Lamps', [...t.lamps.keys()].join(', ')] as [string, string]] : []),
    ['A receiver', `${Math.round(t.fileBytes / t.receivers)} bytes`],
  ];
  const zonal = (provenance as { zonal?: { lobes?: unknown; rms?: unknown } } | undefined)?.zonal;
  if (typeof zonal?.lobes === 'number' && typeof zonal.rms === 'number')
    rows.push(['Lobes', `${zonal.lobes} a receiver`], ['Fit error', `${(100 * zonal.rms).toPrecision(3)} % RMS`]);
  return rows;
}

let frameTime = 0;
/** A frame followed the one before it after so many milliseconds. */
export function showFrameTime(milliseconds: number): void {
  frameTime = frameTime ? 0.9 * frameTime + 0.1 * milliseconds : milliseconds;
  if (get<HTMLDetailsElement>('statistics-box').open)
    get('figures').textContent = `${frameTime.toFixed(frameTime < 10 ? 1 : 0)} ms a frame`;
}
