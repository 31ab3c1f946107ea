// Materials of the package in programs, on each of three's renderers: instances, lights of the program, and what is
// shown in place of the bake.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { Quaternion, Vector3 } from 'three';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, lambentJson, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import type { Backend, Shot } from './fixture/webgpu.ts';
import { haveBrowser, launch, openFixture, psnr } from './browser.ts';
import { png, writeBumpy, writeScene } from './scenes.ts';

const camera = '3.1,2.6,4.3,-0.3,0.8,0,38',
  size = [320, 240],
  rotate = '40,-25,70',
  sun = 'sky:elevation=35,azimuth=60',
  backends = ['webgl', 'webgpu', 'fallback'] as const;

describe.skipIf(!haveTool || !haveBrowser)('materials in a program', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name),
    cameraOf = (camera: string): number[] => camera.split(',').map(Number),
    turnAbout = (axis: number[]): Quaternion => new Quaternion().setFromAxisAngle(new Vector3(...axis), 1.1);
  let browser: Browser, server: ViteDevServer, page: Page;

  beforeAll(async () => {
    writeLopsidedHdr(at('light.hdr'));
    const scene = writeScene(folder),
      glossy = ['--transfer', 'matrix', '--order', '3', '--outgoing', 'svd:2', '--samples', '16'];
    lambent('bake', scene, '--samples', '128', '--order', '5', '-o', at('vertices.glb'));
    lambent(
      ...['bake', scene, '--transfer', 'lightmap', '--texels-per-unit', '12', '--samples', '64', '--order', '4'],
      ...['-o', at('atlas.glb')],
    );
    lambent('compress', at('vertices.glb'), '--zonal', '2', '-o', at('lobes.glb'));
    lambent('bake', scene, ...glossy, '-o', at('glossy.glb'));
    lambent('bake', scene, '--transfer', 'blocks', '--cube', '16', '-o', at('blocks.glb'));
    writeBumpy(at('bumpy.gltf'));
    lambent(
      ...['bake', at('bumpy.gltf'), '--transfer', 'lightmap', '--texels-per-unit', '16', '--samples', '64'],
      ...['--directional', 'sh:2', '--sky', sun, '-o', at('bumps.glb')],
    );
    browser = await launch();
    ({ page, server } = await openFixture(browser, folder, 'webgpu.html'));
  });
  afterAll(async () => {
    await browser?.close();
    await server?.close();
  });

  const lightOf = (order: number): number[] =>
    (
      lambentJson('env', at('light.hdr'), '--env-rotate', rotate, '--order', String(order)) as {
        coefficients: number[][];
      }
    ).coefficients.flat();
  const inside = (a: string, b: string): Promise<number> =>
    page.evaluate(([a, b]) => window.gpu.inside(a, b), [a, b] as const);
  const keep = (name: string, data: string): string => {
    writeFileSync(at(name), Buffer.from(data.replace(/.*,/, ''), 'base64'));
    return data;
  };
  const shoot = async (backend: Backend, shot: Shot): Promise<string> =>
    (await page.evaluate(([b, s]) => window.gpu.shoot(b, s), [backend, shot] as const)).png;

  /** What each renderer draws, against WebGLRenderer, and against `truth`, a picture by `render`. */
  async function alike(
    name: string,
    draw: (backend: Backend) => Promise<string>,
    truth?: string,
    least = 45,
    all = 40,
  ): Promise<void> {
    const pictures: string[] = [];
    for (const backend of backends) {
      pictures.push(keep(`${name}_${backend}.png`, await draw(backend)));
      const between = await inside(pictures[0]!, pictures.at(-1)!);
      let line = `${name} by ${backend}: ${between.toFixed(1)} dB against WebGLRenderer inside outlines`;
      if (truth) {
        const url = `data:image/png;base64,${readFileSync(truth).toString('base64')}`,
          within = await inside(url, pictures.at(-1)!),
          over = psnr(at(`${name}_${backend}.png`), truth);
        line += `; against render ${within.toFixed(1)}, ${over.toFixed(1)} over all`;
        expect(within).toBeGreaterThan(least);
        expect(over).toBeGreaterThan(all);
      }
      console.log(`${line} (${folder})`);
      expect(between).toBeGreaterThan(50);
    }
  }

  /** One quaternion, place and size each. */
  const copies = [
    [...turnAbout([0.48, -0.6, 0.64]).toArray(), -1.6, 0.4, 0, 0.5],
    [...turnAbout([0, 1, 0]).toArray(), 0.7, -0.2, 0.3, 0.8],
    [...turnAbout([-0.8, 0, 0.6]).toArray(), 0.9, 1.6, -1, 0.4],
  ];
  for (const [name, light] of [
    ['vertices', 5],
    ['vertices', sun],
    ['lobes', 5],
    ['atlas', 4],
    ['atlas', sun],
    ['bumps', 1],
    ['glossy', 3],
    ['glossy', sun],
  ] as const)
    it(`draws instances as it draws turned copies: ${name}, ${light}`, async () => {
      const shot = {
        ...{
          path: `/files/${name}.glb`,
          light: light === sun ? sun : lightOf(light),
          exposure: light === sun ? -2 : 0,
        },
        ...{ camera: cameraOf('3.4,1.4,4.6,0,0.5,0,44'), size, peaks: light === sun, copies },
        turn: turnAbout([0.6, 0.8, 0]).slerp(new Quaternion(), 0.7).toArray(),
      };
      for (const backend of backends) {
        const take = async (instanced: boolean): Promise<string> => {
          const { png } = await page.evaluate(([b, s]) => window.gpu.shoot(b, s), [
            backend,
            { ...shot, instanced },
          ] as const);
          writeFileSync(
            at(`${name}_${instanced ? 'instances' : 'copies'}_${backend}.png`),
            Buffer.from(png.replace(/.*,/, ''), 'base64'),
          );
          return png;
        };
        const db = await page.evaluate(([a, b]) => window.gpu.inside(a, b), [
          await take(false),
          await take(true),
        ] as const);
        console.log(`instances of ${name}, ${light}, ${backend}: ${db.toFixed(1)} dB against copies (${folder})`);
        expect(db).toBeGreaterThan(50);
      }
    });

  for (const [name, order] of [
    ['vertices', 5],
    ['atlas', 4],
    ['lobes', 5],
  ] as const)
    it(`lets shadows of what was not baked fall on what was, in the program's own light: ${name}`, async () => {
      const shot = { path: `/files/${name}.glb`, light: lightOf(order), camera: cameraOf(camera), size },
        // The grey floor in the light, in the box's shadow, and in that of the baked sail.
        points: [number, number, number][] = [
          [0.5, 0, 1],
          [0.2, 0, 1.45],
          [1.1, 0, -0.13],
        ],
        sun = ((3 / Math.PI) * 5) / Math.hypot(1, 5, 0.5);
      const pictures: string[] = [];
      for (const backend of backends) {
        const { values, png } = await page.evaluate(([b, s, p]) => window.gpu.underSun(b, s, p), [
          backend,
          shot,
          points,
        ] as const);
        pictures.push(png);
        writeFileSync(at(`${name}_sun_${backend}.png`), Buffer.from(png.replace(/.*,/, ''), 'base64'));
        const [alone, lit, again] = values as [number[][], number[][], number[][]],
          more = lit.map((v, i) => v.map((x, c) => x - alone[i]![c]!));
        console.log(`${name} under a lamp by ${backend}: ${JSON.stringify({ more, alone })} (${folder})`);
        expect(again).toEqual(alone);
        [0.6, 0.58, 0.55].forEach((grey, c) => {
          expect(Math.abs(more[0]![c]! / (grey * sun) - 1)).toBeLessThan(0.01);
          expect(more[1]![c]).toBe(0);
          expect(more[2]![c]).toBe(0);
          expect(alone[1]![c]).toBeGreaterThan(0.01);
        });
      }
      for (const other of pictures.slice(1)) {
        const db = await page.evaluate(([a, b]) => window.gpu.inside(a, b), [pictures[0]!, other] as const);
        console.log(`${name} under a lamp: ${db.toFixed(1)} dB against WebGLRenderer inside outlines`);
        expect(db).toBeGreaterThan(50);
      }
    });

  for (const [name, args] of [
    ['vertices', ['--order', '3']],
    ['zonal', ['--order', '3', '--transfer', 'zonal', '--lobes', '2']],
    ['flat', ['--order', '3', '--transfer', 'lightmap', '--texels-per-unit', '8']],
    ['directional', ['--transfer', 'lightmap', '--texels-per-unit', '8', '--directional', 'sh:2', '--sky', sun]],
  ] as const)
    it(`takes what a lamp sends by normal maps: ${name}`, async () => {
      lambent('bake', at('bumpy.gltf'), ...args, '--samples', '16', '-o', at(`bumps_${name}.glb`));
      const shot = { path: `/files/bumps_${name}.glb`, light: [], camera: cameraOf('1.6,1.5,2.2,-0.1,0.4,-0.2,40') };
      for (const backend of backends) {
        const { maps, flat } = await page.evaluate(([b, s]) => window.gpu.straight(b, s), [
          backend,
          { ...shot, size },
        ] as const);
        console.log(`${name} by ${backend}: ${maps.toFixed(1)} dB with normal maps, ${flat.toFixed(1)} without`);
        expect(maps).toBeGreaterThan(50);
        expect(flat).toBeLessThan(35);
      }
    });

  it('says where lights of the program cannot count', async () => {
    const shot = { path: '/files/glossy.glb', light: lightOf(3), camera: cameraOf(camera), size };
    await expect(page.evaluate((s) => window.gpu.underSun('webgl', s, []), shot)).rejects.toThrow(
      /no diffuse transfer, beside which lights count/,
    );
  });

  it('says which instances it does not light as they stand', async () => {
    const [uneven, mirrored, foreign, ...more] = await page.evaluate(() => window.gpu.said('/files/vertices.glb'));
    expect(uneven).toMatch(/"copies": scaled unevenly or sheared.*: 1$/);
    expect(mirrored).toMatch(/"copies": mirrored.*: 1$/);
    expect(foreign).toMatch(/"copies": of no mesh as it was loaded/);
    expect(more).toEqual([]);
    const other = await page.evaluate(() => window.gpu.said('/files/blocks.glb'));
    expect(other).toHaveLength(2);
    expect(other[0]).toMatch(/"copies": turned differently, which this kind/);
  });

  const coefficient = 5; // y_21 or so: a sign each way
  for (const name of ['vertices', 'lobes', 'atlas', 'glossy'])
    it(`shows a coefficient in false colour: ${name}`, async () => {
      const shot = { path: `/files/${name}.glb`, light: lightOf(1), camera: cameraOf(camera), size };
      await alike(`coefficient_of_${name}`, (backend) => shoot(backend, { ...shot, wears: coefficient }));
    });

  it("shows the error of a fit, and what is lit with nothing in the light's way, a sun's peaks too", async () => {
    const shot = { light: lightOf(5), camera: cameraOf(camera), size };
    await alike('fit_errors', (backend) => shoot(backend, { ...shot, path: '/files/lobes.glb', wears: 'errors' }));
    const truth = at('open_render.png'),
      view = ['--camera', camera, '--size', size.join('x'), '--spp', '16', '--background', 'none', '--window', 'none'];
    lambent('bake', at('scene.obj'), '--shadows', 'off', '--order', '5', '-o', at('open.glb'));
    renderLinear(at('open.glb'), '--env', at('light.hdr'), '--env-rotate', rotate, ...view, '-o', truth);
    const open: Shot = { ...shot, path: '/files/vertices.glb', wears: 'unshadowed' };
    await alike('unshadowed', (backend) => shoot(backend, open), truth);
    await alike('unshadowed_sun', (backend) => shoot(backend, { ...open, light: sun, exposure: -2, peaks: true }));
  });

  const few = ['--depth', '0.25', '--size', '32', '--samples', '128'],
    groove = { depth: 0.6, width: 0.8 };
  for (const { name, order, patch, worn, grooves } of [
    { name: 'relief_2', order: 5, patch: [...few, '--lobes', '2', '--order', '5'], worn: [] },
    { name: 'relief_4', order: 6, patch: [...few, '--lobes', '4', '--order', '6'], worn: [] },
    {
      ...{ name: 'grooves', order: 6, patch: ['--groove', '1', '--size', '16'], grooves: groove },
      worn: ['--groove-depth', String(groove.depth), '--groove-width', String(groove.width)],
    },
  ])
    it(`shades a mesh by a texture of lobes: ${name}`, async () => {
      const near = '1.6,1.5,2.2,-0.1,0.4,-0.2,40',
        tile = [2, 1.5],
        truth = at(`${name}.png`),
        wave = (x: number, y: number): number =>
          0.5 + 0.25 * Math.sin((2 * Math.PI * x) / 32) + 0.2 * Math.cos((2 * Math.PI * (x + 2 * y)) / 32 + 0.7);
      writeBumpy(at('mesh.gltf'));
      writeFileSync(
        at('heights.png'),
        png(32, 32, (x, y) => [wave(x, y), wave(x, y), wave(x, y)]),
      );
      lambent('patch', ...(grooves ? [] : [at('heights.png')]), ...patch, '-o', at(`${name}.lpt`));
      const wearing = (...more: string[]): string[] => [
        ...[at('mesh.gltf'), '--transfer-texture', at(`${name}.lpt`), '--tile', tile.join()],
        ...['--env', at('light.hdr'), '--env-rotate', rotate, '--camera', near, '--size', size.join('x')],
        ...['--spp', '16', '--background', 'none', '--exposure=1', ...more],
      ];
      renderLinear(...wearing(...worn), '-o', truth);
      const shot = { path: '/files/mesh.gltf', light: lightOf(order), camera: cameraOf(near), size },
        shown = async (backend: Backend): Promise<string> =>
          (
            await page.evaluate(([b, s, r, t, g]) => window.gpu.textured(b, s, r, t, 1, g), [
              ...([backend, shot, `/files/${name}.lpt`, tile, grooves] as const),
            ] as const)
          ).png;
      await alike(name, shown, truth, 42, 40);
      if (!grooves) return;
      // The comparison can fail.
      renderLinear(...wearing('--groove-depth', '0.3'), '-o', at('shallow.png'));
      expect(psnr(at('shallow.png'), truth)).toBeLessThan(35);
    });
});
