#pragma once
// WHAT is stored at each receiver, and the narrow waist between baking and relighting. So far one row a receiver: the diffuse
// transfer vector. Cosine, visibility, bounces and 1/pi are in it, the receiver's own albedo is not:
// exit radiance = albedo * dot(transfer, light).
#include <lambent/core/aligned.h>
#include <lambent/core/result.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace lambent {

enum class Precision { half, single };

// Receivers are stored in blocks of this many, so that one SIMD stream relights a block.
inline constexpr size_t transfer_block = 16;

struct Transfer {
  int order = 0;         // of the light's spherical harmonics (basis/sh.h): order^2 columns
  int channels = 1;      // 1: the same transfer for R, G and B (no coloured bounce); 3: one for each
  size_t receivers = 0;
  Precision precision = Precision::half;
  // Layout [block][channel][coefficient][receiver in block], little-endian; the last block is padded with zeros.
  std::span<const uint8_t> data;
  std::shared_ptr<const void> storage;  // keeps `data` alive: memory of ours or a mapped file

  size_t coefficients() const { return size_t(order) * size_t(order); }
  size_t blocks() const { return (receivers + transfer_block - 1) / transfer_block; }
  size_t value_bytes() const { return precision == Precision::half ? 2 : 4; }
  size_t block_values() const { return size_t(channels) * coefficients() * transfer_block; }
  size_t bytes() const { return blocks() * block_values() * value_bytes(); }
};

// A transfer with writable zeroed storage; `values` points at it.
struct WritableTransfer {
  Transfer transfer;
  uint8_t* values = nullptr;
};
WritableTransfer make_transfer(int order, int channels, size_t receivers, Precision precision);

// Writes one receiver's values, [channel][coefficient].
void store_receiver(const WritableTransfer& t, size_t receiver, std::span<const float> values);

// One receiver's values, [channel][coefficient].
std::vector<float> load_receiver(const Transfer& t, size_t receiver);

}  // namespace lambent
