// Tone curves and automatic exposure against `lambent render --tone --exposure auto`; and files without their transfer.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { tones } from '../page/tone.ts';
import { haveTool, lambent, lambentJson, makeFolder, writeLopsidedHdr } from '../test/tool.ts';
import { drawn, haveBrowser, launch, open, psnr, ready, serve, type Server } from './browser.ts';
import { writeScene } from './scenes.ts';

describe.skipIf(!haveTool || !haveBrowser)('what the page shows of light', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name),
    camera = '3.1,2.6,4.3,-0.3,0.8,0,38';
  let browser: Browser, server: Server;

  beforeAll(async () => {
    writeLopsidedHdr(at('light.hdr'));
    const scene = writeScene(folder);
    lambent('bake', scene, '--order', '5', '--samples', '256', '-o', at('scene.glb'));
    const lit = ['--transfer', 'lightmap', '--order', '3', '--texels-per-unit', '6', '--samples', '64'];
    lambent('bake', scene, ...lit, '-o', at('lightmap.glb'));
    browser = await launch();
    server = await serve(at('scene.glb'), '--env', at('light.hdr'));
  });
  afterAll(async () => {
    await browser?.close();
    await server?.stop();
  });

  const stops = (page: Page): Promise<number> =>
    page.evaluate(() => Number((document.getElementById('exposure') as HTMLInputElement).value));

  for (const tone of tones)
    it(`is that of render, tone ${tone}, exposure auto`, async () => {
      const fragment = `ui=off&background=none&camera=${camera}&exposure=auto&tone=${tone}`,
        page = await open(browser, server.address, fragment, 640, 480);
      await page.screenshot({ path: at(`${tone}_page.png`) });
      const view = ['--camera', camera, '--size', '640x480', '--spp', '16', '--background', 'none'],
        { display } = lambentJson(
          ...['render', at('scene.glb'), '--env', at('light.hdr'), ...view, '--tone', tone],
          ...['-o', at(`${tone}_render.png`)],
        ) as { display: { exposure: number } };
      const db = psnr(at(`${tone}_page.png`), at(`${tone}_render.png`)),
        apart = (await stops(page)) - display.exposure;
      console.log(`${tone}: ${db.toFixed(1)} dB, ${apart.toFixed(3)} stops apart (${folder})`);
      expect(Math.abs(apart)).toBeLessThan(0.1);
      expect(db).toBeGreaterThan(38);
      await page.close();
    });

  it('is measured again when the light turns and when it is asked for, not when the camera moves', async () => {
    const page = await open(browser, server.address, `camera=${camera}&exposure=auto`, 480, 360),
      before = await stops(page);
    await page.focus('#picture');
    for (let i = 0; i < 6; ++i) await page.keyboard.press('ArrowRight');
    for (let i = 0; i < 8; ++i) await page.keyboard.press('+');
    await page.waitForTimeout(700);
    expect(await stops(page)).toBe(before);
    await page.click('#auto');
    await drawn(page);
    const there = await stops(page);
    expect(Math.abs(there - before)).toBeGreaterThan(0.05);
    for (let i = 0; i < 12; ++i) await page.keyboard.press('Shift+ArrowLeft');
    await page.focus('#picture');
    for (let i = 0; i < 12; ++i) await page.keyboard.press('Shift+ArrowLeft');
    await page.waitForTimeout(900);
    const turned = await stops(page);
    expect(Math.abs(turned - there)).toBeGreaterThan(0.05);
    await page.waitForFunction(() => /rotate=/.test(location.hash));
    await page.reload();
    await ready(page);
    expect(Math.abs((await stops(page)) - turned)).toBeLessThan(0.02);
    await page.close();
  });

  it('begins with what view was told, and keeps what the hand chose', async () => {
    const told = await serve(at('scene.glb'), '--exposure', '1.5', '--tone', 'aces'),
      page = await browser.newPage({ viewport: { width: 480, height: 360 } });
    await page.goto(told.address);
    await ready(page);
    expect(await stops(page)).toBe(1.5);
    expect(await page.inputValue('#tone')).toBe('aces');
    expect(await page.getAttribute('#auto', 'aria-pressed')).toBe('false');
    await page.click('#auto');
    await page.click('#more summary');
    await page.selectOption('#tone', 'neutral');
    await page.waitForFunction(() => /exposure=auto/.test(location.hash) && /tone=neutral/.test(location.hash));
    await page.reload();
    await ready(page);
    expect(await page.getAttribute('#auto', 'aria-pressed')).toBe('true');
    expect(await page.inputValue('#tone')).toBe('neutral');
    await page.close();
    await told.stop();
  });

  it('turns a sun at its height, which a slider changes; lists the keys', async () => {
    const sky = await serve(at('scene.glb'), '--env', 'sky:elevation=25,azimuth=70'),
      page = await open(browser, sky.address, `camera=${camera}`, 640, 480),
      height = (): Promise<number> =>
        page.evaluate(() => Number(document.querySelector<HTMLInputElement>('#height')!.value)),
      turn = (): Promise<number[]> =>
        page.evaluate(() =>
          (new URLSearchParams(location.hash.slice(1)).get('rotate') ?? '0,0,0').split(',').map(Number),
        );
    expect(Math.abs((await height()) - 25)).toBeLessThan(2);
    await page.focus('#picture');
    for (let i = 0; i < 5; ++i) await page.keyboard.press('Shift+ArrowRight');
    await page.waitForFunction(() => /rotate=44/.test(location.hash)); // after the last of them
    const [yaw, pitch, roll] = await turn();
    expect(Math.abs(yaw! - (5 * 0.06 * 2.6 * 180) / Math.PI)).toBeLessThan(0.1);
    expect(Math.hypot(pitch!, roll!)).toBeLessThan(1e-3);
    await page.click('#more summary');
    await page.fill('#height', '60');
    expect(Math.abs((await height()) - 60)).toBeLessThan(1);
    await page.click('#reset-light');
    expect(Math.abs((await height()) - 25)).toBeLessThan(2);
    await page.keyboard.press('?');
    expect(await page.isVisible('#help')).toBe(true);
    await page.keyboard.press('Escape');
    expect(await page.isVisible('#help')).toBe(false);
    await page.close();
    await sky.stop();
  });

  it('raises a sky of its own, turns by itself, and shares what it shows', async () => {
    const sky = await serve(at('scene.glb'), '--env', 'sky:elevation=25,azimuth=70'),
      page = await open(browser, sky.address, `camera=${camera}&rotate=30,0,0`, 640, 480),
      state = (): URLSearchParams => new URLSearchParams(new URL(page.url()).hash.slice(1)),
      stops0 = await page.screenshot();
    await page.focus('#picture');
    await page.keyboard.press('Shift+ArrowUp');
    await page.waitForFunction(() => /elevation=/.test(location.hash));
    // 0.06 of the height, 2.6 radians for all of it; the sun is in front of the camera or behind it.
    expect(Math.abs(Number(state().get('elevation')) - 25)).toBeCloseTo((0.06 * 2.6 * 180) / Math.PI, 1);
    expect(state().get('rotate')!.split(',').map(Number)).toEqual([30, 0, 0]); // and the horizon stays
    const raised = await page.screenshot();
    expect(raised.equals(stops0)).toBe(false);
    await page.click('#more > summary');
    expect(await page.isVisible('#statistics')).toBe(false);
    await page.click('#statistics-box > summary');
    expect(await page.textContent('#statistics')).toContain('order 5');
    await page.context().grantPermissions(['clipboard-read', 'clipboard-write']);
    await page.click('#link');
    await page.waitForFunction(() => document.getElementById('said')!.textContent !== '');
    expect(await page.evaluate(() => navigator.clipboard.readText())).toBe(page.url());
    const [download] = await Promise.all([page.waitForEvent('download'), page.click('#save')]);
    expect(download.suggestedFilename()).toBe('scene.png');
    await download.saveAs(at('saved.png'));
    const png = readFileSync(at('saved.png'));
    expect([png.readUInt32BE(16), png.readUInt32BE(20)]).toEqual([640, 480]);
    await page.click('#spin');
    await page.waitForTimeout(300);
    await page.click('#spin');
    await page.waitForFunction(() => !/rotate=30,/.test(location.hash));
    expect(state().get('rotate')).toMatch(/^[\d.]+,[-\d.e]+,[-\d.e]+$/);
    await page.close();
    await sky.stop();
  });

  it.each(['lightmap.glb', 'scene.glb'])(
    'sums the light when that changes, not as the camera moves: %s',
    async (name) => {
      const other = await serve(at(name), '--env', at('light.hdr')),
        page = await browser.newPage({ viewport: { width: 320, height: 240 } });
      await page.addInitScript(() => {
        const gl = WebGL2RenderingContext.prototype as unknown as Record<string, (...a: unknown[]) => unknown>;
        (window as unknown as { draws: number }).draws = 0;
        for (const name of ['drawArrays', 'drawElements']) {
          const real = gl[name]!;
          gl[name] = function (this: unknown, ...args: unknown[]) {
            ++(window as unknown as { draws: number }).draws;
            return real.apply(this, args);
          };
        }
      });
      await page.goto(`${other.address}#exposure=0&camera=${camera}`);
      await ready(page);
      await page.focus('#picture');
      const drawsOf = async (key: string): Promise<number> => {
        const count = (): Promise<number> => page.evaluate(() => (window as unknown as { draws: number }).draws),
          before = await count();
        await page.keyboard.press(key);
        await drawn(page);
        return (await count()) - before;
      };
      const [camera1, light, camera2] = [
        await drawsOf('ArrowLeft'),
        await drawsOf('Shift+ArrowLeft'),
        await drawsOf('ArrowLeft'),
      ];
      expect(camera1).toBe(camera2);
      expect(light).toBeGreaterThan(camera1);
      await page.close();
      await other.stop();
    },
  );

  interface Json {
    bufferViews: unknown[];
    extensions?: Record<string, unknown>;
    extensionsUsed?: string[];
  }
  const rewrite = (name: string, change: (json: Json) => void): string => {
    const file = readFileSync(at('scene.glb')),
      length = file.readUInt32LE(12),
      json = JSON.parse(file.subarray(20, 20 + length).toString()) as Json;
    change(json);
    const text = Buffer.from(JSON.stringify(json).padEnd(length)),
      out = Buffer.from(file);
    text.copy(out, 20);
    writeFileSync(at(name), out);
    return at(name);
  };
  const tools: [string, (json: Json) => void, RegExp][] = [
    [
      'keeps the extension and drops its views',
      (json) => {
        const { transfer } = json.extensions!['LAMBENT_transfer'] as { transfer: { bufferView: number } };
        json.bufferViews.length = transfer.bufferView;
      },
      /^kept\.glb was rewritten by a tool that does not know LAMBENT_transfer; bake again$/,
    ],
    ['drops the extension', (json) => void delete json.extensions, /^kept\.glb was rewritten by a tool/],
    [
      'drops every trace',
      (json) => {
        delete json.extensions;
        delete json.extensionsUsed;
      },
      /^kept\.glb is not a baked file: .*; again, where another tool has rewritten it/,
    ],
  ];
  for (const [what, change, message] of tools)
    it(`says so of a file that a tool rewrote which ${what}, and shows the model`, async () => {
      const shot = async (page: Page, name: string): Promise<string> => {
        await drawn(page);
        await page.screenshot({ path: at(name), clip: { x: 120, y: 100, width: 400, height: 250 } });
        return at(name);
      };
      const page = await open(browser, server.address, 'background=none&rotate=30,50,-20&view=unshadowed', 640, 480);
      // three.js's own materials under the environment, turned, are near to ours with nothing in its way.
      const ours = await shot(page, 'unshadowed.png');
      await page.setInputFiles('#file', rewrite('kept.glb', change));
      await page.waitForSelector('#problem:not([hidden])');
      expect(await page.textContent('#problem-text')).toMatch(message);
      expect(await page.textContent('#name')).toBe('kept.glb');
      await page.click('#problem-close');
      const theirs = await shot(page, 'plain.png');
      const turned = await open(browser, server.address, 'background=none&view=unshadowed', 640, 480);
      const other = await shot(turned, 'not_turned.png');
      console.log(`plain: ${psnr(ours, theirs).toFixed(1)} dB; not turned: ${psnr(other, theirs).toFixed(1)} dB`);
      expect(psnr(ours, theirs)).toBeGreaterThan(35);
      expect(psnr(ours, theirs)).toBeGreaterThan(psnr(other, theirs) + 8);
      await page.close();
      await turned.close();
    });
});
