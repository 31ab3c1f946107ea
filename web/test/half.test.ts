import { DataUtils } from 'three';
import { describe, expect, it } from 'vitest';
import { toHalf } from '../src/half.js';

describe('a half float', () => {
  it('that is one comes back, of all of them', () => {
    for (let bits = 0; bits < 65536; ++bits)
      if ((bits & 0x7c00) !== 0x7c00) expect(toHalf(DataUtils.fromHalfFloat(bits))).toBe(bits);
  });

  it('is the nearest, and the even one of two that are as near', () => {
    for (let bits = 0; bits < 0x7bff; ++bits) {
      const low = DataUtils.fromHalfFloat(bits),
        high = DataUtils.fromHalfFloat(bits + 1);
      expect(toHalf(low + 0.49 * (high - low))).toBe(bits);
      expect(toHalf(low + 0.51 * (high - low))).toBe(bits + 1);
      if (bits >= 0x400) expect(toHalf((low + high) / 2)).toBe(bits + (bits & 1));
    }
  });

  it('is at most the greatest', () => {
    expect(toHalf(1e9)).toBe(0x7bff);
    expect(toHalf(-Infinity)).toBe(0xfbff);
  });
});
