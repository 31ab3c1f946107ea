// A packed file from a slow server: a picture of its first bands before the last byte is sent, and in the end the
// picture of the whole file to the byte; a sentence where the connection breaks.
import { existsSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { createServer, type ServerResponse } from 'node:http';
import type { AddressInfo } from 'node:net';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { afterAll, afterEach, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, readPacked } from '../test/tool.ts';
import { drawn, haveBrowser, launch, openFixture, psnr, ready } from './browser.ts';
import type { Backend } from './fixture/webgpu.ts';
import { writeScene } from './scenes.ts';

const camera = '3.1,2.6,4.3,-0.3,0.8,0,38',
  sky = 'sky:elevation=30,azimuth=60,sun=on',
  types: Record<string, string> = { html: 'text/html', js: 'text/javascript', css: 'text/css' };

/** Bytes of a packed file before its first picture can be drawn. */
function firstBytes(path: string): number {
  const { document } = readPacked(path),
    view = document.bufferViews[document.extensions.LAMBENT_transfer.transfer.bufferView]!,
    { byteLength } = view.extensions!.LAMBENT_transfer!.first as { byteLength: number };
  return 28 + readFileSync(path).readUInt32LE(12) + view.byteOffset! + byteLength;
}

describe.skipIf(!haveTool || !haveBrowser)('a packed file that comes slowly', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name),
    files = { vertices: [] as string[], atlas: [] as string[], glossy: [] as string[] };
  let browser: Browser, fixture: { page: Page; server: ViteDevServer }, address: string;

  // Any server of files, which sends so many bytes of a packed file and waits; then the others, or hangs up.
  let held: number | undefined,
    waiting: ((how: 'send' | 'hang up') => void)[] = [],
    sent = 0;
  async function sendSlowly(bytes: Buffer, response: ServerResponse): Promise<void> {
    const pieces = async (from: number, to: number): Promise<void> => {
      for (let i = from; i < to; i += 4096) {
        sent = Math.min(i + 4096, to);
        response.write(bytes.subarray(i, sent));
        await new Promise((resolve) => setTimeout(resolve, 1));
      }
    };
    const until = held!;
    await pieces(0, until);
    const how = await new Promise<'send' | 'hang up'>((resolve) => waiting.push(resolve));
    if (how === 'hang up') return void response.destroy();
    await pieces(until, bytes.length);
    response.end();
  }
  const goOn = (how: 'send' | 'hang up' = 'send'): void => {
    for (const go of waiting) go(how);
    waiting = [];
    held = undefined; // whoever asks again is served at once
  };
  const host = createServer((request, response) => {
    const path = new URL(request.url ?? '/', 'http://host').pathname.replace(/\/$/, '/index.html'),
      everyone = { 'access-control-allow-origin': '*' };
    if (path === '/go' || path === '/hang-up') {
      goOn(path === '/go' ? 'send' : 'hang up');
      return void response.writeHead(204, everyone).end();
    }
    if (!existsSync(join(folder, path))) return void response.writeHead(404).end();
    const bytes = readFileSync(join(folder, path));
    response.writeHead(200, {
      ...everyone,
      'content-type': types[path.replace(/.*\./, '')] ?? 'application/octet-stream',
      'content-length': bytes.length,
    });
    if (path.endsWith('scene.glb') && held !== undefined) void sendSlowly(bytes, response);
    else response.end(bytes);
  });

  beforeAll(async () => {
    const scene = writeScene(folder);
    files.vertices = ['--samples', '128'];
    files.atlas = ['--transfer', 'lightmap', '--texels-per-unit', '12', '--samples', '64', '--order', '5'];
    files.atlas.push('--emit', 'white=0.5,0.4,0.2', '--light-groups');
    files.glossy = ['--transfer', 'matrix', '--order', '5', '--outgoing', 'svd:4', '--samples', '32'];
    for (const [name, options] of Object.entries(files)) {
      lambent('bake', scene, ...options, '-o', at(`${name}.glb`));
      lambent('export', at(`${name}.glb`), '--env', sky, '--web', at(name), '--pack', 'auto');
      const packed = at(`${name}/data/scene.glb`),
        [before, all, first] = [statSync(at(`${name}.glb`)).size, statSync(packed).size, firstBytes(packed)];
      console.log(
        `${name}: ${first} bytes before the first picture, ${((100 * first) / all).toFixed(0)} % of ${all} that are ` +
          `packed, ${((100 * first) / before).toFixed(0)} % of ${before} that are not`,
      );
      expect(first).toBeLessThan(before / 2);
    }
    writeFileSync(
      at('element.html'),
      `<!doctype html><script type="module" src="vertices/lambent-viewer.js"></script>
<lambent-viewer src="vertices/data/scene.glb" env="${sky}" camera="${camera}" exposure="-2" tone="none">
</lambent-viewer>
<script>window.heard = []; for (const name of ['first', 'load', 'error'])
document.querySelector('lambent-viewer').addEventListener(name, () => window.heard.push(name));</script>`,
    );
    await new Promise<void>((resolve) => host.listen(0, '127.0.0.1', resolve));
    address = `http://127.0.0.1:${(host.address() as AddressInfo).port}/`;
    browser = await launch();
    fixture = await openFixture(browser, folder, 'webgpu.html');
  });
  afterEach(() => {
    goOn('hang up');
  });
  afterAll(async () => {
    goOn('hang up');
    await fixture?.page.close();
    await fixture?.server.close();
    await browser?.close();
    host.close();
  });

  const all = (): number => statSync(at('vertices/data/scene.glb')).size;
  const view = `background=none&camera=${camera}&exposure=-2&tone=none`;
  async function openSlowly(more = ''): Promise<Page> {
    held = firstBytes(at('vertices/data/scene.glb'));
    sent = 0;
    const page = await browser.newPage({ viewport: { width: 640, height: 480 }, deviceScaleFactor: 1 });
    page.on('pageerror', (error) => console.error('page:', error.message));
    await page.goto(`${address}vertices/#${view}${more}`);
    await page.waitForSelector('body[data-bands]');
    await drawn(page);
    return page;
  }
  async function openWhole(more = ''): Promise<Page> {
    const page = await browser.newPage({ viewport: { width: 640, height: 480 }, deviceScaleFactor: 1 });
    await page.goto(`${address}vertices/#${view}${more}`);
    await ready(page);
    return page;
  }
  /** What is drawn, without what is said beside it. */
  async function shot(page: Page, name: string): Promise<Buffer> {
    await drawn(page);
    const show = (visibility: string): Promise<void> =>
      page.evaluate((visibility) => {
        for (const of of document.querySelectorAll<HTMLElement>('main > :not(canvas)'))
          of.style.visibility = visibility;
      }, visibility);
    await show('hidden');
    const picture = await page.screenshot({ path: at(`${name}.png`) });
    await show('');
    return picture;
  }

  it('is drawn by its first bands before the rest is sent, then by all', async () => {
    const page = await openSlowly();
    expect(sent).toBe(firstBytes(at('vertices/data/scene.glb')));
    expect(sent).toBeLessThan(all());
    expect(await page.getAttribute('body', 'data-ready')).toBeNull();
    const first = await shot(page, 'first');
    // How far it is, beside the picture.
    expect(await page.isVisible('#loading')).toBe(true);
    expect(await page.textContent('#loading-what')).toMatch(/^Loading vertices\.glb: .* MB, drawn by 3 of 6 bands$/);
    const share = await page.evaluate(() => document.querySelector<HTMLProgressElement>('#loading-share')!.value);
    expect(share).toBeCloseTo(sent / all(), 3);
    await page.screenshot({ path: at('first_page.png') });
    const box = (await page.locator('#loading').boundingBox())!;
    expect(box.height).toBeLessThan(80);
    goOn();
    await ready(page);
    expect(sent).toBe(all());
    expect(await page.isVisible('#loading')).toBe(false);
    await shot(page, 'last');
    // The same file, loaded at once: opened from the disk, which shows all of it.
    await page.evaluate(() => document.getElementById('reset-view')!.click());
    const framed = await shot(page, 'framed');
    await page.setInputFiles('#file', at('vertices/data/scene.glb'));
    await page.waitForFunction(() => document.title === 'scene.glb');
    expect((await shot(page, 'opened')).equals(framed)).toBe(true);
    await page.close();
    // A picture of its own bands: of the whole file the same are drawn by the slider.
    const three = await openWhole('&order=3');
    expect((await shot(three, 'three')).equals(first)).toBe(true);
    await three.close();
    const apart = psnr(at('first.png'), at('last.png'));
    console.log(`the first picture against the last: ${apart.toFixed(1)} dB (${folder})`);
    expect(apart).toBeGreaterThan(25);
    expect(apart).toBeLessThan(60); // there is something to come
  });

  it('keeps its first bands where the connection breaks, and says so', async () => {
    const page = await openSlowly(),
      first = await shot(page, 'kept');
    goOn('hang up');
    await page.waitForSelector('#problem:not([hidden])');
    const [some, whole] = [sent, all()].map((bytes) => bytes.toLocaleString('en'));
    expect(await page.textContent('#problem-text')).toBe(
      `vertices.glb broke off after ${some} of ${whole} bytes: what is shown are its first 3 bands of 6`,
    );
    await page.screenshot({ path: at('broken_page.png') });
    expect(await page.isVisible('#loading')).toBe(false);
    expect((await shot(page, 'broken')).equals(first)).toBe(true);
    // The light may still be turned.
    await page.click('#problem-close');
    await page.focus('#picture');
    await page.keyboard.press('Shift+ArrowLeft');
    expect((await shot(page, 'broken_turned')).equals(first)).toBe(false);
    await page.close();
  });

  it('takes what was done meanwhile: the light that was turned, another file', async () => {
    const page = await openSlowly();
    await page.focus('#picture');
    for (let i = 0; i < 8; ++i) await page.keyboard.press('Shift+ArrowLeft');
    await page.waitForFunction(() => location.hash.includes('rotate='));
    await drawn(page);
    const hash = await page.evaluate(() => location.hash);
    goOn();
    await ready(page);
    await shot(page, 'turned');
    await page.close();
    const whole = await browser.newPage({ viewport: { width: 640, height: 480 }, deviceScaleFactor: 1 });
    await whole.goto(`${address}vertices/${hash}`);
    await ready(whole);
    await shot(whole, 'turned_whole');
    console.log(`turned before the rest was there: ${psnr(at('turned.png'), at('turned_whole.png')).toFixed(1)} dB`);
    expect(psnr(at('turned.png'), at('turned_whole.png'))).toBeGreaterThan(60); // the address rounds angles
    await whole.close();

    const other = await openSlowly();
    await other.setInputFiles('#file', at('atlas.glb'));
    await other.waitForFunction(() => document.title === 'atlas.glb');
    const before = await shot(other, 'other');
    goOn();
    await ready(other);
    expect((await shot(other, 'other_after')).equals(before)).toBe(true);
    expect(await other.isVisible('#problem')).toBe(false);
    await other.close();
  });

  it('is drawn so by the element of one file', async () => {
    const page = await browser.newPage({ viewport: { width: 640, height: 500 }, deviceScaleFactor: 1 });
    held = firstBytes(at('vertices/data/scene.glb'));
    await page.goto(`${address}element.html`);
    const heard = (): Promise<string[]> => page.evaluate(() => (window as unknown as { heard: string[] }).heard),
      words = (): Promise<string> =>
        page.evaluate(() => document.querySelector('lambent-viewer')!.shadowRoot!.querySelector('p')!.textContent);
    await expect.poll(heard, { timeout: 30_000 }).toEqual(['first']);
    expect(await words()).toBe(`Loading: ${Math.round((100 * sent) / all())} %`);
    await drawn(page);
    await page.locator('lambent-viewer').screenshot({ path: at('element_first.png') });
    goOn();
    await expect.poll(heard, { timeout: 30_000 }).toEqual(['first', 'load']);
    expect(await words()).toBe('');
    await drawn(page);
    await page.locator('lambent-viewer').screenshot({ path: at('element_last.png') });
    const apart = psnr(at('element_first.png'), at('element_last.png'));
    expect(apart).toBeLessThan(60);
    await page.close();
    const broken = await browser.newPage({ viewport: { width: 640, height: 500 }, deviceScaleFactor: 1 });
    held = firstBytes(at('vertices/data/scene.glb'));
    await broken.goto(`${address}element.html`);
    await broken.waitForFunction(() => (window as unknown as { heard: string[] }).heard.includes('first'));
    goOn('hang up');
    await broken.waitForFunction(() => (window as unknown as { heard: string[] }).heard.includes('error'));
    expect(
      await broken.evaluate(
        () => document.querySelector('lambent-viewer')!.shadowRoot!.querySelector('p')!.textContent,
      ),
    ).toMatch(/^vertices\/data\/scene\.glb broke off after .*: what is shown are its first 3 bands of 6$/);
    await broken.close();
  });

  const backends: Backend[] = ['webgl', 'webgpu', 'fallback'];
  for (const name of Object.keys(files))
    it(`is loaded so by the package, on each renderer: ${name}`, async () => {
      const packed = at(`${name}/data/scene.glb`),
        size = [320, 240],
        url = `${address}${name}/data/scene.glb`;
      const hasWebGpu = await fixture.page.evaluate(async () =>
        Boolean(await (navigator as { gpu?: { requestAdapter(): Promise<unknown> } }).gpu?.requestAdapter()),
      );
      for (const backend of backends.filter((of) => hasWebGpu || of !== 'webgpu'))
        for (const how of ['go', 'hang-up']) {
          held = firstBytes(packed);
          const { bands, bytes, problem, ...pictures } = await fixture.page.evaluate(
            ([backend, shot, go]) => window.gpu.comes(backend, shot, go),
            [
              backend,
              { path: url, light: sky, camera: camera.split(',').map(Number), size },
              `${address}${how}`,
            ] as const,
          );
          for (const [which, png] of Object.entries(pictures))
            writeFileSync(at(`${name}_${backend}_${how}_${which}.png`), Buffer.from(png.replace(/.*,/, ''), 'base64'));
          expect(bands).toBe(3);
          expect(bytes).toBe(firstBytes(packed));
          expect(pictures.first).toBe(pictures.low);
          expect(pictures.whole).not.toBe(pictures.low);
          if (how === 'go') {
            expect(problem).toBe('');
            expect(pictures.last).toBe(pictures.whole);
          } else {
            expect(problem).toContain(`LambentError: ${url} broke off after ${bytes.toLocaleString('en')} of`);
            expect(pictures.last).toBe(pictures.first);
          }
        }
      const apart = psnr(at(`${name}_webgl_go_first.png`), at(`${name}_webgl_go_last.png`));
      console.log(`${name}: the first picture against the last: ${apart.toFixed(1)} dB`);
    });
});
