// What meshes look up of exit radiance: a texel a receiver, or over an atlas.
import type { Object3D, Texture, WebGLRenderer } from 'three';

/** Receivers a row of a picture whose texel i is receiver i. */
export const sumColumns = 2048;

/** Of what is drawn next; what turned has sums of its own. */
export interface ShownSums {
  readonly rest: { value: Texture };
  /** Of the light's peaks, where those are apart. */
  readonly peaks: { value: Texture };
  readonly hasPeaks: boolean;
  /** Before `object` is drawn. */
  update(renderer: WebGLRenderer, object: Object3D): void;
}
