// What `lambent export --three` writes, in a three.js program that has nothing of ours, against `lambent render`.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, renderLinear } from '../test/tool.ts';
import { haveBrowser, launch, openFixture, psnr } from './browser.ts';
import { writeScene } from './scenes.ts';

const camera = '3.1,2.6,4.3,-0.3,0.8,0,38',
  size = [640, 480];
const shot = ['--camera', camera, '--size', '640x480', '--spp', '16', '--background', 'none', '--exposure', '-2'];

describe.skipIf(!haveTool || !haveBrowser)('an exported lightmap', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, server: ViteDevServer, page: Page;

  beforeAll(async () => {
    const scene = writeScene(folder),
      common = [
        '--transfer',
        'lightmap',
        '--texels-per-unit',
        '12',
        '--samples',
        '128',
        '--bounces',
        '2',
        '--sky',
        'sky:elevation=25,azimuth=70',
      ];
    for (const [name, kind] of [
      ['flat', 'none'],
      ['probes', 'sh:2'],
    ] as const) {
      lambent('bake', scene, ...common, '--directional', kind, '-o', at(`${name}.glb`));
      lambent('export', at(`${name}.glb`), '--three', at(name));
      renderLinear(at(`${name}.glb`), '--show', 'radiosity', ...shot, '-o', at(`${name}.png`));
    }
    browser = await launch();
    ({ page, server } = await openFixture(browser, folder));
  });
  afterAll(async () => {
    await browser?.close();
    await server?.close();
  });

  const shown = async (name: string, pictures: string[]): Promise<string> => {
    const data = await page.evaluate(
      ([path, pictures, camera, size]) => window.scenes.lightmapped(path, pictures, camera, size, -2),
      [`/files/${name}.glb`, pictures.map((p) => `/files/${p}`), camera.split(',').map(Number), size] as const,
    );
    const path = at(`three_${pictures[0]!.replace(/\.exr$/, '')}.png`);
    writeFileSync(path, Buffer.from(data.replace(/.*,/, ''), 'base64'));
    return path;
  };

  it('is worn by the scene that comes with it, by MOZ_lightmap: its own colours under linear irradiance', async () => {
    renderLinear(at('flat.glb'), ...shot, '-o', at('product.png'));
    const data = await page.evaluate(
      ([camera, size]) => window.scenes.mozLightmapped('/files/flat.three.glb', camera, size, -2),
      [camera.split(',').map(Number), size] as const,
    );
    writeFileSync(at('moz.png'), Buffer.from(data.replace(/.*,/, ''), 'base64'));
    const db = psnr(at('moz.png'), at('product.png'));
    console.log(`MOZ_lightmap ${db.toFixed(1)} dB (${folder})`);
    expect(db).toBeGreaterThan(40);
    // A viewer that knows nothing of it finds the scene's own materials.
    const file = readFileSync(at('flat.three.glb')),
      text = file.subarray(20, 20 + file.readUInt32LE(12)).toString();
    expect(text).not.toContain('LAMBENT');
    expect((JSON.parse(text) as { extensionsUsed: string[] }).extensionsUsed).toEqual(['MOZ_lightmap']);
  });

  it('is the irradiance of a lightMap, or coefficients of a LightProbe a texel', async () => {
    const flat = psnr(await shown('flat', ['flat.exr']), at('flat.png'));
    const probes = psnr(
      await shown(
        'probes',
        [0, 1, 2, 3].map((k) => `probes.${k}.exr`),
      ),
      at('probes.png'),
    );
    console.log(`lightMap ${flat.toFixed(1)} dB, LightProbe a texel ${probes.toFixed(1)} dB (${folder})`);
    expect(flat).toBeGreaterThan(40);
    expect(probes).toBeGreaterThan(40);
  });
});
