// What a hand carries in the picture: a button over each. Dragged it goes over the level plane that it lies in, with
// Shift up and down; arrow keys, Page Up and Page Down do the same.
import { Plane, Raycaster, Vector2, Vector3, type PerspectiveCamera } from 'three';
import { get } from './dom.js';

const keyStep = 0.02, // of the scene's radius
  levelEnough = 0.08; // how steeply a ray must meet the plane; else it goes over one that faces the eye

/** One that there is to be. */
export interface Wanted {
  /** What stands on it, and what it is called; how it is carried is added. */
  text: string;
  name: string;
  /** Classes of its looks that it has or has not. */
  looks?: Record<string, boolean>;
  /** Where it is now; undefined once it is gone. */
  at: () => Vector3 | undefined;
  move: (to: Vector3) => void;
}
export interface HandleOwner {
  readonly camera: PerspectiveCamera;
  wanted(): Wanted[];
  /** Of the scene. */
  radius(): number;
}

interface Handle {
  button: HTMLButtonElement;
  wanted: Wanted;
}

export class Handles {
  private handles: Handle[] = [];
  private grip: { handle: Handle; offset: Vector2 } | undefined;

  constructor(
    private readonly owner: HandleOwner,
    private readonly box: HTMLElement = get('handles'),
  ) {}

  /** Buttons for what there is; kept, as far as they are the same. */
  show(): void {
    const wanted = this.owner.wanted();
    while (this.handles.length > wanted.length) this.handles.pop()!.button.remove();
    wanted.forEach((one, i) => {
      const handle = (this.handles[i] ??= this.make(one));
      handle.wanted = one;
      handle.button.textContent = one.text;
      for (const [look, has] of Object.entries(one.looks ?? {})) handle.button.classList.toggle(look, has);
      handle.button.setAttribute(
        'aria-label',
        `${one.name}. Drag, or use the arrow keys, over the level; ` +
          'with Shift, or by Page Up and Page Down, up and down',
      );
    });
    this.place();
  }

  /** Where the camera sees them. */
  place(): void {
    const { camera } = this.owner,
      { clientWidth, clientHeight } = this.box;
    for (const { button, wanted } of this.handles) {
      const at = wanted.at()?.clone().project(camera);
      button.hidden = !at || Math.abs(at.z) >= 1 || Math.abs(at.x) > 1 || Math.abs(at.y) > 1;
      if (!at) continue;
      button.style.left = `${((at.x + 1) / 2) * clientWidth}px`;
      button.style.top = `${((1 - at.y) / 2) * clientHeight}px`;
    }
  }

  private make(wanted: Wanted): Handle {
    const button = document.createElement('button');
    button.type = 'button';
    const handle: Handle = { button, wanted };
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
      { left, top, width, height } = this.box.getBoundingClientRect();
    const from = handle.wanted.at(),
      ray = new Raycaster(),
      to = new Vector3();
    if (!from) return;
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
    handle.wanted.move(to);
  }

  private onKey({ wanted }: Handle, e: KeyboardEvent): void {
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
    const way = ways[e.key],
      at = wanted.at();
    if (!way || !at) return;
    e.preventDefault();
    wanted.move(at.clone().addScaledVector(way, keyStep * this.owner.radius()));
  }
}
