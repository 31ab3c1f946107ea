// Wavelets and fixed views in the browser against `lambent render` of the same file, camera and light; on each of
// three's renderers, and in the page.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { MathUtils, Quaternion, Vector3 } from 'three';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, renderLinear } from '../test/tool.ts';
import type { Backend, Shot } from './fixture/webgpu.ts';
import { drawn, haveBrowser, launch, open, openFixture, psnr, serve, type Server } from './browser.ts';
import { writeScene } from './scenes.ts';

const camera = '3.1,2.6,4.3,-0.3,0.8,0,38',
  size = [320, 240],
  small = [160, 120], // of fixed views
  rotate = '40,-5,10',
  sky = 'sky:elevation=35,azimuth=60,sun=on';
const numbers = (text: string): number[] => text.split(',').map(Number);

describe.skipIf(!haveTool || !haveBrowser)('wavelets and fixed views', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, server: ViteDevServer, page: Page;

  beforeAll(async () => {
    const scene = writeScene(folder),
      haar = (cube: number, ...more: string[]): string =>
        lambent('bake', scene, '--light', `haar:${cube}`, ...more.slice(1), '-o', at(more[0]!)),
      bounces = ['--bounces', '1', '--samples', '16'],
      view = ['--fix-view', camera, '--size', small.join('x'), '--spp', '16'];
    haar(32, 'vertices.glb');
    haar(16, 'coloured.glb', ...bounces);
    haar(16, 'texels.glb', '--receivers', 'texels', '--texels-per-unit', '12');
    haar(16, 'pixels.glb', ...bounces, ...view);
    lambent('bake', scene, '--samples', '64', '--order', '5', ...view, '-o', at('view.glb'));
    lambent('bake', scene, '--samples', '64', '--light', 'directional:32', ...view, '-o', at('view_lobes.glb'));
    browser = await launch();
    ({ page, server } = await openFixture(browser, folder, 'webgpu.html'));
  });
  afterAll(async () => {
    await browser?.close();
    await server?.close();
  });

  const url = (path: string): string => `data:image/png;base64,${readFileSync(path).toString('base64')}`,
    inside = (a: string, b: string): Promise<number> =>
      page.evaluate(([a, b]) => window.gpu.inside(a, b), [url(a), url(b)] as const);
  const truth = (name: string, baked: string, ...more: string[]): string => {
    const isView = /^(pixels|view)/.test(baked);
    renderLinear(
      ...[at(baked), '--env', sky, '--exposure', '-1.5'],
      ...(more.includes('--background') ? [] : ['--background', 'none']),
      ...(isView ? [] : ['--camera', camera, '--size', size.join('x'), '--spp', '16']),
      ...more,
      ...['-o', at(`${name}_render.png`)],
    );
    return at(`${name}_render.png`);
  };

  /** What each renderer draws, against render and against WebGLRenderer; how near to render the first is. */
  async function compare(
    name: string,
    shot: Partial<Shot>,
    render: string,
    others: readonly Backend[] = ['webgpu', 'fallback'],
  ): Promise<number> {
    const picture = async (backend: Backend): Promise<[string, number]> => {
      const path = shot.path!,
        isView = /pixels|view/.test(path),
        whole = { light: sky, exposure: -1.5, camera: numbers(camera), size: isView ? small : size, ...shot, path },
        { png, milliseconds } = await page.evaluate(([b, s]) => window.gpu.shoot(b, s), [backend, whole] as const),
        file = at(`${name}_${backend}.png`);
      writeFileSync(file, Buffer.from(png.replace(/.*,/, ''), 'base64'));
      const within = await inside(render, file),
        over = psnr(file, render);
      console.log(
        `${name}, ${backend}: ${within.toFixed(1)} dB inside outlines, ${over.toFixed(1)} over all; frames of ` +
          `${milliseconds.map((t) => t.toFixed(0)).join(', ')} ms (${folder})`,
      );
      return [file, Math.min(within, over + 5)];
    };
    const [webgl, first] = await picture('webgl');
    for (const backend of others) {
      const [other] = await picture(backend),
        between = await inside(webgl, other);
      console.log(`${name}, ${backend}: ${between.toFixed(1)} dB against WebGLRenderer inside outlines`);
      expect(between).toBeGreaterThan(50);
    }
    return first;
  }

  for (const kind of ['vertices', 'coloured', 'texels', 'pixels'])
    it(`draws what render draws, by few wavelets and by all, in light that turned: ${kind}`, async () => {
      const path = `/files/${kind}.glb`,
        turned = ['--env-rotate', rotate];
      const all = truth(kind, `${kind}.glb`, ...turned),
        few = truth(`${kind}_few`, `${kind}.glb`, ...turned, '--terms', '200');
      expect(await compare(kind, { path, rotate: numbers(rotate) }, all)).toBeGreaterThan(45);
      // What is summed is the same table for each renderer.
      const shot = { path, rotate: numbers(rotate), terms: 200 };
      expect(await compare(`${kind}_few`, shot, few, kind === 'vertices' ? ['webgpu'] : [])).toBeGreaterThan(45);
      // The comparison can fail.
      const none = truth(`${kind}_20`, `${kind}.glb`, ...turned, '--terms', '20');
      expect(await inside(none, few)).toBeLessThan(kind === 'pixels' ? 55 : 45);
    });

  it('turns the light back for a scene that was turned', async () => {
    // About +Y with the camera, which is the scene as it was with the light turned the other way.
    const yaw = 50,
      turn = new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), MathUtils.degToRad(yaw)),
      [eye, target] = [0, 3].map((i) => new Vector3().fromArray(numbers(camera), i).applyQuaternion(turn)),
      shot = { path: '/files/vertices.glb', turn: turn.toArray(), camera: [...eye!, ...target!, 38] };
    const render = truth('turned', 'vertices.glb', '--env-rotate', `${-yaw},0,0`, '--terms', '200');
    expect(await compare('turned', { ...shot, terms: 200 }, render)).toBeGreaterThan(45);
  });

  it('draws a fixed view in harmonics as render draws it, turned, with fewer bands', async () => {
    const path = '/files/view.glb';
    expect(
      await compare(
        'view',
        { path, rotate: numbers(rotate) },
        truth('view', 'view.glb', '--env-rotate', rotate, '--window', 'none'),
      ),
    ).toBeGreaterThan(45);
    const lobes = truth('view_lobes', 'view_lobes.glb', '--env-rotate', rotate),
      shot = { path: '/files/view_lobes.glb', rotate: numbers(rotate) };
    expect(await compare('view_lobes', shot, lobes, ['webgpu'])).toBeGreaterThan(45);
    // Packed for browsers, and read in two pieces.
    lambent('export', at('view.glb'), '--web', at('view_site'), '--pack', 'auto');
    const packed = { path: '/files/view_site~data~scene.glb', rotate: numbers(rotate) };
    expect(await compare('view_packed', packed, at('view_render.png'), [])).toBeGreaterThan(45);
    const peaks = truth('view_peaks', 'view.glb');
    expect(await compare('view_peaks', { path, peaks: true }, peaks, ['webgpu'])).toBeGreaterThan(45);
  });

  it('takes lights of the program beside wavelets, at vertices and texels', async () => {
    const points: [number, number, number][] = [[0.5, 0, 0.9]],
      cosine = 5 / Math.hypot(1, 5, 0.5);
    for (const kind of ['coloured', 'texels'])
      for (const backend of ['webgl', 'fallback'] as const) {
        const shot = { path: `/files/${kind}.glb`, light: [1, 1, 1], camera: numbers(camera), size },
          { values } = await page.evaluate(([b, s, p]) => window.gpu.underSun(b, s, p), [
            backend,
            shot,
            points,
          ] as const),
          [alone, lit, again] = values.map(([at]) => at!);
        expect(again).toEqual(alone);
        expect(alone![0]).toBeGreaterThan(0.01);
        // Of a lamp of 3 straight from above: albedo / pi, by the cosine (half floats, filtered shadows: 1 %).
        [0.6, 0.58, 0.55].forEach((albedo, c) => {
          const added = (lit![c]! - alone![c]!) / ((3 * cosine * albedo) / Math.PI);
          expect(Math.abs(added - 1)).toBeLessThan(0.01);
        });
      }
  });

  it('fills the page, where hands turn the light alone; wavelets are counted in the address', async () => {
    const served: Server = await serve(at('pixels.glb'), '--env', sky),
      [width, height] = small as [number, number],
      render = truth('page', 'pixels.glb', '--env-rotate', rotate, '--terms', '200', '--background', 'env');
    const shown = await open(browser, served.address, `ui=off&rotate=${rotate}&terms=200&exposure=-1.5`, width, height);
    await shown.screenshot({ path: at('page.png') });
    const db = psnr(at('page.png'), render);
    console.log(`the page: ${db.toFixed(1)} dB (${folder})`);
    expect(db).toBeGreaterThan(40); // with the environment where nothing is
    // Wider than the picture: as high as the page, and black beside.
    await shown.setViewportSize({ width: width + 80, height });
    await drawn(shown);
    await shown.screenshot({ path: at('wide.png'), clip: { x: 40, y: 0, width, height } });
    expect(psnr(at('wide.png'), render)).toBeGreaterThan(40);
    await shown.close();

    const page = await open(browser, served.address, 'background=none', 900, 700);
    expect(await page.textContent('#hint')).toContain('Drag to turn the light.');
    expect(await page.isVisible('.looks')).toBe(false);
    const clip = { x: 300, y: 150, width: 300, height: 300 },
      shot = async (): Promise<Buffer> => (await drawn(page), page.screenshot({ clip }));
    const before = await shot();
    await page.focus('#picture');
    await page.keyboard.press('+');
    expect((await shot()).equals(before)).toBe(true); // the camera stays
    await page.mouse.move(450, 300);
    await page.mouse.down();
    await page.mouse.move(560, 300, { steps: 3 });
    await page.mouse.up();
    await page.waitForFunction(() => location.hash.includes('rotate='));
    await page.waitForTimeout(600); // until what is sharp is drawn from all texels
    const turned = await shot();
    expect(turned.equals(before)).toBe(false);
    await page.click('#more summary');
    expect(await page.isVisible('#order')).toBe(false);
    expect(await page.textContent('#terms-value')).toBe('all');
    await page.focus('#terms');
    await page.keyboard.press('Home');
    expect(await page.textContent('#terms-value')).toBe('10');
    await page.waitForFunction(() => location.hash.includes('terms=10'));
    expect(await page.evaluate(() => location.hash)).not.toContain('camera=');
    expect(
      await page.evaluate(() => [...document.querySelectorAll<HTMLOptionElement>('#view option')].map((o) => o.value)),
    ).toEqual(['baked']);
    await page.screenshot({ path: at('controls.png') });
    await page.close();
    expect(await served.stop()).toBe(0);
  });

  it('is checked before: cameras that are not the one that was baked in', () => {
    const refused = (...args: string[]): string => {
      try {
        return lambent('export', at('view.glb'), '--web', at('no_site'), ...args);
      } catch (error) {
        return String((error as { stderr: string }).stderr);
      }
    };
    expect(refused('--camera', camera)).toContain('whose camera is baked in');
    expect(refused('--compare', at('vertices.glb'))).toContain('of another camera');
    expect(refused('--compare', at('pixels.glb'))).not.toContain('lambent:');
  });
});
