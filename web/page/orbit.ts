// The hand: dragging orbits, Shift-dragging turns the light, the wheel or two fingers zoom and shift; arrow keys do the
// same.
import { MathUtils, PerspectiveCamera, Quaternion, Vector3 } from 'three';

const radiansAHeight = 2.6; // for a drag over the whole height of the picture
const keyStep = 0.06; // share of that height a key press counts as

export interface OrbitCallbacks {
  onCamera(): void;
  onLight(): void;
  /** The light's height is to follow the hand, up by so many degrees; false where it is turned instead. */
  onLift(degrees: number): boolean;
  /** First move of each sort, so that hints can go. */
  onUse(what: 'orbit' | 'light'): void;
}

export class Orbit {
  readonly target = new Vector3();
  /** Turns the light; the drag leads its front, what faces the camera, with the hand. */
  readonly light = new Quaternion();
  /** One finger, or the plain mouse, turns the light. */
  lightFirst = false;
  /** Sideways the light turns about the picture's own upright, and not about +Y. */
  free = false;
  /** The camera stays where it is: all that a hand does turns the light. */
  isFixed = false;
  /** Otherwise with Ctrl alone, as where two fingers part on a touch pad. */
  wheelZooms = true;
  private readonly pointers = new Map<number, { x: number; y: number }>();

  constructor(
    readonly camera: PerspectiveCamera,
    private readonly canvas: HTMLCanvasElement,
    private readonly callbacks: OrbitCallbacks,
  ) {
    canvas.addEventListener('pointerdown', (e) => this.onDown(e));
    canvas.addEventListener('pointermove', (e) => this.onMove(e));
    for (const end of ['pointerup', 'pointercancel'] as const)
      canvas.addEventListener(end, (e) => this.pointers.delete(e.pointerId));
    canvas.addEventListener(
      'wheel',
      (e) => {
        if (this.isFixed || (!this.wheelZooms && !e.ctrlKey)) return;
        e.preventDefault();
        this.zoom(Math.exp(MathUtils.clamp(e.deltaY, -120, 120) * 0.0015));
      },
      { passive: false },
    );
    canvas.addEventListener('contextmenu', (e) => e.preventDefault());
    canvas.addEventListener('keydown', (e) => this.onKey(e));
  }

  /** Looks from `eye` at `target`; +Y is up. */
  look(eye: Vector3, target: Vector3): void {
    this.target.copy(target);
    this.camera.position.copy(eye);
    this.camera.up.set(0, 1, 0);
    this.camera.lookAt(target);
    this.camera.updateMatrixWorld();
    this.callbacks.onCamera();
  }

  /** By shares of the picture's height, +x to the right, +y down. */
  turnCamera(x: number, y: number): void {
    const offset = this.camera.position.clone().sub(this.target),
      radius = offset.length();
    const polar = MathUtils.clamp(
      Math.acos(MathUtils.clamp(offset.y / radius, -1, 1)) - y * radiansAHeight,
      1e-3,
      Math.PI - 1e-3,
    );
    const azimuth = Math.atan2(offset.x, offset.z) - x * radiansAHeight;
    offset
      .set(Math.sin(polar) * Math.sin(azimuth), Math.cos(polar), Math.sin(polar) * Math.cos(azimuth))
      .multiplyScalar(radius);
    this.look(offset.add(this.target), this.target.clone());
  }

  /** Sideways about +Y, so that a sun keeps its height; up and down about the picture's own horizontal. */
  turnLight(x: number, y: number): void {
    const right = new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0),
      upright = new Vector3(0, 1, 0);
    if (this.free) upright.setFromMatrixColumn(this.camera.matrixWorld, 1);
    if (y !== 0 && this.callbacks.onLift(-MathUtils.radToDeg(y * radiansAHeight))) y = 0;
    const turn = new Quaternion().setFromAxisAngle(upright, x * radiansAHeight);
    turn.multiply(new Quaternion().setFromAxisAngle(right, y * radiansAHeight));
    this.light.premultiply(turn).normalize();
    this.callbacks.onLight();
  }

  zoom(factor: number): void {
    if (this.isFixed) return;
    const offset = this.camera.position.clone().sub(this.target);
    this.look(offset.multiplyScalar(MathUtils.clamp(factor, 0.2, 5)).add(this.target), this.target.clone());
  }

  shift(x: number, y: number): void {
    if (this.isFixed) return;
    const height = 2 * Math.tan(MathUtils.degToRad(this.camera.fov) / 2) * this.camera.position.distanceTo(this.target);
    const move = new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0).multiplyScalar(-x * height);
    move.addScaledVector(new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 1), y * height);
    this.look(this.camera.position.clone().add(move), this.target.clone().add(move));
  }

  private turn(x: number, y: number, asked: boolean): void {
    const light = asked || this.isFixed;
    this.callbacks.onUse(light ? 'light' : 'orbit');
    if (light) this.turnLight(x, y);
    else this.turnCamera(x, y);
  }

  private onDown(e: PointerEvent): void {
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(e.pointerId);
    this.pointers.set(e.pointerId, { x: e.clientX, y: e.clientY });
  }

  private onMove(e: PointerEvent): void {
    const before = this.pointers.get(e.pointerId);
    if (!before) return;
    const height = this.canvas.clientHeight,
      x = (e.clientX - before.x) / height,
      y = (e.clientY - before.y) / height;
    const others = [...this.pointers].filter(([id]) => id !== e.pointerId).map(([, p]) => p);
    this.pointers.set(e.pointerId, { x: e.clientX, y: e.clientY });
    if (others.length > 0) {
      // Of two fingers one moves at a time: half the shift, and the change of their distance.
      const other = others[0]!,
        apart = (p: { x: number; y: number }): number => Math.hypot(p.x - other.x, p.y - other.y);
      this.shift(x / 2, y / 2);
      if (apart(before) > 10) this.zoom(apart(before) / Math.max(10, apart({ x: e.clientX, y: e.clientY })));
    } else if (e.buttons & 6 || e.ctrlKey) {
      this.shift(x, y);
    } else {
      this.turn(x, y, e.shiftKey !== this.lightFirst);
    }
  }

  private onKey(e: KeyboardEvent): void {
    const arrows: Record<string, [number, number]> = {
      ArrowLeft: [-1, 0],
      ArrowRight: [1, 0],
      ArrowUp: [0, -1],
      ArrowDown: [0, 1],
    };
    const arrow = arrows[e.key];
    if (arrow) this.turn(arrow[0] * keyStep, arrow[1] * keyStep, e.shiftKey !== this.lightFirst);
    else if (e.key === '+' || e.key === '=') this.zoom(0.9);
    else if (e.key === '-') this.zoom(1 / 0.9);
    else return;
    e.preventDefault();
  }
}
