// Coloured glass for WebGPURenderer (see_through.ts): a draw that multiplies what is there, before the one that adds
// what the glass reflects, of the same mesh and the same sides.
import {
  MeshBasicNodeMaterial,
  Node,
  NodeUpdateType,
  type BufferGeometry,
  type Camera,
  type Material,
  type Mesh,
  type NodeFrame,
  type Object3D,
  type Scene,
} from 'three/webgpu';
import { diffuseColor, vec4 } from 'three/tsl';
import { filterBlending, filterParameters } from './see_through.js';

/** WebGPURenderer, as far as it is asked to draw. */
interface Drawer {
  lighting: { getNode(scene: Scene): object };
  renderObject(
    object: Object3D,
    scene: Scene,
    camera: Camera,
    geometry: BufferGeometry,
    material: Material,
    group: object | null,
    lightsNode: object,
    clipping: object | null,
    pass: string,
  ): void;
}

/** Those of a material, by which of its sides are drawn. */
const filters = new WeakMap<Material, Map<number, MeshBasicNodeMaterial>>();
function filterOf(material: Material): MeshBasicNodeMaterial | undefined {
  let ofSides = filters.get(material);
  if (!ofSides) {
    const made = new Map<number, MeshBasicNodeMaterial>();
    filters.set(material, (ofSides = made));
    material.addEventListener('dispose', () => made.forEach((filter) => filter.dispose()));
  }
  let filter = ofSides.get(material.side);
  if (filter) return filter;
  const found = filterParameters(material);
  if (!found) return undefined;
  filter = new MeshBasicNodeMaterial({ ...found.parameters, ...filterBlending, forceSinglePass: true });
  filter.allowOverride = false;
  const { rgb, a } = diffuseColor as unknown as Node<'vec4'>;
  filter.outputNode = vec4(a.oneMinus().add(a.mul(found.share).mul(rgb)), 1);
  ofSides.set(material.side, filter);
  return filter;
}

/** A colour, before which the filter is drawn. */
export class GlassNode extends Node {
  constructor(private readonly colour: Node) {
    super('vec4');
    this.updateBeforeType = NodeUpdateType.OBJECT;
  }

  override setup(): Node {
    return this.colour;
  }

  override updateBefore({ renderer, scene, camera, object, material }: NodeFrame): undefined {
    const filter = filterOf(material!),
      drawer = renderer as unknown as Drawer;
    if (!filter) return undefined;
    const { geometry } = object as Mesh;
    drawer.renderObject(
      object!,
      scene!,
      camera!,
      geometry,
      filter,
      null,
      drawer.lighting.getNode(scene!),
      null,
      'glass',
    );
    return undefined;
  }
}
