// What relighting costs on this machine's WebGL 2, beside plain materials of three.js on the same meshes in the same run: JSON lines,
// as scripts/bench prints them. Chromium's software renderer runs vertex shaders on the processor, so ratios are pessimistic for
// hardware that hides texel fetches.
import { join } from 'node:path';
import { expect, it } from 'vitest';
import { haveBrowser, launch, openFixture, writeScene } from '../e2e/browser.ts';
import { haveTool, lambent, makeFolder } from '../test/tool.ts';

it.skipIf(!haveTool || !haveBrowser)('shading', async () => {
  const folder = makeFolder(), scene = writeScene(folder), browser = await launch();
  const orders = [3, 6, 10];
  for (const order of orders) lambent('bake', scene, '--max-edge', '0.05', '--samples', '32', '--order', String(order), '-o', join(folder, `order_${order}.glb`));
  const { page, server } = await openFixture(browser, folder);
  for (const order of orders) {
    const t = await page.evaluate((path) => window.scenes.timed(path, 21), `/files/order_${order}.glb`);
    const line = (what: string, limit: number, limitIs: string): boolean => process.stdout.write(JSON.stringify({
      name: what, order, channels: 3, vertices: t.vertices, ours: t.baked, limit, ratio: t.baked / limit, unit: 'ms a frame', limit_is: limitIs, renderer: 'SwiftShader',
    }) + '\n');
    line('web_frame', t.lambert, 'MeshLambertMaterial under a LightProbe, same meshes');
    line('web_frame', t.standard, 'MeshStandardMaterial under a LightProbe, same meshes');
    process.stdout.write(JSON.stringify({ name: 'web_turn_light', order, ours: t.turn, limit: 1000 / 60, ratio: t.turn / (1000 / 60), unit: 'ms', limit_is: 'a frame at 60 Hz' }) + '\n');
    expect(t.turn).toBeLessThan(1000 / 60);
  }
  await browser.close();
  await server.close();
});
