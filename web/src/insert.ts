// An object that the bake did not know, put into its scene (`lambent render --insert`): diffuse, each vertex lit by the
// light in free space at its place. A file of its own bake has its own shadows and bounces, as if that light were the
// same all over it; any other is lit as what nothing is in the way of. It casts neither shadow nor light on the scene.
import {
  BackSide,
  Box3,
  BufferAttribute,
  BufferGeometry,
  Float32BufferAttribute,
  FrontSide,
  Group,
  Matrix3,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  Vector3,
  type InstancedMesh,
  type Material,
  type Object3D,
  type SkinnedMesh,
} from 'three';
import { LambentError } from './errors.js';
import { noReceiver } from './header.js';
import { limits, type BakedTransfer } from './kinds.js';
import type { Lattice } from './lattice.js';
import { diffuseParameters } from './prt_material.js';
import { clampedCosine, evaluateSh, shBand, shCount } from './sh.js';

/** One of the two sides of a mesh. */
interface Side {
  /** Of its vertices, the foot of the object at 0. */
  positions: Float32Array;
  /** Outwards on this side. */
  normals: Float32Array;
  receivers: ArrayLike<number> | undefined;
  /** The object's own colours, and these times the light, which are drawn. */
  own: BufferAttribute | undefined;
  lit: BufferAttribute;
}

const isInstanced = (mesh: Mesh): mesh is InstancedMesh => (mesh as Partial<InstancedMesh>).isInstancedMesh === true;

/** Where a mesh stands: once, or as often as it has instances. */
function placesOf(mesh: Mesh): Matrix4[] {
  if (!isInstanced(mesh)) return [mesh.matrixWorld];
  return Array.from({ length: mesh.count }, (_, i) => {
    const at = new Matrix4();
    mesh.getMatrixAt(i, at);
    return at.premultiply(mesh.matrixWorld);
  });
}

type Vectors = Pick<BufferAttribute, 'getX' | 'getY' | 'getZ'>;
const vectorAt = (from: Vectors, i: number): Vector3 => new Vector3(from.getX(i), from.getY(i), from.getZ(i));

/** Places and normals of a mesh's vertices in its own axes, as it is posed; a face without normals is flat. */
function posed(mesh: Mesh, geometry: BufferGeometry): { positions: Float32Array; normals: Float32Array } {
  const places = geometry.getAttribute('position'),
    { count } = places,
    positions = new Float32Array(3 * count),
    skin = (mesh as Partial<SkinnedMesh>).isSkinnedMesh ? (mesh as SkinnedMesh) : undefined,
    isPosed = geometry === mesh.geometry && (skin !== undefined || mesh.morphTargetInfluences !== undefined);
  if (skin) skin.skeleton.update();
  for (let v = 0; v < count; ++v)
    (isPosed ? mesh.getVertexPosition(v, new Vector3()) : vectorAt(places, v)).toArray(positions, 3 * v);
  if (!geometry.hasAttribute('normal')) {
    const flat = new BufferGeometry().setAttribute('position', new BufferAttribute(positions, 3));
    flat.setIndex(geometry.index);
    flat.computeVertexNormals();
    return { positions, normals: flat.getAttribute('normal').array as Float32Array };
  }
  const normals = new Float32Array(3 * count),
    given = geometry.getAttribute('normal');
  for (let v = 0; v < count; ++v) {
    const n = vectorAt(given, v);
    if (skin) {
      const from = vectorAt(places, v),
        to = skin.applyBoneTransform(v, from.clone().add(n));
      n.copy(to).sub(skin.applyBoneTransform(v, from));
    }
    n.normalize().toArray(normals, 3 * v);
  }
  return { positions, normals };
}

export class Insert {
  /** To be added to the scene, whose axes are those of the baked one; place() says where it stands. */
  readonly root = new Group();
  /** Of the object, as its file has it. */
  readonly size = new Vector3();
  readonly vertices: number;
  private readonly sides: Side[] = [];

  /**
   * `object` with all that is visible below it, as it stands; it is copied, but for its textures. `transfer`: its own,
   * where it was baked. Throws LambentError where there is nothing to place, or too much, or where its transfer is none
   * of diffuse surfaces.
   */
  constructor(
    object: Object3D,
    private readonly lattice: Lattice,
    private readonly transfer?: BakedTransfer,
  ) {
    if (transfer && !transfer.coefficientsOf)
      throw new LambentError(
        'cannot be put into a scene: of baked files, diffuse ones at vertices can, lit by harmonics alone',
      );
    object.updateMatrixWorld(true);
    const meshes: Mesh[] = [];
    object.traverseVisible((o) => (o as Partial<Mesh>).isMesh && meshes.push(o as Mesh));
    this.vertices = meshes.reduce((sum, mesh) => {
      const { index, attributes } = mesh.geometry,
        own = attributes['normal'] || transfer ? attributes['position']! : (index ?? attributes['position']!);
      return sum + own.count * (isInstanced(mesh) ? mesh.count : 1);
    }, 0);
    if (this.vertices === 0) throw new LambentError('holds no surfaces that could be put into a scene');
    if (this.vertices > limits.insertVertices)
      throw new LambentError(
        `has ${this.vertices.toLocaleString('en')} vertices, and an object that is put into a scene has ` +
          `${limits.insertVertices.toLocaleString('en')} at most`,
      );
    for (const mesh of meshes) for (const matrix of placesOf(mesh)) this.add(mesh, matrix);
    const box = new Box3(),
      all = new Set(this.sides.map(({ positions }) => positions));
    for (const positions of all) box.union(new Box3().setFromArray(positions));
    box.getSize(this.size);
    const foot = box.getCenter(new Vector3()).setY(box.min.y).toArray();
    if (![...foot, ...this.size.toArray()].every(Number.isFinite))
      throw new LambentError('has vertices whose places are no numbers');
    for (const positions of all) for (let i = 0; i < positions.length; ++i) positions[i]! -= foot[i % 3]!;
    this.meshes.forEach(({ geometry }) => geometry.computeBoundingSphere());
  }

  get meshes(): Mesh[] {
    return this.root.children as Mesh[];
  }

  private add(mesh: Mesh, matrix: Matrix4): void {
    const { geometry: given } = mesh,
      from = given.hasAttribute('normal') || this.transfer || !given.index ? given : given.toNonIndexed(),
      { positions, normals } = posed(mesh, from),
      turn = new Matrix3().getNormalMatrix(matrix);
    const places = new BufferAttribute(positions, 3).applyMatrix4(matrix);
    new BufferAttribute(normals, 3).applyNormalMatrix(turn);
    const materials = [mesh.material].flat(),
      isMirrored = matrix.determinant() < 0;
    for (const [seen, hidden, name] of [
      [FrontSide, BackSide, 'lambentReceiver'],
      [BackSide, FrontSide, 'lambentReceiverBack'],
    ] as const) {
      if (materials.every(({ side }) => side === hidden)) continue;
      const geometry = new BufferGeometry(),
        lit = new Float32BufferAttribute(new Float32Array(3 * places.count), 3);
      geometry.setAttribute('position', places);
      geometry.setAttribute('color', lit);
      geometry.setIndex(from.index);
      geometry.groups = from.groups;
      for (const uv of ['uv', 'uv1', 'uv2', 'uv3'])
        if (from.hasAttribute(uv)) geometry.setAttribute(uv, from.getAttribute(uv));
      const made = materials.map(
        (material: Material) =>
          new MeshBasicMaterial({
            ...diffuseParameters(material),
            vertexColors: true,
            visible: material.visible && material.side !== hidden,
            side: isMirrored ? hidden : seen,
          }),
      );
      this.root.add(new Mesh(geometry, Array.isArray(mesh.material) ? made : made[0]!));
      const hasColors = materials.some(({ vertexColors }) => vertexColors) && from.hasAttribute('color');
      this.sides.push({
        positions,
        normals: seen === FrontSide ? normals : normals.map((n) => -n),
        receivers: this.transfer ? (from.attributes[name]?.array ?? []) : undefined,
        own: hasColors ? (from.getAttribute('color') as BufferAttribute) : undefined,
        lit,
      });
    }
  }

  /** Puts the middle of its bottom there, so many times its size; relight() is to follow. */
  place(foot: Vector3, scale = 1): void {
    this.root.position.copy(foot);
    this.root.scale.setScalar(scale);
    this.root.updateMatrixWorld();
  }

  /** Takes the lattice's light as it is now, where the object stands. */
  relight(): void {
    const { lattice, transfer, root } = this,
      { position, scale } = root,
      order = Math.min(lattice.order, transfer?.order ?? lattice.order),
      rows = shCount(order),
      light = new Float64Array(3 * shCount(lattice.order)),
      channels = transfer?.channels ?? 1,
      stride = transfer ? shCount(transfer.order) : rows, // of a channel
      values = new Float64Array(channels * stride),
      cosine = Array.from({ length: rows }, (_, i) => clampedCosine(shBand(i)) / Math.PI),
      at = new Vector3(),
      sums: [number, number, number] = [0, 0, 0];
    for (const { positions, normals, receivers, own, lit } of this.sides) {
      for (let v = 0; v < lit.count; ++v) {
        const receiver = receivers ? (receivers[v] ?? noReceiver) : 0;
        sums.fill(0);
        if (receiver !== noReceiver) {
          lattice.radianceAt(
            at
              .fromArray(positions, 3 * v)
              .multiply(scale)
              .add(position),
            light,
          );
          if (receivers) transfer!.coefficientsOf!(receiver, values);
          else {
            evaluateSh(order, normals[3 * v]!, normals[3 * v + 1]!, normals[3 * v + 2]!, values);
            for (let i = 0; i < rows; ++i) values[i]! *= cosine[i]!;
          }
          for (let c = 0; c < 3; ++c) {
            const row = Math.min(c, channels - 1) * stride;
            for (let i = 0; i < rows; ++i) sums[c]! += values[row + i]! * light[3 * i + c]!;
          }
        }
        if (own) for (let c = 0; c < 3; ++c) sums[c]! *= own.getComponent(v, c);
        lit.setXYZ(v, ...sums);
      }
      lit.needsUpdate = true;
    }
  }

  /** Of the copies; a transfer of its own is left to whom it belongs to. */
  dispose(): void {
    for (const { geometry, material } of this.meshes) {
      geometry.dispose();
      for (const of of [material].flat()) of.dispose();
    }
    this.root.removeFromParent();
  }
}
