// Controls that some kinds of transfer have, and what is said of hands where a view is fixed.
import type { BakedTransfer } from '../src/index.js';
import { get, input } from './dom.js';
import type { Manifest } from './loading.js';
import type { View } from './state.js';

export function possibleViews(transfer: BakedTransfer | undefined, manifest: Manifest | undefined): View[] {
  const possible: View[] = ['baked'];
  if (manifest?.compare) possible.push('compare');
  if (transfer?.indirect) possible.push('direct', 'indirect');
  else if (!transfer?.view) possible.push('unshadowed');
  if (!transfer || transfer.coefficientMaterials) possible.push('coefficient');
  if (transfer?.fitErrorMaterials) possible.push('error');
  if (manifest?.reference) possible.push('reference');
  return possible;
}

/** Sight and wavelets have no bands to leave out; nor have lobes of light alone. */
export function showBands(transfer: BakedTransfer | undefined): void {
  const { reflection, terms, columns, order } = transfer ?? {};
  get('order-row').hidden = get('window-row').hidden =
    reflection !== undefined || terms !== undefined || (columns !== undefined && order === 0);
}

/** What the slider goes through; 0: all. */
const termSteps = [10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 0] as const;
const rank = (terms: number): number => (terms === 0 ? Infinity : Math.log(terms));

/** How many wavelets of the light are used; undefined: there are none. */
export function showTerms(terms: number | undefined): void {
  get('terms-row').hidden = terms === undefined;
  if (terms === undefined) return;
  const distances = termSteps.map((step) => (step === terms ? 0 : Math.abs(rank(step) - rank(terms))));
  input('terms').value = String(distances.indexOf(Math.min(...distances)));
  get('terms-value').textContent = terms === 0 ? 'all' : terms.toLocaleString('en');
}
export const takeTerms = (): number => termSteps[Number(input('terms').value)]!;

/** Whether the camera was baked in, and hands turn the light alone. */
export function showFixed(isFixed: boolean): void {
  document.querySelectorAll<HTMLElement>('.looks').forEach((of) => (of.hidden = isFixed));
  if (isFixed) for (const id of ['light-hint', 'turn']) get(id).hidden = true; // lamps have a say in it, too
  get('fixed-hint').hidden = !isFixed;
  get('light-keys').textContent = isFixed ? 'Drag, arrow keys' : 'Shift-drag, Shift-arrows';
  get('picture').setAttribute(
    'aria-label',
    isFixed
      ? 'The picture. Drag or use the arrow keys to turn the light.'
      : 'The scene. Drag or use the arrow keys to look around; with Shift, to turn the light.',
  );
}
