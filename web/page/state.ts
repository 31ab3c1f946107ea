// What is on show, as the address's fragment: a link or a reload gives the same picture.
// Numbers are separated by commas; `camera` and `rotate` are spelt as --camera and --env-rotate of the command line.
import { shWindows, type Reflection, type ShWindow } from '../src/index.js';
import type { LampState } from './lamps.js';
import { highestSun, lowestSun } from './sky.js';
import { formatReflection, parseReflection } from './surface.js';
import { tones, type Tone } from './tone.js';

export const views = [
  'baked',
  'compare',
  'direct',
  'indirect',
  'unshadowed',
  'relief',
  'coefficient',
  'error',
  'reference',
] as const;
export type View = (typeof views)[number];
export const viewNames: Record<View, string> = {
  baked: 'Baked',
  compare: 'Second file',
  direct: 'Direct light',
  indirect: 'Indirect light',
  unshadowed: 'Unshadowed',
  relief: 'Relief',
  coefficient: 'One coefficient',
  error: 'Error of the fit',
  reference: 'Reference',
};

export const overlays = ['lattice', 'receivers'] as const;
export type Overlay = (typeof overlays)[number];

export interface State extends LampState {
  camera?: number[]; // eye, target, vertical field of view in degrees
  rotate: number[]; // yaw, pitch, roll in degrees
  env: number;
  elevation?: number; // of a sky's sun, where it is another than the sky's name says
  spin: number; // degrees a second that the light turns about +Y
  free: boolean; // a hand that goes sideways turns the light about the picture's upright, not about +Y
  exposure: number | 'auto'; // stops
  tone: Tone;
  order: number; // bands; 0: all that are baked
  window: ShWindow;
  terms: number; // of wavelets; 0: all
  view: View;
  against?: View; // right of the wipe
  wipe: number; // share of the width left of the wipe
  coefficient: number;
  time?: number; // seconds into the animation, standing still
  brdf?: Reflection; // where surfaces are free, other than diffuse
  inserts?: string[]; // texts of --insert; undefined: what the server says
  show: Overlay[]; // over the scene
  background: boolean;
  ui: boolean;
}

export const defaultState = (): State => ({
  rotate: [0, 0, 0],
  env: 0,
  spin: 0,
  free: false,
  exposure: 'auto',
  tone: 'neutral',
  order: 0,
  window: 'auto',
  terms: 0,
  view: 'baked',
  wipe: 0.5,
  coefficient: 3,
  show: [],
  background: true,
  ui: true,
});

const numbers = (text: string | null, count: number): number[] | undefined => {
  const values = (text ?? '').split(',').map(Number);
  return text !== null && text !== '' && values.length === count && values.every(Number.isFinite) ? values : undefined;
};

/** `fragment` over `base`; what cannot be read is left as it is. */
export function parseState(fragment: string, base: State): State {
  const from = new URLSearchParams(fragment.replace(/^#/, '')),
    state = { ...base };
  const one = (key: string, low: number, high: number): number | undefined => {
    const value = numbers(from.get(key), 1)?.[0];
    return value === undefined ? undefined : Math.min(high, Math.max(low, value));
  };
  const camera = numbers(from.get('camera'), 7);
  if (camera && camera[6]! > 0 && camera[6]! < 180 && [0, 1, 2].some((i) => camera[i] !== camera[i + 3]))
    state.camera = camera;
  state.rotate = numbers(from.get('rotate'), 3) ?? state.rotate;
  state.env = Math.floor(one('env', 0, 1e6) ?? state.env);
  const elevation = one('elevation', lowestSun, highestSun);
  if (elevation !== undefined) state.elevation = elevation;
  state.spin = one('spin', -360, 360) ?? state.spin;
  if (from.has('free')) state.free = from.get('free') === 'on';
  state.exposure = from.get('exposure') === 'auto' ? 'auto' : (one('exposure', -20, 20) ?? state.exposure);
  state.tone = tones.find((t) => t === from.get('tone')) ?? state.tone;
  state.order = Math.floor(one('order', 0, 16) ?? state.order);
  state.window = shWindows.find((w) => w === from.get('window')) ?? state.window;
  state.terms = Math.floor(one('terms', 0, 1048576) ?? state.terms);
  state.view = views.find((v) => v === from.get('view')) ?? state.view;
  const against = views.find((v) => v === from.get('against'));
  if (against) state.against = against;
  state.wipe = one('wipe', 0, 1) ?? state.wipe;
  state.coefficient = Math.floor(one('coefficient', 0, 255) ?? state.coefficient);
  const time = one('time', 0, 1e6);
  if (time !== undefined) state.time = time;
  const brdf = parseReflection(from.get('brdf') ?? '');
  if (brdf) state.brdf = brdf;
  if (from.has('lamp')) state.lamps = from.getAll('lamp').filter((text) => text !== '');
  if (from.has('dark')) state.dark = (from.get('dark') ?? '').split(',').map(Number);
  if (from.has('albedo')) state.albedos = from.getAll('albedo');
  if (from.has('insert')) state.inserts = from.getAll('insert').filter((text) => text !== '');
  if (from.has('show')) state.show = overlays.filter((one) => from.get('show')!.split(',').includes(one));
  if (from.has('background')) state.background = from.get('background') !== 'none';
  if (from.has('ui')) state.ui = from.get('ui') !== 'off';
  return state;
}

const short = (x: number): string => String(Number(x.toPrecision(6)));

/** What differs from `base`, and where the camera is. */
export function formatState(state: State, base: State = defaultState()): string {
  const parts: string[] = [];
  const put = (key: string, text: string): void => void parts.push(`${key}=${text}`);
  if (state.camera) put('camera', state.camera.map(short).join(','));
  if (state.rotate.some((r) => Math.abs(r) > 1e-4)) put('rotate', state.rotate.map(short).join(','));
  if (state.env !== base.env) put('env', String(state.env));
  if (state.elevation !== undefined) put('elevation', short(state.elevation));
  if (state.spin) put('spin', short(state.spin));
  if (state.free) put('free', 'on');
  if (state.exposure !== base.exposure) put('exposure', state.exposure === 'auto' ? 'auto' : short(state.exposure));
  if (state.tone !== base.tone) put('tone', state.tone);
  if (state.order !== base.order) put('order', String(state.order));
  if (state.window !== base.window) put('window', state.window);
  if (state.terms !== base.terms) put('terms', String(state.terms));
  if (state.view !== base.view) put('view', state.view);
  if (state.against) {
    put('against', state.against);
    put('wipe', short(state.wipe));
  }
  if (state.coefficient !== base.coefficient) put('coefficient', String(state.coefficient));
  if (state.time !== undefined) put('time', short(state.time));
  if (state.brdf && state.brdf.model !== 'diffuse') put('brdf', formatReflection(state.brdf));
  const encoded = (text: string): string => encodeURIComponent(text).replace(/%(2C|3D|40)/g, decodeURIComponent);
  // None at all is said as well: the page would begin with one.
  for (const text of state.lamps?.length === 0 ? [''] : (state.lamps ?? [])) put('lamp', encoded(text));
  if (state.dark) put('dark', state.dark.join(','));
  for (const text of state.albedos ?? []) put('albedo', encoded(text));
  for (const text of state.inserts?.length === 0 ? [''] : (state.inserts ?? [])) put('insert', encoded(text));
  if (state.show.length > 0) put('show', state.show.join(','));
  if (!state.background) put('background', 'none');
  if (!state.ui) put('ui', 'off');
  return '#' + parts.join('&');
}
