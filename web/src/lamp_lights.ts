// Lamps as three's lights with shadow maps, drawn anew for what has moved alone; spheres are seen as balls.
import {
  DirectionalLight,
  Mesh,
  MeshBasicMaterial,
  Object3D,
  PointLight,
  SphereGeometry,
  SpotLight,
  Vector3,
  type Sphere,
} from 'three';
import type { LampMakers } from './node_edition.js';
import { isSamePlace, type PlacedLamp, type Rgb } from './moving_lamps.js';

const mapSize = { cube: 1024, flat: 2048 };

type Light = PointLight | SpotLight | DirectionalLight;
const classic: LampMakers = { point: () => new PointLight(), spot: () => new SpotLight() };

class LampLightObject {
  readonly object = new Object3D();
  private light: Light | undefined;
  private ball: Mesh<SphereGeometry, MeshBasicMaterial> | undefined;
  private placed: PlacedLamp | undefined;

  constructor(
    private readonly bounds: Sphere,
    private readonly share: { value: number },
    private readonly make: LampMakers,
  ) {}

  set(placed: PlacedLamp, color: Rgb): void {
    if (this.placed?.kind !== placed.kind) this.begin(placed);
    const moved = !this.placed || !isSamePlace(this.placed, placed),
      shone = this.object.visible;
    this.placed = placed;
    // Exit radiance of white is irradiance over pi, three's as well; what a ball of radiance L sends is pi r^2 L.
    const light = this.light!,
      size = placed.kind === 'sphere' ? Math.PI * placed.radius ** 2 : 1,
      most = Math.max(...color);
    this.object.visible = most > 0;
    light.intensity = most * size;
    light.color.setRGB(...(color.map((c) => c / (most || 1)) as Rgb));
    this.ball?.material.color.setRGB(...color).multiplyScalar(this.share.value);
    if (moved) this.place(placed);
    if (moved || !shone) light.shadow.needsUpdate = true;
  }
  refresh(): void {
    if (this.light) this.light.shadow.needsUpdate = true;
  }
  /** Whether the eye sees balls. */
  show(): void {
    if (this.ball) this.ball.visible = this.share.value > 0;
  }

  private begin({ kind }: PlacedLamp): void {
    this.dispose();
    const { radius } = this.bounds,
      light = kind === 'sun' ? new DirectionalLight() : kind === 'spot' ? this.make.spot() : this.make.point();
    light.castShadow = true;
    const shadow = light.shadow;
    shadow.autoUpdate = false;
    const side = kind === 'point' || kind === 'sphere' ? mapSize.cube : mapSize.flat;
    shadow.mapSize.set(side, side);
    shadow.camera.near = 1e-3 * radius;
    shadow.camera.far = kind === 'sun' ? 4 * radius : 100 * radius;
    // About two texels of the map across the scene.
    shadow.normalBias = (4 * radius) / side;
    shadow.bias = kind === 'sun' ? -1e-4 : -1e-5;
    this.light = light;
    this.object.add(light);
    if (light instanceof PointLight) light.decay = 2;
    else this.object.add(light.target);
    if (kind !== 'sphere') return;
    this.ball = new Mesh(new SphereGeometry(1, 32, 16), new MeshBasicMaterial());
    this.object.add(this.ball);
  }

  private place({ kind, place, direction, radius, cosOuter, cosInner }: PlacedLamp): void {
    const light = this.light!,
      { center } = this.bounds,
      reach = this.bounds.radius,
      way = new Vector3().fromArray(direction);
    light.position.fromArray(place);
    if (light instanceof PointLight) {
      const farthest = light.position.distanceTo(center) + reach;
      Object.assign(light.shadow.camera, { near: Math.max(1e-4 * farthest, radius), far: farthest });
      light.shadow.camera.updateProjectionMatrix();
      if (kind === 'sphere') this.ball!.position.copy(light.position);
      this.ball?.scale.setScalar(radius);
      return;
    }
    if (kind === 'sun') light.position.copy(center).addScaledVector(way, -2 * reach);
    light.target.position.copy(light.position).add(way);
    if (light instanceof SpotLight) {
      light.angle = Math.acos(cosOuter);
      light.penumbra = 1 - Math.acos(cosInner) / light.angle;
      light.distance = 0;
      light.decay = 2;
      const farthest = light.position.distanceTo(center) + reach;
      light.shadow.camera.near = 1e-3 * farthest;
      light.shadow.camera.far = farthest;
      return;
    }
    Object.assign(light.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.5 * reach });
    light.shadow.camera.far = 3.5 * reach;
    light.shadow.camera.updateProjectionMatrix();
  }

  dispose(): void {
    this.light?.dispose();
    this.ball?.geometry.dispose();
    this.ball?.material.dispose();
    this.object.clear();
    this.light = this.ball = this.placed = undefined;
  }
}

/** A group to be put into a program's scene. */
export class LampLights extends Object3D {
  private readonly lamps: LampLightObject[] = [];
  constructor(
    private readonly bounds: Sphere,
    private readonly share: { value: number },
    private readonly make = classic,
  ) {
    super();
    this.name = 'lambent lamps';
  }

  set(lamps: readonly { placed: PlacedLamp; color: Rgb }[]): void {
    while (this.lamps.length > lamps.length) {
      const gone = this.lamps.pop()!;
      gone.dispose();
      this.remove(gone.object);
    }
    while (this.lamps.length < lamps.length) {
      const made = new LampLightObject(this.bounds, this.share, this.make);
      this.lamps.push(made);
      this.add(made.object);
    }
    lamps.forEach(({ placed, color }, i) => this.lamps[i]!.set(placed, color));
    this.show();
  }
  show(): void {
    for (const lamp of this.lamps) lamp.show();
  }
  /** Draws all shadows anew: the graphics card was taken away, or something else has moved. */
  refresh(): void {
    for (const lamp of this.lamps) lamp.refresh();
  }
  override dispose(): void {
    for (const lamp of this.lamps) lamp.dispose();
    this.lamps.length = 0;
    this.clear();
  }
}
