// Nodes that were turned since the bake: transfer is in the axes of the scene as it was baked, so that such a mesh
// takes the light as it stands in its own. It has a sum of its own, of all receivers of the file.
import {
  Matrix3,
  Matrix4,
  type BufferGeometry,
  type Mesh,
  type Object3D,
  type Texture,
  type WebGLRenderer,
} from 'three';
import { InstancedLights, isInstanced, refuseInstances } from './instanced.js';
import { orthogonalPart } from './lobes.js';
import { makeShRotation, rotateSh } from './sh_rotation.js';
import { shCount } from './sh.js';

/** How meshes stood when they were baked: as they do on loading. Skins are not known. */
export class RestPose {
  private readonly inverse = new WeakMap<BufferGeometry, Matrix3>();
  private readonly whole = new WeakMap<BufferGeometry, Matrix4>();
  private readonly linear = new Matrix3();

  /** `followsInstances`: of an InstancedMesh each, by who uses this. */
  constructor(
    meshes: readonly Mesh[],
    private readonly followsInstances = false,
  ) {
    for (const mesh of meshes) {
      if ('isSkinnedMesh' in mesh) continue;
      mesh.updateWorldMatrix(true, false);
      const rest = new Matrix3().setFromMatrix4(mesh.matrixWorld);
      if (rest.determinant() === 0) continue;
      this.inverse.set(mesh.geometry, rest.invert());
      this.whole.set(mesh.geometry, mesh.matrixWorld.clone());
    }
  }

  inverseOf(object: Object3D): Matrix3 | undefined {
    return this.inverse.get((object as Mesh).geometry);
  }

  /** The turn of a mesh, or of a clone of it, since then; undefined where there is none. */
  turnOf(object: Object3D): Matrix3 | undefined {
    const rest = this.inverseOf(object);
    if (!rest) return undefined;
    if (!this.followsInstances && isInstanced(object)) refuseInstances(object, rest);
    const turn = orthogonalPart(this.linear.setFromMatrix4(object.matrixWorld).multiply(rest));
    const isTurned = turn.elements.some((v, i) => Math.abs(v - (i % 4 === 0 ? 1 : 0)) > 1e-5);
    return isTurned ? turn : undefined;
  }

  /** From the world as it is now to where a mesh, or a clone of it, was baked; undefined where it stands there. */
  placeOf(object: Object3D): Matrix4 | undefined {
    const rest = this.whole.get((object as Mesh).geometry);
    if (!rest || object.matrixWorld.equals(rest)) return undefined;
    return object.matrixWorld.clone().invert().premultiply(rest);
  }
}

interface Group<E> {
  how: readonly number[];
  made: E;
  meshes: number;
}

/** Something for meshes that stand alike: once for all that were turned or moved as one. */
export class Alike<E> {
  private readonly groups: Group<E>[] = [];
  private readonly of = new WeakMap<Object3D, Group<E>>();

  constructor(private readonly make: () => E) {}

  /** That of a mesh which stands as these numbers say; `how` is another array where they are not as they were. */
  get(object: Object3D, how: readonly number[]): Readonly<Group<E>> {
    const own = this.of.get(object),
      isAlike = (group: Group<E>): boolean =>
        group.how.length === how.length && group.how.every((v, i) => Math.abs(v - how[i]!) < 1e-6);
    if (own && isAlike(own)) return own;
    if (own) --own.meshes;
    let group = this.groups.find((g) => g.meshes > 0 && isAlike(g));
    if (!group) {
      group = this.groups.find((g) => g.meshes === 0);
      if (!group) this.groups.push((group = { how, made: this.make(), meshes: 0 }));
      group.how = how;
    }
    ++group.meshes;
    this.of.set(object, group);
    return group;
  }

  get all(): E[] {
    return this.groups.map(({ made }) => made);
  }
  clear(): void {
    this.groups.length = 0;
  }
}

/** [column][3] of light, and of its peaks where those count apart. */
export interface TurnableLight {
  rest: ArrayLike<number>;
  peaks: ArrayLike<number> | undefined;
  /** In axes that were turned so; harmonics are turned as they are, lamps stay. */
  turned?: ((turn: Matrix3) => Omit<TurnableLight, 'turned'>) | undefined;
}

/** A light in the axes of what was turned. */
export const lightIn = (turn: Matrix3, light: TurnableLight, order: number): Omit<TurnableLight, 'turned'> =>
  light.turned?.(turn) ?? {
    rest: lightFor(turn, light.rest, order),
    peaks: light.peaks && lightFor(turn, light.peaks, order),
  };

/** [column][3]: harmonics of the world, as many as there are, in the axes of what was turned; lamps stay. */
export function lightFor(turn: Matrix3, light: ArrayLike<number>, order: number): Float64Array {
  const out = Float64Array.from(light);
  // Column-major, so that these are the rows of its inverse.
  if (order > 0)
    rotateSh(makeShRotation(order, turn.elements), Float64Array.from(light).subarray(0, 3 * shCount(order)), out);
  return out;
}

export interface Sums {
  /** [column][3] of light, and of its peaks where those count apart. */
  set(light: ArrayLike<number>, peaks: ArrayLike<number> | undefined): void;
  update(renderer: WebGLRenderer): void;
  readonly pictures: { rest: Texture; peaks: Texture };
  readonly hasPeaks: boolean;
  dispose(): void;
}

const upright = new Matrix3();

/** Sums of a light, and of the same light for each mesh that was turned. */
export class TurnedSums<S extends Sums> {
  readonly main: S;
  /** For shaders: what is drawn next. */
  readonly rest: { value: Texture };
  readonly peaks: { value: Texture };
  /** From the world into the axes that were baked. */
  readonly turnBack = { value: new Matrix3() };
  /** Of what follows each instance of an InstancedMesh. */
  readonly instances: InstancedLights | undefined;
  private light: TurnableLight | undefined;
  private readonly turned: Alike<{ sums: S; how: readonly number[]; of: TurnableLight | undefined }>;

  /** `order` of the light's harmonics; `quads` of it a channel, where shaders sum up for each instance. */
  constructor(
    make: () => S,
    private readonly order: number,
    private readonly pose?: RestPose,
    quads = 0,
  ) {
    this.main = make();
    if (quads > 0) this.instances = new InstancedLights(order, quads, pose);
    this.turned = new Alike(() => ({ sums: make(), how: [], of: undefined }));
    this.rest = { value: this.main.pictures.rest };
    this.peaks = { value: this.main.pictures.peaks };
  }

  get hasPeaks(): boolean {
    return this.main.hasPeaks;
  }

  set(rest: ArrayLike<number>, peaks: ArrayLike<number> | undefined, turned?: TurnableLight['turned']): void {
    this.light = { rest, peaks, turned };
    this.main.set(rest, peaks);
    this.instances?.set(rest, peaks, turned);
  }

  /** Before `object` is drawn. */
  update(renderer: WebGLRenderer, object: Object3D): void {
    if (this.instances && isInstanced(object)) {
      this.instances.instances.value = this.instances.of(object);
      renderer.state.useProgram(null!);
      return;
    }
    const turn = this.pose?.turnOf(object),
      sums = turn ? this.sumsFor(object, turn) : this.main;
    sums.update(renderer);
    const { rest, peaks } = sums.pictures,
      back = turn ? turn.clone().transpose() : upright;
    if (this.rest.value === rest && this.peaks.value === peaks && this.turnBack.value.equals(back)) return;
    this.rest.value = rest;
    this.peaks.value = peaks;
    this.turnBack.value = back;
    renderer.state.useProgram(null!); // else meshes of one material, one after another, keep the first one's values
  }

  private sumsFor(object: Object3D, turn: Matrix3): S {
    const { light, order } = this,
      { how, made } = this.turned.get(object, turn.elements);
    if (light && (made.of !== light || made.how !== how)) {
      const { rest, peaks } = lightIn(turn, light, order);
      made.sums.set(rest, peaks);
      made.how = how;
      made.of = light;
    }
    return made.sums;
  }

  dispose(): void {
    this.main.dispose();
    this.instances?.dispose();
    for (const { sums } of this.turned.all) sums.dispose();
    this.turned.clear();
  }
}
