// Lamps that move and paint in the browser (direct to indirect light) against `lambent render` of the same file, camera
// and lamps; lamps carried as a hand carries them.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, renderLinear } from '../test/tool.ts';
import { drawn, haveBrowser, launch, open, openFixture, psnr, ready, serve, type Server } from './browser.ts';
import { writeScene } from './scenes.ts';

const patience = { timeout: 60_000, interval: 100 }; // beside a build on two cores
const camera = '3.1,2.6,4.3,-0.3,0.8,0,38',
  size = { width: 640, height: 480 },
  lamps = [
    'point@0.9,1.9,1.1=6,5,4',
    'spot@-1.2,2.2,1.6,-0.4,0.4,0,40=9,12,15',
    'sphere@1.5,0.6,1.2,0.15=20,8,4',
    'sun@60,50=0.6,0.6,0.8',
  ],
  paint = 'red=0.1,0.2,0.8';

/** All light has come. */
async function settled(page: Page): Promise<void> {
  await page.waitForSelector('body[data-light=settled]', { state: 'attached' });
  await drawn(page);
}
const stateNow = (page: Page): URLSearchParams => new URLSearchParams(new URL(page.url()).hash.slice(1));
/** The address once it is another than `before`, and stays. */
async function stateAfter(page: Page, before: URLSearchParams): Promise<URLSearchParams> {
  await expect.poll(() => stateNow(page).toString(), patience).not.toBe(before.toString());
  for (let last = ''; last !== stateNow(page).toString(); await page.waitForTimeout(1000))
    last = stateNow(page).toString();
  return stateNow(page);
}
const placeOf = (text: string | null): number[] => (/@([^=]*)=/.exec(text ?? '')?.[1] ?? '').split(',').map(Number);

/** writeScene's scene as a glTF whose sail glows and that has a point lamp, "bulb". */
function writeOwnLamps(folder: string): string {
  lambent('bake', join(folder, 'scene.obj'), '--order', '1', '--samples', '1', '-o', join(folder, 'plain.glb'));
  const glb = readFileSync(join(folder, 'plain.glb')),
    length = glb.readUInt32LE(12);
  interface Plain {
    extensions: Record<string, unknown>;
    extensionsUsed: string[];
    meshes: { primitives: { extensions?: unknown }[] }[];
    materials: { name: string; emissiveFactor?: number[]; extensions?: unknown }[];
    nodes: unknown[];
    scenes: { nodes: number[] }[];
  }
  const document = JSON.parse(glb.subarray(20, 20 + length).toString()) as Plain;
  document.extensions = { KHR_lights_punctual: { lights: [{ type: 'point', intensity: 3, name: 'bulb' }] } };
  document.extensionsUsed = ['KHR_lights_punctual'];
  for (const mesh of document.meshes) for (const primitive of mesh.primitives) delete primitive.extensions;
  for (const material of document.materials) if (material.name === 'white') material.emissiveFactor = [1, 0.8, 0.5];
  document.scenes[0]!.nodes.push(document.nodes.length);
  document.nodes.push({ translation: [-1.2, 1.6, 1], extensions: { KHR_lights_punctual: { light: 0 } } });
  const text = Buffer.from(JSON.stringify(document)),
    json = Buffer.concat([text, Buffer.alloc((4 - (text.length % 4)) % 4, ' ')]),
    rest = glb.subarray(20 + length),
    head = Buffer.alloc(20);
  [0x46546c67, 2, 20 + json.length + rest.length, json.length, 0x4e4f534a].forEach((n, i) =>
    head.writeUInt32LE(n, 4 * i),
  );
  const path = join(folder, 'own_lamps.glb');
  writeFileSync(path, Buffer.concat([head, json, rest]));
  return path;
}

describe.skipIf(!haveTool || !haveBrowser)('lamps that move', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, server: Server, texels: Server, own: Server, fixture: { page: Page; server: ViteDevServer };

  beforeAll(async () => {
    const scene = writeScene(folder),
      few = ['--transfer', 'indirect', '--surfels', '2048', '--samples', '128'];
    lambent('bake', scene, ...few, '-o', at('vertices.glb'));
    // A sail that glows, and a point of the scene's own.
    lambent('bake', writeOwnLamps(folder), ...few, '-o', at('own.glb'));
    lambent('bake', scene, ...few, '--receivers', 'texels', '--atlas', '256x256', '-o', at('texels.glb'));
    browser = await launch();
    [server, texels, own] = [
      await serve(at('vertices.glb')),
      await serve(at('texels.glb')),
      await serve(at('own.glb')),
    ];
    fixture = await openFixture(browser, folder, 'webgpu.html'); // for its measure inside outlines
  });
  afterAll(async () => {
    await fixture?.page.close();
    await fixture?.server.close();
    await browser?.close();
    expect(await server?.stop()).toBe(0);
    expect(await texels?.stop()).toBe(0);
    expect(await own?.stop()).toBe(0);
  });

  const fragment = (view: string, of = lamps): string =>
    `ui=off&camera=${camera}&view=${view}&${of.map((l) => `lamp=${l}`).join('&')}`;
  async function compare(
    name: string,
    page: Page,
    baked: string,
    more: string[],
  ): Promise<{ inside: number; all: number }> {
    await settled(page);
    await page.screenshot({ path: at(`${name}_page.png`) });
    renderLinear(
      ...[at(baked), '--camera', camera, '--size', '640x480', '--spp', '16', '--background', 'none'],
      ...[...more, '-o', at(`${name}_render.png`)],
    );
    const url = (path: string): string => `data:image/png;base64,${readFileSync(path).toString('base64')}`;
    const inside = await fixture.page.evaluate(([a, b]) => window.gpu.inside(a, b), [
      url(at(`${name}_render.png`)),
      url(at(`${name}_page.png`)),
    ] as const);
    const all = psnr(at(`${name}_page.png`), at(`${name}_render.png`));
    console.log(`${name}: ${inside.toFixed(1)} dB inside outlines, ${all.toFixed(1)} dB over all (${folder})`);
    return { inside, all };
  }
  const given = (of: string[]): string[] => of.flatMap((lamp) => ['--lamp', lamp]);

  it('send on what render says: at vertices, repainted, and over an atlas', async () => {
    const page = await open(browser, server.address, fragment('indirect'), size.width, size.height);
    expect(
      (await compare('indirect', page, 'vertices.glb', ['--show', 'indirect', '--at', 'receivers', ...given(lamps)]))
        .inside,
    ).toBeGreaterThan(45);
    await page.close();
    const painted = await open(
      browser,
      server.address,
      `${fragment('indirect')}&albedo=${paint}`,
      size.width,
      size.height,
    );
    const { inside } = await compare('painted', painted, 'vertices.glb', [
      '--show',
      'indirect',
      '--at',
      'receivers',
      '--albedo',
      paint,
      ...given(lamps),
    ]);
    expect(inside).toBeGreaterThan(45);
    expect(psnr(at('painted_page.png'), at('indirect_page.png'))).toBeLessThan(35);
    await painted.close();
    const atlas = await open(browser, texels.address, fragment('indirect'), size.width, size.height);
    expect(
      (await compare('texels', atlas, 'texels.glb', ['--show', 'indirect', '--at', 'receivers', ...given(lamps)]))
        .inside,
    ).toBeGreaterThan(45);
    await atlas.close();
  });

  it('shine as render draws them, each kind with its shadows', async () => {
    for (const [i, lamp] of lamps.entries()) {
      const page = await open(browser, server.address, fragment('direct', [lamp]), size.width, size.height);
      const { inside } = await compare(`direct_${lamp.split('@')[0]}`, page, 'vertices.glb', [
        '--show',
        'direct',
        ...given([lamp]),
      ]);
      // What is sharp at a shadow's edge there is a texel of the map here; a sphere's shadow is that of its middle.
      expect(inside).toBeGreaterThan(lamps[i]!.startsWith('sphere') ? 38 : 50);
      await page.close();
    }
    const page = await open(browser, server.address, fragment('baked'), size.width, size.height);
    expect((await compare('all', page, 'vertices.glb', ['--at', 'receivers', ...given(lamps)])).inside).toBeGreaterThan(
      28,
    );
    await page.close();
  });

  it("shine beside the scene's own, which are scaled and turned off by name", async () => {
    const page = await open(browser, own.address, fragment('indirect', ['']), size.width, size.height);
    const { inside } = await compare('own', page, 'own.glb', ['--show', 'indirect', '--at', 'receivers']);
    expect(inside).toBeGreaterThan(50); // glowing surfaces are sampled, here as there
    await page.close();
    const scaled = await open(
      browser,
      own.address,
      fragment('indirect', ['white=0', 'bulb=0.2,1,3']),
      size.width,
      size.height,
    );
    const more = ['--show', 'indirect', '--at', 'receivers', '--lamp', 'white=0', '--lamp', 'bulb=0.2,1,3'];
    expect((await compare('own_scaled', scaled, 'own.glb', more)).inside).toBeGreaterThan(55);
    await scaled.close();
    // Straight from what glows, as soft as surfels are.
    const direct = await open(browser, own.address, fragment('direct', ['bulb=0']), size.width, size.height);
    expect(
      (await compare('own_direct', direct, 'own.glb', ['--show', 'direct', '--lamp', 'bulb=0'])).inside,
    ).toBeGreaterThan(34);
    await direct.close();
  });

  it('are carried by a hand over their level, with Shift up and down, and by keys; the link keeps it', async () => {
    const page = await open(
      browser,
      server.address,
      `camera=${camera}&lamp=point@0.9,1.2,1.1=6,5,4`,
      size.width,
      size.height,
    );
    await settled(page);
    const handle = page.locator('#handles button');
    const drag = async (dx: number, dy: number, keys: string[] = []): Promise<void> => {
      const box = (await handle.boundingBox())!,
        [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
      for (const key of keys) await page.keyboard.down(key);
      await page.mouse.move(x, y);
      await page.mouse.down();
      await page.mouse.move(x + dx / 2, y + dy / 2, { steps: 4 });
      await page.mouse.move(x + dx, y + dy, { steps: 4 });
      await page.mouse.up();
      for (const key of keys) await page.keyboard.up(key);
      const now = (await handle.boundingBox())!;
      expect(now.x + now.width / 2).toBeCloseTo(x + (keys.length ? 0 : dx), -1); // it stays under the hand
      expect(now.y + now.height / 2).toBeCloseTo(y + dy, -1);
      await settled(page);
    };
    await page.screenshot({ path: at('hand_before.png') });
    let state = stateNow(page);
    await drag(-160, -30);
    state = await stateAfter(page, state);
    const [x, y, z] = placeOf(state.get('lamp'));
    expect(y).toBe(1.2);
    expect(Math.hypot(x! - 0.9, z! - 1.1)).toBeGreaterThan(0.5);
    await drag(0, -60, ['Shift']);
    state = await stateAfter(page, state);
    const [x2, y2, z2] = placeOf(state.get('lamp'));
    expect([x2, z2]).toEqual([x, z]);
    expect(y2).toBeGreaterThan(1.4);
    await handle.focus();
    await page.keyboard.press('PageDown');
    await page.keyboard.press('ArrowRight');
    state = await stateAfter(page, state);
    const [x3, y3] = placeOf(state.get('lamp'));
    expect(y3).toBeLessThan(y2!);
    expect(x3).not.toBe(x2);
    await settled(page);
    await page.evaluate(() => (document.activeElement as HTMLElement).blur()); // no ring about the handle
    await page.screenshot({ path: at('hand_after.png') });
    expect(psnr(at('hand_before.png'), at('hand_after.png'))).toBeLessThan(30);
    // A link, and the light of a lamp that stood there from the start.
    await page.reload();
    await ready(page);
    await settled(page);
    await page.screenshot({ path: at('hand_again.png') });
    expect(psnr(at('hand_again.png'), at('hand_after.png'))).toBeGreaterThan(45);
    await page.close();
  });

  it('are added, switched, coloured and taken away in the list; walls are painted', async () => {
    const page = await open(browser, server.address, `camera=${camera}`, size.width, size.height);
    await page.click('#lamps > summary');
    const texts = (): string[] => stateNow(page).getAll('lamp'),
      kinds = (): string[] => texts().map((t) => t.split('@')[0]!),
      soon = <T>(value: () => T) => expect.poll(value, patience);
    await soon(kinds).toEqual(['point']); // one to begin with
    await page.getByRole('button', { name: 'Add a lamp: spot' }).click();
    await page.getByRole('button', { name: 'Add a lamp: sun' }).click();
    await soon(kinds).toEqual(['point', 'spot', 'sun']);
    expect(await page.locator('#handles button').count()).toBe(3); // the spot's target has one, the sun none
    const sun = page.locator('#lamp-list > details').nth(2);
    await sun.getByLabel('elevation').focus();
    await page.keyboard.press('End');
    await soon(() => placeOf(texts()[2]!)[1]).toBe(90);
    await sun.getByLabel('Colour').fill('#ff0000');
    await soon(() => texts()[2]).toMatch(/=[\d.]+,0,0$/);
    await sun.getByLabel('On', { exact: true }).uncheck();
    await soon(() => stateNow(page).get('dark')).toBe('3');
    await page.getByRole('button', { name: 'Remove lamp 3, sun' }).click();
    await soon(kinds).toEqual(['point', 'spot']);
    await page.click('#lamps details:has(#paint-list) > summary');
    await page.getByLabel('red', { exact: true }).fill('#0000ff');
    await soon(() => stateNow(page).get('albedo')).toBe('red=0,0,1');
    await settled(page);
    await page.screenshot({ path: at('list.png') });
    await page.getByRole('button', { name: 'red as it was' }).click();
    await soon(() => stateNow(page).has('albedo')).toBe(false);
    for (let i = 0; i < 6; ++i) await page.getByRole('button', { name: 'Add a lamp: point' }).click();
    expect(await page.getByRole('button', { name: 'Add a lamp: sphere' }).isDisabled()).toBe(true); // eight
    await page.close();
  });

  it('light an element by its attributes, and WebGPURenderer takes them', async () => {
    const page = await browser.newPage({ viewport: size });
    await page.goto(server.address);
    await ready(page);
    await page.addScriptTag({ url: '/lambent-viewer.js', type: 'module' });
    const show = (name: string, lamps: string): Promise<string> =>
      page
        .evaluate(
          async ([lamps, camera]) => {
            document.body.replaceChildren();
            const element = document.createElement('lambent-viewer');
            for (const [key, value] of Object.entries({
              src: 'data/scene.glb',
              lamps,
              camera,
              exposure: '0',
              tone: 'none',
            }))
              element.setAttribute(key, value);
            const done = new Promise((resolve) =>
              ['load', 'error'].forEach((e) => element.addEventListener(e, resolve)),
            );
            document.body.append(element);
            await done;
            return element.shadowRoot!.querySelector('p')!.textContent;
          },
          [lamps, camera] as const,
        )
        .then(async (text) => {
          await page.waitForTimeout(3000);
          await page.locator('lambent-viewer').screenshot({ path: at(`${name}.png`) });
          return text;
        });
    expect(await show('element', `${lamps[0]!}; ${lamps[3]!}`)).toBe('');
    expect(await show('element_other', lamps[1]!)).toBe('');
    expect(psnr(at('element.png'), at('element_other.png'))).toBeLessThan(25);
    expect(await show('element_none', 'point@1=2')).toMatch(/lamp "point@1=2" is no point of 3 numbers/);
    await page.close();
    expect(await fixture.page.evaluate(() => window.gpu.refusal('/files/vertices.glb', true))).toEqual(['', '']);
  });

  it('are refused in a sentence where they cannot be, in the address as in a broken file', async () => {
    const page = await browser.newPage();
    await page.goto(`${server.address}#lamp=sphere@0,1,0,0=1`);
    await page.waitForSelector('#problem:not([hidden])');
    expect(await page.textContent('#problem-text')).toMatch(/sphere@0,1,0,0=1.*no radius/);
    await page.close();
    expect(() => lambent('export', at('vertices.glb'), '--web', at('site'), '--env', 'uniform:1')).toThrow(
      /lamps alone/,
    );
    const glb = readFileSync(at('vertices.glb'));
    const document = JSON.parse(glb.subarray(20, 20 + glb.readUInt32LE(12)).toString()) as {
      bufferViews: { byteOffset?: number; byteLength: number }[];
      extensions: { LAMBENT_transfer: { transfer: { scales: number } } };
    };
    const { scales } = document.extensions.LAMBENT_transfer.transfer;
    const { byteOffset = 0, byteLength } = document.bufferViews[scales]!;
    for (let i = 0; i < byteLength; i += 4) glb.writeFloatLE(1e9, 28 + glb.readUInt32LE(12) + byteOffset + i);
    writeFileSync(at('broken.glb'), glb);
    const drop = await open(browser, server.address, `camera=${camera}`, size.width, size.height);
    await drop.setInputFiles('#file', at('broken.glb'));
    await drop.waitForSelector('#problem:not([hidden])');
    expect(await drop.textContent('#problem-text')).toMatch(/broken\.glb.*row \d+ sees more than a hemisphere/);
    await drop.close();
  });
});
