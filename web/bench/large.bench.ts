// The page from a thousand to two million vertices: how long until it is drawn, how long a frame takes, and whether it
// is the right picture. JSON lines.
import { statSync } from 'node:fs';
import { join } from 'node:path';
import { expect, it } from 'vitest';
import { drawn, haveBrowser, launch, open, psnr, serve } from '../e2e/browser.ts';
import { writeScene } from '../e2e/scenes.ts';
import { haveTool, lambentJson, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';

const camera = '3.1,2.6,4.3,-0.3,0.8,0,38',
  rotate = '40,-25,70';

it.skipIf(!haveTool || !haveBrowser)('large scenes', async () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name),
    scene = writeScene(folder),
    browser = await launch();
  writeLopsidedHdr(at('light.hdr'));
  for (const edge of [1, 0.04, 0.0121]) {
    const { receivers } = lambentJson(
      'bake',
      scene,
      '--max-edge',
      String(edge),
      '--order',
      '3',
      '--shadows',
      'off',
      '-o',
      at('large.glb'),
    ) as { receivers: number };
    const server = await serve(at('large.glb'), '--env', at('light.hdr')),
      start = performance.now();
    const page = await open(
        browser,
        server.address,
        `ui=off&background=none&camera=${camera}&rotate=${rotate}`,
        640,
        480,
      ),
      seconds = (performance.now() - start) / 1000;
    await page.screenshot({ path: at('page.png') });
    const frames = performance.now();
    await drawn(page); // three frames
    const frame = (performance.now() - frames) / 3;
    await page.close();
    expect(await server.stop()).toBe(0);
    renderLinear(
      at('large.glb'),
      '--camera',
      camera,
      '--size',
      '640x480',
      '--spp',
      '16',
      '--env',
      at('light.hdr'),
      '--env-rotate',
      rotate,
      '--background',
      'none',
      '-o',
      at('render.png'),
    );
    const db = psnr(at('page.png'), at('render.png'));
    process.stdout.write(
      JSON.stringify({
        name: 'web_large',
        receivers,
        megabytes: statSync(at('large.glb')).size / 1e6,
        ours: seconds,
        unit: 's until it is drawn',
        at_most_ms_a_frame: frame,
        psnr: db,
        renderer: 'SwiftShader',
      }) + '\n',
    );
    expect(db).toBeGreaterThan(40);
  }
  await browser.close();
});
