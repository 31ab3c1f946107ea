// Glossy transfer in the browser against `lambent render` of the same file, camera, light and exposure: the outgoing
// bases, one of them from two sides.
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import { complaint, haveBrowser, launch, open, psnr, serve } from './browser.ts';
import { writeScene } from './scenes.ts';

const rotate = '40,-25,70',
  cameras = ['3.1,2.6,4.3,-0.3,0.8,0,38', '1.2,3.4,3.6,-0.3,0.6,0,36'] as const;
const glossy = 'ggx:roughness=0.5,f0=0.9,0.7,0.4',
  phong = 'phong:exponent=8,diffuse=0.3,0.25,0.2,specular=0.4';
const cases: [string, string, string[]][] = [
  ['map', 'materials', ['--bounces', '0']],
  ['svd:6', glossy, ['--bounces', '1']],
  ['sh:4', glossy, ['--bounces', '0']],
  ['hsh:4', glossy, ['--bounces', '0']],
  ['phong', phong, ['--bounces', '0']],
];

describe.skipIf(!haveTool || !haveBrowser)('glossy transfer', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, scene: string;

  beforeAll(async () => {
    writeLopsidedHdr(at('light.hdr'));
    scene = writeScene(folder);
    browser = await launch();
  });
  afterAll(async () => browser?.close());

  const bake = (name: string, outgoing: string, brdf: string, more: string[]): string =>
    lambent(
      'bake',
      scene,
      '--transfer',
      'matrix',
      '--order',
      '4',
      '--incident-order',
      '4',
      '--samples',
      '128',
      '--brdf',
      brdf,
      '--outgoing',
      outgoing,
      ...more,
      '-o',
      at(name),
    );

  for (const [outgoing, brdf, more] of cases)
    it(`looks as render draws it: ${outgoing}, ${brdf.split(':')[0]}`, async () => {
      const name = `${outgoing.replace(':', '')}_${brdf.split(':')[0]}`;
      bake(`${name}.glb`, outgoing, brdf, more);
      const server = await serve(at(`${name}.glb`), '--env', at('light.hdr')),
        found: number[] = [];
      for (const [k, camera] of cameras.slice(0, outgoing === 'map' ? 2 : 1).entries()) {
        const page = await open(
          browser,
          server.address,
          `ui=off&background=none&camera=${camera}&rotate=${rotate}`,
          640,
          480,
        );
        await page.screenshot({ path: at(`page_${name}_${k}.png`) });
        await page.close();
        renderLinear(
          at(`${name}.glb`),
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
          at(`render_${name}_${k}.png`),
        );
        found.push(psnr(at(`page_${name}_${k}.png`), at(`render_${name}_${k}.png`)));
      }
      expect(await server.stop()).toBe(0);
      console.log(`${outgoing}, ${brdf}: ${found.map((db) => db.toFixed(1)).join(', ')} dB (${folder})`);
      for (const db of found) expect(db).toBeGreaterThan(40);
    });

  it('is refused in words where the graphics card cannot draw into half floats', async () => {
    bake('plain.glb', 'svd:4', glossy, ['--bounces', '0']);
    const server = await serve(at('plain.glb'), '--env', at('light.hdr'));
    expect(
      await complaint(browser, server.address, ['EXT_color_buffer_float', 'EXT_color_buffer_half_float'], {}),
    ).toMatch(/^plain\.glb is glossy, which needs .*half-float/);
    expect(await complaint(browser, server.address, [], { MAX_TEXTURE_SIZE: 64 })).toMatch(
      /^plain\.glb (has|takes) .* takes 64$/,
    );
    expect(await server.stop()).toBe(0);
  });
});
