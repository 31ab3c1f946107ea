// Light on lobes beside harmonics or in place of them: each renderer against `lambent render` of the same file, under a
// light that was turned, where each lobe stands still.
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { Quaternion, Vector3 } from 'three';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import { haveBrowser, launch, open, openFixture, psnr, serve } from './browser.ts';
import { cameraOf, compareEditions, size, view } from './editions.ts';
import type { Backend, Shot } from './fixture/webgpu.ts';
import { writeBumpy, writeScene } from './scenes.ts';

const camera = '3.1,2.6,4.3,-0.3,0.8,0,38',
  near = '1.6,1.5,2.2,-0.1,0.4,-0.2,40',
  rotate = '40,-25,70';

describe.skipIf(!haveTool || !haveBrowser)('lobes of light', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, server: ViteDevServer, page: Page;

  beforeAll(async () => {
    writeLopsidedHdr(at('light.hdr'));
    writeScene(folder);
    writeBumpy(at('bumpy.gltf'));
    browser = await launch();
    ({ page, server } = await openFixture(browser, folder, 'webgpu.html'));
  });
  afterAll(async () => {
    await browser?.close();
    await server?.close();
  });

  const lamps = (bands: number): string => `sh:${bands}+lamps:3@${at('light.hdr')}`;
  const cases: [string, string, string, () => string, string[]][] = [
    ['lamps', 'scene.obj', camera, () => lamps(4), ['--bounces', '1']],
    ['directional', 'scene.obj', camera, () => 'directional:24', []],
    ['compact', 'scene.obj', camera, () => 'compact:30', ['--compress', 'cpca:32,12']],
    ['steerable', 'scene.obj', camera, () => 'steerable:4', ['--bounces', '1']],
    ['texels', 'bumpy.gltf', near, () => lamps(3), ['--receivers', 'texels', '--texels-per-unit', '16']],
    [
      'matrix',
      'scene.obj',
      camera,
      () => lamps(3),
      ['--transfer', 'matrix', '--incident-order', '3', '--brdf', 'ggx:roughness=0.5,f0=0.9', '--bounces', '0'],
    ],
  ];
  for (const [name, scene, from, light, args] of cases)
    it(`are drawn as render draws them: ${name}`, async () => {
      lambent('bake', at(scene), '--samples', '128', '--light', light(), ...args, '-o', at(`${name}.glb`));
      const truth = at(`${name}_render.png`),
        shot = { path: `/files/${name}.glb`, light: '/files/light.hdr', camera: cameraOf(from), peaks: true };
      renderLinear(at(`${name}.glb`), '--env', at('light.hdr'), '--env-rotate', rotate, ...view(from), '-o', truth);
      await compareEditions(page, folder, name, { ...shot, rotate: rotate.split(',').map(Number) }, truth);
      // As it was baked, where lamps are in their lobes; and the comparison can fail.
      renderLinear(at(`${name}.glb`), '--env', at('light.hdr'), ...view(from), '-o', at(`${name}_still_render.png`));
      expect(psnr(at(`${name}_webgl.png`), at(`${name}_still_render.png`))).toBeLessThan(35);
      await compareEditions(page, folder, `${name}_still`, shot, at(`${name}_still_render.png`));
    });

  it('have coefficients in false colour that both editions show alike', async () => {
    const shoot = async (backend: Backend, wears: number): Promise<string> =>
        (
          await page.evaluate(([b, s]) => window.gpu.shoot(b, s), [
            backend,
            { path: '/files/lamps.glb', light: [1, 1, 1], camera: cameraOf(camera), wears, size },
          ] satisfies [Backend, Shot])
        ).png,
      inside = (a: string, b: string): Promise<number> =>
        page.evaluate(([a, b]) => window.gpu.inside(a, b), [a, b] as const);
    const lobe = await shoot('webgl', 16);
    expect(await inside(lobe, await shoot('fallback', 16))).toBeGreaterThan(50);
    expect(await inside(lobe, await shoot('webgl', 15))).toBeLessThan(35);
  });

  it('that are bands in other words do not ring under a sun', async () => {
    const truth = at('sun_render.png'),
      sun = 'sky:elevation=35,azimuth=60';
    renderLinear(at('steerable.glb'), '--env', sun, ...view(camera, ['--exposure', '-2']), '-o', truth);
    const shot = { path: '/files/steerable.glb', light: sun, camera: cameraOf(camera), exposure: -2, peaks: true };
    await compareEditions(page, folder, 'sun', shot, truth);
  });

  it('meet what was turned, and its instances, as the light stands in its axes', async () => {
    // The turned scene is the scene in light that was turned the other way.
    const turn = new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), 1.1),
      truth = at('turned_render.png'),
      degrees = (-1.1 * 180) / Math.PI,
      seen = [0, 3]
        .flatMap((k) => new Vector3().fromArray(cameraOf(camera), k).applyQuaternion(turn).toArray())
        .concat(38);
    renderLinear(
      ...[at('lamps.glb'), '--env', at('light.hdr'), '--env-rotate', `${degrees},0,0`, ...view(camera), '-o', truth],
    );
    const shot = { path: '/files/lamps.glb', light: '/files/light.hdr', camera: seen, peaks: true };
    await compareEditions(page, folder, 'turned', { ...shot, turn: turn.toArray() }, truth);
    const copies = [[...turn.toArray(), 0, 0, 0, 1]];
    await compareEditions(page, folder, 'instance', { ...shot, copies, instanced: true }, truth);
  });

  it('are shown by the page, by name and number too', async () => {
    const site = await serve(at('lamps.glb'), '--env', at('light.hdr')),
      look = (more: string): Promise<Page> =>
        open(browser, site.address, `background=none&camera=${camera}&rotate=${rotate}&${more}`, 640, 480);
    const shown = await look('ui=off');
    await shown.screenshot({ path: at('page.png') });
    await shown.close();
    renderLinear(
      ...[at('lamps.glb'), '--env', at('light.hdr'), '--env-rotate', rotate, '--camera', camera],
      ...['--size', '640x480', '--spp', '16', '--background', 'none', '-o', at('page_render.png')],
    );
    expect(psnr(at('page.png'), at('page_render.png'))).toBeGreaterThan(40);
    const coefficient = await look('view=coefficient&coefficient=16');
    expect(await coefficient.textContent('#coefficient-name')).toBe('lobe 1');
    await coefficient.close();
    expect(await site.stop()).toBe(0);
  });
});
