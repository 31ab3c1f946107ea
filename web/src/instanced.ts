// Instances of three's InstancedMesh: each takes the light in its own axes, the turn of the instance on that of its
// node. Its light is a row of a texture, [rest, peaks][channel][quad], and then the columns of its turn; vertices sum
// transfer times that.
//
// Budget: 96 ceil(order^2 / 4) + 48 bytes an instance, 912 at order 6.
import {
  DataTexture,
  FloatType,
  Matrix3,
  Matrix4,
  NearestFilter,
  RGBAFormat,
  Vector3,
  type DataArrayTexture,
  type InstancedMesh,
  type Object3D,
} from 'three';
import { orthogonalPart } from './lobes.js';
import { makeShRotation, rotateSh, type ShRotation } from './sh_rotation.js';
import { shCount } from './sh.js';

const width = 2048;

/** Texels an instance, and instances a row of the texture; `quads` of a channel's light. */
export const instanceLayout = (quads: number): { texels: number; across: number } => {
  const texels = 6 * quads + 3;
  return { texels, across: Math.floor(width / texels) };
};

/**
 * GLSL: prtInstanceSum( receiver, row, part ) and prtInstanceTurn(), by the defines of the transfer's layout, of
 * instance `id`.
 */
export const glslInstances = (id = 'gl_InstanceID'): string => /* glsl */ `
#ifdef USE_INSTANCING
#define PRT_INSTANCE_TEXELS ( 6 * PRT_QUADS + 3 )
#define PRT_INSTANCES_ACROSS ( ${width} / PRT_INSTANCE_TEXELS )
uniform highp sampler2DArray prtTransfer;
uniform highp sampler2D prtInstances;
uniform bool prtInstancePeaks;
vec4 prtInstance( const in int k ) {
  return texelFetch( prtInstances, ivec2( ( ${id} % PRT_INSTANCES_ACROSS ) * PRT_INSTANCE_TEXELS + k,
                                          ${id} / PRT_INSTANCES_ACROSS ), 0 );
}
mat3 prtInstanceTurn() {
  return mat3( prtInstance( 6 * PRT_QUADS ).xyz, prtInstance( 6 * PRT_QUADS + 1 ).xyz,
               prtInstance( 6 * PRT_QUADS + 2 ).xyz );
}
// Transfer . light of a receiver's row; part 1 is of the light's peaks.
vec3 prtInstanceSum( const in int r, const in int row, const in int part ) {
  ivec3 at = ivec3( ( r & ( PRT_COLUMNS - 1 ) ) * PRT_TEXELS + row * PRT_CHANNELS * PRT_QUADS,
                    ( r / PRT_COLUMNS ) & ( PRT_ROWS - 1 ), r / ( PRT_COLUMNS * PRT_ROWS ) );
  int from = 3 * PRT_QUADS * part;
  vec3 sum = vec3( 0.0 );
  for ( int k = 0; k < PRT_QUADS; ++ k ) {
    vec4 red = texelFetch( prtTransfer, at + ivec3( k, 0, 0 ), 0 ), green = red, blue = red;
    #if PRT_CHANNELS == 3
      green = texelFetch( prtTransfer, at + ivec3( PRT_QUADS + k, 0, 0 ), 0 );
      blue = texelFetch( prtTransfer, at + ivec3( 2 * PRT_QUADS + k, 0, 0 ), 0 );
    #endif
    sum += vec3( dot( red, prtInstance( from + k ) ), dot( green, prtInstance( from + PRT_QUADS + k ) ),
                 dot( blue, prtInstance( from + 2 * PRT_QUADS + k ) ) );
  }
  return sum;
}
#endif
`;

export const isInstanced = (object: Object3D): object is InstancedMesh => 'isInstancedMesh' in object;

/** How instance `i` stands against the mesh that was baked, whose inverse is `rest`; not a rotation alone. */
function gradientOf(mesh: InstancedMesh, i: number, rest: Matrix3, out: Matrix3): Matrix3 {
  const matrix = new Matrix4();
  mesh.getMatrixAt(i, matrix);
  return out.setFromMatrix4(matrix.premultiply(mesh.matrixWorld)).multiply(rest);
}

/** Whether a gradient scales all directions alike. */
function isEven({ elements: e }: Matrix3): boolean {
  const [x, y, z] = [0, 3, 6].map((at) => new Vector3().fromArray(e, at)) as [Vector3, Vector3, Vector3],
    size = (x.lengthSq() + y.lengthSq() + z.lengthSq()) / 3;
  return (
    [x, y, z].every((v) => Math.abs(v.lengthSq() - size) < 2e-3 * size) &&
    [x.dot(y), y.dot(z), z.dot(x)].every((d) => Math.abs(d) < 2e-3 * size)
  );
}

const said = new WeakMap<Object3D, Set<string>>();
function say(mesh: InstancedMesh, what: string, sentence: string): void {
  const before = said.get(mesh) ?? new Set();
  said.set(mesh, before);
  if (before.has(what)) return;
  before.add(what);
  console.warn(`lambent: ${mesh.name ? `instances of "${mesh.name}"` : 'instances of a mesh'}: ${sentence}`);
}

/** Says once of a mesh which of its instances are more than turned and scaled. */
function tellApart(mesh: InstancedMesh, gradients: readonly Matrix3[]): void {
  const list = (which: number[]): string =>
      `${which.slice(0, 4).join(', ')}${which.length > 4 ? ` and ${which.length - 4} more` : ''}`,
    all = gradients.map((_, i) => i),
    uneven = all.filter((i) => !isEven(gradients[i]!)),
    mirrored = all.filter((i) => gradients[i]!.determinant() < 0);
  if (uneven.length > 0)
    say(mesh, 'uneven', `scaled unevenly or sheared, lit as the nearest rotation would be: ${list(uneven)}`);
  if (mirrored.length > 0)
    say(mesh, 'mirrored', `mirrored, which three.js draws inside out, and so in their backs' light: ${list(mirrored)}`);
}

/** Gradients of all instances where they have not been looked at since they last changed. */
function unseen(mesh: InstancedMesh, rest: Matrix3): Matrix3[] {
  const { count, instanceMatrix } = mesh;
  if (seen.get(mesh) === instanceMatrix.version) return [];
  seen.set(mesh, instanceMatrix.version);
  return Array.from({ length: count }, (_, i) => gradientOf(mesh, i, rest, new Matrix3()));
}
const seen = new WeakMap<Object3D, number>();

/** Before an InstancedMesh is drawn whose shader turns its instances; `rest` is the inverse of the mesh as baked. */
export function checkInstances(mesh: InstancedMesh, rest: Matrix3): void {
  tellApart(mesh, unseen(mesh, rest));
}

/** Before an InstancedMesh is drawn of a kind that does not follow its instances: says so once, where they differ. */
export function refuseInstances(mesh: InstancedMesh, rest: Matrix3): void {
  const turns = unseen(mesh, rest).map((gradient) => orthogonalPart(gradient).elements);
  if (turns.some((turn) => turn.some((v, k) => Math.abs(v - turns[0]![k]!) > 1e-3)))
    say(
      mesh,
      'kind',
      'turned differently, which this kind of transfer does not follow: all are lit as the mesh itself',
    );
}

/** Finds the inverse of a mesh's matrix as it was baked, without its place. */
interface Poses {
  inverseOf(object: Object3D): Matrix3 | undefined;
}

/** As TurnableLight (turned.ts). */
interface Light {
  rest: ArrayLike<number>;
  peaks: ArrayLike<number> | undefined;
  turned?: ((turn: Matrix3) => Omit<Light, 'turned'>) | undefined;
}
interface Made {
  texture: DataTexture;
  turns: Matrix3[];
  rotations: ShRotation[];
  /** What it was made of. */
  matrices: number;
  world: Matrix4;
  light: Light | undefined;
}

/** Light of the instances of each mesh, of harmonics and then lamps. */
export class InstancedLights {
  /** For shaders: of what is drawn next. */
  readonly instances: { value: DataTexture };
  readonly hasPeaks = { value: false };
  /** Of what stands as it was baked. */
  private readonly none = made(4 * 2, 2, 1);
  private readonly known = new Map<InstancedMesh, Made>();
  private light: Light | undefined;

  /** `quads` 0: turns alone. */
  constructor(
    private readonly order: number,
    private readonly quads: number,
    private readonly pose: Poses | undefined,
  ) {
    this.instances = { value: this.none };
  }

  /** [coefficient][3] */
  set(rest: ArrayLike<number>, peaks: ArrayLike<number> | undefined, turned?: Light['turned']): void {
    this.light = { rest, peaks, turned };
    this.hasPeaks.value = peaks !== undefined;
  }

  /** What glslInstances reads. */
  uniforms(transfer: DataArrayTexture): Record<string, { value: unknown }> {
    return { prtTransfer: { value: transfer }, prtInstances: this.instances, prtInstancePeaks: this.hasPeaks };
  }

  /** Before `object` is drawn: its instances' light; a texel of nothing where it has none. */
  of(object: Object3D): DataTexture {
    if (!isInstanced(object)) return this.none;
    const rest = this.pose?.inverseOf(object);
    if (this.pose && !rest)
      say(object, 'foreign', 'of no mesh as it was loaded (a copied geometry, say, or a skin): lit as it was baked');
    const known = this.standing(object, rest);
    if (known.light === this.light) return known.texture;
    known.light = this.light;
    this.write(known);
    return known.texture;
  }

  /** Turns of all instances, as they are now. */
  private standing(mesh: InstancedMesh, rest: Matrix3 | undefined): Made {
    let known = this.known.get(mesh);
    const { count, instanceMatrix, matrixWorld } = mesh;
    if (known?.turns.length === count && known.matrices === instanceMatrix.version && known.world.equals(matrixWorld))
      return known;
    const { texels, across } = instanceLayout(this.quads),
      height = Math.max(1, Math.ceil(count / across));
    if (!known) {
      mesh.addEventListener('dispose', () => this.forget(mesh));
      known = {
        ...{ texture: made(4 * width * height, width, height), turns: [], rotations: [] },
        ...{ matrices: -1, world: new Matrix4(), light: undefined },
      };
      this.known.set(mesh, known);
    } else if (known.texture.image.height < height) {
      known.texture.dispose();
      known.texture = made(4 * width * height, width, height);
    }
    known.matrices = instanceMatrix.version;
    known.world.copy(matrixWorld);
    known.light = undefined;
    known.turns.length = known.rotations.length = count;
    const gradients = Array.from({ length: count }, (_, i) =>
      rest ? gradientOf(mesh, i, rest, new Matrix3()) : new Matrix3(),
    );
    tellApart(mesh, gradients);
    gradients.forEach((gradient, i) => {
      const turn = orthogonalPart(gradient),
        before = known.turns[i];
      known.turns[i] = turn;
      if (before?.elements.every((v, k) => Math.abs(v - turn.elements[k]!) < 1e-6)) return;
      known.rotations[i] = makeShRotation(this.order, turn.elements); // column-major: of the inverse
    });
    const data = known.texture.image.data as Float32Array;
    known.turns.forEach(({ elements }, i) => {
      const at = 4 * (Math.floor(i / across) * width + (i % across) * texels + 6 * this.quads);
      for (let c = 0; c < 3; ++c) data.set(elements.slice(3 * c, 3 * c + 3), at + 4 * c);
    });
    known.texture.needsUpdate = true;
    return known;
  }

  private write({ texture, rotations, turns }: Made): void {
    const { light, order, quads } = this,
      { texels, across } = instanceLayout(quads),
      data = texture.image.data as Float32Array;
    if (!light || quads === 0) return;
    const turned = new Float64Array(light.rest.length);
    rotations.forEach((rotation, i) => {
      const at = 4 * (Math.floor(i / across) * width + (i % across) * texels);
      const own = light.turned?.(turns[i]!) ?? light;
      [own.rest, own.peaks].forEach((part, p) => {
        if (!part) return;
        turned.set(part); // lamps stay
        if (order > 0 && !light.turned)
          rotateSh(rotation, Float64Array.from(part).subarray(0, 3 * shCount(order)), turned);
        for (let k = 0; k < turned.length; ++k)
          data[at + 4 * quads * (3 * p + (k % 3)) + Math.floor(k / 3)] = turned[k]!;
      });
    });
    texture.needsUpdate = true;
  }

  private forget(mesh: InstancedMesh): void {
    this.known.get(mesh)?.texture.dispose();
    this.known.delete(mesh);
  }

  dispose(): void {
    for (const { texture } of this.known.values()) texture.dispose();
    this.known.clear();
    this.none.dispose();
  }
}

function made(values: number, width: number, height: number): DataTexture {
  const texture = new DataTexture(new Float32Array(values), width, height, RGBAFormat, FloatType);
  texture.minFilter = texture.magFilter = NearestFilter;
  texture.needsUpdate = true;
  return texture;
}
