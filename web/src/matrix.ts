// Transfer matrices (docs/matrices.md; docs/file-format.md, kind "matrix"): radiance = sum over rows (a(wo) + colour
// b(wo)) X, X = T . light. X is drawn into a picture when the light changes (light_sum.ts); each frame the vertex
// shader weighs its rows by the view, in the frame of its receiver: by a look-up in the material's map (map, svd), or
// by harmonics of the outgoing direction.
//
// Budget a receiver: the transfer (packed as in block_texture.ts: rows * channels * ceil(order^2 / 4) * 8 bytes in half
// floats), 8 bytes a row for X, 32 for its frame and map; and 8 bytes a row and node of each map, 4 bytes a vertex (8
// where surfaces have two sides).
import {
  MeshBasicMaterial,
  NearestFilter,
  type DataArrayTexture,
  type Material,
  type Mesh,
  type WebGLProgramParametersWithUniforms,
} from 'three';
import { TransferValues, type BlockLayout } from './block_texture.js';
import { readStored, type StoredValues } from './clusters.js';
import { LambentError } from './errors.js';
import { bandsOfLight, columnsOf, readHeader, type TransferHeader } from './header.js';
import { glslInstances } from './instanced.js';
import { limits, type BakedTransfer, type TransferKind, type TransferSource } from './kinds.js';
import type { Lighting } from './lighting.js';
import { afterAll, LightSum, LightSums, setPeaks } from './light_sum.js';
import {
  checkReflection,
  glossFragmentDeclarations,
  glossVaryings,
  glossVertexBody,
  glslReflect,
  loadLastReflection,
  readOutgoing,
  reflectionBytes,
  reflectionDefines,
  reflectionKey,
  reflectionUniforms,
  rowWidth,
  type LastReflection,
} from './outgoing.js';
import {
  checkNodes,
  isNodeRenderer,
  setNodes,
  throughGlass,
  withoutNodes,
  type NodeEdition,
  type NodeSum,
  type Renderer,
} from './node_edition.js';
import { diffuseParameters, replaceOnce, useExitRadiance } from './prt_material.js';
import { drawFilter, type Drawn } from './see_through.js';
import { RestPose, TurnedSums } from './turned.js';
import { bindPart } from './vertex_transfer.js';

const vertexDeclarations = (shared: LastReflection): string => /* glsl */ `
attribute uint lambentReceiver;
varying vec3 vPrtFront;
#ifdef PRT_TWO_SIDED
  attribute uint lambentReceiverBack;
  varying vec3 vPrtBack;
#endif
${glossVaryings}
${glslInstances()}
uniform highp sampler2D prtRows;
uniform mat3 prtTurnBack;
#define PRT_TURN_BACK
vec3 prtRow( const in int r, const in int row ) {
  #ifdef USE_INSTANCING
    return prtInstanceSum( r, row, 0 );
  #endif
  int i = r * PRT_SUM_ROWS + row;
  return texelFetch( prtRows, ivec2( i % ${rowWidth}, i / ${rowWidth} ), 0 ).rgb;
}
#ifdef PRT_PEAKS
  uniform highp sampler2D prtPeakRows;
  vec3 prtPeakRow( const in int r, const in int row ) {
    #ifdef USE_INSTANCING
      return prtInstanceSum( r, row, 1 );
    #endif
    int i = r * PRT_SUM_ROWS + row;
    return texelFetch( prtPeakRows, ivec2( i % ${rowWidth}, i / ${rowWidth} ), 0 ).rgb;
  }
#endif
${glslReflect(shared.outgoing, false)}`;

interface MatrixValues {
  layout: BlockLayout;
  channels: 1 | 3;
  transfer: DataArrayTexture;
}

class MatrixMaterial extends MeshBasicMaterial {
  constructor(
    readonly sums: TurnedSums<LightSums>,
    readonly shared: LastReflection,
    readonly values: MatrixValues,
    twoSided: boolean,
    source: Material,
    readonly gain?: { value: number },
  ) {
    super(gain ? { side: source.side } : diffuseParameters(source));
    const { layout, channels } = values;
    this.defines = {
      ...reflectionDefines(shared),
      ...{ PRT_QUADS: layout.quads, PRT_TEXELS: layout.texels, PRT_COLUMNS: layout.columns, PRT_ROWS: layout.rows },
      PRT_CHANNELS: channels,
      ...(twoSided && { PRT_TWO_SIDED: '' }),
      ...(gain && { PRT_FALSE_COLOR: '' }),
    };
    if (gain) this.toneMapped = false;
  }

  override onBeforeRender(...drawn: Drawn): void {
    this.sums.update(drawn[0], drawn[4]);
    drawFilter(this, ...drawn);
  }

  override onBeforeCompile(shader: WebGLProgramParametersWithUniforms): void {
    Object.assign(
      shader.uniforms,
      { prtRows: this.sums.rest, prtPeakRows: this.sums.peaks, prtTurnBack: this.sums.turnBack },
      this.sums.instances?.uniforms(this.values.transfer),
      reflectionUniforms(this.shared),
      this.gain && { prtGain: this.gain },
    );
    shader.vertexShader =
      vertexDeclarations(this.shared) +
      replaceOnce(shader.vertexShader, '#include <fog_vertex>', '#include <fog_vertex>' + glossVertexBody);
    shader.fragmentShader = useExitRadiance(
      shader.fragmentShader,
      glossFragmentDeclarations,
      this.gain !== undefined,
      true,
    );
  }

  override customProgramCacheKey(): string {
    return `lambent matrix ${reflectionKey(this.shared)}`;
  }
}

class MatrixTransfer implements BakedTransfer {
  readonly order: number;
  readonly columns: BakedTransfer['columns'];
  readonly channels: 1 | 3;
  readonly receivers: number;
  readonly fileBytes: number;
  readonly gpuBytes: number;
  private readonly values: TransferValues;
  readonly layout: BlockLayout;
  readonly transfer: DataArrayTexture;
  private readonly sums: TurnedSums<LightSums>;
  private readonly materials = new Map<string, MatrixMaterial>();
  private readonly ofCoefficients = new Set<TurnedSums<LightSums>>();
  private readonly sum: NodeSum | undefined; // for WebGPURenderer
  private readonly refusal: string | undefined; // why that does not draw this

  constructor(
    readonly kind: string,
    private readonly header: TransferHeader,
    private readonly shared: LastReflection,
    { values, fileBytes }: StoredValues,
    readonly meshes: Mesh[],
    private readonly nodes?: NodeEdition,
    firstBands?: number,
  ) {
    this.order = bandsOfLight(header);
    this.columns = columnsOf(header);
    this.channels = header.channels;
    this.receivers = header.receivers;
    this.fileBytes = fileBytes;
    this.values = new TransferValues(
      { ...header, count: header.columns, channels: shared.rows * header.channels },
      values,
      firstBands,
    );
    const { layout, data, texture } = this.values;
    this.layout = layout;
    this.transfer = texture;
    const pose = new RestPose(meshes, true);
    this.sums = this.makeSums(pose);
    this.refusal = nodes ? undefined : withoutNodes;
    this.sum = this.makeNodes(pose);
    let gpuBytes = data.byteLength + this.sums.main.rest.bytes + reflectionBytes(shared) + (this.sum?.bytes ?? 0);
    for (const mesh of meshes) {
      const twoSided = mesh.geometry.hasAttribute('lambentReceiverBack'),
        source = mesh.material as Material,
        key = `${source.uuid} ${twoSided}`;
      gpuBytes += mesh.geometry.getAttribute('position').count * (twoSided ? 8 : 4);
      const material = this.materials.get(key) ?? new MatrixMaterial(this.sums, shared, this, twoSided, source);
      this.materials.set(key, material);
      setNodes(
        material,
        nodes && throughGlass(nodes, material, nodes.reflection(this.sum!, shared, twoSided)),
        `The baked scene ${withoutNodes}.`,
      );
      mesh.material = material;
    }
    this.gpuBytes = gpuBytes;
  }

  private makeNodes(pose: RestPose): NodeSum | undefined {
    const { layout, transfer, channels, receivers, header, shared } = this,
      { order } = header;
    return this.nodes?.sum({ layout, transfer, channels, receivers, order, pose, rows: shared.rows, apart: true });
  }

  private makeSums(pose?: RestPose): TurnedSums<LightSums> {
    return new TurnedSums(() => new LightSums(() => this.makeSum(), false), this.header.order, pose, this.layout.quads);
  }

  private makeSum(): LightSum {
    const { rows } = this.shared,
      texels = rows * this.receivers;
    return new LightSum({
      layout: this.layout,
      channels: this.channels,
      transfer: this.transfer,
      width: rowWidth,
      height: Math.ceil(texels / rowWidth),
      filter: NearestFilter,
      what: {
        size: `has ${this.receivers.toLocaleString('en')} receivers of ${rows} rows, which take a texture`,
        use: 'is glossy',
      },
      pick: `
uint prtPick( const in ivec2 texel, out int row ) {
  int i = texel.y * ${rowWidth} + texel.x;
  row = i % ${rows};
  return i < ${texels} ? uint( i / ${rows} ) : 0xffffffffu;
}`,
    });
  }

  check(renderer: Renderer): void {
    if (isNodeRenderer(renderer)) return checkNodes(renderer, this.refusal);
    this.sums.main.rest.check(renderer);
    checkReflection(this.shared, renderer);
    const { maxVertexTextures } = renderer.capabilities;
    const wanted = Math.max(
      ...this.meshes.map(
        (mesh) => 4 + Number('isSkinnedMesh' in mesh) + Number(Object.keys(mesh.geometry.morphAttributes).length > 0),
      ),
    );
    if (maxVertexTextures < wanted)
      throw new LambentError(
        `is relit in vertex shaders, which must read textures, ${wanted} at once; ` +
          `this graphics card reads ${maxVertexTextures} there`,
      );
  }

  relight(lighting: Lighting): void {
    const { rest, peaks, turned } = lighting.of(this.header, true, this.firstBands);
    this.sums.set(rest, peaks, turned);
    this.sum?.set(rest, peaks, false, turned);
    for (const material of this.materials.values()) setPeaks(material, peaks !== undefined);
  }

  get firstBands(): number | undefined {
    return this.values.firstBands;
  }
  refine(values: ArrayBuffer): void {
    this.values.refine(values);
  }

  coefficientMaterials(index: number, gain: { value: number }): Material[] {
    const sums = this.makeSums(),
      light = new Float64Array(3 * this.header.columns).fill(1, 3 * index, 3 * index + 3),
      { nodes, shared } = this,
      sum = this.makeNodes(new RestPose([], true));
    sums.set(light, undefined);
    sum?.set(light, undefined, false);
    this.ofCoefficients.add(sums);
    const made = this.meshes.map(
      (mesh) =>
        new MatrixMaterial(
          sums,
          this.shared,
          this,
          mesh.geometry.hasAttribute('lambentReceiverBack'),
          mesh.material as Material,
          gain,
        ),
    );
    made.forEach((material, i) => {
      const twoSided = this.meshes[i]!.geometry.hasAttribute('lambentReceiverBack');
      setNodes(
        material,
        nodes?.falseColor(nodes.reflection(sum!, shared, twoSided), gain),
        `The view ${withoutNodes}.`,
      );
    });
    afterAll(made, () => (this.ofCoefficients.delete(sums), sums.dispose(), sum?.dispose()));
    return made;
  }

  dispose(): void {
    for (const sums of [this.sums, ...this.ofCoefficients]) sums.dispose();
    this.transfer.dispose();
    this.sum?.dispose();
    this.shared.frames.dispose();
    this.shared.maps.dispose();
    for (const material of this.materials.values()) material.dispose();
    for (const mesh of this.meshes) mesh.geometry.dispose();
  }
}

/** Throws LambentError where so many rows are more than a texture holds. */
export function checkRows({ channels, columns }: TransferHeader, rows: number): void {
  if (rows * channels * Math.ceil(columns / 4) > limits.texels)
    throw new LambentError(
      `has ${rows} rows of ${columns} columns, more than textures hold; "lambent render" draws it`,
    );
}

/** Of a header that says what is drawn; `read` has its values, of a last reflection that was read before. */
export async function loadMatrix(
  source: TransferSource,
  header: TransferHeader,
  kind: string,
  read: (shared: LastReflection) => Promise<StoredValues>,
): Promise<BakedTransfer> {
  const shared = await loadLastReflection(source, header.receivers),
    values = await read(shared),
    meshes = await Promise.all(source.extension.parts.map((part) => bindPart(source, part, header.receivers)));
  return new MatrixTransfer(kind, header, shared, values, meshes, source.nodes, source.firstBands);
}

async function load(source: TransferSource): Promise<BakedTransfer> {
  const header = readHeader(source.extension),
    { rows } = readOutgoing(source.extension.transfer);
  checkRows(header, rows);
  return loadMatrix(source, header, 'matrix', () =>
    readStored(source, header, rows * header.channels * header.columns),
  );
}

export const matrixKind: TransferKind = { name: 'matrix', load };
