// Bytes by how often each is there, as core/huffman.h writes them: how long the code of each byte is, then the codes.

const longest = 15,
  header = 128;

/**
 * So many bytes; undefined where the lengths make no code, bits are missing or left over, or `count` is beyond all that
 * so many bits can hold.
 */
export function huffmanDecode(coded: Uint8Array, count: number): Uint8Array | undefined {
  if (coded.length < header || count > (coded.length - header) * 8) return undefined;
  // By the next fifteen bits: the byte, and the length of its code.
  const table = new Uint16Array(1 << longest);
  let code = 0;
  for (let length = 1; length <= longest; ++length, code *= 2)
    for (let byte = 0; byte < 256; ++byte) {
      if (((coded[byte >> 1]! >> (4 * (byte & 1))) & 15) !== length) continue;
      if (code >= 1 << length) return undefined;
      table.fill((byte << 4) | length, code << (longest - length), (code + 1) << (longest - length));
      ++code;
    }
  const out = new Uint8Array(count),
    total = coded.length;
  let at = header,
    window = 0,
    bits = 0;
  for (let i = 0; i < count; ++i) {
    for (; bits < longest; bits += 8, ++at) window = ((window << 8) | (at < total ? coded[at]! : 0)) & 0x7fffff;
    const found = table[(window >> (bits - longest)) & 0x7fff]!,
      length = found & 15;
    if (length === 0) return undefined;
    bits -= length;
    out[i] = found >> 4;
  }
  // Bits beyond the end were taken for zeros: none of them may have been read, and what is left must be zeros.
  const left = 8 * (total - at) + bits;
  const rest = bits > 0 ? window & ((1 << bits) - 1) : 0;
  return left >= 0 && left < 8 && rest === 0 ? out : undefined;
}
