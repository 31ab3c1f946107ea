// Controls that some kinds of transfer have, and what is said of hands where a view is fixed.
import { shBand, shIndex, type BakedTransfer } from '../src/index.js';
import { get, input } from './dom.js';
import { falseColorEnd, falseColorGain, fitErrorEnd } from './false_color.js';
import type { Manifest } from './loading.js';
import type { State, View } from './state.js';

export function possibleViews(
  transfer: BakedTransfer | undefined,
  manifest: Manifest | undefined,
  hasRelief: boolean,
): View[] {
  const possible: View[] = ['baked'];
  if (manifest?.compare) possible.push('compare');
  if (transfer?.indirect) possible.push('direct', 'indirect');
  else if (!transfer?.view) possible.push('unshadowed');
  if (hasRelief) possible.push('relief');
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

/** What false colours stand for, and which coefficient they show. */
export function showScale(
  { view, against, coefficient, exposure }: State,
  { harmonics = Infinity }: Partial<NonNullable<BakedTransfer['columns']>> = {},
): void {
  const usesCoefficient = [view, against].includes('coefficient'),
    usesError = [view, against].includes('error'),
    l = shBand(coefficient),
    m = coefficient - shIndex(l, 0);
  get('coefficient-row').hidden = !usesCoefficient;
  get('scale').hidden = !usesCoefficient && !usesError;
  get('coefficient-name').textContent =
    coefficient < harmonics ? `l ${l}, m ${m}` : `lobe ${coefficient - harmonics + 1}`;
  const gain = falseColorGain(exposure),
    end = falseColorEnd / gain;
  get('scale-low').textContent = `−${end.toPrecision(2)}`;
  get('scale-high').textContent = `+${end.toPrecision(2)}`;
  if (!usesError || usesCoefficient) return;
  get('scale-low').textContent = 'grey: 0 %'; // the scale's dark half is not used
  get('scale-high').textContent = `${((100 * fitErrorEnd) / gain).toPrecision(2)} %`;
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
