// The analytic clear sky of `--env sky:…`, made in the page as its sun moves (src/lambent/light/sky.cpp, in its units
// and by its numbers). Preetham, Shirley and Smits 1999, "A practical analytic model for daylight": the sky's
// distribution (appendix A.2) in the form of Perez et al. 1993, the sun's attenuation (appendix A.1) with Iqbal's
// absorption data. Relative air mass: Kasten 1966.
import { Quaternion, Vector3 } from 'three';
import { texelSolidAngle, type LatLongMap } from '../src/index.js';

export interface Sky {
  /** Degrees of the sun above the horizon, -2 to 90; from +X towards +Z. */
  elevation: number;
  azimuth: number;
  /** Haze, 1.7 to 10. */
  turbidity: number;
  /** Albedo of the ground. */
  ground: number;
  sun: boolean;
}
export const lowestSun = -2,
  highestSun = 90;
const defaults: Sky = { elevation: 35, azimuth: 45, turbidity: 3, ground: 0.2, sun: true };

/** Of "sky:elevation=35,…" as the command line has it; undefined where that is none, or out of range. */
export function parseSky(name: string): Sky | undefined {
  if (name !== 'sky' && !name.startsWith('sky:')) return undefined;
  const sky: Sky = { ...defaults };
  for (const item of name.slice(4).split(',').filter(Boolean)) {
    const [key, value] = item.split('=') as [string, string | undefined];
    if (key === 'sun' && (value === 'on' || value === 'off')) sky.sun = value === 'on';
    else if (key === 'elevation' || key === 'azimuth' || key === 'turbidity' || key === 'ground')
      sky[key] = Number(value);
    else if (key !== 'width') return undefined;
  }
  const { elevation, azimuth, turbidity, ground } = sky;
  const isSky =
    elevation >= lowestSun &&
    elevation <= highestSun &&
    Number.isFinite(azimuth) &&
    turbidity >= 1.7 &&
    turbidity <= 10 &&
    ground >= 0 &&
    ground <= 1;
  return isSky ? sky : undefined;
}

type Triple = [number, number, number];
const radians = (degrees: number): number => (degrees * Math.PI) / 180;
const sunRadius = radians(0.533 / 2),
  unit = 10000; // cd/m^2

const rec709 = ([x, y, z]: Triple): Triple => [
  Math.max(0, 3.2409699 * x - 1.5373832 * y - 0.4986108 * z),
  Math.max(0, -0.9692436 * x + 1.8759675 * y + 0.0415551 * z),
  Math.max(0, 0.0556301 * x - 0.203977 * y + 1.0569715 * z),
];

/** Wyman, Sloan and Shirley 2013, "Simple analytic approximations to the CIE XYZ color matching functions". */
function matching(nm: number): Triple {
  const lobe = (height: number, centre: number, below: number, above: number): number =>
    height * Math.exp(-0.5 * ((nm - centre) / (nm < centre ? below : above)) ** 2);
  return [
    lobe(1.056, 599.8, 37.9, 31) + lobe(0.362, 442, 16, 26.7) + lobe(-0.065, 501.1, 20.4, 26.2),
    lobe(0.821, 568.8, 46.9, 40.5) + lobe(0.286, 530.9, 16.3, 31.1),
    lobe(1.217, 437, 11.8, 36) + lobe(0.681, 459, 26, 13.8),
  ];
}

// From 380 nm by 10: radiance of the sun outside the atmosphere, W / (cm^2 um sr); absorption of ozone, where there is
// any, and of [water, mixed gases].
const sunRadiance = [
  1655, 1623, 2112, 2588, 2582, 2423, 2676, 2966, 3054, 3006, 3066, 2883, 2871, 2782, 2710, 2723, 2636, 2550, 2506,
  2531, 2535, 2513, 2463, 2417, 2368, 2321, 2282, 2234, 2197, 2153, 2110, 2073, 2024, 1987, 1943, 1907, 1863, 1826,
  1788, 1751, 1714,
];
const ozone = [
  0, 0, 0, 0, 0, 0, 0, 0.003, 0.006, 0.009, 0.014, 0.021, 0.03, 0.04, 0.048, 0.063, 0.075, 0.085, 0.103, 0.12, 0.12,
  0.115, 0.125, 0.12, 0.105, 0.09, 0.079, 0.067, 0.057, 0.048, 0.036, 0.028, 0.023, 0.018, 0.014, 0.011, 0.01, 0.009,
  0.007, 0.004, 0,
];
const water = [0.016, 0.024, 0.0125, 1, 0.87, 0.061, 0.001, 1e-5, 1e-5, 6e-4]; // from 690 nm
const gases = [3, 0.21]; // from 760 nm

/** Irradiance on a plane that faces the sun. */
export function sunIrradiance(elevation: number, turbidity: number): Triple {
  const zenith = Math.min(90 - elevation, 90),
    mass = 1 / (Math.cos(radians(zenith)) + 0.15 * (93.885 - zenith) ** -1.253),
    beta = 0.04608 * turbidity - 0.04586,
    solidAngle = 2 * Math.PI * (1 - Math.cos(sunRadius)),
    xyz: Triple = [0, 0, 0];
  sunRadiance.forEach((radiance, i) => {
    const nm = 380 + 10 * i,
      um = nm / 1000,
      wet = 2 * (water[i - 31] ?? 0) * mass,
      gas = (gases[i - 38] ?? 0) * mass;
    const passes = Math.exp(
      -0.008735 * um ** -4.08 * mass -
        beta * um ** -1.3 * mass -
        ozone[i]! * 0.35 * mass -
        (1.41 * gas) / (1 + 118.93 * gas) ** 0.45 -
        (0.2385 * wet) / (1 + 20.07 * wet) ** 0.45,
    );
    // From W / (cm^2 um) to W / (m^2 nm), and to lumens.
    matching(nm).forEach((v, k) => (xyz[k]! += (v * radiance * passes * 10 * 10 * solidAngle * 683) / unit));
  });
  return rec709(xyz);
}

type Perez = readonly [number, number, number, number, number];
const perez = (c: Perez, theta: number, gamma: number): number =>
  (1 + c[0] * Math.exp(c[1] / Math.max(Math.cos(theta), 1e-4))) *
  (1 + c[2] * Math.exp(c[3] * gamma) + c[4] * Math.cos(gamma) ** 2);

/** Radiance of the sky by its angles from the zenith and from the sun. */
function skyRadiance(elevation: number, turbidity: number): (theta: number, gamma: number) => Triple {
  const T = Math.max(turbidity, 2),
    s = radians(90 - Math.max(elevation, 0)),
    line = (...rows: [number, number][]): Perez => rows.map(([a, b]) => a * T + b) as unknown as Perez;
  const Y = line([0.1787, -1.463], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.067, 0.3703]),
    x = line([-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]),
    y = line([-0.0167, -0.2608], [-0.095, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]);
  const chi = (4 / 9 - T / 120) * (Math.PI - 2 * s),
    twilight = Math.exp(Math.min(elevation, 0) / 1.5);
  const zenithY = twilight * Math.max(0, 1000 * ((4.0453 * T - 4.971) * Math.tan(chi) - 0.2155 * T + 2.4192));
  const cubic = (...rows: [number, number, number, number][]): number =>
    rows.reduce((sum, [a, b, c, d], i) => sum + T ** (2 - i) * (((a * s + b) * s + c) * s + d), 0);
  const zenithX = cubic(
    [0.00166, -0.00375, 0.00209, 0],
    [-0.02903, 0.06377, -0.03202, 0.00394],
    [0.11693, -0.21196, 0.06052, 0.25886],
  );
  const zenithy = cubic(
    [0.00275, -0.0061, 0.00317, 0],
    [-0.04214, 0.0897, -0.04153, 0.00516],
    [0.15346, -0.26756, 0.0667, 0.26688],
  );
  const scale = { Y: zenithY / perez(Y, 0, s), x: zenithX / perez(x, 0, s), y: zenithy / perez(y, 0, s) };
  const within = (v: number): number => Math.min(0.7, Math.max(0.05, v));
  return (theta, gamma) => {
    const Yd = Math.max(0, scale.Y * perez(Y, theta, gamma)) / unit,
      xd = within(scale.x * perez(x, theta, gamma)),
      yd = within(scale.y * perez(y, theta, gamma));
    return rec709([(xd / yd) * Yd, Yd, ((1 - xd - yd) / yd) * Yd]);
  };
}

/** Towards the sun. */
export function sunDirection({ elevation, azimuth }: Sky): Triple {
  const e = radians(elevation),
    a = radians(azimuth);
  return [Math.cos(e) * Math.cos(a), Math.sin(e), Math.cos(e) * Math.sin(a)];
}

/** The map of a sky, sun and ground, twice as wide as high. */
export function skyMap(sky: Sky, width = 512): LatLongMap {
  const height = width / 2,
    horizon = height / 2,
    data = new Float32Array(3 * width * height),
    seen = sunDirection({ ...sky, elevation: Math.max(0, sky.elevation) }),
    radiance = skyRadiance(sky.elevation, sky.turbidity),
    ground = [0, 0, 0];
  for (let j = 0; j < horizon; ++j) {
    const theta = (Math.PI * (j + 0.5)) / height;
    for (let i = 0; i < width; ++i) {
      const phi = 2 * Math.PI * ((i + 0.5) / width - 0.5);
      const towards = Math.sin(theta) * (Math.cos(phi) * seen[0] + Math.sin(phi) * seen[2]) + Math.cos(theta) * seen[1];
      data.set(radiance(theta, Math.acos(Math.min(1, Math.max(-1, towards)))), 3 * (j * width + i));
    }
  }
  if (sky.sun)
    addSun({ data, width, height, channels: 3 }, sunDirection(sky), sunIrradiance(sky.elevation, sky.turbidity));
  for (let j = 0; j < horizon; ++j) {
    const weight = texelSolidAngle(j, width, height) * Math.cos((Math.PI * (j + 0.5)) / height);
    for (let i = 0; i < width; ++i)
      for (let c = 0; c < 3; ++c) ground[c]! += (weight * sky.ground * data[3 * (j * width + i) + c]!) / Math.PI;
  }
  for (let i = horizon * width; i < height * width; ++i) data.set(ground, 3 * i);
  return { data, width, height, channels: 3 };
}

/** Points of equal solid angle over the disc give their share of the irradiance to the texels that they fall in. */
function addSun({ data, width, height }: LatLongMap & { data: Float32Array }, sun: Triple, irradiance: Triple): void {
  const count = 4096;
  // Any two axes across the sun.
  const [x, y, z] = sun,
    flat = Math.hypot(x, z),
    aside: Triple = flat > 1e-6 ? [z / flat, 0, -x / flat] : [1, 0, 0],
    up: Triple = [y * aside[2] - z * aside[1], z * aside[0] - x * aside[2], x * aside[1] - y * aside[0]];
  for (let k = 0; k < count; ++k) {
    // A spiral by the golden angle.
    const angle = 2 * Math.asin(Math.sqrt((k + 0.5) / count) * Math.sin(sunRadius / 2)),
      around = k * Math.PI * (3 - Math.sqrt(5)),
      [u, v] = [Math.sin(angle) * Math.cos(around), Math.sin(angle) * Math.sin(around)];
    const d = sun.map((s, c) => Math.cos(angle) * s + u * aside[c]! + v * up[c]!) as Triple;
    if (d[1] <= 0) continue;
    const i = Math.min(width - 1, Math.floor((Math.atan2(d[2], d[0]) / (2 * Math.PI) + 0.5) * width)),
      j = Math.min(height / 2 - 1, Math.floor((Math.atan2(Math.hypot(d[0], d[2]), d[1]) / Math.PI) * height)),
      share = 1 / count / texelSolidAngle(j, width, height);
    for (let c = 0; c < 3; ++c) data[3 * (j * width + i) + c]! += irradiance[c]! * share;
  }
}

/** Lifts what stands towards `sun` by an angle, about what is level beside it; about `side` where it stands upright. */
export function turnToHeight(sun: Vector3, angle: number, side: Vector3): Quaternion {
  const axis = sun.clone().cross(new Vector3(0, 1, 0));
  if (axis.length() < 1e-6) axis.copy(side);
  return new Quaternion().setFromAxisAngle(axis.normalize(), angle);
}
