#pragma once
// What KHR_meshopt_compression has beyond the library that decodes the rest: version 1 of the attribute codec
// (appendix A of the extension) and the colour filter (appendix B).
#include <cstdint>
#include <span>
#include <vector>

namespace lambent {

// Fills `out` with `count` elements of `stride` bytes, a multiple of 4 up to 256. False for broken streams. A byte of
// stream holds 1024 bytes at most: the caller asks before.
bool decode_attributes_v1(std::span<const uint8_t> stream, size_t count, size_t stride, std::vector<uint8_t>& out);

// In place: YCoCg and alpha of a width that each element tells become four normalised integers of 8 or 16 bits.
void decode_color_filter(std::vector<uint8_t>& elements, size_t stride);

}  // namespace lambent
