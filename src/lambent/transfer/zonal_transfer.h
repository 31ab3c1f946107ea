#pragma once
// Transfer as zonal lobes: it turns with the surface by turning a few axes. Rows have the meaning of transfer.h: one
// for diffuse surfaces, several where a last reflection (outgoing.h) makes radiance of them. Source:
// local-deformable-prt, eq. 11, 16 and section 3.3.
//
// t_lm = sum_i y_lm(s_i) g_il for the bands from exact_bands() on; the bands below are stored as they are: DC alone for
// one or two lobes, DC and linear for three or more, which could reproduce them anyhow. Channels share the axes: what
// blocks the light is the same for all of them, and coloured bounces differ in strength more than in shape; each has
// coefficients of its own.
#include <lambent/transfer/transfer.h>

namespace lambent {

// Lobes of a row, at most.
inline constexpr int max_stored_lobes = 8;

// Bands that `lobes` lobes leave to exact storage.
constexpr int exact_zonal_bands(int order, int lobes) { return std::min(order, lobes >= 3 ? 2 : 1); }

// T as lobes.
struct ZonalTransfer {
  int order = 0;  // bands of the light's harmonics, [1, 16]
  int lobes = 0;  // a row, [1, 8]
  int rows = 1;
  int channels = 1;
  size_t receivers = 0;
  Precision precision = Precision::half;
  // Layout [block][row][value][receiver in block], little-endian, last block padded with zeros. The values of a row:
  // [channel][exact coefficient], then for each lobe its axis x, y, z and [channel][band - exact_bands()].
  std::span<const uint8_t> data;
  std::shared_ptr<const void> storage;

  int exact_bands() const { return exact_zonal_bands(order, lobes); }
  size_t exact_values() const { return size_t(channels) * size_t(sh_count(exact_bands())); }
  size_t lobe_values() const { return 3 + size_t(channels) * size_t(order - exact_bands()); }
  size_t row_values() const { return exact_values() + size_t(lobes) * lobe_values(); }
  size_t receiver_values() const { return size_t(rows) * row_values(); }
  size_t value_bytes() const { return precision == Precision::half ? 2 : 4; }
  size_t blocks() const { return (receivers + transfer_block - 1) / transfer_block; }
  size_t bytes() const { return blocks() * receiver_values() * transfer_block * value_bytes(); }
};

// A transfer with writable zeroed storage; `values` points at it.
struct WritableZonalTransfer {
  ZonalTransfer transfer;
  uint8_t* values = nullptr;
};
// Zeroed.
WritableZonalTransfer make_zonal_transfer(int order, int lobes, int channels, size_t receivers, Precision precision,
                                          int rows = 1);

// The bytes of receivers [first, first + count), as those of a WritableTransfer.
inline std::span<uint8_t> stored_bytes(const WritableZonalTransfer& t, size_t first, size_t count) {
  const size_t block = t.transfer.receiver_values() * transfer_block * t.transfer.value_bytes();
  return {t.values + first / transfer_block * block, (count + transfer_block - 1) / transfer_block * block};
}

// One receiver's values, row by row.
void store_receiver(const WritableZonalTransfer& t, size_t receiver, std::span<const float> values);
std::vector<float> load_receiver(const ZonalTransfer& t, size_t receiver);

// Axis i of the values of one row: of unit length, which rounding to half may have spoilt; +z where it is zero.
Vec3 lobe_axis(const ZonalTransfer& t, std::span<const float> values, int lobe);

// The harmonics that the values of one row stand for, turned by R: [channel][order^2]. (Rf)(s) = f(R^-1 s).
std::vector<float> zonal_harmonics(const ZonalTransfer& t, std::span<const float> values, const Mat3& R = Mat3(1.0f));

}  // namespace lambent
