// Normal maps of the scene's own materials, which count for what lights of the program send (under_lights.ts).
import type { Material, MeshStandardMaterial } from 'three';

type Normals = Pick<MeshStandardMaterial, 'normalMap' | 'normalScale' | 'normalMapType'>;

const kept = new WeakMap<Material, Normals>();

/**
 * Keeps those of `from`, or what was kept of it, for `to`. `isRaw`: as the file has it, not as a mesh without tangents
 * wears it, where GLTFLoader turns bumps round since three finds tangents by derivatives.
 */
export function keepNormals(from: Material, to: Material, isRaw = false): void {
  const { normalMap, normalScale, normalMapType } = from as Material & Partial<Normals>,
    known = kept.get(from);
  if (known) kept.set(to, known);
  else if (normalMap && normalScale && normalMapType !== undefined)
    kept.set(to, {
      normalMap,
      normalScale: isRaw ? normalScale.clone().multiply({ x: 1, y: -1 }) : normalScale,
      normalMapType,
    });
}

export const normalsOf = (material: Material): Normals | undefined => kept.get(material);
