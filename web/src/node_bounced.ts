// What indirect_material.ts has in GLSL, in nodes for WebGPURenderer: light that has bounced, added to what three's
// lights send straight, and lamps that fall off as lambent's.
import {
  PhongLightingModel,
  PointLight,
  PointLightNode,
  SpotLight,
  SpotLightNode,
  type LightingModelDirectInput,
  type Node,
  type NodeBuilder,
} from 'three/webgpu';
import {
  attribute,
  diffuseColor,
  frontFacing,
  ivec2,
  materialEmissive,
  mix,
  pow,
  select,
  texture,
  textureLoad,
  uniform,
  varying,
  vec2,
  vec3,
} from 'three/tsl';
import { pictureColumns } from './indirect_material.js';
import type { LampMakers, MaterialNodes, NodeBounced } from './node_edition.js';
import { receiverAt } from './node_sum.js';

type Vec3 = Node<'vec3'>;
type Float = Node<'float'>;

/** Of what three's lights send straight, as much as is shown. */
class ShownLight extends PhongLightingModel {
  constructor(private readonly share: Float) {
    super(false);
  }
  override direct(input: LightingModelDirectInput, builder: NodeBuilder): void {
    const lightColor = (input.lightColor as unknown as Vec3).mul(this.share);
    super.direct({ ...input, lightColor }, builder);
  }
}

function atVertices({ picture, twoSided }: NodeBounced): Vec3 {
  const of = (name: string): Vec3 => {
    const { r, none } = receiverAt(name),
      texel = ivec2(r.mod(pictureColumns), r.div(pictureColumns)),
      value = textureLoad(texture(picture), texel) as unknown as Node<'vec4'>;
    return varying(select(none, vec3(0), value.rgb));
  };
  const front = of('lambentReceiver');
  return twoSided ? select(frontFacing, front, of('lambentReceiverBack')) : front;
}

/** By hand, since graphics cards need not filter single floats. */
function overAtlas({ picture, twoSided }: NodeBounced): Vec3 {
  const { width, height } = picture.image,
    of = (name: string): Node<'vec2'> => varying(attribute<'vec2'>(name, 'vec2')),
    front = of('lambentPlace'),
    place = twoSided ? select(frontFacing, front, of('lambentPlaceBack')) : front,
    low = place.sub(0.5).floor(),
    share = place.sub(0.5).sub(low);
  const texel = (x: number, y: number): Vec3 => {
    const at = ivec2(low.add(vec2(x, y)).clamp(vec2(0, 0), vec2(width - 1, height - 1)));
    return (textureLoad(texture(picture), at) as unknown as Node<'vec4'>).rgb;
  };
  return mix(mix(texel(0, 0), texel(1, 0), share.x), mix(texel(0, 1), texel(1, 1), share.x), share.y);
}

export function bounced(light: NodeBounced): MaterialNodes {
  const direct = uniform(1).onRenderUpdate(() => light.direct.value) as unknown as Float,
    radiance = light.atlas ? overAtlas(light) : atVertices(light),
    color = diffuseColor as unknown as Node<'vec4'>;
  return {
    // What is sent out is added where no light shines, too, which a model of lighting is not asked for.
    emissiveNode: (materialEmissive as unknown as Vec3).mul(direct).add(color.rgb.mul(radiance.max(0))),
    setupLightingModel: () => new ShownLight(direct),
  };
}

// three limits its lights near them, and spots fall off otherwise than KHR_lights_punctual has them.
interface Parts {
  getLightVector(builder: NodeBuilder): Node;
  decayExponentNode: Node;
}
interface DirectLight {
  lightDirection: Node;
  lightColor: Node;
}
function unlimited(of: Parts, builder: NodeBuilder, limited: DirectLight): DirectLight {
  const way = of.getLightVector(builder) as unknown as Vec3,
    fall = pow(way.length(), of.decayExponentNode as unknown as Float);
  return { ...limited, lightColor: (limited.lightColor as unknown as Vec3).mul(fall.max(0.01).div(fall.max(1e-18))) };
}

class LampPointNode extends PointLightNode {
  override setupDirect(builder: NodeBuilder): DirectLight {
    return unlimited(this, builder, super.setupDirect(builder)!);
  }
}
class LampSpotNode extends SpotLightNode {
  override setupDirect(builder: NodeBuilder): DirectLight {
    return unlimited(this, builder, super.setupDirect(builder)!);
  }
  /** three's own is smooth. */
  getSpotAttenuation(_: NodeBuilder, cosine: Float): Float {
    const cone = this.coneCosNode as unknown as Float,
      penumbra = this.penumbraCosNode as unknown as Float,
      share = cosine.sub(cone).div(penumbra.sub(cone).max(1e-4)).clamp(0, 1);
    return share.mul(share);
  }
}

class LampPoint extends PointLight {}
LampPoint.registerNode(LampPointNode);
class LampSpot extends SpotLight {}
LampSpot.registerNode(LampSpotNode);

export const lights: LampMakers = { point: () => new LampPoint(), spot: () => new LampSpot() };
