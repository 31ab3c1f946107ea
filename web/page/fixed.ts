// A fixed view: its picture fills the canvas's height or width, with the environment behind it and not beside it.
import { MathUtils, type PerspectiveCamera } from 'three';
import type { FixedView } from '../src/index.js';
import type { SkyMaterial } from './screen.js';

/** `camera` has the canvas's aspect ratio, and looks as that of the view does. */
export function fitFixed(view: FixedView | undefined, camera: PerspectiveCamera, { within }: SkyMaterial): void {
  within.value.set(1, 1);
  if (!view) return;
  const wider = camera.aspect / (view.width / view.height),
    half = Math.tan(MathUtils.degToRad(view.fov) / 2);
  camera.fov = 2 * MathUtils.radToDeg(Math.atan(half / Math.min(1, wider)));
  within.value.set(Math.min(1, 1 / wider), Math.min(1, wider));
}
