// Relief that the scene wears in the light of the open sky: a transfer texture (.lpt) that was opened; its controls.
import type { Material } from 'three';
import {
  diffuseParameters,
  LambentError,
  readTransferTexture,
  TransferTextureMaterial,
  type Lighting,
  type TransferTexture,
} from '../src/index.js';
import { get, input } from './dom.js';
import type { Viewer } from './viewer.js';

export class Relief {
  /** By mesh, as those of its own are. */
  readonly materials: TransferTextureMaterial[];
  private readonly made: TransferTextureMaterial[];

  constructor(
    readonly transfer: TransferTexture,
    own: readonly Material[],
  ) {
    const made = new Map(own.map((m) => [m, new TransferTextureMaterial(transfer, diffuseParameters(m))]));
    this.made = [...new Set(made.values())];
    this.materials = own.map((m) => made.get(m)!);
    for (const { tile } of this.made) tile.fromArray(this.hasGrooves ? [0, 12] : [4, 4]);
  }

  get hasGrooves(): boolean {
    return this.transfer.grooveDepth > 0;
  }
  /** What all of them are laid out by. */
  get shown(): TransferTextureMaterial {
    return this.made[0]!;
  }
  change(by: (material: TransferTextureMaterial) => void): void {
    this.made.forEach(by);
  }
  relight(lighting: Lighting): void {
    for (const material of this.made) material.relight(lighting);
  }
  dispose(): void {
    for (const material of this.made) material.dispose();
  }
}

/** The bytes of a .lpt file on the scene's surfaces. Throws LambentError where that cannot be. */
export function wearRelief(viewer: Viewer, bytes: ArrayBuffer): void {
  if (!viewer.baked) throw new LambentError('is relief for a scene: open one first');
  viewer.baked.setRelief(readTransferTexture(bytes));
  viewer.changeLight();
}

interface Slider {
  id: string;
  get: (of: TransferTextureMaterial) => number;
  set: (of: TransferTextureMaterial, value: number) => void;
}
const sliders: Slider[] = [
  { id: 'tile-u', get: (m) => m.tile.x, set: (m, value) => (m.tile.x = value) },
  { id: 'tile-v', get: (m) => m.tile.y, set: (m, value) => (m.tile.y = value) },
  { id: 'groove-depth', get: (m) => m.groove.depth, set: (m, value) => (m.groove.depth = value) },
  { id: 'groove-width', get: (m) => m.groove.width, set: (m, value) => (m.groove.width = value) },
];

/** The controls of a relief that is on show. */
export function showRelief(relief: Relief | undefined): void {
  get('relief').hidden = !relief;
  if (!relief) return;
  input('groove-depth').max = String(relief.transfer.grooveDepth);
  for (const { id, get: of } of sliders) {
    const value = of(relief.shown);
    input(id).value = String(value);
    get(`${id}-value`).textContent = String(Number(value.toPrecision(3)));
    input(id).closest('label')!.hidden = id.startsWith('groove') && !relief.hasGrooves;
  }
}

/** `change` after a hand has moved one. */
export function connectRelief(relief: () => Relief | undefined, change: () => void): void {
  for (const { id, set } of sliders)
    input(id).addEventListener('input', () => {
      relief()?.change((material) => set(material, Number(input(id).value)));
      change();
    });
}
