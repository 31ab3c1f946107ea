// A square bar along +y on two joints, the upper of which bends by 100 degrees about a skew axis and back in two
// seconds, as glTF.
import { writeFileSync } from 'node:fs';

export function writeBendingBar(path: string): void {
  const rings = 40,
    half = 0.25,
    height = 2,
    middle = 1;
  const positions: number[] = [],
    normals: number[] = [],
    joints: number[] = [],
    weights: number[] = [],
    indices: number[] = [];
  for (let side = 0; side < 4; ++side) {
    const n = [Math.cos((side * Math.PI) / 2), Math.sin((side * Math.PI) / 2)],
      across = [-n[1]!, n[0]!],
      steps = 8;
    const first = positions.length / 3;
    for (let j = 0; j <= rings; ++j)
      for (let i = 0; i <= steps; ++i) {
        const t = half * ((2 * i) / steps - 1),
          y = (height * j) / rings,
          upper = Math.min(1, Math.max(0, (y - middle) / 0.6 + 0.5));
        positions.push(half * n[0]! + t * across[0]!, y, -(half * n[1]! + t * across[1]!));
        normals.push(n[0]!, 0, -n[1]!);
        joints.push(0, 1, 0, 0);
        weights.push(1 - upper, upper, 0, 0);
      }
    const at = (i: number, j: number): number => first + j * (steps + 1) + i;
    for (let j = 0; j < rings; ++j)
      for (let i = 0; i < steps; ++i)
        indices.push(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1));
  }
  const length = Math.hypot(0.3, 0.2, 1),
    turn = (degrees: number): number[] => {
      const a = (degrees * Math.PI) / 360,
        s = Math.sin(a) / length;
      return [0.3 * s, 0.2 * s, s, Math.cos(a)];
    };
  const bind = [0, -middle].flatMap((y) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, y, 0, 1]);
  const vertices = positions.length / 3,
    views: object[] = [],
    accessors: object[] = [],
    pieces: Buffer[] = [];
  let offset = 0;
  const add = (values: Float32Array | Uint16Array, type: string, components: number, bounds?: object): number => {
    const bytes = Buffer.from(values.buffer),
      padded = Buffer.concat([bytes, Buffer.alloc(-bytes.length & 3)]);
    views.push({ buffer: 0, byteOffset: offset, byteLength: bytes.length });
    accessors.push({
      bufferView: views.length - 1,
      componentType: values instanceof Float32Array ? 5126 : 5123,
      count: values.length / components,
      type,
      ...bounds,
    });
    pieces.push(padded);
    offset += padded.length;
    return accessors.length - 1;
  };
  const attributes = {
    POSITION: add(new Float32Array(positions), 'VEC3', 3, { min: [-half, 0, -half], max: [half, height, half] }),
    NORMAL: add(new Float32Array(normals), 'VEC3', 3),
    JOINTS_0: add(new Uint16Array(joints), 'VEC4', 4),
    WEIGHTS_0: add(new Float32Array(weights), 'VEC4', 4),
  };
  if (vertices > 65535) throw new Error('too many vertices for short indices');
  const json = {
    asset: { version: '2.0' },
    scene: 0,
    scenes: [{ nodes: [0, 1] }],
    nodes: [{ mesh: 0, skin: 0 }, { children: [2] }, { translation: [0, middle, 0] }],
    meshes: [{ primitives: [{ attributes, indices: add(new Uint16Array(indices), 'SCALAR', 1), material: 0 }] }],
    materials: [{ pbrMetallicRoughness: { baseColorFactor: [0.7, 0.5, 0.3, 1], metallicFactor: 0 } }],
    skins: [{ joints: [1, 2], inverseBindMatrices: add(new Float32Array(bind), 'MAT4', 16) }],
    animations: [
      {
        name: 'Bend',
        samplers: [
          {
            input: add(new Float32Array([0, 1, 2]), 'SCALAR', 1, { min: [0], max: [2] }),
            output: add(new Float32Array([0, 100, 0].flatMap(turn)), 'VEC4', 4),
          },
        ],
        channels: [{ sampler: 0, target: { node: 2, path: 'rotation' } }],
      },
    ],
    accessors,
    bufferViews: views,
    buffers: [{ byteLength: offset }],
  };
  const text = Buffer.from(JSON.stringify(json)),
    head = Buffer.concat([text, Buffer.alloc(-text.length & 3, ' ')]);
  const words = (...values: number[]): Buffer => Buffer.from(Uint32Array.from(values).buffer);
  writeFileSync(
    path,
    Buffer.concat([
      words(0x46546c67, 2, 28 + head.length + offset, head.length, 0x4e4f534a),
      head,
      words(offset, 0x004e4942),
      ...pieces,
    ]),
  );
}
