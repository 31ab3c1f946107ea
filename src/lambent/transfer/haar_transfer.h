#pragma once
// Diffuse transfer of distant light in Haar wavelets on a cube, sparse: at each receiver the coefficients that matter,
// kept by COLUMN, so that relighting reads those columns alone that the light wakes. Source: Ng, Ramamoorthi, Hanrahan,
// "All-Frequency Shadows Using Non-linear Wavelet Lighting Approximation" (2003), as general-prt cites it.
//
// Columns are [face][coefficient], coefficients as in basis/haar.h. Light is what the texels of a cube receive
// (light/cube_light.h: energy), transformed face by face; the transfer of a texel is what is seen of it times the
// cosine over pi, transformed alike. The transform is orthonormal but for a factor that goes into the light, so sums
// over columns are sums over texels.
#include <lambent/core/result.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace lambent {

// Receivers whose sums stay in a core's cache while column after column is added.
inline constexpr size_t haar_chunk = 4096;

// Diffuse transfer in Haar wavelets of the light on a cube's faces, sparse, by column (Ng et al. 2003).
struct HaarTransfer {
  int size = 0;  // of the cube, texels a side of a face: 2^k
  size_t receivers = 0;
  std::vector<float> steps;     // by column: what 1 stands for
  std::vector<uint32_t> begin;  // [chunk][column], and an end a chunk: places in the chunk's data
  // By chunk, column after column: pairs of a byte to go on by and a value from -127 to 127, of the receiver that is
  // reached (from one before the chunk's first); with the value 0 it is a step alone.
  std::vector<std::vector<uint8_t>> data;

  size_t columns() const { return 6 * size_t(size) * size_t(size); }
  size_t chunks() const { return (receivers + haar_chunk - 1) / haar_chunk; }
  size_t bytes() const;    // of all
  size_t entries() const;  // pairs
  std::span<const uint8_t> column(size_t chunk, size_t c) const {
    const uint32_t* at = begin.data() + chunk * (columns() + 1) + c;
    return std::span(data[chunk]).subspan(at[0], at[1] - at[0]);
  }
};

// One coefficient of a receiver.
struct HaarEntry {
  uint32_t column;
  float value;
};
// Quantised to 8 bits by column; rows[r] are of receiver r, columns rising.
HaarTransfer make_haar_transfer(int size, std::span<const std::vector<HaarEntry>> rows);

// Whether the columns are what they promise, so that relighting may trust them. Errors name `where`.
Result<void> check_haar(const HaarTransfer& t, const std::string& where);

// Root of the sum of squares of each column: how much a unit of light in it changes the receivers.
std::vector<float> haar_column_norms(const HaarTransfer& t);

}  // namespace lambent
