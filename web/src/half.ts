const lane = new Float32Array(1),
  bits = new Uint32Array(lane.buffer);

/** The nearest half float, which three's own cuts off; what is beyond the greatest, 65504, is that. */
export function toHalf(value: number): number {
  lane[0] = value;
  const all = bits[0]!,
    size = all & 0x7fffffff,
    sign = (all >>> 16) & 0x8000;
  if (size >= 0x477fe000) return sign | 0x7bff;
  if (size < 0x38800000) return sign | Math.round(Math.abs(value) * 2 ** 24);
  return sign | ((size - 0x38000000 + 0xfff + ((size >>> 13) & 1)) >>> 13);
}
