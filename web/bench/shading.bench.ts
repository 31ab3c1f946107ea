// What relighting costs on this machine's WebGL 2, beside plain materials of three.js on the same meshes in the same
// run: JSON lines, as scripts/bench prints them. Chromium's software renderer runs vertex shaders on the processor, so
// ratios are pessimistic for hardware that hides texel fetches.
import { join } from 'node:path';
import { expect, it } from 'vitest';
import { haveBrowser, launch, openFixture } from '../e2e/browser.ts';
import { writeScene } from '../e2e/scenes.ts';
import { haveTool, lambent, makeFolder } from '../test/tool.ts';

it.skipIf(!haveTool || !haveBrowser)('shading', async () => {
  const folder = makeFolder(),
    scene = writeScene(folder),
    browser = await launch();
  // Zonal lobes are fitted to the order-6 bake. A lightmap costs its pixels look-ups, and its atlas a sum where the
  // light has changed.
  const cases: { kind: string; order: number; file: string; brdf?: string }[] = [3, 6, 10].map((order) => ({
    kind: 'diffuse',
    order,
    file: `order_${order}.glb`,
  }));
  for (const { order, file } of cases)
    lambent('bake', scene, '--max-edge', '0.05', '--samples', '32', '--order', String(order), '-o', join(folder, file));
  for (const lobes of [2, 4]) {
    lambent(
      'compress',
      join(folder, 'order_6.glb'),
      '--zonal',
      String(lobes),
      '-o',
      join(folder, `zonal_${lobes}.glb`),
    );
    cases.push({ kind: `zonal, ${lobes} lobes`, order: 6, file: `zonal_${lobes}.glb` });
  }
  lambent(
    'bake',
    scene,
    '--max-edge',
    '0.05',
    '--transfer',
    'lightmap',
    '--emit',
    'white=1,1,1',
    '--samples',
    '32',
    '--order',
    '6',
    '--texels-per-unit',
    '12',
    '-o',
    join(folder, 'lightmap.glb'),
  );
  cases.push({ kind: 'lightmap', order: 6, file: 'lightmap.glb' });
  for (const outgoing of ['map', 'svd:6']) {
    const file = `matrix_${outgoing.replace(':', '')}.glb`;
    lambent(
      'bake',
      scene,
      '--max-edge',
      '0.05',
      '--transfer',
      'matrix',
      '--brdf',
      'ggx:roughness=0.5,f0=0.9,0.7,0.4',
      '--outgoing',
      outgoing,
      '--samples',
      '32',
      '--bounces',
      '0',
      '--order',
      '5',
      '--incident-order',
      '4',
      '-o',
      join(folder, file),
    );
    cases.push({ kind: `matrix, ${outgoing}`, order: 5, file });
  }
  lambent('bake', scene, '--max-edge', '0.05', '--transfer', 'blocks', '-o', join(folder, 'blocks.glb'));
  const ofSight = (brdf: string): (typeof cases)[number] => ({
    kind: `blocks, ${brdf}`,
    order: 0,
    file: 'blocks.glb',
    brdf,
  });
  cases.push(ofSight('diffuse'), ofSight('phong:diffuse=0.7,specular=0.3,exponent=50'));
  const { page, server } = await openFixture(browser, folder);
  for (const { kind, order, file, brdf } of cases) {
    const frames = brdf ? 5 : 21;
    const t = await page.evaluate(([path, frames, brdf]) => window.scenes.timed(path, frames, brdf), [
      `/files/${file}`,
      frames,
      brdf ?? '',
    ] as const);
    const line = (what: string, limit: number, limitIs: string, ours = t.baked): boolean =>
      process.stdout.write(
        JSON.stringify({
          name: what,
          kind,
          order,
          channels: 3,
          vertices: t.vertices,
          ours,
          limit,
          ratio: ours / limit,
          unit: 'ms a frame',
          limit_is: limitIs,
          renderer: 'SwiftShader',
        }) + '\n',
      );
    line('web_frame', t.lambert, 'MeshLambertMaterial under a LightProbe, same meshes');
    line('web_still_frame', t.lambert, 'MeshLambertMaterial under a LightProbe, same meshes', t.still);
    line('web_frame', t.standard, 'MeshStandardMaterial under a LightProbe, same meshes');
    process.stdout.write(
      JSON.stringify({
        name: 'web_turn_light',
        kind,
        order,
        ours: t.turn,
        limit: 1000 / 60,
        ratio: t.turn / (1000 / 60),
        unit: 'ms',
        limit_is: 'a frame at 60 Hz',
      }) + '\n',
    );
    if (!brdf) expect(t.turn).toBeLessThan(1000 / 60);
  }
  await browser.close();
  await server.close();
});
