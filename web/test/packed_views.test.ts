// Packed views as C++ writes them (tests/packed, src/lambent/baked/packed_test.cpp): they come back to the bytes that
// it has of them, and whatever was cut off, lies or was spoilt is refused in a sentence.
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { describe, expect, it, vi } from 'vitest';
import { unpackView } from '../src/packed_views.ts';
import { readPacked } from './tool.ts';

const kept = (name: string): string => fileURLToPath(new URL(`../../tests/packed/${name}`, import.meta.url));

describe('a file that C++ has packed', () => {
  const { document, view } = readPacked(kept('grid.glb')),
    given = document.bufferViews.map((of) => of.extensions?.LAMBENT_transfer),
    transfer = document.extensions.LAMBENT_transfer.transfer.bufferView,
    refused = /does not fit its description/;

  it('comes back to the bytes that C++ has of it', () => {
    const hashes = given.map((of, i) =>
      new Uint8Array(of ? unpackView(view(i), of) : view(i)).reduce(
        (hash, byte) => Math.imul(hash ^ byte, 16777619) >>> 0,
        2166136261,
      ),
    );
    expect(hashes).toEqual(JSON.parse(readFileSync(kept('grid.json'), 'utf8')));
  });

  it('is refused where it ends early, wherever that is', () => {
    given.forEach((of, i) => {
      if (!of) return;
      const whole = view(i),
        step = Math.max(1, Math.floor(whole.byteLength / 97));
      for (let length = 0; length < whole.byteLength; length += step)
        expect(() => unpackView(whole.slice(0, length), of), `${of.form}, ${length} bytes`).toThrow(refused);
      const longer = new Uint8Array(whole.byteLength + 1);
      longer.set(new Uint8Array(whole));
      expect(() => unpackView(longer.buffer, of)).toThrow(refused);
    });
  });

  it('is refused where its header lies', () => {
    const bytes = view(transfer),
      of = given[transfer]!;
    for (const change of [
      { rows: 901 },
      { rows: 899 },
      { rows: 0 },
      { rows: -900 },
      { rows: 900.5 },
      { rows: 2 ** 31, byteLength: 27 * 2 ** 32 },
      { rows: 2 ** 26, byteLength: 27 * 2 ** 27 },
      { groups: 0 },
      { groups: 1, columns: 27 },
      { groups: 2 ** 20 },
      { columns: 10 },
      { columns: '9' },
      { byteLength: of.byteLength - 2 },
      { byteLength: -1 },
      { byteLength: NaN },
      { step: Infinity },
      { step: 'small' },
      { form: 'single blocks' },
      { form: 'u16' },
      { form: 'floats' },
      { form: ['half blocks'] },
      { form: '' },
    ])
      expect(() => unpackView(bytes, { ...of, ...change }), JSON.stringify(change)).toThrow(refused);
    const word = given.findIndex((of) => of?.form === 'u32');
    for (const more of [4, -4])
      expect(() => unpackView(view(word), { ...given[word], byteLength: given[word]!.byteLength + more })).toThrow(
        refused,
      );
    for (const none of [undefined, null, 7, 'half blocks', []])
      expect(() => unpackView(bytes, none), String(none)).toThrow(refused);
  });

  it('takes no memory for more than its bytes can hold', () => {
    const of = { ...given[transfer]!, rows: 2 ** 20, byteLength: 27 * 2 ** 21 };
    const take = (): never => {
      throw new Error('memory was taken');
    };
    vi.stubGlobal('Uint16Array', take);
    try {
      expect(() => unpackView(view(transfer), of)).toThrow(refused);
    } finally {
      vi.unstubAllGlobals();
    }
  });

  it('is refused where its stream says more than it has', () => {
    // Coded symbols begin with how many they are and how many bytes follow: after the lag, and of rows at once.
    given.forEach((of, i) => {
      if (!of) return;
      const at = of.form.startsWith('u') ? 1 : 0;
      for (const [where, word] of [
        [at, 0xffffffff],
        [at, 0],
        [at, 2 ** 20],
        [at + 4, 0xffffffff],
        [at + 4, 0],
        [at + 4, 127],
      ] as const) {
        const spoilt = view(i);
        new DataView(spoilt).setUint32(where, word, true);
        expect(() => unpackView(spoilt, of), `${of.form}, ${word} at ${where}`).toThrow(refused);
      }
    });
    const lag = new Uint8Array(view(given.findIndex((of) => of?.form === 'u32')));
    lag[0] = 2 ** 7;
    expect(() =>
      unpackView(
        lag.buffer,
        given.find((of) => of?.form === 'u32'),
      ),
    ).toThrow(refused);
  });

  it('is numbers or a sentence, whichever bit is another', () => {
    given.forEach((of, i) => {
      if (!of) return;
      const bytes = new Uint8Array(view(i));
      let count = 0;
      for (let k = 0; k < 150; ++k) {
        const spoilt = bytes.slice();
        spoilt[(k * 7919) % spoilt.length]! ^= 1 << (k % 8);
        try {
          expect(unpackView(spoilt.buffer, of).byteLength).toBe(of.byteLength);
        } catch (error) {
          expect(String(error)).toMatch(refused);
          ++count;
        }
      }
      expect(count).toBeGreaterThan(10);
    });
  });
});
