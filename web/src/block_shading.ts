// Light on visibility in blocks: pictures of receivers for meshes that stand as they were baked, and others for those
// that were turned or moved since, which see the light, and are seen, from elsewhere.
import {
  DataTexture,
  FloatType,
  Matrix3,
  Matrix4,
  NearestFilter,
  RGBAFormat,
  Vector3,
  Vector4,
  type Camera,
  type DataArrayTexture,
  type IUniform,
  type Mesh,
  type Object3D,
  type Texture,
  type WebGLRenderer,
} from 'three';
import { BlockLight } from './block_light.js';
import { blockTolerance } from './block_reflection.js';
import { diffuseShader, glossShader, pictureColumns } from './block_shader.js';
import { isSoftware, sumBlocks, type BlockSumOptions } from './block_sum.js';
import { cubeBlocks, type CubeLight } from './cube.js';
import { DrawnPicture } from './light_sum.js';
import type { BlockStanding } from './node_edition.js';
import { Alike, RestPose } from './turned.js';

const upright = new Matrix3();
const flagBytes = (cube: number): number => Math.ceil(cubeBlocks(cube) / 4);

export interface BlocksHeader {
  cube: number;
  bits: number;
  receivers: number;
}

/** A picture of receivers. */
class ReceiverPicture extends DrawnPicture {
  constructor(
    receivers: number,
    fragmentShader: string,
    defines: Record<string, number>,
    uniforms: Record<string, IUniform>,
  ) {
    super(
      Math.min(pictureColumns, receivers),
      Math.ceil(receivers / pictureColumns),
      NearestFilter,
      { size: `has ${receivers.toLocaleString('en')} receivers, which take a texture`, use: 'is shaded' },
      { fragmentShader, defines, uniforms },
      true,
    );
  }
  /** Compiles it with others. */
  define(defines: Record<string, number>): void {
    Object.assign((this.material.defines ??= {}), defines);
    this.material.needsUpdate = true;
  }
}

/** Exit radiance of white: drawn by the graphics card, or summed by the processor. */
class EvenPicture {
  /** What there is now. */
  readonly shown: { value: Texture };
  private table: DataTexture | undefined;
  private isStale = true;

  constructor(
    readonly drawn: ReceiverPicture,
    private readonly options: BlockSumOptions,
  ) {
    this.shown = { value: drawn.target.texture };
  }

  get bytes(): number {
    return this.drawn.bytes;
  }
  refresh(): void {
    this.isStale = true;
    this.drawn.refresh();
  }
  update(renderer: WebGLRenderer): void {
    if (!isSoftware(renderer) && this.drawn.isDrawnBy(renderer)) return this.drawn.update(renderer);
    const { width, height } = this.drawn.target;
    if (!this.table) {
      this.table = new DataTexture(new Float32Array(4 * width * height), width, height, RGBAFormat, FloatType);
      this.shown.value = this.table;
    }
    if (!this.isStale) return;
    this.isStale = false;
    sumBlocks(this.options, this.table.image.data as Float32Array);
    this.table.needsUpdate = true;
  }
  dispose(): void {
    this.drawn.dispose();
    this.table?.dispose();
  }
}

/** What meshes that stand alike are lit by; what they look up in WebGLRenderer. */
class Standing implements BlockStanding {
  readonly light: BlockLight;
  readonly place = new Matrix4();
  version = 0;
  /** Of which light, and of which turn, the light is. */
  of: object | undefined;
  turn = upright;
  readonly even: EvenPicture;
  readonly gloss: ReceiverPicture;
  readonly eye = new Vector3(Infinity, 0, 0);

  constructor({ header: { cube, bits, receivers }, records, begins, sight, places, lobe }: ShadingOptions) {
    this.light = new BlockLight(cube);
    const defines = {
      PRT_BITS: bits,
      PRT_CUBE: cube,
      PRT_BLOCKS: cubeBlocks(cube),
      PRT_FLAG_BYTES: flagBytes(cube),
      PRT_RECEIVERS: receivers,
      PRT_MODEL: 0,
      PRT_TOLERANCE: blockTolerance,
    };
    const { sums, coarse, fine, texels } = this.light,
      uniforms = { prtSight: { value: sight }, prtReceivers: { value: places }, prtBlockSums: sums };
    const diffuse = new ReceiverPicture(receivers, diffuseShader, defines, uniforms);
    this.gloss = new ReceiverPicture(
      receivers,
      glossShader,
      { ...defines },
      {
        ...uniforms,
        prtCoarse: coarse,
        prtFine: fine,
        prtBlockTexels: texels,
        prtEye: { value: this.eye },
        prtColour: lobe.colour,
        prtWidth: lobe.width,
        prtSamples: lobe.samples,
      },
    );
    this.even = new EvenPicture(diffuse, {
      records,
      places: places.image.data as Float32Array,
      begins,
      sums: sums.value.image.data as Float32Array,
      cube,
      bits,
    });
  }

  set(light: CubeLight): void {
    this.light.set(light);
    this.even.refresh();
    this.gloss.refresh();
    ++this.version;
  }
  shine(model: number): void {
    this.light.gloss();
    this.gloss.define({ PRT_MODEL: model });
    this.gloss.refresh();
  }
  dispose(): void {
    this.light.dispose();
    this.even.dispose();
    this.gloss.dispose();
  }
}

interface ShadingOptions {
  header: BlocksHeader;
  records: Uint8Array;
  begins: Float64Array;
  sight: DataArrayTexture;
  places: DataTexture;
  lobe: { colour: { value: number }; width: { value: number }; samples: { value: Vector4 } };
}

/** Light on meshes as they were baked, and on those that were turned since. */
export class BlockShading {
  readonly main: Standing;
  /** For shaders: what is drawn next. */
  readonly even: { value: Texture };
  readonly shine: { value: Texture };
  private readonly pose: RestPose;
  private readonly others: Alike<Standing>;
  private light: ((turn?: Matrix3) => CubeLight) | undefined;
  private model = 0;

  constructor(options: ShadingOptions, meshes: readonly Mesh[]) {
    this.main = new Standing(options);
    this.even = { value: this.main.even.shown.value };
    this.shine = { value: this.main.gloss.target.texture };
    this.pose = new RestPose(meshes);
    this.others = new Alike(() => {
      const made = new Standing(options);
      if (this.model > 0) made.shine(this.model);
      return made;
    });
  }

  set(light: (turn?: Matrix3) => CubeLight): void {
    this.light = light;
    this.main.set(light());
  }
  /** 0 where nothing shines. */
  setModel(model: number): void {
    this.model = model;
    if (model > 0) for (const stands of [this.main, ...this.others.all]) stands.shine(model);
  }

  /** How a mesh is lit. What has only been moved is lit as it was baked, but a lobe is seen from elsewhere. */
  standing(object?: Object3D): Standing {
    const { main, light, model, pose } = this,
      turn = object && pose.turnOf(object),
      place = object && (turn || model > 0) ? pose.placeOf(object) : undefined;
    if (!object || !light || !place) return main;
    const { made } = this.others.get(object, place.elements),
      now = turn ?? upright;
    made.place.copy(place);
    if (made.of === light && made.turn.equals(now)) return made;
    made.set(light(turn));
    made.of = light;
    made.turn = now.clone();
    return made;
  }

  /** Before `object` is drawn. */
  update(renderer: WebGLRenderer, camera: Camera, object: Object3D): void {
    const stands = this.standing(object);
    stands.even.update(renderer);
    if (this.model > 0) {
      const now = new Vector3().setFromMatrixPosition(camera.matrixWorld).applyMatrix4(stands.place);
      if (!now.equals(stands.eye)) {
        stands.eye.copy(now);
        stands.gloss.refresh();
      }
      stands.gloss.update(renderer);
    }
    const even = stands.even.shown.value,
      shine = stands.gloss.target.texture;
    if (this.even.value === even && this.shine.value === shine) return;
    this.even.value = even;
    this.shine.value = shine;
    renderer.state.useProgram(null!); // else meshes of one material, one after another, keep the first one's values
  }

  dispose(): void {
    for (const stands of [this.main, ...this.others.all]) stands.dispose();
    this.others.clear();
  }
}
