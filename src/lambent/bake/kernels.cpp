#include <lambent/bake/kernels.h>
#include <lambent/core/check.h>
#include <lambent/core/half.h>

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/bake/kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// At most 16 lanes, so that padded arrays hold whole vectors.
using F = hn::CappedTag<float, 16>;

void RotateDirections(const float* R, const float* x, const float* y, const float* z, size_t count, float* ox, float* oy,
                      float* oz) {
  const F d;
  auto row = [&](int r, auto vx, auto vy, auto vz) {
    auto s = hn::Mul(hn::Set(d, R[r]), vx);
    s = hn::MulAdd(hn::Set(d, R[3 + r]), vy, s);
    return hn::MulAdd(hn::Set(d, R[6 + r]), vz, s);
  };
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto vx = hn::LoadU(d, x + i), vy = hn::LoadU(d, y + i), vz = hn::LoadU(d, z + i);
    hn::StoreU(row(0, vx, vy, vz), d, ox + i);
    hn::StoreU(row(1, vx, vy, vz), d, oy + i);
    hn::StoreU(row(2, vx, vy, vz), d, oz + i);
  }
}

void WeightedRows(const float* table, size_t rows, size_t stride, const float* weights, size_t count, float* out) {
  const F d;
  size_t i = 0;
  for (; i + 4 <= rows; i += 4) {  // four sums at a time share the loads of the weights
    const float* t = table + i * stride;
    auto s0 = hn::Zero(d), s1 = s0, s2 = s0, s3 = s0;
    for (size_t j = 0; j < count; j += hn::Lanes(d)) {
      const auto w = hn::LoadU(d, weights + j);
      s0 = hn::MulAdd(hn::LoadU(d, t + j), w, s0);
      s1 = hn::MulAdd(hn::LoadU(d, t + stride + j), w, s1);
      s2 = hn::MulAdd(hn::LoadU(d, t + 2 * stride + j), w, s2);
      s3 = hn::MulAdd(hn::LoadU(d, t + 3 * stride + j), w, s3);
    }
    out[i] = hn::GetLane(hn::SumOfLanes(d, s0));
    out[i + 1] = hn::GetLane(hn::SumOfLanes(d, s1));
    out[i + 2] = hn::GetLane(hn::SumOfLanes(d, s2));
    out[i + 3] = hn::GetLane(hn::SumOfLanes(d, s3));
  }
  for (; i < rows; ++i) {
    auto s = hn::Zero(d);
    for (size_t j = 0; j < count; j += hn::Lanes(d))
      s = hn::MulAdd(hn::LoadU(d, table + i * stride + j), hn::LoadU(d, weights + j), s);
    out[i] = hn::GetLane(hn::SumOfLanes(d, s));
  }
}

// Sums of `vectors` vectors stay in registers while the entries stream by.
template <size_t vectors, int channels>
void GatherVectors(const uint32_t* columns, const float* weights, size_t entries, const float* x, size_t stride, size_t offset,
                   float* acc) {
  const F d;
  const size_t lanes = hn::Lanes(d);
  hn::Vec<F> sum[vectors];
  for (size_t k = 0; k < vectors; ++k) sum[k] = hn::LoadU(d, acc + offset + k * lanes);
  [[maybe_unused]] size_t phase[vectors];
  for (size_t k = 0; k < vectors; ++k) phase[k] = (offset + k * lanes) % 3;
  for (size_t e = 0; e < entries; ++e) {
    const float* row = x + size_t(columns[e]) * stride + offset;
    if constexpr (channels == 1) {
      const auto w = hn::Set(d, weights[e]);
      for (size_t k = 0; k < vectors; ++k) sum[k] = hn::MulAdd(w, hn::LoadU(d, row + k * lanes), sum[k]);
    } else {
      // A run of the pattern r g b r g b ... long enough for any phase lies in `weights`: see GatherRows.
      const float* pattern = weights + e * 20;
      for (size_t k = 0; k < vectors; ++k) {
        const auto w = hn::LoadU(d, pattern + phase[k]);
        sum[k] = hn::MulAdd(w, hn::LoadU(d, row + k * lanes), sum[k]);
      }
    }
  }
  for (size_t k = 0; k < vectors; ++k) hn::StoreU(sum[k], d, acc + offset + k * lanes);
}

template <int channels>
void GatherAll(const uint32_t* columns, const float* weights, size_t entries, const float* x, size_t stride, size_t width,
               float* acc) {
  const F d;
  const size_t lanes = hn::Lanes(d);
  size_t j = 0;
  for (; j + 8 * lanes <= width; j += 8 * lanes) GatherVectors<8, channels>(columns, weights, entries, x, stride, j, acc);
  switch ((width - j) / lanes) {
    case 7: GatherVectors<7, channels>(columns, weights, entries, x, stride, j, acc); break;
    case 6: GatherVectors<6, channels>(columns, weights, entries, x, stride, j, acc); break;
    case 5: GatherVectors<5, channels>(columns, weights, entries, x, stride, j, acc); break;
    case 4: GatherVectors<4, channels>(columns, weights, entries, x, stride, j, acc); break;
    case 3: GatherVectors<3, channels>(columns, weights, entries, x, stride, j, acc); break;
    case 2: GatherVectors<2, channels>(columns, weights, entries, x, stride, j, acc); break;
    case 1: GatherVectors<1, channels>(columns, weights, entries, x, stride, j, acc); break;
    default: break;
  }
}

void GatherRows(const uint32_t* columns, const uint16_t* weights, size_t entries, int channels, const float* x, size_t stride,
                size_t width, float* acc) {
  const F d;
  const hn::Rebind<hwy::float16_t, F> dh;
  constexpr size_t chunk = 64;
  HWY_ALIGN float w[chunk * 20 + 16];
  for (size_t begin = 0; begin < entries; begin += chunk) {
    const size_t n = std::min(chunk, entries - begin);
    const uint16_t* half = weights + begin * size_t(channels);
    const size_t count = n * size_t(channels);
    HWY_ALIGN float decoded[chunk * 3 + 4];
    size_t i = 0;
    for (; i + hn::Lanes(d) <= count; i += hn::Lanes(d))
      hn::StoreU(hn::PromoteTo(d, hn::LoadU(dh, reinterpret_cast<const hwy::float16_t*>(half + i))), d, decoded + i);
    for (; i < count; ++i) decoded[i] = half_to_float(half[i]);
    if (channels == 1) {
      GatherAll<1>(columns + begin, decoded, n, x, stride, width, acc);
      continue;
    }
    for (size_t e = 0; e < n; ++e)
      for (size_t k = 0; k < 20; ++k) w[e * 20 + k] = decoded[e * 3 + k % 3];
    GatherAll<3>(columns + begin, w, n, x, stride, width, acc);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {

HWY_EXPORT(RotateDirections);
HWY_EXPORT(WeightedRows);
HWY_EXPORT(GatherRows);

void rotate_directions(const Mat3& R, const float* x, const float* y, const float* z, size_t count, float* ox, float* oy, float* oz) {
  LAMBENT_CHECK(count % lane_multiple == 0);
  HWY_DYNAMIC_DISPATCH(RotateDirections)(&R[0][0], x, y, z, count, ox, oy, oz);
}

void weighted_rows(const float* table, size_t rows, size_t stride, const float* weights, size_t count, float* out) {
  LAMBENT_CHECK(count % lane_multiple == 0 && stride % lane_multiple == 0);
  HWY_DYNAMIC_DISPATCH(WeightedRows)(table, rows, stride, weights, count, out);
}

void gather_rows(const uint32_t* columns, const uint16_t* weights, size_t entries, int channels, const float* x, size_t stride,
                 size_t width, float* acc) {
  LAMBENT_CHECK(width % lane_multiple == 0 && width <= stride && (channels == 1 || channels == 3));
  HWY_DYNAMIC_DISPATCH(GatherRows)(columns, weights, entries, channels, x, stride, width, acc);
}

}  // namespace lambent
#endif
