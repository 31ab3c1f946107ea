// The page under the hand, and what it says when something is wrong.
import { copyFileSync, existsSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createServer, request } from 'node:http';
import type { AddressInfo } from 'node:net';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, writeHdr } from '../test/tool.ts';
import { complaint, drawn, haveBrowser, launch, open, serve, type Server } from './browser.ts';
import { writeBall, writeScene, writeSkin } from './scenes.ts';

describe.skipIf(!haveTool || !haveBrowser)('the page', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, server: Server;

  beforeAll(async () => {
    writeBall(at('ball.obj'));
    // One lamp towards (0, 0.2, 1), where the camera is: three quarters of the way to the right is +Z.
    writeHdr(at('lamp.hdr'), 64, 32, (x, y) =>
      Math.hypot(x - 47.5, y - 14) < 3 ? [250, 240, 220, 133] : [20, 22, 30, 124],
    );
    lambent('bake', at('ball.obj'), '--samples', '256', '-o', at('ball.glb'));
    lambent('compress', at('ball.glb'), '--zonal', '2', '-o', at('lobes.glb'));
    browser = await launch();
    server = await serve(at('ball.glb'), '--env', at('lamp.hdr'));
  });
  afterAll(async () => {
    await browser?.close();
    await server?.stop();
  });

  /**
   * Where the light is on the picture: the mean place of luminance beyond half its peak, right and down from the
   * middle.
   */
  async function highlight(page: Page): Promise<{ x: number; y: number }> {
    const png = (await page.screenshot()).toString('base64');
    return page.evaluate(async (data) => {
      const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${data}`)).blob());
      const canvas = new OffscreenCanvas(image.width, image.height),
        context = canvas.getContext('2d')!;
      context.drawImage(image, 0, 0);
      const pixels = context.getImageData(0, 0, image.width, image.height).data;
      let peak = 0,
        sum = 0,
        x = 0,
        y = 0;
      for (let i = 0; i < pixels.length; i += 4) peak = Math.max(peak, pixels[i + 1]!);
      for (let i = 0; i < pixels.length; i += 4) {
        const w = Math.max(0, pixels[i + 1]! - 0.5 * peak),
          k = i / 4;
        sum += w;
        x += w * ((k % image.width) - image.width / 2);
        y += w * (Math.floor(k / image.width) - image.height / 2);
      }
      return { x: x / sum, y: y / sum };
    }, png);
  }
  async function drag(page: Page, dx: number, dy: number, shift: boolean): Promise<void> {
    if (shift) await page.keyboard.down('Shift');
    await page.mouse.move(200, 200);
    await page.mouse.down();
    await page.mouse.move(200 + dx, 200 + dy, { steps: 5 });
    await page.mouse.up();
    if (shift) await page.keyboard.up('Shift');
    await drawn(page);
  }

  // From the front, and from a skew place above: the hand moves on the screen, whatever the world's axes are.
  for (const eye of ['0,0.8,5', '2.4,3.1,3.2'])
    it(`turns the light with the hand, seen from ${eye}`, async () => {
      const page = await open(
        browser,
        server.address,
        `ui=off&background=none&exposure=-2&camera=${eye},0,0,0,35`,
        400,
        400,
      );
      const start = await highlight(page);
      await drag(page, 60, 0, true);
      const right = await highlight(page);
      expect(right.x).toBeGreaterThan(start.x + 15);
      expect(Math.abs(right.y - start.y)).toBeLessThan(15);
      await drag(page, 0, 60, true);
      const down = await highlight(page);
      expect(down.y).toBeGreaterThan(right.y + 15);
      await drag(page, 0, -60, true);
      await drag(page, -60, 0, true);
      const back = await highlight(page);
      expect(Math.hypot(back.x - start.x, back.y - start.y)).toBeLessThan(3);
      await page.focus('#picture');
      await page.keyboard.press('Shift+ArrowLeft');
      await drawn(page);
      expect((await highlight(page)).x).toBeLessThan(back.x - 5);
      await page.close();
    });

  it('looks around without Shift: the light stays with the world', async () => {
    const page = await open(
      browser,
      server.address,
      'ui=off&background=none&exposure=-2&camera=0,0.8,5,0,0,0,35',
      400,
      400,
    );
    const start = await highlight(page);
    await drag(page, 60, 0, false);
    // The ball turns with the hand, its highlight on it.
    expect((await highlight(page)).x).toBeGreaterThan(start.x + 15);
    await page.waitForFunction(() => /camera=/.test(location.hash));
    expect(new URL(page.url()).hash).not.toContain('rotate');
    await page.close();
  });

  it('keeps what it shows in its address', async () => {
    const page = await open(
      browser,
      server.address,
      'camera=0,0.8,5,0,0,0,35&rotate=40,-25,70&exposure=-1.5&tone=agx' +
        '&order=4&window=hann&against=unshadowed&wipe=0.25',
      400,
      400,
    );
    await page.waitForTimeout(500);
    const state = new URLSearchParams(new URL(page.url()).hash.slice(1));
    expect(
      state
        .get('rotate')!
        .split(',')
        .map(Number)
        .map((v) => Math.round(v)),
    ).toEqual([40, -25, 70]);
    expect(Object.fromEntries(state)).toMatchObject({
      exposure: '-1.5',
      tone: 'agx',
      order: '4',
      window: 'hann',
      against: 'unshadowed',
      wipe: '0.25',
    });
    await page.close();
  });

  it.each(['ball.glb', 'lobes.glb'])('uploads nothing but uniforms when the light turns: %s', async (name) => {
    const other = await serve(at(name), '--env', at('lamp.hdr')),
      page = await browser.newPage({ viewport: { width: 400, height: 400 } });
    await page.addInitScript(() => {
      const counts = { uploads: 0, uniformBytes: 0 },
        gl = WebGL2RenderingContext.prototype as unknown as Record<string, (...a: unknown[]) => unknown>;
      (window as unknown as { counts: typeof counts }).counts = counts;
      for (const name of Object.getOwnPropertyNames(WebGL2RenderingContext.prototype)) {
        const isUpload =
            /^(buffer(Sub)?Data|(compressed)?tex(Sub)?Image[23]D|copyBufferSubData|texStorage[23]D)$/i.test(name),
          isUniform = /^uniform(Matrix)?\d/.test(name);
        if (!isUpload && !isUniform) continue;
        const real = gl[name]!;
        gl[name] = function (this: unknown, ...args: unknown[]) {
          if (isUpload) ++counts.uploads;
          else
            counts.uniformBytes += args
              .slice(1)
              .reduce<number>(
                (n, a) => n + (typeof a === 'number' ? 4 : ((a as { length?: number })?.length ?? 0) * 4),
                0,
              );
          return real.apply(this, args);
        };
      }
    });
    await page.goto(`${other.address}#ui=off&camera=0,0.8,5,0,0,0,35&exposure=0`);
    await page.waitForSelector('body[data-ready=yes]', { state: 'attached' });
    await drawn(page);
    const counts = (): Promise<{ uploads: number; uniformBytes: number }> =>
      page.evaluate(() => ({ ...(window as unknown as { counts: { uploads: number; uniformBytes: number } }).counts }));
    const before = await counts();
    expect(before.uploads).toBeGreaterThan(3); // the counter counts
    await page.focus('#picture');
    for (let i = 0; i < 10; ++i) {
      await page.keyboard.press('Shift+ArrowLeft');
      await drawn(page);
    }
    const after = await counts();
    expect(after.uploads - before.uploads).toBe(0);
    // Ten light changes, each drawn once: 432 bytes of light and the matrices of two draws.
    const each = (after.uniformBytes - before.uniformBytes) / 10;
    console.log(`turning the light of ${name}: 0 uploads, ${each.toFixed(0)} bytes of uniforms a frame`);
    expect(each).toBeGreaterThan(432);
    expect(each).toBeLessThan(2000);
    await page.close();
    await other.stop();
  });

  it('wipes with the hand and with the keys', async () => {
    const page = await open(browser, server.address, 'camera=0,0.8,5,0,0,0,35&against=coefficient&wipe=0.5', 400, 400);
    const share = (): Promise<number> =>
      page.evaluate(() => Number(document.getElementById('wipe')!.getAttribute('aria-valuenow')));
    // Left of the line at first, below its labels.
    const middle = (): Promise<Buffer> => page.screenshot({ clip: { x: 150, y: 195, width: 20, height: 40 } });
    const before = await middle(),
      box = (await page.locator('#wipe').boundingBox())!;
    expect(await share()).toBe(50);
    await page.mouse.move(box.x + box.width / 2, 200); // clear of the controls
    await page.mouse.down();
    await page.mouse.move(100, 200, { steps: 5 });
    await page.mouse.up();
    await drawn(page);
    expect(Math.abs((await share()) - 25)).toBeLessThan(3);
    expect((await middle()).equals(before)).toBe(false); // the other view lies there now
    await page.focus('#wipe');
    await page.keyboard.press('End');
    await drawn(page);
    expect(await share()).toBe(100);
    expect((await middle()).equals(before)).toBe(true);
    await page.close();
  });

  it('plays an animation and stands still where it was stopped', async () => {
    writeSkin(at('skin.glb'), 0.3);
    lambent('bake', at('skin.glb'), '--samples', '64', '--bounces', '0', '-o', at('skinned.glb'));
    const other = await serve(at('skinned.glb'), '--env', at('lamp.hdr'));
    const page = await open(browser, other.address, '', 400, 400),
      middle = (): Promise<Buffer> => page.screenshot({ clip: { x: 100, y: 110, width: 200, height: 150 } });
    const rest = await middle();
    await page.click('#play');
    await page.waitForTimeout(400);
    expect((await middle()).equals(rest)).toBe(false);
    await page.click('#play');
    await drawn(page);
    const stopped = await middle();
    await page.waitForFunction(() => /time=/.test(location.hash));
    expect((await middle()).equals(stopped)).toBe(true);
    await page.reload();
    await page.waitForSelector('body[data-ready=yes]', { state: 'attached' });
    await drawn(page);
    expect((await middle()).equals(rest)).toBe(false); // the address keeps the time
    await page.close();
    await other.stop();
  });

  it('opens an environment from a file', async () => {
    const page = await open(browser, server.address, 'ui=off&background=none&camera=0,0.8,5,0,0,0,35', 400, 400);
    const lamp = await highlight(page);
    // The same lamp on the other side of the map: from behind the ball, so that its rim shines.
    writeHdr(at('behind.hdr'), 64, 32, (x, y) =>
      Math.hypot(x - 15.5, y - 4) < 3 ? [250, 240, 220, 133] : [20, 22, 30, 124],
    );
    await page.setInputFiles('#file', at('behind.hdr'));
    await page.waitForFunction(
      () => (document.getElementById('env') as HTMLSelectElement).selectedOptions[0]?.text === 'behind.hdr',
    );
    await drawn(page);
    expect((await highlight(page)).y).toBeLessThan(lamp.y - 30);
    await page.close();
  });

  const bad: [string, (folder: string) => string, RegExp][] = [
    [
      'a file cut off',
      (f) => (writeFileSync(join(f, 'cut.glb'), readFileSync(join(f, 'ball.glb')).subarray(0, 5000)), 'cut.glb'),
      /^cut\.glb is cut off/,
    ],
    [
      'a scene that is not baked',
      (f) => (
        lambent('bake', join(f, 'ball.obj'), '--samples', '16', '-o', join(f, 'other.glb')),
        plain(f),
        'plain.glb'
      ),
      /^plain\.glb is not a baked file/,
    ],
    [
      'a picture for an environment',
      (f) => (writeFileSync(join(f, 'picture.hdr'), 'GIF89a nothing'), 'picture.hdr'),
      /^picture\.hdr is no environment/,
    ],
    ['an empty file', (f) => (writeFileSync(join(f, 'empty.glb'), ''), 'empty.glb'), /^empty\.glb is empty/],
  ];
  /** ball.glb with its extension under a name that nobody knows. */
  function plain(f: string): void {
    copyFileSync(join(f, 'ball.glb'), join(f, 'plain.glb'));
    writeFileSync(
      join(f, 'plain.glb'),
      Buffer.from(
        readFileSync(join(f, 'ball.glb')).toString('latin1').replaceAll('LAMBENT_transfer', 'SOMEBODY_elses_x'),
        'latin1',
      ),
    );
  }
  for (const [name, make, message] of bad)
    it(`says what is wrong with ${name}, and shows on`, async () => {
      const page = await open(browser, server.address, 'camera=0,0.8,5,0,0,0,35', 400, 400);
      await page.setInputFiles('#file', at(make(folder)));
      await page.waitForSelector('#problem:not([hidden])');
      expect(await page.textContent('#problem-text')).toMatch(message);
      await page.click('#problem-close');
      expect(await page.isVisible('#problem')).toBe(false);
      await page.close();
    });

  it('says so when the graphics context is lost, and draws again when it is back', async () => {
    const page = await open(browser, server.address, 'camera=0,0.8,5,0,0,0,35', 400, 400);
    // Clear of the controls.
    const middle = (): Promise<Buffer> => page.screenshot({ clip: { x: 100, y: 110, width: 200, height: 180 } });
    const before = await middle();
    await page.evaluate(() => {
      const gl = (document.getElementById('picture') as HTMLCanvasElement).getContext('webgl2')!,
        lose = gl.getExtension('WEBGL_lose_context')!;
      (window as unknown as { lose: WEBGL_lose_context }).lose = lose;
      lose.loseContext();
    });
    await page.waitForSelector('#problem:not([hidden])');
    expect((await middle()).equals(before)).toBe(false);
    await page.evaluate(() => (window as unknown as { lose: WEBGL_lose_context }).lose.restoreContext());
    await page.waitForSelector('#problem', { state: 'hidden' });
    await page.waitForTimeout(500);
    await drawn(page);
    expect((await middle()).equals(before)).toBe(true);
    await page.close();
  });

  it('says so where there is no WebGL 2', async () => {
    const page = await browser.newPage();
    await page.addInitScript(() => {
      const real = Reflect.get(HTMLCanvasElement.prototype, 'getContext') as (
        this: HTMLCanvasElement,
        kind: string,
        ...rest: unknown[]
      ) => unknown;
      HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, ...rest: unknown[]) {
        return kind.startsWith('webgl') ? null : real.call(this, kind, ...rest);
      } as typeof HTMLCanvasElement.prototype.getContext;
    });
    await page.goto(server.address);
    await page.waitForSelector('#problem:not([hidden])');
    expect(await page.textContent('#problem-text')).toMatch(/no WebGL 2/);
    await page.close();
  });

  it('says so where vertex shaders read no textures, and needs no drawing into floats', async () => {
    expect(await complaint(browser, server.address, [], { MAX_VERTEX_TEXTURE_IMAGE_UNITS: 0 })).toMatch(
      /^ball\.glb is relit in vertex shaders, .* reads 0 there$/,
    );
    expect(
      await complaint(
        browser,
        server.address,
        ['EXT_color_buffer_float', 'EXT_color_buffer_half_float', 'OES_texture_float_linear'],
        {},
      ),
    ).toBe('');
  });

  it('asks no other host for anything', async () => {
    const page = await browser.newPage(),
      foreign: string[] = [];
    page.on(
      'request',
      (request) =>
        void (
          /^(blob|data):/.test(request.url()) ||
          request.url().startsWith(server.address) ||
          foreign.push(request.url())
        ),
    );
    await page.goto(server.address);
    await page.waitForSelector('body[data-ready=yes]', { state: 'attached' });
    expect(foreign).toEqual([]);
    await page.close();
  });

  it('fits a phone: every control can be reached', async () => {
    const page = await open(browser, server.address, '', 360, 640);
    for (const id of ['env', 'open', 'exposure', 'turn', 'more']) {
      const box = (await page.locator(`#${id}`).boundingBox())!;
      expect(box.x).toBeGreaterThanOrEqual(0);
      expect(box.x + box.width).toBeLessThanOrEqual(360);
      expect(box.y + box.height).toBeLessThanOrEqual(640);
    }
    expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(360);
    await page.close();
  });
});

describe.skipIf(!haveTool || !haveBrowser)('an exported folder', () => {
  const folder = makeFolder(),
    types: Record<string, string> = { html: 'text/html', js: 'text/javascript', css: 'text/css' };
  // Any server of files; the page lies in a folder of it.
  const host = createServer((request, response) => {
    const path = join(folder, new URL(request.url ?? '/', 'http://host').pathname.replace(/\/$/, '/index.html'));
    if (!existsSync(path)) return void response.writeHead(404).end();
    response
      .writeHead(200, { 'content-type': types[path.replace(/.*\./, '')] ?? 'application/octet-stream' })
      .end(readFileSync(path));
  });
  let browser: Browser,
    address = '';

  beforeAll(async () => {
    writeBall(join(folder, 'ball.obj'));
    lambent('bake', join(folder, 'ball.obj'), '--samples', '64', '-o', join(folder, 'ball.glb'));
    lambent(
      'export',
      join(folder, 'ball.glb'),
      '--env',
      'sky:elevation=20,azimuth=70',
      '--web',
      join(folder, 'site'),
      '--pack',
      'auto',
    );
    await new Promise<void>((resolve) => host.listen(0, '127.0.0.1', resolve));
    address = `http://127.0.0.1:${(host.address() as AddressInfo).port}/site/`;
    browser = await launch();
  });
  afterAll(async () => {
    await browser?.close();
    host.close();
  });

  it('shows its scene from any server', async () => {
    const page = await open(browser, address, '', 400, 400);
    expect(await page.textContent('#name')).toBe('ball.glb');
    expect(await page.textContent('#env')).toBe('sky:elevation=20,azimuth=70');
    await page.close();
  });

  it('asks for a file where it has none, and takes it', async () => {
    rmSync(join(folder, 'site/lambent.json'));
    const page = await open(browser, address, '', 400, 400);
    expect(await page.isVisible('#invitation')).toBe(true);
    await page.setInputFiles('#file', join(folder, 'ball.glb'));
    await page.waitForFunction(() => document.title === 'ball.glb');
    expect(await page.isVisible('#invitation')).toBe(false);
    expect(await page.isVisible('#problem')).toBe(false);
    await page.close();
  });
});

describe.skipIf(!haveTool || !haveBrowser)('the server', () => {
  it('serves its table of files and nothing else', async () => {
    const folder = makeFolder(),
      scene = writeScene(folder);
    lambent('bake', scene, '--samples', '64', '-o', join(folder, 'scene.glb'));
    const server = await serve(join(folder, 'scene.glb'), '--env', 'uniform:1,0.5,0.25');
    const get = (path: string, init: RequestInit = {}): Promise<Response> => fetch(server.address + path, init);
    const types: [string, RegExp][] = [
      ['', /^text\/html/],
      ['lambent.json', /^application\/json/],
      ['data/scene.glb', /^model\/gltf-binary/],
      ['data/environment-0.exr', /^image\/x-exr/],
    ];
    for (const [path, type] of types) {
      const answer = await get(path);
      expect(answer.status).toBe(200);
      expect(answer.headers.get('content-type')).toMatch(type);
      expect(answer.headers.get('x-content-type-options')).toBe('nosniff');
    }
    expect(
      Buffer.from(await (await get('data/scene.glb')).arrayBuffer()).equals(readFileSync(join(folder, 'scene.glb'))),
    ).toBe(true);
    // As they stand on the wire: fetch() would tidy them up first.
    const raw = (path: string, host?: string): Promise<number> =>
      new Promise((resolve, reject) => {
        const url = new URL(server.address);
        request(
          { host: url.hostname, port: url.port, path, ...(host && { headers: { host } }) },
          (answer) => (answer.resume(), resolve(answer.statusCode ?? 0)),
        )
          .on('error', reject)
          .end();
      });
    for (const path of [
      '/../scene.obj',
      '/data/../../scene.obj',
      '/data/../lambent.json',
      '//etc/passwd',
      '/./lambent.json',
      '/data\\..\\scene.obj',
    ])
      expect(await raw(path), path).toBe(404);
    expect(await raw('/lambent.json')).toBe(200);
    expect(await raw('/lambent.json', 'evil.example')).toBe(403);
    expect(await raw('/lambent.json', 'evil.example:' + new URL(server.address).port)).toBe(403);
    for (const path of [
      'data/scene.obj',
      'data/',
      '..%2fscene.obj',
      '%2e%2e/%2e%2e/etc/passwd',
      'data/..%2f..%2fscene.mtl',
      'index.html%00.js',
      'assets/',
    ])
      expect((await get(path)).status, path).toBe(404);
    for (const method of ['POST', 'PUT', 'DELETE'])
      expect((await get('lambent.json', { method })).status).toBeGreaterThanOrEqual(400);
    expect(await server.stop()).toBe(0);
  });
});
