// Lamps that move and paint (direct to indirect light): their list, with a slider for each number, and the text of the
// address. Handles in the picture are lamp_handles.ts.
import {
  formatColor,
  formatLamp,
  lampKinds,
  lampNumbers,
  LambentError,
  limits,
  namesLamp,
  parseLamp,
  parseNamedColor,
  type IndirectControls,
  type Lamp,
  type LampKind,
  type Rgb,
} from '../src/index.js';
import { get } from './dom.js';
import { button, row, say, slider } from './rows.js';

/** As the address has them: texts of --lamp, numbers of those that are off (from 1), texts of --albedo. */
export interface LampState {
  lamps?: string[];
  dark?: number[];
  albedos?: string[];
}

const kindNames: Record<LampKind, string> = { point: 'Point', sphere: 'Sphere', spot: 'Spot', sun: 'Sun' };

/** Puts a state into a scene. Throws LambentError at a lamp or paint that cannot be. */
export function takeLamps(scene: IndirectControls, { lamps, dark, albedos }: LampState): void {
  const moving = (lamps ?? []).filter(namesLamp).map((text, i): Lamp => {
    const lamp = parseLamp(text);
    return dark?.includes(i + 1) ? { ...lamp, off: true } : lamp;
  });
  scene.movingLamps = lamps ? moving : firstLamps(scene);
  const named = (text: string): { name: string; color: Rgb } => {
    const found = parseNamedColor(text);
    if (!found) throw new LambentError(`"${text}" is no NAME=R,G,B`);
    return found;
  };
  for (const name of scene.ownLamps.keys()) scene.scaleOwn(name, [1, 1, 1]);
  for (const { name, color } of (lamps ?? []).filter((text) => !namesLamp(text)).map(named))
    scene.scaleOwn(name, color);
  for (const name of scene.painted.keys()) scene.paint(name, undefined);
  for (const { name, color } of (albedos ?? []).map(named)) scene.paint(name, color);
}

export function stateOfLamps(scene: IndirectControls): LampState {
  const isAsItWas = (scale: Rgb): boolean => scale.every((s) => s === 1);
  const dark = scene.movingLamps.flatMap(({ off }, i) => (off ? [i + 1] : []));
  return {
    lamps: [
      ...scene.movingLamps.map(formatLamp),
      ...[...scene.ownLamps].filter(([, s]) => !isAsItWas(s)).map(([name, s]) => `${name}=${formatColor(s)}`),
    ],
    ...(dark.length > 0 && { dark }),
    ...(scene.painted.size > 0 && { albedos: [...scene.painted].map(([name, c]) => `${name}=${formatColor(c)}`) }),
  };
}

/** A lamp to begin with, in the middle of a scene that has none of its own. */
const firstLamps = (scene: IndirectControls): Lamp[] => (scene.ownLamps.size > 0 ? [] : [newLamp(scene, 'point')]);

/** About as bright as its scene is wide. */
export function newLamp({ bounds: { center, radius } }: IndirectControls, kind: LampKind): Lamp {
  const short = (x: number): number => Number(x.toPrecision(4)),
    [x, y, z] = [center.x, center.y + 0.15 * radius, center.z].map(short) as Rgb,
    flux = short(radius * radius);
  const grey = (v: number): Rgb => [v, v, v];
  switch (kind) {
    case 'point':
      return { kind, numbers: [x, y, z], color: grey(flux) };
    case 'sphere':
      return {
        kind,
        numbers: [x, y, z, short(0.04 * radius)],
        color: grey(short(flux / (Math.PI * (0.04 * radius) ** 2))),
      };
    case 'spot':
      return { kind, numbers: [x, y, z, x, short(y - 0.5 * radius), z, 40], color: grey(4 * flux) };
    case 'sun':
      return { kind, numbers: [40, 50], color: grey(3) };
  }
}

const toScreen = (c: number): number =>
  Math.round(255 * Math.min(1, Math.max(0, c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055)));
const toLinear = (v: number): number => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const hexOf = (color: Rgb): string => '#' + color.map((c) => toScreen(c).toString(16).padStart(2, '0')).join('');
const colorOf = (hex: string): Rgb =>
  [1, 3, 5].map((i) => Number(toLinear(parseInt(hex.slice(i, i + 2), 16) / 255).toPrecision(6))) as Rgb;

function colour(text: string, color: Rgb, change: (color: Rgb) => void): HTMLLabelElement {
  const picker = document.createElement('input');
  Object.assign(picker, { type: 'color', value: hexOf(color), name: text });
  picker.addEventListener('input', () => change(colorOf(picker.value)));
  return row(text, picker);
}
/** The controls. `change` is told of whatever a hand has changed. */
export class LampPanel {
  /** Which one has its handle's mark, and is moved by the sliders that are open. */
  private readonly open = new Set<number>([0]);

  constructor(
    private readonly scene: () => IndirectControls | undefined,
    private readonly change: () => void,
  ) {
    for (const kind of lampKinds)
      get('add-lamps').append(
        button(kindNames[kind], () => this.add(kind), `Add a lamp: ${kindNames[kind].toLowerCase()}`),
      );
  }

  private add(kind: LampKind): void {
    const scene = this.scene();
    if (!scene || scene.movingLamps.length >= limits.lamps) return;
    this.open.clear();
    this.open.add(scene.movingLamps.length);
    scene.movingLamps = [...scene.movingLamps, newLamp(scene, kind)];
    this.show();
    this.change();
  }

  /** Changes one lamp. */
  set(index: number, lamp: Lamp): void {
    const scene = this.scene();
    if (!scene) return;
    scene.movingLamps = scene.movingLamps.map((old, i) => (i === index ? lamp : old));
    this.change();
  }

  /** All that there is, anew; hidden where there is no such scene. */
  show(): void {
    const scene = this.scene();
    get('lamps').hidden = !scene;
    if (!scene) return;
    for (const add of get('add-lamps').querySelectorAll('button'))
      add.disabled = scene.movingLamps.length >= limits.lamps;
    get('lamp-list').replaceChildren(
      ...scene.movingLamps.map((lamp, i) => this.lampBox(scene, lamp, i)),
      ...[...scene.ownLamps].map(([name, scale]) => this.ownBox(scene, name, scale)),
    );
    get('paint-list').replaceChildren(
      ...[...scene.materials].map(([name, color]) => this.paintRow(scene, name, color)),
    );
  }

  /** Of a lamp that a hand has dragged, its numbers. */
  follow(index: number, lamp: Lamp): void {
    const box = get('lamp-list').children[index];
    lamp.numbers.forEach((n, i) => {
      const range = box?.querySelector<HTMLInputElement>(`[data-number="${i}"] input`);
      if (!range) return;
      range.value = String(n);
      range.parentElement!.querySelector('output')!.textContent = say(n);
    });
  }

  private lampBox(scene: IndirectControls, given: Lamp, index: number): HTMLElement {
    const name = `Lamp ${index + 1}, ${kindNames[given.kind].toLowerCase()}`,
      now = (): Lamp => this.scene()?.movingLamps[index] ?? given,
      box = document.createElement('details'),
      summary = document.createElement('summary'),
      rows = document.createElement('div');
    box.append(summary, rows);
    box.open = this.open.has(index);
    box.addEventListener('toggle', () => (box.open ? this.open.add(index) : this.open.delete(index)));
    summary.textContent = name;
    const on = document.createElement('input');
    Object.assign(on, { type: 'checkbox', checked: !given.off });
    on.addEventListener('change', () => {
      this.set(index, { ...now(), off: !on.checked });
    });
    const { center, radius } = scene.bounds,
      middle = [center.x, center.y, center.z];
    const rangeOf = (text: string, value: number): readonly [number, number] => {
      const axis = ['X', 'Y', 'Z'].indexOf(text.at(-1)!);
      if (axis >= 0) return [Math.min(middle[axis]! - radius, value), Math.max(middle[axis]! + radius, value)];
      if (text === 'radius') return [Math.min(0.002 * radius, value), Math.max(0.3 * radius, value)];
      return text === 'angle'
        ? [1, 90]
        : text === 'azimuth'
          ? [Math.min(-180, value), Math.max(180, value)]
          : [-90, 90];
    };
    rows.append(row('On', on));
    lampNumbers[given.kind].forEach((text, i) => {
      const label = slider(text, rangeOf(text, given.numbers[i]!), given.numbers[i]!, say, (value) => {
        const lamp = now();
        this.set(index, { ...lamp, numbers: lamp.numbers.map((n, k) => (k === i ? value : n)) });
      });
      label.dataset['number'] = String(i);
      rows.append(label);
    });
    rows.append(
      ...lightRows(
        given.color,
        () => now().color,
        (color) => this.set(index, { ...now(), color }),
      ),
      button('Remove', () => this.remove(index), `Remove ${name.toLowerCase()}`),
    );
    return box;
  }

  private remove(index: number): void {
    const scene = this.scene();
    if (!scene) return;
    this.open.clear();
    scene.movingLamps = scene.movingLamps.filter((_, i) => i !== index);
    this.show();
    this.change();
    get('add-lamps').querySelector('button')?.focus();
  }

  private ownBox(scene: IndirectControls, name: string, scale: Rgb): HTMLElement {
    const box = document.createElement('details'),
      summary = document.createElement('summary'),
      rows = document.createElement('div'),
      on = document.createElement('input');
    box.append(summary, rows);
    let lit: Rgb = Math.max(...scale) > 0 ? scale : [1, 1, 1];
    const set = (to: Rgb): void => (scene.scaleOwn(name, to), this.change());
    summary.textContent = `The scene's own: ${name || 'without a name'}`;
    Object.assign(on, { type: 'checkbox', checked: Math.max(...scale) > 0 });
    on.addEventListener('change', () => set(on.checked ? lit : [0, 0, 0]));
    rows.append(
      row('On', on),
      ...lightRows(
        lit,
        () => lit,
        (color) => {
          lit = color;
          if (on.checked) set(color);
        },
      ),
    );
    return box;
  }

  private paintRow(scene: IndirectControls, name: string, own: Rgb): HTMLElement {
    const group = document.createElement('p'),
      shown = name || 'without a name',
      back = button('As it was', () => paint(undefined), `${shown} as it was`);
    const picker = colour(shown, scene.painted.get(name) ?? own, (color) => paint(color));
    const paint = (color: Rgb | undefined): void => {
      scene.paint(name, color);
      back.hidden = !color;
      if (!color) {
        picker.querySelector('input')!.value = hexOf(own);
        picker.querySelector('input')!.focus();
      }
      this.change();
    };
    back.hidden = !scene.painted.has(name);
    group.append(picker, back);
    return group;
  }
}

/** Colour and brightness: the colour is of the brightest channel 1. */
function lightRows(given: Rgb, now: () => Rgb, change: (color: Rgb) => void): HTMLElement[] {
  const most = (color: Rgb): number => Math.max(...color, 1e-12),
    tint = (color: Rgb): Rgb => color.map((c) => c / most(color)) as Rgb,
    stops = Math.log10(most(given));
  const scaled = (color: Rgb, to: number): Rgb => color.map((c) => Number((c * to).toPrecision(6))) as Rgb;
  return [
    colour('Colour', tint(given), (color) => change(scaled(tint(color), most(now())))),
    slider(
      'Brightness',
      [stops - 2, stops + 2],
      stops,
      (value) => say(10 ** value),
      (value) => change(scaled(tint(now()), 10 ** value)),
    ),
  ];
}
