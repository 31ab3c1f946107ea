// The example pages, as they stand: each draws its scene, and complains of nothing.
import { existsSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import type { Browser } from 'playwright-core';
import { createServer, type ViteDevServer } from 'vite';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, writeLopsidedHdr } from '../test/tool.ts';
import { haveBrowser, launch } from './browser.ts';
import { writeScene } from './scenes.ts';

const path = (name: string): string => fileURLToPath(new URL(name, import.meta.url)),
  element = path('../../build/web/lambent-viewer.js');

describe.skipIf(!haveTool || !haveBrowser)('the example', () => {
  const folder = makeFolder();
  let browser: Browser, server: ViteDevServer;

  beforeAll(async () => {
    writeLopsidedHdr(join(folder, 'sky.hdr'));
    const lattice = ['--lattice', '4,3,4', '--lattice-order', '3'];
    lambent('bake', writeScene(folder), '--samples', '64', '--order', '4', ...lattice, '-o', join(folder, 'scene.glb'));
    browser = await launch();
    server = await createServer({
      root: path('../examples'),
      configFile: false,
      logLevel: 'error',
      cacheDir: path('../../build/web-tests/examples-cache'),
      resolve: {
        alias: [
          { find: /^lambent-three$/, replacement: path('../src/index.ts') },
          { find: /^lambent-three\/webgpu$/, replacement: path('../src/webgpu.ts') },
        ],
      },
      optimizeDeps: { entries: ['*.ts'] },
      server: { host: '127.0.0.1', port: 0, hmr: false, fs: { allow: [path('..')] } },
    });
    await server.listen();
  });
  afterAll(async () => {
    await browser?.close();
    await server?.close();
  });

  it.each(['element', 'webgpu', 'probes'])('%s draws its scene, and complains of nothing', async (name) => {
    if (name === 'element') expect(existsSync(element), 'the page is built (scripts/web --build)').toBe(true);
    const page = await browser.newPage({ viewport: { width: 400, height: 320 } }),
      complaints: string[] = [],
      address = server.resolvedUrls!.local[0]!;
    page.on('pageerror', (error) => complaints.push(error.message));
    page.on('console', (message) => message.type() === 'error' && complaints.push(message.text()));
    page.on(
      'request',
      (r) => void (/^(blob|data):/.test(r.url()) || r.url().startsWith(address) || complaints.push(r.url())),
    );
    for (const file of ['scene.glb', 'sky.hdr'])
      await page.route(`**/${file}`, (route) => route.fulfill({ body: readFileSync(join(folder, file)) }));
    await page.route('**/lambent-viewer.js', (route) =>
      route.fulfill({ body: readFileSync(element), contentType: 'text/javascript' }),
    );
    // As it stands, without what the server would put into it, which its policy forbids.
    if (name === 'element')
      await page.route('**/element.html', (route) =>
        route.fulfill({ body: readFileSync(path('../examples/element.html')), contentType: 'text/html' }),
      );
    // On its WebGL 2 backend: headless, a canvas of WebGPU is blank. webgpu.test.ts has both, into targets.
    await page.addInitScript(() => Object.defineProperty(Navigator.prototype, 'gpu', { value: undefined }));
    await page.goto(`${address}${name}.html`);
    // Of the picture, how many different colours there are: a plain one has few. A canvas is read as soon as it is
    // drawn, which the slider asks for.
    const colours = (): Promise<number> =>
      page.evaluate(() => {
        const canvas = (document.querySelector('lambent-viewer')?.shadowRoot ?? document).querySelector('canvas')!;
        document.querySelector('input')?.dispatchEvent(new Event('input'));
        const context = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d')!;
        context.drawImage(canvas, 0, 0);
        const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
        return new Set(new Uint32Array(data.buffer)).size;
      });
    const shown = async (): Promise<number> => {
      if (name !== 'element') return colours();
      const png = (await page.locator('lambent-viewer').screenshot()).toString('base64');
      return page.evaluate(async (data) => {
        const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0)),
          image = await createImageBitmap(new Blob([bytes], { type: 'image/png' })),
          context = new OffscreenCanvas(image.width, image.height).getContext('2d')!;
        context.drawImage(image, 0, 0);
        return new Set(new Uint32Array(context.getImageData(0, 0, image.width, image.height).data.buffer)).size;
      }, png);
    };
    await page.waitForSelector(name === 'element' ? 'lambent-viewer' : 'canvas');
    await expect.poll(shown, { timeout: 120_000, interval: 1000 }).toBeGreaterThan(200);
    expect(complaints).toEqual([]);
    if (name === 'element') {
      // Another light, by an attribute; then what cannot be read, in words.
      const shadow = (): Promise<string> =>
        page.evaluate(() => document.querySelector('lambent-viewer')!.shadowRoot!.querySelector('p')!.textContent);
      await page.evaluate(() => document.querySelector('lambent-viewer')!.setAttribute('env', 'sky:elevation=200'));
      await expect
        .poll(shadow)
        .toBe('sky:elevation=200 is no sky: elevation, azimuth, turbidity, ground and sun are its keys');
      await page.evaluate(() => document.querySelector('lambent-viewer')!.setAttribute('src', 'nowhere.glb'));
      await page.route('**/nowhere.glb', (route) => route.fulfill({ status: 404 }));
      await expect.poll(shadow).toMatch(/nowhere\.glb|sky:elevation=200/);
    }
    await page.close();
  });
});
