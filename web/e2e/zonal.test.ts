// Zonal lobes in the browser against `lambent render` of the same file, camera, light and exposure; at rest, and where
// the surface moves.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import { drawn, haveBrowser, launch, open, openFixture, psnr, serve } from './browser.ts';
import { writeBall, writeScene, writeSkin } from './scenes.ts';

const rotate = '40,-25,70';

describe.skipIf(!haveTool || !haveBrowser)('zonal lobes', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser;

  beforeAll(async () => {
    writeLopsidedHdr(at('light.hdr'));
    lambent('bake', writeScene(folder), '--samples', '256', '--bounces', '1', '-o', at('scene.glb'));
    writeSkin(at('skin.glb'), 0.3);
    lambent('bake', at('skin.glb'), '--samples', '256', '--bounces', '1', '-o', at('plain.glb'));
    for (const lobes of [2, 4])
      lambent('compress', at('scene.glb'), '--zonal', String(lobes), '-o', at(`scene_${lobes}.glb`));
    lambent('compress', at('plain.glb'), '--zonal', '4', '-o', at('lobes.glb'));
    browser = await launch();
  });
  afterAll(async () => browser?.close());

  async function shoot(baked: string, name: string, camera: string, fragment: string): Promise<void> {
    const server = await serve(at(baked), '--env', at('light.hdr'));
    const page = await open(
      browser,
      server.address,
      `ui=off&background=none&camera=${camera}&rotate=${rotate}${fragment}`,
      640,
      480,
    );
    await page.screenshot({ path: at(name) });
    await page.close();
    expect(await server.stop()).toBe(0);
  }
  const render = (baked: string, name: string, camera: string, args: string[]): string =>
    renderLinear(
      at(baked),
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
      ...args,
      '-o',
      at(name),
    );

  const sceneCamera = '3.1,2.6,4.3,-0.3,0.8,0,38',
    skinCamera = '1.4,1.9,2.6,0.1,0.1,0,38',
    bent = ['--animation', 'bend', '--time', '0.9'];
  for (const lobes of [2, 4])
    it(`look as render draws them: ${lobes} a receiver, light turned about a skew axis`, async () => {
      await shoot(`scene_${lobes}.glb`, `page_${lobes}.png`, sceneCamera, '');
      render(`scene_${lobes}.glb`, `render_${lobes}.png`, sceneCamera, []);
      const db = psnr(at(`page_${lobes}.png`), at(`render_${lobes}.png`));
      console.log(`${lobes} lobes: ${db.toFixed(1)} dB (${folder})`);
      expect(db).toBeGreaterThan(40);
    });

  it('show the error of their fit, as the file has it', async () => {
    const file = readFileSync(at('scene_2.glb')),
      jsonLength = file.readUInt32LE(12),
      json = JSON.parse(file.subarray(20, 20 + jsonLength).toString()) as {
        bufferViews: { byteOffset?: number; byteLength: number }[];
        extensions: { LAMBENT_transfer: { transfer: { fitErrors: number } } };
      };
    const view = json.bufferViews[json.extensions.LAMBENT_transfer.transfer.fitErrors]!,
      start = 28 + jsonLength + (view.byteOffset ?? 0);
    const errors = new Float32Array(new Uint8Array(file.subarray(start, start + view.byteLength)).buffer),
      gain = 0.5 / errors.reduce((a, b) => Math.max(a, b));
    const { page, server } = await openFixture(browser, folder);
    const shown = await page.evaluate((gain) => window.scenes.fitErrors('/files/scene_2.glb', gain), gain);
    await page.close();
    await server.close();
    const off = shown.map(([receiver, value]) => Math.abs(value / gain - errors[receiver]!)).sort((a, b) => a - b),
      mean = errors.reduce((a, b) => a + b) / errors.length;
    console.log(
      `errors of a fit: mean ${(100 * mean).toFixed(2)} %, ` +
        `shown within ${((100 * off[off.length >> 1]!) / mean).toFixed(1)} % of that at half of ${off.length} vertices`,
    );
    expect(off.length).toBeGreaterThan(1000);
    expect(mean).toBeGreaterThan(0.01);
    expect(off[off.length >> 1]! / mean).toBeLessThan(0.1);
    // The page offers it, with a scale.
    const viewer = await serve(at('scene_2.glb'), '--env', at('light.hdr')),
      tab = await open(browser, viewer.address, 'view=error', 640, 480);
    expect(await tab.inputValue('#view')).toBe('error');
    expect(await tab.textContent('#scale-high')).toBe('10 %');
    await tab.close();
    expect(await viewer.stop()).toBe(0);
  });

  // A thin sheet on black is nearly all outline, which the browser smooths after tone mapping: at rest, with nothing
  // turned, the same picture has 38.8 dB. So what turning costs is held against that.
  it('turn with the skin as in render, and not as harmonics stay', async () => {
    await shoot('lobes.glb', 'page_rest.png', skinCamera, '');
    await shoot('lobes.glb', 'page_bent.png', skinCamera, '&time=0.9');
    await shoot('plain.glb', 'page_stiff.png', skinCamera, '&time=0.9');
    render('lobes.glb', 'render_rest.png', skinCamera, []);
    render('lobes.glb', 'render_bent.png', skinCamera, bent);
    const rest = psnr(at('page_rest.png'), at('render_rest.png'));
    const turned = psnr(at('page_bent.png'), at('render_bent.png')),
      stiff = psnr(at('page_stiff.png'), at('render_bent.png'));
    console.log(
      `skin: at rest ${rest.toFixed(1)} dB; bent ${turned.toFixed(1)} dB, ` +
        `transfer as baked ${stiff.toFixed(1)} dB (${folder})`,
    );
    expect(turned).toBeGreaterThan(rest - 1);
    expect(turned).toBeGreaterThan(38);
    expect(stiff).toBeLessThan(turned - 8); // the comparison can fail
  });

  // Lobes of a matrix's rows: the view looks its reflection up in a frame that turns with the skin.
  it('are glossy as in render, at rest and bent', async () => {
    lambent(
      'bake',
      at('skin.glb'),
      '--transfer',
      'zonal',
      '--lobes',
      '3',
      '--order',
      '4',
      '--incident-order',
      '4',
      '--outgoing',
      'svd:4',
      '--brdf',
      'ggx:roughness=0.5,f0=0.9,0.7,0.4',
      '--samples',
      '256',
      '--bounces',
      '0',
      '-o',
      at('gloss.glb'),
    );
    lambent(
      'bake',
      writeScene(folder),
      '--transfer',
      'zonal',
      '--lobes',
      '3',
      '--order',
      '4',
      '--incident-order',
      '4',
      '--outgoing',
      'svd:4',
      '--brdf',
      'ggx:roughness=0.5,f0=0.9,0.7,0.4',
      '--samples',
      '128',
      '--bounces',
      '1',
      '-o',
      at('gloss_scene.glb'),
    );
    await shoot('gloss_scene.glb', 'page_gloss_scene.png', sceneCamera, '');
    await shoot('gloss.glb', 'page_gloss_rest.png', skinCamera, '');
    await shoot('gloss.glb', 'page_gloss_bent.png', skinCamera, '&time=0.9');
    render('gloss_scene.glb', 'render_gloss_scene.png', sceneCamera, []);
    render('gloss.glb', 'render_gloss_rest.png', skinCamera, []);
    render('gloss.glb', 'render_gloss_bent.png', skinCamera, bent);
    const [scene, rest, turned] = ['scene', 'rest', 'bent'].map((name) =>
      psnr(at(`page_gloss_${name}.png`), at(`render_gloss_${name}.png`)),
    ) as [number, number, number];
    const moved = psnr(at('page_gloss_rest.png'), at('render_gloss_bent.png'));
    console.log(
      `glossy lobes: ${scene.toFixed(1)} dB; ` +
        `skin at rest ${rest.toFixed(1)} dB, bent ${turned.toFixed(1)} dB (${folder})`,
    );
    expect(scene).toBeGreaterThan(40);
    expect(turned).toBeGreaterThan(rest - 1);
    expect(turned).toBeGreaterThan(36);
    expect(moved).toBeLessThan(turned - 8); // the comparison can fail
  });

  it('shows the lobes of the receiver under the pointer, in the picture and in words', async () => {
    writeBall(at('ball.obj'));
    lambent('bake', at('ball.obj'), '--samples', '256', '-o', at('ball.glb'));
    lambent('compress', at('ball.glb'), '--zonal', '1', '-o', at('one.glb'));
    const server = await serve(at('one.glb'), '--env', at('light.hdr')),
      page = await open(browser, server.address, 'camera=0,0,5,0,0,0,35', 400, 400);
    // Clear of the words and the controls.
    const middle = (): Promise<Buffer> => page.screenshot({ clip: { x: 60, y: 110, width: 280, height: 180 } });
    const axis = async (): Promise<number[]> => {
      const text = (await page.textContent('#lobes'))!;
      expect(text).toMatch(/^1 lobe of energy 0\.\d+: 100 % about /);
      return /\((.*)\)/
        .exec(text)![1]!
        .split(', ')
        .map((v) => Number(v.replace('−', '-')));
    };
    const before = await middle();
    // Open sky about a ball: a lobe along the normal.
    await page.mouse.dblclick(200, 200);
    await drawn(page);
    expect((await axis())[2]).toBeGreaterThan(0.98);
    expect((await middle()).equals(before)).toBe(false);
    await page.mouse.move(290, 200);
    await page.keyboard.press('l');
    await drawn(page);
    const ray = Math.atan((90 / 200) * Math.tan((35 / 360) * Math.PI)),
      normal = Math.asin(5 * Math.sin(ray)) - ray; // from 5 away, angles with +Z
    expect(Math.abs((await axis())[0]! - Math.sin(normal))).toBeLessThan(0.05);
    await page.keyboard.press('Escape');
    await drawn(page);
    expect(await page.textContent('#lobes')).toBe('');
    expect((await middle()).equals(before)).toBe(true);
    await page.mouse.dblclick(20, 200); // beside the ball
    await drawn(page);
    expect((await middle()).equals(before)).toBe(true);
    await page.close();
    await server.stop();
  });
});
