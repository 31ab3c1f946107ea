// What `lambent export --web --pack` writes comes back: integers to the bit, transfer and vertices within what is
// stated; and what was spoilt on its way is refused in a sentence.
import { execFileSync } from 'node:child_process';
import { statSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { NodeIO } from '@gltf-transform/core';
import { DataUtils } from 'three';
import { describe, expect, it } from 'vitest';
import { LambentTransfer } from '../src/gltf_transform/index.ts';
import { unpackView } from '../src/packed_views.ts';
import { haveTool, lambent, makeFolder, readPacked as read, toolPath } from './tool.ts';

/** A hilly grid, with a quarter of its vertices above a lid. */
function writeHills(path: string): void {
  const n = 48,
    lines: string[] = [];
  for (let j = 0; j <= n; ++j)
    for (let i = 0; i <= n; ++i) lines.push(`v ${i / 8} ${Math.sin(i / 3) * Math.cos(j / 5)} ${j / 8}`);
  const at = (i: number, j: number): number => j * (n + 1) + i + 1;
  for (let j = 0; j < n; ++j)
    for (let i = 0; i < n; ++i) lines.push(`f ${at(i, j)} ${at(i, j + 1)} ${at(i + 1, j + 1)} ${at(i + 1, j)}`);
  writeFileSync(path, lines.join('\n'));
}

describe.skipIf(!haveTool)('a packed file', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  writeHills(at('hills.obj'));
  lambent('bake', at('hills.obj'), '--samples', '256', '-o', at('hills.glb'));
  lambent('export', at('hills.glb'), '--web', at('site'), '--pack', '0.005');
  const plain = read(at('hills.glb')),
    packed = read(at('site/data/scene.glb'));
  const back = (index: number): ArrayBuffer => {
    const given = packed.document.bufferViews[index]!.extensions?.LAMBENT_transfer;
    return given ? unpackView(packed.view(index), given) : packed.view(index);
  };

  it('is a third as large, and says what is needed to read it', () => {
    const [before, after] = [at('hills.glb'), at('site/data/scene.glb')].map((path) => statSync(path).size) as [
      number,
      number,
    ];
    console.log(`hills: ${before} bytes, packed ${after}`);
    expect(after).toBeLessThan(before / 3);
    expect(packed.document.extensionsRequired).toEqual(['LAMBENT_transfer']);
  });

  it('keeps integers, and numbers to within their steps', () => {
    expect(packed.document.bufferViews.length).toBe(plain.document.bufferViews.length);
    const isPacked = packed.document.bufferViews.map((view) => view.extensions?.LAMBENT_transfer);
    expect(isPacked.filter((found) => found?.form === 'u32').length).toBeGreaterThan(1);
    expect(isPacked.filter((found) => found?.form === 'floats').length).toBe(2);
    plain.document.bufferViews.forEach((_, i) => {
      const [one, two] = [plain.view(i), back(i)],
        form = isPacked[i]?.form;
      expect(two.byteLength).toBe(one.byteLength);
      if (form === 'floats') {
        const [a, b] = [new Float32Array(one), new Float32Array(two)];
        expect(Math.max(...a.map((v, k) => Math.abs(v - b[k]!)))).toBeLessThanOrEqual(0.5001 * isPacked[i]!.step!);
      } else if (form !== 'half blocks') expect(new Uint8Array(two)).toEqual(new Uint8Array(one));
    });
  });

  it('has the error that it states, which is what was asked for', () => {
    const { transfer, packed: stated } = packed.document.extensions.LAMBENT_transfer,
      values = (buffer: ArrayBuffer): number[] =>
        Array.from(new Uint16Array(buffer), (bits) => DataUtils.fromHalfFloat(bits)),
      [a, b] = [values(plain.view(transfer.bufferView)), values(back(transfer.bufferView))];
    const off = Math.sqrt(a.reduce((sum, v, i) => sum + (v - b[i]!) ** 2, 0) / a.reduce((sum, v) => sum + v * v, 0));
    expect(Math.abs(off - stated!.error)).toBeLessThan(1e-5);
    expect(off).toBeGreaterThan(0.003);
    expect(off).toBeLessThan(0.0055);
  });

  it('is refused where it was spoilt', () => {
    const index = packed.document.extensions.LAMBENT_transfer.transfer.bufferView,
      given = packed.document.bufferViews[index]!.extensions!.LAMBENT_transfer!;
    for (const [bytes, description] of [
      [packed.view(index).slice(0, -1), given],
      [packed.view(index).slice(100), given],
      [new ArrayBuffer(0), given],
      [packed.view(index), { ...given, rows: 1e9, byteLength: 2e9 }],
      [packed.view(index), { ...given, columns: 35 }],
      [packed.view(index), { ...given, form: 'u32' }],
      [packed.view(index), { ...given, form: 'else' }],
      [packed.view(index), {}],
    ] as const)
      expect(() => unpackView(bytes, description)).toThrow(/does not fit its description/);
    // Whatever a byte is, it is numbers or a sentence.
    const bytes = new Uint8Array(packed.view(index));
    for (let i = 0; i < 60; ++i) {
      const spoilt = bytes.slice();
      spoilt[(i * 7919) % spoilt.length]! ^= 1 << (i % 8);
      try {
        unpackView(spoilt.buffer, given);
      } catch (error) {
        expect(String(error)).toMatch(/does not fit its description/);
      }
    }
  });

  it('is for browsers: glTF Transform says so', async () => {
    const io = new NodeIO().registerExtensions([LambentTransfer]);
    await expect(io.read(at('site/data/scene.glb'))).rejects.toThrow(/packed for browsers/);
  });

  it('is for browsers: commands say so, as they do of what cannot be packed', () => {
    const say = (...args: string[]): string => {
      try {
        execFileSync(toolPath, args, { stdio: ['ignore', 'pipe', 'pipe'] });
        return '';
      } catch (error) {
        return String((error as { stderr: Buffer }).stderr);
      }
    };
    expect(say('inspect', at('site/data/scene.glb'))).toMatch(/packed for browsers/);
    lambent('compress', at('hills.glb'), '--zonal', '2', '-o', at('lobes.glb'));
    expect(say('export', at('lobes.glb'), '--web', at('other'), '--pack', 'auto')).toMatch(/--pack takes dense/);
    expect(say('export', at('hills.glb'), '--web', at('other'), '--pack', '7')).toMatch(/--pack: must be auto or/);
  });
});
