#pragma once
// Diffuse transfer of distant light in Haar wavelets on a cube, sparse: at each receiver the coefficients that matter,
// kept by COLUMN, so that relighting reads those columns alone that the light wakes. Source: Ng, Ramamoorthi, Hanrahan,
// "All-Frequency Shadows Using Non-linear Wavelet Lighting Approximation" (2003), as general-prt cites it.
//
// Columns are [face][coefficient], coefficients as in basis/haar.h; where bounces between coloured surfaces make three
// channels of them, [channel][face][coefficient]. Light is what the texels of a cube receive
// (light/cube_light.h: energy), transformed face by face; the transfer of a texel is what is seen of it times the
// cosine over pi, transformed alike. The transform is orthonormal but for a factor that goes into the light, so sums
// over columns are sums over texels.
#include <lambent/core/result.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace lambent {

// Receivers side by side that have their entries together.
inline constexpr size_t haar_tile = 64;
// Receivers whose sums stay in a core's cache while column after column is added.
inline constexpr size_t haar_chunk = 64 * haar_tile;
// With so many entries a tile has the values of all its receivers: that is read several times as fast.
inline constexpr size_t haar_whole = haar_tile / 2;

// Diffuse transfer in Haar wavelets of the light on a cube's faces, sparse, by column (Ng et al. 2003).
struct HaarTransfer {
  int size = 0;  // of the cube, texels a side of a face: 2^k
  size_t receivers = 0;
  double error = 0;  // of all receivers together: relative RMS of what was left out and rounded; told, not looked at
  int channels = 1;  // or 3: r, g and b, each with its columns
  std::vector<float> steps;      // by column: what 1 stands for
  std::vector<uint64_t> starts;  // by chunk, and the end: places in `data`
  std::vector<uint32_t> begin;   // [chunk][column], and an end a chunk: places after the chunk's start
  // Chunk after chunk, column after column. A column of no entry in a chunk has no bytes. Else it has 64 bits
  // (little-endian), one a tile of the chunk, set where it has entries; and for each such tile a byte: 0, and the
  // values of all its receivers follow, -128 to 127, a byte each; or how many entries it has, and for each a byte that
  // says which receiver of the tile, rising, and the value.
  std::span<const uint8_t> data;
  std::shared_ptr<const void> storage;  // keeps `data` alive: memory of ours or a mapped file

  static constexpr int rows = 1;
  size_t light_columns() const { return 6 * size_t(size) * size_t(size); }
  size_t columns() const { return size_t(channels) * light_columns(); }
  size_t chunks() const { return (receivers + haar_chunk - 1) / haar_chunk; }
  size_t receiver_values() const { return columns(); }
  size_t bytes() const;    // of all
  size_t entries() const;  // values that are not 0
  std::span<const uint8_t> column(size_t chunk, size_t c) const {
    const uint32_t* at = begin.data() + chunk * (columns() + 1) + c;
    return data.subspan(size_t(starts[chunk]) + at[0], at[1] - at[0]);
  }
};

// One coefficient of a receiver.
struct HaarEntry {
  uint32_t column;
  float value;
};

// Takes receivers chunk after chunk (haar_chunk of them but for the last), rounded to 8 bits by steps of their columns.
class HaarWriter {
 public:
  // largest: by column, of one channel or three, what no entry exceeds.
  HaarWriter(int size, std::span<const float> largest);
  // rows[r]: entries of receiver r of the chunk, columns rising.
  void add(std::span<const std::vector<HaarEntry>> rows);
  // What rounding has changed: the sum of squares.
  double lost() const { return lost_; }
  HaarTransfer finish(double error);

 private:
  HaarTransfer out_;
  std::vector<uint8_t> data_;
  double lost_ = 0;
};

// All of it at once.
HaarTransfer make_haar_transfer(int size, std::span<const std::vector<HaarEntry>> rows);

// Whether the columns are what they promise, so that relighting may trust them. Errors name `where`.
Result<void> check_haar(const HaarTransfer& t, const std::string& where);

// Root of the sum of squares of each column: how much a unit of light in it changes the receivers.
std::vector<float> haar_column_norms(const HaarTransfer& t);

// One receiver's coefficients, by column.
std::vector<float> load_receiver(const HaarTransfer& t, size_t receiver);

}  // namespace lambent
