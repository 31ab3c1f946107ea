// Surfaces that let light pass (docs/theory.md, "Light that passes through"): (1 - a) + a t C of what is behind shows,
// a being alpha, t the transmission and C the base colour. Alpha is blended by three; coloured glass takes a draw of
// its own, which multiplies what is there, before the one that adds what the glass reflects.
import {
  Color,
  CustomBlending,
  MeshBasicMaterial,
  OneFactor,
  SrcAlphaFactor,
  SrcColorFactor,
  ZeroFactor,
  type Material,
  type Mesh,
  type MeshBasicMaterialParameters,
  type WebGLProgramParametersWithUniforms,
} from 'three';
import { replaceOnce } from './prt_material.js';

/** Of the covered part of a material of three's own, the share of light that passes; its texture is not looked at. */
export function transmissionOf(source: Material): number {
  const { transmission = 0, metalness = 0 } = source as { transmission?: number; metalness?: number };
  return transmission * (1 - metalness);
}

/** Multiplies what is behind by what passes. */
class FilterMaterial extends MeshBasicMaterial {
  constructor(
    private readonly share: number,
    parameters: MeshBasicMaterialParameters,
  ) {
    super({ ...parameters, ...filterBlending });
  }

  override onBeforeCompile(shader: WebGLProgramParametersWithUniforms): void {
    shader.uniforms['passingShare'] = { value: this.share };
    shader.fragmentShader =
      'uniform float passingShare;\n' +
      replaceOnce(
        shader.fragmentShader,
        '#include <opaque_fragment>',
        'gl_FragColor = vec4( 1.0 - diffuseColor.a + diffuseColor.a * passingShare * diffuseColor.rgb, 1.0 );',
      );
  }

  override customProgramCacheKey(): string {
    return 'lambent filter';
  }
}

const filters = new WeakMap<Material, FilterMaterial>();

interface Glass {
  share: number;
  color: Color;
}
const glassOf = (material: Material): Glass | undefined => material.userData['lambentGlass'] as Glass | undefined;

/** `own`, the diffuse parameters of `source`; of glass, for what it reflects, to be added to what passes. */
export function glassParameters(source: Material, own: MeshBasicMaterialParameters): MeshBasicMaterialParameters {
  const share = transmissionOf(source);
  let glass = glassOf(source);
  if (!glass && !(share > 0)) return own;
  glass ??= { share, color: new Color(own.color ?? 0xffffff) };
  return {
    ...own,
    color: glass.color.clone().multiplyScalar(1 - glass.share),
    transparent: true,
    depthWrite: false,
    blending: CustomBlending,
    blendSrc: SrcAlphaFactor,
    blendDst: OneFactor,
    blendSrcAlpha: ZeroFactor,
    blendDstAlpha: OneFactor,
    userData: { lambentGlass: glass },
  };
}

/** Of a glass material: its own without what makes it glass, and the share of light that passes. */
export function filterParameters(
  material: Material,
): { share: number; parameters: MeshBasicMaterialParameters } | undefined {
  const glass = glassOf(material);
  if (!glass) return undefined;
  const { side, map, alphaMap, alphaTest, opacity, vertexColors, depthTest } = material as MeshBasicMaterial;
  return {
    share: glass.share,
    parameters: { side, map, alphaMap, alphaTest, opacity, vertexColors, depthTest, color: glass.color.clone() },
  };
}
/** How a filter is blended: it multiplies what is there. */
export const filterBlending = {
  transparent: true,
  depthWrite: false,
  fog: false,
  toneMapped: false,
  blending: CustomBlending,
  blendSrc: ZeroFactor,
  blendDst: SrcColorFactor,
} as const;

/** What three tells a material of what it is about to draw. */
export type Drawn = Parameters<Material['onBeforeRender']>;

/** To be called before `material` is drawn: lets glass pass what is behind. */
export function drawFilter(material: MeshBasicMaterial, ...[renderer, scene, camera, geometry, object]: Drawn): void {
  let filter = filters.get(material);
  if (!filter) {
    const found = filterParameters(material);
    if (!found) return;
    const made = new FilterMaterial(found.share, found.parameters);
    material.addEventListener('dispose', () => made.dispose());
    filters.set(material, (filter = made));
  }
  renderer.renderBufferDirect(camera, scene, geometry, filter, object, null!);
}

/** Whether some of these meshes are seen through, so that what is behind them shows. */
export const anySeeThrough = (meshes: Mesh[]): boolean =>
  meshes.some((mesh) => [mesh.material].flat().some((material) => material.transparent));
