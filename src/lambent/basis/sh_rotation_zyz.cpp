// Follows: local-deformable-prt (rotation by z-x-z-x-z). In SIMD lanes each class of a band (sh_rotation_zyz-inl.h), at
// most four harmonics up to order 8, is one vector of four lanes, padded with zeros in the blocks: a turn about z has
// no shuffles, and a quarter turn about x broadcasts lane after lane.
#include <lambent/basis/quadrature.h>
#include <lambent/basis/sh_rotation_zyz-inl.h>
#include <lambent/basis/sh_rotation_zyz.h>
#include <lambent/core/aligned.h>
#include <lambent/core/check.h>

#include <array>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/basis/sh_rotation_zyz.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR
// Without vectors this is the plain code.
void RotateBands(int order, const EulerZyz& e, const float* blocks, const float*, const float* in, float* out) {
  const size_t count = size_t(sh_count(order));
  const float angles[6] = {e.cos_a, e.sin_a, e.cos_b, e.sin_b, e.cos_c, e.sin_c};
  float f[sh_count(max_sh_order)], scratch[sh_count(max_sh_order)];
  std::copy(in, in + count, f);
  zyz::rotate_bands(2, order, angles, blocks, f, scratch);
  std::copy(f + 4, f + count, out + 4);
}
#else
using F4 = hn::FixedTag<float, 4>;
using V4 = hn::Vec<F4>;

struct Turn {
  V4 even_cos, even_sin, odd_cos, odd_sin;  // of m t, m = 0 2 4 6 and 1 3 5 7
};
template <bool up_to_3>  // m = 0 1 2 3 only: lanes 2 and 3 repeat 0 and 1
HWY_INLINE Turn MakeTurn(float cosine, float sine) {
  const F4 d;
  auto times = [](V4& c, V4& s, V4 ac, V4 as, V4 bc, V4 bs) {
    c = hn::NegMulAdd(as, bs, hn::Mul(ac, bc)), s = hn::MulAdd(ac, bs, hn::Mul(as, bc));
  };
  const V4 one = hn::Set(d, 1.0f), zero = hn::Zero(d), c1 = hn::Set(d, cosine), s1 = hn::Set(d, sine);
  V4 c2, s2, c4, s4, next_c, next_s;
  times(c2, s2, c1, s1, c1, s1);
  const V4 low_c = hn::OddEven(c2, one), low_s = hn::OddEven(s2, zero);  // 0 2 0 2
  times(next_c, next_s, low_c, low_s, c1, s1);                           // 1 3 1 3
  if constexpr (up_to_3) return {low_c, low_s, next_c, next_s};
  times(c4, s4, c2, s2, c2, s2);
  const V4 high_c = hn::ConcatUpperLower(d, c4, one), high_s = hn::ConcatUpperLower(d, s4, zero);  // 0 0 4 4
  Turn t;
  times(t.even_cos, t.even_sin, high_c, high_s, low_c, low_s);
  times(t.odd_cos, t.odd_sin, high_c, high_s, next_c, next_s);
  return t;
}

HWY_INLINE void TurnAboutZ(const Turn& t, V4 f[4]) {
  const V4 c0 = f[0], c1 = f[1];
  f[0] = hn::NegMulAdd(f[2], t.even_sin, hn::Mul(c0, t.even_cos)),
  f[2] = hn::MulAdd(c0, t.even_sin, hn::Mul(f[2], t.even_cos));
  f[1] = hn::NegMulAdd(f[3], t.odd_sin, hn::Mul(c1, t.odd_cos)),
  f[3] = hn::MulAdd(c1, t.odd_sin, hn::Mul(f[3], t.odd_cos));
}

// Columns of one padded block; lanes of sines of even m begin at m = 0.
template <int width>
HWY_INLINE V4 Columns(const float* HWY_RESTRICT column, V4 v) {
  const F4 d;
  V4 sum = hn::Mul(hn::Load(d, column), hn::Broadcast<0>(v));
  sum = hn::MulAdd(hn::Load(d, column + 4), hn::Broadcast<1>(v), sum);
  if constexpr (width > 2) sum = hn::MulAdd(hn::Load(d, column + 8), hn::Broadcast<2>(v), sum);
  if constexpr (width > 3) sum = hn::MulAdd(hn::Load(d, column + 12), hn::Broadcast<3>(v), sum);
  return sum;
}

// Band l from `in` to `out`, which may be the same.
template <int l>
HWY_INLINE void RotateBand(const Turn turns[3], const float* HWY_RESTRICT columns, const float* in, float* out) {
  const F4 d;
  constexpr int width = l / 2 + 1;
  const float* centre = in + l * (l + 1);
  // m = 0 .. 3, 4 .. 7, -7 .. -4, -3 .. 0, without reading beyond the band.
  V4 c_low, c_high, s_low, s_high;
  if constexpr (l == 2) {
    c_low = hn::ShiftRightLanes<1>(d, hn::LoadU(d, centre - 1));
    s_high = hn::ShiftLeftLanes<1>(d, hn::LoadU(d, centre - 2));
  } else {
    c_low = hn::LoadU(d, centre), s_high = hn::LoadU(d, centre - 3);
  }
  if constexpr (l < 4) {
    c_high = s_low = hn::Zero(d);
  } else if constexpr (l == 7) {
    c_high = hn::LoadU(d, centre + 4), s_low = hn::LoadU(d, centre - 7);
  } else {
    c_high = hn::ShiftRightLanes<7 - l>(d, hn::LoadU(d, centre + l - 3));
    s_low = hn::ShiftLeftLanes<7 - l>(d, hn::LoadU(d, centre - l));
  }
  V4 f[4] = {hn::ConcatEven(d, c_high, c_low), hn::ConcatOdd(d, c_high, c_low),
             hn::Reverse(d, hn::ConcatOdd(d, s_high, s_low)), hn::Reverse(d, hn::ConcatEven(d, s_high, s_low))};
  TurnAboutZ(turns[2], f);
  const float* table = columns + size_t(l - 2) * 8 * 16;
  V4 g[4];
  for (int c = 0; c < 4; ++c) g[c] = Columns<width>(table + c * 16, f[zyz::class_source(l, c)]);
  TurnAboutZ(turns[1], g);
  for (int c = 0; c < 4; ++c) f[zyz::class_source(l, c)] = Columns<width>(table + (4 + c) * 16, g[c]);
  TurnAboutZ(turns[0], f);
  HWY_ALIGN float cosines[8], sines[8];
  hn::Store(hn::InterleaveLower(d, f[0], f[1]), d, cosines),
      hn::Store(hn::InterleaveUpper(d, f[0], f[1]), d, cosines + 4);
  hn::Store(hn::Reverse(d, hn::InterleaveLower(d, f[2], f[3])), d, sines + 4);
  hn::Store(hn::Reverse(d, hn::InterleaveUpper(d, f[2], f[3])), d, sines);
  std::memcpy(out + l * (l + 1), cosines, (l + 1) * sizeof(float));
  std::memcpy(out + l * l, sines + 7 - l, l * sizeof(float));
}

// Bands 2 and up, order 3 .. simd_order.
void RotateBands(int order, const EulerZyz& e, const float*, const float* columns, const float* in, float* out) {
  if (order <= 4) {
    const Turn turns[3] = {MakeTurn<true>(e.cos_a, e.sin_a), MakeTurn<true>(e.cos_b, e.sin_b),
                           MakeTurn<true>(e.cos_c, e.sin_c)};
    RotateBand<2>(turns, columns, in, out);
    if (order > 3) RotateBand<3>(turns, columns, in, out);
    return;
  }
  const Turn turns[3] = {MakeTurn<false>(e.cos_a, e.sin_a), MakeTurn<false>(e.cos_b, e.sin_b),
                         MakeTurn<false>(e.cos_c, e.sin_c)};
  RotateBand<2>(turns, columns, in, out);
  RotateBand<3>(turns, columns, in, out);
  RotateBand<4>(turns, columns, in, out);
  if (order > 5) RotateBand<5>(turns, columns, in, out);
  if (order > 6) RotateBand<6>(turns, columns, in, out);
  if (order > 7) RotateBand<7>(turns, columns, in, out);
}
#endif

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {
namespace zyz {

const std::vector<double>& quarter_turn_blocks() {
  // Entry (i, j) is the integral of y_i(x, y, z) y_j(x, z, -y), by quadrature that is exact.
  static const std::vector<double> blocks = [] {
    const std::vector<DirectionNode> nodes = direction_quadrature(max_sh_order);
    constexpr size_t count = sh_count(max_sh_order);
    std::vector<double> y(nodes.size() * count), turned(y.size()), result;
    for (size_t s = 0; s < nodes.size(); ++s) {
      const Vec3d d = nodes[s].direction;
      evaluate_sh(max_sh_order, d, std::span(y).subspan(s * count, count));
      evaluate_sh(max_sh_order, Vec3d(d.x, d.z, -d.y), std::span(turned).subspan(s * count, count));
      for (size_t i = 0; i < count; ++i) y[s * count + i] *= nodes[s].weight;
    }
    for (int l = 2; l < max_sh_order; ++l)
      for (int c = 0; c < 4; ++c)
        for (int r = 0; r < class_size(l, c); ++r)
          for (int k = 0; k < class_size(l, c); ++k) {
            const size_t i = size_t(sh_index(l, class_m(c, r))),
                         j = size_t(sh_index(l, class_m(class_source(l, c), k)));
            double sum = 0;
            for (size_t s = 0; s < nodes.size(); ++s) sum += y[s * count + i] * turned[s * count + j];
            result.push_back(sum);
          }
    return result;
  }();
  return blocks;
}

}  // namespace zyz

namespace {

HWY_EXPORT(RotateBands);

constexpr int simd_order = 8;

struct Tables {
  std::vector<float> blocks;
  AlignedVector<float> columns;  // [l - 2][forth and back][class][column][row], padded to 4 x 4
  Tables() : columns(size_t(simd_order - 2) * 8 * 16) {
    const std::vector<double>& exact = zyz::quarter_turn_blocks();
    blocks.assign(exact.begin(), exact.end());
    const float* block = blocks.data();
    auto lane = [](int c, int k) { return c == 2 ? k + 1 : k; };
    for (int l = 2; l < simd_order; ++l)
      for (int c = 0; c < 4; ++c) {
        const int n = zyz::class_size(l, c), source = zyz::class_source(l, c);
        float* forth = columns.data() + (size_t(l - 2) * 8 + size_t(c)) * 16;
        for (int r = 0; r < n; ++r)
          for (int k = 0; k < n; ++k) {
            const float value = *block++;
            forth[lane(source, k) * 4 + lane(c, r)] = value;
            forth[4 * 16 + lane(c, r) * 4 + lane(source, k)] = value;
          }
      }
  }
};
const Tables& tables() {
  static const Tables t;
  return t;
}

}  // namespace

EulerZyz euler_zyz(const Mat3& R) {
  // Glm's R[column][row]. The last column of the product is (cos a sin b, sin a sin b, cos b).
  EulerZyz e;
  e.cos_b = R[2][2];
  e.sin_b = std::sqrt(R[2][0] * R[2][0] + R[2][1] * R[2][1]);
  if (e.sin_b > 1e-18f) {
    const float scale = 1 / e.sin_b;
    e.cos_a = R[2][0] * scale, e.sin_a = R[2][1] * scale;
  }
  // Row y of Rz(-a) R = Ry(b) Rz(c) is (sin c, cos c, 0), whatever b is.
  e.sin_c = e.cos_a * R[0][1] - e.sin_a * R[0][0];
  e.cos_c = e.cos_a * R[1][1] - e.sin_a * R[1][0];
  return e;
}

void rotate_sh_zyz(const Mat3& R, std::span<const float> in, std::span<float> out) {
  int order = 1;
  while (size_t(sh_count(order)) < in.size()) ++order;
  LAMBENT_CHECK(order <= max_sh_order && size_t(sh_count(order)) == in.size() && out.size() >= in.size());
  out[0] = in[0];
  if (order > 1) {  // the linear part points along (-f3, -f1, f2)
    const Vec3 v = R * Vec3(-in[3], -in[1], in[2]);
    out[3] = -v.x, out[1] = -v.y, out[2] = v.z;
  }
  if (order < 3) return;
  const EulerZyz e = euler_zyz(R);
  const Tables& t = tables();
  HWY_DYNAMIC_DISPATCH(RotateBands)
  (std::min(order, simd_order), e, t.blocks.data(), t.columns.data(), in.data(), out.data());
  if (order <= simd_order) return;
  float f[sh_count(max_sh_order)], scratch[sh_count(max_sh_order)];
  const float angles[6] = {e.cos_a, e.sin_a, e.cos_b, e.sin_b, e.cos_c, e.sin_c};
  std::copy(in.begin() + sh_count(simd_order), in.end(), f + sh_count(simd_order));
  zyz::rotate_bands(simd_order, order, angles, t.blocks.data(), f, scratch);
  std::copy(f + sh_count(simd_order), f + in.size(), out.begin() + sh_count(simd_order));
}

void rotate_sh_zyz(const Mat3& R, std::span<const Vec3> in, std::span<Vec3> out) {
  LAMBENT_CHECK(in.size() <= size_t(sh_count(max_sh_order)) && out.size() >= in.size());
  float channel[sh_count(max_sh_order)];
  const std::span<float> values(channel, in.size());
  for (int c = 0; c < 3; ++c) {
    for (size_t i = 0; i < in.size(); ++i) values[i] = in[i][c];
    rotate_sh_zyz(R, values, values);
    for (size_t i = 0; i < in.size(); ++i) out[i][c] = values[i];
  }
}

}  // namespace lambent
#endif
