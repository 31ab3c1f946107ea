// What the page shows: its state in the address, and the exposure that it measures.
import { describe, expect, it } from 'vitest';
import { defaultState, formatState, parseState } from '../page/state.ts';
import { autoExposure, tones } from '../page/tone.ts';

describe('the state of the page', () => {
  it('is automatic and neutral unless something else is said', () => {
    expect(parseState('', defaultState())).toMatchObject({ exposure: 'auto', tone: 'neutral' });
    expect(formatState(defaultState())).toBe('#');
  });

  for (const tone of tones)
    for (const exposure of ['auto', 0, -1.5, 20] as const)
      it(`keeps tone ${tone} at ${exposure} in its address, whatever the scene begins with`, () => {
        const state = { ...defaultState(), tone, exposure };
        for (const base of [defaultState(), { ...defaultState(), exposure: 2, tone: 'aces' as const }])
          expect(parseState(formatState(state, base), base)).toEqual(state);
      });

  it('keeps a sun that was raised, and a light that turns, or turns freely', () => {
    const state = { ...defaultState(), elevation: -1.5, spin: -8, free: true };
    expect(parseState(formatState(state), defaultState())).toEqual(state);
    expect(parseState('#elevation=200&spin=x', defaultState())).toMatchObject({ elevation: 90, spin: 0 });
  });

  it('leaves what cannot be read as it was', () => {
    const base = { ...defaultState(), exposure: 1, tone: 'agx' as const };
    expect(parseState('#exposure=bright&tone=vivid', base)).toMatchObject({ exposure: 1, tone: 'agx' });
    expect(parseState('#exposure=99', base).exposure).toBe(20);
  });
});

describe('the automatic exposure', () => {
  const grey = (y: number, alpha = 1): number[] => [y * alpha, y * alpha, y * alpha, alpha];

  it('brings the pixel that nine tenths are no brighter than to 0.7', () => {
    const pixels = Array.from({ length: 11 }, (_, i) => grey((i + 1) / 10)).flat(); // 0.1 to 1.1, the tenth: 1.0
    expect(autoExposure(pixels)).toBeCloseTo(Math.log2(0.7 / 1.0), 5);
    expect(autoExposure(pixels.map((v, i) => (i % 4 < 3 ? 8 * v : v)))).toBeCloseTo(Math.log2(0.7 / 8), 5);
    expect(autoExposure([0.5, 0.2, 0.9, 1])).toBeCloseTo(Math.log2(0.7 / (0.1063 + 0.14304 + 0.06498)), 5);
  });

  it('counts what is covered by half, at its own colour, and all where nothing is', () => {
    expect(autoExposure([...grey(0.35, 0.5), ...grey(50, 0.4), ...grey(9, 0)])).toBeCloseTo(1, 5);
    expect(autoExposure([...grey(0.35, 0.25), ...grey(0.1, 0.25)])).toBeCloseTo(Math.log2(7), 5);
  });

  it('takes what is below black for black, channel by channel, and what is no number', () => {
    expect(autoExposure([-5, 0.35 / 0.7152, -5, 1])).toBeCloseTo(1, 5);
    expect(autoExposure([...grey(NaN), ...grey(NaN), ...grey(NaN), 0.35, 0.35, 0.35, 1])).toBeCloseTo(1, 5);
  });

  it('takes the brightest where all else is dark, and leaves black as it is', () => {
    const dark = Array.from({ length: 30 }, () => grey(0)).flat();
    expect(autoExposure([...dark, ...grey(2.8)])).toBeCloseTo(-2, 5);
    expect(autoExposure(dark)).toBe(0);
    expect(autoExposure([])).toBe(0);
    expect(autoExposure(grey(1e-20))).toBe(20);
  });
});
