// The camera that shows all of a scene.
import { Vector3, type Mesh, type Object3D } from 'three';

const groundName = 'ground'; // of the floor that `lambent bake --ground` adds
/** Of the camera, in degrees. */
export const framedFov = 35;

function isGround(object: Object3D): boolean {
  for (let o: Object3D | null = object; o; o = o.parent) if (o.name === groundName) return true;
  return false;
}

/**
 * From the front right and a little above, all of it just in view: the camera of `lambent render --camera auto`
 * (camera_around of core/camera.h), in a picture so many times as wide as high. Undefined where there is nothing.
 */
export function framed(root: Object3D, aspect: number): { eye: Vector3; target: Vector3 } | undefined {
  root.updateMatrixWorld(true);
  const meshes: Mesh[] = [];
  root.traverse((o) => void ((o as Mesh).isMesh && meshes.push(o as Mesh)));
  const subject = meshes.filter((mesh) => !isGround(mesh));
  const forward = new Vector3(-0.55, -0.4, -1).normalize(),
    side = new Vector3().crossVectors(forward, new Vector3(0, 1, 0)).normalize(),
    up = new Vector3().crossVectors(side, forward);
  const margin = 0.02,
    tanY = Math.tan((framedFov * Math.PI) / 360) * (1 - 2 * margin),
    tanX = tanY * aspect;
  // What bounds the points from the right, the left, above, below, before and behind, in the axes of the view.
  const most = new Array<number>(6).fill(-Infinity),
    point = new Vector3();
  for (const mesh of subject.length ? subject : meshes) {
    const { count } = mesh.geometry.getAttribute('position');
    for (let i = 0; i < count; ++i) {
      mesh.getVertexPosition(i, point).applyMatrix4(mesh.matrixWorld);
      const x = point.dot(side),
        y = point.dot(up),
        z = point.dot(forward);
      [x - tanX * z, -x - tanX * z, y - tanY * z, -y - tanY * z, -z, z].forEach((bound, k) => {
        if (bound > most[k]!) most[k] = bound;
      });
    }
  }
  const [right, left, top, bottom, near, far] = most as [number, number, number, number, number, number];
  if (!(near + far >= 0)) return undefined;
  const z = Math.min(-(right + left) / (2 * tanX), -(top + bottom) / (2 * tanY));
  const eye = new Vector3()
    .addScaledVector(side, (right - left) / 2)
    .addScaledVector(up, (top - bottom) / 2)
    .addScaledVector(forward, z);
  return { eye, target: eye.clone().addScaledVector(forward, (far - near) / 2 - z) };
}
