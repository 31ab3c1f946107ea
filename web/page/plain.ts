// Light of three.js's own for a scene without transfer.
import { EquirectangularReflectionMapping, type DataTexture, type Quaternion, type Scene } from 'three';

export function lightPlain(scene: Scene, background: DataTexture, turn: Quaternion): void {
  if (scene.environment?.source !== background.source) {
    scene.environment?.dispose();
    scene.environment = background.clone(); // with the first row at the top, as three.js has environments
    scene.environment.mapping = EquirectangularReflectionMapping;
    scene.environment.flipY = true;
    scene.environment.needsUpdate = true;
  }
  scene.environmentRotation.setFromQuaternion(turn);
}
