#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/relight/relight.h>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/relight/relight.cpp"
#include <hwy/foreach_target.h>
#include <hwy/cache_control.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::CappedTag<float, 16>;

inline auto LoadValues(const F d, const float* p) { return hn::LoadU(d, p); }
inline auto LoadValues(const F d, const hwy::float16_t* p) {
  return hn::PromoteTo(d, hn::LoadU(hn::Rebind<hwy::float16_t, F>(), p));
}

// light is [channel][column]. A sum is kept in registers while its columns stream by, in memory order: reading several
// channels at once would confuse the hardware's prefetching. Even and odd columns are summed apart, to hide the latency
// of adding.
template <class Value>
void RelightGrey(const Value* t, size_t pieces, size_t columns, const float* light, float* out) {
  const F d;
  constexpr size_t B = 16;
  for (size_t b = 0; b < pieces; ++b, t += columns * B, out += 3 * B) {
    for (size_t part = 0; part < B; part += hn::Lanes(d)) {
      auto r0 = hn::Zero(d), g0 = r0, b0 = r0, r1 = r0, g1 = r0, b1 = r0;
      const Value* p = t + part;
      size_t k = 0;
      for (; k + 2 <= columns; k += 2, p += 2 * B) {
        const auto even = LoadValues(d, p), odd = LoadValues(d, p + B);
        r0 = hn::MulAdd(even, hn::Set(d, light[k]), r0);
        g0 = hn::MulAdd(even, hn::Set(d, light[columns + k]), g0);
        b0 = hn::MulAdd(even, hn::Set(d, light[2 * columns + k]), b0);
        r1 = hn::MulAdd(odd, hn::Set(d, light[k + 1]), r1);
        g1 = hn::MulAdd(odd, hn::Set(d, light[columns + k + 1]), g1);
        b1 = hn::MulAdd(odd, hn::Set(d, light[2 * columns + k + 1]), b1);
      }
      if (k < columns) {
        const auto last = LoadValues(d, p);
        r0 = hn::MulAdd(last, hn::Set(d, light[k]), r0);
        g0 = hn::MulAdd(last, hn::Set(d, light[columns + k]), g0);
        b0 = hn::MulAdd(last, hn::Set(d, light[2 * columns + k]), b0);
      }
      hn::Stream(hn::Add(r0, r1), d, out + part);
      hn::Stream(hn::Add(g0, g1), d, out + B + part);
      hn::Stream(hn::Add(b0, b1), d, out + 2 * B + part);
    }
  }
  hwy::FlushStream();
}

template <class Value>
void RelightColoured(const Value* t, size_t pieces, size_t columns, const float* light, float* out) {
  const F d;
  constexpr size_t B = 16;
  for (size_t b = 0; b < pieces; ++b) {
    const float* l = light;
    for (int channel = 0; channel < 3; ++channel, t += columns * B, l += columns, out += B) {
      for (size_t part = 0; part < B; part += hn::Lanes(d)) {
        auto s0 = hn::Zero(d), s1 = s0, s2 = s0, s3 = s0;
        const Value* p = t + part;
        size_t k = 0;
        for (; k + 4 <= columns; k += 4, p += 4 * B) {
          s0 = hn::MulAdd(LoadValues(d, p), hn::Set(d, l[k]), s0);
          s1 = hn::MulAdd(LoadValues(d, p + B), hn::Set(d, l[k + 1]), s1);
          s2 = hn::MulAdd(LoadValues(d, p + 2 * B), hn::Set(d, l[k + 2]), s2);
          s3 = hn::MulAdd(LoadValues(d, p + 3 * B), hn::Set(d, l[k + 3]), s3);
        }
        for (; k < columns; ++k, p += B) s0 = hn::MulAdd(LoadValues(d, p), hn::Set(d, l[k]), s0);
        hn::Stream(hn::Add(hn::Add(s0, s1), hn::Add(s2, s3)), d, out + part);
      }
    }
  }
  hwy::FlushStream();
}

template <class Value>
void RelightPieces(const Value* t, size_t pieces, size_t columns, int channels, const float* light, float* out) {
  if (channels == 1) RelightGrey(t, pieces, columns, light, out);
  else RelightColoured(t, pieces, columns, light, out);
}

void RelightHalf(const uint8_t* t, size_t pieces, size_t columns, int channels, const float* light, float* out) {
  RelightPieces(reinterpret_cast<const hwy::float16_t*>(t), pieces, columns, channels, light, out);
}
void RelightSingle(const uint8_t* t, size_t pieces, size_t columns, int channels, const float* light, float* out) {
  RelightPieces(reinterpret_cast<const float*>(t), pieces, columns, channels, light, out);
}

}  // namespace HWY_NAMESPACE
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {

HWY_EXPORT(RelightHalf);
HWY_EXPORT(RelightSingle);

void relight(const Transfer& t, std::span<const Vec3> light, Relit& out) {
  const size_t C = t.columns(), rows = size_t(t.rows);
  LAMBENT_CHECK(light.size() >= C && C <= max_columns && t.data.size() == t.bytes());
  float planar[3 * max_columns];
  for (size_t k = 0; k < C; ++k)
    for (int c = 0; c < 3; ++c) planar[size_t(c) * C + k] = light[k][c];
  out.rows = t.rows;
  out.values.resize(t.blocks() * rows * 3 * transfer_block);
  const size_t block_bytes = t.block_values() * t.value_bytes();
  const size_t grain = std::max<size_t>(1, (size_t{1} << 20) / block_bytes);
  parallel_for(t.blocks(), grain, [&](size_t begin, size_t end) {
    const uint8_t* data = t.data.data() + begin * block_bytes;
    float* values = out.values.data() + begin * rows * 3 * transfer_block;
    const size_t pieces = (end - begin) * rows;  // to the loop, a block's row is a block
    if (t.precision == Precision::half) HWY_DYNAMIC_DISPATCH(RelightHalf)(data, pieces, C, t.channels, planar, values);
    else HWY_DYNAMIC_DISPATCH(RelightSingle)(data, pieces, C, t.channels, planar, values);
  });
}

}  // namespace lambent
#endif
