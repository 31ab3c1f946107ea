// Records of visibility in blocks, as strangers may have written them: all is checked before a shader trusts it.
import { LambentError } from './errors.js';

/** Where each receiver's record begins, and the end of the last; of base-128 lengths, one a receiver. */
export function recordBegins(lengths: Uint8Array, receivers: number, bytes: number): Float64Array {
  const begins = new Float64Array(receivers + 1);
  let at = 0;
  for (let r = 0; r < receivers; ++r) {
    let length = 0,
      digit = 128;
    for (let scale = 1; digit >= 128; scale *= 128) {
      if (at >= lengths.length || scale > 2 ** 42) throw new LambentError('"lengths" does not fit its receivers');
      digit = lengths[at++]!;
      length += (digit & 127) * scale;
    }
    begins[r + 1] = begins[r]! + length;
  }
  if (at !== lengths.length) throw new LambentError('"lengths" does not fit its receivers');
  if (begins[receivers] !== bytes)
    throw new LambentError(`holds ${bytes} bytes of visibility where its lengths make ${begins[receivers]}`);
  return begins;
}

/** Throws LambentError where a record is not as docs/file-format.md has it. */
export function checkRecords(records: Uint8Array, begins: Float64Array, blocks: number, bits: number): void {
  const each = bits > 1 ? 2 : 1,
    top = 2 ** bits - 1,
    flags = Math.ceil(blocks / 4);
  for (let r = 0; r + 1 < begins.length; ++r)
    if (!isRecord(begins[r]!, begins[r + 1]!)) throw new LambentError(`holds broken visibility, at receiver ${r}`);

  function isRecord(begin: number, end: number): boolean {
    let at = begin + flags;
    if (at > end) return false;
    for (let b = 0; b < blocks; ++b) {
      const sight = (records[begin + (b >> 2)]! >> (2 * (b & 3))) & 3;
      if (sight > 2) return false;
      if (sight < 2) continue;
      if (at >= end) return false;
      let count = records[at++]!;
      if (count > 127) {
        if (at >= end || records[at]! > 127) return false;
        count = (count & 127) + 128 * records[at++]!;
      }
      if (count < 1 || count > 256 || end - at < count * each) return false;
      for (let i = 0; i < count; ++i) {
        if (i > 0 && records[at + i]! <= records[at + i - 1]!) return false;
        if (bits > 1 && records[at + count + i]! > top) return false;
      }
      at += count * each;
    }
    return at === end;
  }
}
