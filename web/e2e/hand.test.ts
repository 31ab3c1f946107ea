// Fingers, the wipe, animations and false colour: what a hand does to the page, judged by the pixels that come of it.
import { join } from 'node:path';
import type { Browser, CDPSession, Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { writeBendingBar } from '../test/skinned.ts';
import { haveTool, lambent, makeFolder, writeLopsidedHdr } from '../test/tool.ts';
import { drawn, haveBrowser, launch, open, serve, type Server } from './browser.ts';
import { writeBall } from './scenes.ts';

const size = 400,
  camera = 'camera=0,0,5,0,0,0,35';

interface Picture {
  at(x: number, y: number): number[];
}
async function picture(page: Page): Promise<Picture> {
  const png = (await page.screenshot()).toString('base64');
  const pixels = await page.evaluate(async (data) => {
    const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${data}`)).blob());
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d')!;
    context.drawImage(image, 0, 0);
    const { data: bytes } = context.getImageData(0, 0, image.width, image.height);
    let text = '';
    for (let i = 0; i < bytes.length; i += 1 << 15) text += String.fromCharCode(...bytes.subarray(i, i + (1 << 15)));
    return btoa(text);
  }, png);
  const bytes = Buffer.from(pixels, 'base64');
  return { at: (x, y) => [...bytes.subarray(4 * (y * size + x), 4 * (y * size + x) + 3)] };
}

/** A control's value, as if the user had set it. */
async function set(page: Page, id: string, value: string): Promise<void> {
  await page.evaluate(
    ([name, to]) => {
      const control = document.getElementById(name!) as HTMLInputElement;
      control.value = to!;
      for (const event of ['input', 'change']) control.dispatchEvent(new Event(event));
    },
    [id, value],
  );
  await drawn(page);
}

/** The state that the page writes into its address once it is left alone. */
async function stateOf(page: Page): Promise<URLSearchParams> {
  await page.waitForTimeout(500);
  return new URLSearchParams(new URL(page.url()).hash.slice(1));
}
const numbers = (state: URLSearchParams, key: string): number[] => (state.get(key) ?? '0,0,0').split(',').map(Number);

describe.skipIf(!haveTool || !haveBrowser)('under the hand', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, ball: Server, bar: Server;

  beforeAll(async () => {
    writeBall(at('ball.obj'));
    writeBendingBar(at('bar_plain.glb'));
    writeLopsidedHdr(at('light.hdr'));
    lambent('bake', at('ball.obj'), '--shadows', 'off', '-o', at('ball.glb'));
    lambent('bake', at('bar_plain.glb'), '--samples', '64', '-o', at('bar.glb'));
    browser = await launch();
    [ball, bar] = [
      await serve(at('ball.glb'), '--env', at('light.hdr')),
      await serve(at('bar.glb'), '--env', at('light.hdr')),
    ];
  });
  afterAll(async () => {
    await browser?.close();
    await ball?.stop();
    await bar?.stop();
  });

  /** Fingers go along these lines together, [from x, from y, to x, to y] each. */
  async function fingers(page: Page, lines: [number, number, number, number][]): Promise<void> {
    const session: CDPSession = await page.context().newCDPSession(page),
      steps = 6;
    const points = (t: number): { x: number; y: number; id: number }[] =>
      lines.map(([x0, y0, x1, y1], id) => ({ x: x0 + (x1 - x0) * t, y: y0 + (y1 - y0) * t, id }));
    await session.send('Input.dispatchTouchEvent', { type: 'touchStart', touchPoints: points(0) });
    for (let i = 1; i <= steps; ++i)
      await session.send('Input.dispatchTouchEvent', { type: 'touchMove', touchPoints: points(i / steps) });
    await session.send('Input.dispatchTouchEvent', { type: 'touchEnd', touchPoints: [] });
    await drawn(page);
  }

  it('looks with one finger, and turns the light with it once that is chosen', async () => {
    const page = await open(browser, ball.address, camera, size, size);
    await fingers(page, [[200, 150, 260, 150]]);
    const looked = await stateOf(page),
      eye = numbers(looked, 'camera');
    // 60 of 400 pixels are 0.15 of the height: 0.15 * 2.6 radians, and the camera goes against the finger.
    expect(Math.atan2(eye[0]!, eye[2]!)).toBeCloseTo(-0.39, 2);
    expect(Math.hypot(eye[0]!, eye[1]!, eye[2]!)).toBeCloseTo(5, 3);
    expect(looked.has('rotate')).toBe(false);
    await page.click('#turn');
    await fingers(page, [[200, 150, 260, 150]]);
    const turned = await stateOf(page);
    expect(turned.get('camera')).toBe(looked.get('camera'));
    expect(numbers(turned, 'rotate')[0]).toBeCloseTo((0.39 * 180) / Math.PI, 0);
    await page.close();
  });

  it('comes nearer as two fingers part, and shifts as they go together', async () => {
    const page = await open(browser, ball.address, camera, size, size);
    await fingers(page, [
      [170, 150, 140, 150],
      [230, 150, 260, 150],
    ]);
    const eye = numbers(await stateOf(page), 'camera');
    // Twice as far apart.
    expect(Math.hypot(eye[0]! - eye[3]!, eye[1]! - eye[4]!, eye[2]! - eye[5]!)).toBeCloseTo(2.5, 1);
    await fingers(page, [
      [170, 150, 210, 150],
      [230, 150, 270, 150],
    ]);
    const moved = numbers(await stateOf(page), 'camera');
    // A tenth of the height that is seen at the ball, to the left; the fingers' distance, and so the camera's, is as
    // before.
    const seen = 2 * Math.tan((35 * Math.PI) / 360) * (eye[2]! - eye[5]!);
    expect(moved[3]! - eye[3]!).toBeCloseTo(-0.1 * seen, 1);
    expect(moved[2]).toBeCloseTo(eye[2]!, 1);
    await page.close();
  });

  it('shows one view left of the wipe and the other right of it, wherever it is dragged', async () => {
    const page = await open(
      browser,
      ball.address,
      `background=none&${camera}&view=coefficient&coefficient=1`,
      size,
      size,
    );
    const right = await picture(page);
    await set(page, 'view', 'baked');
    const left = await picture(page);
    await set(page, 'against', 'coefficient');
    // Clear of what is written there.
    const places = [130, 160, 180, 220, 240, 270].flatMap((x) => [130, 205, 235].map((y) => [x, y] as const));
    for (const [x, y] of places) expect(left.at(x, y)).not.toEqual(right.at(x, y));
    const check = async (split: number): Promise<void> => {
      const shown = await picture(page);
      for (const [x, y] of places)
        if (Math.abs(x - split) > 12)
          expect(shown.at(x, y), `${x}, ${y} at ${split}`).toEqual((x < split ? left : right).at(x, y));
    };
    await check(200);
    for (const to of [150, 255]) {
      const box = (await page.locator('#wipe').boundingBox())!;
      await page.mouse.move(box.x + box.width / 2, 200);
      await page.mouse.down();
      await page.mouse.move(to, 210, { steps: 4 });
      await page.mouse.up();
      await drawn(page);
      await check(to);
      expect(Number((await stateOf(page)).get('wipe'))).toBeCloseTo(to / size, 2);
    }
    await page.focus('#wipe');
    for (let i = 0; i < 5; ++i) await page.keyboard.press('ArrowLeft');
    await drawn(page);
    await check(255 - 0.1 * size);
    await page.close();
  });

  // Without shadows t_lm = A_l / pi y_lm(n): two thirds of y_lm for l = 1 (docs/theory.md), with y_1-1 = -k n_y, y_10 =
  // k n_z and y_11 = -k n_x, k = sqrt(3 / 4 pi). Seen along -z from afar, n is the place on the disc.
  it('shows a coefficient in the colours of its scale', async () => {
    const linear = (byte: number): number =>
      byte / 255 <= 0.04045 ? byte / 255 / 12.92 : ((byte / 255 + 0.055) / 1.055) ** 2.4;
    const mix = (a: number[], b: number[], t: number): number[] => a.map((v, i) => v + (b[i]! - v) * Math.min(1, t));
    const grey = [0.212, 0.212, 0.212],
      navy = [0.004, 0.013, 0.082],
      yellow = [1, 0.871, 0.352];
    const k = Math.sqrt(3 / (4 * Math.PI)),
      stops = -0.5,
      far = 100,
      fov = (2 * Math.atan(1.25 / far) * 180) / Math.PI;
    const values: [number, (n: number[]) => number][] = [
      [1, (n) => -k * n[1]!],
      [2, (n) => k * n[2]!],
      [3, (n) => -k * n[0]!],
    ];
    const page = await open(
      browser,
      ball.address,
      `ui=off&background=none&camera=0,0,${far},0,0,0,${fov}&view=coefficient&exposure=${stops}`,
      size,
      size,
    );
    for (const [coefficient, y] of values) {
      await set(page, 'coefficient', String(coefficient));
      const shown = await picture(page);
      for (let i = 0; i < 40; ++i) {
        const r = 0.85 * Math.sqrt((i + 0.5) / 40),
          x = Math.floor(200 + 160 * r * Math.cos(2.4 * i)),
          row = Math.floor(200 + 160 * r * Math.sin(2.4 * i));
        const n = [(x + 0.5 - 200) / 160, -(row + 0.5 - 200) / 160, 0];
        n[2] = Math.sqrt(1 - n[0]! ** 2 - n[1]! ** 2);
        const share = ((2 / 3) * y(n) * 2 ** stops) / 0.25,
          expected = share < 0 ? mix(grey, navy, -share) : mix(grey, yellow, share);
        shown
          .at(x, row)
          .forEach((byte, c) =>
            expect(Math.abs(linear(byte) - expected[c]!), `${coefficient}: ${x}, ${row}`).toBeLessThan(0.02),
          );
      }
    }
    await page.close();
  });

  it('plays an animation, and holds it', async () => {
    const page = await open(browser, bar.address, 'background=none&camera=0,1,6,0,1,0,35', size, size);
    expect(await page.isVisible('#play')).toBe(true);
    // The bar at rest covers x = -0.25 to 0.25; bent to the left, its upper half reaches beyond x = -0.5 above y = 1.
    const beside = 200 - Math.round((0.6 / (2 * Math.tan((35 * Math.PI) / 360) * 6)) * size);
    const reaches = async (): Promise<boolean> => {
      const shown = await picture(page);
      for (let y = 130; y < 200; ++y) if (Math.max(...shown.at(beside, y)) > 20) return true;
      return false;
    };
    expect(await reaches()).toBe(false);
    await page.click('#play');
    let bent = false;
    for (let i = 0; i < 100 && !bent; ++i) bent = await reaches();
    expect(bent).toBe(true);
    await page.click('#play');
    await drawn(page);
    const clip = { x: 60, y: 60, width: 280, height: 200 },
      held = await page.screenshot({ clip });
    await page.waitForTimeout(300);
    expect((await page.screenshot({ clip })).equals(held)).toBe(true);
    await page.click('#play');
    await page.waitForTimeout(300);
    expect((await page.screenshot({ clip })).equals(held)).toBe(false);
    await page.close();
  });
});
