// Follows: local-deformable-prt (rotation by z-x-z-x-z). In SIMD lanes each class of a band (sh_rotation_zyz-inl.h) is
// one vector padded with zeros in the blocks, of four lanes up to band 7 and of eight above: a turn about z has no
// shuffles, and a quarter turn about x broadcasts lane after lane.
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
#include <lambent/basis/everywhere-inl.h>

#ifndef LAMBENT_SH_ROTATION_ZYZ
#define LAMBENT_SH_ROTATION_ZYZ
namespace lambent {
namespace {

constexpr int narrow_order = 8;  // bands below have classes of at most four

// Blocks of the quarter turn, [forth and back][class][column][row] for each band: all as they are, and padded to 4 x 4
// and 8 x 8. Classes have the sines of even m from m = 0 on when padded.
struct RotationTables {
  std::vector<float> blocks;
  AlignedVector<float> narrow, wide;
};
constexpr size_t narrow_band = 8 * 4 * 4, wide_band = 8 * 8 * 8;

}  // namespace
}  // namespace lambent
#endif

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_SCALAR
// Without vectors this is the plain code.
void RotateBands(int order, const EulerZyz& e, const RotationTables& tables, const float* in, float* out) {
  const size_t count = size_t(sh_count(order));
  const float angles[6] = {e.cos_a, e.sin_a, e.cos_b, e.sin_b, e.cos_c, e.sin_c};
  float f[sh_count(max_sh_order)], scratch[sh_count(max_sh_order)];
  std::copy(in, in + count, f);
  zyz::rotate_bands(order, angles, tables.blocks.data(), f, scratch);
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

// Bands 8 and up: the same with eight lanes a class, or twice four.
using F8 = hn::CappedTag<float, 8>;
using V8 = hn::Vec<F8>;
constexpr size_t wide_lanes = hn::MaxLanes(F8()), wide_parts = 8 / wide_lanes;

struct WideTurn {
  V8 even_cos[wide_parts], even_sin[wide_parts], odd_cos[wide_parts], odd_sin[wide_parts];  // m = 0 2 .. 14, 1 3 .. 15
};
HWY_INLINE void Widen(const Turn& t, WideTurn& w) {
  // e^{8it} is the square of e^{4it}, which is lane 2 of the even ones.
  const V4 c4 = hn::Broadcast<2>(t.even_cos), s4 = hn::Broadcast<2>(t.even_sin);
  const V4 c8 = hn::NegMulAdd(s4, s4, hn::Mul(c4, c4)), s8 = hn::Mul(hn::Add(s4, s4), c4);
  auto join = [](auto low, auto high, V8* out) {
    if constexpr (wide_parts == 1) out[0] = hn::Combine(F8(), high, low);
    else out[0] = low, out[1] = high;
  };
  join(t.even_cos, hn::NegMulAdd(t.even_sin, s8, hn::Mul(t.even_cos, c8)), w.even_cos);
  join(t.even_sin, hn::MulAdd(t.even_cos, s8, hn::Mul(t.even_sin, c8)), w.even_sin);
  join(t.odd_cos, hn::NegMulAdd(t.odd_sin, s8, hn::Mul(t.odd_cos, c8)), w.odd_cos);
  join(t.odd_sin, hn::MulAdd(t.odd_cos, s8, hn::Mul(t.odd_sin, c8)), w.odd_sin);
}

// f is [class][part].
HWY_INLINE void TurnAboutZ(const WideTurn& t, V8 f[4][wide_parts]) {
  auto turn = [](V8 c, V8 s, V8& plus, V8& minus) {
    const V8 p = plus;
    plus = hn::NegMulAdd(minus, s, hn::Mul(p, c)), minus = hn::MulAdd(p, s, hn::Mul(minus, c));
  };
  for (size_t p = 0; p < wide_parts; ++p) {
    turn(t.even_cos[p], t.even_sin[p], f[0][p], f[2][p]);
    turn(t.odd_cos[p], t.odd_sin[p], f[1][p], f[3][p]);
  }
}

// Columns k .. end - 1 of a padded block.
template <size_t k, size_t end>
HWY_INLINE void AddColumns(const float* HWY_RESTRICT column, const V8* v, V8* sum) {
  if constexpr (k < end) {
    const F8 d;
    const V8 value = Everywhere<k>(d, v);
    for (size_t p = 0; p < wide_parts; ++p)
      sum[p] = hn::MulAdd(hn::Load(d, column + k * 8 + p * wide_lanes), value, sum[p]);
    AddColumns<k + 1, end>(column, v, sum);
  }
}
template <int l, int c>  // of a source of class c
HWY_INLINE void Columns(const float* HWY_RESTRICT column, const V8* v, V8* sum) {
  const F8 d;
  constexpr size_t first = c == 2;
  const V8 value = Everywhere<first>(d, v);
  for (size_t p = 0; p < wide_parts; ++p) sum[p] = hn::Mul(hn::Load(d, column + first * 8 + p * wide_lanes), value);
  AddColumns<first + 1, first + zyz::class_size(l, c)>(column, v, sum);
}

// Band l to `out` from around in + l (l + 1), but for m >= 0 from `plus`, where 16 values can be read; all may overlap.
template <int l>
HWY_INLINE void RotateWideBand(const WideTurn turns[3], const float* HWY_RESTRICT columns, const float* plus,
                               const float* in, float* out) {
  const F8 d;
  V8 f[4][wide_parts], g[4][wide_parts];
  for (size_t p = 0; p < wide_parts; ++p) {
    hn::LoadInterleaved2(d, plus + 2 * p * wide_lanes, f[0][p], f[1][p]);
    hn::LoadInterleaved2(d, in + l * (l + 1) + 1 - 2 * (p + 1) * wide_lanes, f[3][p], f[2][p]);
    f[2][p] = hn::Reverse(d, f[2][p]), f[3][p] = hn::Reverse(d, f[3][p]);
  }
  const float* table = columns + size_t(l - narrow_order) * wide_band;
  constexpr int source[4] = {zyz::class_source(l, 0), zyz::class_source(l, 1), zyz::class_source(l, 2),
                             zyz::class_source(l, 3)};
  TurnAboutZ(turns[2], f);
  Columns<l, source[0]>(table, f[source[0]], g[0]);
  Columns<l, source[1]>(table + 64, f[source[1]], g[1]);
  Columns<l, source[2]>(table + 2 * 64, f[source[2]], g[2]);
  Columns<l, source[3]>(table + 3 * 64, f[source[3]], g[3]);
  TurnAboutZ(turns[1], g);
  Columns<l, 0>(table + 4 * 64, g[0], f[source[0]]);
  Columns<l, 1>(table + 5 * 64, g[1], f[source[1]]);
  Columns<l, 2>(table + 6 * 64, g[2], f[source[2]]);
  Columns<l, 3>(table + 7 * 64, g[3], f[source[3]]);
  TurnAboutZ(turns[0], f);
  HWY_ALIGN float cosines[16], sines[16];  // sines of m = 15 .. 0
  for (size_t p = 0; p < wide_parts; ++p) {
    hn::StoreInterleaved2(f[0][p], f[1][p], d, cosines + 2 * p * wide_lanes);
    hn::StoreInterleaved2(hn::Reverse(d, f[3][p]), hn::Reverse(d, f[2][p]), d, sines + 16 - 2 * (p + 1) * wide_lanes);
  }
  std::memcpy(out + l * (l + 1), cosines, (l + 1) * sizeof(float));
  std::memcpy(out + l * l, sines + 15 - l, l * sizeof(float));
}

template <int l>
void RotateWideBands(int order, const WideTurn turns[3], const float* columns, const float* in, float* out) {
  if constexpr (l < max_sh_order) {
    const float* plus = in + l * (l + 1);
    if (l < order - 1) {
      RotateWideBand<l>(turns, columns, plus, in, out);
      RotateWideBands<l + 1>(order, turns, columns, in, out);
    } else {  // beyond the last band nothing can be read
      float last[16] = {};
      std::memcpy(last, plus, (l + 1) * sizeof(float));
      RotateWideBand<l>(turns, columns, last, in, out);
    }
  }
}

// Bands 2 and up.
void RotateBands(int order, const EulerZyz& e, const RotationTables& tables, const float* in, float* out) {
  const float* narrow = tables.narrow.data();
  if (order <= 4) {
    const Turn turns[3] = {MakeTurn<true>(e.cos_a, e.sin_a), MakeTurn<true>(e.cos_b, e.sin_b),
                           MakeTurn<true>(e.cos_c, e.sin_c)};
    RotateBand<2>(turns, narrow, in, out);
    if (order > 3) RotateBand<3>(turns, narrow, in, out);
    return;
  }
  const Turn turns[3] = {MakeTurn<false>(e.cos_a, e.sin_a), MakeTurn<false>(e.cos_b, e.sin_b),
                         MakeTurn<false>(e.cos_c, e.sin_c)};
  RotateBand<2>(turns, narrow, in, out);
  RotateBand<3>(turns, narrow, in, out);
  RotateBand<4>(turns, narrow, in, out);
  if (order > 5) RotateBand<5>(turns, narrow, in, out);
  if (order > 6) RotateBand<6>(turns, narrow, in, out);
  if (order > 7) RotateBand<7>(turns, narrow, in, out);
  if (order <= narrow_order) return;
  WideTurn wide[3];
  for (int i = 0; i < 3; ++i) Widen(turns[i], wide[i]);
  RotateWideBands<narrow_order>(order, wide, tables.wide.data(), in, out);
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

RotationTables make_tables() {
  const std::vector<double>& exact = zyz::quarter_turn_blocks();
  RotationTables t;
  t.blocks.assign(exact.begin(), exact.end());
  t.narrow.resize((narrow_order - 2) * narrow_band), t.wide.resize((max_sh_order - narrow_order) * wide_band);
  const float* block = t.blocks.data();
  auto lane = [](int c, int k) { return c == 2 ? k + 1 : k; };
  for (int l = 2; l < max_sh_order; ++l) {
    const int lanes = l < narrow_order ? 4 : 8;
    float* band = l < narrow_order ? t.narrow.data() + size_t(l - 2) * narrow_band
                                   : t.wide.data() + size_t(l - narrow_order) * wide_band;
    for (int c = 0; c < 4; ++c) {
      const int n = zyz::class_size(l, c), source = zyz::class_source(l, c);
      float* forth = band + c * lanes * lanes;
      float* back = band + (4 + c) * lanes * lanes;
      for (int r = 0; r < n; ++r)
        for (int k = 0; k < n; ++k) {
          const float value = *block++;
          forth[lane(source, k) * lanes + lane(c, r)] = value;
          back[lane(c, r) * lanes + lane(source, k)] = value;
        }
    }
  }
  return t;
}
const RotationTables& tables() {
  static const RotationTables t = make_tables();
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
  HWY_DYNAMIC_DISPATCH(RotateBands)(order, e, tables(), in.data(), out.data());
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
