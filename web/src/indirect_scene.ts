// A baked scene's meshes as what rays meet, and its own lamps: glowing surfaces and punctual lights.
import {
  Color,
  Matrix3,
  Matrix4,
  Vector3,
  type Light,
  type Material,
  type Mesh,
  type MeshStandardMaterial,
  type Object3D,
} from 'three';
import { LambentError } from './errors.js';
import type { OwnLamp } from './indirect_light.js';
import { areaOf, type Glow } from './leaf_light.js';
import type { SceneTriangles } from './leaf_places.js';
import type { PlacedLamp, Rgb } from './moving_lamps.js';
import { transmissionOf } from './see_through.js';

export type OwnMaterial = Material & Partial<MeshStandardMaterial>;

/** Throws LambentError at surfaces that light passes, which rays of the page do not. */
export function checkSolid(materials: readonly OwnMaterial[]): void {
  for (const material of materials) {
    if (material.transparent || material.alphaTest > 0 || transmissionOf(material) > 0)
      throw new LambentError(
        'holds direct-to-indirect light of surfaces that are seen through, which this version does not draw; ' +
          '"lambent render" does',
      );
    if (material.emissiveMap && material.emissive?.getHex())
      throw new LambentError(
        'holds direct-to-indirect light of lamps that glow by a picture, which this version does not draw; ' +
          '"lambent render" does',
      );
  }
}

/** `names`: of the surfels' materials. */
export function sceneTriangles(
  meshes: readonly Mesh[],
  owns: readonly OwnMaterial[],
  names: readonly string[],
): SceneTriangles {
  const count = (mesh: Mesh): number => (mesh.geometry.index ?? mesh.geometry.getAttribute('position')).count;
  const n = meshes.reduce((sum, mesh) => sum + Math.floor(count(mesh) / 3), 0),
    out: SceneTriangles = {
      positions: new Float32Array(9 * n),
      normals: new Float32Array(9 * n),
      materials: new Int32Array(n),
    };
  const v = new Vector3();
  let at = 0;
  meshes.forEach((mesh, m) => {
    const { index } = mesh.geometry,
      vertices = mesh.geometry.getAttribute('position').count,
      given = mesh.geometry.getAttribute('normal'),
      positions = new Float32Array(3 * vertices),
      normals = new Float32Array(3 * vertices),
      turn = new Matrix3().getNormalMatrix(mesh.matrixWorld);
    for (let i = 0; i < vertices; ++i) {
      mesh
        .getVertexPosition(i, v)
        .applyMatrix4(mesh.matrixWorld)
        .toArray(positions, 3 * i);
      if (given && !('isSkinnedMesh' in mesh))
        v.fromBufferAttribute(given, i)
          .applyMatrix3(turn)
          .normalize()
          .toArray(normals, 3 * i);
    }
    const material = names.indexOf(owns[m]!.name);
    for (let t = 0; t < Math.floor(count(mesh) / 3); ++t, ++at) {
      out.materials[at] = material;
      for (let k = 0; k < 3; ++k) {
        const vertex = index ? index.getX(3 * t + k) : 3 * t + k;
        if (vertex >= vertices) throw new LambentError(`has a triangle of vertex ${vertex}, which does not exist`);
        out.positions.set(positions.subarray(3 * vertex, 3 * vertex + 3), 9 * at + 3 * k);
        out.normals.set(normals.subarray(3 * vertex, 3 * vertex + 3), 9 * at + 3 * k);
      }
    }
  });
  return out;
}

/** Surfaces that glow, by name. */
export function glowsOf(meshes: readonly Mesh[], owns: readonly OwnMaterial[], scene: SceneTriangles): Glow[] {
  const glows = new Map<string, { triangles: Glow['triangles']; radiance: number[] }>();
  let at = 0;
  meshes.forEach((mesh, m) => {
    const own = owns[m]!,
      count = Math.floor((mesh.geometry.index ?? mesh.geometry.getAttribute('position')).count / 3),
      color = own.emissive && new Color().copy(own.emissive).multiplyScalar(own.emissiveIntensity ?? 1);
    for (let t = 0; t < count; ++t, ++at) {
      const corners = scene.positions.subarray(9 * at, 9 * at + 9);
      if (!color || !(Math.max(color.r, color.g, color.b) > 0) || !(areaOf(corners) > 0)) continue;
      const name = own.name || 'material',
        glow = glows.get(name) ?? { triangles: [], radiance: [] };
      glows.set(name, glow);
      glow.triangles.push({ corners, twoSided: own.side === 2 });
      glow.radiance.push(color.r, color.g, color.b);
    }
  });
  return [...glows].map(([name, { triangles, radiance }]) => ({
    name,
    triangles,
    radiance: Float32Array.from(radiance),
  }));
}

/**
 * What Blender's exporter states lamps in, beside watts of surfaces that glow: divided by this they go together
 * (scene/lights.cpp). By the document's asset.generator.
 */
function lampUnits(generator: string, directional: boolean): number {
  if (!generator.startsWith('Khronos glTF Blender I/O')) return 1;
  const [a = 0, b = 0, c = 0] = (/v(\d+)\.(\d+)\.(\d+)/.exec(generator) ?? []).slice(1).map(Number),
    isStandard = 1e6 * a + 1e3 * b + c >= 3004040;
  return isStandard ? 683 : directional ? 1 : 4 * Math.PI;
}

/** Lights of a glTF, which are taken out of three's hands: they shine as ours do. */
export function ownLamps(root: Object3D, generator: string): OwnLamp[] {
  const lamps: OwnLamp[] = [];
  root.updateMatrixWorld(true);
  root.traverse((object) => {
    const light = object as Light & { angle?: number; penumbra?: number };
    if (!(light as Partial<Light>).isLight) return;
    const kind = 'isDirectionalLight' in light ? 'sun' : 'isSpotLight' in light ? 'spot' : 'point',
      angle = light.angle ?? 0,
      scale = light.intensity / lampUnits(generator, kind === 'sun');
    const placed: PlacedLamp = {
      kind,
      place: new Vector3().setFromMatrixPosition(light.matrixWorld).toArray(),
      direction: new Vector3(0, 0, -1)
        .applyMatrix4(new Matrix4().extractRotation(light.matrixWorld))
        .normalize()
        .toArray(),
      radius: 0,
      cosOuter: Math.cos(angle),
      cosInner: Math.cos(angle * (1 - (light.penumbra ?? 0))),
    };
    light.visible = false;
    if (scale > 0) lamps.push({ name: light.name, placed, color: light.color.toArray().map((c) => c * scale) as Rgb });
  });
  return lamps;
}
