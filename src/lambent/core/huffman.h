#pragma once
// Bytes by how often each is there. Source: D. Huffman, "A method for the construction of minimum-redundancy codes",
// 1952; codes are canonical, so that their lengths say all.
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace lambent {

// How long the code of each byte is, 128 bytes of two lengths each, the lower byte's in the lower half; 0: it is not
// there, else at most 15. Then the codes, from the highest bit down, and zeros to the end of a byte.
std::vector<uint8_t> huffman_encode(std::span<const uint8_t> bytes);

// So many bytes; none where the lengths make no code, bits are missing or left over, or `count` is beyond all that so
// many bits can hold.
std::optional<std::vector<uint8_t>> huffman_decode(std::span<const uint8_t> coded, size_t count);

}  // namespace lambent
