// The page: controls, the wipe, files that are opened or dropped, and every message a user may see.
import { Euler, MathUtils, Vector3 } from 'three';
import { LambentError, NoTransferError, shWindows, type Reflection, type ShWindow } from '../src/index.js';
import {
  loadManifest,
  makeEnvironment,
  mapTexture,
  makeSky,
  readBaked,
  readMap,
  readPlain,
  type Beside,
  type EnvironmentFile,
  type Manifest,
} from './loading.js';
import { bandsOf } from './model.js';
import { get, degrees, hideProblem, input, select, sentence, showLoading, showProblem } from './dom.js';
import { connectHelp, connectLobes, connectWipe } from './hands.js';
import { fetchWhole, openAsItComes } from './incoming.js';
import { InsertControls } from './insert_controls.js';
import { LampControls } from './lamp_controls.js';
import { connectSharing } from './sharing.js';
import { highestSun, lowestSun, parseSky, type Sky } from './sky.js';
import { OverlayControls } from './overlay_controls.js';
import { defaultState, formatState, parseState, viewNames as names, type State, type View } from './state.js';
import { connectRelief, showRelief, wearRelief } from './relief.js';
import { showSurface, takeReflection } from './surface.js';
import { possibleViews, showBands, showFixed, showScale, showTerms, takeTerms } from './kind_controls.js';
import { showFrameTime, showStatistics } from './statistics.js';
import { tones, type Tone } from './tone.js';
import { Viewer } from './viewer.js';

const usualSpin = 12; // degrees a second

class Page {
  private readonly base = defaultState(); // what the address need not say
  private readonly state: State;
  private readonly viewer: Viewer;
  private readonly environments: { name: string; load: () => Promise<EnvironmentFile>; opened?: true }[] = [];
  /** Of the environment in use, where it is a sky: as it stands now. */
  private sky: Sky | undefined;
  private isServed = false; // the scene, and not opened from a file
  private savedSoon = 0;
  private opened = false;
  private readonly lamps: LampControls;
  private readonly inserts: InsertControls;
  private readonly overlays: OverlayControls;

  constructor(private readonly manifest: Manifest | undefined) {
    const { base } = this;
    if (manifest?.camera) base.camera = manifest.camera;
    if (manifest?.rotate) base.rotate = manifest.rotate;
    if (manifest?.exposure !== undefined) base.exposure = manifest.exposure;
    base.tone = tones.find((tone) => tone === manifest?.tone) ?? base.tone;
    this.state = parseState(location.hash, base);
    this.viewer = new Viewer(get<HTMLCanvasElement>('picture'), {
      onFrame: showFrameTime,
      onChange: () => (this.showHeight(), this.saveSoon()),
      onLift: (by) => this.lift(by),
      onUse: (what) => what === 'light' && get('hint').classList.add('gone'),
      onProblem: showProblem,
      onRecovered: hideProblem,
      onMeter: () => this.showExposure(),
      onDraw: () => (this.lamps.place(), this.inserts.place()),
      onSettled: (isSettled) => this.lamps.settled(isSettled),
    });
    this.lamps = new LampControls(this.viewer, (to) => {
      for (const key of ['lamps', 'dark', 'albedos'] as const) delete this.state[key];
      Object.assign(this.state, to);
      this.saveSoon();
    });
    this.inserts = new InsertControls(this.viewer, manifest, (to) => {
      this.state.inserts = to;
      this.saveSoon();
    });
    this.overlays = new OverlayControls(this.viewer, (to) => ((this.state.show = to), this.saveSoon()));
    this.connect();
  }

  async start(): Promise<void> {
    const { manifest, state, viewer } = this;
    for (const { name, file } of manifest?.environments ?? [])
      this.environments.push({ name, load: async () => makeEnvironment(name, readMap(await fetchWhole(name, file))) });
    if (!this.environments.some(({ name }) => parseSky(name)))
      this.environments.push({ name: 'sky', load: () => Promise.resolve(makeSky('sky', parseSky('sky')!)) });
    this.listEnvironments();
    this.setRotation(state.rotate);
    await this.chooseEnvironment(Math.min(state.env, this.environments.length - 1), state.elevation);
    if (!manifest) {
      get('loading').hidden = true;
      get('invitation').hidden = false;
      this.show();
      return;
    }
    const { name, baked, compare } = manifest;
    this.isServed = true;
    await openAsItComes(viewer, name, baked, async (bytes, isAll) => {
      await this.openBaked(name, bytes, baked);
      if (!isAll) this.show();
    });
    if (compare)
      await this.useModel('compare', 'the second file', await fetchWhole('the second file', compare), compare);
    if (manifest.reference)
      viewer.setReference(mapTexture(readMap(await fetchWhole('the reference', manifest.reference))));
    get('loading').hidden = true;
    this.show();
  }

  /** All of the state to controls and viewer. */
  private show(): void {
    const { state, viewer } = this;
    const transfer = viewer.bakedScene?.transfer,
      possible = possibleViews(transfer, this.manifest, viewer.baked?.relief !== undefined);
    if (!possible.includes(state.view)) state.view = 'baked';
    if (state.against && !possible.includes(state.against)) delete state.against;
    const option = (value: string, text: string): HTMLOptionElement => new Option(text, value);
    select('view').replaceChildren(...possible.map((v) => option(v, names[v])));
    select('against').replaceChildren(option('', 'nothing'), ...possible.map((v) => option(v, names[v].toLowerCase())));
    select('window').replaceChildren(...shWindows.map((w) => option(w, w)));
    select('view').value = state.view;
    select('against').value = state.against ?? '';
    select('window').value = state.window;
    const all = bandsOf(transfer),
      columns = transfer?.columns,
      last = (columns ? columns.harmonics + columns.lobes : all * all) - 1;
    if (transfer?.coefficientMaterials) state.coefficient = Math.min(state.coefficient, last);
    input('order').max = String(all);
    input('order').value = String(state.order || all);
    input('coefficient').max = String(last);
    input('coefficient').value = String(state.coefficient);
    select('tone').replaceChildren(...tones.map((tone) => option(tone, tone)));
    select('tone').value = state.tone;
    input('background').checked = state.background;
    input('free').checked = state.free;
    showBands(transfer);
    showTerms(transfer?.terms === undefined ? undefined : state.terms);
    this.lamps.show();
    this.inserts.show();
    this.overlays.show(state.show);
    showFixed(transfer?.view !== undefined);
    const makeSurfaces = (brdf: Reflection): void => {
      state.brdf = takeReflection(transfer!, brdf, viewer.renderer, (error) =>
        showProblem(sentence(document.title, error)),
      );
    };
    if (transfer?.reflection && state.brdf) makeSurfaces(state.brdf);
    showSurface(transfer?.reflection, (to) => (makeSurfaces(to), this.apply()));
    get('play').hidden = !viewer.hasAnimation;
    document.body.classList.toggle('bare', !state.ui);
    this.apply();
  }

  private apply(): void {
    const { state, viewer } = this;
    viewer.view = state.view;
    viewer.against = state.against;
    viewer.wipe = state.wipe;
    viewer.exposure = state.exposure;
    viewer.tone = state.tone;
    const isOtherLight = viewer.order !== state.order || viewer.window !== state.window || viewer.terms !== state.terms;
    viewer.order = state.order;
    viewer.terms = state.terms;
    viewer.window = state.window;
    viewer.coefficient = state.coefficient;
    viewer.showBackground = state.background;
    viewer.spin = state.spin;
    viewer.orbit.free = state.free;
    get('spin').setAttribute('aria-pressed', String(state.spin !== 0));
    if (isOtherLight) viewer.changeLight();
    else viewer.invalidate();
    this.showExposure();
    get('order-value').textContent = `${viewer.bands} of ${bandsOf(viewer.bakedScene?.transfer)}`;
    showScale(state, viewer.bakedScene?.transfer.columns);
    showRelief([state.view, state.against].includes('relief') ? viewer.baked?.relief : undefined);
    const wipe = get('wipe');
    wipe.hidden = !state.against;
    wipe.style.left = `${100 * state.wipe}%`;
    wipe.setAttribute('aria-valuenow', String(Math.round(100 * state.wipe)));
    get('left-name').textContent = names[state.view];
    get('right-name').textContent = state.against ? names[state.against] : '';
    this.saveSoon();
  }

  private showHeight(): void {
    const height = this.sky?.elevation ?? this.viewer.lightHeight,
      [low, high] = this.sky ? [lowestSun, highestSun] : [-90, 90];
    Object.assign(input('height'), { min: String(low), max: String(high), value: String(height) });
    get('height-value').textContent = degrees(height);
  }

  /** Puts a sky's sun elsewhere: the sky is another one then. */
  private raiseSun(elevation: number): void {
    if (!this.sky) return;
    this.sky.elevation = this.state.elevation = MathUtils.clamp(elevation, lowestSun, highestSun);
    this.viewer.setEnvironment(makeSky('', this.sky));
    this.showHeight();
    this.saveSoon();
  }
  /** A hand that goes up by so many degrees; the sun goes with its light on what faces the camera. */
  private lift(by: number): boolean {
    if (!this.sky || this.state.free) return false;
    this.raiseSun(this.sky.elevation + (this.viewer.isSunBehindCamera ? by : -by));
    return true;
  }

  private showExposure(): void {
    const { stops } = this.viewer,
      isAuto = this.state.exposure === 'auto',
      text = `${stops > 0 ? '+' : ''}${stops.toFixed(1)}`.replace('-', '−');
    input('exposure').value = String(stops);
    get('exposure-value').textContent = text;
    get('auto').setAttribute('aria-pressed', String(isAuto));
  }

  private connect(): void {
    const { state, viewer } = this;
    const on = (id: string, event: string, change: () => void): void =>
      get(id).addEventListener(event, () => (change(), this.apply()));
    on('exposure', 'input', () => (state.exposure = Number(input('exposure').value)));
    on('auto', 'click', () => ((state.exposure = 'auto'), viewer.measure()));
    get('height').addEventListener('input', () => {
      const height = Number(input('height').value);
      if (this.sky) return this.raiseSun(height);
      viewer.lightHeight = height;
      get('height-value').textContent = degrees(viewer.lightHeight);
      this.saveSoon();
    });
    on('spin', 'click', () => (state.spin = state.spin ? 0 : usualSpin));
    on('free', 'change', () => (state.free = input('free').checked));
    on('tone', 'change', () => (state.tone = select('tone').value as Tone));
    on(
      'order',
      'input',
      () => (state.order = input('order').value === input('order').max ? 0 : Number(input('order').value)),
    );
    on('terms', 'input', () => showTerms((state.terms = takeTerms())));
    on('window', 'change', () => (state.window = select('window').value as ShWindow));
    on('view', 'change', () => (state.view = select('view').value as View));
    on('against', 'change', () => {
      if (select('against').value) state.against = select('against').value as View;
      else delete state.against;
    });
    on(
      'coefficient',
      'input',
      () =>
        (state.coefficient = MathUtils.clamp(
          Math.floor(Number(input('coefficient').value)) || 0,
          0,
          Number(input('coefficient').max),
        )),
    );
    on('background', 'change', () => (state.background = input('background').checked));
    get('env').addEventListener(
      'change',
      () => void this.attempt('', () => this.chooseEnvironment(select('env').selectedIndex)),
    );
    get('turn').addEventListener('click', () => {
      viewer.orbit.lightFirst = !viewer.orbit.lightFirst;
      get('turn').setAttribute('aria-pressed', String(viewer.orbit.lightFirst));
      get('picture').classList.toggle('light-first', viewer.orbit.lightFirst);
    });
    get('play').addEventListener('click', () => {
      const on = get('play').getAttribute('aria-pressed') !== 'true';
      get('play').setAttribute('aria-pressed', String(on));
      viewer.play(on);
      if (on) delete state.time;
      else if (viewer.animationTime !== undefined) state.time = viewer.animationTime;
      // Not while it plays: a status that changes each frame is noise.
      if (!on) get('lobes').textContent = viewer.lobes ?? '';
      this.saveSoon();
    });
    get('reset-view').addEventListener('click', () => this.setCamera(this.manifest?.camera));
    get('reset-light').addEventListener('click', () => {
      this.setRotation(this.manifest?.rotate ?? [0, 0, 0]);
      const { name } = this.environments[state.env]!;
      if (this.sky) this.raiseSun(parseSky(name)!.elevation);
      delete state.elevation;
    });
    get('problem-close').addEventListener('click', hideProblem);
    get('open').addEventListener('click', () => get('file').click());
    get('file').addEventListener('change', () => {
      this.openFiles([...(input('file').files ?? [])]);
      input('file').value = '';
    });
    for (const event of ['dragenter', 'dragover', 'dragleave', 'drop'])
      addEventListener(
        event,
        (e) => (
          e.preventDefault(),
          document.body.classList.toggle('dropping', event.startsWith('drage') || event === 'dragover')
        ),
      );
    addEventListener('drop', (e) => {
      this.openFiles([...(e.dataTransfer?.files ?? [])]);
    });
    connectWipe(
      () => state.wipe,
      (share) => ((state.wipe = share), this.apply()),
    );
    connectLobes(viewer);
    connectSharing(viewer, () => ({
      name: document.title,
      address: this.saveNow(),
      whole:
        this.isServed &&
        this.inserts.isWhole &&
        !viewer.baked?.relief &&
        this.environments.findIndex((e) => e.opened) < 0,
    }));
    connectHelp();
    connectRelief(
      () => viewer.baked?.relief,
      () => this.apply(),
    );
    // How much of the page's foot the controls cover; later, since what depends on it is observed as well.
    const cover = (): void => {
      const { top } = get('controls').getBoundingClientRect();
      document.documentElement.style.setProperty('--covered', `${Math.round(innerHeight - top) + 8}px`);
    };
    new ResizeObserver(() => requestAnimationFrame(cover)).observe(get('controls'));
    get('controls').addEventListener('submit', (e) => e.preventDefault());
    addEventListener('hashchange', () => {
      if (location.hash !== this.address()) location.reload();
    });
  }

  /** One file, or a .gltf with those that it names. */
  private openFiles(files: readonly File[]): void {
    const file = files.find(({ name }) => /\.gl(b|tf)$/i.test(name)) ?? files[0];
    if (!file) return;
    const isScene = /\.gl(b|tf)$/i.test(file.name);
    // What is wrong with a scene names it already.
    void this.attempt(isScene ? '' : file.name, async () => {
      showLoading(`Reading ${file.name}`);
      const bytes = await file.arrayBuffer();
      if (isScene && (await this.inserts.opened(file.name, bytes, files))) {
        this.saveSoon();
      } else if (isScene) {
        this.isServed = false;
        await this.openBaked(file.name, bytes, files);
        this.show();
      } else if (/\.lpt$/i.test(file.name)) {
        wearRelief(this.viewer, bytes);
        this.state.view = 'relief';
        this.show();
      } else {
        if (this.viewer.indirect) throw new LambentError('is no scene, and lamps alone light this one');
        const environment = makeEnvironment(file.name, readMap(bytes));
        this.environments.push({
          name: file.name,
          load: () => Promise.resolve(makeEnvironment(file.name, readMap(bytes))),
          opened: true,
        });
        this.listEnvironments();
        this.useEnvironment(this.environments.length - 1, environment);
      }
      get('loading').hidden = true;
    });
  }

  private async openBaked(name: string, bytes: ArrayBuffer, beside: Beside): Promise<void> {
    const { viewer } = this,
      first = !this.opened;
    this.opened = true;
    const problem = await this.useScene(name, bytes, beside);
    get('name').textContent = document.title = name;
    get('hint').hidden = false;
    get('invitation').hidden = true;
    get('lobes').textContent = '';
    get('lobes-how').hidden = !viewer.hasLobes;
    this.setCamera(first ? this.state.camera : undefined);
    if (first && this.state.time !== undefined) viewer.pose(this.state.time);
    get('loading').hidden = true;
    this.lamps.take(this.isServed && first ? this.state : {});
    await this.inserts.take(this.isServed ? (first ? this.state.inserts : undefined) : []);
    viewer.measure();
    if (problem) return this.showPlain(problem);
    showStatistics(viewer.bakedScene);
  }

  private async useModel(role: 'baked' | 'compare', name: string, bytes: ArrayBuffer, beside: Beside): Promise<void> {
    try {
      this.viewer.setModel(role, await readBaked(bytes, beside));
    } catch (error) {
      throw new (error instanceof NoTransferError ? NoTransferError : LambentError)(sentence(name, error));
    }
  }

  /** The baked scene of a file; where it holds none, the scene as any viewer has it, and what is to be said of it. */
  private async useScene(name: string, bytes: ArrayBuffer, beside: Beside): Promise<NoTransferError | undefined> {
    try {
      await this.useModel('baked', name, bytes, beside);
      return undefined;
    } catch (error) {
      if (!(error instanceof NoTransferError)) throw error;
      const plain = await readPlain(bytes, beside).catch(() => {
        throw error;
      });
      this.viewer.setPlain(plain);
      return error;
    }
  }

  private showPlain(problem: NoTransferError): void {
    showStatistics();
    showProblem(problem.message);
  }

  private listEnvironments(): void {
    select('env').replaceChildren(...this.environments.map(({ name }, i) => new Option(name, String(i))));
  }

  /** `elevation`: of a sky's sun, where it is another than its name says. */
  private async chooseEnvironment(index: number, elevation?: number): Promise<void> {
    const sky = parseSky(this.environments[index]!.name);
    if (sky && elevation !== undefined) {
      get('loading').hidden = true;
      return this.useEnvironment(index, makeSky('', { ...sky, elevation }), { ...sky, elevation });
    }
    const environment = await this.environments[index]!.load().catch((error: unknown) => {
      throw new LambentError(sentence(this.environments[index]!.name, error));
    });
    get('loading').hidden = true;
    this.useEnvironment(index, environment, sky);
  }

  private useEnvironment(index: number, environment: EnvironmentFile, sky?: Sky): void {
    this.sky = sky;
    if (sky && sky.elevation !== parseSky(this.environments[index]!.name)!.elevation)
      this.state.elevation = sky.elevation;
    else delete this.state.elevation;
    this.state.env = index;
    select('env').selectedIndex = index;
    this.viewer.setEnvironment(environment);
    this.showHeight();
    this.saveSoon();
  }

  private setCamera(camera: number[] | undefined): void {
    if (!camera || this.viewer.fixedView) return this.viewer.frameAll();
    this.viewer.camera.fov = camera[6]!;
    this.viewer.orbit.look(new Vector3().fromArray(camera), new Vector3().fromArray(camera, 3));
  }

  /** Yaw, pitch, roll in degrees, as --env-rotate. */
  private setRotation(degrees: number[]): void {
    const [yaw, pitch, roll] = degrees.map((d) => MathUtils.degToRad(d)) as [number, number, number];
    this.viewer.orbit.light.setFromEuler(new Euler(pitch, yaw, roll, 'YXZ'));
    this.showHeight();
    this.viewer.changeLight();
    this.saveSoon();
  }

  private current(): State {
    const { camera, orbit } = this.viewer,
      turn = new Euler().setFromQuaternion(orbit.light, 'YXZ');
    const state = { ...this.state, rotate: [turn.y, turn.x, turn.z].map((a) => MathUtils.radToDeg(a)) };
    if (this.viewer.fixedView) delete state.camera;
    else state.camera = [...camera.position.toArray(), ...orbit.target.toArray(), camera.fov];
    return state;
  }

  private address(): string {
    const { exposure, tone } = this.base;
    return formatState(this.current(), { ...defaultState(), exposure, tone });
  }

  private saveSoon(): void {
    clearTimeout(this.savedSoon);
    this.savedSoon = window.setTimeout(() => this.saveNow(), 300);
  }
  /** The address with all that is shown. */
  private saveNow(): string {
    if (this.viewer.bakedScene) history.replaceState(null, '', this.address());
    return location.href;
  }

  private async attempt(name: string, work: () => Promise<void>): Promise<void> {
    hideProblem();
    try {
      await work();
    } catch (error) {
      showProblem(sentence(name, error));
    }
  }
}

addEventListener('error', (e) => showProblem(e.message));
addEventListener('unhandledrejection', (e) => showProblem(sentence('', e.reason)));
try {
  await new Page(await loadManifest()).start();
  document.body.dataset['ready'] = 'yes';
} catch (error) {
  showProblem(sentence('', error));
}
