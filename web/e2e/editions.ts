// A shot of the fixture by each of three's renderers, against `lambent render` and against each other.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Page } from 'playwright-core';
import { expect } from 'vitest';
import type { Backend, Shot } from './fixture/webgpu.ts';
import { psnr } from './browser.ts';

export const size = [320, 240];
export const cameraOf = (camera: string): number[] => camera.split(',').map(Number);
/** Arguments of `render` for a picture of that size. */
export const view = (camera: string, more: string[] = []): string[] => [
  ...['--camera', camera, '--size', size.join('x'), '--spp', '16', '--background', 'none'],
  ...more,
];

/**
 * What each renderer draws, against `truth`, a picture by `render`: inside outlines, in decibels, and over all; and
 * against WebGLRenderer. Pictures go to `folder`.
 */
export async function compareEditions(
  page: Page,
  folder: string,
  name: string,
  shot: Omit<Shot, 'size'>,
  truth: string,
  least = 45,
  all = 40,
): Promise<void> {
  const url = (path: string): string => `data:image/png;base64,${readFileSync(path).toString('base64')}`,
    inside = (a: string, b: string): Promise<number> =>
      page.evaluate(([a, b]) => window.gpu.inside(a, b), [url(a), url(b)] as const);
  const picture = async (backend: Backend): Promise<string> => {
    const { png, milliseconds } = await page.evaluate(([b, s]) => window.gpu.shoot(b, s), [
        backend,
        { ...shot, size },
      ] as const),
      path = join(folder, `${name}_${backend}.png`);
    writeFileSync(path, Buffer.from(png.replace(/.*,/, ''), 'base64'));
    const within = await inside(truth, path),
      over = psnr(path, truth);
    console.log(
      `${name} by ${await page.evaluate((b) => window.gpu.backendName(b), backend)}: ${within.toFixed(1)} dB ` +
        `against render inside outlines, ${over.toFixed(1)} over all; frames of ` +
        `${milliseconds.map((t) => t.toFixed(0)).join(', ')} ms (${folder})`,
    );
    expect(within).toBeGreaterThan(least);
    expect(over).toBeGreaterThan(all);
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
}
