// Remakes the pictures of docs/web.md: `npm run screenshots`. Needs the tool, Chromium, the built page, and the data
// folder (LAMBENT_DATA, or shared/data beside the repository).
import { existsSync, statSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import type { Browser, BrowserContextOptions, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder } from '../test/tool.ts';
import { drawn, haveBrowser, launch, ready, serve } from './browser.ts';

const data = process.env['LAMBENT_DATA'] ?? fileURLToPath(new URL('../../../shared/data', import.meta.url));
const haveData = existsSync(data);
if (!haveData) console.warn(`skipped: there is no ${data}`);
const images = fileURLToPath(new URL('../../docs/images', import.meta.url));
const mostBytes = 120_000;

describe.skipIf(!haveTool || !haveBrowser || !haveData)(
  'screenshots',
  () => {
    const folder = makeFolder(),
      at = (name: string): string => join(folder, name),
      mesh = (name: string): string => join(data, 'meshes', name);
    const environment = (name: string): string => join(data, 'environments', `${name}_1k.hdr`);
    let browser: Browser;
    beforeAll(async () => void (browser = await launch()));
    afterAll(async () => browser?.close());

    async function shoot(
      name: string,
      args: string[],
      fragment: string,
      context: BrowserContextOptions,
      prepare?: (page: Page) => Promise<void>,
    ): Promise<void> {
      const server = await serve(...args),
        page = await (await browser.newContext(context)).newPage();
      await page.goto(`${server.address}#${fragment}&exposure=0&tone=none`); // the first of a name counts
      await ready(page);
      await prepare?.(page);
      await drawn(page);
      // Times of a software renderer would mislead.
      await page.evaluate(() => (document.getElementById('figures')!.textContent = ''));
      const path = join(images, name);
      let quality = 90;
      do await page.screenshot({ path, type: 'jpeg', quality });
      while (statSync(path).size > mostBytes && (quality -= 5) > 40);
      expect(statSync(path).size).toBeLessThanOrEqual(mostBytes);
      await page.context().close();
      await server.stop();
    }
    const desk: BrowserContextOptions = { viewport: { width: 900, height: 560 }, colorScheme: 'light' };

    it('the bunny', async () => {
      lambent(
        'bake',
        mesh('bunny.obj'),
        '--ground',
        '--order',
        '5',
        '--samples',
        '256',
        '--bounces',
        '1',
        '-o',
        at('bunny.glb'),
      );
      const scene = [at('bunny.glb'), '--env', environment('chinese_garden')];
      await shoot('web_bunny.jpg', scene, 'against=unshadowed&exposure=-1', desk);
      await shoot('web_phone.jpg', scene, 'exposure=-1', {
        viewport: { width: 390, height: 600 },
        deviceScaleFactor: 2,
        isMobile: true,
        hasTouch: true,
        colorScheme: 'dark',
      });
    });

    it('the courtyard', async () => {
      lambent('demo', '--spp', '1', '--detail', '0.5', '-o', at('demo'));
      await shoot(
        'web.jpg',
        [at('demo/courtyard.glb'), '--env', 'sky:elevation=12,azimuth=35'],
        'camera=0.95,1.95,7.6,-0.05,1.42,-0.3,35&exposure=-1',
        desk,
      );
    });

    it('a walking man', async () => {
      lambent(
        'bake',
        mesh('CesiumMan.glb'),
        '--ground',
        '--transfer',
        'zonal',
        '--samples',
        '256',
        '--bounces',
        '1',
        '-o',
        at('man.glb'),
      );
      await shoot(
        'web_lobes.jpg',
        [at('man.glb'), '--env', environment('chinese_garden')],
        'time=0.6&exposure=-1',
        desk,
        async (page) => {
          await page.focus('#picture');
          for (let i = 0; i < 2; ++i) await page.keyboard.press('-'); // clear of the hint and the controls
          await drawn(page);
          await page.mouse.dblclick(440, 250);
        },
      );
    });
  },
  240_000,
);
