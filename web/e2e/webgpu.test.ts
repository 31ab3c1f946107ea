// The package on WebGPURenderer, with WebGPU (of a software device) and with its WebGL 2 backend, against
// `lambent render`, and against WebGLRenderer.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, lambentJson, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import type { Backend } from './fixture/webgpu.ts';
import { haveBrowser, launch, openFixture, psnr } from './browser.ts';
import { writeScene } from './scenes.ts';

const camera = '3.1,2.6,4.3,-0.3,0.8,0,38',
  size = [320, 240],
  rotate = '40,-25,70';

describe.skipIf(!haveTool || !haveBrowser)('on WebGPURenderer', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, server: ViteDevServer, page: Page;

  beforeAll(async () => {
    writeLopsidedHdr(at('light.hdr'));
    const scene = writeScene(folder);
    lambent('bake', scene, '--samples', '128', '--order', '5', '-o', at('vertices.glb'));
    lambent(
      ...['bake', scene, '--transfer', 'lightmap', '--texels-per-unit', '12', '--samples', '64', '--order', '4'],
      ...['--emit', 'white=0.5,0.4,0.2', '--light-groups', '-o', at('atlas.glb')],
    );
    lambent('compress', at('vertices.glb'), '--zonal', '2', '-o', at('lobes.glb'));
    const glossy = ['--transfer', 'matrix', '--order', '3', '--outgoing', 'svd:2', '--samples', '16'];
    lambent('bake', scene, ...glossy, '-o', at('glossy.glb'));
    lambent('bake', scene, '--transfer', 'blocks', '--cube', '32', '--visibility', 'bits:3', '-o', at('blocks.glb'));
    browser = await launch();
    ({ page, server } = await openFixture(browser, folder, 'webgpu.html'));
  });
  afterAll(async () => {
    await browser?.close();
    await server?.close();
  });

  for (const name of ['vertices', 'atlas'])
    it(`draws what render and WebGLRenderer draw: ${name}`, async () => {
      const { coefficients } = lambentJson(
        ...['env', at('light.hdr'), '--env-rotate', rotate, '--order', name === 'atlas' ? '4' : '5'],
      ) as { coefficients: number[][] };
      const shot = {
        path: `/files/${name}.glb`,
        light: coefficients.flat(),
        camera: camera.split(',').map(Number),
        size,
      };
      const view = ['--env', at('light.hdr'), '--env-rotate', rotate, '--window', 'none', '--camera', camera];
      renderLinear(
        at(`${name}.glb`),
        ...view,
        ...['--size', size.join('x'), '--spp', '16', '--background', 'none', '-o', at(`${name}_render.png`)],
      );
      const url = (path: string): string => `data:image/png;base64,${readFileSync(path).toString('base64')}`,
        truth = at(`${name}_render.png`),
        inside = (a: string, b: string): Promise<number> =>
          page.evaluate(([a, b]) => window.gpu.inside(a, b), [url(a), url(b)] as const);
      const picture = async (backend: Backend): Promise<string> => {
        const { png, milliseconds } = await page.evaluate(([b, s]) => window.gpu.shoot(b, s), [backend, shot] as const),
          path = at(`${name}_${backend}.png`);
        writeFileSync(path, Buffer.from(png.replace(/.*,/, ''), 'base64'));
        const within = await inside(truth, path),
          all = psnr(path, truth);
        console.log(
          `${name} by ${await page.evaluate((b) => window.gpu.backendName(b), backend)}: ${within.toFixed(1)} dB ` +
            `against render inside outlines, ${all.toFixed(1)} over all; frames of ` +
            `${milliseconds.map((t) => t.toFixed(0)).join(', ')} ms (${folder})`,
        );
        expect(within).toBeGreaterThan(45);
        expect(all).toBeGreaterThan(40);
        return path;
      };
      const webgl = await picture('webgl'),
        hasWebGpu = await page.evaluate(async () =>
          Boolean(await (navigator as { gpu?: { requestAdapter(): Promise<unknown> } }).gpu?.requestAdapter()),
        );
      if (!hasWebGpu) console.warn('this browser has no WebGPU here: its WebGL 2 backend alone is tried');
      for (const backend of hasWebGpu ? (['webgpu', 'fallback'] as const) : (['fallback'] as const)) {
        const between = await inside(webgl, await picture(backend));
        console.log(`${name}: ${between.toFixed(1)} dB against WebGLRenderer inside outlines`);
        expect(between).toBeGreaterThan(50);
      }
    });

  for (const brdf of ['diffuse', 'phong:diffuse=0.4,specular=0.5,exponent=50', 'ggx:roughness=0.4,f0=0.6'])
    it(`draws visibility in blocks as WebGLRenderer does: ${brdf}`, async () => {
      const path = '/files/blocks.glb',
        shot = { path, light: 'sky:elevation=35,azimuth=60,sun=on', brdf, camera: camera.split(',').map(Number), size };
      const take = (backend: Backend): Promise<{ png: string; milliseconds: number[] }> =>
        page.evaluate(([b, s]) => window.gpu.shoot(b, s), [backend, shot] as const);
      const truth = await take('webgl');
      for (const backend of ['webgpu', 'fallback'] as const) {
        const { png, milliseconds } = await take(backend),
          db = await page.evaluate(([a, b]) => window.gpu.inside(a, b), [truth.png, png] as const);
        writeFileSync(at(`blocks_${brdf.split(':')[0]}_${backend}.png`), Buffer.from(png.replace(/.*,/, ''), 'base64'));
        const frames = [truth.milliseconds, milliseconds].map((all) => all.map((t) => t.toFixed(0)).join(', '));
        console.log(
          `blocks, ${brdf}, ${backend}: ${db.toFixed(1)} dB against WebGLRenderer inside outlines; frames of ` +
            `${frames[1]} ms, there ${frames[0]} ms (${folder})`,
        );
        expect(db).toBeGreaterThan(50);
      }
    });

  it('says what it does not draw, in place of a white surface', async () => {
    const say = (name: string, withNodes: boolean): Promise<string[]> =>
      page.evaluate(([path, nodes]) => window.gpu.refusal(path, nodes), [`/files/${name}`, withNodes] as const);
    for (const sentence of await say('vertices.glb', false)) expect(sentence).toMatch(/lambent-three\/webgpu/);
    for (const sentence of await say('lobes.glb', true)) expect(sentence).toMatch(/zonal lobes, which WebGPURenderer/);
    for (const sentence of await say('glossy.glb', true))
      expect(sentence).toMatch(/transfer matrix, which WebGPURenderer/);
    expect(await say('vertices.glb', true)).toEqual(['', '']);
  });
});
