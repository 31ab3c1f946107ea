// Scenes that the tests bake, made to show what each of them looks for.
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { crc32, deflateSync } from 'node:zlib';
import { random } from '../test/tool.ts';

/**
 * A lopsided scene: a floor, a corner of two walls, a ball, and a sail with two sides, in colours that bleed. Fine
 * enough that triangles are smaller than most pixels would need.
 */
export function writeScene(folder: string): string {
  const lines: string[] = ['mtllib scene.mtl'],
    faces: string[] = [];
  let vertices = 0;
  const quad = (material: string, corner: number[], a: number[], b: number[], n: number): void => {
    faces.push(`usemtl ${material}`);
    for (let j = 0; j <= n; ++j)
      for (let i = 0; i <= n; ++i)
        lines.push('v ' + [0, 1, 2].map((k) => corner[k]! + (a[k]! * i) / n + (b[k]! * j) / n).join(' '));
    const at = (i: number, j: number): number => vertices + j * (n + 1) + i + 1;
    for (let j = 0; j < n; ++j)
      for (let i = 0; i < n; ++i) faces.push(`f ${at(i, j)} ${at(i + 1, j)} ${at(i + 1, j + 1)} ${at(i, j + 1)}`);
    vertices += (n + 1) ** 2;
  };
  quad('grey', [-2, 0, 2], [4, 0, 0], [0, 0, -4], 32);
  quad('red', [-2, 0, 2], [0, 0, -4], [0, 2.4, 0], 24);
  quad('green', [-2, 0, -2], [4, 0, 0], [0, 2.4, 0], 24);
  quad('white', [0.9, 0.1, 0.2], [0.7, 0.3, -0.6], [-0.1, 1.6, 0.1], 14);
  const rows = 24,
    turns = 48,
    centre = [-0.4, 0.75, 0.3],
    radius = 0.7,
    jitter = random(2);
  faces.push('usemtl blue');
  for (let j = 0; j <= rows; ++j)
    for (let i = 0; i < turns; ++i) {
      const t = (Math.PI * j) / rows,
        p = (2 * Math.PI * (i + 0.2 * jitter())) / turns;
      const ray = [Math.sin(t) * Math.cos(p), Math.cos(t), Math.sin(t) * Math.sin(p)];
      lines.push('v ' + ray.map((v, k) => centre[k]! + radius * v).join(' '));
    }
  const ball = (i: number, j: number): number => vertices + j * turns + (i % turns) + 1;
  for (let j = 0; j < rows; ++j)
    for (let i = 0; i < turns; ++i) {
      if (j < rows - 1) faces.push(`f ${ball(i, j)} ${ball(i + 1, j + 1)} ${ball(i, j + 1)}`);
      if (j > 0) faces.push(`f ${ball(i, j)} ${ball(i + 1, j)} ${ball(i + 1, j + 1)}`);
    }
  const colours: Record<string, string> = {
    grey: '0.6 0.58 0.55',
    red: '0.7 0.2 0.12',
    green: '0.25 0.6 0.2',
    white: '0.85 0.85 0.8',
    blue: '0.3 0.4 0.75',
  };
  writeFileSync(
    join(folder, 'scene.mtl'),
    Object.entries(colours)
      .map(([name, kd]) => `newmtl ${name}\nKd ${kd}\n`)
      .join(''),
  );
  const path = join(folder, 'scene.obj');
  writeFileSync(path, [...lines, ...faces].join('\n') + '\n');
  return path;
}

/** A room that sees the sky through a door towards +X alone, and a block in it. */
export function writeRoom(folder: string): string {
  const lines: string[] = [];
  let vertices = 0;
  const quad = (corner: number[], a: number[], b: number[]): void => {
    const [across, up] = [a, b].map((v) => Math.ceil(12 * Math.hypot(...v))) as [number, number];
    for (let j = 0; j <= up; ++j)
      for (let i = 0; i <= across; ++i)
        lines.push('v ' + [0, 1, 2].map((k) => corner[k]! + (a[k]! * i) / across + (b[k]! * j) / up).join(' '));
    const at = (i: number, j: number): number => vertices + j * (across + 1) + i + 1;
    for (let j = 0; j < up; ++j)
      for (let i = 0; i < across; ++i) lines.push(`f ${at(i, j)} ${at(i + 1, j)} ${at(i + 1, j + 1)} ${at(i, j + 1)}`);
    vertices += (across + 1) * (up + 1);
  };
  quad([-2, 0, 2], [4, 0, 0], [0, 0, -4]); // floor
  quad([-2, 2.4, -2], [4, 0, 0], [0, 0, 4]);
  quad([-2, 0, -2], [4, 0, 0], [0, 2.4, 0]);
  quad([2, 0, 2], [-4, 0, 0], [0, 2.4, 0]);
  quad([-2, 0, 2], [0, 0, -4], [0, 2.4, 0]);
  quad([2, 0, -2], [0, 0, 1.3], [0, 2.4, 0]); // left and right of the door
  quad([2, 0, 0.7], [0, 0, 1.3], [0, 2.4, 0]);
  quad([-0.4, 0, -0.2], [0.6, 0, 0], [0, 0.8, 0]);
  quad([-0.4, 0, -0.8], [0, 0, 0.6], [0, 0.8, 0]);
  quad([-0.4, 0.8, -0.2], [0.6, 0, 0], [0, 0, -0.6]);
  const path = join(folder, 'room.obj');
  writeFileSync(path, lines.join('\n') + '\n');
  return path;
}

/** A unit ball alone. */
export function writeBall(path: string): void {
  const rows = 40,
    turns = 80,
    lines: string[] = [];
  for (let j = 0; j <= rows; ++j)
    for (let i = 0; i < turns; ++i) {
      const t = (Math.PI * j) / rows,
        p = (2 * Math.PI * i) / turns;
      lines.push(`v ${Math.sin(t) * Math.cos(p)} ${Math.cos(t)} ${Math.sin(t) * Math.sin(p)}`);
    }
  const at = (i: number, j: number): number => j * turns + (i % turns) + 1;
  for (let j = 0; j < rows; ++j)
    for (let i = 0; i < turns; ++i) {
      if (j < rows - 1) lines.push(`f ${at(i, j)} ${at(i + 1, j + 1)} ${at(i, j + 1)}`);
      if (j > 0) lines.push(`f ${at(i, j)} ${at(i + 1, j)} ${at(i + 1, j + 1)}`);
    }
  writeFileSync(path, lines.join('\n') + '\n');
}

/**
 * A skinned glTF: a sheet with ridges, 2 long and 1 wide, whose far half a bone turns over a second by 80 degrees about
 * a skew axis (animation "bend"). `blend`: over how much of its length the skin goes from one bone to the other.
 * Normals are those of the ridges.
 */
export function writeSkin(path: string, blend: number): void {
  const columns = 96,
    rows = 40,
    positions: number[] = [],
    normals: number[] = [],
    joints: number[] = [],
    weights: number[] = [],
    indices: number[] = [];
  for (let j = 0; j <= rows; ++j)
    for (let i = 0; i <= columns; ++i) {
      const x = (2 * i) / columns - 1,
        z = j / rows - 0.5,
        kx = 17,
        kz = 9,
        a = 0.07;
      positions.push(x, a * Math.sin(kx * x) * Math.cos(kz * z + 0.7), z);
      const n = [
          -a * kx * Math.cos(kx * x) * Math.cos(kz * z + 0.7),
          1,
          a * kz * Math.sin(kx * x) * Math.sin(kz * z + 0.7),
        ],
        size = Math.hypot(...n);
      normals.push(...n.map((v) => v / size));
      const t = Math.min(1, Math.max(0, x / blend + 0.5)),
        w = t * t * (3 - 2 * t);
      joints.push(0, 1, 0, 0);
      weights.push(1 - w, w, 0, 0);
    }
  const at = (i: number, j: number): number => j * (columns + 1) + i;
  for (let j = 0; j < rows; ++j)
    for (let i = 0; i < columns; ++i)
      indices.push(at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
  const axis = [0.36, 0.48, 0.8],
    half = (40 * Math.PI) / 180,
    turn = [...axis.map((v) => v * Math.sin(half)), Math.cos(half)];
  const identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
  const pieces: Buffer[] = [],
    bufferViews: object[] = [],
    accessors: object[] = [];
  let length = 0;
  const add = (
    values: Float32Array | Uint32Array | Uint8Array,
    type: string,
    size: number,
    more: object = {},
  ): number => {
    const bytes = Buffer.from(values.buffer, values.byteOffset, values.byteLength);
    bufferViews.push({ buffer: 0, byteOffset: length, byteLength: bytes.length });
    pieces.push(bytes);
    length += bytes.length;
    const componentType = values instanceof Float32Array ? 5126 : values instanceof Uint32Array ? 5125 : 5121;
    return (
      accessors.push({
        bufferView: bufferViews.length - 1,
        componentType,
        count: values.length / size,
        type,
        ...more,
      }) - 1
    );
  };
  const count = positions.length / 3,
    of = (c: number): number[] => Array.from({ length: count }, (_, k) => positions[3 * k + c]!);
  const bounds = {
    min: [0, 1, 2].map((c) => Math.fround(Math.min(...of(c)))),
    max: [0, 1, 2].map((c) => Math.fround(Math.max(...of(c)))),
  };
  const attributes = {
    POSITION: add(new Float32Array(positions), 'VEC3', 3, bounds),
    NORMAL: add(new Float32Array(normals), 'VEC3', 3),
    JOINTS_0: add(new Uint8Array(joints), 'VEC4', 4),
    WEIGHTS_0: add(new Float32Array(weights), 'VEC4', 4),
  };
  const index = add(new Uint32Array(indices), 'SCALAR', 1),
    inverse = add(new Float32Array([...identity, ...identity]), 'MAT4', 16);
  const times = add(new Float32Array([0, 1]), 'SCALAR', 1, { min: [0], max: [1] }),
    turns = add(new Float32Array([0, 0, 0, 1, ...turn]), 'VEC4', 4);
  const json = JSON.stringify({
    asset: { version: '2.0' },
    scene: 0,
    scenes: [{ nodes: [0, 1] }],
    nodes: [{ name: 'sheet', mesh: 0, skin: 0 }, { name: 'root', children: [2] }, { name: 'tip' }],
    meshes: [{ primitives: [{ attributes, indices: index, material: 0 }] }],
    materials: [
      { pbrMetallicRoughness: { baseColorFactor: [0.7, 0.6, 0.45, 1], metallicFactor: 0 }, doubleSided: true },
    ],
    skins: [{ joints: [1, 2], inverseBindMatrices: inverse }],
    animations: [
      {
        name: 'bend',
        samplers: [{ input: times, output: turns }],
        channels: [{ sampler: 0, target: { node: 2, path: 'rotation' } }],
      },
    ],
    buffers: [{ byteLength: length }],
    bufferViews,
    accessors,
  });
  const text = Buffer.from(json.padEnd(Math.ceil(json.length / 4) * 4)),
    head = Buffer.alloc(20),
    bin = Buffer.alloc(8);
  [0x46546c67, 2, 28 + text.length + length, text.length, 0x4e4f534a].forEach((v, k) => head.writeUInt32LE(v, 4 * k));
  bin.writeUInt32LE(length, 0);
  bin.writeUInt32LE(0x004e4942, 4);
  writeFileSync(path, Buffer.concat([head, text, bin, ...pieces]));
}

/** A PNG of 8-bit RGB. */
export function png(width: number, height: number, texel: (x: number, y: number) => number[]): Buffer {
  const rows = Buffer.alloc(height * (1 + 3 * width));
  for (let y = 0; y < height; ++y)
    for (let x = 0; x < width; ++x)
      rows.set(
        texel(x, y).map((v) => Math.round(255 * v)),
        y * (1 + 3 * width) + 1 + 3 * x,
      );
  const chunk = (type: string, data: Buffer): Buffer => {
    const body = Buffer.concat([Buffer.from(type), data]),
      out = Buffer.alloc(8 + body.length);
    out.writeUInt32BE(data.length, 0);
    body.copy(out, 4);
    out.writeUInt32BE(crc32(body), 4 + body.length);
    return out;
  };
  const header = Buffer.alloc(13);
  header.writeUInt32BE(width, 0);
  header.writeUInt32BE(height, 4);
  header.set([8, 2, 0, 0, 0], 8);
  return Buffer.concat([
    Buffer.from([137, 80, 78, 71, 13, 10, 26, 10]),
    chunk('IHDR', header),
    chunk('IDAT', deflateSync(rows)),
    chunk('IEND', Buffer.alloc(0)),
  ]);
}

/**
 * A floor and two walls with bumps in their normal texture, one of the walls mirrored, and a sign between them that
 * glows by a texture.
 */
export function writeBumpy(path: string): void {
  const positions: number[] = [],
    normals: number[] = [],
    places: number[] = [],
    walls: number[] = [],
    sign: number[] = [];
  const quad = (indices: number[], corner: number[], a: number[], b: number[], mirrored: boolean): void => {
    const n = 12,
      first = positions.length / 3,
      cross = [0, 1, 2].map((k) => a[(k + 1) % 3]! * b[(k + 2) % 3]! - a[(k + 2) % 3]! * b[(k + 1) % 3]!),
      size = Math.hypot(...cross);
    for (let j = 0; j <= n; ++j)
      for (let i = 0; i <= n; ++i) {
        positions.push(...[0, 1, 2].map((k) => corner[k]! + (a[k]! * i) / n + (b[k]! * j) / n));
        normals.push(...cross.map((v) => v / size));
        places.push(mirrored ? 1 - i / n : i / n, 1 - j / n);
      }
    for (let j = 0; j < n; ++j)
      for (let i = 0; i < n; ++i) {
        const at = first + j * (n + 1) + i;
        indices.push(at, at + 1, at + n + 2, at, at + n + 2, at + n + 1);
      }
  };
  quad(walls, [-1, 0, 1], [2, 0, 0], [0, 0, -2], false);
  quad(walls, [-1, 0, -1], [2, 0, 0], [0, 1.5, 0], true);
  quad(walls, [-1, 0, 1], [0, 0, -2], [0, 1.5, 0], false);
  quad(sign, [0.1, 0.1, -0.3], [0.7, 0, 0.2], [0, 0.6, 0], false);
  const bump = (x: number, y: number): number[] => {
    const w = 2 * Math.PI * 3,
      u = (x + 0.5) / 128,
      v = (y + 0.5) / 128,
      n = [-0.5 * Math.cos(w * u) * Math.sin(w * v), 0.5 * Math.sin(w * u) * Math.cos(w * v), 1],
      size = Math.hypot(...n);
    return n.map((k) => (k / size + 1) / 2);
  };
  const glow = (x: number, y: number): number[] => (((x >> 4) + (y >> 4)) % 2 ? [0.9, 0.7, 0.2] : [0.1, 0.2, 0.6]);
  const pieces: Buffer[] = [],
    bufferViews: object[] = [],
    accessors: object[] = [];
  let length = 0;
  const add = (values: Float32Array | Uint32Array, type: string, size: number, more: object = {}): number => {
    const bytes = Buffer.from(values.buffer, values.byteOffset, values.byteLength);
    bufferViews.push({ buffer: 0, byteOffset: length, byteLength: bytes.length });
    pieces.push(bytes);
    length += bytes.length;
    return (
      accessors.push({
        bufferView: bufferViews.length - 1,
        componentType: values instanceof Float32Array ? 5126 : 5125,
        count: values.length / size,
        type,
        ...more,
      }) - 1
    );
  };
  const attributes = {
    POSITION: add(new Float32Array(positions), 'VEC3', 3, { min: [-1, 0, -1], max: [1, 1.5, 1] }),
    NORMAL: add(new Float32Array(normals), 'VEC3', 3),
    TEXCOORD_0: add(new Float32Array(places), 'VEC2', 2),
  };
  const uri = (type: string, bytes: Buffer): string => `data:${type};base64,${bytes.toString('base64')}`;
  const primitives = [walls, sign].map((indices, material) => ({
    attributes,
    indices: add(new Uint32Array(indices), 'SCALAR', 1),
    material,
  }));
  writeFileSync(
    path,
    JSON.stringify({
      asset: { version: '2.0' },
      scene: 0,
      scenes: [{ nodes: [0] }],
      nodes: [{ mesh: 0 }],
      meshes: [{ primitives }],
      materials: [
        {
          name: 'bumps',
          pbrMetallicRoughness: { baseColorFactor: [0.7, 0.65, 0.6, 1], metallicFactor: 0 },
          normalTexture: { index: 0, scale: 0.8 },
        },
        {
          name: 'sign',
          doubleSided: true,
          pbrMetallicRoughness: { baseColorFactor: [0.3, 0.3, 0.3, 1], metallicFactor: 0 },
          emissiveFactor: [1, 1, 1],
          emissiveTexture: { index: 1 },
        },
      ],
      textures: [
        { source: 0, sampler: 0 },
        { source: 1, sampler: 0 },
      ],
      samplers: [{ magFilter: 9729, minFilter: 9729 }],
      images: [{ uri: uri('image/png', png(128, 128, bump)) }, { uri: uri('image/png', png(64, 64, glow)) }],
      buffers: [{ byteLength: length, uri: uri('application/octet-stream', Buffer.concat(pieces)) }],
      bufferViews,
      accessors,
    }),
  );
}

/**
 * A floor, a wall and panes: half there, stained, and half reflecting; one mesh and material each, as a .gltf of one
 * file.
 */
export function writeGlass(path: string): void {
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
