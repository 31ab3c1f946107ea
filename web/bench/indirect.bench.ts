// What a lamp that a hand moves by a step takes in the page's own code (in Node.js, whose engine is Chromium's), and in
// `lambent render` in the same run: JSON lines. SCENE: a scene, or a file of direct to indirect light.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { expect, it } from 'vitest';
import { bakedScene, LambentTransferPlugin, parseLamp } from '../src/index.ts';
import { haveTool, lambent, lambentJson, makeFolder } from '../test/tool.ts';

const data = process.env['LAMBENT_DATA'] ?? join(import.meta.dirname, '../../../shared/data'),
  scene = process.env['SCENE'] ?? join(data, 'meshes/room.glb'),
  steps = 12;

it.skipIf(!haveTool)('a lamp that moves', async () => {
  const folder = makeFolder(),
    isBaked = readFileSync(scene).includes('LAMBENT_transfer'),
    file = isBaked ? scene : join(folder, 'room.glb');
  if (!isBaked) lambent('bake', scene, '--transfer', 'indirect', '-o', file);
  Object.assign(globalThis, { self: globalThis });
  const glb = Uint8Array.from(readFileSync(file)),
    loading = performance.now();
  const gltf = await new GLTFLoader()
    .register((parser) => new LambentTransferPlugin(parser))
    .parseAsync(glb.buffer, '');
  const controls = bakedScene(gltf)!.transfer.indirect!;
  const load = performance.now() - loading;
  const place = (k: number): string => `${0.5 + 0.02 * k},3.5,0.7`,
    lamp = (k: number): void => void (controls.movingLamps = [parseLamp(`point@${place(k)}=100`)]);
  lamp(0);
  const first = performance.now();
  controls.settle();
  const appearing = performance.now() - first;
  // One frame of a hand: light at each leaf's middle, one bounce and more; then all that there is to do.
  const least = { rays: Infinity, bounces: Infinity, count: 0, reading: Infinity, settling: Infinity };
  for (let k = 1; k <= steps; ++k) {
    lamp(k);
    controls.update(1e9);
    const { rays, bounces, count, reading } = controls.times;
    if (rays < least.rays) least.rays = rays;
    if (bounces < least.bounces) Object.assign(least, { bounces, count });
    if (reading < least.reading) least.reading = reading;
    lamp(k + 0.5);
    const begin = performance.now();
    controls.settle();
    least.settling = Math.min(least.settling, performance.now() - begin);
  }
  const frames = lambentJson(
    'render',
    file,
    ...['--threads', '1', '--lamp', `point@${place(0)}=100`, '--move', `1@0:${place(0)};1:${place(1)}`],
    ...['--frames', '0:1:0.2', '--size', '16x12', '--spp', '1', '-o', join(folder, 'frames.exr')],
  ) as Record<string, number>;
  const short = (x: number): number => Number(x.toPrecision(3));
  console.log(
    JSON.stringify({
      leaves: controls.leaves,
      entries: controls.entries,
      load_ms: short(load),
      appearing_ms: short(appearing),
      hand: {
        rays_ms: short(least.rays),
        bounces_ms: short(least.bounces),
        bounces: least.count,
        reading_ms: short(least.reading),
      },
      settled_ms: short(least.settling),
      render_one_thread: {
        rays_ms: short(1e3 * frames['shadow_ray_seconds']!),
        bounces_ms: short(1e3 * frames['solve_seconds']!),
        bounces: frames['bounces'],
        reading_ms: short(1e3 * frames['read_seconds']!),
      },
    }),
  );
  expect(controls.times.count).toBeGreaterThan(0);
});
