// Values of receivers as an array texture. The file has blocks of 16 receivers, [block][channel][value][16]; a vertex
// wants the values of one receiver together, four a texel. So values are transposed once, on loading. Diffuse transfer
// has order^2 values a channel; zonal transfer, whose channels share their axes, counts as one channel.
//
// Texel (x, y, layer) of receiver r and channel c, k = 0 .. quads-1, quads = ceil(count / 4):
//   x = (r mod columns) * channels * quads + c * quads + k,  y = (r / columns) mod rows,  layer = r / (columns * rows)
// with powers of two for columns and rows. Width and height stay within the 2048, layers within the 256, that WebGL2
// promises.
//
// Budget: 4 quads * channels values a receiver (half floats: 216 bytes for order 6 in colour, 72 in grey), up to `rows`
// - 1 unused rows in the last layer, and 4 bytes a vertex for its receiver, 8 where surfaces have two sides.
import { DataArrayTexture, FloatType, HalfFloatType, NearestFilter, RGBAFormat } from 'three';
import { LambentError } from './errors.js';

export const block = 16;
const maxSize = 2048,
  maxLayers = 256,
  leastRows = 256;

export interface BlockHeader {
  count: number; // values a channel
  channels: number; // of matrices: rows * channels
  precision: 'half' | 'single';
  receivers: number;
}

export interface BlockLayout {
  quads: number; // texels a channel
  texels: number; // texels a receiver
  columns: number; // receivers a row, a power of two
  rows: number; // rows a layer, a power of two
  width: number;
  height: number; // `rows`, but no more than are filled where there is one layer
  layers: number;
}

const powerOfTwoFrom = (n: number): number => 2 ** Math.ceil(Math.log2(Math.max(1, n)));

export function blockLayout({ count, channels, receivers }: BlockHeader): BlockLayout {
  const quads = Math.ceil(count / 4),
    texels = channels * quads;
  const columns = 2 ** Math.floor(Math.log2(maxSize / texels));
  const filled = Math.ceil(receivers / columns);
  const rows = Math.min(maxSize, Math.max(leastRows, powerOfTwoFrom(filled / maxLayers)));
  const layers = Math.ceil(filled / rows);
  if (layers > maxLayers)
    throw new LambentError(`has ${receivers.toLocaleString('en')} receivers, more than textures hold`);
  return { quads, texels, columns, rows, width: columns * texels, height: layers > 1 ? rows : filled, layers };
}

/**
 * The texture's values: bits of half floats, or single floats. `values` has exactly the bytes that the header makes.
 */
export function packBlocks(
  header: BlockHeader,
  values: ArrayBuffer,
): { layout: BlockLayout; data: Uint16Array | Float32Array } {
  const { count, channels, precision, receivers } = header;
  const blocks = Math.ceil(receivers / block);
  const expected = blocks * channels * count * block * (precision === 'half' ? 2 : 4);
  if (values.byteLength !== expected)
    throw new LambentError(`holds ${values.byteLength} bytes of transfer where its header makes ${expected}`);
  const layout = blockLayout(header);
  const { quads, texels, width, height, layers } = layout;
  const Values = precision === 'half' ? Uint16Array : Float32Array;
  const from = new Values(values),
    data = new Values(4 * width * height * layers);
  const receiverStride = 4 * texels; // rows are full and layers follow rows, so receivers simply follow each other
  for (let b = 0; b < blocks; ++b)
    for (let c = 0; c < channels; ++c)
      for (let k = 0; k < count; ++k) {
        const at = ((b * channels + c) * count + k) * block;
        let to = b * block * receiverStride + 4 * c * quads + k;
        const lanes = Math.min(block, receivers - b * block);
        for (let lane = 0; lane < lanes; ++lane, to += receiverStride) data[to] = from[at + lane]!;
      }
  return { layout, data };
}

export function blockTexture(layout: BlockLayout, data: Uint16Array | Float32Array): DataArrayTexture {
  const texture = new DataArrayTexture(data, layout.width, layout.height, layout.layers);
  texture.name = 'lambent transfer';
  texture.format = RGBAFormat;
  texture.type = data instanceof Uint16Array ? HalfFloatType : FloatType;
  texture.minFilter = texture.magFilter = NearestFilter;
  texture.generateMipmaps = false;
  texture.needsUpdate = true;
  return texture;
}

/** Transfer as a texture, of which at first some bands may be there and the others zero. */
export class TransferValues {
  readonly layout: BlockLayout;
  readonly texture: DataArrayTexture;

  constructor(
    private readonly header: BlockHeader,
    values: ArrayBuffer,
    /** How many are there; undefined once all are. */
    public firstBands: number | undefined,
  ) {
    const { layout, data } = packBlocks(header, values);
    this.layout = layout;
    this.texture = blockTexture(layout, data);
  }

  get data(): Uint16Array | Float32Array {
    return this.texture.image.data as Uint16Array | Float32Array;
  }

  refine(values: ArrayBuffer): void {
    this.data.set(packBlocks(this.header, values).data);
    this.texture.needsUpdate = true;
    this.firstBands = undefined;
  }
}
