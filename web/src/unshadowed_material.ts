// What baking is compared with: a diffuse surface under the same light, but with nothing in its way. Exit radiance of
// white is sum_lm A_l / pi L_lm y_lm(n), by the Funk-Hecke theorem (docs/theory.md), summed at the vertex so that it is
// interpolated as baked transfer is. A_l vanishes for odd l beyond 1; what is left is generated without loops.
import { MeshBasicMaterial, type WebGLProgramParametersWithUniforms, type MeshBasicMaterialParameters } from 'three';
import { glslHarmonics } from './glsl_harmonics.js';
import type { Lighting } from './lighting.js';
import { setNodes, throughGlass, withoutEdition, type NodeEdition, type NodeUnshadowed } from './node_edition.js';
import { setPeaks } from './light_sum.js';
import { replaceOnce, whiteLine } from './prt_material.js';
import { drawFilter, type Drawn } from './see_through.js';
import { clampedCosine, shBand, shCount } from './sh.js';

/** Indices of the harmonics that irradiance has. */
export const irradianceIndices = (order: number): number[] =>
  Array.from({ length: shCount(order) }, (_, i) => i).filter((i) => clampedCosine(shBand(i)) !== 0);

/** GLSL that adds to `even` and `odd` the sums over harmonics of the normal `n`, by the recurrences of sh.ts. */
export function glslIrradiance(order: number, light = 'irradianceLight'): string {
  const place = new Map(irradianceIndices(order).map((index, at) => [index, at]));
  return glslHarmonics(order, (index, value) => {
    const at = place.get(index);
    return at === undefined ? '' : `${shBand(index) % 2 ? 'odd' : 'even'} += ${value} * ${light}[ ${at} ];`;
  });
}

export class UnshadowedMaterial extends MeshBasicMaterial {
  private readonly light: { value: Float32Array };
  private readonly peaks: { value: Float32Array };

  private readonly unshadowed: NodeUnshadowed | undefined;

  /** `nodes`, of lambent-three/webgpu: WebGPURenderer draws it, too. */
  constructor(
    readonly order: number,
    parameters: MeshBasicMaterialParameters = {},
    nodes?: NodeEdition,
  ) {
    super(parameters);
    this.unshadowed = nodes?.unshadowed(order, irradianceIndices(order));
    setNodes(this, nodes && throughGlass(nodes, this, this.unshadowed!.nodes), `This surface ${withoutEdition}.`);
    this.light = { value: new Float32Array(3 * irradianceIndices(order).length) };
    this.peaks = { value: new Float32Array(this.light.value.length) };
  }

  relight(lighting: Lighting): void {
    const { rest, peaks } = lighting.parts(this.order);
    const pack = (out: Float32Array, light: ArrayLike<number>): void =>
      irradianceIndices(this.order).forEach((index, at) => {
        for (let c = 0; c < 3; ++c) out[3 * at + c] = (light[3 * index + c]! * clampedCosine(shBand(index))) / Math.PI;
      });
    pack(this.light.value, rest);
    if (peaks) pack(this.peaks.value, peaks);
    setPeaks(this, peaks !== undefined);
    this.unshadowed?.set(this.light.value, peaks && this.peaks.value);
  }

  override onBeforeRender(...drawn: Drawn): void {
    drawFilter(this, ...drawn);
  }

  override onBeforeCompile(shader: WebGLProgramParametersWithUniforms): void {
    shader.uniforms['irradianceLight'] = this.light;
    shader.uniforms['irradiancePeaks'] = this.peaks;
    const count = irradianceIndices(this.order).length;
    const declarations = `
uniform vec3 irradianceLight[ ${count} ];
#ifdef PRT_PEAKS
  uniform vec3 irradiancePeaks[ ${count} ];
  void peakIrradiance( const in vec3 n, out vec3 even, out vec3 odd ) {
    even = odd = vec3( 0.0 );
    ${glslIrradiance(this.order, 'irradiancePeaks')}
  }
#endif
varying vec3 vFront, vBack;
`;
    const body = `
  vec3 n = normalize( ( vec4( transformedNormal, 0.0 ) * viewMatrix ).xyz );
  vec3 even = vec3( 0.0 ), odd = vec3( 0.0 );
  ${glslIrradiance(this.order)}
  vFront = even + odd; vBack = even - odd;
  #ifdef PRT_PEAKS
    vec3 evenPeaks, oddPeaks;
    peakIrradiance( n, evenPeaks, oddPeaks );
    vFront = max( vFront, vec3( 0.0 ) ) + max( evenPeaks + oddPeaks, vec3( 0.0 ) );
    vBack = max( vBack, vec3( 0.0 ) ) + max( evenPeaks - oddPeaks, vec3( 0.0 ) );
  #endif`;
    const withNormals = replaceOnce(
      shader.vertexShader,
      '#if defined ( USE_ENVMAP ) || defined ( USE_SKINNING )',
      '#if 1',
    );
    shader.vertexShader =
      declarations + replaceOnce(withNormals, '#include <fog_vertex>', '#include <fog_vertex>' + body);
    // On the back the normal is the other way, and odd harmonics change sign.
    shader.fragmentShader =
      'varying vec3 vFront, vBack;\n' +
      replaceOnce(
        shader.fragmentShader,
        whiteLine,
        'reflectedLight.indirectDiffuse += max( gl_FrontFacing ? vFront : vBack, vec3( 0.0 ) );',
      );
  }

  override customProgramCacheKey(): string {
    return `lambent unshadowed ${this.order}`;
  }
}
