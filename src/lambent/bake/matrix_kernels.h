#pragma once
// The inner loops of matrix baking, compiled for several instruction sets and chosen at run time. `width` is a multiple
// of lane_multiple (kernels.h).
#include <lambent/bake/kernels.h>

namespace lambent {

// Hits are added up four at a time.
inline constexpr size_t hit_batch = 4;

// v[c * width + i] += sum over rows r of weights[r * channels + c] * y[(r * channels + c) * width + i].
void add_weighted_rows(const float* y, size_t rows, size_t channels, size_t width, const float* weights, float* v);

// acc[j * width + i] += sum over the batch of z[b * n + j] * v[b * width + i], j < n: a sum of outer products.
void add_outer_products(const float* z, size_t n, const float* v, size_t width, float* acc);

}  // namespace lambent
