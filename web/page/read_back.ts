// Light that was drawn, as numbers.
import { DataUtils, FloatType, HalfFloatType, type WebGLRenderer, type WebGLRenderTarget } from 'three';

/** Of floats that the graphics card draws into, the finest. */
export function floatType({ extensions }: WebGLRenderer): typeof FloatType | typeof HalfFloatType | undefined {
  if (extensions.has('EXT_color_buffer_float')) return FloatType;
  return extensions.has('EXT_color_buffer_half_float') ? HalfFloatType : undefined;
}

/** All of a target of such floats, [pixel][r, g, b, a]. */
export function readFloats(renderer: WebGLRenderer, target: WebGLRenderTarget): number[] {
  const { width, height, texture } = target,
    single = texture.type === FloatType,
    pixels = new (single ? Float32Array : Uint16Array)(4 * width * height);
  renderer.readRenderTargetPixels(target, 0, 0, width, height, pixels);
  return Array.from(pixels, (v) => (single ? v : DataUtils.fromHalfFloat(v)));
}
