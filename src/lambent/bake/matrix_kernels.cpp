#include <lambent/bake/matrix_kernels.h>
#include <lambent/core/check.h>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/bake/matrix_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::CappedTag<float, 16>;

void AddWeightedRows(const float* y, size_t rows, size_t channels, size_t width, const float* weights, float* v) {
  const F d;
  for (size_t c = 0; c < channels; ++c)
    for (size_t i = 0; i < width; i += hn::Lanes(d)) {
      auto sum = hn::LoadU(d, v + c * width + i);
      for (size_t r = 0; r < rows; ++r)
        sum = hn::MulAdd(hn::Set(d, weights[r * channels + c]), hn::LoadU(d, y + (r * channels + c) * width + i), sum);
      hn::StoreU(sum, d, v + c * width + i);
    }
}

void AddOuterProducts(const float* z, size_t n, const float* v, size_t width, float* acc) {
  const F d;
  for (size_t i = 0; i < width; i += hn::Lanes(d)) {
    const auto v0 = hn::LoadU(d, v + i), v1 = hn::LoadU(d, v + width + i), v2 = hn::LoadU(d, v + 2 * width + i),
               v3 = hn::LoadU(d, v + 3 * width + i);
    float* a = acc + i;
    for (size_t j = 0; j < n; ++j, a += width) {
      auto sum = hn::MulAdd(hn::Set(d, z[j]), v0, hn::LoadU(d, a));
      sum = hn::MulAdd(hn::Set(d, z[n + j]), v1, sum);
      sum = hn::MulAdd(hn::Set(d, z[2 * n + j]), v2, sum);
      sum = hn::MulAdd(hn::Set(d, z[3 * n + j]), v3, sum);
      hn::StoreU(sum, d, a);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {

HWY_EXPORT(AddWeightedRows);
HWY_EXPORT(AddOuterProducts);

void add_weighted_rows(const float* y, size_t rows, size_t channels, size_t width, const float* weights, float* v) {
  LAMBENT_CHECK(width % lane_multiple == 0);
  HWY_DYNAMIC_DISPATCH(AddWeightedRows)(y, rows, channels, width, weights, v);
}

void add_outer_products(const float* z, size_t n, const float* v, size_t width, float* acc) {
  static_assert(hit_batch == 4);
  LAMBENT_CHECK(width % lane_multiple == 0);
  HWY_DYNAMIC_DISPATCH(AddOuterProducts)(z, n, v, width, acc);
}

}  // namespace lambent
#endif
