// Lamps under the hand: a button over each in the picture. Dragged it goes over the level plane that it lies in, with
// Shift up and down; arrow keys, Page Up and Page Down do the same. A spot has another one, where it shines.
import { Plane, Raycaster, Vector2, Vector3, type PerspectiveCamera } from 'three';
import type { Lamp } from '../src/index.js';
import { get } from './dom.js';

const keyStep = 0.02, // of the scene's radius
  levelEnough = 0.08; // how steeply a ray must meet the plane; else the lamp goes over one that faces the eye

export interface HandleOwner {
  readonly camera: PerspectiveCamera;
  lamps(): readonly Lamp[];
  /** Of the scene. */
  radius(): number;
  move(index: number, lamp: Lamp): void;
}

interface Handle {
  button: HTMLButtonElement;
  lamp: number;
  first: 0 | 3; // of the place's numbers
}

export class LampHandles {
  private handles: Handle[] = [];
  private grip: { handle: Handle; offset: Vector2 } | undefined;

  constructor(
    private readonly owner: HandleOwner,
    private readonly box: HTMLElement = get('handles'),
  ) {}

  /** Buttons for the lamps that there are; kept, as far as they are the same. */
  show(): void {
    const wanted = this.owner.lamps().flatMap(({ kind }, lamp) =>
      kind === 'sun'
        ? []
        : kind === 'spot'
          ? [
              { lamp, first: 0 as const },
              { lamp, first: 3 as const },
            ]
          : [{ lamp, first: 0 as const }],
    );
    while (this.handles.length > wanted.length) this.handles.pop()!.button.remove();
    wanted.forEach(({ lamp, first }, i) => {
      const handle = (this.handles[i] ??= this.make());
      Object.assign(handle, { lamp, first });
      const { kind, off } = this.owner.lamps()[lamp]!;
      handle.button.textContent = String(lamp + 1);
      handle.button.classList.toggle('target', first === 3);
      handle.button.classList.toggle('off', off ?? false);
      handle.button.setAttribute(
        'aria-label',
        `Lamp ${lamp + 1}, ${kind}${first === 3 ? ': where it shines' : ''}. Drag, or use the arrow keys, over the ` +
          'level; with Shift, or by Page Up and Page Down, up and down',
      );
    });
    this.place();
  }

  /** Where the camera sees the lamps. */
  place(): void {
    const { camera } = this.owner,
      { clientWidth, clientHeight } = this.box;
    for (const { button, lamp, first } of this.handles) {
      const given = this.owner.lamps()[lamp];
      if (!given) continue;
      const at = new Vector3().fromArray(given.numbers, first).project(camera);
      const isSeen = at.z < 1 && at.z > -1 && Math.abs(at.x) <= 1 && Math.abs(at.y) <= 1;
      button.hidden = !isSeen;
      button.style.left = `${((at.x + 1) / 2) * clientWidth}px`;
      button.style.top = `${((1 - at.y) / 2) * clientHeight}px`;
    }
  }

  private make(): Handle {
    const button = document.createElement('button');
    button.type = 'button';
    const handle: Handle = { button, lamp: 0, first: 0 };
    button.addEventListener('pointerdown', (e) => {
      if (e.button !== 0) return;
      const { left, top, width, height } = button.getBoundingClientRect();
      button.setPointerCapture(e.pointerId);
      this.grip = { handle, offset: new Vector2(e.clientX - left - width / 2, e.clientY - top - height / 2) };
    });
    button.addEventListener('pointermove', (e) => {
      if (this.grip?.handle === handle) this.drag(e.clientX, e.clientY, e.shiftKey);
    });
    for (const end of ['pointerup', 'pointercancel'] as const)
      button.addEventListener(end, () => (this.grip = undefined));
    button.addEventListener('keydown', (e) => this.onKey(handle, e));
    this.box.append(button);
    return handle;
  }

  private drag(x: number, y: number, upright: boolean): void {
    const { handle, offset } = this.grip!,
      { camera } = this.owner,
      lamp = this.owner.lamps()[handle.lamp],
      { left, top, width, height } = this.box.getBoundingClientRect();
    if (!lamp) return;
    const from = new Vector3().fromArray(lamp.numbers, handle.first),
      ray = new Raycaster(),
      to = new Vector3();
    ray.setFromCamera(
      new Vector2((2 * (x - offset.x - left)) / width - 1, 1 - (2 * (y - offset.y - top)) / height),
      camera,
    );
    const up = new Vector3(0, 1, 0),
      facing = camera.getWorldDirection(new Vector3());
    const isLevel = !upright && Math.abs(ray.ray.direction.y) > levelEnough;
    const plane = new Plane().setFromNormalAndCoplanarPoint(
      isLevel ? up : upright ? facing.setY(0).normalize() : facing,
      from,
    );
    if (!ray.ray.intersectPlane(plane, to)) return;
    if (upright) to.set(from.x, to.y, from.z);
    else if (!isLevel) to.setY(from.y);
    // Not over the horizon, where a hand's breadth is the world.
    if (to.distanceTo(from) > 4 * this.owner.radius()) return;
    this.moveTo(handle, lamp, to);
  }

  private onKey(handle: Handle, e: KeyboardEvent): void {
    const lamp = this.owner.lamps()[handle.lamp];
    if (!lamp) return;
    const right = new Vector3().setFromMatrixColumn(this.owner.camera.matrixWorld, 0).setY(0).normalize(),
      ahead = new Vector3(0, 1, 0).cross(right),
      up = new Vector3(0, 1, 0);
    const ways: Record<string, Vector3> = {
      ArrowLeft: right.clone().negate(),
      ArrowRight: right,
      ArrowUp: e.shiftKey ? up : ahead,
      ArrowDown: e.shiftKey ? up.clone().negate() : ahead.clone().negate(),
      PageUp: up,
      PageDown: up.clone().negate(),
    };
    const way = ways[e.key];
    if (!way) return;
    e.preventDefault();
    const from = new Vector3().fromArray(lamp.numbers, handle.first);
    this.moveTo(handle, lamp, from.addScaledVector(way, keyStep * this.owner.radius()));
  }

  /** A lamp takes what it shines at with it. */
  private moveTo({ lamp: index, first }: Handle, lamp: Lamp, to: Vector3): void {
    const numbers = [...lamp.numbers],
      short = (x: number): number => Number(x.toPrecision(6));
    to.toArray().forEach((v, k) => {
      if (first === 0 && lamp.kind === 'spot') numbers[3 + k] = short(numbers[3 + k]! + v - numbers[k]!);
      numbers[first + k] = short(v);
    });
    if (lamp.kind === 'spot' && [0, 1, 2].every((k) => numbers[k] === numbers[3 + k])) return;
    this.owner.move(index, { ...lamp, numbers });
  }
}
