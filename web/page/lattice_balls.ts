// The points of the lattice as balls in the light that they hold: white, and diffuse. A point that lies inside
// something holds its neighbours' light, and is half as large.
import {
  DataTexture,
  FloatType,
  Group,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  Mesh,
  NearestFilter,
  RGBAFormat,
  ShaderMaterial,
  SphereGeometry,
  Vector3,
} from 'three';
import { clampedCosine, shBand, shCount, type Lattice } from '../src/index.js';
import { glslHarmonics } from '../src/glsl_harmonics.js';
import type { Companion } from './companions.js';
import type { View } from './state.js';

const most = 32768, // balls; of more points each second, third, ... of an axis
  fewBalls = 4096, // rounder ones
  bandsDrawn = 8, // beyond them a cosine has less than a hundredth
  share = 0.14, // radius, of the least distance between points
  width = 2048; // of the texture, a coefficient a texel

/** Those that are drawn, by their numbers in the file. */
export function pointsDrawn({ points }: Lattice): number[] {
  let step = 1;
  while (points.reduce((n, along) => n * Math.ceil(along / step), 1) > most) ++step;
  const [nx, ny, nz] = points,
    drawn: number[] = [];
  for (let z = 0; z < nz; z += step)
    for (let y = 0; y < ny; y += step) for (let x = 0; x < nx; x += step) drawn.push((z * ny + y) * nx + x);
  return drawn;
}

/** Of a ball; of a lattice of one point, a share of `scene`, the scene's radius. */
export function ballRadius({ points, header: { min, max } }: Lattice, scene: number): number {
  const apart = points.flatMap((n, k) => (n > 1 && max[k]! > min[k]! ? [(max[k]! - min[k]!) / (n - 1)] : []));
  return share * Math.min(...(apart.length > 0 ? apart : [0.2 * scene]));
}

interface Shown {
  lattice: Lattice;
  drawn: number[];
  texture: DataTexture;
  rows: number;
}

export class LatticeBalls implements Companion {
  readonly root = new Group();
  readonly isLit = false;
  private shown: Shown | undefined;

  isShownIn(view: View): boolean {
    return view !== 'compare' && view !== 'reference';
  }

  /** In place of what there was; undefined: none. */
  show(lattice: Lattice | undefined, sceneRadius: number): void {
    if (this.shown?.lattice === lattice) return;
    this.clear();
    if (!lattice) return;
    const drawn = pointsDrawn(lattice),
      order = Math.min(lattice.order, bandsDrawn),
      rows = shCount(order),
      texture = new DataTexture(
        new Float32Array(4 * width * Math.ceil((rows * drawn.length) / width)),
        width,
        Math.ceil((rows * drawn.length) / width),
        RGBAFormat,
        FloatType,
      );
    texture.minFilter = texture.magFilter = NearestFilter;
    const radius = ballRadius(lattice, sceneRadius),
      geometry = new InstancedBufferGeometry(),
      ball = new SphereGeometry(1, ...(drawn.length > fewBalls ? [8, 5] : [20, 12])),
      places = new Float32Array(4 * drawn.length),
      at = new Vector3();
    drawn.forEach((point, i) => {
      lattice.position(point, at).toArray(places, 4 * i);
      places[4 * i + 3] = lattice.valid[point] ? radius : 0.5 * radius;
    });
    geometry.setAttribute('position', ball.getAttribute('position'));
    geometry.setIndex(ball.index);
    geometry.setAttribute('ballPlace', new InstancedBufferAttribute(places, 4));
    geometry.instanceCount = drawn.length;
    const material = new ShaderMaterial({
      uniforms: { coefficients: { value: texture } },
      vertexShader: /* glsl */ `
attribute vec4 ballPlace;
uniform highp sampler2D coefficients;
varying vec3 vLight;
vec3 coefficient( const in int i ) {
  int at = gl_InstanceID * ${rows} + i;
  return texelFetch( coefficients, ivec2( at % ${width}, at / ${width} ), 0 ).rgb;
}
void main() {
  vec3 n = normalize( position ), sum = vec3( 0.0 );
  ${glslHarmonics(order, (i, value) => {
    const factor = clampedCosine(shBand(i)) / Math.PI;
    return Math.abs(factor) < 1e-6 ? '' : `sum += ${factor.toExponential(9)} * (${value}) * coefficient( ${i} );`;
  })}
  vLight = sum;
  gl_Position = projectionMatrix * viewMatrix * modelMatrix * vec4( ballPlace.xyz + ballPlace.w * n, 1.0 );
}`,
      fragmentShader: /* glsl */ `
varying vec3 vLight;
void main() {
  gl_FragColor = vec4( max( vLight, vec3( 0.0 ) ), 1.0 );
  #include <tonemapping_fragment>
  #include <colorspace_fragment>
}`,
    });
    const balls = new Mesh(geometry, material);
    balls.frustumCulled = false;
    this.root.add(balls);
    this.shown = { lattice, drawn, texture, rows };
    this.relight();
  }

  relight(): void {
    if (!this.shown) return;
    const { lattice, drawn, texture, rows } = this.shown,
      data = texture.image.data as Float32Array,
      size = 3 * shCount(lattice.order);
    drawn.forEach((point, i) => {
      for (let k = 0; k < rows; ++k)
        for (let c = 0; c < 3; ++c) data[4 * (rows * i + k) + c] = lattice.coefficients[size * point + 3 * k + c]!;
    });
    texture.needsUpdate = true;
  }

  private clear(): void {
    this.shown?.texture.dispose();
    this.shown = undefined;
    for (const balls of this.root.children as Mesh<InstancedBufferGeometry, ShaderMaterial>[]) {
      balls.geometry.dispose();
      balls.material.dispose();
    }
    this.root.clear();
  }
}
