// Wavelets: the transform against its definition, columns against what the tool makes of the same file, and files that
// lie about theirs.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { describe, expect, it } from 'vitest';
import { readMap } from '../page/loading.ts';
import { haarOfLight, haarTransform, HaarColumns, type HaarHeader } from '../src/haar.ts';
import { Lighting } from '../src/lighting.ts';
import { haveTool, lambent, makeFolder, random, readPacked, writeLopsidedHdr } from './tool.ts';

describe('the Haar transform', () => {
  it('is that of wavelets by their definition', () => {
    const size = 8,
      next = random(1),
      pixels = Float64Array.from({ length: size * size }, () => next() - 0.3),
      found = haarTransform(size, pixels);
    // A constant, and on each square of side 2^-l three wavelets of height 2^l (basis/haar.h).
    let at = 0;
    const expected = [pixels.reduce((sum, v) => sum + v) / pixels.length];
    for (let level = 0; 1 << level < size; ++level)
      for (let i = 0; i < 4 ** level; ++i) {
        let [x0, y0] = [0, 0];
        for (let bit = 0; bit < level; ++bit) {
          x0 |= ((i >> (2 * bit)) & 1) << bit;
          y0 |= ((i >> (2 * bit + 1)) & 1) << bit;
        }
        const side = size >> level;
        const signs: ((x: number, y: number) => number)[] = [(x) => x, (_, y) => y, (x, y) => x * y];
        for (const sign of signs) {
          let sum = 0;
          for (let y = 0; y < side; ++y)
            for (let x = 0; x < side; ++x)
              sum +=
                pixels[(y0 * side + y) * size + x0 * side + x]! * sign(x < side / 2 ? 1 : -1, y < side / 2 ? 1 : -1);
          expected.push((sum * 2 ** level) / size ** 2);
        }
      }
    for (const v of expected) expect(found[at++]).toBeCloseTo(v, 12);
    expect(at).toBe(found.length);
    const squares = (of: Float64Array): number => of.reduce((sum, v) => sum + v * v, 0);
    expect(squares(found)).toBeCloseTo(squares(pixels) / pixels.length, 12);
  });
});

/** A column: receivers of tiles and their values, as docs/file-format.md has them. */
function column(tiles: [number, number[] | [number, number][]][]): number[] {
  const bits = new Array<number>(8).fill(0),
    rest: number[] = [];
  for (const [t, values] of tiles) {
    bits[t >> 3]! |= 1 << (t & 7);
    if (Array.isArray(values[0])) rest.push(values.length, ...(values as [number, number][]).flat());
    else rest.push(0, ...(values as number[]));
  }
  return [...bits, ...rest];
}
const size = 16,
  width = 6 * size * size;
interface Parts {
  header: HaarHeader;
  data: number[];
  lengths: number[];
  steps: Float32Array;
}
/** 70 receivers: a whole tile and six more; column 1 of the first, column 5 of both. */
function parts(): Parts {
  const first = column([[0, Array.from({ length: 64 }, (_, i) => i)]]),
    both = column([
      [
        0,
        [
          [3, 7],
          [63, 253],
        ],
      ],
      [1, [[5, 2]]],
    ]),
    lengths = new Array<number>(width).fill(0),
    steps = new Float32Array(width);
  lengths[1] = first.length;
  lengths[5] = both.length;
  steps[1] = 0.5;
  steps[5] = 2;
  return { header: { size, channels: 1, receivers: 70 }, data: [...first, ...both], lengths, steps };
}
const make = ({ header, data, lengths, steps }: Parts): HaarColumns =>
  new HaarColumns(header, Uint8Array.from(data), Uint8Array.from(lengths), steps);

describe('columns of wavelets', () => {
  it('are summed where the light wakes them, the largest by what they change', () => {
    const columns = make(parts()),
      light = new Float32Array(3 * width),
      out = new Float32Array(4 * 70);
    light.set([1, 2, 3], 3);
    light.set([0.1, 0, 0], 15);
    light.set([9, 9, 9], 21); // of no receiver
    expect(columns.terms(light, 0).columns).toEqual(Uint32Array.from([1, 5]));
    expect(columns.terms(light, 1).columns).toEqual(Uint32Array.from([1]));
    expect(columns.terms(light, 0, 80).columns).toEqual(Uint32Array.from([1])); // of 73 bytes, and 16
    columns.sum(columns.terms(light, 0), out);
    const at = (r: number): number[] => Array.from(out.subarray(4 * r, 4 * r + 3));
    expect(at(10)).toEqual([5, 10, 15]);
    expect(at(3)[0]).toBeCloseTo(1.5 + 1.4, 5);
    expect(at(63)[0]).toBeCloseTo(31.5 - 0.6, 5);
    expect(at(69)[0]).toBeCloseTo(0.4, 6);
    expect(at(68)).toEqual([0, 0, 0]);
    light.fill(-1);
    columns.sum(columns.terms(light, 0), out);
    expect(Math.min(...out)).toBe(0); // light is not negative
  });

  const broken: [string, RegExp, (of: Parts) => void][] = [
    ['a step that is no number', /step of a column is no number/, ({ steps }) => (steps[7] = NaN)],
    ['a step below 0', /step of a column is no number/, ({ steps }) => (steps[7] = -1)],
    ['an endless step', /step of a column is no number/, ({ steps }) => (steps[7] = Infinity)],
    ['fewer steps than columns', /1535 steps are there/, (of) => (of.steps = of.steps.subarray(1))],
    ['fewer lengths than columns', /fewer lengths than columns/, ({ lengths }) => lengths.pop()],
    ['lengths without an end', /fewer lengths than columns/, ({ lengths }) => (lengths[width - 1] = 128)],
    ['more lengths than columns', /more lengths than columns/, ({ lengths }) => lengths.push(0)],
    ['a length beyond the data', /longer than what is there/, ({ lengths }) => (lengths[9] = 127)],
    [
      'a length beyond numbers',
      /longer than what is there/,
      ({ lengths }) => lengths.splice(9, 1, 255, 255, 255, 255, 255, 127),
    ],
    ['data beyond the lengths', /lengths make 89/, ({ data }) => data.push(0)],
    ['receivers by the thousand million', /fewer lengths than columns/, ({ header }) => (header.receivers = 4e9)],
    ['a tile beyond the receivers', /column 1 .*goes beyond/, ({ data }) => ((data[0] = 0), (data[1] = 1))],
    ['a receiver beyond them', /column 5 /, ({ data }) => (data[73 + 14] = 6)],
    ['receivers that do not rise', /column 5 /, ({ data }) => (data[73 + 11] = 3)],
    ['a count beyond the column', /column 5 /, ({ data }) => (data[73 + 8] = 200)],
    ['a tile more than it has', /column 5 /, ({ data }) => (data[73] = 7)],
    ['a tile less than it has', /column 5 /, ({ data }) => (data[73] = 1)],
    ['a column of its tiles alone', /column 0 /, ({ lengths }) => ((lengths[0] = 8), (lengths[1]! -= 8))],
  ];
  for (const [name, why, change] of broken)
    it(`are refused in a sentence: ${name}`, () => {
      const of = parts();
      change(of);
      expect(() => make(of)).toThrow(why);
      expect(() => make(of)).toThrow(/^holds broken wavelets: /);
    });
});

describe.skipIf(!haveTool)('wavelets of the tool', () => {
  it('are summed to the numbers of render, by few terms and by all', () => {
    const folder = makeFolder(),
      at = (name: string): string => join(folder, name);
    writeLopsidedHdr(at('light.hdr'));
    writeFileSync(at('corner.mtl'), 'newmtl copper\nKd 0.8 0.4 0.2\n');
    const corner = 'v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv -1 1 -1\nv 1 1 -1\nf 4 3 2 1\nf 1 2 6 5\n';
    writeFileSync(at('grey.obj'), corner);
    writeFileSync(at('coloured.obj'), `mtllib corner.mtl\nusemtl copper\n${corner}`);
    const camera = '2,2.5,3,0,0.3,0,40',
      light = Lighting.fromMap(readMap(Uint8Array.from(readFileSync(at('light.hdr'))).buffer), 2);
    for (const [name, more] of [
      ['grey', []],
      ['coloured', ['--bounces', '1', '--samples', '16']],
    ] as [string, string[]][]) {
      lambent(
        ...['bake', at(`${name}.obj`), '--max-edge', '0.3', '--light', 'haar:16', ...more],
        ...['--fix-view', camera, '--size', '24x18', '--spp', '4', '-o', at(`${name}.glb`)],
      );
      const { document, view } = readPacked(at(`${name}.glb`)),
        transfer = document.extensions.LAMBENT_transfer.transfer as unknown as Record<string, number>,
        columns = new HaarColumns(
          { size: transfer['cube']!, channels: (transfer['channels'] ?? 1) as 1 | 3, receivers: 24 * 18 },
          new Uint8Array(view(transfer['bufferView']!)),
          new Uint8Array(view(transfer['lengths']!)),
          new Float32Array(view(transfer['steps']!)),
        ),
        out = new Float32Array(4 * 24 * 18);
      for (const terms of [0, 12]) {
        columns.sum(columns.terms(haarOfLight(light.onCube(16)), terms), out);
        lambent(
          ...['render', at(`${name}.glb`), '--env', at('light.hdr'), '--background', 'none'],
          ...['--terms', String(terms), '-o', at('render.exr')],
        );
        const { data, channels } = readMap(Uint8Array.from(readFileSync(at('render.exr'))).buffer);
        let [off, all] = [0, 0];
        for (let i = 0; i < 24 * 18; ++i)
          for (let c = 0; c < 3; ++c) {
            off += (out[4 * i + c]! - data[channels * i + c]!) ** 2;
            all += data[channels * i + c]! ** 2;
          }
        expect(all).toBeGreaterThan(0.1);
        console.log(`${name}, ${terms} terms: ${Math.sqrt(off / all)} of the light's RMS off`);
        // Pictures are in half floats, 2^-12 of a value on average; sums here are in single ones.
        expect(Math.sqrt(off / all)).toBeLessThan(5e-4);
      }
    }
  });
});
