import { describe, expect, it } from 'vitest';
import { DataUtils } from 'three';
import { blockLayout, packBlocks, type BlockHeader } from '../src/block_texture.ts';
import { readHeader } from '../src/header.ts';
import { checkBakedFile } from '../src/index.ts';
import { zonalValues } from '../src/zonal.ts';
import { random } from './tool.ts';

describe('the transfer texture', () => {
  for (const header of [
    { count: 36, channels: 3, precision: 'half', receivers: 1000 },
    { count: 25, channels: 1, precision: 'single', receivers: 37 },
    { count: 256, channels: 3, precision: 'half', receivers: 5000 }, // more than one layer
    { count: 1, channels: 1, precision: 'half', receivers: 1 },
  ] as BlockHeader[])
    it(`holds every value where the shader looks: ${header.count} values, ${header.channels} channels, ${header.receivers} receivers`, () => {
      const { count, channels, receivers } = header, blocks = Math.ceil(receivers / 16), next = random(count);
      const length = blocks * channels * count * 16, values = header.precision === 'half' ? new Uint16Array(length) : new Float32Array(length);
      for (let i = 0; i < length; ++i) values[i] = Math.floor(65000 * next());
      const { layout, data } = packBlocks(header, values.buffer);
      expect(data.length).toBe(4 * layout.width * layout.height * layout.layers);
      expect(Math.max(layout.width, layout.height)).toBeLessThanOrEqual(2048);
      for (let i = 0; i < 5000; ++i) {
        const r = Math.floor(next() * receivers), c = Math.floor(next() * channels), k = Math.floor(next() * count);
        const x = (r % layout.columns) * layout.texels + c * layout.quads + (k >> 2);
        const y = Math.floor(r / layout.columns) % layout.rows, layer = Math.floor(r / (layout.columns * layout.rows));
        const texel = data[4 * ((layer * layout.height + y) * layout.width + x) + (k & 3)];
        expect(texel).toBe(values[(((r >> 4) * channels + c) * count + k) * 16 + (r & 15)]);
      }
    });

  it('keeps to what WebGL2 promises for two million receivers of any order', () => {
    for (let order = 1; order <= 16; ++order) {
      const { width, height, layers } = blockLayout({ count: order * order, channels: 3, precision: 'half', receivers: 2_000_000 });
      expect(Math.max(width, height)).toBeLessThanOrEqual(2048);
      expect(layers).toBeLessThanOrEqual(256);
    }
    // The budget of the docs: 216 bytes a receiver at order 6 in colour, and little beside.
    const { width, height, layers } = blockLayout({ count: 36, channels: 3, precision: 'half', receivers: 1_000_000 });
    const bytes = width * height * layers * 8;
    expect(bytes).toBeGreaterThanOrEqual(216e6);
    expect(bytes).toBeLessThan(1.03 * 216e6);
  });

  it('refuses a length that does not fit', () => {
    expect(() => packBlocks({ count: 4, channels: 1, precision: 'half', receivers: 17 }, new ArrayBuffer(128))).toThrow(/128 bytes.*256/);
  });

  it('uploads bits of half floats as they are', () => {
    const half = DataUtils.toHalfFloat(-0.3125), values = new Uint16Array(16).fill(half);
    expect(packBlocks({ count: 1, channels: 1, precision: 'half', receivers: 16 }, values.buffer).data[0]).toBe(half);
  });
});

describe('zonal values', () => {
  // docs/zonal.md: bytes a vertex in half floats, grey, order 6.
  it('take the bytes of the docs', () => expect([1, 2, 3, 4, 5, 6].map((lobes) => 2 * zonalValues(6, lobes, 1))).toEqual([18, 34, 50, 64, 78, 92]));
});

/** A GLB with this JSON and no binary chunk. */
function glb(json: unknown): ArrayBuffer {
  const text = JSON.stringify(json).padEnd(Math.ceil(JSON.stringify(json).length / 4) * 4), bytes = new Uint8Array(20 + text.length), view = new DataView(bytes.buffer);
  [0x46546c67, 2, bytes.length, text.length, 0x4e4f534a].forEach((v, i) => view.setUint32(4 * i, v, true));
  bytes.set(new TextEncoder().encode(text), 20);
  return bytes.buffer;
}

describe('files that are not what they should be', () => {
  const transfer = { kind: 'diffuse' }, extension = (e: object) => glb({ extensions: { LAMBENT_transfer: { version: 1, transfer, parts: [], ...e } } });
  const cases: [string, ArrayBuffer, RegExp][] = [
    ['empty', new ArrayBuffer(0), /is empty/],
    ['text', new TextEncoder().encode('hello, world, this is text').buffer, /not a glTF binary/],
    ['no extension', glb({ asset: { version: '2.0' } }), /not a baked file/],
    ['another version', extension({ version: 2 }), /version 2/],
    ['another kind', extension({ transfer: { kind: 'quantum' } }), /kind "quantum".*diffuse/],
    ['no parts', extension({ parts: 3 }), /parts/],
    ['a list for an extension', glb({ extensions: { LAMBENT_transfer: [] } }), /not a baked file/],
  ];
  for (const [name, bytes, message] of cases) it(name, () => expect(() => checkBakedFile(bytes)).toThrow(message));

  it('what is not drawn yet, by name', () => {
    const header = { kind: 'diffuse', basis: 'sh', order: 3, channels: 1, precision: 'half', receivers: 5, bufferView: 0 };
    const read = (more: object, surface?: { kind: string }) => () => readHeader({ version: 1, transfer: { ...header, ...more }, parts: [], ...(surface && { surface }) });
    expect(read({})()).toMatchObject({ order: 3, channels: 1, receivers: 5 });
    expect(read({ lobes: [[0, 0, 1, 50]] })).toThrow(/lobes of light/);
    expect(read({ groups: ['all'] })).toThrow(/own lamps/);
    expect(read({ directional: 'hl2' })).toThrow(/directional lightmap \("hl2"\)/);
    expect(read({ cpca: { clusters: 4 } })).toThrow(/clusters \(--compress cpca\)/);
    expect(read({}, { kind: 'patches' })).toThrow(/over patches/);
    expect(read({ order: 0 })).toThrow(/"order"/);
  });

  it('cut off anywhere', () => {
    const whole = extension({});
    checkBakedFile(whole);
    for (let length = 0; length < whole.byteLength; ++length) expect(() => checkBakedFile(whole.slice(0, length)), `${length}`).toThrow(/empty|not a glTF|cut off/);
  });

  it('with any byte of the header changed never throws anything but a sentence', () => {
    const whole = new Uint8Array(extension({})), next = random(77);
    for (let i = 0; i < 4000; ++i) {
      const broken = whole.slice();
      for (let k = 0; k < 1 + (i % 3); ++k) broken[Math.floor(next() * broken.length)] = Math.floor(next() * 256);
      try {
        checkBakedFile(broken.buffer);
      } catch (error) {
        expect((error as Error).name).toBe('LambentError');
      }
    }
  });
});
