// Visibility in blocks in the browser against `lambent render` of the same file, camera, light and materials; the light
// turned and the material changed by hand.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, renderLinear } from '../test/tool.ts';
import { complaint, drawn, haveBrowser, launch, open, openFixture, psnr, serve, type Server } from './browser.ts';
import { writeScene } from './scenes.ts';

const camera = '3.1,2.6,4.3,-0.3,0.8,0,38',
  rotate = '40,-5,10',
  sky = 'sky:elevation=35,azimuth=60,sun=on';

describe.skipIf(!haveTool || !haveBrowser)('visibility in blocks', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, server: Server, fixture: { page: Page; server: ViteDevServer };

  beforeAll(async () => {
    const scene = writeScene(folder);
    lambent('bake', scene, '--transfer', 'blocks', '--cube', '32', '--visibility', 'bits:3', '-o', at('colours.glb'));
    // Of white, so that `diffuse` times the scene's own colour is that of --brdf.
    writeFileSync(at('scene.mtl'), readFileSync(at('scene.mtl'), 'utf8').replace(/Kd .*/g, 'Kd 1 1 1'));
    lambent('bake', scene, '--transfer', 'blocks', '--cube', '32', '-o', at('white.glb'));
    browser = await launch();
    server = await serve(at('white.glb'), '--compare', at('colours.glb'), '--env', sky);
    fixture = await openFixture(browser, folder, 'webgpu.html'); // for its measure inside outlines
  });
  afterAll(async () => {
    await fixture?.page.close();
    await fixture?.server.close();
    await browser?.close();
    expect(await server?.stop()).toBe(0);
  });

  /** Pages that do not know that their graphics card is a program. */
  const onCard = {
    newPage: async (options) => {
      const page = await browser.newPage(options);
      await page.addInitScript(() => {
        const gl = WebGL2RenderingContext.prototype as unknown as { getExtension: (name: string) => unknown },
          real = gl.getExtension;
        gl.getExtension = function (name) {
          return name === 'WEBGL_debug_renderer_info' ? null : real.call(this, name);
        };
      });
      return page;
    },
  } as Browser;

  async function compare(name: string, baked: string, fragment: string, more: string[], by = onCard): Promise<number> {
    const page = await open(
      by,
      server.address,
      `ui=off&background=none&camera=${camera}&rotate=${rotate}&${fragment}`,
      640,
      480,
    );
    await page.screenshot({ path: at(`${name}_page.png`) });
    await page.close();
    renderLinear(
      ...[at(baked), '--camera', camera, '--size', '640x480', '--spp', '16', '--env', sky, '--env-rotate', rotate],
      ...['--background', 'none', ...more, '-o', at(`${name}_render.png`)],
    );
    const url = (path: string): string => `data:image/png;base64,${readFileSync(path).toString('base64')}`;
    const inside = await fixture.page.evaluate(([a, b]) => window.gpu.inside(a, b), [
      url(at(`${name}_render.png`)),
      url(at(`${name}_page.png`)),
    ] as const);
    const all = psnr(at(`${name}_page.png`), at(`${name}_render.png`));
    console.log(`${name}: ${inside.toFixed(1)} dB inside outlines, ${all.toFixed(1)} dB over all (${folder})`);
    return inside;
  }

  it('looks as render draws it: diffuse, of several levels and in the colours of the scene', async () => {
    expect(await compare('diffuse', 'colours.glb', 'view=compare', [])).toBeGreaterThan(50);
    expect(await compare('processor', 'colours.glb', 'view=compare', [], browser)).toBeGreaterThan(50);
    expect(await compare('binary', 'white.glb', '', [], browser)).toBeGreaterThan(50);
  });
  it('looks as render draws it: Phong, and not as another exponent', async () => {
    const brdf = 'phong:diffuse=0.3,specular=0.5,exponent=50';
    expect(await compare('phong', 'white.glb', `brdf=${brdf}`, ['--brdf', brdf])).toBeGreaterThan(50);
    const other = brdf.replace('50', '20');
    expect(await compare('other', 'white.glb', `brdf=${brdf}`, ['--brdf', other])).toBeLessThan(45);
  });
  it('looks as render draws it: GGX, by the tolerance of the page', async () => {
    for (const roughness of [0.6, 0.4, 0.25]) {
      const brdf = `ggx:roughness=${roughness},f0=0.6`,
        blocks = ['--brdf', brdf, '--method', 'blocks', '--tolerance', '0.02'];
      expect(await compare(`ggx_${roughness}`, 'white.glb', `brdf=${brdf}`, blocks)).toBeGreaterThan(50);
    }
  });
  it('looks as render draws it: lobes of which blocks take 64 samples, by all texels, too', async () => {
    for (const brdf of ['phong:diffuse=0.1,specular=0.8,exponent=20', 'ggx:roughness=0.4,f0=0.6'])
      expect(
        await compare(`standard_${brdf.slice(0, 3)}`, 'white.glb', `brdf=${brdf}`, [
          '--brdf',
          brdf,
          '--method',
          'standard',
        ]),
      ).toBeGreaterThan(50);
  });

  it('changes with its sliders, and keeps them in the address', async () => {
    const page = await open(browser, server.address, `background=none&camera=${camera}`, 900, 700);
    await page.click('#more summary');
    expect(await page.isVisible('#order')).toBe(false);
    const clip = { x: 0, y: 100, width: 400, height: 400 },
      shot = async (): Promise<Buffer> => (await drawn(page), page.screenshot({ clip }));
    const plain = await shot();
    await page.selectOption('#model', 'phong');
    const phong = await shot();
    expect(phong.equals(plain)).toBe(false);
    await page.focus('#slider-2');
    for (let i = 0; i < 10; ++i) await page.keyboard.press('ArrowRight');
    expect((await shot()).equals(phong)).toBe(false);
    await page.focus('#slider-0');
    await page.keyboard.press('End'); // all of the energy is diffuse
    expect(await page.textContent('#slider-value-1')).toBe('0');
    await page.waitForFunction(() => location.hash.includes('brdf=phong:diffuse=1,specular=0'));
    await page.selectOption('#model', 'diffuse');
    expect((await shot()).equals(plain)).toBe(true);
    await page.close();
  });

  it('is refused in words where it is broken, and where the graphics card cannot draw it', async () => {
    const noFloats = ['EXT_color_buffer_float', 'EXT_color_buffer_half_float'];
    expect(await complaint(browser, server.address, noFloats, {})).toBe(''); // the processor sums
    expect(await complaint(browser, `${server.address}#brdf=ggx`, noFloats, {})).toMatch(
      /is shaded, which needs .*half-float/,
    );
    expect(await complaint(browser, server.address, [], { MAX_VERTEX_TEXTURE_IMAGE_UNITS: 1 })).toMatch(
      /^white\.glb is looked up in vertex shaders, .* 2 at once/,
    );
    const whole = readFileSync(at('white.glb')),
      length = whole.readUInt32LE(12),
      json = JSON.parse(whole.toString('utf8', 20, 20 + length)) as {
        bufferViews: { byteOffset?: number }[];
        extensions: { LAMBENT_transfer: { transfer: { bufferView: number } } };
      };
    const { bufferView } = json.extensions.LAMBENT_transfer.transfer;
    whole[28 + length + (json.bufferViews[bufferView]!.byteOffset ?? 0)] = 255; // no sight is 3
    writeFileSync(at('broken.glb'), whole);
    const page = await open(browser, server.address, `camera=${camera}`, 640, 480);
    await page.setInputFiles('#file', at('broken.glb'));
    await page.waitForSelector('#problem:not([hidden])');
    expect(await page.textContent('#problem-text')).toMatch(/^broken\.glb holds broken visibility, at receiver 0/);
    await page.close();
  });
});
