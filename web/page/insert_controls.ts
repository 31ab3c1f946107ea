// Objects under the hand: their list, their handles, files that are opened to be placed.
import { Vector3, type Sphere } from 'three';
import { checkBakedFile, LambentError, limits, NoTransferError, type Lattice } from '../src/index.js';
import { rewritten } from '../src/glb.js';
import { get, input, say as tell, sentence, showProblem } from './dom.js';
import { Handles, type Wanted } from './handles.js';
import { fetchWhole } from './incoming.js';
import {
  ballName,
  ballSource,
  firstPlace,
  firstScale,
  formatInsert,
  Inserts,
  isAround,
  parseInsert,
  sourceOf,
  type Placed,
  type Source,
} from './inserts.js';
import { readBaked, readPlain, type Beside, type Manifest } from './loading.js';
import { button, say, slider } from './rows.js';
import type { Viewer } from './viewer.js';

const unlit = 'cannot stand in this scene, which has no light in free space: bake it with --lattice';
const letter = (index: number): string => String.fromCharCode(65 + index);

export class InsertControls {
  private readonly inserts = new Inserts();
  private readonly sources = new Map<string, Source>([[ballName, ballSource()]]);
  private readonly handles: Handles;
  private readonly open = new Set<Placed>();

  /** `changed` is told the texts of all objects that an address can hold, whenever a hand has changed some. */
  constructor(
    private readonly viewer: Viewer,
    private readonly manifest: Manifest | undefined,
    private readonly changed: (to: string[]) => void,
  ) {
    viewer.companions.add(this.inserts);
    this.handles = new Handles({
      camera: viewer.camera,
      radius: () => viewer.bounds.radius,
      wanted: () => this.inserts.placed.map((placed, i) => this.handleOf(placed, i)),
    });
    const served = (manifest?.inserts ?? []).map(({ name }) => name);
    const files = input('object-file');
    get('add-objects').append(
      button('A ball', () => void this.attempt(ballName, () => this.addServed(ballName)), 'Add a ball'),
      ...served.map((name) => button(name, () => void this.attempt(name, () => this.addServed(name)), `Add ${name}`)),
      button('A file…', () => files.click(), 'Add a file'),
    );
    files.addEventListener('change', () => {
      const all = [...(files.files ?? [])],
        file = all.find(({ name }) => /\.gl(b|tf)$/i.test(name)) ?? all[0];
      files.value = '';
      if (file) void this.attempt(file.name, async () => this.addFile(file.name, await file.arrayBuffer(), all));
    });
  }

  /** Whether all that stands here is in the address. */
  get isWhole(): boolean {
    return this.inserts.placed.every(({ source }) => source.isServed);
  }

  /** Enters the scene that there is now. `texts`: what stands in it; undefined: what the server says. */
  async take(texts: readonly string[] | undefined): Promise<void> {
    const { bakedScene, bounds, fixedView } = this.viewer,
      lattice = bakedScene?.lattice;
    this.open.clear();
    this.inserts.enter(lattice && !fixedView && isAround(lattice, bounds) ? lattice : undefined);
    for (const text of texts ?? this.manifest?.insert ?? [])
      await this.attempt('', async () => {
        const { name, foot, scale } = parseInsert(text);
        if (!this.inserts.lattice) throw new LambentError(`${text} ${unlit}`);
        try {
          this.inserts.add(await this.served(name), foot, scale);
        } catch (error) {
          throw new LambentError(sentence(name, error));
        }
      });
    this.show();
  }
  /** A file that was opened, where it is a plain one and the scene lights it; false: it takes the scene's place. */
  async opened(name: string, bytes: ArrayBuffer, beside: Beside): Promise<boolean> {
    if (!this.inserts.lattice) return false;
    try {
      checkBakedFile(bytes);
      return false;
    } catch (error) {
      if (!(error instanceof NoTransferError) || error.message === rewritten) return false;
    }
    await this.addFile(name, bytes, beside);
    tell(`${name} stands in the scene, in the light of its lattice.`);
    return true;
  }

  private async served(name: string): Promise<Source> {
    const known = this.sources.get(name),
      file = this.manifest?.inserts?.find((one) => one.name === name)?.file;
    if (known) return known;
    if (file === undefined)
      throw new LambentError(`is no object that this page has: ${[ballName, ...this.servedNames].join(', ')}`);
    const bytes = await fetchWhole(name, file);
    get('loading').hidden = true;
    const source = sourceOf(name, await readBaked(bytes, file), true);
    this.sources.set(name, source);
    return source;
  }
  private get servedNames(): string[] {
    return (this.manifest?.inserts ?? []).map(({ name }) => name);
  }

  private async addServed(name: string): Promise<void> {
    this.addNew(await this.served(name));
  }
  private async addFile(name: string, bytes: ArrayBuffer, beside: Beside): Promise<void> {
    let isBaked = true;
    try {
      checkBakedFile(bytes);
    } catch (error) {
      if (!(error instanceof NoTransferError)) throw error;
      isBaked = false;
    }
    this.addNew(sourceOf(name, await (isBaked ? readBaked : readPlain)(bytes, beside), false));
  }
  private addNew(source: Source): void {
    const { viewer, inserts } = this,
      lattice = inserts.lattice as Lattice;
    const foot = firstPlace(lattice, viewer.bakedScene!.transfer.meshes, viewer.orbit.target);
    const placed = inserts.add(source, foot, (insert) => firstScale(insert, viewer.bounds.radius));
    this.open.clear();
    this.open.add(placed);
    this.change();
    this.show();
  }

  private async attempt(name: string, work: () => Promise<void>): Promise<void> {
    try {
      await work();
    } catch (error) {
      showProblem(sentence(name, error));
    }
  }

  private change(): void {
    this.viewer.invalidate();
    this.changed(this.inserts.placed.filter(({ source }) => source.isServed).map(formatInsert));
  }

  private handleOf(placed: Placed, index: number): Wanted {
    const { insert, foot, source } = placed,
      middle = (): Vector3 => new Vector3(0, (placed.scale * insert.size.y) / 2, 0);
    return {
      text: letter(index),
      name: `Object ${letter(index)}, ${source.name}`,
      looks: { object: true },
      at: () => (this.inserts.placed.includes(placed) ? foot.clone().add(middle()) : undefined),
      move: (to) => {
        foot.copy(to).sub(middle());
        this.put(placed);
        this.follow(placed);
      },
    };
  }
  private put(placed: Placed): void {
    placed.foot.fromArray(placed.foot.toArray().map((x) => Number(x.toPrecision(6))));
    this.inserts.put(placed);
    this.change();
  }

  /** All that there is, anew; hidden where nothing lights objects. */
  show(): void {
    const { placed, lattice } = this.inserts;
    get('objects').hidden = !lattice;
    for (const id of ['object-hint', 'object-keys', 'object-keys-what']) get(id).hidden = placed.length === 0;
    for (const add of get('add-objects').querySelectorAll('button')) add.disabled = placed.length >= limits.inserts;
    get('object-list').replaceChildren(...(lattice ? placed.map((one, i) => this.boxOf(one, i, lattice)) : []));
    this.handles.show();
  }
  place(): void {
    this.handles.place();
  }

  /** Of one that a hand has dragged, its numbers. */
  private follow(placed: Placed): void {
    const box = get('object-list').children[this.inserts.placed.indexOf(placed)];
    placed.foot.toArray().forEach((value, axis) => {
      const range = box?.querySelector<HTMLInputElement>(`[data-axis="${axis}"] input`);
      if (!range) return;
      range.value = String(value);
      range.parentElement!.querySelector('output')!.textContent = say(value);
    });
  }

  private boxOf(placed: Placed, index: number, { header: { min, max } }: Lattice): HTMLElement {
    const name = `Object ${letter(index)}, ${placed.source.name}`,
      box = document.createElement('details'),
      summary = document.createElement('summary'),
      rows = document.createElement('div'),
      { bounds } = this.viewer as { bounds: Sphere };
    box.append(summary, rows);
    box.open = this.open.has(placed);
    box.addEventListener('toggle', () => (box.open ? this.open.add(placed) : this.open.delete(placed)));
    summary.textContent = name;
    ['X', 'Y', 'Z'].forEach((text, axis) => {
      const now = placed.foot.getComponent(axis),
        middle = bounds.center.getComponent(axis),
        low = Math.min(min[axis]!, middle - bounds.radius, now),
        high = Math.max(max[axis]!, middle + bounds.radius, now);
      const label = slider(text, [low, high], now, say, (value) => {
        placed.foot.setComponent(axis, value);
        this.put(placed);
      });
      label.dataset['axis'] = String(axis);
      rows.append(label);
    });
    const size = Math.log10(placed.scale);
    rows.append(
      slider(
        'Scale',
        [size - 1, size + 1],
        size,
        (value) => say(10 ** value),
        (value) => {
          placed.scale = Number((10 ** value).toPrecision(4));
          this.put(placed);
        },
      ),
      button('Remove', () => this.remove(placed), `Remove ${name.toLowerCase()}`),
    );
    return box;
  }

  private remove(placed: Placed): void {
    this.open.delete(placed);
    this.inserts.remove(placed);
    this.change();
    this.show();
    get('add-objects').querySelector('button')?.focus();
  }
}
