// A loaded file and the materials its meshes wear in each view. Those beyond the baked ones are made when first wanted.
import type { Material, Mesh, Object3D } from 'three';
import type { GLTF } from 'three/addons/loaders/GLTFLoader.js';
import {
  bakedScene,
  diffuseParameters,
  LambentError,
  UnshadowedMaterial,
  type BakedScene,
  type BakedTransfer,
  type Lighting,
  type TransferTexture,
} from '../src/index.js';
import { Relief } from './relief.js';

export type Look = 'baked' | 'direct' | 'indirect' | 'unshadowed' | 'relief' | 'coefficient' | 'error';

/** Bands of light that count, at least 1. Lobes of light take none; for what is drawn without shadows a few do. */
export const bandsOf = (transfer: BakedTransfer | undefined): number => transfer?.order || (transfer?.columns ? 6 : 1);

export class Model {
  readonly root: Object3D;
  readonly baked: BakedScene;
  private readonly own: Material[]; // by mesh, as all lists here
  relief: Relief | undefined;
  private unshadowed: UnshadowedMaterial[] | undefined;
  private errors: Material[] | undefined;
  private coefficient: { index: number; bands: number | undefined; materials: Material[] } | undefined;

  constructor(gltf: GLTF) {
    const baked = bakedScene(gltf);
    if (!baked) throw new LambentError('holds no transfer');
    this.root = gltf.scene;
    this.baked = baked;
    this.own = this.meshes.map((mesh) => mesh.material as Material);
  }

  /** Light is taken on a cube: there are none to leave out. */
  get hasNoBands(): boolean {
    const { reflection, terms } = this.baked.transfer;
    return reflection !== undefined || terms !== undefined;
  }
  /** Of what is drawn without shadows: as many as are baked. On a cube there are none; diffuse surfaces ask for few. */
  private get bands(): number {
    return this.hasNoBands ? 6 : bandsOf(this.baked.transfer);
  }

  get meshes(): Mesh[] {
    return this.baked.transfer.meshes;
  }

  /** In place of one before it. Throws LambentError where there is no sky to light it. */
  setRelief(transfer: TransferTexture): void {
    const { indirect, view } = this.baked.transfer;
    if (indirect) throw new LambentError("is relief in the sky's light, and lamps alone light this scene");
    if (view) throw new LambentError('is relief for surfaces, of which a fixed view has none');
    this.relief?.dispose();
    this.relief = new Relief(transfer, this.own);
  }

  /** Gains scale false colour; `index` says which coefficient. */
  wear(
    look: Look,
    lighting: Lighting | undefined,
    index: number,
    gain: { value: number },
    errorGain: { value: number },
  ): void {
    let materials = this.own;
    const { indirect } = this.baked.transfer;
    if (indirect) indirect.show = look === 'direct' || look === 'indirect' ? look : 'all';
    if (look === 'unshadowed') {
      if (!this.unshadowed) {
        const made = new Map<Material, UnshadowedMaterial>();
        for (const m of this.own)
          if (!made.has(m)) made.set(m, new UnshadowedMaterial(this.bands, diffuseParameters(m)));
        this.unshadowed = this.own.map((m) => made.get(m)!);
        if (lighting) this.relight(lighting);
      }
      materials = this.unshadowed;
    } else if (look === 'relief') {
      materials = this.relief?.materials ?? this.own;
    } else if (look === 'coefficient') {
      const { transfer } = this.baked,
        bands = transfer.firstBands;
      if (this.coefficient?.index !== index || this.coefficient.bands !== bands) {
        this.disposeCoefficient();
        const materials = transfer.coefficientMaterials?.(index, gain) ?? this.own;
        this.coefficient = { index, bands, materials };
      }
      materials = this.coefficient.materials;
    } else if (look === 'error') {
      materials = this.errors ??= this.baked.transfer.fitErrorMaterials?.(errorGain) ?? this.own;
    }
    this.meshes.forEach((mesh, i) => (mesh.material = materials[i]!));
  }

  private disposeCoefficient(): void {
    if (this.coefficient?.materials !== this.own) this.coefficient?.materials.forEach((m) => m.dispose());
  }

  relight(lighting: Lighting): void {
    this.baked.relight(lighting);
    this.relief?.relight(lighting);
    for (const material of new Set(this.unshadowed ?? [])) material.relight(lighting);
  }

  dispose(): void {
    this.unshadowed?.forEach((m) => m.dispose());
    this.relief?.dispose();
    this.disposeCoefficient();
    if (this.errors !== this.own) this.errors?.forEach((m) => m.dispose());
    this.baked.dispose();
  }
}
