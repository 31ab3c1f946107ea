#pragma once
// WHAT is stored at each receiver, and the narrow waist between baking and relighting: a matrix T that takes light
// coefficients to `rows` numbers a receiver, for each colour channel. Diffuse transfer is its one-row case: cosine,
// visibility, bounces and 1/pi are in it, the receiver's own albedo is not, and exit radiance = albedo * (T light).
#include <lambent/basis/directional.h>
#include <lambent/core/aligned.h>
#include <lambent/core/result.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace lambent {

// Of stored values: IEEE 754 binary16 or binary32.
enum class Precision { half, single };

// Receivers are stored in blocks of this many, so that one SIMD stream relights a block.
inline constexpr size_t transfer_block = 16;

// The COLUMNS of T: what light is a combination of. Harmonics come first, then lobes (lamps in the distance), then the
// scene's own lamps by group.
struct LightBasis {
  int order = 0;  // bands of spherical harmonics (basis/sh.h): order^2 columns; 0: none
  LobeKind lobe_kind = LobeKind::von_mises_fisher;
  std::vector<Lobe> lobes;          // one column each, scaled to unit norm (basis/directional.h)
  std::vector<std::string> groups;  // one column each
  size_t count() const { return size_t(sh_count(order)) + lobes.size() + groups.size(); }
};

// Columns that relighting takes at most.
inline constexpr size_t max_columns = 1024;

// T, dense.
struct Transfer {
  LightBasis light;
  int rows = 1;
  int channels = 1;  // 1: the same transfer for R, G and B (no coloured bounce); 3: one for each
  size_t receivers = 0;
  Precision precision = Precision::half;
  // Layout [block][row][channel][column][receiver in block], little-endian; the last block is padded with zeros.
  std::span<const uint8_t> data;
  std::shared_ptr<const void> storage;  // keeps `data` alive: memory of ours or a mapped file

  size_t columns() const { return light.count(); }
  size_t blocks() const { return (receivers + transfer_block - 1) / transfer_block; }
  size_t value_bytes() const { return precision == Precision::half ? 2 : 4; }
  size_t receiver_values() const { return size_t(rows) * size_t(channels) * columns(); }
  size_t block_values() const { return receiver_values() * transfer_block; }
  size_t bytes() const { return blocks() * block_values() * value_bytes(); }
};

// A transfer with writable zeroed storage; `values` points at it.
struct WritableTransfer {
  Transfer transfer;
  uint8_t* values = nullptr;
};
// light: max_columns at most; rows at least 1; channels 1 or 3.
WritableTransfer make_transfer(LightBasis light, int rows, int channels, size_t receivers, Precision precision);

// Writes one receiver's values, [row][channel][column].
void store_receiver(const WritableTransfer& t, size_t receiver, std::span<const float> values);

// The bytes of receivers [first, first + count), padding included; `first` is a multiple of transfer_block, and so is
// the count, but for the last ones.
inline std::span<uint8_t> stored_bytes(const WritableTransfer& t, size_t first, size_t count) {
  const size_t block = t.transfer.block_values() * t.transfer.value_bytes();
  return {t.values + first / transfer_block * block, (count + transfer_block - 1) / transfer_block * block};
}

// One receiver's values, [row][channel][column].
std::vector<float> load_receiver(const Transfer& t, size_t receiver);

}  // namespace lambent
