#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/relight/block_runs.h>

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

constexpr size_t B = transfer_block;

// Where sums go: a row of a block, 3 x 16 numbers, after another. Into a Relit, past the caches.
struct Planar {
  float* out;
  template <class V>
  void put(V sums, size_t at) {
    hn::Stream(sums, F(), out + at);
  }
  void next() { out += 3 * B; }
};

// Into the caller's memory, [receiver][row][r, g, b].
struct Interleaved {
  float* out;
  size_t stride, rows, receivers;  // receivers that are left, this block's included
  size_t row = 0;
  alignas(64) float planar[3 * B] = {};

  template <class V>
  void put(V sums, size_t at) {
    hn::Store(sums, F(), planar + at);
  }
  void next() {
    const F d;
    if (rows == 1 && stride == 3 && receivers >= B) {
      alignas(64) float mixed[3 * B];
      for (size_t part = 0; part < B; part += hn::Lanes(d))
        hn::StoreInterleaved3(hn::Load(d, planar + part), hn::Load(d, planar + B + part),
                              hn::Load(d, planar + 2 * B + part), d, mixed + 3 * part);
      if (reinterpret_cast<uintptr_t>(out) % 64 == 0)
        for (size_t i = 0; i < 3 * B; i += hn::Lanes(d)) hn::Stream(hn::Load(d, mixed + i), d, out + i);
      else std::copy(mixed, mixed + 3 * B, out);
    } else {
      for (size_t i = 0; i < std::min(B, receivers); ++i)
        for (size_t c = 0; c < 3; ++c) out[i * stride + 3 * row + c] = planar[c * B + i];
    }
    if (++row < rows) return;
    row = 0, out += B * stride, receivers -= std::min(B, receivers);
  }
};

// light is [channel][column]. A sum is kept in registers while its columns stream by, in memory order: reading several
// channels at once would confuse the hardware's prefetching. Even and odd columns are summed apart, to hide the latency
// of adding.
template <class Value, class Sink>
void RelightGrey(const Value* t, size_t pieces, size_t columns, const float* light, Sink& out) {
  const F d;
  for (size_t b = 0; b < pieces; ++b, t += columns * B, out.next()) {
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
      out.put(hn::Add(r0, r1), part);
      out.put(hn::Add(g0, g1), B + part);
      out.put(hn::Add(b0, b1), 2 * B + part);
    }
  }
}

template <class Value, class Sink>
void RelightColoured(const Value* t, size_t pieces, size_t columns, const float* light, Sink& out) {
  const F d;
  for (size_t b = 0; b < pieces; ++b, out.next()) {
    const float* l = light;
    for (size_t channel = 0; channel < 3; ++channel, t += columns * B, l += columns) {
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
        out.put(hn::Add(hn::Add(s0, s1), hn::Add(s2, s3)), channel * B + part);
      }
    }
  }
}

template <class Sink>
void RelightPieces(const Transfer& t, size_t block, size_t pieces, const float* light, Sink out) {
  const uint8_t* data = t.data.data() + block * t.block_values() * t.value_bytes();
  auto run = [&](const auto* values) {
    if (t.channels == 1) RelightGrey(values, pieces, t.columns(), light, out);
    else RelightColoured(values, pieces, t.columns(), light, out);
  };
  if (t.precision == Precision::half) run(reinterpret_cast<const hwy::float16_t*>(data));
  else run(reinterpret_cast<const float*>(data));
  hwy::FlushStream();
}

// To the loops, a block's row is a block.
void RelightToRelit(const Transfer& t, size_t begin, size_t end, const float* light, float* out) {
  const size_t rows = size_t(t.rows);
  RelightPieces(t, begin, (end - begin) * rows, light, Planar{out + begin * rows * 3 * B});
}
void RelightToMemory(const Transfer& t, size_t begin, size_t end, const float* light, float* out, size_t stride) {
  RelightPieces(t, begin, (end - begin) * size_t(t.rows), light,
                Interleaved{out + begin * B * stride, stride, size_t(t.rows), t.receivers - begin * B});
}

}  // namespace HWY_NAMESPACE
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {

HWY_EXPORT(RelightToRelit);
HWY_EXPORT(RelightToMemory);

namespace {

// body(begin, end, light [channel][column]) for runs of blocks.
template <class Body>
void for_blocks(const Transfer& t, std::span<const Vec3> light, const BlockRuns* only, const Body& body) {
  const size_t C = t.columns();
  LAMBENT_CHECK(light.size() >= C && C <= max_columns && t.data.size() == t.bytes());
  float planar[3 * max_columns];
  for (size_t k = 0; k < C; ++k)
    for (size_t c = 0; c < 3; ++c) planar[c * C + k] = light[k][c];
  const size_t grain = std::max<size_t>(1, (size_t{1} << 20) / (t.block_values() * t.value_bytes()));
  parallel_blocks(t.blocks(), grain, only, [&](size_t begin, size_t end) { body(begin, end, planar); });
}

}  // namespace

void relight(const Transfer& t, std::span<const Vec3> light, Relit& out) { relight(t, light, out, nullptr); }

void relight(const Transfer& t, std::span<const Vec3> light, Relit& out, const BlockRuns* only) {
  out.rows = t.rows;
  out.values.resize(t.blocks() * size_t(t.rows) * 3 * transfer_block);
  for_blocks(t, light, only, [&](size_t begin, size_t end, const float* planar) {
    HWY_DYNAMIC_DISPATCH(RelightToRelit)(t, begin, end, planar, out.values.data());
  });
}

void relight(const Transfer& t, std::span<const Vec3> light, std::span<float> out, size_t stride) {
  const size_t each = 3 * size_t(t.rows);
  LAMBENT_CHECK(stride >= each && (t.receivers == 0 || out.size() >= (t.receivers - 1) * stride + each));
  for_blocks(t, light, nullptr, [&](size_t begin, size_t end, const float* planar) {
    HWY_DYNAMIC_DISPATCH(RelightToMemory)(t, begin, end, planar, out.data(), stride);
  });
}

void interleave(const Relit& relit, size_t receivers, std::span<float> out, size_t stride) {
  const size_t each = 3 * size_t(relit.rows);
  LAMBENT_CHECK(stride >= each && (receivers == 0 || out.size() >= (receivers - 1) * stride + each));
  parallel_for(receivers, 4096, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r)
      for (int row = 0; row < relit.rows; ++row) {
        const Vec3 v = relit.at(r, row);
        float* o = out.data() + r * stride + 3 * size_t(row);
        o[0] = v.x, o[1] = v.y, o[2] = v.z;
      }
  });
}

}  // namespace lambent
#endif
