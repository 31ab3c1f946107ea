// T . light of wavelets, by the processor, when the light changes: a texture that meshes look up, and one more for
// those that were turned as one since the bake.
import {
  DataTexture,
  FloatType,
  NearestFilter,
  RGBAFormat,
  type Matrix3,
  type Object3D,
  type Texture,
  type WebGLRenderer,
} from 'three';
import type { CubeLight } from './cube.js';
import { haarOfLight, type HaarColumns } from './haar.js';
import { noReceiver } from './header.js';
import { sumColumns, type ShownSums } from './shown_sums.js';
import { Alike, type RestPose } from './turned.js';

/** A light, or what it is in the axes of what was turned. */
export type Cubes = (turn?: Matrix3) => CubeLight;

/** The receiver of each texel of an atlas, none where there is none. */
export interface Atlas {
  width: number;
  height: number;
  map: Uint32Array;
}

interface Table {
  texture: DataTexture;
  /** Which light it shows, of which turn. */
  version: number;
  how: readonly number[];
}

const asBaked: readonly number[] = [];

export class HaarSums implements ShownSums {
  readonly rest: { value: Texture };
  readonly peaks: { value: Texture };
  readonly hasPeaks = false;
  /** For nodes: that of what stands as it was baked. */
  readonly main: Table;
  /** Terms of the light that were used last. */
  used = 0;
  private readonly turned: Alike<Table>;
  private cubes: Cubes | undefined;
  private count = 0;
  private bytes = Infinity;
  private version = 0;
  private readonly scratch: Float32Array | undefined;

  constructor(
    private readonly columns: HaarColumns,
    private readonly atlas: Atlas | undefined,
    private readonly pose: RestPose,
  ) {
    const { receivers } = columns,
      width = atlas?.width ?? Math.min(sumColumns, receivers),
      height = atlas?.height ?? Math.ceil(receivers / sumColumns);
    const make = (): Table => {
      const texture = new DataTexture(new Float32Array(4 * width * height), width, height, RGBAFormat, FloatType);
      texture.name = 'lambent wavelets';
      texture.minFilter = texture.magFilter = NearestFilter;
      texture.needsUpdate = true;
      return { texture, version: -1, how: asBaked };
    };
    if (atlas) this.scratch = new Float32Array(4 * receivers);
    this.main = make();
    this.turned = new Alike(make);
    this.rest = { value: this.main.texture };
    this.peaks = { value: this.main.texture };
  }

  get size(): { width: number; height: number } {
    return this.main.texture.image;
  }

  /** `count` of the light's terms (0: all), of these as many as have `bytes` of columns; counts at the next draw. */
  set(cubes: Cubes, count: number, bytes: number): void {
    this.cubes = cubes;
    this.count = count;
    this.bytes = bytes;
    ++this.version;
  }

  /** What `object` is to look up, summed. */
  of(object: Object3D): DataTexture {
    const turn = this.pose.turnOf(object);
    if (!turn) return this.sumUp(this.main, asBaked);
    const { how, made } = this.turned.get(object, turn.elements);
    return this.sumUp(made, how, turn);
  }

  private sumUp(table: Table, how: readonly number[], turn?: Matrix3): DataTexture {
    const { columns, cubes, atlas, scratch, version } = this;
    if (!cubes || (table.version === version && table.how === how)) return table.texture;
    const terms = columns.terms(haarOfLight(cubes(turn)), this.count, this.bytes),
      data = table.texture.image.data as Float32Array;
    columns.sum(terms, scratch ?? data);
    if (atlas)
      atlas.map.forEach((r, i) => {
        if (r !== noReceiver) for (let c = 0; c < 3; ++c) data[4 * i + c] = scratch![4 * r + c]!;
      });
    Object.assign(table, { version, how });
    this.used = terms.count;
    table.texture.needsUpdate = true;
    return table.texture;
  }

  update(renderer: WebGLRenderer, object: Object3D): void {
    const texture = this.of(object);
    if (this.rest.value === texture) return;
    this.rest.value = texture;
    renderer.state.useProgram(null!); // else meshes of one material, one after another, keep the first one's values
  }

  dispose(): void {
    for (const { texture } of [this.main, ...this.turned.all]) texture.dispose();
    this.turned.clear();
  }
}
