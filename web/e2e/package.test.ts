// The package in a three.js program of somebody else's.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { Vector3 } from 'three';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, writeLopsidedHdr } from '../test/tool.ts';
import { haveBrowser, launch, openFixture } from './browser.ts';
import { writeBall, writeScene } from './scenes.ts';

describe.skipIf(!haveTool || !haveBrowser)('the package', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, server: ViteDevServer, page: Page;

  beforeAll(async () => {
    writeLopsidedHdr(at('light.hdr'));
    writeBall(at('ball.obj'));
    lambent('bake', at('ball.obj'), '--shadows', 'off', '-o', at('ball.glb'));
    // So far away that it is alone under the sky.
    const free = ['--lattice', '2,2,2', '--lattice-box=40,40,40,44,44,44', '--lattice-order', '3', '--samples', '64'];
    lambent('bake', at('ball.obj'), ...free, '-o', at('free.glb'));
    const scene = writeScene(folder),
      atlas = ['--receivers', 'texels', '--texels-per-unit', '4', '--samples', '16', '--order', '4'];
    lambent('bake', scene, '--samples', '64', '-o', at('scene.glb'));
    lambent('bake', scene, ...atlas, '-o', at('atlas.glb'));
    lambent('export', at('ball.glb'), '--env', at('light.hdr'), '--web', at('site'));
    browser = await launch();
    ({ page, server } = await openFixture(browser, folder));
  });
  afterAll(async () => {
    await browser?.close();
    await server?.close();
  });

  it('is as bright as the materials of three.js under a probe of the same light', async () => {
    const values = await page.evaluate(() =>
      window.scenes.mixed('/files/ball.glb', '/files/site~data~environment-0.exr'),
    );
    const means = [0, 1, 2].map(
      (which) => values.reduce((sum, v) => sum + v[which]!.reduce((a, b) => a + b), 0) / values.length / 3,
    );
    let worst = 0;
    for (const [baked, lambert] of values)
      baked!.forEach((v, c) => (worst = Math.max(worst, Math.abs(v - lambert![c]!) / means[1]!)));
    console.log(
      `mean radiance: baked ${means[0]!.toFixed(5)}, Lambert ${means[1]!.toFixed(5)}, ` +
        `Standard ${means[2]!.toFixed(5)}; largest difference ${(100 * worst).toFixed(2)} % of the mean`,
    );
    expect(means[0]).toBeGreaterThan(0.01);
    expect(Math.abs(means[0]! / means[1]! - 1)).toBeLessThan(0.005);
    expect(worst).toBeLessThan(0.04); // facets of 4.5 degrees, and normals half a pixel apart
    // Roughness 1 takes what its specular part reflects out of the diffuse part, and adds none of it back from a probe.
    expect(means[2]! / means[0]!).toBeGreaterThan(0.9);
    expect(means[2]! / means[0]!).toBeLessThan(1.01);
  });

  it("lights materials of three's own by a grid of probes out of its lattice", async () => {
    const { apart, mean } = await page.evaluate(() =>
      window.scenes.probes('/files/free.glb', '/files/site~data~environment-0.exr'),
    );
    console.log(`a grid of probes: ${((100 * apart) / mean).toFixed(2)} % of the mean apart at most`);
    expect(mean).toBeGreaterThan(0.01);
    expect(apart / mean).toBeLessThan(0.005);
  });

  it('has materials that are cloned, and that take hooks of a program beside their own', async () => {
    for (const path of ['/files/scene.glb', '/files/atlas.glb']) {
      const { own, clone, hook } = await page.evaluate((path) => window.scenes.dressed(path), path);
      expect(Math.min(...own)).toBeGreaterThan(100);
      expect(clone).toEqual(own);
      expect(hook[0]! / own[0]!).toBeCloseTo(0.5, 5);
      expect(hook.slice(1)).toEqual(own.slice(1));
    }
  });

  it.each([
    ['diffuse', ['--order', '4']],
    ['atlas', ['--receivers', 'texels', '--texels-per-unit', '8', '--order', '4']],
    [
      'matrix',
      [
        '--transfer',
        'matrix',
        '--brdf',
        'ggx:roughness=0.6,f0=0.6',
        '--outgoing',
        'map',
        '--order',
        '4',
        '--incident-order',
        '3',
      ],
    ],
  ])('lights a scene that was turned since as if it had been baked so: %s', async (name, kind) => {
    // The ball over a floor, and the same turned about the fixture's axis.
    const axis = new Vector3(0.48, -0.6, 0.64),
      text = readFileSync(at('scene.obj'), 'utf8'),
      v = new Vector3();
    writeFileSync(
      at('other.obj'),
      text.replace(/^(vn?) (\S+) (\S+) (\S+)/gm, (_, key: string, ...xyz: string[]) => {
        v.fromArray(xyz.slice(0, 3).map(Number)).applyAxisAngle(axis, 1.1);
        return `${key} ${v.toArray().join(' ')}`;
      }),
    );
    for (const file of ['scene', 'other'])
      lambent(
        'bake',
        at(`${file}.obj`),
        ...kind,
        '--samples',
        '512',
        '--bounces',
        '1',
        '-o',
        at(`${file}_${name}.glb`),
      );
    const { turned, not } = await page.evaluate(
      (files) => window.scenes.turned(files[0]!, files[1]!),
      ['scene', 'other'].map((file) => `/files/${file}_${name}.glb`),
    );
    console.log(`turned, ${name}: ${turned.toFixed(1)} dB; taken as it was baked ${not.toFixed(1)} dB`);
    expect(turned).toBeGreaterThan(45);
    expect(not).toBeLessThan(turned - 10);
  });

  it('leaves files open to a plain GLTFLoader', async () => {
    const { materials, hasOurs, shown } = await page.evaluate(() => window.scenes.plain('/files/scene.glb'));
    expect(materials).toEqual(new Array(5).fill('MeshStandardMaterial'));
    expect(hasOurs).toBe(false);
    expect(shown).toBeGreaterThan(0.1);
  });

  it('refuses transfer that does not fit, in a sentence', async () => {
    const file = readFileSync(at('scene.glb')),
      jsonLength = file.readUInt32LE(12),
      json = file.subarray(20, 20 + jsonLength).toString();
    /** The file with its JSON changed, and as long as it was. */
    const write = (name: string, from: RegExp, to: string): void => {
      const changed = json.replace(from, to);
      expect(changed).not.toBe(json);
      expect(changed.trimEnd().length).toBeLessThanOrEqual(jsonLength);
      writeFileSync(
        at(name),
        Buffer.concat([
          file.subarray(0, 20),
          Buffer.from(changed.trimEnd().padEnd(jsonLength)),
          file.subarray(20 + jsonLength),
        ]),
      );
    };
    write('order.glb', /"order":6,"precision":"half","receivers":(?=\d)/, '"order":5,"precision":"half","receivers":');
    write('kind.glb', /"kind":"diffuse"/, '"kind":"zigzag"');
    write('few.glb', /"precision":"half","receivers":\d+/, '"precision":"half","receivers":9');
    write('node.glb', /"node":0,"primitive":0/, '"node":9,"primitive":0');
    const say = (name: string): Promise<string> =>
      page.evaluate((path) => window.scenes.refusal(path), `/files/${name}`);
    expect(await say('order.glb')).toMatch(/holds \d+ bytes of transfer where its header makes \d+/);
    expect(await say('kind.glb')).toMatch(/kind "zigzag".*diffuse/);
    expect(await say('few.glb')).toMatch(/bytes of transfer where its header makes 3456|receiver \d+ is out of range/);
    expect(await say('node.glb')).toMatch(/node 9, primitive 0 has transfer but no mesh/);
  });
});
