// What surfaces are made of, where that is free (visibility in blocks): the controls, and the text of the address.
import type { BakedTransfer, Reflection, Renderer } from '../src/index.js';
import { get, input, select } from './dom.js';

export type Model = Reflection['model'];

interface Slider {
  key: string;
  name: string;
  usual: number;
  most: number;
}
/** Spelt as `render --brdf`; `diffuse` is times the scene's own colour. */
const sliders: Record<Model, Slider[]> = {
  diffuse: [],
  phong: [
    { key: 'diffuse', name: 'Diffuse', usual: 0.7, most: 1 },
    { key: 'specular', name: 'Specular', usual: 0.3, most: 1 },
    { key: 'exponent', name: 'Exponent', usual: 60, most: 2000 },
  ],
  ggx: [
    { key: 'roughness', name: 'Roughness', usual: 0.3, most: 1 },
    { key: 'f0', name: 'Reflectance', usual: 0.9, most: 1 },
  ],
};
const names: Record<Model, string> = { diffuse: 'diffuse', phong: 'Phong', ggx: 'GGX (metal)' };
const models = Object.keys(sliders) as Model[];

type Values = Record<string, number | string>;
const make = (model: Model, value: (slider: Slider) => number): Reflection =>
  Object.fromEntries([['model', model], ...sliders[model].map((s) => [s.key, value(s)])]) as Reflection;
const usual = (model: Model): Reflection => make(model, (s) => s.usual);

/** Undefined where the text is none of these. */
export function parseReflection(text: string): Reflection | undefined {
  const [name, rest = ''] = text.split(/:(.*)/),
    model = models.find((m) => m === name);
  if (!model) return undefined;
  const given = new URLSearchParams(rest.replaceAll(',', '&'));
  const made = make(model, ({ key, usual, most }) => {
    const value = given.get(key) ?? '';
    return value !== '' && Number.isFinite(Number(value)) ? Math.min(most, Math.max(0, Number(value))) : usual;
  });
  if (made.model === 'phong') made.specular = Math.min(made.specular, 1 - made.diffuse);
  return made;
}

export const formatReflection = (of: Reflection): string => {
  const values = of as Values,
    parts = sliders[of.model].map(({ key }) => `${key}=${Number(Number(values[key]).toPrecision(4))}`);
  return of.model + (parts.length ? `:${parts.join(',')}` : '');
};

// Exponents by their logarithm.
const place = ({ key, most }: Slider, value: number): number =>
  key === 'exponent' ? Math.log(Math.max(1, value)) / Math.log(most) : value / most;
const valueAt = ({ key, most }: Slider, at: number): number =>
  key === 'exponent' ? Math.round(most ** at) : Math.round(100 * at * most) / 100;

/** Shows what there is, hidden where nothing is free; `change` is told what a hand has made of it. */
export function showSurface(of: Reflection | undefined, change: (to: Reflection) => void): void {
  get('surface').hidden = !of;
  if (!of) return;
  const chosen = select('model');
  chosen.replaceChildren(...models.map((m) => new Option(names[m], m)));
  chosen.value = of.model;
  chosen.onchange = () => {
    const made = usual(chosen.value as Model);
    showSurface(made, change);
    change(made);
  };
  const values = { ...of } as Values;
  for (const [i, row] of [...get('surface').querySelectorAll<HTMLElement>('label[data-slider]')].entries()) {
    const slider = sliders[of.model][i];
    row.hidden = !slider;
    if (!slider) continue;
    const range = input(`slider-${i}`),
      show = (): void => {
        const value = Number(values[slider.key]);
        range.value = String(place(slider, value));
        get(`slider-value-${i}`).textContent = String(Number(value.toPrecision(4)));
      };
    get(`slider-name-${i}`).textContent = slider.name;
    show();
    range.oninput = () => {
      values[slider.key] = valueAt(slider, Number(range.value));
      // Energy is kept: more of the one is less of the other.
      const other = slider.key === 'diffuse' ? 'specular' : slider.key === 'specular' ? 'diffuse' : undefined;
      if (other)
        values[other] = Math.min(Number(values[other]), Math.round(100 - 100 * Number(values[slider.key])) / 100);
      const made = { ...values } as unknown as Reflection;
      showSurface(made, change);
      change(made);
    };
  }
}

/** Makes a scene of it, and says of what it is now: diffuse, where the graphics card does not draw that. */
export function takeReflection(
  transfer: BakedTransfer,
  of: Reflection,
  renderer: Renderer,
  onProblem: (error: unknown) => void,
): Reflection {
  transfer.reflection = of;
  try {
    transfer.check(renderer);
  } catch (error) {
    transfer.reflection = { model: 'diffuse' };
    onProblem(error);
  }
  return transfer.reflection;
}
