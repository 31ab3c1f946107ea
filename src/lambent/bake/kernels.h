#pragma once
// The inner loops of baking, compiled for several instruction sets and chosen at run time. Float arrays are padded with
// zeros to multiples of `lane_multiple`.
#include <lambent/basis/directional.h>

#include <cstddef>
#include <cstdint>

namespace lambent {

inline constexpr size_t lane_multiple = 16;
constexpr size_t pad_lanes(size_t n) { return (n + lane_multiple - 1) / lane_multiple * lane_multiple; }

// (ox, oy, oz)[i] = R (x, y, z)[i]; count a multiple of lane_multiple.
void rotate_directions(const Mat3& R, const float* x, const float* y, const float* z, size_t count, float* ox,
                       float* oy, float* oz);

// out[i] = sum over j < count of table[i * stride + j] * weights[j], for i < rows; count and stride multiples of
// lane_multiple.
void weighted_rows(const float* table, size_t rows, size_t stride, const float* weights, size_t count, float* out);

// out[i] = scale * the lobe's value (basis/directional.h) at axis . (x, y, z)[i]; count a multiple of lane_multiple.
void lobe_values(LobeKind kind, Vec3 axis, float sharpness, float scale, const float* x, const float* y, const float* z,
                 size_t count, float* out);

// out[i] = a[i] * b[i]; count a multiple of lane_multiple.
void multiply_values(const float* a, const float* b, size_t count, float* out);

// IEEE halves of floats, rounded to nearest even.
void floats_to_halves(const float* floats, size_t count, uint16_t* halves);

// A block of sparse-matrix rows by columns: each of the matrix's columns that the block touches, once; its entries say
// which of the block's rows takes it, with what weight.
struct SparseEntries {
  const uint32_t* columns;  // distinct
  const uint32_t* ends;     // of each column's run of entries
  size_t column_count;
  const uint8_t* rows;      // within the block
  const uint16_t* weights;  // halves: `channels` an entry
};

// acc[row * width + j] += w(e, j) * x[column * width + j] over all entries. width is a multiple of lane_multiple. With
// one channel, w is the entry's weight; with three, lane j takes weight j % 3 (values lie [coefficient][channel]).
// Every row of x that the block needs is read from memory once, and the rows of acc stay in cache.
void multiply_entries(const SparseEntries& entries, int channels, const float* x, size_t width, float* acc);

}  // namespace lambent
