// The lobes of one receiver, picked with the pointer: a ball each, drawn over the scene, and the same in words.
import {
  BufferGeometry,
  Color,
  DirectionalLight,
  Float32BufferAttribute,
  HemisphereLight,
  LatheGeometry,
  Line,
  LineBasicMaterial,
  Mesh,
  MeshLambertMaterial,
  Object3D,
  PerspectiveCamera,
  Raycaster,
  Scene,
  SkinnedMesh,
  Vector2,
  Vector3,
} from 'three';
import { lobeValue, type BakedTransfer, type Lobe } from '../src/index.js';

export interface Picked {
  mesh: Mesh;
  vertex: number;
  /** The surface is seen from behind, and has receivers there. */
  back: boolean;
}

/** Through a place of the canvas, in pixels. */
export function rayAt(x: number, y: number, canvas: HTMLCanvasElement, camera: PerspectiveCamera): Raycaster {
  const ray = new Raycaster();
  ray.setFromCamera(new Vector2((2 * x) / canvas.clientWidth - 1, 1 - (2 * y) / canvas.clientHeight), camera);
  return ray;
}

/** The vertex nearest to where the ray first meets a mesh. */
export function pickVertex(meshes: readonly Mesh[], ray: Raycaster): Picked | undefined {
  // Bounds of skins are those of the pose in which they were last asked for.
  for (const mesh of meshes) if (mesh instanceof SkinnedMesh) mesh.computeBoundingSphere();
  const hit = ray.intersectObjects(
    meshes.filter((m) => m.visible),
    false,
  )[0];
  if (!hit?.face || !hit.barycoord) return undefined;
  const { a, b, c, normal } = hit.face,
    { x, y, z } = hit.barycoord,
    mesh = hit.object as Mesh;
  const behind = normal.dot(ray.ray.direction.clone().transformDirection(mesh.matrixWorld.clone().invert())) > 0;
  return {
    mesh,
    vertex: x >= y && x >= z ? a : y >= z ? b : c,
    back: behind && mesh.geometry.hasAttribute('lambentReceiverBack'),
  };
}

const number = (x: number): string => (Math.abs(x) < 0.005 ? '0.00' : x.toFixed(2).replace('-', '−'));

/** Number of lobes, and of each, the strongest first, its share of their energy and its axis. */
export function describeLobes(lobes: readonly Lobe[]): string {
  const total = lobes.reduce((sum, { energy }) => sum + energy, 0);
  const parts = [...lobes]
    .sort((a, b) => b.energy - a.energy)
    .map(
      ({ axis, energy }) =>
        `${total > 0 ? Math.round((100 * energy) / total) : 0} % about (${axis.toArray().map(number).join(', ')})`,
    );
  const count = lobes.length === 1 ? '1 lobe' : `${lobes.length} lobes`;
  return `${count} of energy ${Number(total.toPrecision(3))}: ${parts.join('; ')}`;
}

/** The greatest absolute value of a lobe. */
export function lobePeak(bands: readonly number[]): number {
  let peak = 0;
  for (let i = 0; i <= 64; ++i) peak = Math.max(peak, Math.abs(lobeValue(bands, i / 32 - 1)));
  return peak;
}

// The ends of the false-colour scale: bright where the lobe is positive, dark where it is negative.
const positive = new Color('#fff0a0'),
  negative = new Color('#0b1e51');

/** A lobe about +Y: as far from the middle as `scale` times its absolute value. */
export function lobeGeometry(bands: readonly number[], scale: number): BufferGeometry {
  const rings = 48,
    values = Array.from({ length: rings + 1 }, (_, j) => lobeValue(bands, -Math.cos((Math.PI * j) / rings)));
  const geometry = new LatheGeometry(
    values.map((value, j) => {
      const r = scale * Math.abs(value),
        theta = (Math.PI * j) / rings;
      return new Vector2(r * Math.sin(theta), -r * Math.cos(theta));
    }),
    32,
  );
  const colors = Array.from({ length: geometry.getAttribute('position').count }, (_, k) =>
    (values[k % values.length]! < 0 ? negative : positive).toArray(),
  );
  return geometry.setAttribute('color', new Float32BufferAttribute(colors.flat(), 3));
}

const heightShare = 0.09; // how far the strongest lobe reaches, of the picture's height
const apart = 1.3; // from the point to the middle of a ball, in that reach

export class LobeGlyphs {
  private readonly scene = new Scene();
  private readonly balls = new Object3D();
  private readonly lamp = new DirectionalLight(0xffffff, 2);
  private readonly ball = new MeshLambertMaterial({ vertexColors: true, toneMapped: false });
  private readonly stick = new LineBasicMaterial({ color: 0xffffff, toneMapped: false });
  private picked: (Picked & { transfer: BakedTransfer }) | undefined;

  constructor() {
    this.scene.add(this.balls, this.lamp, new HemisphereLight(0xffffff, 0x808080, 1.5));
  }

  /** Shows the lobes of a vertex and says what they are; undefined where it has none. */
  pick(transfer: BakedTransfer, picked: Picked | undefined): string | undefined {
    this.clear();
    const lobes = picked && transfer.lobesAt?.(picked.mesh, picked.vertex, picked.back);
    if (!picked || !lobes) return undefined;
    this.picked = { ...picked, transfer };
    const peak = Math.max(...lobes.map(({ bands }) => lobePeak(bands))),
      scale = peak > 0 ? 1 / peak : 0; // one scale for all
    for (const { bands } of lobes) {
      const along = new Object3D(),
        ball = new Mesh(lobeGeometry(bands, scale), this.ball);
      ball.position.y = apart;
      along.add(
        ball,
        new Line(new BufferGeometry().setFromPoints([new Vector3(), new Vector3(0, apart, 0)]), this.stick),
      );
      this.balls.add(along);
    }
    return describeLobes(lobes);
  }

  /** In words, as the surface stands now. */
  describe(): string | undefined {
    const lobes = this.lobes();
    return lobes && describeLobes(lobes);
  }

  clear(): void {
    this.picked = undefined;
    this.balls.traverse((o) => (o instanceof Mesh || o instanceof Line) && (o.geometry as BufferGeometry).dispose());
    this.balls.clear();
  }

  /** Where the surface is now; undefined where there is nothing to draw. */
  place(camera: PerspectiveCamera): Scene | undefined {
    const lobes = this.lobes();
    if (!this.picked || !lobes) return undefined;
    const { mesh, vertex } = this.picked;
    mesh.getVertexPosition(vertex, this.balls.position).applyMatrix4(mesh.matrixWorld);
    this.balls.scale.setScalar(
      2 * heightShare * Math.tan((camera.fov * Math.PI) / 360) * camera.position.distanceTo(this.balls.position),
    );
    this.balls.children.forEach((along, i) =>
      along.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), lobes[i]!.axis),
    );
    this.lamp.position.copy(camera.position).sub(this.balls.position);
    return this.scene;
  }

  private lobes(): Lobe[] | undefined {
    return this.picked && this.picked.transfer.lobesAt?.(this.picked.mesh, this.picked.vertex, this.picked.back);
  }
}
