// Receivers as dots on their surfaces: vertices that have one, or the middles of the atlas's texels.
import {
  BufferAttribute,
  BufferGeometry,
  Group,
  Points,
  ShaderMaterial,
  Vector3,
  type Mesh,
  type SkinnedMesh,
} from 'three';
import type { BakedTransfer } from '../src/index.js';
import { noReceiver } from '../src/header.js';
import type { Companion } from './companions.js';
import type { View } from './state.js';

const most = 500_000, // dots; of more each second, third, ...
  size = 4; // pixels

/** A place on a mesh: vertices and their weights, in its own axes. */
interface Placed {
  corners: Uint32Array; // three a dot
  weights: Float32Array;
}

/** Vertices with a receiver on one side or both. */
function atVertices({ geometry }: Mesh): Placed {
  const front = geometry.getAttribute('lambentReceiver'),
    back = geometry.attributes['lambentReceiverBack'],
    corners: number[] = [],
    weights: number[] = [];
  for (let v = 0; v < front.count; ++v) {
    if (front.getX(v) === noReceiver && (!back || back.getX(v) === noReceiver)) continue;
    corners.push(v, v, v);
    weights.push(1, 0, 0);
  }
  return { corners: Uint32Array.from(corners), weights: Float32Array.from(weights) };
}

/** Middles of texels that lie within triangles over the atlas. */
function atTexels({ geometry }: Mesh): Placed {
  const { index } = geometry,
    count = index?.count ?? geometry.getAttribute('position').count,
    corners: number[] = [],
    weights: number[] = [];
  for (const name of ['lambentPlace', 'lambentPlaceBack']) {
    const place = geometry.attributes[name];
    if (!place) continue;
    for (let t = 0; t + 2 < count; t += 3) {
      const [a, b, c] = [0, 1, 2].map((k) => index?.getX(t + k) ?? t + k) as [number, number, number],
        x = [a, b, c].map((v) => place.getX(v)) as [number, number, number],
        y = [a, b, c].map((v) => place.getY(v)) as [number, number, number],
        area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]);
      if (area === 0) continue;
      // The first middle at or after the least coordinate, the last at or before the largest.
      for (let j = Math.ceil(Math.min(...y) - 0.5); j + 0.5 <= Math.max(...y); ++j)
        for (let i = Math.ceil(Math.min(...x) - 0.5); i + 0.5 <= Math.max(...x); ++i) {
          const [px, py] = [i + 0.5, j + 0.5],
            u = ((px - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (py - y[0])) / area,
            v = ((x[1] - x[0]) * (py - y[0]) - (px - x[0]) * (y[1] - y[0])) / area;
          if (u < 0 || v < 0 || u + v > 1) continue;
          corners.push(a, b, c);
          weights.push(1 - u - v, u, v);
        }
    }
  }
  return { corners: Uint32Array.from(corners), weights: Float32Array.from(weights) };
}

/** Each `step`-th. */
function thinned({ corners, weights }: Placed, step: number): Placed {
  if (step === 1) return { corners, weights };
  const kept = Array.from({ length: Math.ceil(corners.length / 3 / step) }, (_, i) => 3 * step * i),
    pick = (from: Uint32Array | Float32Array): number[] => kept.flatMap((at) => [...from.subarray(at, at + 3)]);
  return { corners: Uint32Array.from(pick(corners)), weights: Float32Array.from(pick(weights)) };
}

interface Dots extends Placed {
  mesh: Mesh;
  points: Points<BufferGeometry, ShaderMaterial>;
}

export class ReceiverDots implements Companion {
  readonly root = new Group();
  readonly isLit = false;
  private transfer: BakedTransfer | undefined;
  private dots: Dots[] = [];
  /** White with a dark rim, to be seen on all; a little nearer to the eye than its surface. */
  private readonly material = new ShaderMaterial({
    uniforms: { size: { value: size } },
    vertexShader: /* glsl */ `
uniform float size;
void main() {
  vec4 seen = modelViewMatrix * vec4( position, 1.0 );
  seen.xyz *= 0.997;
  gl_Position = projectionMatrix * seen;
  gl_PointSize = size;
}`,
    fragmentShader: /* glsl */ `
void main() {
  float r = length( gl_PointCoord - 0.5 );
  if ( r > 0.5 ) discard;
  gl_FragColor = vec4( vec3( r < 0.3 ? 1.0 : 0.0 ), 1.0 );
}`,
  });

  /** How many there are in the scene, once shown. */
  count = 0;

  isShownIn(view: View): boolean {
    return view !== 'compare' && view !== 'reference';
  }
  relight(): void {
    // They are marks.
  }

  /** Of this in place of what there was; undefined: none. */
  show(transfer: BakedTransfer | undefined): void {
    if (this.transfer === transfer) return;
    this.transfer = transfer;
    for (const { points } of this.dots) points.geometry.dispose();
    this.root.clear();
    this.dots = [];
    this.count = 0;
    if (!transfer) return;
    this.material.uniforms['size']!.value = size * Math.min(2, window.devicePixelRatio || 1);
    const all = transfer.meshes.map((mesh) =>
      mesh.geometry.hasAttribute('lambentReceiver')
        ? atVertices(mesh)
        : mesh.geometry.hasAttribute('lambentPlace')
          ? atTexels(mesh)
          : { corners: new Uint32Array(), weights: new Float32Array() },
    );
    this.count = all.reduce((sum, { corners }) => sum + corners.length / 3, 0);
    const step = Math.max(1, Math.ceil(this.count / most));
    this.dots = transfer.meshes.map((mesh, i) => {
      const placed = thinned(all[i]!, step),
        geometry = new BufferGeometry(),
        points = new Points(geometry, this.material);
      geometry.setAttribute('position', new BufferAttribute(new Float32Array(placed.corners.length), 3));
      points.frustumCulled = points.matrixAutoUpdate = false;
      this.root.add(points);
      return { ...placed, mesh, points };
    });
    for (const dots of this.dots) place(dots);
  }

  /** Surfaces that move take them along. */
  beforeDraw(): void {
    for (const dots of this.dots) {
      const { mesh, points } = dots;
      mesh.updateWorldMatrix(true, false);
      points.matrix.copy(mesh.matrixWorld);
      points.matrixWorldNeedsUpdate = true;
      points.visible = mesh.visible;
      if ((mesh as Partial<SkinnedMesh>).isSkinnedMesh || mesh.morphTargetInfluences) place(dots);
    }
  }
}

/** Where its mesh has them now. */
function place({ mesh, points, corners, weights }: Dots): void {
  const positions = points.geometry.getAttribute('position') as BufferAttribute,
    at = new Vector3(),
    corner = new Vector3();
  for (let i = 0; i < corners.length; i += 3) {
    at.set(0, 0, 0);
    for (let k = 0; k < 3; ++k)
      if (weights[i + k] !== 0) at.addScaledVector(mesh.getVertexPosition(corners[i + k]!, corner), weights[i + k]!);
    at.toArray(positions.array, i);
  }
  positions.needsUpdate = true;
}
