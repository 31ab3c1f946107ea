// A bake through glTF Transform's functions with our extension: the same bytes, the same receivers at the same places,
// the same picture; and what cannot be kept is refused.
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { Document, Logger, NodeIO, type Primitive, type Transform } from '@gltf-transform/core';
import { ALL_EXTENSIONS, EXTMeshoptCompression, KHRDracoMeshCompression } from '@gltf-transform/extensions';
import {
  copyToDocument,
  dedup,
  dequantize,
  flatten,
  join as joinMeshes,
  mergeDocuments,
  meshopt,
  prune,
  quantize,
  reorder,
  simplify,
  unpartition,
  weld,
} from '@gltf-transform/functions';
import { MeshoptDecoder, MeshoptEncoder, MeshoptSimplifier } from 'meshoptimizer';
import { beforeAll, describe, expect, it, vi } from 'vitest';
import { LambentTransfer, sideSemantics } from '../src/gltf_transform/index.ts';
import { plainKeys, replaceViews, viewKeys } from '../src/extension_views.ts';
import { haveTool, lambent, lambentJson, makeFolder, renderLinear } from './tool.ts';

interface Extension {
  parts: { node: number; primitive: number; front: number; back?: number }[];
  [key: string]: unknown;
}
interface Json {
  extensions?: { LAMBENT_transfer?: Extension };
  bufferViews: { byteOffset?: number; byteLength: number }[];
}

/** The extension of a file, with the bytes of each view in place of its number. */
function contents(path: string): { transfer: unknown; parts: Map<string, string> } {
  const file = readFileSync(path),
    length = file.readUInt32LE(12),
    json = JSON.parse(file.subarray(20, 20 + length).toString()) as Json,
    extension = json.extensions!.LAMBENT_transfer!;
  const bytes = (view: number): string => {
    const { byteOffset = 0, byteLength } = json.bufferViews[view]!;
    return file.subarray(28 + length + byteOffset, 28 + length + byteOffset + byteLength).toString('base64');
  };
  const found: string[] = [],
    transfer = replaceViews(extension, (view) => found.push(bytes(view)) - 1);
  const parts = extension.parts.map((p): [string, string] => [
    `${p.node} ${p.primitive}`,
    [p.front, p.back].map((view) => (view === undefined ? '' : bytes(view))).join(' '),
  ]);
  return { transfer: [JSON.parse(JSON.stringify(transfer)), found], parts: new Map(parts) };
}

/** Where each vertex that triangles use stands, with its receivers; sorted. */
function vertices(document: Document): string[] {
  const out = new Set<string>();
  for (const node of document.getRoot().listNodes())
    for (const primitive of node.getMesh()?.listPrimitives() ?? []) {
      const position = primitive.getAttribute('POSITION')!,
        m = node.getWorldMatrix(),
        sides = Object.values(sideSemantics).map((name) => primitive.getAttribute(name));
      for (const v of primitive.getIndices()!.getArray() as ArrayLike<number> as number[]) {
        const p = position.getElement(v, []),
          at = [0, 1, 2].map((k) => m[k]! * p[0]! + m[4 + k]! * p[1]! + m[8 + k]! * p[2]! + m[12 + k]!);
        out.add(
          `${at.map((x) => (Math.round(x * 1e4) / 1e4 + 0).toFixed(4)).join(' ')}: ` +
            sides.map((side) => (side ? side.getElement(v, []).join(' ') : '-')).join(', '),
        );
      }
    }
  return [...out].sort();
}

describe('the views of the extension', () => {
  it('are those of the schema, and so are the numbers that are none', () => {
    const schema: unknown = JSON.parse(
      readFileSync(new URL('../../docs/schema/LAMBENT_transfer.schema.json', import.meta.url), 'utf8'),
    );
    const views = new Set<string>(),
      numbers = new Set<string>();
    const visit = (value: unknown): void => {
      if (typeof value !== 'object' || value === null) return;
      const { properties } = value as { properties?: Record<string, Record<string, unknown>> };
      for (const [name, p] of Object.entries(properties ?? {})) {
        const isNumber = p['type'] === 'integer' || p['type'] === 'number' || typeof p['const'] === 'number',
          isChoice = Array.isArray(p['enum']) && p['enum'].every((e) => typeof e === 'number');
        if (name === 'bufferView' || /^(Of [a-z ]+(, optional)?: )?buffer view of/i.test(String(p['description'])))
          views.add(name);
        else if (isNumber || isChoice) numbers.add(name);
      }
      Object.values(value).forEach(visit);
    };
    visit(schema);
    expect([...views].sort()).toEqual([...viewKeys, 'front'].sort());
    const others = [
      'node',
      'primitive',
      'back' /* as front */,
      'input',
      'inputVertices' /* not carried */,
      'bufferViews',
      'byteLength' /* of the document */,
    ];
    for (const name of numbers) expect([...plainKeys, ...others]).toContain(name);
  });

  it('are refused where they may have a new name', () => {
    expect(() => replaceViews({ version: 1, transfer: { novelty: 7 } }, (v) => v)).toThrow(/"novelty".*newer/);
    expect(replaceViews({ version: 1, terms: [{ bufferView: 3 }], provenance: { n: 4 }, parts: [] }, () => 9)).toEqual({
      version: 1,
      terms: [{ bufferView: 9 }],
      provenance: { n: 4 },
      parts: undefined,
    });
  });
});

describe.skipIf(!haveTool)('a bake in glTF Transform', () => {
  const folder = makeFolder(),
    at = (name: string): string => join(folder, name),
    silent = new Logger(Logger.Verbosity.SILENT);
  const io = new NodeIO()
    .setLogger(silent)
    .registerExtensions([...ALL_EXTENSIONS, LambentTransfer])
    .registerDependencies({ 'meshopt.encoder': MeshoptEncoder, 'meshopt.decoder': MeshoptDecoder });

  /** Boxes of one mesh at two places, a floor with texture coordinates, and a sheet with two sides. */
  async function writeInput(path: string): Promise<void> {
    const document = new Document().setLogger(silent),
      buffer = document.createBuffer(),
      scene = document.createScene();
    const grid = (material: string, corner: number[], a: number[], b: number[], n: number, sides = 1): Primitive => {
      const positions: number[] = [],
        normals: number[] = [],
        places: number[] = [],
        indices: number[] = [],
        cross = [0, 1, 2].map((k) => a[(k + 1) % 3]! * b[(k + 2) % 3]! - a[(k + 2) % 3]! * b[(k + 1) % 3]!),
        size = Math.hypot(...cross);
      for (let j = 0; j <= n; ++j)
        for (let i = 0; i <= n; ++i) {
          positions.push(...[0, 1, 2].map((k) => corner[k]! + (a[k]! * i) / n + (b[k]! * j) / n));
          normals.push(...cross.map((v) => v / size));
          places.push(i / n, j / n);
        }
      for (let j = 0; j < n; ++j)
        for (let i = 0; i < n; ++i) {
          const v = j * (n + 1) + i;
          indices.push(v, v + 1, v + n + 2, v, v + n + 2, v + n + 1);
        }
      const known = document
        .getRoot()
        .listMaterials()
        .find((m) => m.getName() === material);
      const colour = [...material].map((c) => ((c.charCodeAt(0) * 37) % 60) / 100 + 0.3);
      const accessor = (type: 'VEC2' | 'VEC3', values: number[]) =>
        document.createAccessor('', buffer).setType(type).setArray(new Float32Array(values));
      return document
        .createPrimitive()
        .setMaterial(
          known ??
            document
              .createMaterial(material)
              .setBaseColorFactor([colour[0]!, colour[1]!, colour[2]!, 1])
              .setMetallicFactor(0)
              .setDoubleSided(sides === 2),
        )
        .setAttribute('POSITION', accessor('VEC3', positions))
        .setAttribute('NORMAL', accessor('VEC3', normals))
        .setAttribute('TEXCOORD_0', accessor('VEC2', places))
        .setIndices(document.createAccessor('', buffer).setArray(new Uint16Array(indices)));
    };
    const box = document.createMesh('box');
    for (const [corner, a, b] of [
      [
        [0, 1, 0],
        [0, 0, 1],
        [1, 0, 0],
      ],
      [
        [0, 0, 1],
        [1, 0, 0],
        [0, 1, 0],
      ],
      [
        [1, 0, 1],
        [0, 0, -1],
        [0, 1, 0],
      ],
      [
        [1, 0, 0],
        [-1, 0, 0],
        [0, 1, 0],
      ],
      [
        [0, 0, 0],
        [0, 0, 1],
        [0, 1, 0],
      ],
    ] as [number[], number[], number[]][])
      box.addPrimitive(grid('box', corner, a, b, 4));
    scene.addChild(document.createNode('left').setMesh(box).setTranslation([-1.3, 0, -0.4]));
    scene.addChild(document.createNode('right').setMesh(box).setTranslation([0.4, 0, 0.1]).setScale([0.7, 1.4, 0.7]));
    const floor = document.createMesh('floor').addPrimitive(grid('floor', [-2, 0, 2], [4, 0, 0], [0, 0, -4], 16));
    scene.addChild(document.createNode('floor').setMesh(floor));
    const sheet = grid('sheet', [-0.2, 0.2, 0.8], [0.5, 0.2, -0.3], [0, 1.1, 0.2], 6, 2);
    scene.addChild(document.createNode('sheet').setMesh(document.createMesh('sheet').addPrimitive(sheet)));
    await new NodeIO().write(path, document);
  }

  const bakes: Record<string, string[]> = {
    diffuse: ['--samples', '64', '--terms', '--order', '4', '--bounces', '1'],
    single: ['--samples', '64', '--order', '2', '--precision', 'single', '--bounces', '0'],
    zonal: ['--samples', '64', '--transfer', 'zonal', '--lobes', '2', '--order', '4'],
    matrix: ['--samples', '64', '--transfer', 'matrix', '--incident-order', '3', '--view-map', '8', '--bounces', '1'],
    factors: ['--samples', '64', '--transfer', 'matrix', '--factors', '--incident-order', '3', '--view-map', '8'],
    blocks: ['--transfer', 'blocks', '--cube', '16'],
    clusters: ['--samples', '64', '--order', '3', '--compress', 'cpca:4,2'],
    patches: ['--samples', '64', '--receivers', 'patches', '--order', '3'],
    lightmap: ['--samples', '64', '--transfer', 'lightmap', '--sky', 'sky:elevation=30', '--texels-per-unit', '6'],
    view: ['--samples', '64', '--fix-view', '2,2,4,0,0.5,0,40', '--order', '2'],
  };
  const env = ['--env', 'sky:elevation=25,azimuth=110'];
  const picture = (name: string): string => {
    const kind = /^[a-z]*/.exec(name)![0],
      light = kind === 'lightmap' ? [] : env,
      camera = kind === 'view' ? [] : ['--camera', '2.4,2.2,3.6,0,0.5,0,40', '--size', '160x120'];
    renderLinear(at(`${name}.glb`), ...light, ...camera, '-o', at(`${name}.exr`));
    return at(`${name}.exr`);
  };
  /** rmse of linear radiance against the bake's own picture. */
  const difference = (name: string, from: string): number =>
    (lambentJson('compare', picture(name), picture(from)) as { rmse: number }).rmse;
  const through = async (from: string, to: string, ...transforms: Transform[]): Promise<Document> => {
    const document = await io.read(at(`${from}.glb`));
    await document.transform(...transforms);
    await io.write(at(`${to}.glb`), document);
    return document;
  };

  beforeAll(async () => {
    await Promise.all([MeshoptEncoder.ready, MeshoptDecoder.ready, MeshoptSimplifier.ready]);
    await writeInput(at('input.glb'));
    for (const [name, options] of Object.entries(bakes))
      lambent('bake', at('input.glb'), ...options, '-o', at(`${name}.glb`));
  });

  for (const name of Object.keys(bakes))
    it(`${name}: read and written, bit for bit`, async () => {
      await through(name, `${name}_copy`);
      const before = contents(at(`${name}.glb`)),
        after = contents(at(`${name}_copy.glb`));
      expect(after.transfer).toEqual(before.transfer);
      expect(after.parts).toEqual(before.parts);
      expect(readFileSync(picture(`${name}_copy`)).equals(readFileSync(picture(name)))).toBe(true);
    });

  const pipelines: Record<string, { transforms: () => Transform[]; rmse: number }> = {
    'dedup and prune': { transforms: () => [dedup(), prune()], rmse: 0 },
    weld: { transforms: () => [weld()], rmse: 1e-6 },
    reorder: { transforms: () => [reorder({ encoder: MeshoptEncoder })], rmse: 1e-6 },
    'flatten and join': { transforms: () => [flatten(), joinMeshes()], rmse: 1e-5 },
    quantize: { transforms: () => [quantize()], rmse: 2e-3 },
  };
  for (const [name, { transforms, rmse }] of Object.entries(pipelines))
    for (const kind of ['diffuse', 'matrix'])
      it(`${kind} through ${name}: the same values, receivers and picture`, async () => {
        const before = await io.read(at(`${kind}.glb`)),
          file = `${kind}_${name.replaceAll(' ', '_')}`;
        await through(kind, file, ...transforms());
        expect(contents(at(`${file}.glb`)).transfer).toEqual(contents(at(`${kind}.glb`)).transfer);
        if (name !== 'quantize') expect(vertices(await io.read(at(`${file}.glb`)))).toEqual(vertices(before));
        expect(difference(file, kind)).toBeLessThanOrEqual(rmse);
      });

  it('through all of meshopt: the same values, and the picture of its quantized vertices', async () => {
    await through('diffuse', 'packed', dedup(), weld(), meshopt({ encoder: MeshoptEncoder, level: 'medium' }));
    expect(contents(at('packed.glb')).transfer).toEqual(contents(at('diffuse.glb')).transfer);
    const unpacked = await io.read(at('packed.glb'));
    unpacked
      .getRoot()
      .listExtensionsUsed()
      .find((extension) => extension instanceof EXTMeshoptCompression)!
      .dispose();
    await io.write(at('diffuse_unpacked.glb'), unpacked);
    expect(contents(at('diffuse_unpacked.glb')).transfer).toEqual(contents(at('diffuse.glb')).transfer);
    expect(difference('diffuse_unpacked', 'diffuse')).toBeLessThan(2e-3);
  });

  it('simplified: fewer vertices, each with the receivers that it had', async () => {
    const before = new Set(vertices(await io.read(at('diffuse.glb'))));
    const warn = vi.spyOn(silent, 'warn').mockClear();
    await through('diffuse', 'simple', weld(), simplify({ simplifier: MeshoptSimplifier, ratio: 0.5, error: 1 }));
    expect(warn).toHaveBeenCalledWith(expect.stringMatching(/\d+ of \d+ receivers have no vertex any more/));
    const after = vertices(await io.read(at('simple.glb')));
    expect(after.length).toBeLessThan(0.8 * before.size);
    for (const vertex of after) expect(before).toContain(vertex);
    renderLinear(at('simple.glb'), ...env, '--camera', 'auto', '-o', at('simple.png'));
  });

  it('written twice, and after a write that failed', async () => {
    const document = await io.read(at('diffuse.glb'));
    const draco = document.createExtension(KHRDracoMeshCompression);
    await expect(io.writeBinary(document)).rejects.toThrow(/Draco/);
    draco.dispose();
    const [first, second] = [await io.writeBinary(document), await io.writeBinary(document)];
    expect(Buffer.from(second).equals(first)).toBe(true);
    writeFileSync(at('twice.glb'), second);
    expect(contents(at('twice.glb'))).toEqual(contents(at('diffuse.glb')));
  });

  it('a lightmap through dedup, weld, reorder and quantize without unused attributes going', async () => {
    await through(
      'lightmap',
      'lightmap_small',
      dedup(),
      prune({ keepAttributes: true, keepSolidTextures: true }),
      weld(),
      reorder({ encoder: MeshoptEncoder }),
    );
    expect(contents(at('lightmap_small.glb')).transfer).toEqual(contents(at('lightmap.glb')).transfer);
    expect(difference('lightmap_small', 'lightmap')).toBeLessThan(1e-6);
  });

  const refused: [string, string, (document: Document) => unknown, RegExp][] = [
    ['Draco', 'diffuse', (d) => d.createExtension(KHRDracoMeshCompression), /Draco.*meshopt/],
    ['dequantize of all', 'diffuse', (d) => d.transform(dequantize({ pattern: /.*/ })), /dequantize.*_LAMBENT_FRONT/],
    ['a lightmap whose texture coordinates went', 'lightmap', (d) => d.transform(prune()), /TEXCOORD.*keepAttributes/],
    ['a lightmap that was joined', 'lightmap', (d) => d.transform(flatten(), joinMeshes()), /own material.*join/],
    ['other triangles', 'patches', (d) => d.transform(reorder({ encoder: MeshoptEncoder })), /triangles.*bake again/],
    [
      'a mesh without receivers',
      'diffuse',
      (d) => {
        const [mesh] = d.getRoot().listMeshes(),
          [primitive] = mesh!.listPrimitives();
        primitive!.setAttribute(sideSemantics.front, null).setAttribute(sideSemantics.back, null);
      },
      /lost its receivers/,
    ],
    [
      'receivers of fewer vertices',
      'diffuse',
      (d) => {
        const side = d.getRoot().listMeshes()[0]!.listPrimitives()[0]!.getAttribute(sideSemantics.front)!;
        side.setArray((side.getArray() as Uint32Array<ArrayBuffer>).slice(3));
      },
      /vertices and \d+ receivers/,
    ],
    [
      'two bakes in one',
      'diffuse',
      async (d) => (mergeDocuments(d, await io.read(at('single.glb'))), d.transform(unpartition())),
      /another bake.*merged/,
    ],
  ];
  for (const [what, bake, change, message] of refused)
    it(`refuses ${what}`, async () => {
      const document = await io.read(at(`${bake}.glb`));
      await change(document);
      await expect(io.writeBinary(document)).rejects.toThrow(message);
    });

  it('refuses meshes whose bake stayed in another document', async () => {
    const source = await io.read(at('diffuse.glb')),
      target = new Document().setLogger(silent);
    target.createExtension(LambentTransfer);
    copyToDocument(target, source, source.getRoot().listScenes());
    await expect(io.writeBinary(target)).rejects.toThrow(/receivers of a bake that this document has not/);
  });

  it('says so of files that something else has rewritten', async () => {
    const plain = new NodeIO().setLogger(silent).registerExtensions(ALL_EXTENSIONS);
    await plain.write(at('dropped.glb'), await plain.read(at('diffuse.glb')));
    const dropped = await io.read(at('dropped.glb'));
    expect(dropped.getRoot().listExtensionsUsed()).toHaveLength(0);
    // gltf-pipeline keeps JSON that it does not know and drops the buffer views that only this names.
    const file = readFileSync(at('diffuse.glb')),
      length = file.readUInt32LE(12),
      json = JSON.parse(file.subarray(20, 20 + length).toString()) as Json;
    const { bufferViews } = json as unknown as { bufferViews: unknown[] };
    bufferViews.length = Math.min(...json.extensions!.LAMBENT_transfer!.parts.map((part) => part.front)) - 1;
    await expect(
      io.readJSON({ json: json as never, resources: { '@glb.bin': file.subarray(28 + length) } }),
    ).rejects.toThrow(/rewritten by a tool that does not know LAMBENT_transfer; bake again/);
  });
});
