// From radiance to what the screen shows, by the names and numbers of `lambent render --tone --exposure`.
import {
  ACESFilmicToneMapping,
  AgXToneMapping,
  LinearToneMapping,
  NeutralToneMapping,
  ShaderChunk,
  type ToneMapping,
} from 'three';

/** As three.js has them; none: clamped. */
export const toneMappings = {
  neutral: NeutralToneMapping,
  agx: AgXToneMapping,
  aces: ACESFilmicToneMapping,
  none: LinearToneMapping,
} satisfies Record<string, ToneMapping>;
export type Tone = keyof typeof toneMappings;
export const tones = Object.keys(toneMappings) as Tone[];

/** Radiance below black, as bands of light leave it, is black before any curve, as in `render`. */
export function clampBeforeTone(): void {
  const chunk = 'tonemapping_fragment',
    before = '#if defined( TONE_MAPPING )\n  gl_FragColor.rgb = max( gl_FragColor.rgb, vec3( 0.0 ) );\n#endif\n';
  if (!ShaderChunk[chunk].startsWith(before)) ShaderChunk[chunk] = before + ShaderChunk[chunk];
}

/**
 * Stops at which nine tenths of what surfaces cover is no brighter than 0.7 (`auto_exposure` in
 * src/lambent/image/tone.h): `pixels` are linear RGBA, colours times alpha; those covered by less than half do not
 * count, unless all are. 0 where all is black.
 */
export function autoExposure(pixels: ArrayLike<number>): number {
  const covered: number[] = [],
    all: number[] = [];
  for (let i = 0; i < pixels.length; i += 4) {
    const [r, g, b] = [0, 1, 2].map((c) => Math.max(pixels[i + c]!, 0)) as [number, number, number],
      alpha = pixels[i + 3]!;
    const sum = (0.2126 * r + 0.7152 * g + 0.0722 * b) / (alpha > 0 ? alpha : 1),
      y = Number.isFinite(sum) ? sum : 0;
    all.push(y);
    if (alpha >= 0.5) covered.push(y);
  }
  const values = Float32Array.from(covered.length > 0 ? covered : all).sort();
  if (values.length === 0) return 0;
  const level = values[Math.floor((values.length - 1) * 0.9)]! || values.at(-1)!; // else a lamp in the dark
  return level > 0 ? Math.min(20, Math.max(-20, Math.log2(0.7 / level))) : 0;
}
