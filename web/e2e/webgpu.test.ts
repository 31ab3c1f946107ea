// The package on WebGPURenderer, with WebGPU (of a software device) and with its WebGL 2 backend, against
// `lambent render`, and against WebGLRenderer.
import { existsSync, readFileSync, statSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser, Page } from 'playwright-core';
import type { ViteDevServer } from 'vite';
import { Quaternion, Vector3 } from 'three';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, lambentJson, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import type { Backend, Shot } from './fixture/webgpu.ts';
import { haveBrowser, launch, openFixture } from './browser.ts';
import { cameraOf, compareEditions, size, view } from './editions.ts';
import { writeBumpy, writeGlass, writeScene, writeSkin } from './scenes.ts';

const camera = '3.1,2.6,4.3,-0.3,0.8,0,38',
  rotate = '40,-25,70';

describe.skipIf(!haveTool || !haveBrowser)('on WebGPURenderer', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser, server: ViteDevServer, page: Page;

  beforeAll(async () => {
    writeLopsidedHdr(at('light.hdr'));
    const scene = writeScene(folder);
    writeBumpy(at('bumpy.gltf'));
    lambent('bake', scene, '--samples', '128', '--order', '5', '-o', at('vertices.glb'));
    lambent(
      ...['bake', scene, '--transfer', 'lightmap', '--texels-per-unit', '12', '--samples', '64', '--order', '4'],
      ...['--emit', 'white=0.5,0.4,0.2', '--light-groups', '-o', at('atlas.glb')],
    );
    lambent('compress', at('vertices.glb'), '--zonal', '2', '-o', at('lobes.glb'));
    const glossy = ['--transfer', 'matrix', '--order', '3', '--outgoing', 'svd:2', '--samples', '16'];
    lambent('bake', scene, ...glossy, '-o', at('glossy.glb'));
    lambent('bake', scene, '--transfer', 'blocks', '--cube', '32', '--visibility', 'bits:3', '-o', at('blocks.glb'));
    browser = await launch();
    ({ page, server } = await openFixture(browser, folder, 'webgpu.html'));
  });
  afterAll(async () => {
    await browser?.close();
    await server?.close();
  });

  const compare = (name: string, shot: Omit<Shot, 'size'>, truth: string, least = 45, all = 40): Promise<void> =>
    compareEditions(page, folder, name, shot, truth, least, all);
  const lightOf = (order: number): number[] =>
    (
      lambentJson('env', at('light.hdr'), '--env-rotate', rotate, '--order', String(order)) as {
        coefficients: number[][];
      }
    ).coefficients.flat();
  const lit = ['--env', at('light.hdr'), '--env-rotate', rotate, '--window', 'none'];

  for (const [name, order] of [
    ['vertices', 5],
    ['atlas', 4],
  ] as const)
    it(`draws what render and WebGLRenderer draw: ${name}`, async () => {
      const truth = at(`${name}_render.png`);
      renderLinear(at(`${name}.glb`), ...lit, ...view(camera), '-o', truth);
      await compare(name, { path: `/files/${name}.glb`, light: lightOf(order), camera: cameraOf(camera) }, truth);
    });

  it('draws a file that is packed for browsers as render draws it whole', async () => {
    for (const [name, order] of [
      ['vertices', 5],
      ['atlas', 4],
    ] as const) {
      const truth = at(`${name}_whole.png`);
      renderLinear(at(`${name}.glb`), ...lit, ...view(camera), '-o', truth);
      lambent('export', at(`${name}.glb`), '--web', at(`${name}_site`), '--pack', 'auto');
      const [before, after] = [`${name}.glb`, `${name}_site/data/scene.glb`].map((file) => statSync(at(file)).size);
      console.log(`${name}: ${before} bytes, packed ${after}`);
      const path = `/files/${name}_site~data~scene.glb`;
      await compare(`${name}_packed`, { path, light: lightOf(order), camera: cameraOf(camera) }, truth);
    }
  });

  for (const kind of ['sh:2', 'sh:3', 'hl2', 'vector'])
    it(`draws a directional lightmap, bumps and a glowing texture: ${kind}`, async () => {
      const name = `directional_${kind.replace(':', '')}`,
        camera = '1.6,1.5,2.2,-0.1,0.4,-0.2,40',
        truth = at(`${name}_render.png`);
      lambent(
        ...['bake', at('bumpy.gltf'), '--transfer', 'lightmap', '--texels-per-unit', '16', '--samples', '64'],
        ...['--directional', kind, '--sky', 'sky:elevation=30,azimuth=60', '-o', at(`${name}.glb`)],
      );
      renderLinear(at(`${name}.glb`), ...view(camera), '--exposure', '-2', '-o', truth);
      const shot = { path: `/files/${name}.glb`, light: [0, 0, 0], camera: cameraOf(camera) };
      await compare(name, { ...shot, exposure: -2 }, truth);
    });

  it('draws panes that are half there, stained, and half reflecting', async () => {
    const camera = '0.2,4.4,3.4,-0.1,0.2,0.1,36', // panes before the floor and the wall, and not before nothing
      truth = at('glass_render.png');
    writeGlass(at('glass.gltf'));
    lambent('bake', at('glass.gltf'), '--samples', '128', '--order', '5', '-o', at('glass.glb'));
    renderLinear(at('glass.glb'), ...lit, ...view(camera), '-o', truth);
    const shot = { path: '/files/glass.glb', light: lightOf(5), camera: cameraOf(camera) };
    await compare('glass', shot, truth);
  });

  const sun = 'sky:elevation=35,azimuth=60';
  const glossy = 'ggx:roughness=0.5,f0=0.9';
  for (const [outgoing, more] of [
    ['map', []],
    ['svd:4', ['--brdf', glossy]],
    ['sh:4', ['--brdf', glossy]],
    ['hsh:4', ['--brdf', glossy]],
    ['phong', ['--brdf', 'phong:diffuse=0.4,specular=0.5,exponent=8']],
  ] as const)
    it(`draws a last reflection: ${outgoing}`, async () => {
      const name = `matrix_${outgoing.replace(':', '')}`,
        truth = at(`${name}_render.png`),
        size = ['--order', '4', '--incident-order', '4', '--samples', '64'];
      lambent(
        ...['bake', join(folder, 'scene.obj'), '--transfer', 'matrix', ...size, '--outgoing', outgoing, ...more],
        ...['-o', at(`${name}.glb`)],
      );
      renderLinear(at(`${name}.glb`), ...lit, ...view(camera), '-o', truth);
      await compare(name, { path: `/files/${name}.glb`, light: lightOf(4), camera: cameraOf(camera) }, truth);
    });

  it('draws zonal lobes, glossy ones too, and what turns with a skin', async () => {
    renderLinear(at('lobes.glb'), ...lit, ...view(camera), '-o', at('lobes_render.png'));
    const shot = { path: '/files/lobes.glb', light: lightOf(5), camera: cameraOf(camera) };
    await compare('lobes', shot, at('lobes_render.png'));
    const rows = ['--transfer', 'zonal', '--outgoing', 'sh:2', '--lobes', '2', '--brdf', glossy];
    lambent('bake', join(folder, 'scene.obj'), '--order', '3', ...rows, '--samples', '32', '-o', at('gloss_lobes.glb'));
    renderLinear(at('gloss_lobes.glb'), ...lit, ...view(camera), '-o', at('gloss_lobes_render.png'));
    const gloss = { path: '/files/gloss_lobes.glb', light: lightOf(3), camera: cameraOf(camera) };
    await compare('gloss_lobes', gloss, at('gloss_lobes_render.png'));
    writeSkin(at('skin.glb'), 0.3);
    const few = ['--samples', '64', '--lobes', '4', '-o'],
      svd = ['--outgoing', 'svd:2', '--brdf', glossy];
    lambent('bake', at('skin.glb'), '--transfer', 'zonal', '--order', '5', ...few, at('skin_lobes.glb'));
    lambent('bake', at('skin.glb'), '--transfer', 'zonal', '--order', '3', ...svd, ...few, at('skin_gloss.glb'));
    const near = '1.4,1.9,2.6,0.1,0.1,0,38';
    for (const [name, order] of [
      ['skin_lobes', 5],
      ['skin_gloss', 3],
    ] as const) {
      const truth = at(`${name}_render.png`);
      renderLinear(at(`${name}.glb`), ...lit, ...view(near, ['--animation', 'bend', '--time', '0.9']), '-o', truth);
      const bent = { path: `/files/${name}.glb`, light: lightOf(order), camera: cameraOf(near), time: 0.9 };
      await compare(name, bent, truth, 45, 40);
    }
  });

  it("holds the light's peaks apart", async () => {
    for (const name of ['vertices', 'lobes', 'glossy']) {
      const truth = at(`${name}_sun_render.png`);
      renderLinear(at(`${name}.glb`), '--env', sun, ...view(camera, ['--exposure', '-2']), '-o', truth);
      const shot = { path: `/files/${name}.glb`, light: sun, camera: cameraOf(camera) };
      await compare(`${name}_sun`, { ...shot, exposure: -2, peaks: true }, truth, 45, 40);
    }
  });

  const turnAbout = (axis: number[]): Quaternion => new Quaternion().setFromAxisAngle(new Vector3(...axis), 1.1);
  /** The camera of somebody who was turned as well, about where the scene's origin is. */
  function along(camera: string, turn: Quaternion): number[] {
    const numbers = cameraOf(camera);
    return [0, 3]
      .flatMap((from) =>
        new Vector3()
          .fromArray(numbers.slice(from, from + 3))
          .applyQuaternion(turn)
          .toArray(),
      )
      .concat(numbers[6]!);
  }
  const turning: [string, string[], string?][] = [
    ['vertices', ['--order', '4', '--samples', '256', '--bounces', '1']],
    [
      'atlas',
      ['--transfer', 'lightmap', '--texels-per-unit', '8', '--order', '4', '--samples', '256', '--bounces', '1'],
    ],
    [
      'matrix',
      [
        ...['--transfer', 'matrix', '--brdf', 'ggx:roughness=0.6,f0=0.6', '--outgoing', 'map'],
        ...['--order', '4', '--incident-order', '3', '--samples', '256', '--bounces', '1'],
      ],
    ],
    ['blocks', ['--transfer', 'blocks', '--cube', '32', '--visibility', 'bits:3'], 'diffuse'],
    ['shiny', ['--transfer', 'blocks', '--cube', '32', '--visibility', 'bits:3'], 'ggx:roughness=0.4,f0=0.6'],
  ];
  for (const [name, args, brdf] of turning)
    it(`draws a scene that was turned since as render draws it where it was baked so: ${name}`, async () => {
      const turn = turnAbout([0.48, -0.6, 0.64]),
        text = readFileSync(at('scene.obj'), 'utf8'),
        v = new Vector3();
      writeFileSync(
        at('other.obj'),
        text.replace(/^(vn?) (\S+) (\S+) (\S+)/gm, (_, key: string, ...xyz: string[]) => {
          v.fromArray(xyz.slice(0, 3).map(Number)).applyQuaternion(turn);
          return `${key} ${v.toArray().join(' ')}`;
        }),
      );
      const kind = brdf ? 'blocks' : name,
        files = ['scene', 'other'].map((file) => `${kind}_of_${file}.glb`) as [string, string];
      for (const file of files)
        if (!existsSync(at(file)))
          lambent('bake', at(file.replace(/.*_of_|glb/g, '') + 'obj'), ...args, '-o', at(file));
      const seen = along(camera, turn),
        truth = at(`${name}_turned_render.png`),
        sky = 'sky:elevation=35,azimuth=60',
        light = brdf ? ['--env', sky, '--brdf', brdf, '--exposure', '-1'] : lit;
      renderLinear(at(files[1]), ...light, ...view(seen.join(',')), '-o', truth);
      const path = `/files/${files[0]}`,
        shot = { path, camera: seen, turn: turn.toArray() };
      await compare(
        `${name}_turned`,
        brdf ? { ...shot, light: sky, brdf, exposure: -1 } : { ...shot, light: lightOf(4) },
        truth,
        45,
        brdf ? 36 : 40, // render's vertices that look away from the eye are black
      );
      if (brdf || name === 'atlas') return;
      const instance = { path, camera: seen, copies: [[...turn.toArray(), 0, 0, 0, 1]], instanced: true };
      await compare(`${name}_instance`, { ...instance, light: lightOf(4) }, truth);
    });

  it('sees lobes of visibility in blocks from where the eye is, of a scene that was moved', async () => {
    const move = [0.9, -0.6, 1.4],
      truth = at('moved_render.png'),
      sky = 'sky:elevation=35,azimuth=60',
      brdf = 'ggx:roughness=0.4,f0=0.6';
    renderLinear(at('blocks.glb'), '--env', sky, '--brdf', brdf, '--exposure', '-1', ...view(camera), '-o', truth);
    const seen = cameraOf(camera).map((x, i) => x + move[i % 3]! * (i < 6 ? 1 : 0));
    const shot = { path: '/files/blocks.glb', light: sky, brdf, exposure: -1, camera: seen, move };
    await compare('moved', shot, truth, 45, 36);
  });

  it('draws bumps of a scene that was turned with the lamps that it was baked under', async () => {
    const turn = turnAbout([0, 1, 0]),
      near = '1.6,1.5,2.2,-0.1,0.4,-0.2,40',
      truth = at('bumps_turned_render.png');
    lambent(
      ...['bake', at('bumpy.gltf'), '--transfer', 'lightmap', '--texels-per-unit', '16', '--samples', '64'],
      ...['--directional', 'sh:3', '--sky', 'sky:elevation=30,azimuth=60', '-o', at('bumps.glb')],
    );
    renderLinear(at('bumps.glb'), ...view(near), '--exposure', '-2', '-o', truth);
    const shot = { path: '/files/bumps.glb', light: [0, 0, 0], camera: along(near, turn), turn: turn.toArray() };
    await compare('bumps_turned', { ...shot, exposure: -2 }, truth);
  });

  const lamps = [
    'point@0.9,1.9,1.1=6,5,4',
    'spot@-1.2,2.2,1.6,-0.4,0.4,0,40=9,12,15',
    'sphere@1.5,0.6,1.2,0.15=20,8,4',
    'sun@60,50=0.6,0.6,0.8',
  ];
  for (const [name, show, more] of [
    ['bounced', 'indirect', []],
    ['bounced_texels', 'indirect', ['--receivers', 'texels', '--atlas', '256x256']],
    ['direct', 'direct', []],
    ['both', 'all', []],
  ] as const)
    it(`draws lamps that move, and paint: ${name}`, async () => {
      const truth = at(`${name}_render.png`),
        few = ['--transfer', 'indirect', '--surfels', '2048', '--samples', '64', ...more],
        file = more.length > 0 ? 'moving_texels' : 'moving',
        // A sphere's shadow is that of its middle here.
        given = show === 'indirect' ? lamps : lamps.filter((lamp) => !lamp.startsWith('sphere'));
      if (!existsSync(at(`${file}.glb`))) lambent('bake', join(folder, 'scene.obj'), ...few, '-o', at(`${file}.glb`));
      renderLinear(
        ...[at(`${file}.glb`), ...view(camera), '--albedo', 'red=0.1,0.2,0.8'],
        ...[...(show === 'all' ? [] : ['--show', show]), ...(show === 'direct' ? [] : ['--at', 'receivers'])],
        ...[...given.flatMap((lamp) => ['--lamp', lamp]), '-o', truth],
      );
      const shot = { path: `/files/${file}.glb`, light: [0, 0, 0], camera: cameraOf(camera) };
      // A shadow's edge is sharp in render, and over a texel or two here.
      await compare(
        name,
        { ...shot, show, lamps: given, paint: ['red', [0.1, 0.2, 0.8]] },
        truth,
        45,
        show === 'indirect' ? 45 : 38,
      );
    });

  for (const brdf of ['diffuse', 'phong:diffuse=0.4,specular=0.5,exponent=50', 'ggx:roughness=0.4,f0=0.6'])
    it(`draws visibility in blocks as WebGLRenderer does: ${brdf}`, async () => {
      const path = '/files/blocks.glb',
        shot = { path, light: 'sky:elevation=35,azimuth=60,sun=on', brdf, camera: cameraOf(camera), size };
      const take = (backend: Backend): Promise<{ png: string; milliseconds: number[] }> =>
        page.evaluate(([b, s]) => window.gpu.shoot(b, s), [backend, shot] as const);
      const truth = await take('webgl');
      for (const backend of ['webgpu', 'fallback'] as const) {
        const { png, milliseconds } = await take(backend),
          db = await page.evaluate(([a, b]) => window.gpu.inside(a, b), [truth.png, png] as const);
        writeFileSync(at(`blocks_${brdf.split(':')[0]}_${backend}.png`), Buffer.from(png.replace(/.*,/, ''), 'base64'));
        const frames = [truth.milliseconds, milliseconds].map((all) => all.map((t) => t.toFixed(0)).join(', '));
        console.log(
          `blocks, ${brdf}, ${backend}: ${db.toFixed(1)} dB against WebGLRenderer inside outlines; frames of ` +
            `${frames[1]} ms, there ${frames[0]} ms (${folder})`,
        );
        expect(db).toBeGreaterThan(50);
      }
    });

  it('says what it does not draw, in place of a white surface', async () => {
    const say = (name: string, withNodes: boolean): Promise<string[]> =>
      page.evaluate(([path, nodes]) => window.gpu.refusal(path, nodes), [`/files/${name}`, withNodes] as const);
    for (const sentence of await say('vertices.glb', false)) expect(sentence).toMatch(/lambent-three\/webgpu/);
    for (const sentence of await say('glossy.glb', false)) expect(sentence).toMatch(/lambent-three\/webgpu/);
    expect(await say('vertices.glb', true)).toEqual(['', '']);
  });
});
