#include <lambent/bake/kernels.h>
#include <lambent/core/check.h>
#include <lambent/core/half.h>

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/bake/kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/cache_control.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// At most 16 lanes, so that padded arrays hold whole vectors.
using F = hn::CappedTag<float, 16>;

void RotateDirections(const float* R, const float* x, const float* y, const float* z, size_t count, float* ox,
                      float* oy, float* oz) {
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

// Entries [begin, end) of one column, `vectors` vectors of it: the column's values stay in registers while rows of acc
// pass by.
template <size_t vectors, int channels>
HWY_INLINE void AddColumn(const float* x, const uint8_t* rows, const float* weights, size_t begin, size_t end,
                          size_t width, size_t offset, float* acc) {
  const F d;
  constexpr size_t lanes = hn::MaxLanes(F());
  hn::Vec<F> value[vectors];
  for (size_t k = 0; k < vectors; ++k) value[k] = hn::LoadU(d, x + offset + k * lanes);
  // Lane i of vector k takes weight (offset + k lanes + i) % 3: three patterns in turn.
  HWY_ALIGN int32_t pattern[3][lanes];
  for (size_t p = 0; p < 3; ++p)
    for (size_t i = 0; i < lanes; ++i) pattern[p][i] = int32_t((offset + p * lanes + i) % 3);
#if HWY_TARGET != HWY_SCALAR
  const auto i0 = hn::SetTableIndices(d, pattern[0]), i1 = hn::SetTableIndices(d, pattern[1]),
             i2 = hn::SetTableIndices(d, pattern[2]);
#endif
  for (size_t e = begin; e < end; ++e) {
    float* row = acc + size_t(rows[e]) * width + offset;
    if constexpr (channels == 1) {
      const auto w = hn::Set(d, weights[e]);
      for (size_t k = 0; k < vectors; ++k)
        hn::StoreU(hn::MulAdd(w, value[k], hn::LoadU(d, row + k * lanes)), d, row + k * lanes);
    } else {
#if HWY_TARGET != HWY_SCALAR
      const auto rgb = hn::LoadDup128(d, weights + 4 * e);
      const hn::Vec<F> w[3] = {hn::TableLookupLanes(rgb, i0), hn::TableLookupLanes(rgb, i1),
                               hn::TableLookupLanes(rgb, i2)};
#else
      const hn::Vec<F> w[3] = {hn::Set(d, weights[4 * e + size_t(pattern[0][0])]),
                               hn::Set(d, weights[4 * e + size_t(pattern[1][0])]),
                               hn::Set(d, weights[4 * e + size_t(pattern[2][0])])};
#endif
      for (size_t k = 0; k < vectors; ++k)
        hn::StoreU(hn::MulAdd(w[k % 3], value[k], hn::LoadU(d, row + k * lanes)), d, row + k * lanes);
    }
  }
}

template <int channels>
HWY_INLINE void AddColumnAll(const float* x, const uint8_t* rows, const float* weights, size_t begin, size_t end,
                             size_t width, float* acc) {
  constexpr size_t lanes = hn::MaxLanes(F());
  size_t j = 0;
  for (; j + 8 * lanes <= width; j += 8 * lanes) AddColumn<8, channels>(x, rows, weights, begin, end, width, j, acc);
  switch ((width - j) / lanes) {
    case 7: AddColumn<7, channels>(x, rows, weights, begin, end, width, j, acc); break;
    case 6: AddColumn<6, channels>(x, rows, weights, begin, end, width, j, acc); break;
    case 5: AddColumn<5, channels>(x, rows, weights, begin, end, width, j, acc); break;
    case 4: AddColumn<4, channels>(x, rows, weights, begin, end, width, j, acc); break;
    case 3: AddColumn<3, channels>(x, rows, weights, begin, end, width, j, acc); break;
    case 2: AddColumn<2, channels>(x, rows, weights, begin, end, width, j, acc); break;
    case 1: AddColumn<1, channels>(x, rows, weights, begin, end, width, j, acc); break;
    default: break;
  }
}

void MultiplyEntries(const SparseEntries& s, int channels, const float* x, size_t width, float* acc) {
  const F d;
  const hn::Rebind<hwy::float16_t, F> dh;
  // Weights are decoded a window at a time, three of them spread to four for aligned broadcasts.
  constexpr size_t window = 512;
  HWY_ALIGN float decoded[window * 3 + 16];
  HWY_ALIGN float spread[window * 4];
  const size_t entries = s.column_count ? s.ends[s.column_count - 1] : 0;
  size_t column = 0;
  for (size_t first = 0; first < entries; first += window) {
    const size_t n = std::min(window, entries - first), count = n * size_t(channels);
    const uint16_t* half = s.weights + first * size_t(channels);
    size_t i = 0;
    for (; i + hn::Lanes(d) <= count; i += hn::Lanes(d))
      hn::StoreU(hn::PromoteTo(d, hn::LoadU(dh, reinterpret_cast<const hwy::float16_t*>(half + i))), d, decoded + i);
    for (; i < count; ++i) decoded[i] = half_to_float(half[i]);
    if (channels == 3)
      for (size_t e = 0; e < n; ++e) {
        spread[4 * e] = decoded[3 * e], spread[4 * e + 1] = decoded[3 * e + 1], spread[4 * e + 2] = decoded[3 * e + 2];
        spread[4 * e + 3] = 0;
      }
    for (size_t e = 0; e < n;) {
      const size_t end = std::min(size_t(s.ends[column]) - first, n);
      // The columns are known ahead: ask for a row of x well before its turn.
      if (column + 4 < s.column_count) {
        const float* ahead = x + size_t(s.columns[column + 4]) * width;
        for (size_t j = 0; j < width; j += 16) hwy::Prefetch(ahead + j);
      }
      const float* row = x + size_t(s.columns[column]) * width;
      if (channels == 1) AddColumnAll<1>(row, s.rows + first, decoded, e, end, width, acc);
      else AddColumnAll<3>(row, s.rows + first, spread, e, end, width, acc);
      e = end;
      if (first + end == s.ends[column]) ++column;
    }
  }
}

void FloatsToHalves(const float* floats, size_t count, uint16_t* halves) {
  const F d;
  const hn::Rebind<hwy::float16_t, F> dh;
  size_t i = 0;
  for (; i + hn::Lanes(d) <= count; i += hn::Lanes(d))
    hn::StoreU(hn::DemoteTo(dh, hn::LoadU(d, floats + i)), dh, reinterpret_cast<hwy::float16_t*>(halves + i));
  for (; i < count; ++i) halves[i] = float_to_half(floats[i]);
}

// The shape of a lobe at cosines c.
template <class V>
V LobeShape(LobeKind kind, float sharpness, V c) {
  const F d;
  const auto s = hn::Set(d, sharpness), one = hn::Set(d, 1.0f);
  switch (kind) {
    case LobeKind::cosine_power:
      // The logarithm needs a positive number, and anything to the power of 1 or more that small is as good as 0.
      return hn::Exp(d, hn::Mul(s, hn::Log(d, hn::Max(c, hn::Set(d, 1e-30f)))));
    case LobeKind::von_mises_fisher: return hn::Exp(d, hn::Mul(s, hn::Sub(c, one)));
    case LobeKind::compact: {
      const auto inside = hn::Max(hn::Zero(d), hn::MulAdd(hn::Set(d, sharpness / 3), hn::Sub(c, one), one));
      return hn::Mul(inside, hn::Mul(inside, inside));
    }
    case LobeKind::band_limited: break;
  }
  auto before = one, at = c, sum = one;
  const float peak = sharpness * sharpness;
  for (int l = 1; l < int(sharpness); ++l) {
    sum = hn::MulAdd(hn::Set(d, float(2 * l + 1)), at, sum);
    const float k = float(l);
    const auto next =
        hn::NegMulAdd(hn::Set(d, k / (k + 1)), before, hn::Mul(hn::Set(d, (2 * k + 1) / (k + 1)), hn::Mul(c, at)));
    before = at, at = next;
  }
  return hn::Mul(sum, hn::Set(d, 1 / peak));
}

void LobeValues(LobeKind kind, const float* axis, float sharpness, float scale, const float* x, const float* y,
                const float* z, size_t count, float* out) {
  const F d;
  const auto ax = hn::Set(d, axis[0]), ay = hn::Set(d, axis[1]), az = hn::Set(d, axis[2]), peak = hn::Set(d, scale);
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto c =
        hn::MulAdd(ax, hn::LoadU(d, x + i), hn::MulAdd(ay, hn::LoadU(d, y + i), hn::Mul(az, hn::LoadU(d, z + i))));
    hn::StoreU(hn::Mul(peak, LobeShape(kind, sharpness, c)), d, out + i);
  }
}

void MultiplyValues(const float* a, const float* b, size_t count, float* out) {
  const F d;
  for (size_t i = 0; i < count; i += hn::Lanes(d))
    hn::StoreU(hn::Mul(hn::LoadU(d, a + i), hn::LoadU(d, b + i)), d, out + i);
}

}  // namespace HWY_NAMESPACE
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {

HWY_EXPORT(RotateDirections);
HWY_EXPORT(WeightedRows);
HWY_EXPORT(MultiplyEntries);
HWY_EXPORT(FloatsToHalves);
HWY_EXPORT(LobeValues);
HWY_EXPORT(MultiplyValues);

void rotate_directions(const Mat3& R, const float* x, const float* y, const float* z, size_t count, float* ox,
                       float* oy, float* oz) {
  LAMBENT_CHECK(count % lane_multiple == 0);
  HWY_DYNAMIC_DISPATCH(RotateDirections)(&R[0][0], x, y, z, count, ox, oy, oz);
}

void weighted_rows(const float* table, size_t rows, size_t stride, const float* weights, size_t count, float* out) {
  LAMBENT_CHECK(count % lane_multiple == 0 && stride % lane_multiple == 0);
  HWY_DYNAMIC_DISPATCH(WeightedRows)(table, rows, stride, weights, count, out);
}

void lobe_values(LobeKind kind, Vec3 axis, float sharpness, float scale, const float* x, const float* y, const float* z,
                 size_t count, float* out) {
  LAMBENT_CHECK(count % lane_multiple == 0);
  HWY_DYNAMIC_DISPATCH(LobeValues)(kind, &axis[0], sharpness, scale, x, y, z, count, out);
}

void multiply_values(const float* a, const float* b, size_t count, float* out) {
  LAMBENT_CHECK(count % lane_multiple == 0);
  HWY_DYNAMIC_DISPATCH(MultiplyValues)(a, b, count, out);
}

void floats_to_halves(const float* floats, size_t count, uint16_t* halves) {
  HWY_DYNAMIC_DISPATCH(FloatsToHalves)(floats, count, halves);
}

void multiply_entries(const SparseEntries& entries, int channels, const float* x, size_t width, float* acc) {
  LAMBENT_CHECK(width % lane_multiple == 0 && (channels == 1 || channels == 3));
  HWY_DYNAMIC_DISPATCH(MultiplyEntries)(entries, channels, x, width, acc);
}

}  // namespace lambent
#endif
