// What stands beside a baked scene in its picture, hidden and shown by surfaces as all else: objects, the lattice's
// points, receivers.
import { Group, type Mesh, type Object3D, type Vector3 } from 'three';
import { anySeeThrough } from '../src/index.js';
import type { View } from './state.js';

export interface Companion {
  readonly root: Object3D;
  /** Light of the scene, which it is part of; else it is drawn over the scene, and counts for no exposure. */
  readonly isLit: boolean;
  isShownIn(view: View): boolean;
  /** The light is another one now. */
  relight(): void;
  /** How far from a place it reaches. */
  reach?(from: Vector3): number;
  meshes?(): Mesh[];
  /** Before each picture in which it is shown. */
  beforeDraw?(): void;
}

export class Companions {
  readonly root = new Group();
  private readonly all: Companion[] = [];

  add(companion: Companion): void {
    this.all.push(companion);
    this.root.add(companion.root);
  }
  relight(): void {
    for (const one of this.all) one.relight();
  }
  /** Shows what a view has; to measure the exposure, what is lit alone. */
  dress(view: View, isMeasure = false): void {
    for (const one of this.all) {
      one.root.visible = one.isShownIn(view) && (one.isLit || !isMeasure);
      if (one.root.visible) one.beforeDraw?.();
    }
  }
  reach(from: Vector3): number {
    return Math.max(0, ...this.all.map((one) => one.reach?.(from) ?? 0));
  }
  get isSeenThrough(): boolean {
    return this.all.some((one) => one.root.visible && anySeeThrough(one.meshes?.() ?? []));
  }
}
