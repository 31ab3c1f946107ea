// Where the receivers of visibility in blocks are, as the scene stands when it is loaded: as it was baked.
import {
  DataTexture,
  FloatType,
  Matrix3,
  NearestFilter,
  RGBAFormat,
  Vector3,
  type Mesh,
  type SkinnedMesh,
} from 'three';
import { receiverColumns } from './block_shader.js';
import { LambentError } from './errors.js';
import { noReceiver } from './header.js';

/** Places and unit normals of vertices in the world; normals on the side that the triangles' fronts are on. */
function surfaceOf(mesh: Mesh): { positions: Float32Array; normals: Float32Array } {
  mesh.updateWorldMatrix(true, false);
  const { geometry, matrixWorld } = mesh,
    count = geometry.getAttribute('position').count,
    [positions, normals, fronts] = [
      new Float32Array(3 * count),
      new Float32Array(3 * count),
      new Float32Array(3 * count),
    ],
    turn = new Matrix3().getNormalMatrix(matrixWorld),
    own = geometry.getAttribute('normal'),
    skin = 'isSkinnedMesh' in mesh ? (mesh as SkinnedMesh) : undefined,
    [p, n, a, b, c] = Array.from({ length: 5 }, () => new Vector3()) as [Vector3, Vector3, Vector3, Vector3, Vector3];
  if (!own) throw new LambentError('has a mesh without normals, which visibility in blocks was baked for');
  for (let v = 0; v < count; ++v) {
    mesh.getVertexPosition(v, p);
    n.fromBufferAttribute(own, v);
    if (skin) {
      a.fromBufferAttribute(geometry.getAttribute('position'), v);
      n.add(a);
      n.copy(skin.applyBoneTransform(v, n)).sub(skin.applyBoneTransform(v, a));
    }
    p.applyMatrix4(matrixWorld).toArray(positions, 3 * v);
    n.applyMatrix3(turn)
      .normalize()
      .toArray(normals, 3 * v);
  }
  const corners = geometry.index?.count ?? count,
    isMirrored = matrixWorld.determinant() < 0;
  for (let i = 0; i + 2 < corners; i += 3) {
    const at = [0, 1, 2].map((k) => geometry.index?.getX(i + k) ?? i + k);
    [a, b, c].forEach((corner, k) => corner.fromArray(positions, 3 * at[k]!));
    b.sub(a)
      .cross(c.sub(a))
      .multiplyScalar(isMirrored ? -1 : 1);
    for (const v of at) for (let k = 0; k < 3; ++k) fronts[3 * v + k]! += b.getComponent(k);
  }
  for (let v = 0; v < 3 * count; v += 3) {
    const along = normals[v]! * fronts[v]! + normals[v + 1]! * fronts[v + 1]! + normals[v + 2]! * fronts[v + 2]!;
    if (along < 0) for (let k = 0; k < 3; ++k) normals[v + k] = -normals[v + k]!;
  }
  return { positions, normals };
}

/**
 * Two texels a receiver: its place and the lower 24 bits of where its record begins, its normal and the upper ones.
 * As the scene stands now, which is as it was baked.
 */
export function placeReceivers(meshes: readonly Mesh[], receivers: number, begins: Float64Array): DataTexture {
  const height = Math.ceil(receivers / receiverColumns),
    data = new Float32Array(8 * receiverColumns * height),
    done = new Uint8Array(receivers);
  for (let r = 0; r < receivers; ++r) {
    data[8 * r + 3] = begins[r]! % 2 ** 24;
    data[8 * r + 7] = Math.floor(begins[r]! / 2 ** 24);
  }
  for (const mesh of meshes) {
    const { positions, normals } = surfaceOf(mesh);
    for (const [name, sign] of [
      ['lambentReceiver', 1],
      ['lambentReceiverBack', -1],
    ] as const) {
      if (!mesh.geometry.hasAttribute(name)) continue;
      const map = mesh.geometry.getAttribute(name);
      for (let v = 0; v < map.count; ++v) {
        const r = map.getX(v);
        if (r === noReceiver || done[r]) continue;
        done[r] = 1;
        data.set(positions.subarray(3 * v, 3 * v + 3), 8 * r);
        for (let k = 0; k < 3; ++k) data[8 * r + 4 + k] = sign * normals[3 * v + k]!;
      }
    }
  }
  const made = new DataTexture(data, 2 * receiverColumns, height, RGBAFormat, FloatType);
  made.name = 'lambent receivers';
  made.minFilter = made.magFilter = NearestFilter;
  made.generateMipmaps = false;
  made.needsUpdate = true;
  return made;
}
