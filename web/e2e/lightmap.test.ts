// Lightmaps in the browser against `lambent render` of the same file, camera, light and exposure: the scene's lamps and
// turned harmonics.
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import { complaint, haveBrowser, launch, open, psnr, serve } from './browser.ts';
import { writeBumpy, writeScene } from './scenes.ts';

const rotate = '40,-25,70',
  camera = '3.1,2.6,4.3,-0.3,0.8,0,38';

describe.skipIf(!haveTool || !haveBrowser)('a lightmap', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser;

  beforeAll(async () => {
    writeLopsidedHdr(at('light.hdr'));
    const scene = writeScene(folder),
      common = ['--transfer', 'lightmap', '--texels-per-unit', '12', '--samples', '128', '--bounces', '2'];
    lambent(
      'bake',
      scene,
      ...common,
      '--emit',
      'white=1.5,1.1,0.7',
      '--emit',
      'red=0.1,0.02,0.02',
      '--light-groups',
      '--order',
      '4',
      '-o',
      at('lit.glb'),
    );
    browser = await launch();
  });
  afterAll(async () => browser?.close());

  it('looks as render draws it: lamps, and harmonics turned about a skew axis', async () => {
    const server = await serve(at('lit.glb'), '--env', at('light.hdr'));
    const page = await open(
      browser,
      server.address,
      `ui=off&background=none&camera=${camera}&rotate=${rotate}`,
      640,
      480,
    );
    await page.screenshot({ path: at('page.png') });
    await page.close();
    expect(await server.stop()).toBe(0);
    const render = (name: string, turn: string): string =>
      renderLinear(
        at('lit.glb'),
        '--camera',
        camera,
        '--size',
        '640x480',
        '--spp',
        '16',
        '--env',
        at('light.hdr'),
        '--env-rotate',
        turn,
        '--background',
        'none',
        '-o',
        at(name),
      );
    render('render.png', rotate);
    render('other.png', '0,0,0');
    const db = psnr(at('page.png'), at('render.png')),
      other = psnr(at('page.png'), at('other.png'));
    console.log(`lightmap: ${db.toFixed(1)} dB; light not turned ${other.toFixed(1)} dB (${folder})`);
    expect(db).toBeGreaterThan(40);
    expect(other).toBeLessThan(db - 8); // the comparison can fail
  });

  for (const kind of ['sh:2', 'sh:3', 'hl2', 'vector'])
    it(`is lit as render lights it where a normal texture bends normals, and glows by a texture: ${kind}`, async () => {
      const view = '1.6,1.5,2.2,-0.1,0.4,-0.2,40',
        name = kind.replace(':', '');
      writeBumpy(at('bumpy.gltf'));
      lambent(
        'bake',
        at('bumpy.gltf'),
        '--transfer',
        'lightmap',
        '--texels-per-unit',
        '16',
        '--samples',
        '128',
        '--bounces',
        '2',
        '--directional',
        kind,
        '--sky',
        'sky:elevation=30,azimuth=60',
        '-o',
        at(`${name}.glb`),
      );
      const server = await serve(at(`${name}.glb`), '--env', at('light.hdr'));
      const page = await open(browser, server.address, `ui=off&background=none&camera=${view}&exposure=-2`, 640, 480);
      await page.screenshot({ path: at(`page_${name}.png`) });
      await page.close();
      expect(await server.stop()).toBe(0);
      const shot = ['--camera', view, '--size', '640x480', '--spp', '16', '--background', 'none', '--exposure', '-2'];
      renderLinear(at(`${name}.glb`), ...shot, '-o', at(`${name}.png`));
      const db = psnr(at(`page_${name}.png`), at(`${name}.png`));
      console.log(`${kind}: ${db.toFixed(1)} dB (${folder})`);
      expect(db).toBeGreaterThan(40);
    });

  it('is refused in words where the card cannot draw into half floats, or takes no atlas so large', async () => {
    const server = await serve(at('lit.glb'), '--env', at('light.hdr'));
    expect(
      await complaint(browser, server.address, ['EXT_color_buffer_float', 'EXT_color_buffer_half_float'], {}),
    ).toMatch(/^lit\.glb is a lightmap, which needs .*half-float/);
    // The lesser extension will do.
    expect(await complaint(browser, server.address, ['EXT_color_buffer_float'], {})).toBe('');
    expect(await complaint(browser, server.address, [], { MAX_TEXTURE_SIZE: 32 })).toMatch(
      /^lit\.glb has an atlas of .* takes 32$/,
    );
    expect(await server.stop()).toBe(0);
  });
});
