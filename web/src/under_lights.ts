// Lights of the program on baked surfaces: what three's directional lights, points and spots send straight, with their
// shadow maps, beside what was baked. A sun whose shadows are to be sharp, or to fall from what the bake did not know,
// is left out of the baked light and is such a light.
import type { Material, Mesh } from 'three';
import { LambentError } from './errors.js';
import type { BakedTransfer } from './kinds.js';
import { normalsOf } from './own_normals.js';
import { nodeNames, setNodes, type MaterialNodes, type NodeEdition } from './node_edition.js';

/** What a material was drawn with before it took lights. */
const before = new WeakMap<object, MaterialNodes>();

/** three tells by these what it gives a material: those of a MeshBasicMaterial, or of a MeshLambertMaterial. */
interface Kind {
  type: string;
  isMeshBasicMaterial: boolean;
  isMeshLambertMaterial: boolean;
  flatShading: boolean;
}

function nodesOf(material: Material): MaterialNodes | undefined {
  const nodes: Record<string, unknown> = {};
  for (const name of nodeNames) {
    const property = Object.getOwnPropertyDescriptor(material, name);
    if (property?.get) return undefined; // it says why there are none
    if (property) nodes[name] = property.value;
  }
  return nodes;
}

function replaceNodes(material: Material, nodes: MaterialNodes): void {
  for (const name of nodeNames) Reflect.deleteProperty(material, name);
  setNodes(material, nodes, '');
}

/** Of a transfer that is diffuse: its meshes' materials take the program's lights, or no longer do. */
export function takeLights(transfer: BakedTransfer, edition: NodeEdition | undefined, on: boolean): void {
  if (!transfer.isDiffuse) {
    const why =
      transfer.kind === 'indirect' ? 'lit by lights already' : 'no diffuse transfer, beside which lights count';
    throw new LambentError(`is ${why}`);
  }
  for (const mesh of transfer.meshes) for (const material of [mesh.material].flat()) give(mesh, material, edition, on);
}

function give(mesh: Mesh, material: Material, edition: NodeEdition | undefined, on: boolean): void {
  const kind = material as Material & Kind;
  // Glass is drawn twice, and what it reflects of a light is no diffuse term.
  if (kind.isMeshLambertMaterial === on || material.userData['lambentGlass'] !== undefined) return;
  kind.type = on ? 'MeshLambertMaterial' : 'MeshBasicMaterial';
  kind.isMeshBasicMaterial = !on;
  kind.isMeshLambertMaterial = on;
  kind.flatShading = on && !mesh.geometry.hasAttribute('normal');
  const normals = normalsOf(material);
  if (normals) Object.assign(material, { ...normals, ...(!on && { normalMap: null }) });
  material.needsUpdate = true;
  const nodes = nodesOf(material);
  if (!edition || !nodes) return;
  if (on) {
    before.set(material, nodes);
    replaceNodes(material, edition.underLights(nodes));
  } else replaceNodes(material, before.get(material) ?? nodes);
}
