// Direct to indirect light (docs/indirect.md; docs/file-format.md, kind "indirect"): lamps move, walls are repainted,
// and the bounces follow. Direct light is drawn by three's lights; what bounces is found by the processor
// (indirect_light.ts), a texel a receiver, which meshes look up.
//
// Budget: 16 bytes a receiver (over an atlas, a texel) on the graphics card and 4 a vertex; in memory 8 bytes an entry
// of the operator, and some 200 a triangle.
import {
  Box3,
  Color,
  DataTexture,
  FloatType,
  NearestFilter,
  RGBAFormat,
  Sphere,
  type Mesh,
  type Object3D,
} from 'three';
import { LambentError } from './errors.js';
import { isIndex } from './glb.js';
import { noReceiver, readReceivers } from './header.js';
import { IndirectLight, type IndirectTimes } from './indirect_light.js';
import { IndirectMaterial, pictureColumns, type IndirectUniforms } from './indirect_material.js';
import { readOperator, type IndirectOperator } from './indirect_file.js';
import { checkSolid, glowsOf, ownLamps, sceneTriangles, type OwnMaterial } from './indirect_scene.js';
import { axesOf, isDrawn, limits, type BakedTransfer, type TransferKind, type TransferSource } from './kinds.js';
import { LampLights } from './lamp_lights.js';
import { readPlacedMeshes } from './lightmap.js';
import { placeLamp, type Lamp, type Rgb } from './moving_lamps.js';
import { checkNodes, isNodeRenderer, setNodes, withoutNodes, type Renderer } from './node_edition.js';
import { bindPart } from './vertex_transfer.js';

/** What a program does with lamps and paint; `lights` goes into its scene, and shadow maps have to be on. */
export interface IndirectControls {
  readonly lights: Object3D;
  /** Lamps that move, 8 at most. Setting them throws LambentError at one that cannot be. */
  movingLamps: readonly Lamp[];
  /** Names of the scene's own lamps, and what scales them. */
  readonly ownLamps: ReadonlyMap<string, Rgb>;
  scaleOwn(name: string, scale: Rgb): void;
  /** Materials by name, and the colours they have now (a picture's mean); those that were painted. */
  readonly materials: ReadonlyMap<string, Rgb>;
  readonly painted: ReadonlyMap<string, Rgb>;
  /** Repaints one; undefined: as it was. */
  paint(name: string, color: Rgb | undefined): void;
  show: 'all' | 'direct' | 'indirect';
  /** Works for about so many milliseconds; whether there is more to do. To be called before each frame until then. */
  update(milliseconds: number): boolean;
  /** All that there is to do. */
  settle(): void;
  readonly times: IndirectTimes;
  readonly leaves: number;
  readonly entries: number;
  /** Of the scene. */
  readonly bounds: Sphere;
  /** The graphics card was taken away: shadows are drawn anew. */
  refresh(): void;
}

const readOff = 4; // of the scene's own lights, those with shadow maps: others are read off surfels, as what glows is

interface Picture {
  texture: DataTexture;
  /** Receiver of each texel; none: texel i is receiver i. */
  map: Uint32Array | undefined;
}

class IndirectTransfer implements BakedTransfer, IndirectControls {
  readonly kind = 'indirect';
  readonly order = 0;
  readonly channels = 3;
  readonly receivers: number;
  readonly fileBytes: number;
  readonly gpuBytes: number;
  readonly indirect: IndirectControls = this;
  readonly lights: LampLights;
  readonly bounds = new Sphere();
  readonly materials = new Map<string, Rgb>();
  readonly painted = new Map<string, Rgb>();
  private readonly light: IndirectLight;
  private readonly own: ReturnType<typeof ownLamps>;
  private readonly uniforms: IndirectUniforms;
  private readonly worn: IndirectMaterial[] = [];
  private readonly refusal: string | undefined;
  private given: readonly Lamp[] = [];
  private shown = -1;
  private showing: IndirectControls['show'] = 'all';

  constructor(
    private readonly operator: IndirectOperator,
    private readonly picture: Picture,
    readonly meshes: Mesh[],
    private readonly owns: readonly OwnMaterial[],
    source: TransferSource,
  ) {
    this.receivers = operator.receivers;
    this.fileBytes = operator.fileBytes;
    let root: Object3D = meshes[0]!;
    while (root.parent) root = root.parent;
    this.own = ownLamps(root, source.generator ?? '');
    const scene = sceneTriangles(meshes, owns, operator.surfels.names);
    this.checkPlaces(scene.positions);
    const glows = glowsOf(meshes, owns, scene);
    if (this.own.length + glows.length > limits.ownLamps)
      throw new LambentError(
        `has more than ${limits.ownLamps} lamps of its own, which this version does not draw; "lambent render" does`,
      );
    this.light = new IndirectLight(operator, scene, this.own, glows, readOff);
    this.uniforms = { prtLight: { value: picture.texture }, prtDirect: { value: 1 } };
    const { nodes } = source,
      direct = this.uniforms.prtDirect;
    this.lights = new LampLights(this.bounds, direct, nodes?.lights);
    this.refusal = nodes ? undefined : withoutNodes;
    const atlas = picture.map !== undefined;
    let vertexBytes = 0;
    meshes.forEach((mesh, i) => {
      const { geometry } = mesh,
        twoSided = geometry.hasAttribute(atlas ? 'lambentPlaceBack' : 'lambentReceiverBack');
      vertexBytes += geometry.getAttribute('position').count * (atlas ? 8 : 4) * (twoSided ? 2 : 1);
      const material = new IndirectMaterial(this.uniforms, { atlas, twoSided }, owns[i]!);
      if (geometry.hasAttribute('color')) material.vertexColors = true;
      setNodes(
        material,
        nodes?.bounced({ picture: picture.texture, atlas, twoSided, direct }),
        `The baked scene ${withoutNodes}.`,
      );
      this.worn.push(material);
      mesh.material = material;
      mesh.castShadow = mesh.receiveShadow = true;
    });
    this.gpuBytes = 4 * picture.texture.image.data!.length + vertexBytes;
    this.listMaterials();
    this.placeLights();
  }

  /** Surfels lie on the scene; not so where it was moved to be baked, since its numbers are too large for floats. */
  private checkPlaces(positions: Float32Array): void {
    const box = new Box3().setFromArray(positions),
      surfels = new Box3().setFromArray(this.operator.surfels.positions);
    box.getBoundingSphere(this.bounds);
    if (
      !box
        .clone()
        .expandByScalar(0.01 * this.bounds.radius)
        .containsBox(surfels)
    )
      throw new LambentError(
        'holds direct-to-indirect light beside its scene, which lies too far from the origin for the page, or was ' +
          'moved; "lambent render" draws it',
      );
  }

  private listMaterials(): void {
    const { names, materials, albedos } = this.operator.surfels,
      sums = new Map<number, [number, number, number, number]>();
    materials.forEach((m, i) => {
      const sum = sums.get(m) ?? [0, 0, 0, 0];
      for (let c = 0; c < 3; ++c) sum[c]! += albedos[3 * i + c]!;
      ++sum[3];
      sums.set(m, sum);
    });
    for (const [m, [r, g, b, n]] of [...sums].sort((a, b) => a[0] - b[0]))
      this.materials.set(names[m]!, [r / n, g / n, b / n]);
  }

  get movingLamps(): readonly Lamp[] {
    return this.given;
  }
  set movingLamps(lamps: readonly Lamp[]) {
    if (lamps.length > limits.lamps)
      throw new LambentError(`${lamps.length} lamps are more than the ${limits.lamps} that this version draws`);
    this.light.setLamps(lamps);
    this.given = lamps.map((lamp) => ({ ...lamp, numbers: [...lamp.numbers], color: [...lamp.color] }));
    this.placeLights();
  }

  get ownLamps(): ReadonlyMap<string, Rgb> {
    return this.light.scales;
  }
  scaleOwn(name: string, scale: Rgb): void {
    this.light.setOwn(name, scale);
    this.placeLights();
    this.owns.forEach(({ name: own }, i) => {
      const { glow, emissive } = this.worn[i]!;
      if ((own || 'material') === name) emissive.copy(glow).multiply(new Color(...scale));
    });
  }

  private placeLights(): void {
    const off: Rgb = [0, 0, 0];
    this.lights.set([
      ...this.given.map((lamp) => ({ placed: placeLamp(lamp), color: lamp.off ? off : lamp.color })),
      ...this.own.slice(0, readOff).map(({ name, placed, color }) => {
        const scale = this.light.scales.get(name)!;
        return { placed, color: color.map((c, k) => c * scale[k]!) as Rgb };
      }),
    ]);
  }

  paint(name: string, color: Rgb | undefined): void {
    if (!this.materials.has(name)) throw new LambentError(`the file has no material "${name}"`);
    if (color && !color.every((c) => c >= 0 && c <= 1)) throw new LambentError('a colour lies from 0 to 1');
    this.light.setAlbedo(name, color);
    if (color) this.painted.set(name, color);
    else this.painted.delete(name);
    this.owns.forEach((own, i) => {
      if (own.name !== name) return;
      const worn = this.worn[i]!;
      if (color) worn.color.setRGB(...color);
      else worn.color.copy(own.color ?? new Color(1, 1, 1));
      const map = color ? null : (own.map ?? null),
        vertexColors = !color && (own.vertexColors || this.meshes[i]!.geometry.hasAttribute('color'));
      if (worn.map !== map || worn.vertexColors !== vertexColors) worn.needsUpdate = true;
      worn.map = map;
      worn.vertexColors = vertexColors;
    });
  }

  get show(): IndirectControls['show'] {
    return this.showing;
  }
  set show(what: IndirectControls['show']) {
    if (what === this.showing) return;
    this.showing = what;
    this.uniforms.prtDirect.value = what === 'indirect' ? 0 : 1;
    this.light.show({ bounced: what !== 'direct', soft: what !== 'indirect' });
    this.take();
    this.lights.show();
  }

  update(milliseconds: number): boolean {
    const more = this.light.update(milliseconds);
    this.take();
    return more;
  }
  settle(): void {
    this.light.settle();
    this.take();
  }
  /** The newest light into the picture. */
  private take(): void {
    const { light, picture } = this;
    if (light.version === this.shown) return;
    this.shown = light.version;
    const data = picture.texture.image.data as Float32Array;
    if (!picture.map) data.set(light.values);
    else
      picture.map.forEach((r, i) => {
        if (r !== noReceiver) data.set(light.values.subarray(4 * r, 4 * r + 4), 4 * i);
      });
    picture.texture.needsUpdate = true;
  }

  get times(): IndirectTimes {
    return this.light.times;
  }
  get leaves(): number {
    return this.operator.surfels.areas.length;
  }
  get entries(): number {
    return this.operator.rows.nodes.length;
  }
  refresh(): void {
    this.lights.refresh();
  }

  check(renderer: Renderer): void {
    if (isNodeRenderer(renderer)) return checkNodes(renderer, this.refusal);
    const { width, height } = this.picture.texture.image,
      { maxTextureSize, maxTextures } = renderer.capabilities,
      most = Math.max(width, height);
    if (maxTextureSize < most)
      throw new LambentError(`takes textures of ${most} texels a side; this graphics card has ${maxTextureSize}`);
    if (maxTextures < 16) throw new LambentError('takes 16 textures at once, which this graphics card does not have');
  }

  /** Nothing: lamps light this, and no environment does. */
  relight(): void {
    return;
  }

  dispose(): void {
    this.lights.removeFromParent();
    this.lights.dispose();
    this.picture.texture.dispose();
    for (const material of this.worn) material.dispose();
    for (const mesh of this.meshes) mesh.geometry.dispose();
  }
}

function makePicture(width: number, height: number, map?: Uint32Array): Picture {
  const texture = new DataTexture(new Float32Array(4 * width * height), width, height, RGBAFormat, FloatType);
  texture.name = 'lambent indirect light';
  texture.minFilter = texture.magFilter = NearestFilter;
  texture.needsUpdate = true;
  return { texture, map };
}

async function load(source: TransferSource): Promise<BakedTransfer> {
  const { extension } = source,
    { surface } = extension;
  if (!isDrawn(extension))
    throw new LambentError(
      `holds direct-to-indirect light that is ${axesOf(extension).slice(1).join(', at ')}, which this version does ` +
        'not draw; "lambent render" does',
    );
  const owns = (await Promise.all(extension.parts.map((part) => source.ownMaterial(part)))) as OwnMaterial[];
  checkSolid(owns);
  if (owns.length === 0) throw new LambentError('has no surface');
  const operator = await readOperator(source),
    { receivers } = operator;
  if (surface?.kind !== 'texels') {
    const meshes = await Promise.all(extension.parts.map((part) => bindPart(source, part, receivers)));
    const picture = makePicture(Math.min(pictureColumns, receivers), Math.ceil(receivers / pictureColumns));
    return new IndirectTransfer(operator, picture, meshes, owns, source);
  }
  const { width, height, texels } = surface;
  if (!isIndex(width, 16384) || !isIndex(height, 16384) || width < 1 || height < 1)
    throw new LambentError('the size of the atlas is out of range');
  const map = await readReceivers(
    source,
    texels,
    width * height,
    receivers,
    'the atlas does not have one receiver a texel',
  );
  const meshes = await readPlacedMeshes(source);
  return new IndirectTransfer(operator, makePicture(width, height, map), meshes, owns, source);
}

export const indirectKind: TransferKind = { name: 'indirect', load };
