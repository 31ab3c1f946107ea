// Colour nodes of a MeshBasicMaterial that is lit by what was baked, alone or beside the program's lights.
import { PhongLightingModel, type Node } from 'three/webgpu';
import { diffuseColor, luminance, materialColor, mix, select, uniform, vec3, vec4 } from 'three/tsl';
import type { MaterialNodes } from './node_edition.js';

/** What colours were made of. */
const radiances = new WeakMap<object, Node<'vec3'>>();

/** With the alpha of a texture, where there is one; `share`: how much of a pixel that is. */
export function lit(radiance: Node<'vec3'>, share?: Node<'float'>): Node<'vec4'> {
  const color = vec4(materialColor as unknown as Node<'vec4'>),
    made = vec4(color.rgb.mul(radiance.max(0)), share ? color.a.mul(share) : color.a);
  radiances.set(made, radiance);
  return made;
}

/** Of a colour node that is made of more than exit radiance: what false colour shows of it. */
export const showAs = (colorNode: object, radiance: Node<'vec3'>): void => void radiances.set(colorNode, radiance);

/** prt_material.ts has the scale. */
export function falseColor({ colorNode }: MaterialNodes, gain: { value: number }): MaterialNodes {
  const scale = uniform(1).onRenderUpdate(() => gain.value) as unknown as Node<'float'>,
    value = luminance(radiances.get(colorNode!)!).mul(scale).toVar(),
    grey = vec3(0.212),
    negative = mix(grey, vec3(0.004, 0.013, 0.082), value.negate().clamp(0, 1)),
    positive = mix(grey, vec3(1, 0.871, 0.352), value.clamp(0, 1));
  return { colorNode: vec4(select(value.lessThan(0), negative, positive), 1) };
}

/** Of the program's lights, what they send straight. */
class StraightLight extends PhongLightingModel {
  constructor() {
    super(false);
  }
  override indirect(): void {
    // What comes from all around was baked.
  }
  override finish(): void {
    // As well.
  }
}

/** For materials of one colour node, which are drawn by one program. */
const known = new WeakMap<object, MaterialNodes>();

/** What was baked is sent out, as far as three is concerned: that is added where no light shines, too. */
export function underLights({ colorNode, emissiveNode }: MaterialNodes): MaterialNodes {
  const before = known.get(colorNode!);
  if (before) return before;
  const color = diffuseColor as unknown as Node<'vec4'>,
    baked = color.rgb.mul(radiances.get(colorNode!)!.max(0)),
    nodes: MaterialNodes = {
      emissiveNode: emissiveNode ? baked.add(emissiveNode as Node<'vec3'>) : baked,
      setupLightingModel: () => new StraightLight(),
    };
  known.set(colorNode!, nodes);
  return nodes;
}
