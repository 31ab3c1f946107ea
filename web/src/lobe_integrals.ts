// Integrals of a lat-long map of radiance against lobes of light that may stand anywhere, as light/project.h has them.
// Of a broad lobe by the map's harmonics, which are summed once: 2 pi I_l times the band's value at its axis
// (Funk-Hecke), so that a light that turns costs as many products as harmonics count. Of a sharp one, which would take
// too many bands, by the texels that it reaches, Gauss nodes in each.
import { reducedMap } from './cube.js';
import {
  gaussLegendre,
  lobeAt,
  lobeReach,
  lobeScale,
  type LightLobe,
  type LobeBasis,
  type LobeKind,
} from './light_basis.js';
import { projectAboutPole, type LatLongMap } from './projection.js';
import { evaluateSh, shBand, shCount, tabledOrder } from './sh.js';

/** What of a lobe's squared norm bands are to leave out, and may: compact ones fall off slowly. */
const [enough, most] = [1e-9, 2e-6];
/** Texels around the equator of a map whose harmonics are summed. */
const widest = 2048;

/** Gauss nodes across `width` radians about 0: as many as a lobe of this sharpness takes to a part in 10^4. */
function nodesAcross(width: number, sharpness: number): { x: number; weight: number }[] {
  const ratio = width * Math.sqrt(sharpness),
    pieces = Math.max(1, Math.ceil(ratio)),
    count = ratio < 1 / 32 ? 1 : ratio < 0.25 ? 2 : 4;
  return Array.from({ length: pieces }, (_, i) =>
    gaussLegendre(count, width * (i / pieces - 0.5), width * ((i + 1) / pieces - 0.5)),
  ).flat();
}

/** A lobe's share of each band, 2 pi I_l of unit norm; undefined where the tabled bands do not hold it. */
function shares(basis: LobeBasis, sharpness: number): Float64Array | undefined {
  const I = basis.momentsOf(sharpness),
    scale = lobeScale(basis.kind, sharpness);
  let rest = 1,
    bands = 0;
  for (; bands < tabledOrder && rest > enough; ++bands)
    rest -= Math.PI * (2 * bands + 1) * (scale * (I[bands] ?? 0)) ** 2;
  return rest > most ? undefined : I.slice(0, bands).map((v) => 2 * Math.PI * scale * v);
}

export class LobeIntegrals {
  private harmonics: Float64Array | undefined;
  private readonly sharesOf = new Map<number, Float64Array | undefined>();

  constructor(
    private readonly map: LatLongMap,
    private readonly basis: LobeBasis,
  ) {
    for (const { sharpness } of basis.lobes)
      if (!this.sharesOf.has(sharpness)) this.sharesOf.set(sharpness, shares(basis, sharpness));
  }

  /** [lobe][3], of lobes of unit norm about axes of the map's. */
  about(axes: readonly (readonly [number, number, number])[]): Float64Array {
    const out = new Float64Array(3 * axes.length),
      bands = Math.max(0, ...[...this.sharesOf.values()].map((share) => share?.length ?? 0)),
      y = new Float64Array(shCount(bands));
    if (bands > 0) this.harmonics ??= projectAboutPole(reducedMap(this.map, widest), bands);
    axes.forEach(([x, up, z], k) => {
      const { sharpness } = this.basis.lobes[k]!,
        share = this.sharesOf.get(sharpness),
        to = out.subarray(3 * k, 3 * k + 3);
      if (!share) return overTexels(this.map, this.basis.kind, { axis: [x, up, z], sharpness }, to);
      evaluateSh(share.length, z, x, up, y); // the map's pole is +Y
      for (let i = 0; i < shCount(share.length); ++i) {
        const f = share[shBand(i)]! * y[i]!;
        for (let c = 0; c < 3; ++c) to[c]! += f * this.harmonics![3 * i + c]!;
      }
    });
    return out;
  }
}

/** The integral of a map against a lobe of unit norm, added to three channels. */
export function overTexels(
  { data, width, height, channels }: LatLongMap,
  kind: LobeKind,
  { axis, sharpness: s }: LightLobe,
  out: Float64Array,
): void {
  const reach = lobeReach(kind, s),
    row = Math.PI / height,
    column = (2 * Math.PI) / width,
    toPole = Math.acos(Math.min(1, Math.max(-1, axis[1]))),
    azimuth = Math.atan2(axis[2], axis[0]),
    equatorial = Math.hypot(axis[0], axis[2]),
    inRow = nodesAcross(row, s),
    scale = lobeScale(kind, s),
    value =
      kind === 'von_mises_fisher'
        ? (cosine: number): number => Math.exp(s * (cosine - 1))
        : (cosine: number): number => lobeAt(kind, s, cosine);
  const first = Math.max(0, Math.floor((toPole - reach) / row - 1)),
    last = Math.min(height - 1, Math.ceil((toPole + reach) / row + 1));
  for (let y = first; y <= last; ++y) {
    const theta = row * (y + 0.5),
      widest = Math.sin(Math.min(theta + 0.5 * row, Math.max(theta - 0.5 * row, Math.PI / 2))),
      latitudes = inRow.map(({ x, weight }) => ({
        cos: axis[1] * Math.cos(theta + x),
        sin: Math.sin(theta + x),
        weight: scale * weight * Math.sin(theta + x),
      })),
      across = nodesAcross(column * widest, s);
    // How far from the lobe's meridian texels of this row are within reach.
    const beyond = reach + 0.5 * Math.hypot(row, column * widest),
      flat = equatorial * Math.sin(theta),
      least = beyond < Math.PI ? (Math.cos(beyond) - axis[1] * Math.cos(theta)) / Math.max(flat, 1e-12) : -1;
    if (least > 1) continue;
    const far = least <= -1 ? Math.PI : Math.acos(least),
      middle = (azimuth + Math.PI) / column - 0.5,
      half = Math.min(far / column + 1, width / 2);
    for (let i = Math.ceil(middle - half), n = 0; i <= middle + half && n < width; ++i, ++n) {
      const x = ((i % width) + width) % width,
        phi = column * (i + 0.5) - Math.PI - azimuth;
      let sum = 0;
      for (const a of across) {
        const c = equatorial * Math.cos(phi + a.x / widest);
        let inner = 0;
        for (const t of latitudes) inner += t.weight * value(t.cos + c * t.sin);
        sum += (a.weight / widest) * inner;
      }
      for (let c = 0; c < 3; ++c) {
        const radiance = data[(y * width + x) * channels + c]!;
        if (radiance > 0 && radiance < Infinity) out[c]! += radiance * sum;
      }
    }
  }
}
