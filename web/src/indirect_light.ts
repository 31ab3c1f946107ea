// Lamps and paint of one scene -> indirect light at its receivers, frame by frame (docs/indirect.md, "What is done for
// a frame"): only lamps that have moved are looked for with rays, and bounces go on from the light of the frame before.
import { IndirectSolve } from './indirect_solve.js';
import type { IndirectOperator } from './indirect_file.js';
import { GlowLight, LampLight, LeafLight, type Glow } from './leaf_light.js';
import { LeafPlaces, type SceneTriangles } from './leaf_places.js';
import { isSamePlace, placeLamp, whyNoLamp, type Lamp, type PlacedLamp, type Rgb } from './moving_lamps.js';
import { LambentError } from './errors.js';
import { Rays } from './rays.js';

const coarse = 1e-2, // of the bounces, while something moves
  exact = 1e-3,
  mostBounces = 64,
  rest = 200, // milliseconds after which nothing moves any more
  share = 0.5; // of a frame's time for rays

/** A light of the scene's own that stands: placed, with its name and what it gives. */
export interface OwnLamp {
  name: string;
  placed: PlacedLamp;
  color: Rgb;
}

/** What the last update() took, in milliseconds. */
export interface IndirectTimes {
  rays: number;
  bounces: number;
  reading: number;
  /** Bounces in it. */
  count: number;
}

/** Light that has bounced; direct light that is read off surfels. */
export interface LightParts {
  bounced: boolean;
  soft: boolean;
}

export class IndirectLight {
  /** Light at receivers, [receiver][4], the fourth not used; exit radiance of white. */
  readonly values: Float32Array;
  /** Counts up whenever `values` are others. */
  version = 0;
  readonly times: IndirectTimes = { rays: 0, bounces: 0, reading: 0, count: 0 };
  /** Of names of the scene's own lamps, what scales them. */
  readonly scales = new Map<string, Rgb>();
  private readonly rays: Rays;
  private readonly leaves: LeafLight;
  private readonly solve: IndirectSolve;
  private readonly direct: Float32Array; // at leaves
  private lamps: { lamp: Lamp; light: LampLight }[] = [];
  private readonly own: { lamp: OwnLamp; light: LampLight }[];
  private readonly glows: GlowLight[];
  private readonly soft: Float32Array | undefined; // of gathering surfels: straight from what glows
  private readonly albedos: Float32Array;
  private isDirectDue = true;
  private isPaintDue = false;
  private isRead = false;
  private parts: LightParts = { bounced: true, soft: true };
  private lastChange = -Infinity;

  /** `sharp`: of `own`, those that pixels draw; what others send straight is read off surfels, as that of `glows`. */
  constructor(
    readonly operator: IndirectOperator,
    scene: SceneTriangles,
    own: readonly OwnLamp[] = [],
    glows: readonly Glow[] = [],
    private readonly sharp = Infinity,
  ) {
    const { surfels, receivers, gathering } = operator,
      leaves = surfels.areas.length;
    this.rays = new Rays(scene.positions);
    this.leaves = new LeafLight(new LeafPlaces(this.rays, scene, surfels), surfels.positions);
    this.solve = new IndirectSolve(operator);
    this.direct = new Float32Array(3 * leaves);
    this.values = new Float32Array(4 * receivers);
    this.albedos = surfels.albedos.slice();
    this.own = own.map((lamp) => ({ lamp, light: new LampLight(this.leaves, lamp.placed) }));
    this.glows = glows.map((glow, i) => new GlowLight(this.leaves, glow, 0x57111 + i));
    if (glows.length > 0 || own.length > sharp) this.soft = new Float32Array(3 * gathering);
    for (const { name } of [...own, ...glows]) this.scales.set(name, [1, 1, 1]);
  }

  /** Lamps as they are now; what stands where it stood takes no ray. Throws LambentError at one that cannot be. */
  setLamps(lamps: readonly Lamp[]): void {
    for (const lamp of lamps) {
      const why = whyNoLamp(lamp);
      if (why !== undefined) throw new LambentError(`a lamp ${why}`);
    }
    const old = this.lamps;
    this.lamps = lamps.map((given, i) => {
      const lamp: Lamp = { ...given, numbers: [...given.numbers], color: [...given.color] },
        placed = placeLamp(lamp);
      // The same one, or one that has moved up in the list.
      const known = old.find((o, j) => j >= i && isSamePlace(placeLamp(o.lamp), placed)) ?? old[i];
      const light = known?.light ?? new LampLight(this.leaves, placed);
      const taken = known && old.indexOf(known);
      if (taken !== undefined) old[taken] = { lamp, light: new LampLight(this.leaves, placed) };
      light.move(placed);
      return { lamp, light };
    });
    this.touch();
  }

  /** Scales a name of the scene's own lamps; 0 turns it off. */
  setOwn(name: string, scale: Rgb): void {
    if (!this.scales.has(name)) throw new LambentError(`the scene has no lamp "${name}"`);
    this.scales.set(name, scale);
    this.touch();
  }

  /** Repaints a material; undefined: as it was baked. */
  setAlbedo(name: string, color: Rgb | undefined): void {
    const { names, materials, albedos } = this.operator.surfels;
    for (let i = 0; i < materials.length; ++i)
      if (names[materials[i]!] === name) this.albedos.set(color ?? albedos.subarray(3 * i, 3 * i + 3), 3 * i);
    this.isPaintDue = true;
    this.touch();
  }

  private touch(): void {
    this.isDirectDue = true;
    this.lastChange = performance.now();
  }

  /** With colours that they have now; those that are read off surfels are not among `sharp` ones. */
  private shining(sharp = false): { light: LampLight; color: Rgb }[] {
    return [
      ...this.lamps.filter(({ lamp }) => !lamp.off).map(({ lamp, light }) => ({ light, color: lamp.color })),
      ...this.own
        .slice(0, sharp ? this.sharp : undefined)
        .map(({ lamp, light }) => ({
          light,
          color: lamp.color.map((c, k) => c * this.scales.get(lamp.name)![k]!) as Rgb,
        })),
    ].filter(({ color }) => Math.max(...color) > 0);
  }

  /**
   * Works for about so many milliseconds, one bounce at least where one is due. Whether there is more to do.
   * `restless`: as if nothing moved, however short ago something did.
   */
  update(budget: number, restless = false): boolean {
    const begin = performance.now(),
      isStill = restless || begin - this.lastChange > rest,
      shining = this.shining(),
      { times } = this;
    const until = begin + share * budget;
    const isCoarse = shining.some(({ light }) => light.isCoarse);
    for (const { light } of shining)
      if (!isCoarse || light.isCoarse) this.isDirectDue = light.go(until, isStill) || this.isDirectDue;
    if (!isCoarse) for (const glow of this.glows) this.isDirectDue = glow.go(until) || this.isDirectDue;
    const isLit = shining.every(({ light }) => light.isDone) && this.glows.every((glow) => glow.isDone);
    times.rays = performance.now() - begin;
    if (this.isPaintDue) this.solve.paint(this.albedos);
    if (this.isDirectDue) this.sumDirect(this.shining(true));
    this.isDirectDue = this.isPaintDue = false;
    const { solve } = this,
      tolerance = isLit ? exact : coarse;
    const bouncing = performance.now();
    times.count = 0;
    while (solve.residual > tolerance && solve.bounces < mostBounces) {
      solve.step(this.direct);
      ++times.count;
      if (performance.now() - begin > budget) break;
    }
    const reading = performance.now();
    times.bounces = reading - bouncing;
    if (times.count > 0 || !this.isRead) {
      this.read();
    }
    times.reading = performance.now() - reading;
    return !isLit || (solve.residual > tolerance && solve.bounces < mostBounces);
  }

  /** What receivers are to have. */
  show(parts: LightParts): void {
    const { bounced, soft } = this.parts;
    if (bounced === parts.bounced && soft === parts.soft) return;
    this.parts = parts;
    if (this.isRead) this.read();
  }
  private read(): void {
    const { parts, solve, soft } = this;
    let light = solve.x;
    if (!parts.bounced) light = soft && parts.soft ? soft : new Float32Array(solve.x.length);
    else if (soft && parts.soft) light = light.map((v, i) => v + soft[i]!);
    solve.read(this.values, light);
    this.isRead = true;
    ++this.version;
  }

  /** All that there is to do. */
  settle(): void {
    while (this.update(1e9, true)) continue;
  }

  private sumDirect(shining: { light: LampLight; color: Rgb }[]): void {
    const { direct, solve } = this;
    direct.fill(0);
    for (const {
      light: { light },
      color: [red, green, blue],
    } of shining)
      for (let i = 0; i < light.length; ++i) {
        direct[3 * i]! += red * light[i]!;
        direct[3 * i + 1]! += green * light[i]!;
        direct[3 * i + 2]! += blue * light[i]!;
      }
    this.addGlow();
    solve.restart();
  }

  private addGlow(): void {
    const { direct, soft, operator } = this;
    if (!soft) return;
    const glowing = new Float32Array(direct.length);
    for (const { lamp, light } of this.own.slice(this.sharp)) {
      const scale = this.scales.get(lamp.name)!;
      for (let i = 0; i < direct.length; ++i)
        glowing[i]! += lamp.color[i % 3]! * scale[i % 3]! * light.light[Math.floor(i / 3)]!;
    }
    for (const { light, glow } of this.glows) {
      const scale = this.scales.get(glow.name)!;
      for (let i = 0; i < light.length; ++i) glowing[i]! += scale[i % 3]! * light[i]!;
    }
    for (let i = 0; i < direct.length; ++i) direct[i]! += glowing[i]!;
    const { areas } = operator.surfels,
      sums = new Float32Array(operator.gathering);
    soft.fill(0);
    for (let i = 0; i < areas.length; ++i) {
      const g = this.solve.gatheringOf(i);
      sums[g]! += areas[i]!;
      for (let c = 0; c < 3; ++c) soft[3 * g + c]! += areas[i]! * glowing[3 * i + c]!;
    }
    for (let i = 0; i < soft.length; ++i) soft[i]! /= sums[Math.floor(i / 3)]!;
  }
}
