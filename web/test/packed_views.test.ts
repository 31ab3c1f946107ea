// Packed views as C++ writes them (tests/packed, src/lambent/baked/packed_test.cpp): they come back to the bytes that
// it has of them, and whatever was cut off, lies or was spoilt is refused in a sentence.
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { describe, expect, it, vi } from 'vitest';
import { firstColumns, unpackView } from '../src/packed_views.ts';
import { readProgressive } from '../src/progressive.ts';
import { readPacked } from './tool.ts';

const refused = /does not fit its description/;
const kept = (name: string): string => fileURLToPath(new URL(`../../tests/packed/${name}`, import.meta.url));

describe('a file that C++ has packed', () => {
  const { document, view } = readPacked(kept('grid.glb')),
    given = document.bufferViews.map((of) => of.extensions?.LAMBENT_transfer),
    transfer = document.extensions.LAMBENT_transfer.transfer.bufferView;

  const hashOf = (bytes: ArrayBuffer): number =>
      new Uint8Array(bytes).reduce((hash, byte) => Math.imul(hash ^ byte, 16777619) >>> 0, 2166136261),
    hashes = JSON.parse(readFileSync(kept('grid.json'), 'utf8')) as { views: number[]; first: number };

  it('comes back to the bytes that C++ has of it', () => {
    expect(given.map((of, i) => hashOf(of ? unpackView(view(i), of) : view(i)))).toEqual(hashes.views);
  });

  it('comes back as C++ has it where its first bands alone are there', () => {
    const of = given[transfer]!,
      first = firstColumns(of)!;
    expect(first).toMatchObject({ order: 3, lamps: 2, alone: false });
    const alone = { ...of, first: { ...of.first, alone: true } };
    expect(hashOf(unpackView(view(transfer).slice(0, first.byteLength), alone))).toBe(hashes.first);
    for (const length of [first.byteLength - 1, first.byteLength + 1, 0])
      expect(() => unpackView(view(transfer).slice(0, length), alone)).toThrow(refused);
    for (const change of [
      { order: 0 },
      { order: 4 },
      { order: 2 },
      { order: 1.5 },
      { lamps: 1 },
      { lamps: 9 },
      { lamps: -1 },
      { byteLength: -1 },
      { alone: 'yes' },
    ])
      expect(
        () => unpackView(view(transfer).slice(0, first.byteLength), { ...of, first: { ...alone.first, ...change } }),
        JSON.stringify(change),
      ).toThrow(refused);
    for (const none of [null, 3, []]) expect(() => unpackView(view(transfer), { ...of, first: none })).toThrow(refused);
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
      { rows: 2 ** 31, byteLength: 54 * 2 ** 32 },
      { rows: 2 ** 23, byteLength: 54 * 2 ** 24 },
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
    const of = { ...given[transfer]!, rows: 2 ** 20, byteLength: 54 * 2 ** 21 };
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

describe('a file that comes piece by piece', () => {
  const file = readFileSync(kept('grid.glb')),
    { document, view } = readPacked(kept('grid.glb')),
    transfer = document.extensions.LAMBENT_transfer.transfer.bufferView,
    of = document.bufferViews[transfer]!.extensions!.LAMBENT_transfer!,
    first = firstColumns(of)!.byteLength,
    enough = 28 + file.readUInt32LE(12) + document.bufferViews[transfer]!.byteOffset! + first;

  /** What a server sends: so many bytes at a time; after `last` it breaks off. */
  function answer(bytes: Uint8Array, size: number, last = Infinity, error?: Error): { sent: number; as: Response } {
    const made = { sent: 0, as: undefined as unknown as Response };
    const body = new ReadableStream<Uint8Array>(
      {
        pull: (to) => {
          const end = Math.min(made.sent + size, bytes.length, last);
          if (end > made.sent) to.enqueue(bytes.slice(made.sent, end));
          else if (error) to.error(error);
          else to.close();
          made.sent = end;
        },
      },
      { highWaterMark: 0 },
    );
    made.as = new Response(body);
    return made;
  }
  const documentOf = (glb: ArrayBuffer): typeof document => {
    const bytes = Buffer.from(glb);
    expect(bytes.readUInt32LE(8)).toBe(bytes.length);
    return JSON.parse(bytes.toString('utf8', 20, 20 + bytes.readUInt32LE(12))) as typeof document;
  };

  for (const size of [1, 7, 1000, 1 << 20])
    it(`can be drawn once its first bands are there, ${size} bytes at a time`, async () => {
      const { as } = answer(file, size),
        told: number[] = [];
      const part = await readProgressive(as, (bytes, share) => {
        told.push(bytes);
        expect(share).toBeCloseTo(bytes < 12 ? 0 : bytes / file.length, 9);
      });
      expect(told[0]).toBeGreaterThanOrEqual(1);
      expect(part.bands).toBe(3);
      const cut = documentOf(part.bytes),
        cutView = cut.bufferViews[transfer]!;
      expect(cutView.byteLength).toBe(first);
      const packed = cutView.extensions!.LAMBENT_transfer!,
        glb = Buffer.from(part.bytes),
        begin = 28 + glb.readUInt32LE(12);
      expect(glb.readUInt32LE(begin - 8)).toBe(glb.length - begin);
      cut.bufferViews.forEach(({ byteOffset = 0, byteLength }, i) => {
        const bytes = glb.subarray(begin + byteOffset, begin + byteOffset + byteLength);
        expect(bytes.equals(Buffer.from(view(i)).subarray(0, byteLength)), `view ${i}`).toBe(true);
      });
      expect(() =>
        unpackView(Uint8Array.from(glb.subarray(begin + cutView.byteOffset!)).buffer.slice(0, first), packed),
      ).not.toThrow();
      expect(Buffer.from(await part.rest!).equals(Buffer.from(unpackView(view(transfer), of)))).toBe(true);
      expect(told.at(-1)).toBe(file.length);
    });

  it('is drawn at the byte that completes the first bands, and not before', async () => {
    const early = answer(file, 1 << 20, enough - 1);
    await expect(readProgressive(early.as)).rejects.toThrow(
      `broke off after ${(enough - 1).toLocaleString('en')} of ${file.length.toLocaleString('en')} bytes`,
    );
    const part = await readProgressive(answer(file, 1 << 20, enough).as);
    expect(part.bands).toBe(3);
    await expect(part.rest).rejects.toThrow(`broke off after ${enough.toLocaleString('en')} of`);
    const lost = await readProgressive(answer(file, 1 << 20, enough + 5, new Error('reset')).as);
    await expect(lost.rest).rejects.toThrow(/^broke off after/);
    const whole = await readProgressive(answer(file, 999).as, undefined, true);
    expect(whole.rest).toBeUndefined();
    expect(Buffer.from(whole.bytes).equals(file)).toBe(true);
  });

  it('is whatever it is where it is no packed file, or says what cannot be', async () => {
    /** The file with another header of its transfer's view. */
    const changed = (change: (json: typeof document) => void): Uint8Array => {
      const json = structuredClone(document);
      change(json);
      let text = JSON.stringify(json);
      text = text.padEnd(Math.ceil(text.length / 4) * 4);
      const binary = file.subarray(20 + file.readUInt32LE(12)),
        head = Buffer.alloc(20);
      [0x46546c67, 2, 20 + text.length + binary.length, text.length, 0x4e4f534a].forEach((word, i) =>
        head.writeUInt32LE(word, 4 * i),
      );
      return Buffer.concat([head, Buffer.from(text), binary]);
    };
    const packed = (json: typeof document): Record<string, unknown> =>
      json.bufferViews[transfer]!.extensions!.LAMBENT_transfer!;
    for (const bytes of [
      new Uint8Array(0),
      new Uint8Array(100),
      new TextEncoder().encode('{"asset":{}}'),
      changed((json) => delete packed(json)['first']),
      changed((json) => (packed(json)['first'] = { order: 3, lamps: 2, byteLength: 1e9 })),
      changed((json) => (packed(json)['first'] = { order: 30, lamps: 2, byteLength: 100 })),
      changed((json) => (packed(json)['first'] = null)),
      changed((json) => (json.bufferViews[1]!.byteLength = 1e9)),
      changed((json) => (json.bufferViews[transfer]!.byteOffset = -4)),
      changed((json) => (json.extensions.LAMBENT_transfer.transfer.bufferView = 99)),
      changed((json) => ((json as { extensions: unknown }).extensions = 7)),
      changed((json) => ((json as { bufferViews: unknown }).bufferViews = [null])),
    ]) {
      const part = await readProgressive(answer(bytes, 100).as);
      expect(part.rest).toBeUndefined();
      expect(Buffer.from(part.bytes).equals(bytes)).toBe(true);
    }
    const odd = Uint8Array.from(file);
    new DataView(odd.buffer).setUint32(12, 0xfffffff0, true); // of its JSON
    expect((await readProgressive(answer(odd, 1000).as)).rest).toBeUndefined();
    // What comes later may be spoilt, too.
    const spoilt = Uint8Array.from(file);
    spoilt.fill(0xa5, enough + 200);
    const part = await readProgressive(answer(spoilt, 1000).as);
    await expect(part.rest).rejects.toThrow(refused);
  });
});
