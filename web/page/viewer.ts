// The picture: a baked scene, its light and what it is compared with. Draws when something has changed, and only then.
import {
  AnimationMixer,
  Box3,
  HalfFloatType,
  LinearToneMapping,
  Matrix4,
  PerspectiveCamera,
  Quaternion,
  Raycaster,
  Scene,
  Sphere,
  Vector2,
  Vector3,
  WebGLRenderer,
  WebGLRenderTarget,
  type AnimationAction,
  type DataTexture,
  type Mesh,
  type Object3D,
} from 'three';
import type { GLTF } from 'three/addons/loaders/GLTFLoader.js';
import { FullScreenQuad } from 'three/addons/postprocessing/Pass.js';
import { anySeeThrough, LambentError, type BakedScene, type ShWindow } from '../src/index.js';
import type { EnvironmentFile } from './loading.js';
import { LobeGlyphs, pickVertex } from './lobes.js';
import { Model } from './model.js';
import { Orbit } from './orbit.js';
import { DevelopMaterial, PictureMaterial, SkyMaterial } from './screen.js';
import type { View } from './state.js';

export interface ViewerCallbacks {
  /** A frame followed the one before it after so many milliseconds, without a pause between. */
  onFrame(milliseconds: number): void;
  onChange(): void;
  onUse(what: 'orbit' | 'light'): void;
  onProblem(message: string): void;
  onRecovered(): void;
}

const groundName = 'ground'; // of the floor that `lambent bake --ground` adds
/** Transfer at the ends of the false-colour scale, at exposure 0: those of open surfaces stay below 0.33. */
export const falseColorEnd = 0.25;
/** Of errors of a fit, relative. */
export const fitErrorEnd = 0.1;
const pause = 250; // milliseconds without a frame

export class Viewer {
  readonly renderer: WebGLRenderer;
  readonly camera = new PerspectiveCamera(35, 1, 0.1, 100);
  readonly orbit: Orbit;
  view: View = 'baked';
  against: View | undefined;
  wipe = 0.5;
  order = 0; // bands in use; 0: all
  window: ShWindow = 'none';
  exposure = 0;
  showBackground = true;
  coefficient = 3;

  private readonly scene = new Scene();
  private readonly sky = new SkyMaterial();
  private readonly picture = new PictureMaterial();
  private readonly developed = new DevelopMaterial();
  private readonly linear = new WebGLRenderTarget(1, 1, { type: HalfFloatType, samples: 4 });
  private readonly screen = new FullScreenQuad(this.sky);
  private readonly gain = { value: 1 }; // of false colour
  private readonly errorGain = { value: 1 };
  private readonly glyphs = new LobeGlyphs();
  private readonly bounds = new Sphere(new Vector3(), 1);
  private baked: Model | undefined;
  private compare: Model | undefined;
  private environment: EnvironmentFile | undefined;
  private animation: { mixer: AnimationMixer; action: AnimationAction } | undefined;
  private lightChanged = true;
  private request = 0;
  private lastFrame = 0;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly callbacks: ViewerCallbacks,
  ) {
    try {
      this.renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: 'high-performance' });
    } catch {
      throw new LambentError('This browser gives the page no WebGL 2, which it draws with.');
    }
    this.renderer.debug.onShaderError = (context, program) =>
      callbacks.onProblem(
        `The graphics driver refuses a shader: ${context.getProgramInfoLog(program) ?? 'no reason given'}`,
      );
    this.renderer.autoClear = false;
    this.renderer.toneMapping = LinearToneMapping; // exposure, then the sRGB curve: as `lambent render` writes a PNG
    this.renderer.setClearColor(0x000000, 1);
    canvas.addEventListener('webglcontextlost', () =>
      callbacks.onProblem('The graphics card was taken away from this page. The picture returns with it.'),
    );
    // What was drawn into textures is gone.
    canvas.addEventListener('webglcontextrestored', () => (callbacks.onRecovered(), this.changeLight()));
    this.orbit = new Orbit(this.camera, canvas, {
      onChange: () => (this.changeLight(), callbacks.onChange()),
      onUse: (what) => callbacks.onUse(what),
    });
    new ResizeObserver(() => this.invalidate()).observe(canvas);
  }

  /**
   * Takes a loaded file in, in place of the one that was there; throws LambentError where the graphics card cannot draw
   * it.
   */
  setModel(role: 'baked' | 'compare', gltf: GLTF): void {
    const model = new Model(gltf),
      old = this[role];
    model.baked.transfer.check(this.renderer);
    if (old) {
      this.scene.remove(old.root);
      old.dispose();
    }
    this[role] = model;
    this.scene.add(model.root);
    if (role === 'baked') {
      this.animation = undefined;
      this.glyphs.clear();
      if (gltf.animations[0]) {
        const mixer = new AnimationMixer(gltf.scene);
        this.animation = { mixer, action: mixer.clipAction(gltf.animations[0]) };
      }
      new Box3().setFromObject(model.root, true).getBoundingSphere(this.bounds);
    }
    this.changeLight();
  }

  get bakedScene(): BakedScene | undefined {
    return this.baked?.baked;
  }
  get hasAnimation(): boolean {
    return this.animation !== undefined;
  }
  get bands(): number {
    const all = Math.max(1, this.baked?.baked.transfer.order ?? 1);
    return this.order > 0 ? Math.min(this.order, all) : all;
  }

  setEnvironment(environment: EnvironmentFile): void {
    if (this.environment !== environment) this.environment?.background.dispose();
    this.environment = environment;
    this.sky.map.value = environment.background;
    this.changeLight();
  }

  setReference(map: DataTexture): void {
    this.picture.map.value = map;
    this.invalidate();
  }

  /**
   * From the front right and a little above, all of it just in view: the camera of `lambent render --camera auto`
   * (camera_around of core/camera.h) in the canvas as it is now.
   */
  frameAll(): void {
    const root = this.baked?.root;
    if (!root) return;
    root.updateMatrixWorld(true);
    const meshes: Mesh[] = [];
    root.traverse((o) => void ((o as Mesh).isMesh && meshes.push(o as Mesh)));
    const subject = meshes.filter((mesh) => !isGround(mesh));
    this.camera.fov = 35;
    const forward = new Vector3(-0.55, -0.4, -1).normalize(),
      side = new Vector3().crossVectors(forward, new Vector3(0, 1, 0)).normalize(),
      up = new Vector3().crossVectors(side, forward);
    const margin = 0.02,
      tanY = Math.tan((35 * Math.PI) / 360) * (1 - 2 * margin),
      tanX = (tanY * Math.max(1, this.canvas.clientWidth)) / Math.max(1, this.canvas.clientHeight);
    // What bounds the points from the right, the left, above, below, before and behind, in the axes of the view.
    const most = new Array<number>(6).fill(-Infinity),
      point = new Vector3();
    for (const mesh of subject.length ? subject : meshes) {
      const { count } = mesh.geometry.getAttribute('position');
      for (let i = 0; i < count; ++i) {
        mesh.getVertexPosition(i, point).applyMatrix4(mesh.matrixWorld);
        const x = point.dot(side),
          y = point.dot(up),
          z = point.dot(forward);
        [x - tanX * z, -x - tanX * z, y - tanY * z, -y - tanY * z, -z, z].forEach((bound, k) => {
          if (bound > most[k]!) most[k] = bound;
        });
      }
    }
    const [right, left, top, bottom, near, far] = most as [number, number, number, number, number, number];
    if (!(near + far >= 0)) return;
    const z = Math.min(-(right + left) / (2 * tanX), -(top + bottom) / (2 * tanY));
    const eye = new Vector3()
      .addScaledVector(side, (right - left) / 2)
      .addScaledVector(up, (top - bottom) / 2)
      .addScaledVector(forward, z);
    this.orbit.look(eye, eye.clone().addScaledVector(forward, (far - near) / 2 - z));
  }

  /** The light, its order or its window are others now. */
  changeLight(): void {
    this.lightChanged = true;
    this.invalidate();
  }

  play(on: boolean): void {
    const action = this.animation?.action;
    if (!action) return;
    action.paused = !on;
    if (on) action.play();
    this.invalidate();
  }

  /** Stands still at so many seconds into the animation. */
  pose(time: number): void {
    if (!this.animation) return;
    this.animation.action.play();
    this.animation.mixer.setTime(time);
    this.animation.action.paused = true;
    this.invalidate();
  }
  get animationTime(): number | undefined {
    return this.animation?.action.isScheduled() ? this.animation.action.time : undefined;
  }

  get hasLobes(): boolean {
    return this.baked?.baked.transfer.lobesAt !== undefined;
  }
  /**
   * Shows the lobes under a point of the canvas, in pixels, and says what they are; takes them away where there are
   * none.
   */
  pickLobes(x: number, y: number): string | undefined {
    const { canvas, baked } = this,
      ray = new Raycaster();
    if (!baked) return undefined;
    ray.setFromCamera(new Vector2((2 * x) / canvas.clientWidth - 1, 1 - (2 * y) / canvas.clientHeight), this.camera);
    this.invalidate();
    return this.glyphs.pick(baked.baked.transfer, pickVertex(baked.meshes, ray));
  }
  clearLobes(): void {
    this.glyphs.clear();
    this.invalidate();
  }
  /** The lobes that are shown, in words. */
  get lobes(): string | undefined {
    return this.glyphs.describe();
  }

  invalidate(): void {
    if (!this.request) this.request = requestAnimationFrame((now) => this.onFrame(now));
  }

  private onFrame(now: number): void {
    this.request = 0;
    const apart = now - this.lastFrame;
    this.lastFrame = now;
    if (this.animation?.action.isRunning()) {
      this.animation.mixer.update(Math.min(apart, pause) / 1000);
      this.invalidate();
    }
    this.draw();
    if (apart < pause) this.callbacks.onFrame(apart);
  }

  private draw(): void {
    const { renderer, camera, sky } = this;
    this.fitToCanvas();
    if (this.lightChanged) this.relight();
    renderer.toneMappingExposure = 2 ** this.exposure;
    this.gain.value = 2 ** this.exposure / falseColorEnd;
    this.errorGain.value = 2 ** this.exposure / fitErrorEnd;
    sky.turnBack.value.setFromMatrix4(
      new Matrix4().makeRotationFromQuaternion(new Quaternion().copy(this.orbit.light).invert()),
    );
    sky.unproject.value.copy(camera.matrixWorld).multiply(camera.projectionMatrixInverse);
    const ratio = renderer.getPixelRatio(),
      width = this.canvas.width / ratio,
      height = this.canvas.height / ratio;
    const split = Math.round(this.wipe * this.canvas.width) / ratio;
    renderer.setScissorTest(this.against !== undefined);
    if (this.against !== undefined) renderer.setScissor(0, 0, split, height);
    this.drawView(this.view);
    if (this.against === undefined) return;
    renderer.setScissor(split, 0, width - split, height);
    this.drawView(this.against);
  }

  private fitToCanvas(): void {
    const { canvas, camera, bounds } = this;
    const width = Math.max(1, canvas.clientWidth),
      height = Math.max(1, canvas.clientHeight),
      ratio = Math.min(2, window.devicePixelRatio || 1);
    if (canvas.width !== Math.floor(width * ratio) || canvas.height !== Math.floor(height * ratio)) {
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
    }
    const distance = camera.position.distanceTo(bounds.center),
      reach = 1.1 * bounds.radius; // a little more, for what is animated
    camera.aspect = width / height;
    camera.far = distance + reach;
    camera.near = Math.max(distance - reach, 5e-4 * camera.far);
    camera.updateProjectionMatrix();
  }

  private relight(): void {
    const lighting = this.environment?.lighting;
    if (!lighting) return;
    this.lightChanged = false;
    lighting.rotation.copy(this.orbit.light);
    lighting.bands = this.bands;
    lighting.window = this.window;
    this.baked?.relight(lighting);
    this.compare?.relight(lighting);
  }

  private drawView(view: View): void {
    const { renderer, screen } = this;
    renderer.clear();
    if (view === 'reference') {
      const image = this.picture.map.value?.image;
      this.picture.stretch.value = image ? this.camera.aspect / (image.width / image.height) : 1;
      screen.material = this.picture;
      if (image) screen.render(renderer);
      return;
    }
    const shown = view === 'compare' ? this.compare : this.baked;
    for (const model of [this.baked, this.compare]) if (model) model.root.visible = model === shown;
    shown?.wear(
      view === 'compare' ? 'baked' : view,
      this.environment?.lighting,
      this.coefficient,
      this.gain,
      this.errorGain,
    );
    // What shows through surfaces adds up as light does, before the sRGB curve.
    const blends = shown !== undefined && anySeeThrough(shown.meshes);
    if (blends) {
      this.linear.setSize(this.canvas.width, this.canvas.height);
      renderer.setRenderTarget(this.linear);
      renderer.clear();
    }
    if (this.showBackground && this.environment && view !== 'coefficient' && view !== 'error') {
      screen.material = this.sky;
      screen.render(renderer);
    }
    if (!shown) return;
    renderer.render(this.scene, this.camera);
    if (blends) {
      renderer.setRenderTarget(null);
      this.developed.map.value = this.linear.texture;
      screen.material = this.developed;
      screen.render(renderer);
    }
    const glyphs = shown === this.baked ? this.glyphs.place(this.camera) : undefined;
    if (!glyphs) return;
    renderer.clearDepth(); // lobes may point into the surface
    renderer.render(glyphs, this.camera);
  }
}

function isGround(object: Object3D): boolean {
  for (let o: Object3D | null = object; o; o = o.parent) if (o.name === groundName) return true;
  return false;
}
