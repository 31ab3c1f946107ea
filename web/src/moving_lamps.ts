// Lamps that move: named, placed, and what of them arrives at a surface (pipeline/moving_lamps.h; docs/indirect.md,
// "Lamps"). A lamp's text is that of --lamp.
import { LambentError } from './errors.js';
import { frameAbout, hash, sobolOwen } from './keyed_random.js';
import type { Rays } from './rays.js';

export type Rgb = [red: number, green: number, blue: number];
export const lampKinds = ['point', 'sphere', 'spot', 'sun'] as const;
export type LampKind = (typeof lampKinds)[number];

/** Of a lamp's text, in its order. */
export const lampNumbers: Record<LampKind, readonly string[]> = {
  point: ['X', 'Y', 'Z'],
  sphere: ['X', 'Y', 'Z', 'radius'],
  spot: ['X', 'Y', 'Z', 'towards X', 'towards Y', 'towards Z', 'angle'],
  sun: ['azimuth', 'elevation'],
};

export interface Lamp {
  kind: LampKind;
  /** As lampNumbers names them; angles in degrees. */
  numbers: number[];
  /** Flux per steradian of points and spots, radiance of spheres, irradiance by suns. */
  color: Rgb;
  /** Switched off it gives no light. */
  off?: boolean;
}

const syntax =
  'sphere@X,Y,Z,RADIUS=R,G,B, point@X,Y,Z=R,G,B, spot@X,Y,Z,TX,TY,TZ,ANGLE=R,G,B or sun@AZIMUTH,ELEVATION=R,G,B';

/** Why a lamp cannot be; undefined where it can. */
export function whyNoLamp({ kind, numbers: n, color }: Lamp): string | undefined {
  if (n.length !== lampNumbers[kind].length || !n.every((x) => Math.abs(x) <= 1e9))
    return `is no ${kind} of ${lampNumbers[kind].length} numbers within 1e9`;
  if (color.length !== 3 || !color.every((c) => c >= 0 && c <= 1e12)) return 'has no colour from 0 to 1e12';
  if (kind === 'sun' && Math.abs(n[1]!) > 90) return 'has an elevation beyond -90 to 90 degrees';
  if (kind === 'sphere' && !(n[3]! > 0)) return 'has no radius above 0';
  if (kind !== 'spot') return undefined;
  if (n[0] === n[3] && n[1] === n[4] && n[2] === n[5]) return 'shines at where it stands';
  return n[6]! > 0 && n[6]! <= 90 ? undefined : 'has no angle above 0 and up to 90 degrees';
}

/** NAME=R,G,B or NAME=GREY. */
export function parseNamedColor(text: string): { name: string; color: Rgb } | undefined {
  const at = text.lastIndexOf('='),
    list = text.slice(at + 1).split(','),
    values = list.map(Number);
  if (at < 1 || list.some((t) => t.trim() === '') || !values.every((v) => Number.isFinite(v) && v >= 0))
    return undefined;
  const [r, g, b] = values.length === 1 ? [values[0], values[0], values[0]] : values;
  return values.length === 1 || values.length === 3 ? { name: text.slice(0, at), color: [r!, g!, b!] } : undefined;
}

export const namesLamp = (text: string): boolean => lampKinds.some((kind) => text.startsWith(`${kind}@`));

/** Throws LambentError at what is none. */
export function parseLamp(text: string): Lamp {
  const named = parseNamedColor(text),
    [kind, list = ''] = (named?.name ?? '').split('@') as [LampKind, string?];
  const lamp = named &&
    lampKinds.includes(kind) && {
      kind,
      numbers: list.split(',').map((t) => (t.trim() === '' ? NaN : Number(t))),
      color: named.color,
    };
  if (!lamp) throw new LambentError(`a lamp is ${syntax}, not "${text}"`);
  const why = whyNoLamp(lamp);
  if (why !== undefined) throw new LambentError(`lamp "${text}" ${why}`);
  return lamp;
}
const short = (x: number, digits: number): string => String(Number(x.toPrecision(digits)));
export const formatColor = (color: Rgb): string => color.map((c) => short(c, 6)).join(',');
export const formatLamp = ({ kind, numbers, color }: Lamp): string =>
  `${kind}@${numbers.map((n) => short(n, 9)).join(',')}=${formatColor(color)}`;

/** Where a lamp stands and how it shines, without its colour. */
export interface PlacedLamp {
  kind: LampKind;
  place: Rgb;
  /** The way its light goes, of spots and suns. */
  direction: Rgb;
  radius: number;
  cosOuter: number;
  cosInner: number;
}

export function placeLamp({ kind, numbers: n }: Lamp): PlacedLamp {
  const placed: PlacedLamp = { kind, place: [0, 0, 0], direction: [0, -1, 0], radius: 0, cosOuter: -1, cosInner: -1 };
  if (kind === 'sun') {
    const [azimuth, elevation] = n.map((d) => (d * Math.PI) / 180) as [number, number];
    placed.direction = [
      -Math.cos(elevation) * Math.cos(azimuth),
      -Math.sin(elevation),
      -Math.cos(elevation) * Math.sin(azimuth),
    ];
    return placed;
  }
  placed.place = [n[0]!, n[1]!, n[2]!];
  if (kind === 'sphere') placed.radius = n[3]!;
  if (kind === 'spot') {
    const way = [n[3]! - n[0]!, n[4]! - n[1]!, n[5]! - n[2]!] as Rgb,
      length = Math.hypot(...way),
      angle = (n[6]! * Math.PI) / 180;
    placed.direction = way.map((w) => w / length) as Rgb;
    placed.cosOuter = Math.cos(angle);
    placed.cosInner = Math.cos(angle / 2);
  }
  return placed;
}

export const isSamePlace = (a: PlacedLamp, b: PlacedLamp): boolean =>
  a.kind === b.kind &&
  a.radius === b.radius &&
  a.cosOuter === b.cosOuter &&
  a.cosInner === b.cosInner &&
  a.place.every((p, i) => p === b.place[i]) &&
  a.direction.every((d, i) => d === b.direction[i]);

const frame = new Float64Array(6),
  point: [number, number] = [0, 0];

/**
 * Exit radiance of a white surface at (x, y, z), which is clear of it, by a lamp of colour 1. Spheres are sampled by
 * solid angle, `samples` times, by numbers keyed by `key`.
 */
export function directLight(
  rays: Rays,
  { kind, place, direction, radius, cosOuter, cosInner }: PlacedLamp,
  x: number,
  y: number,
  z: number,
  nx: number,
  ny: number,
  nz: number,
  samples: number,
  key: number,
): number {
  if (kind === 'sun') {
    const facing = -(nx * direction[0] + ny * direction[1] + nz * direction[2]);
    if (!(facing > 0) || rays.meets(x, y, z, -direction[0], -direction[1], -direction[2], Infinity)) return 0;
    return facing / Math.PI;
  }
  const wx = place[0] - x,
    wy = place[1] - y,
    wz = place[2] - z,
    far = Math.hypot(wx, wy, wz);
  if (!(far > radius)) return 0;
  const ax = wx / far,
    ay = wy / far,
    az = wz / far,
    facing = nx * ax + ny * ay + nz * az;
  if (kind !== 'sphere') {
    if (!(facing > 0)) return 0;
    let share = 1;
    if (kind === 'spot') {
      const cosine = -(ax * direction[0] + ay * direction[1] + az * direction[2]);
      share = Math.min(Math.max((cosine - cosOuter) / Math.max(cosInner - cosOuter, 1e-4), 0), 1) ** 2;
      if (share === 0) return 0;
    }
    return rays.meets(x, y, z, ax, ay, az, far) ? 0 : (share * facing) / (Math.PI * far * far);
  }
  // A sphere fills a cone of directions; 1 - its cosine, by the squared sine where that is small.
  const sine = radius / far,
    depth = (sine * sine) / (1 + Math.sqrt(Math.max(1 - sine * sine, 0)));
  if (facing < -sine) return 0;
  frameAbout(ax, ay, az, frame);
  let sum = 0;
  for (let s = 0; s < samples; ++s) {
    sobolOwen(s, key, point);
    const down = point[0] * depth,
      turn = 2 * Math.PI * point[1],
      out = Math.sqrt(Math.max(down * (2 - down), 0)),
      a = out * Math.cos(turn),
      b = out * Math.sin(turn),
      c = 1 - down;
    const dx = a * frame[0]! + b * frame[3]! + c * ax,
      dy = a * frame[1]! + b * frame[4]! + c * ay,
      dz = a * frame[2]! + b * frame[5]! + c * az,
      cosine = nx * dx + ny * dy + nz * dz;
    if (!(cosine > 0)) continue;
    const reach = far * c - Math.sqrt(Math.max(radius * radius - far * far * out * out, 0));
    if (!rays.meets(x, y, z, dx, dy, dz, reach)) sum += cosine;
  }
  return (2 * depth * sum) / samples;
}

export const keyOf = (leaf: number, place: number): number => hash(leaf, place);
