import { describe, expect, it } from 'vitest';
import { DataUtils } from 'three';
import { blockLayout, packBlocks, type BlockHeader } from '../src/block_texture.ts';
import { replaceViews } from '../src/extension_views.ts';
import { readHeader } from '../src/header.ts';
import { checkBakedFile } from '../src/index.ts';
import { mapLayout, packMaps, readOutgoing } from '../src/outgoing.ts';
import { viewReader } from '../src/plugin.ts';
import { zonalValues } from '../src/zonal.ts';
import { random } from './tool.ts';

describe('the transfer texture', () => {
  for (const header of [
    { count: 36, channels: 3, precision: 'half', receivers: 1000 },
    { count: 25, channels: 1, precision: 'single', receivers: 37 },
    { count: 256, channels: 3, precision: 'half', receivers: 5000 }, // more than one layer
    { count: 1, channels: 1, precision: 'half', receivers: 1 },
  ] as BlockHeader[])
    it(`holds every value where the shader looks: ${JSON.stringify(header)}`, () => {
      const { count, channels, receivers } = header,
        blocks = Math.ceil(receivers / 16),
        next = random(count);
      const length = blocks * channels * count * 16,
        values = header.precision === 'half' ? new Uint16Array(length) : new Float32Array(length);
      for (let i = 0; i < length; ++i) values[i] = Math.floor(65000 * next());
      const { layout, data } = packBlocks(header, values.buffer);
      expect(data.length).toBe(4 * layout.width * layout.height * layout.layers);
      expect(Math.max(layout.width, layout.height)).toBeLessThanOrEqual(2048);
      for (let i = 0; i < 5000; ++i) {
        const r = Math.floor(next() * receivers),
          c = Math.floor(next() * channels),
          k = Math.floor(next() * count);
        const x = (r % layout.columns) * layout.texels + c * layout.quads + (k >> 2);
        const y = Math.floor(r / layout.columns) % layout.rows,
          layer = Math.floor(r / (layout.columns * layout.rows));
        const texel = data[4 * ((layer * layout.height + y) * layout.width + x) + (k & 3)];
        expect(texel).toBe(values[(((r >> 4) * channels + c) * count + k) * 16 + (r & 15)]);
      }
    });

  it('keeps to what WebGL2 promises for two million receivers of any order', () => {
    for (let order = 1; order <= 16; ++order) {
      const { width, height, layers } = blockLayout({
        count: order * order,
        channels: 3,
        precision: 'half',
        receivers: 2_000_000,
      });
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
    expect(() => packBlocks({ count: 4, channels: 1, precision: 'half', receivers: 17 }, new ArrayBuffer(128))).toThrow(
      /128 bytes.*256/,
    );
  });

  it('uploads bits of half floats as they are', () => {
    const half = DataUtils.toHalfFloat(-0.3125),
      values = new Uint16Array(16).fill(half);
    expect(packBlocks({ count: 1, channels: 1, precision: 'half', receivers: 16 }, values.buffer).data[0]).toBe(half);
  });
});

describe('zonal values', () => {
  // docs/zonal.md: bytes a vertex in half floats, grey, order 6.
  it('take the bytes of the docs', () =>
    expect([1, 2, 3, 4, 5, 6].map((lobes) => 2 * zonalValues(6, lobes, 1))).toEqual([18, 34, 50, 64, 78, 92]));
});

describe('view maps', () => {
  it('lie as tiles where the shader looks', () => {
    const grid = 64,
      maps = 5,
      rows = 25,
      next = random(3),
      values = Uint16Array.from({ length: 4 * maps * grid * grid * rows }, () => Math.floor(65535 * next()));
    const { across, width, height } = mapLayout(grid, maps, rows),
      out = packMaps(grid, maps, rows, values);
    expect(out.length).toBe(4 * width * height);
    expect(width).toBeLessThanOrEqual(4096);
    for (let i = 0; i < 2000; ++i) {
      const [m, y, x, r, c] = [maps, grid, grid, rows, 4].map((n) => Math.floor(next() * n)) as [
          number,
          number,
          number,
          number,
          number,
        ],
        tile = m * rows + r;
      const px = (tile % across) * grid + x,
        py = Math.floor(tile / across) * grid + y;
      expect(out[4 * (py * width + px) + c]).toBe(values[4 * (((m * grid + y) * grid + x) * rows + r) + c]);
    }
  });

  it('are refused where they do not fit', () => {
    const map = { kind: 'map', order: 5, grid: 64, mapCount: 3, maps: 1, mapOf: 2, frames: 3 };
    const read =
      (outgoing: unknown, rows: unknown = 25) =>
      () =>
        readOutgoing({ kind: 'matrix', rows, outgoing });
    expect(read(map)()).toMatchObject({ rows: 25, outgoing: { kind: 'map', grid: 64, maps: 3 } });
    expect(read({ kind: 'sh', order: 4 }, 32)()).toMatchObject({ rows: 32, outgoing: { hasB: true } });
    expect(read(undefined)).toThrow(/no "outgoing"/);
    expect(read({ ...map, kind: 'wavelets' })).toThrow(/"wavelets"/);
    expect(read({ ...map, grid: 1 })).toThrow(/no size/);
    expect(read({ ...map, grid: 1e9 })).toThrow(/no size/);
    expect(read({ ...map, mapCount: 0 })).toThrow(/no size/);
    expect(read(map, 0)).toThrow(/"rows"/);
    expect(read(map, 1e6)).toThrow(/"rows"/);
    expect(read({ kind: 'sh', order: 4 }, 31)).toThrow(/does not fit/);
    expect(read({ kind: 'phong', order: 17 }, 31)).toThrow(/order/);
  });
});

/** A GLB with this JSON and no binary chunk. */
function glb(json: unknown): ArrayBuffer {
  const text = JSON.stringify(json).padEnd(Math.ceil(JSON.stringify(json).length / 4) * 4),
    bytes = new Uint8Array(20 + text.length),
    view = new DataView(bytes.buffer);
  [0x46546c67, 2, bytes.length, text.length, 0x4e4f534a].forEach((v, i) => view.setUint32(4 * i, v, true));
  bytes.set(new TextEncoder().encode(text), 20);
  return bytes.buffer;
}

/** Plain .gltf. */
const gltf = (json: unknown): ArrayBuffer => new TextEncoder().encode(JSON.stringify(json)).buffer;

describe('a .gltf with its data in several files', () => {
  const document = (bufferView: unknown, ...more: object[]): object => ({
    asset: { version: '2.0' },
    buffers: [{ byteLength: 8 }, { byteLength: 4 }],
    bufferViews: [
      { buffer: 0, byteLength: 4 },
      { buffer: 0, byteOffset: 4, byteLength: 4 },
      { buffer: 1, byteLength: 4 },
    ],
    extensions: {
      LAMBENT_transfer: {
        version: 1,
        transfer: { kind: 'diffuse', bufferView },
        parts: [{ node: 0, primitive: 0, front: [1, 2] }],
      },
    },
    ...(Object.assign({}, ...more) as object),
  });

  it('is checked as a .glb is', () => {
    expect(checkBakedFile(gltf(document([0, 1, 2])))).toMatchObject({ asset: { version: '2.0' } });
    expect(() => checkBakedFile(gltf(document([0, 3])))).toThrow(/rewritten/);
    expect(() => checkBakedFile(gltf(document([0, 2], { images: [{ bufferView: 2 }] })))).toThrow(/rewritten/);
    expect(() => checkBakedFile(gltf({ asset: {} }))).toThrow(/not a baked file/);
    expect(() => checkBakedFile(new TextEncoder().encode('{"asset": ').buffer)).toThrow(/JSON/);
  });

  it('has each of its views carried', () => {
    const extension = (document([0, 1, 2]) as { extensions: { LAMBENT_transfer: Record<string, unknown> } }).extensions
      .LAMBENT_transfer;
    expect(replaceViews(extension, (view) => view + 10)['transfer']).toEqual({
      kind: 'diffuse',
      bufferView: [10, 11, 12],
    });
  });

  const header = { kind: 'diffuse', basis: 'sh', order: 1, channels: 1, precision: 'half', receivers: 16 };
  const read = (bufferView: unknown) => () =>
    readHeader({ version: 1, transfer: { ...header, bufferView }, parts: [] }).bufferView;

  it('has a list of views in its header', () => {
    expect(read([4, 5])()).toEqual([4, 5]);
    for (const wrong of [[], [4, -1], ['4'], null, 1.5]) expect(read(wrong)).toThrow(/bufferView/);
  });

  it('is read by the plugin, view after view', async () => {
    const bytes = (values: number[]): ArrayBuffer => new Uint8Array(values).buffer;
    const views = [bytes([1, 2]), bytes([3]), bytes([4, 5, 6])];
    const read = viewReader({
      json: document([0, 1, 2]),
      getDependency: (_: string, index: number) => Promise.resolve(views[index]),
    });
    expect([...new Uint8Array(await read([2, 0, 1]))]).toEqual([4, 5, 6, 1, 2, 3]);
    expect(await read(1)).toBe(views[1]);
    await expect(read([0, 3])).rejects.toThrow(/buffer view 3 does not exist/);
  });
});

describe('files that are not what they should be', () => {
  const transfer = { kind: 'diffuse' },
    extension = (e: object) => glb({ extensions: { LAMBENT_transfer: { version: 1, transfer, parts: [], ...e } } });
  const cases: [string, ArrayBuffer, RegExp][] = [
    ['empty', new ArrayBuffer(0), /is empty/],
    ['text', new TextEncoder().encode('hello, world, this is text').buffer, /is not a glTF/],
    ['no extension', glb({ asset: { version: '2.0' } }), /not a baked file/],
    ['another version', extension({ version: 2 }), /version 2/],
    ['another kind', extension({ transfer: { kind: 'quantum' } }), /kind "quantum".*diffuse/],
    ['no parts', extension({ parts: 3 }), /parts/],
    ['a list for an extension', glb({ extensions: { LAMBENT_transfer: [] } }), /not a baked file/],
  ];
  for (const [name, bytes, message] of cases) it(name, () => expect(() => checkBakedFile(bytes)).toThrow(message));

  it('what is not drawn yet, by name', () => {
    const header = {
      kind: 'diffuse',
      basis: 'sh',
      order: 3,
      channels: 1,
      precision: 'half',
      receivers: 5,
      bufferView: 0,
    };
    const read = (more: object, surface?: { kind: string }) => () =>
      readHeader({ version: 1, transfer: { ...header, ...more }, parts: [], ...(surface && { surface }) });
    expect(read({})()).toMatchObject({ order: 3, channels: 1, receivers: 5 });
    expect(read({ order: 16, lobes: [[0, 0, 1, 50]], lobeKind: 'compact' })).toThrow(/257 columns of light/);
    expect(read({ groups: ['all'] })).toThrow(/own lamps/);
    expect(read({ directional: 'hl2' })).toThrow(/directional light \("hl2"\)/);
    expect(read({}, { kind: 'patches' })).toThrow(/over patches/);
    expect(read({ order: 0 })).toThrow(/"order"/);
  });

  it('cut off anywhere', () => {
    const whole = extension({});
    checkBakedFile(whole);
    for (let length = 0; length < whole.byteLength; ++length)
      expect(() => checkBakedFile(whole.slice(0, length)), `${length}`).toThrow(/empty|not a glTF|cut off/);
  });

  it('with any byte of the header changed never throws anything but a sentence', () => {
    const whole = new Uint8Array(extension({})),
      next = random(77);
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
