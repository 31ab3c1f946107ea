// What surfaces of visibility in blocks are made of, and how many samples of its lobe a block gets: as relight/
// products.cpp chooses, but that blocks which want 4 get 16, and those of which a part is seen get all.
import { cardinalFunctions, fineCardinal, fineNodes, finePlace } from './block_light.js';
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
  fine: number; // 64
  all: number;
}

const polynomials = Float64Array.from({ length: fineNodes * blockSide }, (_, i) =>
  fineCardinal(Math.floor(i / blockSide), (i % blockSide) + 0.5),
);
const finePlaces = Array.from({ length: fineNodes }, (_, i) => finePlace(i));

/**
 * Largest error over a flat block, whose middle is `angle` from a Phong lobe's axis, of no sample, of one, of 4 x 4 and
 * of 8 x 8.
 */
function phongErrors(exponent: number, angle: number, halfWidth: number, cardinal: Float64Array): number[] {
  const errors = [0, 0, 0, 0],
    nodes = new Float64Array(16),
    rows = new Float64Array(fineNodes * blockSide); // [node column][row]
  for (const turn of [0, Math.PI / 4]) {
    const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
    const lobe = (column: number, row: number): number => {
      const x = (column / 8 - 1) * halfWidth,
        y = (row / 8 - 1) * halfWidth,
        u = x * cos - y * sin + angle,
        v = x * sin + y * cos,
        theta = Math.sqrt(u * u + v * v);
      return theta < Math.PI / 2 ? (Math.cos(theta) ** exponent * (exponent + 2)) / (2 * Math.PI) : 0;
    };
    const middle = lobe(8, 8);
    for (let i = 0; i < 16; ++i) nodes[i] = lobe(4 * (i % 4) + 2, 4 * (i >> 2) + 2);
    rows.fill(0);
    for (let i = 0; i < fineNodes * fineNodes; ++i) {
      const value = lobe(finePlaces[i % fineNodes]!, finePlaces[i >> 3]!);
      for (let y = 0; y < blockSide; ++y)
        rows[(i % fineNodes) * blockSide + y]! += value * polynomials[(i >> 3) * blockSide + y]!;
    }
    for (let y = 0; y < blockSide; ++y)
      for (let x = 0; x < blockSide; ++x) {
        const truth = lobe(x + 0.5, y + 0.5);
        let sum = 0;
        for (let i = 0; i < 16; ++i)
          sum += nodes[i]! * cardinal[(i % 4) * blockSide + x]! * cardinal[(i >> 2) * blockSide + y]!;
        errors[0] = Math.max(errors[0]!, truth);
        errors[1] = Math.max(errors[1]!, Math.abs(middle - truth));
        errors[2] = Math.max(errors[2]!, Math.abs(sum - truth));
        sum = 0;
        for (let i = 0; i < fineNodes; ++i) sum += rows[i * blockSide + y]! * polynomials[i * blockSide + x]!;
        errors[3] = Math.max(errors[3]!, Math.abs(sum - truth));
      }
  }
  return errors;
}

/** `widest`: the largest angle from the middle of a block to a corner. */
export function samplesOf(reflection: Reflection, widest: number): Samples {
  if (reflection.model === 'diffuse') return { one: never, nodes: never, fine: never, all: never };
  if (reflection.model === 'ggx') {
    // By values at nodes, but near a lobe narrower than their spacing; of a narrower one, those at 64.
    const deviation = alphaOf(reflection.roughness) / Math.SQRT2,
      near = Math.cos(Math.min(Math.PI, widest + 3 * deviation));
    return {
      one: -2,
      nodes: never,
      fine: deviation < widest / 2 ? near : never,
      all: deviation < widest / 4 ? near : never,
    };
  }
  const steps = 90,
    found = [never, never, never, never],
    cardinal = cardinalFunctions(4);
  for (let i = steps; i >= 0 && found.some((cosine) => cosine > 1); --i) {
    const angle = (i * Math.PI) / steps,
      errors = phongErrors(reflection.exponent, angle, widest / Math.SQRT2, cardinal);
    for (let k = 0; k < 4; ++k)
      if (found[k]! > 1 && Math.PI * reflection.specular * errors[k]! > (k < 3 ? 2 : 0.1) * tolerance)
        found[k] = Math.cos(Math.min(Math.PI, angle + Math.PI / steps)) - 1e-6;
  }
  // More samples are never wrong: the classes are nested.
  const all = found[3]!,
    fine = Math.min(found[2]!, all),
    nodes = Math.min(found[1]!, fine);
  return { one: Math.min(found[0]!, nodes), nodes, fine, all };
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
