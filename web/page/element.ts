// <lambent-viewer src="scene.glb" env="sky:elevation=20">: a baked scene in anybody's page, of one file that asks for
// no other (docs/web.md). Attributes are spelt as the options of `lambent view`.
import { Euler, MathUtils, Vector3 } from 'three';
import { LambentError } from '../src/index.js';
import type { FirstPart, Progress } from '../src/progressive.js';
import { takeLamps } from './lamps.js';
import {
  fetchFile,
  firstAlone,
  makeEnvironment,
  makeSky,
  readBaked,
  readMap,
  type EnvironmentFile,
} from './loading.js';
import { defaultState, parseState, type State } from './state.js';
import { parseSky } from './sky.js';
import { Viewer } from './viewer.js';

const sheet = `
:host { display: block; position: relative; aspect-ratio: 4 / 3; overflow: hidden; background: #0c0d10; }
:host([hidden]) { display: none; }
canvas { position: absolute; inset: 0; width: 100%; height: 100%; touch-action: pan-y; cursor: grab; outline: none; }
canvas:focus-visible { outline: 2px solid #8ab8ff; outline-offset: -3px; }
p { position: absolute; inset: auto 0 0 0; margin: 0; padding: 0.4em 0.8em; font: 15px/1.4 system-ui, sans-serif;
  color: #eceff3; background: #16181c; }
p:empty { display: none; }`;

/** What the address of the page may hold, an element has as attributes. */
const ofState = [
  'camera',
  'rotate',
  'exposure',
  'tone',
  'spin',
  'background',
  'order',
  'window',
  'brdf',
  'terms',
] as const;
/** Several, apart by semicolons: each of the address's. */
const lists = { lamps: 'lamp', albedos: 'albedo' } as const;

export class LambentViewer extends HTMLElement {
  static readonly observedAttributes = ['src', 'env', 'alt', ...ofState, ...Object.keys(lists)];
  private readonly canvas = document.createElement('canvas');
  private readonly words = document.createElement('p');
  private viewer: Viewer | undefined;
  private shown: { src?: string | null; env?: string | null } = {};
  private due = false;

  constructor() {
    super();
    const root = this.attachShadow({ mode: 'open' }),
      style = new CSSStyleSheet(); // which no content security policy has a say in
    style.replaceSync(sheet);
    root.adoptedStyleSheets = [style];
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute('role', 'img');
    this.words.setAttribute('role', 'status');
    root.append(this.canvas, this.words);
  }

  connectedCallback(): void {
    this.update();
  }
  disconnectedCallback(): void {
    this.viewer?.dispose();
    this.viewer = undefined;
    this.shown = {};
    // A canvas gives its context once.
    const fresh = this.canvas.cloneNode() as HTMLCanvasElement;
    this.canvas.replaceWith(fresh);
    Object.assign(this, { canvas: fresh });
  }
  attributeChangedCallback(): void {
    this.update();
  }

  /** Once for all attributes that change together. */
  private update(): void {
    if (this.due) return;
    this.due = true;
    queueMicrotask(() => {
      this.due = false;
      if (this.isConnected) void this.show();
    });
  }

  private say(text: string): void {
    this.words.textContent = text;
  }

  private async show(): Promise<void> {
    const seen = this.getAttribute('alt') ?? 'A scene in light that turns',
      how = 'Drag or use the arrow keys to look around; with Shift, to turn the light.';
    this.canvas.setAttribute('aria-label', `${seen}. ${how}`);
    try {
      this.viewer ??= this.makeViewer();
      const { viewer } = this,
        src = this.getAttribute('src'),
        env = this.getAttribute('env') ?? 'sky',
        state = this.stateOf();
      if (src === null) throw new LambentError('lambent-viewer has no src, the address of a baked file');
      const isNewScene = this.shown.src !== src,
        isNewLight = this.shown.env !== env;
      this.shown = { src, env };
      const [scene, light] = await Promise.all([
        isNewScene
          ? this.fetch(src, false)
              .then(async ({ bytes, ...more }) => ({ ...more, gltf: await readBaked(bytes, src) }))
              .catch(named(src))
          : undefined,
        isNewLight ? this.environment(env).catch(named(env)) : undefined,
      ]);
      if (viewer !== this.viewer || this.shown.src !== src || this.shown.env !== env) return; // others came meanwhile
      Object.assign(viewer, {
        exposure: state.exposure,
        tone: state.tone,
        order: state.order,
        window: state.window,
        terms: state.terms,
        spin: state.spin,
        showBackground: state.background,
      });
      if (light) viewer.setEnvironment(light);
      if (scene) viewer.setModel('baked', scene.gltf);
      const transfer = viewer.bakedScene?.transfer;
      if (transfer?.reflection) transfer.reflection = state.brdf ?? { model: 'diffuse' };
      if (viewer.indirect) takeLamps(viewer.indirect, state);
      const [yaw, pitch, roll] = state.rotate.map((d) => MathUtils.degToRad(d)) as [number, number, number];
      viewer.orbit.light.setFromEuler(new Euler(pitch, yaw, roll, 'YXZ'));
      if (state.camera && !viewer.fixedView) {
        viewer.camera.fov = state.camera[6]!;
        viewer.orbit.look(new Vector3().fromArray(state.camera), new Vector3().fromArray(state.camera, 3));
      } else if (scene) viewer.frameAll();
      viewer.changeLight();
      viewer.measure();
      if (scene?.rest && !(await this.refine(viewer, src, scene))) return;
      this.say('');
      this.dispatchEvent(new Event('load'));
    } catch (error) {
      this.say(error instanceof Error ? error.message : String(error));
      this.dispatchEvent(new Event('error'));
    }
  }

  /** As the page reads them from its address; what cannot be read is as if it were not there. */
  private stateOf(): State {
    const from = new URLSearchParams();
    for (const name of ofState) {
      const value = this.getAttribute(name);
      if (value !== null) from.set(name, value);
    }
    for (const [attribute, name] of Object.entries(lists)) {
      const texts = this.getAttribute(attribute);
      if (texts === null) continue;
      for (const text of texts.split(';')) from.append(name, text.trim());
    }
    return parseState(from.toString(), defaultState());
  }

  private makeViewer(): Viewer {
    const viewer = new Viewer(this.canvas, {
      onFrame: () => undefined,
      onChange: () => undefined,
      onLift: () => false,
      onUse: () => undefined,
      onProblem: (message) => this.say(message),
      onRecovered: () => this.say(''),
      onMeter: () => undefined,
    });
    viewer.orbit.wheelZooms = false; // the wheel scrolls the page that this is a part of
    return viewer;
  }

  private fetch(path: string, whole = true): Promise<FirstPart> {
    const say: Progress = (_, share) => this.say(share > 0 ? `Loading: ${Math.round(100 * share)} %` : 'Loading');
    return fetchFile(path, say, whole);
  }

  /** The bands that come after the first picture; whether it is still what is shown. */
  private async refine(viewer: Viewer, src: string, { bands, rest }: Omit<FirstPart, 'bytes'>): Promise<boolean> {
    const scene = viewer.bakedScene!;
    this.dispatchEvent(new Event('first'));
    const isShown = (): boolean => viewer === this.viewer && viewer.bakedScene === scene;
    try {
      const values = await rest!;
      if (!isShown()) return false;
      scene.refine(values);
    } catch (error) {
      if (!isShown()) return false;
      throw new LambentError(`${src} ${firstAlone(error, bands!, scene.transfer.order).message}`);
    }
    viewer.changeLight();
    viewer.measure();
    return true;
  }

  private async environment(env: string): Promise<EnvironmentFile> {
    const sky = parseSky(env);
    if (sky) return makeSky(env, sky);
    if (env === 'sky' || env.startsWith('sky:'))
      throw new LambentError('is no sky: elevation, azimuth, turbidity, ground and sun are its keys');
    return makeEnvironment(env, readMap((await this.fetch(env)).bytes));
  }
}

/** An error that says whose it is. */
const named =
  (name: string) =>
  (error: unknown): never => {
    throw new LambentError(`${name} ${error instanceof Error ? error.message : String(error)}`);
  };

if (!customElements.get('lambent-viewer')) customElements.define('lambent-viewer', LambentViewer);
