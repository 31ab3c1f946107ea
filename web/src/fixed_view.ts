// A fixed view (docs/file-format.md): receivers are the pixels of a picture. A rectangle of that shape shows it, where
// the camera that was baked sees it fill the picture; it is the file's only mesh, and a program may place it elsewhere.
import {
  DataTexture,
  FloatType,
  Float32BufferAttribute,
  MathUtils,
  Mesh,
  MeshBasicMaterial,
  NearestFilter,
  PlaneGeometry,
  RedFormat,
  Vector3,
  type Material,
} from 'three';
import { TransferValues } from './block_texture.js';
import { LambentError } from './errors.js';
import { isIndex, isViews } from './glb.js';
import { bandsOfLight, columnsOf, readHeader, type TransferHeader } from './header.js';
import type { BakedTransfer, TransferSource } from './kinds.js';
import type { Lighting } from './lighting.js';
import { afterAll } from './light_sum.js';
import { checkNodes, isNodeRenderer, setNodes, withoutNodes, type NodeSum, type Renderer } from './node_edition.js';
import { ShownMaterial, type ShownOver } from './shown_material.js';
import { RestPose, TurnedSums } from './turned.js';
import { VertexSums } from './vertex_sum.js';

const maxSide = 65536; // of a picture

/** The camera that was baked in, +Y up. */
export interface FixedView {
  /** Pixels. */
  readonly width: number;
  readonly height: number;
  readonly eye: Vector3;
  readonly target: Vector3;
  /** Of the picture's height, degrees. */
  readonly fov: number;
}

export interface FixedPicture {
  view: FixedView;
  mesh: Mesh;
  over: Extract<ShownOver, { at: 'view' }>;
}

function readCamera(given: unknown, receivers: number): FixedView {
  const { width, height, eye, target, fov } = (given ?? {}) as Record<string, unknown>;
  if (!isIndex(width, maxSide) || !isIndex(height, maxSide) || width < 1 || height < 1)
    throw new LambentError('the size of the fixed view is out of range');
  if (width * height !== receivers) throw new LambentError('the fixed view has not as many pixels as receivers');
  const point = (of: unknown): Vector3 => {
    if (!Array.isArray(of) || of.length !== 3 || !of.every((x) => typeof x === 'number' && Math.abs(x) < 1e30))
      throw new LambentError('the fixed view has no place that its camera looks from, or at');
    return new Vector3().fromArray(of as number[]);
  };
  if (typeof fov !== 'number' || !(fov > 0 && fov < 180)) throw new LambentError('"fov" is out of range');
  const view = { width, height, eye: point(eye), target: point(target), fov };
  if (!(view.eye.distanceTo(view.target) > 0)) throw new LambentError('the camera of the fixed view looks nowhere');
  return view;
}

/** One high, facing +Z, its corners at the picture's. */
function rectangle({ width, height, eye, target, fov }: FixedView): Mesh {
  const geometry = new PlaneGeometry(width / height, 1),
    mesh = new Mesh(geometry, new MeshBasicMaterial()),
    distance = eye.distanceTo(target);
  geometry.setAttribute('lambentPlace', new Float32BufferAttribute([0, 0, width, 0, 0, height, width, height], 2));
  mesh.name = 'fixed view';
  mesh.position.copy(target);
  mesh.scale.setScalar(2 * distance * Math.tan(MathUtils.degToRad(fov) / 2));
  mesh.lookAt(eye);
  return mesh;
}

/** Puts the picture in the place of the file's scene, which is for viewers that do not know ours. */
export async function readFixedView(source: TransferSource, receivers: number): Promise<FixedPicture> {
  const view = readCamera(source.extension.view, receivers),
    { coverage } = source.extension.view as { coverage: unknown },
    { width, height } = view;
  if (source.extension.parts.length > 0) throw new LambentError('holds a fixed view, and surfaces beside it');
  if (!isViews(coverage)) throw new LambentError('the fixed view has no "coverage"');
  const bytes = await source.bufferView(coverage);
  if (bytes.byteLength !== 4 * receivers) throw new LambentError('the fixed view does not have one coverage a pixel');
  const covered = new Float32Array(bytes);
  for (const c of covered) if (!(c >= 0 && c <= 1)) throw new LambentError("a pixel's coverage is out of range");
  const texture = new DataTexture(covered, width, height, RedFormat, FloatType),
    mesh = rectangle(view);
  texture.name = 'lambent coverage';
  texture.minFilter = texture.magFilter = NearestFilter;
  texture.needsUpdate = true;
  (mesh.material as Material).transparent = covered.some((c) => c < 1);
  source.showInstead(mesh);
  return { view, mesh, over: { at: 'view', twoSided: false, width, height, coverage: texture } };
}

/** Dense transfer of a fixed view: rows of a pixel in three channels, its colour included. */
class ViewTransfer implements BakedTransfer {
  readonly kind = 'diffuse';
  readonly isDiffuse = false; // lights of a program would light what is painted
  readonly order: number;
  readonly columns: BakedTransfer['columns'];
  readonly channels: 1 | 3;
  readonly receivers: number;
  readonly fileBytes: number;
  readonly gpuBytes: number;
  readonly meshes: Mesh[];
  readonly view: FixedView;
  private readonly values: TransferValues;
  private readonly sums: TurnedSums<VertexSums>;
  private readonly sum: NodeSum | undefined;
  private readonly refusal: string | undefined;
  private readonly material: ShownMaterial;
  private readonly ofCoefficients = new Set<TurnedSums<VertexSums>>();

  constructor(
    private readonly light: TransferHeader,
    values: ArrayBuffer,
    private readonly picture: FixedPicture,
    private readonly source: TransferSource,
  ) {
    const { mesh, over, view } = picture,
      { nodes } = source;
    this.order = bandsOfLight(light);
    this.columns = columnsOf(light);
    this.channels = light.channels;
    this.receivers = light.receivers;
    this.fileBytes = values.byteLength;
    this.values = new TransferValues({ ...light, count: light.columns }, values, source.firstBands);
    this.meshes = [mesh];
    this.view = view;
    this.sums = this.makeSums();
    this.sum = this.makeNodes();
    this.refusal = nodes ? undefined : withoutNodes;
    this.gpuBytes = this.values.data.byteLength + this.sums.main.bytes + 4 * light.receivers + (this.sum?.bytes ?? 0);
    this.material = new ShownMaterial(this.sums, over, mesh.material as Material);
    setNodes(this.material, nodes?.shown(this.sum!, over), `The baked scene ${withoutNodes}.`);
    mesh.material = this.material;
  }

  private makeSums(): TurnedSums<VertexSums> {
    const { channels, receivers } = this,
      { order } = this.light,
      { layout, texture: transfer } = this.values;
    return new TurnedSums(() => new VertexSums({ layout, channels, transfer, receivers }), order);
  }
  private makeNodes(): NodeSum | undefined {
    const { channels, receivers } = this,
      { order } = this.light,
      { layout, texture: transfer } = this.values;
    return this.source.nodes?.sum({ layout, transfer, channels, receivers, order, pose: new RestPose([]) });
  }

  check(renderer: Renderer): void {
    if (isNodeRenderer(renderer)) return checkNodes(renderer, this.refusal);
    this.sums.main.check(renderer);
    const { width, height } = this.view;
    if (Math.max(width, height) > renderer.capabilities.maxTextureSize)
      throw new LambentError(
        `is a picture of ${width} x ${height}, where this graphics card takes ${renderer.capabilities.maxTextureSize}`,
      );
  }

  relight(lighting: Lighting): void {
    const { rest, peaks } = lighting.of(this.light, false, this.firstBands);
    this.sums.set(rest, peaks);
    this.sum?.set(rest, peaks, true);
  }

  get firstBands(): number | undefined {
    return this.values.firstBands;
  }
  refine(values: ArrayBuffer): void {
    this.values.refine(values);
  }

  coefficientMaterials(index: number, gain: { value: number }): Material[] {
    const light = new Float64Array(3 * this.light.columns).fill(1, 3 * index, 3 * index + 3),
      { over } = this.picture,
      { nodes } = this.source,
      sums = this.makeSums(),
      sum = this.makeNodes();
    sums.set(light, undefined);
    sum?.set(light, undefined, false);
    this.ofCoefficients.add(sums);
    const made = new ShownMaterial(sums, over, this.material, gain);
    setNodes(made, nodes?.falseColor(nodes.shown(sum!, over), gain), `The view ${withoutNodes}.`);
    afterAll([made], () => (this.ofCoefficients.delete(sums), sums.dispose(), sum?.dispose()));
    return [made];
  }

  dispose(): void {
    for (const sums of [this.sums, ...this.ofCoefficients]) sums.dispose();
    this.sum?.dispose();
    this.values.texture.dispose();
    this.picture.over.coverage.dispose();
    this.material.dispose();
    for (const mesh of this.meshes) mesh.geometry.dispose();
  }
}

export async function loadFixedView(source: TransferSource): Promise<BakedTransfer> {
  const header = readHeader(source.extension, 'view'),
    values = await source.bufferView(header.bufferView);
  return new ViewTransfer(header, values, await readFixedView(source, header.receivers), source);
}
