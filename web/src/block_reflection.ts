// What surfaces of visibility in blocks are made of, and how many samples of its lobe a block gets: as relight/
// products.cpp chooses, but that blocks which want 4 get 16, and those of which a part is seen get all.
import { cardinalFunctions } from './block_light.js';
import { blockSide } from './cube.js';

/** Spelt as `render --brdf` spells it; `diffuse` is times the scene's own colour. */
export type Reflection =
  | { model: 'diffuse' }
  | { model: 'phong'; diffuse: number; specular: number; exponent: number }
  | { model: 'ggx'; roughness: number; f0: number };

const tolerance = 0.2; // the default of `render` for Phong's lobes
const leastAlpha = 1e-3;
const never = 2;

/** Cosines of the angle between a block's middle and the mirror image of the view above which a block gets more. */
export interface Samples {
  one: number; // below it the lobe is left out
  nodes: number;
  all: number;
}

/**
 * Largest error over a flat block, whose middle is `angle` from a Phong lobe's axis, of no sample, of one and of
 * 4 x 4.
 */
function phongErrors(exponent: number, angle: number, halfWidth: number, cardinal: Float64Array): number[] {
  const errors = [0, 0, 0],
    nodes = new Float64Array(16);
  for (const turn of [0, Math.PI / 4]) {
    const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
    const lobe = (column: number, row: number): number => {
      const x = (column / 8 - 1) * halfWidth,
        y = (row / 8 - 1) * halfWidth,
        theta = Math.hypot(x * cos - y * sin + angle, x * sin + y * cos);
      return theta < Math.PI / 2 ? (Math.cos(theta) ** exponent * (exponent + 2)) / (2 * Math.PI) : 0;
    };
    const middle = lobe(8, 8);
    for (let i = 0; i < 16; ++i) nodes[i] = lobe(4 * (i % 4) + 2, 4 * (i >> 2) + 2);
    for (let y = 0; y < blockSide; ++y)
      for (let x = 0; x < blockSide; ++x) {
        const truth = lobe(x + 0.5, y + 0.5);
        let sum = 0;
        for (let i = 0; i < 16; ++i)
          sum += nodes[i]! * cardinal[(i % 4) * blockSide + x]! * cardinal[(i >> 2) * blockSide + y]!;
        errors[0] = Math.max(errors[0]!, truth);
        errors[1] = Math.max(errors[1]!, Math.abs(middle - truth));
        errors[2] = Math.max(errors[2]!, Math.abs(sum - truth));
      }
  }
  return errors;
}

/** `widest`: the largest angle from the middle of a block to a corner. */
export function samplesOf(reflection: Reflection, widest: number): Samples {
  if (reflection.model === 'diffuse') return { one: never, nodes: never, all: never };
  if (reflection.model === 'ggx') {
    // By values at nodes, but near a lobe narrower than their spacing.
    const deviation = Math.SQRT2 * alphaOf(reflection.roughness);
    return { one: -2, nodes: never, all: deviation < widest ? Math.cos(Math.min(Math.PI, widest + 3 * deviation)) : 2 };
  }
  const steps = 90,
    found = [never, never, never],
    cardinal = cardinalFunctions(4);
  for (let i = steps; i >= 0; --i) {
    const angle = (i * Math.PI) / steps,
      errors = phongErrors(reflection.exponent, angle, widest / Math.SQRT2, cardinal);
    for (let k = 0; k < 3; ++k)
      if (found[k]! > 1 && Math.PI * reflection.specular * errors[k]! > 2 * tolerance)
        found[k] = Math.cos(Math.min(Math.PI, angle + Math.PI / steps)) - 1e-6;
  }
  // More samples are never wrong: the classes are nested.
  const all = found[2]!,
    nodes = Math.min(found[1]!, all);
  return { one: Math.min(found[0]!, nodes), nodes, all };
}

const alphaOf = (roughness: number): number => Math.max(roughness * roughness, leastAlpha);

/** Uniforms of the gloss: s(wi) is times `colour`; `width` is exponent or alpha. */
export const lobeOf = (reflection: Reflection): { colour: number; width: number } =>
  reflection.model === 'phong'
    ? { colour: reflection.specular, width: reflection.exponent }
    : reflection.model === 'ggx'
      ? { colour: reflection.f0, width: alphaOf(reflection.roughness) }
      : { colour: 0, width: 1 };
export const diffuseOf = (reflection: Reflection): number =>
  reflection.model === 'phong' ? reflection.diffuse : reflection.model === 'diffuse' ? 1 : 0;
export const blockTolerance = 0.02;
