// Objects put into a scene by hand, in the light of its lattice, against `lambent render --insert`; carried as a hand
// carries them.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { Color, PerspectiveCamera, Vector3 } from 'three';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { readMap } from '../page/loading.ts';
import { checkBakedFile, Lighting, type Lattice } from '../src/index.ts';
import type { TransferExtension } from '../src/glb.ts';
import type { TransferSource } from '../src/kinds.ts';
import { loadLattice } from '../src/lattice.ts';
import { haveTool, lambent, makeFolder, readPacked, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import { drawn, haveBrowser, launch, open, openFixture, psnr, ready, serve, type Server } from './browser.ts';
import { writeBall, writeScene } from './scenes.ts';

const camera = '1.9,1.5,2.6,0.5,0.5,0.3,26', // close by
  place = [0.6, 0.05, 0.7] as const,
  at3 = place.join(','),
  patience = { timeout: 60_000, interval: 100 };

/** Half a shell, open to the light's side, with a floor: what shadows itself. */
function writeShell(path: string): void {
  const rows = 24,
    turns = 40,
    lines = ['mtllib shell.mtl', 'usemtl shell'];
  for (const radius of [0.5, 0.44])
    for (let j = 0; j <= rows; ++j)
      for (let i = 0; i <= turns; ++i) {
        const t = (Math.PI * j) / rows,
          p = (Math.PI * i) / turns;
        lines.push(
          `v ${radius * Math.sin(t) * Math.cos(p)} ${radius * Math.cos(t)} ${-radius * Math.sin(t) * Math.sin(p)}`,
        );
      }
  const at = (layer: number, i: number, j: number): number =>
    layer * (rows + 1) * (turns + 1) + j * (turns + 1) + i + 1;
  for (let j = 0; j < rows; ++j)
    for (let i = 0; i < turns; ++i) {
      lines.push(`f ${at(0, i, j)} ${at(0, i, j + 1)} ${at(0, i + 1, j + 1)} ${at(0, i + 1, j)}`);
      lines.push(`f ${at(1, i, j)} ${at(1, i + 1, j)} ${at(1, i + 1, j + 1)} ${at(1, i, j + 1)}`);
    }
  writeFileSync(path, lines.join('\n') + '\n');
  writeFileSync(path.replace(/[^/]*$/, 'shell.mtl'), 'newmtl shell\nKd 0.7 0.6 0.4\n');
}
/** A baked file with its extension under a name that nobody knows: a plain one. */
const writePlain = (from: string, to: string): void =>
  writeFileSync(
    to,
    Buffer.from(readFileSync(from).toString('latin1').replaceAll('LAMBENT_transfer', 'SOMEBODY_elses_x'), 'latin1'),
  );

/** A file's lattice under an environment, read beside three's loader. */
async function readLattice(baked: string, env: string): Promise<Lattice> {
  const bytes = (path: string): ArrayBuffer => new Uint8Array(readFileSync(path)).buffer,
    document = checkBakedFile(bytes(baked)) as { extensions: { LAMBENT_transfer: TransferExtension } },
    { view } = readPacked(baked);
  const lattice = (await loadLattice({
    extension: document.extensions.LAMBENT_transfer,
    bufferView: (index: number) => Promise.resolve(view(index)),
  } as unknown as TransferSource))!;
  const light = Lighting.fromMap(readMap(bytes(env)));
  light.window = 'none';
  lattice.relight(light);
  return lattice;
}

/** The address is written a little after the hand rests. */
async function stays(page: Page): Promise<void> {
  await drawn(page);
  for (let last = ''; last !== page.url(); await page.waitForTimeout(800)) last = page.url();
}
const insertsOf = (page: Page): string[] => new URLSearchParams(new URL(page.url()).hash.slice(1)).getAll('insert');
const numbersOf = (text: string): number[] =>
  text
    .slice(text.lastIndexOf('@') + 1)
    .split(',')
    .map(Number);

describe.skipIf(!haveTool || !haveBrowser)('objects', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, server: Server, bare: Server, fixture: { page: Page; server: ViteDevServer };

  beforeAll(async () => {
    const scene = writeScene(folder),
      few = ['--order', '5', '--samples', '128', '--bounces', '1'];
    writeShell(at('shell.obj'));
    writeBall(at('ball.obj'));
    const ball = readFileSync(at('ball.obj'), 'utf8').split('\n'),
      halved = ball.map((l) =>
        l.startsWith('v')
          ? 'v ' +
            l
              .slice(2)
              .split(' ')
              .map((v) => Number(v) / 2)
              .join(' ')
          : l,
      );
    writeFileSync(at('round.obj'), ['mtllib round.mtl', 'usemtl round', ...halved].join('\n'));
    writeFileSync(at('round.mtl'), 'newmtl round\nKd 0.8 0.8 0.8\n');
    writeLopsidedHdr(at('light.hdr'));
    lambent('bake', scene, ...few, '--lattice', '9,6,9', '--lattice-order', '4', '-o', at('scene.glb'));
    lambent('bake', scene, ...few, '-o', at('bare.glb'));
    lambent('bake', at('round.obj'), '--order', '4', '-o', at('round.glb'));
    writePlain(at('round.glb'), at('plain.glb'));
    lambent('bake', at('shell.obj'), '--order', '6', '-o', at('own.glb'));
    lambent('bake', at('round.obj'), '--transfer', 'blocks', '--cube', '16', '-o', at('blocks.glb'));
    browser = await launch();
    const env = ['--env', at('light.hdr')];
    server = await serve(at('scene.glb'), ...env, '--insert', `${at('shell.obj')}@${at3},0.7`);
    bare = await serve(at('bare.glb'), ...env);
    fixture = await openFixture(browser, folder, 'webgpu.html'); // for its measure inside outlines
  });
  afterAll(async () => {
    await fixture?.page.close();
    await fixture?.server.close();
    await browser?.close();
    expect(await server?.stop()).toBe(0);
    expect(await bare?.stop()).toBe(0);
  });

  async function compare(name: string, page: Page, insert: string, ...more: string[]): Promise<[number, number]> {
    await drawn(page);
    await page.screenshot({ path: at(`${name}_page.png`) });
    renderLinear(
      ...[at('scene.glb'), '--env', at('light.hdr'), '--camera', camera, '--size', '640x480', '--spp', '16'],
      ...['--background', 'none', '--insert', insert, ...more, '-o', at(`${name}_render.png`)],
    );
    const url = (path: string): string => `data:image/png;base64,${readFileSync(path).toString('base64')}`;
    const inside = await fixture.page.evaluate(([a, b]) => window.gpu.inside(a, b), [
      url(at(`${name}_render.png`)),
      url(at(`${name}_page.png`)),
    ] as const);
    const all = psnr(at(`${name}_page.png`), at(`${name}_render.png`));
    console.log(`${name}: ${inside.toFixed(1)} dB inside outlines, ${all.toFixed(1)} dB over all (${folder})`);
    return [inside, all];
  }
  const start = (more: string, of = server): Promise<Page> =>
    open(browser, of.address, `ui=off&background=none&camera=${camera}&window=none${more}`, 640, 480);

  it.each([
    ['served', '', () => `${at('shell.obj')}@${at3},0.7`, []],
    ['turned', '&rotate=70,20,-30', () => `${at('shell.obj')}@${at3},0.7`, ['--env-rotate', '70,20,-30']],
    ['ball', `&insert=ball@${at3},0.8`, () => `${at('round.obj')}@${at3},0.8`, []],
  ] as const)('stand as `render --insert` has them: %s', async (name, more, insert, also) => {
    const page = await start(more),
      [inside, all] = await compare(name, page, insert(), '--window', 'none', ...also);
    expect(inside).toBeGreaterThan(45);
    expect(all).toBeGreaterThan(38);
    await page.close();
  });

  it('are carried by their letters, scaled, added and removed, and the address keeps them', async () => {
    const page = await open(browser, server.address, `camera=${camera}`, 900, 700);
    expect(await page.locator('#handles button:visible').allTextContents()).toEqual(['A']);
    await page.click('#objects > summary');
    await page.click('#add-objects button:text("A ball")');
    await expect.poll(() => page.locator('#handles button').count(), patience).toBe(2);
    await expect.poll(() => insertsOf(page).length, patience).toBe(2);
    const ball = numbersOf(insertsOf(page)[1]!);
    // It stands on something: on the floor's height, or the shell's or the ball's.
    expect(ball[1]).toBeGreaterThan(-0.01);
    await page.click('#objects > summary');
    const handle = page.locator('#handles button').first(),
      before = numbersOf(insertsOf(page)[0]!),
      box = (await handle.boundingBox())!;
    expect(before.slice(0, 3)).toEqual([...place]);
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + 90, box.y + 40, { steps: 5 });
    await page.mouse.up();
    await expect.poll(() => numbersOf(insertsOf(page)[0]!)[0], patience).not.toBe(before[0]);
    await stays(page);
    const carried = numbersOf(insertsOf(page)[0]!);
    expect(carried[1]).toBeCloseTo(before[1]!, 4); // over the level
    expect(carried[3]).toBe(0.7);
    await handle.focus();
    await page.keyboard.press('PageUp');
    await expect.poll(() => numbersOf(insertsOf(page)[0]!)[1], patience).toBeGreaterThan(carried[1]! + 0.02);
    await stays(page);
    const lifted = numbersOf(insertsOf(page)[0]!);
    expect(lifted[0]).toBeCloseTo(carried[0]!, 4);
    // A reload shows the same.
    const picture = async (): Promise<Buffer> => {
      await drawn(page);
      return page.screenshot({ clip: { x: 60, y: 120, width: 780, height: 420 } });
    };
    await page.evaluate(() => (document.activeElement as HTMLElement).blur());
    const shown = await picture();
    await page.reload();
    await ready(page);
    await page.screenshot({ path: at('objects.png') });
    expect((await picture()).equals(shown)).toBe(true);
    await page.click('#objects > summary');
    await page.click('#object-list details:first-child > summary');
    await page.screenshot({ path: at('objects_open.png') });
    await page.locator('#object-list details:first-child [name=Scale]').fill('0'); // a power of ten
    await expect.poll(() => numbersOf(insertsOf(page)[0]!).length, patience).toBe(3); // 1, which is not said
    await page.click('#object-list details:first-child button:text("Remove")');
    await expect.poll(() => insertsOf(page).map((text) => text.replace(/@.*/, '')), patience).toEqual(['ball']);
    await page.close();
  });

  it('are files that are opened or dropped, of plain ones and bakes of their own', async () => {
    const page = await open(browser, server.address, `camera=${camera}&insert=`, 900, 700);
    expect(await page.locator('#handles button').count()).toBe(0);
    await page.setInputFiles('#file', at('plain.glb'));
    await expect.poll(() => page.locator('#handles button').count(), patience).toBe(1);
    expect(await page.isVisible('#problem')).toBe(false);
    expect(await page.textContent('#name')).toBe('scene.glb');
    await page.setInputFiles('#object-file', at('own.glb'));
    await expect.poll(() => page.locator('#handles button').count(), patience).toBe(2);
    await page.waitForTimeout(500);
    expect(insertsOf(page)).toEqual(['']); // no address has an opened file
    await page.setInputFiles('#object-file', at('blocks.glb'));
    await page.waitForSelector('#problem:not([hidden])');
    expect(await page.textContent('#problem-text')).toMatch(/^blocks\.glb cannot be put into a scene: of baked files/);
    await page.click('#problem-close');
    for (let i = 0; i < 6; ++i)
      await page.evaluate(() => document.querySelector<HTMLElement>('#add-objects button')!.click());
    await expect.poll(() => page.locator('#handles button').count(), patience).toBe(8);
    expect(await page.isDisabled('#add-objects button')).toBe(true);
    await page.close();
  });

  it('are refused where nothing lights them, or the page has none of the name', async () => {
    const page = await browser.newPage();
    const said = async (address: string): Promise<string> => {
      await page.goto('about:blank');
      await page.goto(address);
      await page.waitForSelector('#problem:not([hidden])');
      return (await page.textContent('#problem-text'))!;
    };
    expect(await said(`${bare.address}#insert=ball@0,0,0`)).toMatch(/no light in free space: bake it with --lattice/);
    expect(await page.isVisible('#objects')).toBe(false);
    expect(await said(`${server.address}#insert=cup@0,0,0`)).toMatch(
      /^cup is no object that this page has: ball, shell\.obj/,
    );
    expect(await said(`${server.address}#insert=ball@0,0`)).toMatch(/no object in a place/);
    await page.close();
    const refused = (...args: string[]): string => {
      try {
        lambent(...args);
      } catch (error) {
        return String((error as { stderr: unknown }).stderr);
      }
      return '';
    };
    expect(refused('export', at('bare.glb'), '--web', at('site'), '--insert', `${at('round.obj')}@0,0,0`)).toMatch(
      /has no light in free space for --insert: bake it with --lattice/,
    );
    lambent('export', at('scene.glb'), '--web', at('site'), '--insert', `${at('round.obj')}@0.5,0,1`);
    const manifest = JSON.parse(readFileSync(join(at('site'), 'lambent.json'), 'utf8')) as Record<string, unknown>;
    expect(manifest['insert']).toEqual(['round.obj@0.5,0,1']);
    expect(manifest['inserts']).toEqual([{ name: 'round.obj', file: 'data/object-0.glb' }]);
  });

  it('shows the points of the lattice in their light, behind what hides them, and receivers', async () => {
    // Light as it is: a ball's middle faces the eye, and is white lit by what arrives there.
    const eye = [0.3, 5, 6],
      view = `camera=${eye.join(',')},0.3,0.6,0,26`,
      page = await open(browser, server.address, `ui=off&background=none&${view}&window=none&insert=`, 640, 480);
    const pixels = async (): Promise<(x: number, y: number) => number[]> => {
      await drawn(page);
      const png = (await page.screenshot()).toString('base64'),
        bytes = await page.evaluate(async (data) => {
          const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${data}`)).blob()),
            context = new OffscreenCanvas(image.width, image.height).getContext('2d')!;
          context.drawImage(image, 0, 0);
          return [...context.getImageData(0, 0, image.width, image.height).data];
        }, png);
      return (x, y) => bytes.slice(4 * (y * 640 + x), 4 * (y * 640 + x) + 3);
    };
    const plain = await pixels();
    await page.evaluate(() => document.getElementById('show-lattice')!.click());
    const withBalls = await pixels();
    await page.screenshot({ path: at('lattice.png') });
    const lattice = await readLattice(at('scene.glb'), at('light.hdr')),
      seen = new PerspectiveCamera(26, 640 / 480, 0.1, 100),
      p = new Vector3(),
      colour = new Color();
    seen.position.fromArray(eye);
    seen.lookAt(0.3, 0.6, 0);
    seen.updateMatrixWorld();
    let shown = 0,
      hidden = 0;
    const [nx, ny, nz] = lattice.points;
    for (let i = 0; i < nx * ny * nz; ++i) {
      lattice.position(i, p);
      const normal = seen.position.clone().sub(p).normalize(),
        { r, g, b } = lattice.irradianceAt(p, normal, colour).multiplyScalar(1 / Math.PI),
        at = p.clone().project(seen),
        [x, y] = [Math.floor(((at.x + 1) / 2) * 640), Math.floor(((1 - at.y) / 2) * 480)],
        isFirst = ((i / nx) | 0) % ny === ny - 1; // of the uppermost points nothing is in front
      if (x < 0 || y < 0 || x >= 640 || y >= 480) continue;
      if (withBalls(x, y).every((v, k) => v === plain(x, y)[k])) ++hidden;
      if (!isFirst || !lattice.valid[i]) continue;
      ++shown;
      [r, g, b].forEach((v, k) => {
        const screen = v <= 0.0031308 ? 12.92 * v : 1.055 * Math.min(1, v) ** (1 / 2.4) - 0.055;
        expect(Math.abs(withBalls(x, y)[k]! - 255 * screen), `point ${i} at ${x}, ${y}`).toBeLessThan(4);
      });
    }
    expect(shown).toBeGreaterThan(40);
    expect(hidden).toBeGreaterThan(5); // in the floor's ball, behind walls
    await page.evaluate(() => document.getElementById('show-receivers')!.click());
    await page.evaluate(() => document.getElementById('show-lattice')!.click());
    const withDots = await pixels();
    await page.screenshot({ path: at('receivers.png') });
    // The floor has a vertex each eighth, on both sides of the middle: white at those, as it was between them.
    let dots = 0;
    for (let i = 4; i < 30; ++i) {
      p.set(-2 + i / 8, 0, 1.5).project(seen);
      const [x, y] = [Math.floor(((p.x + 1) / 2) * 640), Math.floor(((1 - p.y) / 2) * 480)];
      if (x < 0 || x >= 640 || y < 0 || y >= 480) continue;
      const around = [-1, 0, 1].flatMap((dx) => [-1, 0, 1].map((dy) => withDots(x + dx, y + dy)));
      if (around.some((pixel) => pixel.every((v) => v > 250))) ++dots;
      else throw new Error(`no dot at ${x}, ${y}`);
    }
    expect(dots).toBeGreaterThan(15);
    await page.waitForTimeout(500);
    expect(new URLSearchParams(new URL(page.url()).hash.slice(1)).get('show')).toBe('receivers');
    await page.evaluate(() => document.getElementById('show-receivers')!.click());
    const again = await pixels();
    for (let y = 0; y < 480; y += 7) for (let x = 0; x < 640; x += 7) expect(again(x, y)).toEqual(plain(x, y));
    await page.close();
  });

  it('refuses the shadow field of an object by name: opened, served and exported', async () => {
    lambent('field', at('round.glb'), '-o', at('field.glb'), '--shells', '4', '--side', '4', '--samples', '64');
    const page = await open(browser, server.address, `camera=${camera}`, 400, 400),
      sentence =
        /field\.glb:? holds the shadow field of an object, which the web page does not draw: `lambent render --place`/;
    for (const input of ['#file', '#object-file']) {
      await page.setInputFiles(input, at('field.glb'));
      await page.waitForSelector('#problem:not([hidden])');
      expect(await page.textContent('#problem-text')).toMatch(sentence);
      await page.click('#problem-close');
    }
    expect(await page.textContent('#name')).toBe('scene.glb');
    await page.close();
    await expect(serve(at('field.glb'))).rejects.toThrow(sentence);
    expect(() => lambent('export', at('field.glb'), '--web', at('field_site'))).toThrow(sentence);
  });
});
