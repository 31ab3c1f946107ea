// What a file holds, and what a frame takes: shown where they are asked for.
import type { BakedScene, IndirectTimes } from '../src/index.js';
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
      t.indirect
        ? 'direct to indirect light'
        : t.reflection
          ? 'visibility in blocks'
          : t.terms !== undefined
            ? 'wavelets on a cube'
            : [
                `${t.kind}, order ${t.order}`,
                ...(t.columns ? [`${t.columns.lobes} lobes of light`] : []),
                t.channels === 3 ? 'colour' : 'grey',
              ].join(', '),
    ],
    ['Receivers', t.receivers.toLocaleString('en')],
    ['Vertices', t.meshes.reduce((n, m) => n + m.geometry.getAttribute('position').count, 0).toLocaleString('en')],
    ['In the file', megabytes(t.fileBytes)],
    ['On the graphics card', megabytes(t.gpuBytes)],
    ...(t.indirect
      ? [
          ['Surfels', t.indirect.leaves.toLocaleString('en')] as [string, string],
          ['Entries', t.indirect.entries.toLocaleString('en')] as [string, string],
        ]
      : []),
    ...(t.lamps?.size ? [['Lamps', [...t.lamps.keys()].join(', ')] as [string, string]] : []),
    ['A receiver', `${Math.round(t.fileBytes / t.receivers)} bytes`],
  ];
  const zonal = (provenance as { zonal?: { lobes?: unknown; rms?: unknown } } | undefined)?.zonal;
  if (typeof zonal?.lobes === 'number' && typeof zonal.rms === 'number')
    rows.push(['Lobes', `${zonal.lobes} a receiver`], ['Fit error', `${(100 * zonal.rms).toPrecision(3)} % RMS`]);
  return rows;
}

let frameTime = 0;
/** What of a frame lamps took: rays, bounces and reading, in milliseconds. */
export function showLightTime({ rays, bounces, reading }: IndirectTimes): void {
  get('light-time').textContent =
    `${rays.toFixed(1)} ms of rays, ${bounces.toFixed(1)} of bounces, ${reading.toFixed(1)} of reading`;
}

/** A frame followed the one before it after so many milliseconds. */
export function showFrameTime(milliseconds: number): void {
  frameTime = frameTime ? 0.9 * frameTime + 0.1 * milliseconds : milliseconds;
  if (get<HTMLDetailsElement>('statistics-box').open)
    get('figures').textContent = `${frameTime.toFixed(frameTime < 10 ? 1 : 0)} ms a frame`;
}
