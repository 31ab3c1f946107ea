#include <lambent/relight/hidden_table.h>

#include <lambent/basis/sh_rotation_zyz.h>
#include <lambent/core/parallel.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <mutex>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/relight/hidden_table.cpp"
#include <hwy/foreach_target.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using F = hn::CappedTag<float, 16>;
using I = hn::RebindToSigned<F>;
using V = hn::Vec<F>;

// Two numbers of 16 bits in each lane.
HWY_INLINE hn::Vec<I> Pair(V first, V second) {
  return hn::Or(hn::And(hn::NearestInt(first), hn::Set(I(), 0xFFFF)), hn::ShiftLeft<16>(hn::NearestInt(second)));
}

// sum + the products of both numbers of each lane.
HWY_INLINE hn::Vec<I> AddProducts(hn::Vec<I> a, hn::Vec<I> b, hn::Vec<I> sum) {
#if HWY_ARCH_X86 && HWY_TARGET != HWY_EMU128 && HWY_TARGET != HWY_SCALAR
  const hn::Repartition<int16_t, F> s;
  auto none = hn::Zero(I());
  return hn::ReorderWidenMulAccumulate(I(), hn::BitCast(s, a), hn::BitCast(s, b), sum, none);
#else
  const auto low = [](hn::Vec<I> v) { return hn::ShiftRight<16>(hn::ShiftLeft<16>(v)); };
  return hn::Add(sum, hn::Add(hn::Mul(low(a), low(b)), hn::Mul(hn::ShiftRight<16>(a), hn::ShiftRight<16>(b))));
#endif
}

uint64_t NearOfTile(const float* lanes, size_t count, Vec3 position, float radius, float reach) {
  const F d;
  uint64_t near = 0;
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    const auto of = [&](size_t k) { return hn::Load(d, lanes + k * sh_tile + i); };
    const auto x = hn::Sub(of(0), hn::Set(d, position.x)), y = hn::Sub(of(1), hn::Set(d, position.y)),
               z = hn::Sub(of(2), hn::Set(d, position.z));
    const auto over = hn::MulAdd(of(3), x, hn::MulAdd(of(4), y, hn::Mul(of(5), z)));
    const auto squared = hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z)));
    uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hn::And(hn::Lt(over, hn::Set(d, radius)), hn::Lt(squared, hn::Set(d, reach))), bits);
    near |= (uint64_t(bits[0]) | uint64_t(bits[1]) << 8) << i;
  }
  return count < sh_tile ? near & ((uint64_t(1) << count) - 1) : near;
}

// Receivers of a tile as the object sees them, and how far they are at least and at most.
struct Seen {
  alignas(64) float own[3][sh_tile], away[sh_tile];
  float least, most;
};
void SeeTile(const PlacedObject& object, const float* lanes, Seen& seen) {
  const F d;
  const Mat3 back = transpose(object.place.rotation) * (1 / object.place.scale);
  const Vec3 at = object.place.position;
  auto least = hn::Set(d, 1e36f), most = hn::Zero(d);
  for (size_t i = 0; i < sh_tile; i += hn::Lanes(d)) {
    const auto px = hn::Sub(hn::Load(d, lanes + i), hn::Set(d, at.x)),
               py = hn::Sub(hn::Load(d, lanes + sh_tile + i), hn::Set(d, at.y)),
               pz = hn::Sub(hn::Load(d, lanes + 2 * sh_tile + i), hn::Set(d, at.z));
    auto squared = hn::Set(d, 1e-36f);
    for (size_t row = 0; row < 3; ++row) {
      const auto x = hn::MulAdd(hn::Set(d, back[0][row]), px,
                                hn::MulAdd(hn::Set(d, back[1][row]), py, hn::Mul(hn::Set(d, back[2][row]), pz)));
      hn::Store(x, d, seen.own[row] + i), squared = hn::MulAdd(x, x, squared);
    }
    const auto distance = hn::Sqrt(squared);
    hn::Store(distance, d, seen.away + i);
    least = hn::Min(least, distance), most = hn::Max(most, distance);
  }
  seen.least = hn::GetLane(hn::MinOfLanes(d, least)), seen.most = hn::GetLane(hn::MaxOfLanes(d, most));
}

void MixTable(const PlacedObject& object, const HiddenTable& t, const float* lanes, uint64_t wanted, TableMix& m) {
  const F d;
  const I di;
  const Shells& s = object.light->shells;
  const float *log_radii = object.light->log_radii.data(), *radii = s.radii.data();
  const auto one = hn::Set(d, 1.0f), zero = hn::Zero(d), tiny = hn::Set(d, 1e-30f);
  const auto scale = hn::Set(d, 0.5f * float(s.side - 1)), last = hn::Set(d, float(s.side - 2));
  Seen seen;
  SeeTile(object, lanes, seen);
  const auto shell_of = [&](float distance) {  // the last one that is no larger, of those that the table has
    const float* end = radii + t.first_shell + t.shells;
    return std::max(int(std::upper_bound(radii + t.first_shell, end, distance) - radii) - 1, t.first_shell);
  };
  const int nearest = shell_of(seen.least), farthest = shell_of(seen.most);
  for (size_t i = 0; i < sh_tile; i += hn::Lanes(d)) {
    const auto x = hn::Load(d, seen.own[0] + i), y = hn::Load(d, seen.own[1] + i), z = hn::Load(d, seen.own[2] + i);
    const auto distance = hn::Load(d, seen.away + i);
    // As fold_octahedron().
    const auto inverse = hn::Div(one, hn::Max(hn::Add(hn::Add(hn::Abs(x), hn::Abs(y)), hn::Abs(z)), tiny));
    const auto fx = hn::Mul(x, inverse), fy = hn::Mul(y, inverse);
    const auto below = hn::Lt(z, zero);
    const auto gx = hn::IfThenElse(below, hn::CopySign(hn::Sub(one, hn::Abs(fy)), fx), fx);
    const auto gy = hn::IfThenElse(below, hn::CopySign(hn::Sub(one, hn::Abs(fx)), fy), fy);
    const auto sx = hn::Mul(hn::Add(gx, one), scale), sy = hn::Mul(hn::Add(gy, one), scale);
    const auto cx = hn::Min(hn::Max(hn::Floor(sx), zero), last), cy = hn::Min(hn::Max(hn::Floor(sy), zero), last);
    const auto u = hn::Min(hn::Max(hn::Sub(sx, cx), zero), one), v = hn::Min(hn::Max(hn::Sub(sy, cy), zero), one);
    // The shells about it, and what of them is asked: of the few that this tile's receivers lie between.
    auto low = hn::Set(di, nearest), high = low;
    auto r_low = hn::Set(d, radii[nearest]), from = hn::Set(d, log_radii[nearest]), to = from,
         beyond = hn::Set(d, t.outer[size_t(nearest)]);
    for (int k = nearest; k <= farthest; ++k) {
      const int up = std::min(k + 1, t.first_shell + t.shells - 1);
      const auto past = hn::Le(hn::Set(d, radii[k]), distance);
      const auto past_i = hn::RebindMask(di, past);
      low = hn::IfThenElse(past_i, hn::Set(di, k), low), high = hn::IfThenElse(past_i, hn::Set(di, up), high);
      r_low = hn::IfThenElse(past, hn::Set(d, radii[k]), r_low);
      from = hn::IfThenElse(past, hn::Set(d, log_radii[k]), from),
      to = hn::IfThenElse(past, hn::Set(d, log_radii[up]), to);
      beyond = hn::IfThenElse(past, hn::Set(d, t.outer[size_t(up)]), beyond);
    }
    const auto width = hn::Sub(to, from);
    const auto part = hn::Div(hn::Sub(hn::Log2(d, distance), from), hn::Max(width, tiny));
    const auto share = hn::IfThenElseZero(hn::Gt(width, zero), hn::Min(hn::Max(part, zero), one));
    // Values are times (radius of the shell / the sphere's)^2 outside of the sphere, so that they hardly change there.
    const auto outside = hn::Ge(r_low, hn::Set(d, s.radius));
    const auto ratio = hn::Div(hn::Set(d, s.radius), hn::Max(distance, r_low));
    hn::Store(hn::IfThenElse(outside, hn::Mul(ratio, ratio), one), d, m.factor + i);
    const auto full = hn::Set(d, 32767.0f);
    const auto far = hn::Mul(full, hn::Mul(share, hn::IfThenElse(outside, one, beyond))),
               near = hn::Mul(full, hn::Sub(one, share));
    const auto not_u = hn::Sub(one, u), not_v = hn::Sub(one, v);
    const auto store = [&](size_t row, V w) {
      hn::Store(Pair(hn::Mul(w, not_u), hn::Mul(w, u)), di, m.weights[row] + i);
    };
    store(0, hn::Mul(near, not_v)), store(1, hn::Mul(near, v)), store(2, hn::Mul(far, not_v)),
        store(3, hn::Mul(far, v));
    const auto cell = hn::Add(hn::Mul(hn::ConvertTo(di, cy), hn::Set(di, s.side)), hn::ConvertTo(di, cx));
    const auto first = hn::Set(di, t.first_shell), points = hn::Set(di, s.side * s.side),
               each = hn::Set(di, int32_t(t.groups * t.stride));
    hn::Store(hn::Mul(hn::Add(hn::Mul(hn::Sub(low, first), points), cell), each), di, m.low + i);
    hn::Store(hn::Mul(hn::Add(hn::Mul(hn::Sub(high, first), points), cell), each), di, m.high + i);
  }
  for (uint64_t off = ~wanted; off != 0; off &= off - 1)
    for (auto& w : m.weights) w[std::countr_zero(off)] = 0;
}

#if HWY_TARGET != HWY_SCALAR
// Blocks of 4 numbers, added up and scaled.
template <class D>
HWY_INLINE void StoreFolded(D d, hn::Vec<D> v, float factor, const float* scale, float* to) {
  if constexpr (hn::MaxLanes(D()) > 4) {
    const hn::Half<D> half;
    StoreFolded(half, hn::Add(hn::LowerHalf(half, v), hn::UpperHalf(half, v)), factor, scale, to);
  } else {
    hn::StoreU(hn::Mul(v, hn::Mul(hn::Set(d, factor), hn::LoadU(d, scale))), d, to);
  }
}
#endif

// Sums of the lanes, scaled, side by side.
HWY_INLINE void StoreSums(V a, V b, V c, float factor, const float* scale, float* to) {
#if HWY_TARGET == HWY_SCALAR
  const float sums[3] = {hn::GetLane(a), hn::GetLane(b), hn::GetLane(c)};
  for (size_t k = 0; k < 3; ++k) to[k] = sums[k] * factor * scale[k];
#else
  const F d;
  const hn::Repartition<double, F> pairs;
  const auto halves = [&](V x, V y) {
    return hn::BitCast(pairs, hn::Add(hn::InterleaveLower(d, x, y), hn::InterleaveUpper(d, x, y)));
  };
  const auto ab = halves(a, b), c0 = halves(c, hn::Zero(d));
  const auto sum =
      hn::Add(hn::BitCast(d, hn::InterleaveLower(pairs, ab, c0)), hn::BitCast(d, hn::InterleaveUpper(pairs, ab, c0)));
  StoreFolded(d, sum, factor, scale, to);
#endif
}

HWY_INLINE V LoadRow(const float* row) { return hn::Load(F(), row); }
HWY_INLINE V LoadRow(const uint16_t* row) {
  const hn::Rebind<hwy::float16_t, F> half;
  return hn::PromoteTo(F(), hn::Load(half, reinterpret_cast<const hwy::float16_t*>(row)));
}

// `fixed` is the stride, where it is known; else 0.
template <bool with_light, size_t fixed, class Stored>
void DotTableBy(const HiddenTable& t, size_t group, const TableMix& m, uint64_t asked, const Stored* HWY_RESTRICT rows,
                size_t row_stride, size_t channel_stride, const TableLight& l, float* HWY_RESTRICT out) {
  const F d;
  const I di;
  const size_t lanes = hn::Lanes(d), stride = fixed ? fixed : t.stride;
  const size_t next_row = size_t(t.side) * t.groups * stride;
  const int32_t* const values = t.values.data() + group * stride;
  const float ones[4] = {1, 1, 1, 1}, scale[4] = {-t.scale[group], -t.scale[group + 1], -t.scale[group + 2], 0};
  for (; asked != 0; asked &= asked - 1) {
    const size_t i = size_t(std::countr_zero(asked));
    const int32_t *p = values + m.low[i], *q = values + m.high[i], *p1 = p + next_row, *q1 = q + next_row;
    const auto w0 = hn::Set(di, m.weights[0][i]), w1 = hn::Set(di, m.weights[1][i]), w2 = hn::Set(di, m.weights[2][i]),
               w3 = hn::Set(di, m.weights[3][i]);
    const Stored* a = rows + i * row_stride;
    auto r = hn::Zero(d), g = r, b = r;
    for (size_t k = 0; k < stride; k += lanes) {
      const auto hidden = [&](size_t at) {
        auto sum = AddProducts(hn::Load(di, p + at), w0, hn::Zero(di));
        sum = AddProducts(hn::Load(di, p1 + at), w1, sum), sum = AddProducts(hn::Load(di, q + at), w2, sum);
        return hn::ConvertTo(d, AddProducts(hn::Load(di, q1 + at), w3, sum));
      };
      auto hr = hidden(k), hg = hidden(stride + k), hb = hidden(2 * stride + k);
      if constexpr (with_light) {
        const auto share = hn::Set(d, l.share[i]);
        const auto left = [&](size_t c, V h) {
          return hn::MulAdd(hn::Set(d, m.factor[i] * scale[c]), h,
                            hn::Mul(share, hn::Load(d, l.light + c * stride + k)));
        };
        hr = left(0, hr), hg = left(1, hg), hb = left(2, hb);
      }
      const auto first = LoadRow(a + k);
      r = hn::MulAdd(first, hr, r);
      if (channel_stride == 0) {
        g = hn::MulAdd(first, hg, g), b = hn::MulAdd(first, hb, b);
      } else {
        g = hn::MulAdd(LoadRow(a + channel_stride + k), hg, g);
        b = hn::MulAdd(LoadRow(a + 2 * channel_stride + k), hb, b);
      }
    }
    StoreSums(r, g, b, with_light ? 1.0f : m.factor[i], with_light ? ones : scale, out + 4 * i);
  }
}

template <class Stored>
void DotTableOf(const HiddenTable& t, size_t group, const TableMix& m, uint64_t asked, const Stored* rows,
                size_t row_stride, size_t channel_stride, const TableLight& l, float* out) {
  const bool small = t.stride == 16;
  (l.light ? small ? DotTableBy<true, 16, Stored> : DotTableBy<true, 0, Stored>
   : small ? DotTableBy<false, 16, Stored>
           : DotTableBy<false, 0, Stored>)(t, group, m, asked, rows, row_stride, channel_stride, l, out);
}
void DotTable(const HiddenTable& t, size_t group, const TableMix& m, uint64_t asked, const TableRows& rows,
              const TableLight& l, float* out) {
  if (rows.halves) DotTableOf(t, group, m, asked, rows.halves, rows.stride, rows.channel_stride, l, out);
  else DotTableOf(t, group, m, asked, rows.floats, rows.stride, rows.channel_stride, l, out);
}

void DotTableOpen(const HiddenTable& t, const TableMix& m, uint64_t asked, const uint16_t* rows, float* out) {
  const F d;
  const I di;
  const size_t point = t.groups * t.stride, row = size_t(t.side) * point, first = (t.groups - 1) * t.stride;
  for (; asked != 0; asked &= asked - 1) {
    const size_t i = size_t(std::countr_zero(asked));
    const int32_t *p = t.values.data() + m.low[i] + first, *q = t.values.data() + m.high[i] + first;
    auto sum = hn::Zero(d);
    for (size_t k = 0; k < 16; k += hn::Lanes(d)) {
      const auto part = [&](const int32_t* from, size_t w, hn::Vec<I> before) {
        return AddProducts(hn::Load(di, from + k), hn::Set(di, m.weights[w][i]), before);
      };
      const auto hidden = part(q + row, 3, part(q, 2, part(p + row, 1, part(p, 0, hn::Zero(di)))));
      sum = hn::MulAdd(LoadRow(rows + 16 * i + k), hn::ConvertTo(d, hidden), sum);
    }
    out[i] = hn::GetLane(hn::SumOfLanes(d, sum)) * m.factor[i] * t.scale.back();
  }
}

// Four receivers at a time.
void AddSums(const float* sums, const float* open, size_t count, float* values) {
#if HWY_TARGET == HWY_SCALAR
  for (size_t i = 0; i < count; ++i)
    for (size_t c = 0; c < 3; ++c) {
      float& value = values[(i / transfer_block * 3 + c) * transfer_block + i % transfer_block];
      value = value * open[i] + sums[4 * i + c];
    }
#else
  const hn::CappedTag<float, 4> d;
  const hn::Repartition<double, decltype(d)> pairs;
  for (size_t i = 0; i < count; i += 4, sums += 16) {
    const auto a = hn::Load(d, sums), b = hn::Load(d, sums + 4), c = hn::Load(d, sums + 8), e = hn::Load(d, sums + 12);
    const auto ab = hn::BitCast(pairs, hn::InterleaveLower(d, a, b)),
               ce = hn::BitCast(pairs, hn::InterleaveLower(d, c, e)),
               blue_ab = hn::BitCast(pairs, hn::InterleaveUpper(d, a, b)),
               blue_ce = hn::BitCast(pairs, hn::InterleaveUpper(d, c, e));
    const auto left = hn::Load(d, open + i);
    float* value = values + i / transfer_block * 3 * transfer_block + i % transfer_block;
    const auto add = [&](auto sum, float* to) {
      hn::Store(hn::MulAdd(hn::Load(d, to), left, hn::BitCast(d, sum)), d, to);
    };
    add(hn::InterleaveLower(pairs, ab, ce), value), add(hn::InterleaveUpper(pairs, ab, ce), value + transfer_block);
    add(hn::InterleaveLower(pairs, blue_ab, blue_ce), value + 2 * transfer_block);
  }
#endif
}

// out[k] = factor times the sum over j of matrix[j][k] values[j], of two points (or one twice), whose values are
// `coefficients` apart; the greatest of each group is kept.
void FillPoints(const float* matrix, const float* values, size_t coefficients, size_t next, size_t groups,
                size_t stride, float factor, float* HWY_RESTRICT out, float* greatest) {
  const F d;
  const size_t width = groups * stride;
  const auto scale = hn::Set(d, factor);
  for (size_t g = 0; g < groups; ++g) {
    auto most = hn::Zero(d);
    for (size_t k = g * stride; k < (g + 1) * stride; k += hn::Lanes(d)) {
      auto a = hn::Zero(d), b = a;
      for (size_t j = 0; j < coefficients; ++j) {
        const auto m = hn::Load(d, matrix + j * width + k);
        a = hn::MulAdd(m, hn::Set(d, values[j]), a), b = hn::MulAdd(m, hn::Set(d, values[next * coefficients + j]), b);
      }
      a = hn::Mul(a, scale), b = hn::Mul(b, scale);
      most = hn::Max(most, hn::Max(hn::Abs(a), hn::Abs(b)));
      hn::Store(a, d, out + k), hn::Store(b, d, out + next * width + k);
    }
    greatest[g] = std::max(greatest[g], hn::GetLane(hn::MaxOfLanes(d, most)));
  }
}

void PackPoint(const float* point, const float* next, const float* over, size_t groups, size_t stride, int32_t* out) {
  const F d;
  for (size_t g = 0; g < groups; ++g) {
    const auto scale = hn::Set(d, over[g]);
    for (size_t k = g * stride; k < (g + 1) * stride; k += hn::Lanes(d))
      hn::Store(Pair(hn::Mul(hn::Load(d, point + k), scale), hn::Mul(hn::Load(d, next + k), scale)), I(), out + k);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {
namespace {
HWY_EXPORT(NearOfTile);
HWY_EXPORT(MixTable);
HWY_EXPORT(DotTable);
HWY_EXPORT(DotTableOpen);
HWY_EXPORT(AddSums);
HWY_EXPORT(FillPoints);
HWY_EXPORT(PackPoint);

// [coefficient of the object's, in its own axes][group][coefficient of H L, in the world's].
AlignedVector<float> table_matrix(const PlacedObject& object, const ShTileProduct& p,
                                  std::span<const MovingLight> lights, const HiddenTable& t) {
  const size_t n = p.rows_of.size(), m = size_t(sh_count(p.order_b));
  const size_t own = size_t(sh_count(p.order_a)), width = t.groups * t.stride;
  std::vector<float> world(t.groups * own * m, 0.0f);  // [group][coefficient of H L][of H]
  size_t entry = 0, row = 0;
  for (size_t k = 0; k < n; ++k)
    for (size_t end = row + p.rows_of[k]; row < end; ++row)
      for (size_t last = entry + p.rows[row].count; entry < last; ++entry)
        for (size_t l = 0; l < lights.size(); ++l)
          for (size_t c = 0; c < 3; ++c)
            world[((3 * l + c) * own + p.rows[row].i) * m + p.j[entry]] += p.value[entry] * lights[l].light[k][int(c)];
  if (t.open)
    for (size_t k = 0; k < std::min<size_t>({9, own, m}); ++k) world[((t.groups - 1) * own + k) * m + k] = 1;
  AlignedVector<float> out(m * width, 0.0f);
  const Mat3 back = transpose(object.place.rotation);
  std::vector<float> turned(m);
  for (size_t g = 0; g < t.groups; ++g)
    for (size_t i = 0; i < own; ++i) {
      rotate_sh_zyz(back, std::span<const float>(world).subspan((g * own + i) * m, m), std::span<float>(turned));
      for (size_t j = 0; j < m; ++j) out[j * width + g * t.stride + i] = turned[j];
    }
  return out;
}
}  // namespace

void make_hidden_table(const PlacedObject& object, const ShTileProduct& product, std::span<const MovingLight> lights,
                       bool open, int first_shell, int shells, HiddenTable& t) {
  const Shells& s = object.light->shells;
  t.first_shell = first_shell, t.shells = shells, t.open = open, t.side = s.side;
  t.stride = (size_t(sh_count(product.order_a)) + 15) / 16 * 16, t.groups = 3 * lights.size() + open;
  t.outer.clear();
  for (float r : s.radii) t.outer.push_back(r >= s.radius ? (s.radius / r) * (s.radius / r) : 1.0f);
  const AlignedVector<float> matrix = table_matrix(object, product, lights, t);
  const size_t side = size_t(s.side), each = side * side, m = size_t(sh_count(object.light->order));
  const size_t width = t.groups * t.stride, points = size_t(shells) * each;
  t.plain.resize(points * width), t.values.resize(points * width);
  std::vector<float> greatest(t.groups, 0.0f);
  std::mutex mutex;
  parallel_for(points, 256, [&](size_t begin, size_t end) {
    std::vector<float> most(t.groups, 0.0f);
    for (size_t p = begin; p < end;) {
      const size_t next = p + 1 < end && (p + 1) % each != 0;  // of the same shell
      HWY_DYNAMIC_DISPATCH(FillPoints)
      (matrix.data(), object.light->values.data() + (size_t(first_shell) * each + p) * m, m, next, t.groups, t.stride,
       1 / t.outer[size_t(first_shell) + p / each], t.plain.data() + p * width, most.data());
      p += 1 + next;
    }
    const std::lock_guard lock(mutex);
    for (size_t g = 0; g < t.groups; ++g) greatest[g] = std::max(greatest[g], most[g]);
  });
  t.scale.resize(t.groups);
  std::vector<float> over(t.groups);
  for (size_t g = 0; g < t.groups; ++g) {
    over[g] = greatest[g] > 0 ? 32767 / greatest[g] : 0.0f;
    t.scale[g] = greatest[g] / (32767.0f * 32767.0f);
  }
  parallel_for(points, 256, [&](size_t begin, size_t end) {
    for (size_t p = begin; p < end; ++p) {
      const float* point = t.plain.data() + p * width;
      HWY_DYNAMIC_DISPATCH(PackPoint)
      (point, (p + 1) % side == 0 ? point : point + width, over.data(), t.groups, t.stride,
       t.values.data() + p * width);
    }
  });
}

void mix_table(const PlacedObject& object, const HiddenTable& table, const float* lanes, uint64_t wanted,
               TableMix& mix) {
  HWY_DYNAMIC_DISPATCH(MixTable)(object, table, lanes, wanted, mix);
}

uint64_t near_of_tile(const float* lanes, size_t count, Vec3 position, float radius, float reach) {
  return HWY_DYNAMIC_DISPATCH(NearOfTile)(lanes, count, position, radius, reach);
}

void dot_table(const HiddenTable& table, size_t first_group, const TableMix& mix, uint64_t asked, const TableRows& rows,
               const TableLight& light, float* out) {
  HWY_DYNAMIC_DISPATCH(DotTable)(table, first_group, mix, asked, rows, light, out);
}

void add_sums(const float* sums, const float* open, size_t count, float* values) {
  HWY_DYNAMIC_DISPATCH(AddSums)(sums, open, count, values);
}

void dot_table_open(const HiddenTable& table, const TableMix& mix, uint64_t asked, const uint16_t* rows, float* out) {
  HWY_DYNAMIC_DISPATCH(DotTableOpen)(table, mix, asked, rows, out);
}

}  // namespace lambent
#endif
