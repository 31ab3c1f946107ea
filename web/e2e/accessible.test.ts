// The page has nothing that axe-core finds fault with: of each kind of controls, folded out and in, wide and narrow,
// light and dark.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder } from '../test/tool.ts';
import { drawn, haveBrowser, launch, open, serve, type Server } from './browser.ts';
import { writeScene } from './scenes.ts';

const axe = readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');

interface Found {
  violations: { id: string; nodes: { html: string }[] }[];
  passes: unknown[];
}
async function faults(page: Page): Promise<string[]> {
  await drawn(page);
  await page.evaluate(axe);
  const found = await page.evaluate(() => (globalThis as unknown as { axe: { run(): Promise<Found> } }).axe.run());
  expect(found.passes.length).toBeGreaterThan(10); // it did look
  return found.violations.map((v) => `${v.id}: ${v.nodes.map((n) => n.html.slice(0, 200)).join(' ')}`);
}

describe.skipIf(!haveTool || !haveBrowser)('what axe-core finds', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name),
    servers: Server[] = [];
  let browser: Browser;

  beforeAll(async () => {
    const scene = writeScene(folder);
    lambent('bake', scene, '--order', '2', '--samples', '16', '-o', at('diffuse.glb'));
    const lattice = ['--lattice', '3,2,3', '--lattice-order', '2'];
    lambent('bake', scene, '--order', '2', '--samples', '16', ...lattice, '-o', at('lattice.glb'));
    lambent('bake', scene, '--transfer', 'blocks', '--cube', '16', '-o', at('blocks.glb'));
    lambent('bake', scene, '--transfer', 'indirect', '--surfels', '512', '--samples', '32', '-o', at('indirect.glb'));
    browser = await launch();
  });
  afterAll(async () => {
    await browser?.close();
    await Promise.all(servers.map((server) => server.stop()));
  });

  it.each([
    ['diffuse', ''],
    ['blocks', ''],
    ['lattice', '&insert=ball@0.9,0,1.1,0.6&show=lattice,receivers'],
    ['indirect', '&lamp=point@0.9,1.9,1.1=6,5,4'],
  ])('of %s is nothing', async (kind, more) => {
    const server = await serve(at(`${kind}.glb`));
    servers.push(server);
    for (const [width, height, scheme] of [
      [900, 700, 'light'],
      [390, 800, 'dark'],
    ] as const) {
      const page = await open(browser, server.address, `camera=3.1,2.6,4.3,-0.3,0.8,0,38${more}`, width, height);
      await page.emulateMedia({ colorScheme: scheme });
      expect(await faults(page)).toEqual([]);
      for (const sheet of ['#lamps', '#objects', '#more']) {
        if (!(await page.isVisible(sheet))) continue;
        await page.click(`${sheet} > summary`);
        expect(await faults(page), sheet).toEqual([]);
      }
      await page.screenshot({ path: at(`${kind}_${width}.png`) });
      await page.keyboard.press('Escape');
      await page.click('#help-open');
      expect(await faults(page), 'help').toEqual([]);
      await page.close();
    }
  });
});
