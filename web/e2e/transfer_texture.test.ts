// A texture of zonal lobes on a mesh, in a three.js program, against `lambent render --transfer-texture`.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { readTransferTexture } from '../src/transfer_texture.ts';
import { haveTool, lambent, lambentJson, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import { drawn, haveBrowser, launch, open, openFixture, psnr, serve } from './browser.ts';
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

  it('is worn by the scene in the page, which opens it, with sliders for how it is laid', async () => {
    lambent('patch', '--groove', '1', '--size', '16', '-o', at('grooves.lpt'));
    lambent('bake', at('mesh.gltf'), '--samples', '64', '--order', '6', '-o', at('worn.glb'));
    const site = await serve(at('worn.glb'), '--env', at('light.hdr')),
      view = `ui=off&background=none&camera=${camera}&rotate=${rotate}&window=none&exposure=1`,
      shown = await open(browser, site.address, view, 640, 480);
    const truth = (name: string, ...worn: string[]): string => {
      renderLinear(
        ...[at('mesh.gltf'), '--transfer-texture', at(`${name}.lpt`), ...worn, '--env', at('light.hdr')],
        ...['--env-rotate', rotate, '--camera', camera, '--size', size.join('x'), '--spp', '16'],
        ...['--background', 'none', '--exposure=1', '-o', at(`${name}_page_render.png`)],
      );
      return at(`${name}_page_render.png`);
    };
    const wear = async (name: string, values: Record<string, number>): Promise<string> => {
      await shown.setInputFiles('#file', at(`${name}.lpt`));
      await shown.waitForFunction(() => location.hash.includes('view=relief'));
      for (const [id, value] of Object.entries(values))
        await shown.$eval(
          `#${id}`,
          (slider, value) => {
            (slider as HTMLInputElement).value = String(value);
            slider.dispatchEvent(new Event('input', { bubbles: true }));
          },
          value,
        );
      await drawn(shown);
      await shown.screenshot({ path: at(`${name}_page.png`) });
      return at(`${name}_page.png`);
    };
    const relief = psnr(await wear('bumps_4', { 'tile-u': 2, 'tile-v': 1.5 }), truth('bumps_4', '--tile', '2,1.5'));
    const laid = ['--tile', '2,6', '--groove-depth', '0.6', '--groove-width', '0.8'],
      sliders = { 'tile-u': 2, 'tile-v': 6, 'groove-depth': 0.6, 'groove-width': 0.8 },
      grooves = psnr(await wear('grooves', sliders), truth('grooves', ...laid));
    console.log(`the page: relief ${relief.toFixed(1)}, grooves ${grooves.toFixed(1)} dB (${folder})`);
    expect(Math.min(relief, grooves)).toBeGreaterThan(40);
    await shown.close();

    const page = await open(browser, site.address, '', 900, 700);
    await page.click('#more summary');
    expect(await page.isVisible('#relief')).toBe(false);
    await page.setInputFiles('#file', at('bumps_4.lpt'));
    await page.waitForSelector('#relief:not([hidden])');
    expect(await page.isVisible('#groove-depth')).toBe(false);
    expect(await page.inputValue('#view')).toBe('relief');
    await page.screenshot({ path: at('relief_controls.png') });
    writeFileSync(at('broken.lpt'), readFileSync(at('bumps_4.lpt')).subarray(0, 1000));
    await page.setInputFiles('#file', at('broken.lpt'));
    await page.waitForSelector('#problem:not([hidden])');
    expect(await page.textContent('#problem-text')).toMatch(/broken\.lpt.*bytes/);
    await page.close();
    expect(await site.stop()).toBe(0);
  });

  it('is refused in a sentence where it is none', () => {
    const file = new Uint8Array(readFileSync(at('bumps_4.lpt'))),
      read = (change: (bytes: Uint8Array) => Uint8Array | void) => () => {
        const bytes = file.slice();
        readTransferTexture((change(bytes) ?? bytes).slice().buffer);
      };
    expect(read(() => new Uint8Array(0))).toThrow(/is not a texture/);
    expect(read((b) => b.subarray(0, 100))).toThrow(/36 bytes/);
    expect(read((b) => b.set([51], 7))).toThrow(/another version/);
    expect(read((b) => b.set([1], 32))).toThrow(/grooves have no depth/);
    expect(read((b) => b.set([2], 32))).toThrow(/kind that is not known/);
    expect(read((b) => b.set([50], 7))).toThrow(/seen from views/);
    expect(read((b) => b.set([0, 0, 0, 0], 8))).toThrow(/width or height/);
    expect(read((b) => b.set([99], 16))).toThrow(/order, lobes/);
    expect(read((b) => b.set([3], 28))).toThrow(/precision/);
    expect(read((b) => b.set([255, 255, 255, 255], 8))).toThrow(/width or height/);
  });
});
