// The browser's picture against `lambent render` of the same file, camera, light and exposure.
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import { haveBrowser, launch, open, psnr, serve, type Server } from './browser.ts';
import { writeRoom, writeScene } from './scenes.ts';

const camera = '3.1,2.6,4.3,-0.3,0.8,0,38',
  rotate = '40,-25,70';

describe.skipIf(!haveTool || !haveBrowser)('the picture', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, server: Server;

  beforeAll(async () => {
    writeLopsidedHdr(at('light.hdr'));
    const scene = writeScene(folder);
    lambent('bake', scene, '--samples', '1024', '--bounces', '2', '-o', at('scene.glb'));
    lambent('bake', scene, '--shadows', 'off', '-o', at('open.glb'));
    browser = await launch();
    server = await serve(
      at('scene.glb'),
      '--compare',
      at('open.glb'),
      '--env',
      at('light.hdr'),
      '--env',
      'sky:elevation=30,azimuth=200',
    );
  });
  afterAll(async () => {
    await browser?.close();
    expect(await server?.stop()).toBe(0);
  });

  /** PSNR of the page at `fragment` against `render` with `args`. */
  async function compare(name: string, baked: string, fragment: string, args: string[]): Promise<number> {
    const page = await open(browser, server.address, `ui=off&camera=${camera}&${fragment}`, 640, 480);
    await page.screenshot({ path: at(`${name}_page.png`) });
    await page.close();
    renderLinear(
      at(baked),
      '--camera',
      camera,
      '--size',
      '640x480',
      '--spp',
      '16',
      ...args,
      '-o',
      at(`${name}_render.png`),
    );
    const db = psnr(at(`${name}_page.png`), at(`${name}_render.png`));
    console.log(`${name}: ${db.toFixed(1)} dB (${folder})`);
    return db;
  }
  const none = ['--background', 'none'],
    light = ['--env', at('light.hdr')];

  it('is that of render', async () => {
    expect(await compare('plain', 'scene.glb', 'background=none', [...light, ...none])).toBeGreaterThan(40);
  });
  it('is that of render under light turned about a skew axis', async () => {
    expect(
      await compare('turned', 'scene.glb', `background=none&rotate=${rotate}`, [
        ...light,
        ...none,
        '--env-rotate',
        rotate,
      ]),
    ).toBeGreaterThan(40);
  });
  it('is that of render with fewer bands, a window and another exposure', async () => {
    expect(
      await compare('windowed', 'scene.glb', `background=none&rotate=${rotate}&order=4&window=hann&exposure=-1.5`, [
        ...light,
        ...none,
        '--env-rotate',
        rotate,
        '--light-order',
        '4',
        '--window',
        'hann',
        '--exposure',
        '-1.5',
      ]),
    ).toBeGreaterThan(40);
  });
  it('is that of render under a sun that rings in a room', async () => {
    lambent('bake', writeRoom(folder), '--samples', '256', '--bounces', '2', '-o', at('room.glb'));
    const inside = '-1.7,1.7,1.6,1,0.7,-0.6,75',
      sun = 'sky:elevation=25,azimuth=10',
      room = await serve(at('room.glb'), '--env', sun);
    const shown = async (name: string, window: string): Promise<string> => {
      const page = await open(browser, room.address, `ui=off&camera=${inside}&exposure=1${window}`, 640, 480);
      await page.screenshot({ path: at(`${name}.png`) });
      await page.close();
      return at(`${name}.png`);
    };
    const page = await shown('room_page', ''),
      ringing = await shown('room_ringing', '&window=none');
    expect(await room.stop()).toBe(0);
    const view = ['--env', sun, '--camera', inside, '--size', '640x480', '--spp', '16', '--exposure', '1'];
    renderLinear(at('room.glb'), ...view, '-o', at('room_render.png'));
    const db = psnr(page, at('room_render.png')),
      without = psnr(ringing, at('room_render.png'));
    console.log(`a room by default: ${db.toFixed(1)} dB; without a window ${without.toFixed(1)} dB (${folder})`);
    expect(db).toBeGreaterThan(40);
    expect(without).toBeLessThan(30);
  });
  it('is that of render under a sky, with a window', async () => {
    expect(
      await compare('sky', 'scene.glb', `background=none&env=1&window=lanczos&rotate=${rotate}&exposure=-1`, [
        '--env',
        'sky:elevation=30,azimuth=200',
        ...none,
        '--env-rotate',
        rotate,
        '--window',
        'lanczos',
        '--exposure',
        '-1',
      ]),
    ).toBeGreaterThan(40);
  });
  it('has the environment behind it as render has', async () => {
    expect(
      await compare('behind', 'scene.glb', `rotate=${rotate}`, [...light, '--env-rotate', rotate]),
    ).toBeGreaterThan(40);
  });
  it('without shadows, from normals alone, is that of a bake without shadows', async () => {
    expect(
      await compare('unshadowed', 'open.glb', `background=none&view=unshadowed&rotate=${rotate}`, [
        ...light,
        ...none,
        '--env-rotate',
        rotate,
      ]),
    ).toBeGreaterThan(40);
  });
  it('of the second file is that of render', async () => {
    expect(
      await compare('second', 'open.glb', `background=none&view=compare&rotate=${rotate}`, [
        ...light,
        ...none,
        '--env-rotate',
        rotate,
      ]),
    ).toBeGreaterThan(40);
  });
  it('is not that of another light: the comparison can fail', async () => {
    expect(
      await compare('other', 'scene.glb', 'background=none', [...light, ...none, '--env-rotate', rotate]),
    ).toBeLessThan(30);
  });
});
