// A texture of zonal lobes on a mesh, in a three.js program, against `lambent render --transfer-texture`.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { readTransferTexture } from '../src/transfer_texture.ts';
import { haveTool, lambent, lambentJson, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import { haveBrowser, launch, openFixture, psnr } from './browser.ts';
import { png, writeBumpy } from './scenes.ts';

const camera = '1.6,1.5,2.2,-0.1,0.4,-0.2,40',
  size = [640, 480],
  rotate = '40,-25,70',
  tile = [2, 1.5],
  exposure = 1;

describe.skipIf(!haveTool || !haveBrowser)('a transfer texture', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, server: ViteDevServer, page: Page;

  beforeAll(async () => {
    writeLopsidedHdr(at('light.hdr'));
    writeBumpy(at('mesh.gltf'));
    // A relief that is the same under no turn and no mirror.
    const wave = (x: number, y: number): number =>
      0.5 + 0.25 * Math.sin((2 * Math.PI * x) / 32) + 0.2 * Math.cos((2 * Math.PI * (x + 2 * y)) / 32 + 0.7);
    writeFileSync(
      at('heights.png'),
      png(32, 32, (x, y) => [wave(x, y), wave(x, y), wave(x, y)]),
    );
    browser = await launch();
    ({ page, server } = await openFixture(browser, folder));
  });
  afterAll(async () => {
    await browser?.close();
    await server?.close();
  });

  for (const [lobes, order] of [
    [2, 5],
    [4, 6],
  ] as const)
    it(`is shaded by its table as render shades it: ${lobes} lobes, order ${order}`, async () => {
      const name = `bumps_${lobes}`;
      lambent(
        'patch',
        at('heights.png'),
        '--depth',
        '0.25',
        '--size',
        '32',
        '--samples',
        '128',
        '--lobes',
        String(lobes),
        '--order',
        String(order),
        '-o',
        at(`${name}.lpt`),
      );
      renderLinear(
        at('mesh.gltf'),
        '--transfer-texture',
        at(`${name}.lpt`),
        '--tile',
        tile.join(),
        '--env',
        at('light.hdr'),
        '--env-rotate',
        rotate,
        '--camera',
        camera,
        '--size',
        size.join('x'),
        '--spp',
        '16',
        '--background',
        'none',
        `--exposure=${exposure}`,
        '-o',
        at(`${name}.png`),
      );
      const light = (
        lambentJson('env', at('light.hdr'), '--env-rotate', rotate, '--order', String(order)) as {
          coefficients: number[][];
        }
      ).coefficients.flat();
      const data = await page.evaluate(
        ([name, tile, light, camera, size, exposure]) =>
          window.scenes.textured('/files/mesh.gltf', `/files/${name}.lpt`, tile, light, camera, size, exposure),
        [name, tile, light, camera.split(',').map(Number), size, exposure] as const,
      );
      writeFileSync(at(`three_${name}.png`), Buffer.from(data.replace(/.*,/, ''), 'base64'));
      const db = psnr(at(`three_${name}.png`), at(`${name}.png`));
      console.log(`transfer texture, ${lobes} lobes of order ${order}: ${db.toFixed(1)} dB (${folder})`);
      expect(db).toBeGreaterThan(40);
    });

  it('is refused in a sentence where it is none', () => {
    const file = new Uint8Array(readFileSync(at('bumps_4.lpt'))),
      read = (change: (bytes: Uint8Array) => Uint8Array | void) => () => {
        const bytes = file.slice();
        readTransferTexture((change(bytes) ?? bytes).slice().buffer);
      };
    expect(read(() => new Uint8Array(0))).toThrow(/is not a texture/);
    expect(read((b) => b.subarray(0, 100))).toThrow(/36 bytes/);
    expect(read((b) => b.set([50], 7))).toThrow(/another version/);
    expect(read((b) => b.set([1], 32))).toThrow(/grooves/);
    expect(read((b) => b.set([0, 0, 0, 0], 8))).toThrow(/width or height/);
    expect(read((b) => b.set([99], 16))).toThrow(/order, lobes/);
    expect(read((b) => b.set([3], 28))).toThrow(/precision/);
    expect(read((b) => b.set([255, 255, 255, 255], 8))).toThrow(/width or height/);
  });
});
