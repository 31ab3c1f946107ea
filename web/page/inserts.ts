// Objects that are put into a scene with a lattice by hand: where they stand, and the text of the address. Their list
// and handles are insert_controls.ts.
import {
  Box3,
  Group,
  MathUtils,
  Mesh,
  MeshBasicMaterial,
  Raycaster,
  Sphere,
  SphereGeometry,
  Vector3,
  type Object3D,
} from 'three';
import type { GLTF } from 'three/addons/loaders/GLTFLoader.js';
import { bakedScene, Insert, LambentError, limits, type BakedTransfer, type Lattice } from '../src/index.js';
import type { Companion } from './companions.js';
import type { View } from './state.js';

/** What may be placed, as often as one likes. */
export interface Source {
  /** In the address; of a file that was opened, which no address has, its name. */
  name: string;
  isServed: boolean;
  root: Object3D;
  transfer?: BakedTransfer | undefined;
}
export interface Placed {
  readonly source: Source;
  readonly insert: Insert;
  readonly foot: Vector3;
  scale: number;
}

export const ballName = 'ball';
/** Of diameter 1. */
export function ballSource(): Source {
  const ball = new Mesh(new SphereGeometry(0.5, 48, 24), new MeshBasicMaterial({ name: ballName }));
  ball.material.color.setScalar(0.8);
  return { name: ballName, isServed: true, root: ball };
}
export const sourceOf = (name: string, gltf: GLTF, isServed: boolean): Source => ({
  name,
  isServed,
  root: gltf.scene,
  transfer: bakedScene(gltf)?.transfer,
});

const short = (x: number): number => Number(x.toPrecision(6));

/** NAME@X,Y,Z[,SCALE], as `--insert`. */
export const formatInsert = ({ source, foot, scale }: Placed): string =>
  `${source.name}@${[...foot.toArray(), ...(scale === 1 ? [] : [scale])].map(short).join(',')}`;

/** Throws LambentError where the text is none of an object. */
export function parseInsert(text: string): { name: string; foot: Vector3; scale: number } {
  const at = text.lastIndexOf('@'),
    numbers = text
      .slice(at + 1)
      .split(',')
      .map((n) => (n.trim() === '' ? NaN : Number(n))),
    [x, y, z, scale = 1] = numbers as [number, number, number, number?];
  const isRight = at > 0 && [3, 4].includes(numbers.length) && numbers.every((n) => Math.abs(n) <= 1e9) && scale > 0;
  if (!isRight) throw new LambentError(`"${text}" is no object in a place: NAME@X,Y,Z or NAME@X,Y,Z,SCALE is wanted`);
  return { name: text.slice(0, at), foot: new Vector3(x, y, z), scale };
}

/** Those of one scene. */
export class Inserts implements Companion {
  readonly root = new Group();
  readonly isLit = true;
  readonly placed: Placed[] = [];
  lattice: Lattice | undefined;

  isShownIn(view: View): boolean {
    return view === 'baked' || view === 'relief';
  }
  relight(): void {
    for (const { insert } of this.placed) insert.relight();
  }
  meshes(): Mesh[] {
    return this.placed.flatMap(({ insert }) => insert.meshes);
  }
  reach(from: Vector3): number {
    const far = this.placed.map(({ insert, foot, scale }) => foot.distanceTo(from) + scale * insert.size.length());
    return Math.max(0, ...far);
  }

  /** Takes the place of what there was: none stand in it yet. */
  enter(lattice: Lattice | undefined): void {
    for (const { insert } of this.placed) insert.dispose();
    this.placed.length = 0;
    this.lattice = lattice;
  }

  /** Throws LambentError where the object cannot be placed, or there are as many as there may be. */
  add(source: Source, foot: Vector3, scale: number | ((insert: Insert) => number)): Placed {
    if (this.placed.length >= limits.inserts)
      throw new LambentError(`is one too many: ${limits.inserts} objects stand in the scene already`);
    const insert = new Insert(source.root, this.lattice!, source.transfer);
    const placed = { source, insert, foot: foot.clone(), scale: typeof scale === 'number' ? scale : scale(insert) };
    this.placed.push(placed);
    this.root.add(insert.root);
    this.put(placed);
    return placed;
  }
  /** Where its foot and scale now say. */
  put({ insert, foot, scale }: Placed): void {
    insert.place(foot, scale);
    insert.relight();
  }
  remove(placed: Placed): void {
    placed.insert.dispose();
    this.placed.splice(this.placed.indexOf(placed), 1);
  }
}

/** Whether the lattice lies where the scene is drawn: one far from the origin is moved there by its nodes. */
export function isAround({ header: { min, max } }: Lattice, bounds: Sphere): boolean {
  return new Box3(new Vector3().fromArray(min), new Vector3().fromArray(max)).intersectsSphere(bounds);
}

/** A place to begin with: on what lies under the place that the camera looks at, as far as the lattice reaches. */
export function firstPlace({ header: { min, max } }: Lattice, meshes: readonly Mesh[], target: Vector3): Vector3 {
  const from = target.clone().clamp(new Vector3().fromArray(min), new Vector3().fromArray(max)),
    down = new Raycaster(from, new Vector3(0, -1, 0));
  const hit = down.intersectObjects(
    meshes.filter((mesh) => mesh.visible),
    false,
  )[0];
  return from.setY(hit?.point.y ?? min[1]!);
}

/** 1, unless that is far too large or too small for the scene. */
export function firstScale({ size }: Insert, radius: number): number {
  const share = size.length() / (2 * radius);
  return share > 0.03 && share < 0.25 ? 1 : Number(MathUtils.clamp(0.15 / share, 1e-6, 1e6).toPrecision(2));
}
