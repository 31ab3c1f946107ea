#pragma once
// The inner loops of baking, compiled for several instruction sets and chosen at run time. Float arrays are padded with zeros
// to multiples of `lane_multiple`.
#include <lambent/core/vec.h>

#include <cstddef>
#include <cstdint>

namespace lambent {

inline constexpr size_t lane_multiple = 16;
constexpr size_t pad_lanes(size_t n) { return (n + lane_multiple - 1) / lane_multiple * lane_multiple; }

// (ox, oy, oz)[i] = R (x, y, z)[i]; count a multiple of lane_multiple.
void rotate_directions(const Mat3& R, const float* x, const float* y, const float* z, size_t count, float* ox, float* oy, float* oz);

// out[i] = sum over j < count of table[i * stride + j] * weights[j], for i < rows; count and stride multiples of lane_multiple.
void weighted_rows(const float* table, size_t rows, size_t stride, const float* weights, size_t count, float* out);

// acc[j] += sum over entries e of w(e, j) * x[columns[e] * stride + j], j < width (a multiple of lane_multiple, at most stride).
// Weights are halves: one an entry if channels is 1; else three, and lane j takes weight j % 3 (values lie [column][channel]).
void gather_rows(const uint32_t* columns, const uint16_t* weights, size_t entries, int channels, const float* x, size_t stride,
                 size_t width, float* acc);

}  // namespace lambent
