// The picture: a baked scene, its light and what it is compared with. Draws when something has changed, and only then.
import {
  AnimationMixer,
  Box3,
  HalfFloatType,
  MathUtils,
  Matrix4,
  PerspectiveCamera,
  Quaternion,
  Scene,
  Sphere,
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
import {
  anySeeThrough,
  LambentError,
  type BakedScene,
  type FixedView,
  type IndirectControls,
  type ShWindow,
} from '../src/index.js';
import type { EnvironmentFile } from './loading.js';
import { framed, framedFov } from './framing.js';
import { LobeGlyphs, pickVertex, rayAt } from './lobes.js';
import { bandsOf, Model } from './model.js';
import { fitFixed } from './fixed.js';
import { lightPlain } from './plain.js';
import { Orbit } from './orbit.js';
import { floatType, readFloats } from './read_back.js';
import { DevelopMaterial, PictureMaterial, SkyMaterial } from './screen.js';
import { turnToHeight } from './sky.js';
import type { View } from './state.js';
import type { ViewerCallbacks } from './viewer_callbacks.js';
import { falseColorEnd, falseColorGain, fitErrorEnd } from './false_color.js';
import { Companions } from './companions.js';
import { autoExposure, clampBeforeTone, toneMappings, type Tone } from './tone.js';

const pause = 250; // milliseconds without a frame
const finePause = 250; // after the light has stood still, what is sharp is drawn from all of its texels
const meterPause = 300; // between two measures of the exposure while the light turns
const meterWidth = 128; // pixels
const lightTime = { drawn: 10, alone: 25 }; // milliseconds for lamps that move: beside a picture, without

export class Viewer {
  readonly renderer: WebGLRenderer;
  readonly camera = new PerspectiveCamera(35, 1, 0.1, 100);
  readonly orbit: Orbit;
  view: View = 'baked';
  against: View | undefined;
  wipe = 0.5;
  order = 0; // bands in use; 0: all
  window: ShWindow = 'auto';
  terms = 0; // of wavelets; 0: all
  exposure: number | 'auto' = 'auto';
  tone: Tone = 'neutral';
  showBackground = true;
  coefficient = 3;
  spin = 0; // degrees a second that the light turns about +Y

  private readonly scene = new Scene();
  private readonly sky = new SkyMaterial();
  private readonly reference = new PictureMaterial();
  private readonly developed = new DevelopMaterial();
  private readonly linear = new WebGLRenderTarget(1, 1, { type: HalfFloatType, samples: 4 });
  private readonly screen = new FullScreenQuad(this.sky);
  private readonly gain = { value: 1 }; // of false colour
  private readonly errorGain = { value: 1 };
  private readonly glyphs = new LobeGlyphs();
  /** Of the scene. */
  readonly bounds = new Sphere(new Vector3(), 1);
  readonly companions = new Companions();
  baked: Model | undefined;
  private compare: Model | undefined;
  private plain: Object3D | undefined; // a scene without transfer, in place of `baked`
  private environment: EnvironmentFile | undefined;
  private animation: { mixer: AnimationMixer; action: AnimationAction } | undefined;
  private lightChanged = true;
  private measured = 0; // stops
  private meterDue = true;
  private lastMeter = -Infinity;
  private meterSoon = 0;
  private lastLight = -Infinity;
  private fineSoon = 0;
  private meterTarget: WebGLRenderTarget | undefined;
  private request = 0;
  private isDue = false; // a picture, not light alone
  private lastFrame = 0;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly callbacks: ViewerCallbacks,
  ) {
    clampBeforeTone();
    this.scene.add(this.companions.root);
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
    this.renderer.setClearColor(0x000000, 1);
    canvas.addEventListener('webglcontextlost', () =>
      callbacks.onProblem('The graphics card was taken away from this page. The picture returns with it.'),
    );
    // What was drawn into textures is gone.
    canvas.addEventListener('webglcontextrestored', () => {
      this.indirect?.refresh();
      callbacks.onRecovered();
      this.changeLight();
    });
    this.orbit = new Orbit(this.camera, canvas, {
      onCamera: () => (this.invalidate(), callbacks.onChange()),
      onLight: () => (this.changeLight(), callbacks.onChange()),
      onLift: (degrees) => callbacks.onLift(degrees),
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
    const { indirect } = model.baked.transfer;
    if (indirect) {
      this.renderer.shadowMap.enabled = true;
      this.scene.add(indirect.lights);
    }
    if (role === 'baked') this.takeScene(gltf);
    this.changeLight();
  }

  /** A scene without transfer takes the place of the baked one: three.js's own materials under the environment. */
  setPlain(gltf: GLTF): void {
    if (this.baked) {
      this.scene.remove(this.baked.root);
      this.baked.dispose();
      this.baked = undefined;
    }
    this.takeScene(gltf);
    this.plain = gltf.scene;
    this.scene.add(gltf.scene);
    this.changeLight();
  }

  private takeScene(gltf: GLTF): void {
    this.plain?.traverse((o) => (o as Partial<Mesh>).geometry?.dispose());
    if (this.plain) this.scene.remove(this.plain);
    this.plain = undefined;
    this.animation = undefined;
    this.glyphs.clear();
    if (gltf.animations[0]) {
      const mixer = new AnimationMixer(gltf.scene);
      this.animation = { mixer, action: mixer.clipAction(gltf.animations[0]) };
    }
    this.orbit.isFixed = this.fixedView !== undefined;
    new Box3().setFromObject(gltf.scene, true).getBoundingSphere(this.bounds);
  }

  get bakedScene(): BakedScene | undefined {
    return this.baked?.baked;
  }
  get indirect(): IndirectControls | undefined {
    return this.baked?.baked.transfer.indirect;
  }
  get fixedView(): FixedView | undefined {
    return this.baked?.baked.transfer.view;
  }
  get hasAnimation(): boolean {
    return this.animation !== undefined;
  }
  get bands(): number {
    const all = bandsOf(this.baked?.baked.transfer);
    return this.order > 0 ? Math.min(this.order, all) : all;
  }

  setEnvironment(environment: EnvironmentFile): void {
    if (this.environment !== environment) this.environment?.background.dispose();
    this.environment = environment;
    this.sky.map.value = environment.background;
    this.changeLight();
  }

  setReference(map: DataTexture): void {
    this.reference.map.value = map;
    this.invalidate();
  }

  /** The camera of `lambent render --camera auto`, in the canvas as it is now. */
  frameAll(): void {
    if (this.fixedView) return this.orbit.look(this.fixedView.eye, this.fixedView.target);
    const root = this.baked?.root ?? this.plain,
      { clientWidth, clientHeight } = this.canvas;
    this.camera.fov = framedFov;
    const view = root && framed(root, Math.max(1, clientWidth) / Math.max(1, clientHeight));
    if (view) this.orbit.look(view.eye, view.target);
  }

  /** The light, its order or its window are others now. */
  changeLight(): void {
    this.lightChanged = this.meterDue = true;
    this.invalidate();
  }
  /** Measures the exposure where the camera stands, if it is automatic. */
  measure(): void {
    this.meterDue = true;
    this.lastMeter = -Infinity;
    this.invalidate();
  }
  /** How high above the horizon the environment's brightest texel stands, in degrees; keeps its azimuth when set. */
  get lightHeight(): number {
    return MathUtils.radToDeg(Math.asin(MathUtils.clamp(this.sun.y, -1, 1)));
  }
  set lightHeight(degrees: number) {
    const side = new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0),
      turn = turnToHeight(this.sun, MathUtils.degToRad(degrees - this.lightHeight), side);
    this.orbit.light.premultiply(turn).normalize();
    this.changeLight();
  }
  private get sun(): Vector3 {
    return (this.environment?.sun ?? new Vector3(0, 1, 0)).clone().applyQuaternion(this.orbit.light);
  }
  /** What shines on what faces the camera. */
  get isSunBehindCamera(): boolean {
    return this.sun.dot(this.camera.position.clone().sub(this.orbit.target).setY(0)) >= 0;
  }
  /** Stops in use. */
  get stops(): number {
    return this.exposure === 'auto' ? this.measured : this.exposure;
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
    const { baked } = this;
    if (!baked) return undefined;
    this.invalidate();
    return this.glyphs.pick(baked.baked.transfer, pickVertex(baked.meshes, rayAt(x, y, this.canvas, this.camera)));
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
    this.isDue = true;
    this.askFrame();
  }
  private askFrame(): void {
    if (!this.request) this.request = requestAnimationFrame((now) => this.onFrame(now));
  }

  dispose(): void {
    cancelAnimationFrame(this.request);
    clearTimeout(this.meterSoon);
    clearTimeout(this.fineSoon);
    this.request = -1; // no more are asked for
    for (const model of [this.baked, this.compare]) model?.dispose();
    this.environment?.background.dispose();
    this.linear.dispose();
    this.meterTarget?.dispose();
    this.renderer.dispose();
  }

  /** What is shown, as a PNG. */
  picture(): Promise<Blob | null> {
    this.draw();
    return new Promise((resolve) => this.canvas.toBlob(resolve));
  }

  private onFrame(now: number): void {
    this.request = 0;
    const apart = now - this.lastFrame;
    this.lastFrame = now;
    if (this.animation?.action.isRunning()) {
      this.animation.mixer.update(Math.min(apart, pause) / 1000);
      this.invalidate();
    }
    if (this.spin !== 0) {
      const angle = MathUtils.degToRad((this.spin * Math.min(apart, pause)) / 1000);
      this.orbit.light.premultiply(new Quaternion().setFromAxisAngle(new Vector3(0, 1, 0), angle)).normalize();
      this.changeLight();
    }
    this.findLight();
    if (!this.isDue) return;
    this.isDue = false;
    this.draw();
    if (apart < pause) this.callbacks.onFrame(apart);
  }

  /** What lamps send on, as far as a frame has time for it. */
  private findLight(): void {
    const { indirect } = this;
    if (!indirect) return;
    const more = indirect.update(this.isDue ? lightTime.drawn : lightTime.alone);
    if (indirect.times.count > 0) this.isDue = this.meterDue = true;
    if (more) this.askFrame();
    this.callbacks.onSettled?.(!more);
  }

  private draw(): void {
    this.callbacks.onDraw?.();
    const { renderer, camera, sky } = this;
    this.fitToCanvas();
    if (this.lightChanged) this.relight();
    this.gain.value = falseColorGain(this.exposure) / falseColorEnd;
    this.errorGain.value = falseColorGain(this.exposure) / fitErrorEnd;
    sky.turnBack.value.setFromMatrix4(
      new Matrix4().makeRotationFromQuaternion(new Quaternion().copy(this.orbit.light).invert()),
    );
    sky.unproject.value.copy(camera.matrixWorld).multiply(camera.projectionMatrixInverse);
    if (this.exposure === 'auto' && this.meterDue) this.meter();
    renderer.toneMapping = toneMappings[this.tone];
    renderer.toneMappingExposure = 2 ** this.stops;
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
      // A little more, for what is animated.
      reach = Math.max(1.1 * bounds.radius, this.companions.reach(bounds.center));
    camera.aspect = width / height;
    fitFixed(this.fixedView, camera, this.sky);
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
    for (const of of [this.baked, this.compare])
      if (of?.baked.transfer.terms !== undefined) of.baked.transfer.terms = this.terms;
    // What is put on a cube.
    if ([this.baked, this.compare].some((of) => of && !of.baked.transfer.indirect && of.hasNoBands)) {
      const now = performance.now();
      lighting.quick = now - this.lastLight < finePause;
      this.lastLight = now;
      clearTimeout(this.fineSoon);
      if (lighting.quick) this.fineSoon = window.setTimeout(() => this.changeLight(), finePause + 50);
    }
    this.baked?.relight(lighting);
    this.compare?.relight(lighting);
    this.companions.relight();
    if (this.plain) lightPlain(this.scene, this.environment!.background, this.orbit.light);
  }

  /** A small picture of the surfaces says how bright they are; while the light turns, a few times a second. */
  private meter(): void {
    const { renderer, screen } = this,
      wait = this.lastMeter + meterPause - performance.now();
    clearTimeout(this.meterSoon);
    if (wait > 0) return void (this.meterSoon = window.setTimeout(() => this.invalidate(), wait));
    const type = floatType(renderer);
    if (type === undefined || !this.environment) return;
    const height = Math.min(4 * meterWidth, Math.max(1, Math.round(meterWidth / this.camera.aspect))),
      target = (this.meterTarget ??= new WebGLRenderTarget(meterWidth, height, { type }));
    target.setSize(meterWidth, height);
    const read = (): number[] => readFloats(renderer, target);
    renderer.setRenderTarget(target);
    renderer.setClearColor(0x000000, 0);
    renderer.clear();
    if (this.dress('baked', true) ?? this.plain) renderer.render(this.scene, this.camera);
    let pixels = read();
    if (this.showBackground && !this.indirect && !pixels.some((v, i) => i % 4 === 3 && v >= 0.5)) {
      screen.material = this.sky;
      screen.render(renderer);
      pixels = read();
    }
    renderer.setClearColor(0x000000, 1);
    renderer.setRenderTarget(null);
    this.meterDue = false;
    this.lastMeter = performance.now();
    this.measured = autoExposure(pixels);
    this.callbacks.onMeter(this.measured);
  }

  private drawView(view: View): void {
    const { renderer, screen } = this;
    renderer.clear();
    if (view === 'reference') {
      const image = this.reference.map.value?.image;
      this.reference.stretch.value = image ? this.camera.aspect / (image.width / image.height) : 1;
      screen.material = this.reference;
      if (image) screen.render(renderer);
      return;
    }
    const shown = this.dress(view);
    // What shows through surfaces adds up as light does, before the screen's curves.
    const blends = shown !== undefined && (anySeeThrough(shown.meshes) || this.companions.isSeenThrough);
    if (blends) {
      this.linear.setSize(this.canvas.width, this.canvas.height);
      renderer.setRenderTarget(this.linear);
      renderer.clear();
    }
    if (this.showBackground && this.environment && !this.indirect && view !== 'coefficient' && view !== 'error') {
      screen.material = this.sky;
      screen.render(renderer);
    }
    if (shown ?? this.plain) renderer.render(this.scene, this.camera);
    if (blends) {
      renderer.setRenderTarget(null);
      this.developed.map.value = this.linear.texture;
      screen.material = this.developed;
      screen.render(renderer);
    }
    const glyphs = shown && shown === this.baked ? this.glyphs.place(this.camera) : undefined;
    if (!glyphs) return;
    renderer.clearDepth(); // lobes may point into the surface
    renderer.render(glyphs, this.camera);
  }

  /** Makes the model that a view shows visible, in that view's materials. */
  private dress(view: Exclude<View, 'reference'>, isMeasure = false): Model | undefined {
    const shown = view === 'compare' ? this.compare : this.baked;
    for (const model of [this.baked, this.compare]) if (model) model.root.visible = model === shown;
    if (this.plain) this.plain.visible = !shown;
    this.companions.dress(view, isMeasure);
    shown?.wear(
      view === 'compare' ? 'baked' : view,
      this.environment?.lighting,
      this.coefficient,
      this.gain,
      this.errorGain,
    );
    return shown;
  }
}
