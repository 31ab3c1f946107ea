// Panes in front of a baked scene and of the sky: the page against `lambent render`.
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import { haveBrowser, launch, open, psnr, serve, type Server } from './browser.ts';
import { writeGlass } from './scenes.ts';

const camera = '0.5,1.6,6,0,1,0,40';

describe.skipIf(!haveTool || !haveBrowser)('glass', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser;

  beforeAll(async () => {
    writeLopsidedHdr(at('light.hdr'));
    writeGlass(at('glass.gltf'));
    browser = await launch();
  });
  afterAll(async () => {
    await browser?.close();
  });

  async function compare(name: string, ...args: string[]): Promise<number> {
    lambent('bake', at('glass.gltf'), ...args, '-o', at(`${name}.glb`));
    const server: Server = await serve(at(`${name}.glb`), '--env', at('light.hdr'));
    const page = await open(browser, server.address, `ui=off&camera=${camera}`, 480, 360);
    await page.screenshot({ path: at(`${name}_page.png`) });
    await page.close();
    expect(await server.stop()).toBe(0);
    const view = ['--camera', camera, '--size', '480x360', '--spp', '16'];
    renderLinear(at(`${name}.glb`), '--env', at('light.hdr'), ...view, '-o', at(`${name}_render.png`));
    const db = psnr(at(`${name}_page.png`), at(`${name}_render.png`));
    console.log(`${name}: ${db.toFixed(1)} dB (${folder})`);
    return db;
  }

  it('of diffuse transfer is that of render', async () => {
    expect(await compare('diffuse', '--samples', '512', '--bounces', '2')).toBeGreaterThan(40);
  });
  it('of a matrix is that of render', async () => {
    expect(
      await compare('matrix', '--samples', '64', '--bounces', '1', '--transfer', 'matrix', '--order', '4'),
    ).toBeGreaterThan(38);
  });
});
