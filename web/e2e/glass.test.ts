// Panes in front of a baked scene and of the sky: the page against `lambent render`.
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import type { Browser } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, it } from 'vitest';
import { haveTool, lambent, makeFolder, renderLinear, writeLopsidedHdr } from '../test/tool.ts';
import { haveBrowser, launch, open, psnr, serve, type Server } from './browser.ts';

const camera = '0.5,1.6,6,0,1,0,40';

/** Quads in n x n cells, one mesh and material each, as a .gltf of one file. */
function writeGlass(path: string): void {
  type V = [number, number, number];
  const quads: { corner: V; a: V; b: V; n: number; material: object }[] = [
    { corner: [-2, 0, 2], a: [4, 0, 0], b: [0, 0, -4], n: 20, material: { color: [0.7, 0.5, 0.3, 1] } },
    { corner: [-2, 0, -2], a: [2.2, 0, 0], b: [0, 2.2, 0], n: 16, material: { color: [0.3, 0.5, 0.8, 1] } },
    // Half there; stained, beside it and in front of it; stained and half reflecting.
    {
      corner: [-1.8, 0.1, 0.5],
      a: [1.6, 0, 0],
      b: [0, 1.5, 0],
      n: 16,
      material: { color: [0.8, 0.8, 0.7, 0.5], blend: true },
    },
    {
      corner: [-1, 0.2, 1.2],
      a: [1.6, 0, 0],
      b: [0, 1.2, 0],
      n: 16,
      material: { color: [0.9, 0.4, 0.3, 1], glass: 1 },
    },
    {
      corner: [0.8, 0.1, 0.9],
      a: [1.1, 0, -0.4],
      b: [0, 1.4, 0],
      n: 16,
      material: { color: [0.4, 0.8, 0.5, 1], glass: 0.6 },
    },
  ];
  const pieces: Buffer[] = [];
  let length = 0;
  const bufferViews: object[] = [],
    accessors: object[] = [],
    meshes: object[] = [],
    materials: object[] = [];
  const add = (array: Float32Array | Uint32Array, type: string, bounds: object = {}): number => {
    const bytes = Buffer.from(array.buffer);
    bufferViews.push({ buffer: 0, byteOffset: length, byteLength: bytes.length });
    const float = array instanceof Float32Array;
    accessors.push({
      bufferView: bufferViews.length - 1,
      componentType: float ? 5126 : 5125,
      count: array.length / (type === 'VEC3' ? 3 : 1),
      type,
      ...bounds,
    });
    pieces.push(bytes);
    length += bytes.length;
    return accessors.length - 1;
  };
  for (const { corner, a, b, n, material } of quads) {
    const points: number[] = [],
      indices: number[] = [];
    const at = (i: number, j: number): number => j * (n + 1) + i;
    for (let j = 0; j <= n; ++j)
      for (let i = 0; i <= n; ++i)
        for (let k = 0; k < 3; ++k) points.push(corner[k]! + (a[k]! * i) / n + (b[k]! * j) / n);
    for (let j = 0; j < n; ++j)
      for (let i = 0; i < n; ++i)
        indices.push(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1));
    const axis = (k: number): number[] => points.filter((_, i) => i % 3 === k);
    const bounds = {
      min: [0, 1, 2].map((k) => Math.fround(Math.min(...axis(k)))),
      max: [0, 1, 2].map((k) => Math.fround(Math.max(...axis(k)))),
    };
    const { color, blend, glass } = material as { color: number[]; blend?: boolean; glass?: number };
    materials.push({
      pbrMetallicRoughness: { baseColorFactor: color, metallicFactor: 0, roughnessFactor: 0 },
      doubleSided: true,
      ...(blend && { alphaMode: 'BLEND' }),
      ...(glass && { extensions: { KHR_materials_transmission: { transmissionFactor: glass } } }),
    });
    const primitive = {
      attributes: { POSITION: add(new Float32Array(points), 'VEC3', bounds) },
      indices: add(new Uint32Array(indices), 'SCALAR'),
      material: materials.length - 1,
    };
    meshes.push({ primitives: [primitive] });
  }
  const uri = `data:application/octet-stream;base64,${Buffer.concat(pieces).toString('base64')}`;
  const document = {
    asset: { version: '2.0' },
    extensionsUsed: ['KHR_materials_transmission'],
    scene: 0,
    scenes: [{ nodes: meshes.map((_, i) => i) }],
    nodes: meshes.map((_, mesh) => ({ mesh })),
    meshes,
    materials,
    accessors,
    bufferViews,
    buffers: [{ uri, byteLength: length }],
  };
  writeFileSync(path, JSON.stringify(document));
}

describe.skipIf(!haveTool || !haveBrowser)('glass', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name);
  let browser: Browser;

  beforeAll(async () => {
    writeLopsidedHdr(at('light.hdr'));
    writeGlass(at('glass.gltf'));
    browser = await launch();
  });
  afterAll(async () => {
    await browser?.close();
  });

  async function compare(name: string, ...args: string[]): Promise<number> {
    lambent('bake', at('glass.gltf'), ...args, '-o', at(`${name}.glb`));
    const server: Server = await serve(at(`${name}.glb`), '--env', at('light.hdr'));
    const page = await open(browser, server.address, `ui=off&camera=${camera}`, 480, 360);
    await page.screenshot({ path: at(`${name}_page.png`) });
    await page.close();
    expect(await server.stop()).toBe(0);
    const view = ['--camera', camera, '--size', '480x360', '--spp', '16'];
    renderLinear(at(`${name}.glb`), '--env', at('light.hdr'), ...view, '-o', at(`${name}_render.png`));
    const db = psnr(at(`${name}_page.png`), at(`${name}_render.png`));
    console.log(`${name}: ${db.toFixed(1)} dB (${folder})`);
    return db;
  }

  it('of diffuse transfer is that of render', async () => {
    expect(await compare('diffuse', '--samples', '512', '--bounces', '2')).toBeGreaterThan(40);
  });
  it('of a matrix is that of render', async () => {
    expect(
      await compare('matrix', '--samples', '64', '--bounces', '1', '--transfer', 'matrix', '--order', '4'),
    ).toBeGreaterThan(38);
  });
});
