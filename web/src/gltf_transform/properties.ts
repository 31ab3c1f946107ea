// What a document of glTF Transform holds of a bake, beside the vertex attributes that carry its receivers.
import {
  ExtensionProperty,
  PropertyType,
  type IProperty,
  type Material,
  type Nullable,
  type Property,
  type PropertyResolver,
} from '@gltf-transform/core';
import { extensionName } from '../glb.js';

export interface TransferData {
  /** The extension's JSON without its parts; buffer views are numbers into `views`. */
  readonly json: Record<string, unknown>;
  /** Bytes of the file. */
  readonly views: readonly Uint8Array[];
  readonly receivers: number;
  /** Receivers that vertices name. */
  readonly used: number;
  readonly surface: 'vertices' | 'texels' | 'patches' | 'view';
  /** Tells receivers of this bake from those of another. */
  readonly fingerprint: string;
  /** Every triangle of the file had receivers, and, where `hasLook`, a material of the scene's own. */
  readonly isWhole: boolean;
  readonly hasLook: boolean;
}

/** The transfer itself, at the document's root. */
export class Transfer extends ExtensionProperty {
  static override EXTENSION_NAME = extensionName;
  declare extensionName: typeof extensionName;
  declare propertyType: 'Transfer';
  declare parentTypes: [PropertyType.ROOT];
  declare data: TransferData; // never changed, so that copies share it

  protected init(): void {
    this.extensionName = extensionName;
    this.propertyType = 'Transfer';
    this.parentTypes = [PropertyType.ROOT];
  }
  override copy(other: this, resolve?: PropertyResolver<Property>): this {
    this.data = other.data;
    return super.copy(other, resolve);
  }
}

/** A receiver a triangle, which follows no change of the triangles. */
export interface PatchSides {
  readonly front: Uint32Array;
  readonly back: Uint32Array | undefined;
  readonly vertices: number;
  readonly indices: Uint32Array;
}

export interface PartData {
  /** The extension's JSON at the primitive, without "ownMaterial". */
  readonly json: Record<string, unknown>;
  /** Sets of texture coordinates that were there, which "texCoord" and the scene's own material count on. */
  readonly texcoords: readonly string[];
  readonly patches: PatchSides | undefined;
}

interface IPart extends IProperty {
  ownMaterial: Material;
}

/** What the extension says of a primitive beside its receivers. */
export class Part extends ExtensionProperty<IPart> {
  static override EXTENSION_NAME = extensionName;
  declare extensionName: typeof extensionName;
  declare propertyType: 'Part';
  declare parentTypes: [PropertyType.PRIMITIVE];
  declare data: PartData;

  protected init(): void {
    this.extensionName = extensionName;
    this.propertyType = 'Part';
    this.parentTypes = [PropertyType.PRIMITIVE];
  }
  protected override getDefaults(): Nullable<IPart> {
    return Object.assign(super.getDefaults() as IProperty, { ownMaterial: null });
  }
  override copy(other: this, resolve?: PropertyResolver<Property>): this {
    this.data = other.data;
    return super.copy(other, resolve);
  }

  get ownMaterial(): Material | null {
    return this.getRef('ownMaterial');
  }
  set ownMaterial(material: Material | null) {
    this.setRef('ownMaterial', material);
  }
}
