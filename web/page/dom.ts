// Elements of the page, and what it says.
import { LambentError } from '../src/index.js';

export const get = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;
export const input = (id: string): HTMLInputElement => get(id);
export const select = (id: string): HTMLSelectElement => get(id);

export function showProblem(text: string): void {
  document.body.classList.remove('bare');
  get('loading').hidden = true;
  get('problem-text').textContent = text;
  get('problem').hidden = false;
}
export const hideProblem = (): void => void (get('problem').hidden = true);
export const sentence = (name: string, error: unknown): string =>
  error instanceof LambentError
    ? name
      ? `${name} ${error.message}`
      : error.message
    : `${name ? name + ': ' : ''}${error instanceof Error ? error.message : String(error)}`;

export function showLoading(what: string, share?: number): void {
  get('loading-what').textContent = what;
  const bar = get<HTMLProgressElement>('loading-share');
  if (share === undefined || share === 0) bar.removeAttribute('value');
  else bar.value = share;
  get('loading').hidden = false;
}

export const megabytes = (bytes: number): string => `${(bytes / 1e6).toPrecision(3)} MB`;
export const degrees = (angle: number): string => `${Math.round(angle)}°`.replace('-', '−');

let saidUntil = 0;
/** A word about what was just done, for a few seconds. */
export function say(text: string): void {
  get('said').textContent = text;
  clearTimeout(saidUntil);
  saidUntil = window.setTimeout(() => (get('said').textContent = ''), 4000);
}
