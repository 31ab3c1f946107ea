#include <lambent/basis/sh_product_tile.h>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/basis/sh_product_tile.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using F = hn::CappedTag<float, 16>;

// Four vectors of functions at a time, so that an entry and its place are read once for them.
void MultiplyTile(const ShTileProduct& p, const float* HWY_RESTRICT a, const float* HWY_RESTRICT b,
                  float* HWY_RESTRICT out) {
  const F d;
  constexpr size_t lanes = hn::MaxLanes(F()), strip = 4 * lanes;
  for (size_t at = 0; at < sh_tile; at += strip) {
    const ShTileProduct::Row* row = p.rows.data();
    const uint16_t* j = p.j.data();
    const float* value = p.value.data();
    for (size_t k = 0; k < p.rows_of.size(); ++k) {
      auto s0 = hn::Zero(d), s1 = s0, s2 = s0, s3 = s0;
      for (size_t end = p.rows_of[k]; end > 0; --end, ++row) {
        auto t0 = hn::Zero(d), t1 = t0, t2 = t0, t3 = t0;
        for (size_t e = row->count; e > 0; --e, ++j, ++value) {
          const auto c = hn::Set(d, *value);
          const float* from = b + size_t(*j) * sh_tile + at;
          t0 = hn::MulAdd(c, hn::Load(d, from), t0), t1 = hn::MulAdd(c, hn::Load(d, from + lanes), t1);
          t2 = hn::MulAdd(c, hn::Load(d, from + 2 * lanes), t2), t3 = hn::MulAdd(c, hn::Load(d, from + 3 * lanes), t3);
        }
        const float* from = a + size_t(row->i) * sh_tile + at;
        s0 = hn::MulAdd(t0, hn::Load(d, from), s0), s1 = hn::MulAdd(t1, hn::Load(d, from + lanes), s1);
        s2 = hn::MulAdd(t2, hn::Load(d, from + 2 * lanes), s2), s3 = hn::MulAdd(t3, hn::Load(d, from + 3 * lanes), s3);
      }
      float* to = out + k * sh_tile + at;
      hn::Store(s0, d, to), hn::Store(s1, d, to + lanes);
      hn::Store(s2, d, to + 2 * lanes), hn::Store(s3, d, to + 3 * lanes);
    }
  }
}

void DotTile(const float* HWY_RESTRICT a, const Vec3* light, size_t count, float* HWY_RESTRICT out) {
  const F d;
  constexpr size_t lanes = hn::MaxLanes(F());
  for (size_t at = 0; at < sh_tile; at += lanes) {
    auto r = hn::Zero(d), g = r, b = r;
    for (size_t k = 0; k < count; ++k) {
      const auto v = hn::Load(d, a + k * sh_tile + at);
      r = hn::MulAdd(v, hn::Set(d, light[k].x), r), g = hn::MulAdd(v, hn::Set(d, light[k].y), g);
      b = hn::MulAdd(v, hn::Set(d, light[k].z), b);
    }
    hn::Store(r, d, out + at), hn::Store(g, d, out + sh_tile + at), hn::Store(b, d, out + 2 * sh_tile + at);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {
namespace {
HWY_EXPORT(MultiplyTile);
HWY_EXPORT(DotTile);
}  // namespace

ShTileProduct make_sh_tile_product(int order_a, int order_b, int order_c) {
  const TriplingTensor t = make_tripling_tensor(order_a, order_b, order_c);
  ShTileProduct p{order_a, order_b, order_c, {}, {}, t.j, t.single};
  for (size_t k = 0; k + 1 < t.begin.size(); ++k) {
    const size_t first = p.rows.size();
    for (uint32_t e = t.begin[k]; e < t.begin[k + 1]; ++e) {
      if (p.rows.size() == first || p.rows.back().i != t.i[e]) p.rows.push_back({t.i[e], 0});
      ++p.rows.back().count;
    }
    p.rows_of.push_back(uint16_t(p.rows.size() - first));
  }
  return p;
}

const ShTileProduct& ShTileProducts::make(int a, int b, int c) {
  auto& slot = made_[{a, b, c}];
  if (!slot) slot = std::make_unique<const ShTileProduct>(make_sh_tile_product(a, b, c));
  return *slot;
}

void multiply_sh_tile(const ShTileProduct& product, const float* a, const float* b, float* out) {
  HWY_DYNAMIC_DISPATCH(MultiplyTile)(product, a, b, out);
}

void dot_sh_tile(const float* a, std::span<const Vec3> light, float* out) {
  HWY_DYNAMIC_DISPATCH(DotTile)(a, light.data(), light.size(), out);
}

}  // namespace lambent
#endif
