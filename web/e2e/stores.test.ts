// Dense transfer in fewer bytes, unfolded while it is loaded: each renderer against `lambent render` of the same file.
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, lambentJson, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import { haveBrowser, launch, open, openFixture, psnr, serve } from './browser.ts';
import { cameraOf, compareEditions, view } from './editions.ts';
import { writeBumpy, writeScene } from './scenes.ts';

const camera = '3.1,2.6,4.3,-0.3,0.8,0,38',
  near = '1.6,1.5,2.2,-0.1,0.4,-0.2,40',
  rotate = '40,-25,70',
  clusters = ['--compress', 'cpca:24,6'];

describe.skipIf(!haveTool || !haveBrowser)('a file of clusters or factors', () => {
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

  const lightOf = (order: number): number[] =>
    (
      lambentJson('env', at('light.hdr'), '--env-rotate', rotate, '--order', String(order)) as {
        coefficients: number[][];
      }
    ).coefficients.flat();
  const lit = ['--env', at('light.hdr'), '--env-rotate', rotate, '--window', 'none'];
  const cases: [string, string, number, string, string[]][] = [
    ['vertices', 'scene.obj', 5, camera, ['--order', '5', '--bounces', '2', ...clusters]],
    [
      'matrix',
      'scene.obj',
      4,
      camera,
      [
        ...['--transfer', 'matrix', '--order', '4', '--incident-order', '4', '--brdf', 'ggx:roughness=0.5,f0=0.9'],
        ...['--bounces', '1', ...clusters],
      ],
    ],
    [
      'texels',
      'bumpy.gltf',
      4,
      near,
      ['--receivers', 'texels', '--texels-per-unit', '16', '--order', '4', ...clusters],
    ],
  ];
  for (const [name, scene, order, from, args] of cases)
    it(`is drawn as render draws it, under light that was turned: ${name}`, async () => {
      lambent('bake', at(scene), '--samples', '64', ...args, '-o', at(`${name}.glb`));
      expect(lambent('inspect', at(`${name}.glb`))).toMatch(/24 clusters/);
      const truth = at(`${name}_render.png`);
      renderLinear(at(`${name}.glb`), ...lit, ...view(from), '-o', truth);
      const shot = { path: `/files/${name}.glb`, light: lightOf(order), camera: cameraOf(from) };
      await compareEditions(page, folder, name, shot, truth);
      renderLinear(at(`${name}.glb`), '--env', at('light.hdr'), '--window', 'none', ...view(from), '-o', at('o.png'));
      expect(psnr(at(`${name}_webgl.png`), at('o.png'))).toBeLessThan(35); // the comparison can fail
    });

  it('is drawn where the light and the material are factors of it', async () => {
    const truth = at('factors_render.png'),
      parts = ['--transfer', 'matrix', '--factors', '--order', '4', '--incident-order', '4'];
    lambent('bake', at('scene.obj'), ...parts, '--samples', '128', '-o', at('factors.glb'));
    renderLinear(at('factors.glb'), ...lit, ...view(camera), '-o', truth);
    const shot = { path: '/files/factors.glb', light: lightOf(4), camera: cameraOf(camera) };
    await compareEditions(page, folder, 'factors', shot, truth);
    renderLinear(at('factors.glb'), '--env', at('light.hdr'), '--window', 'none', ...view(camera), '-o', at('o.png'));
    expect(psnr(at('factors_webgl.png'), at('o.png'))).toBeLessThan(35); // the comparison can fail
    const sun = 'sky:elevation=35,azimuth=60';
    renderLinear(at('factors.glb'), '--env', sun, ...view(camera, ['--exposure', '-2']), '-o', truth);
    await compareEditions(page, folder, 'factors_sun', { ...shot, light: sun, exposure: -2, peaks: true }, truth);
  });

  it('has directions for normal maps, too', async () => {
    const sky = ['--sky', 'sky:elevation=30,azimuth=60', '--directional', 'sh:3'],
      truth = at('directional_render.png'),
      few = ['--transfer', 'lightmap', '--texels-per-unit', '16', '--samples', '64'];
    lambent('bake', at('bumpy.gltf'), ...few, ...sky, '-o', at('plain.glb'));
    lambent('compress', at('plain.glb'), '--cpca', '24,6', '-o', at('directional.glb'));
    renderLinear(at('directional.glb'), ...view(near), '--exposure', '-2', '-o', truth);
    const shot = { path: '/files/directional.glb', light: [0, 0, 0], camera: cameraOf(near), exposure: -2 };
    await compareEditions(page, folder, 'directional', shot, truth);
  });

  it('is served by view, and drawn by the page', async () => {
    const truth = at('page_render.png'),
      site = await serve(at('vertices.glb'), '--env', at('light.hdr')),
      shown = await open(
        browser,
        site.address,
        `ui=off&background=none&camera=${camera}&rotate=${rotate}&window=none`,
        640,
        480,
      );
    await shown.screenshot({ path: at('page.png') });
    await shown.close();
    expect(await site.stop()).toBe(0);
    renderLinear(
      at('vertices.glb'),
      ...lit,
      '--camera',
      camera,
      ...'--size 640x480 --spp 16 --background none'.split(' '),
      '-o',
      truth,
    );
    const db = psnr(at('page.png'), truth);
    console.log(`the page: ${db.toFixed(1)} dB (${folder})`);
    expect(db).toBeGreaterThan(40);
  });
});
