#include <lambent/relight/moving_kernels.h>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/relight/moving_kernels.cpp"
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

void MixTile(const Shells& s, const float* log_radii, const float* px, const float* py, const float* pz, TileMix& m) {
  const F d;
  const I di;
  const auto one = hn::Set(d, 1.0f), zero = hn::Zero(d);
  const auto tiny = hn::Set(d, 1e-30f);
  const auto scale = hn::Set(d, 0.5f * float(s.side - 1)), last = hn::Set(d, float(s.side - 2));
  const int32_t shells = int32_t(s.radii.size()), points = s.side * s.side;
  for (size_t i = 0; i < sh_tile; i += hn::Lanes(d)) {
    const auto x = hn::Load(d, px + i), y = hn::Load(d, py + i), z = hn::Load(d, pz + i);
    const auto distance = hn::Sqrt(hn::Max(hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z))), hn::Set(d, 1e-36f)));
    // As fold_octahedron().
    const auto inverse = hn::Div(one, hn::Max(hn::Add(hn::Add(hn::Abs(x), hn::Abs(y)), hn::Abs(z)), tiny));
    const auto fx = hn::Mul(x, inverse), fy = hn::Mul(y, inverse);
    const auto below = hn::Lt(z, zero);
    const auto gx = hn::IfThenElse(below, hn::CopySign(hn::Sub(one, hn::Abs(fy)), fx), fx);
    const auto gy = hn::IfThenElse(below, hn::CopySign(hn::Sub(one, hn::Abs(fx)), fy), fy);
    const auto sx = hn::Mul(hn::Add(gx, one), scale), sy = hn::Mul(hn::Add(gy, one), scale);
    const auto cx = hn::Min(hn::Max(hn::Floor(sx), zero), last), cy = hn::Min(hn::Max(hn::Floor(sy), zero), last);
    hn::Store(hn::Min(hn::Max(hn::Sub(sx, cx), zero), one), d, m.u + i);
    hn::Store(hn::Min(hn::Max(hn::Sub(sy, cy), zero), one), d, m.v + i);
    auto above = hn::Zero(di);
    for (float r : s.radii)
      above = hn::Sub(above, hn::VecFromMask(di, hn::RebindMask(di, hn::Le(hn::Set(d, r), distance))));
    const auto low = hn::Max(hn::Sub(above, hn::Set(di, 1)), hn::Zero(di)),
               high = hn::Min(above, hn::Set(di, shells - 1));
    const auto from = hn::GatherIndex(d, log_radii, low), to = hn::GatherIndex(d, log_radii, high);
    const auto width = hn::Sub(to, from);
    const auto t = hn::Div(hn::Sub(hn::Log2(d, distance), from), hn::Max(width, tiny));
    const auto share = hn::IfThenElseZero(hn::Gt(width, zero), hn::Min(hn::Max(t, zero), one));
    const auto r_low = hn::GatherIndex(d, s.radii.data(), low), r_high = hn::GatherIndex(d, s.radii.data(), high);
    const auto outside = hn::Ge(r_low, hn::Set(d, s.radius));
    const auto over = hn::Div(one, hn::Max(distance, r_low));
    const auto near = hn::IfThenElse(outside, hn::Mul(r_low, over), one),
               far = hn::IfThenElse(outside, hn::Mul(r_high, over), one);
    hn::Store(hn::Mul(hn::Sub(one, share), hn::Mul(near, near)), d, m.near + i);
    hn::Store(hn::Mul(share, hn::Mul(far, far)), d, m.far + i);
    const auto cell = hn::Add(hn::Mul(hn::ConvertTo(di, cy), hn::Set(di, s.side)), hn::ConvertTo(di, cx));
    hn::Store(hn::Add(hn::Mul(low, hn::Set(di, points)), cell), di, m.low + i);
    hn::Store(hn::Add(hn::Mul(high, hn::Set(di, points)), cell), di, m.high + i);
  }
}

void HiddenOfTile(const TileMix& m, const uint8_t* wanted, size_t side, const float* HWY_RESTRICT values, size_t stride,
                  float* HWY_RESTRICT rows) {
  const F d;
  for (size_t i = 0; i < sh_tile; ++i) {
    if (!wanted[i]) continue;
    const float u = m.u[i], v = m.v[i], near = m.near[i], far = m.far[i];
    const float a = (1 - u) * (1 - v), b = u * (1 - v), c = (1 - u) * v, e = u * v;
    const float *p = values + size_t(m.low[i]) * stride, *q = values + size_t(m.high[i]) * stride;
    const float *p2 = p + side * stride, *q2 = q + side * stride;
    const auto wa = hn::Set(d, a), wb = hn::Set(d, b), wc = hn::Set(d, c), we = hn::Set(d, e), wn = hn::Set(d, near),
               wf = hn::Set(d, far);
    for (size_t k = 0; k < stride; k += hn::Lanes(d)) {
      auto first = hn::Mul(wa, hn::Load(d, p + k)), second = hn::Mul(wa, hn::Load(d, q + k));
      first = hn::MulAdd(wb, hn::Load(d, p + stride + k), first);
      second = hn::MulAdd(wb, hn::Load(d, q + stride + k), second);
      first = hn::MulAdd(wc, hn::Load(d, p2 + k), first), second = hn::MulAdd(wc, hn::Load(d, q2 + k), second);
      first = hn::MulAdd(we, hn::Load(d, p2 + stride + k), first);
      second = hn::MulAdd(we, hn::Load(d, q2 + stride + k), second);
      hn::Store(hn::MulAdd(wn, first, hn::Mul(wf, second)), d, rows + i * stride + k);
    }
  }
}

// Four by four numbers, their rows for their columns.
using Q = hn::CappedTag<float, 4>;
HWY_INLINE void Transpose4(const float* HWY_RESTRICT from, size_t from_step, float* HWY_RESTRICT to, size_t to_step) {
#if HWY_TARGET == HWY_SCALAR
  for (size_t i = 0; i < 4; ++i)
    for (size_t k = 0; k < 4; ++k) to[k * to_step + i] = from[i * from_step + k];
#else
  const Q d;
  const hn::Repartition<double, Q> pairs;
  const auto a = hn::LoadU(d, from), b = hn::LoadU(d, from + from_step), c = hn::LoadU(d, from + 2 * from_step),
             e = hn::LoadU(d, from + 3 * from_step);
  const auto ab = hn::BitCast(pairs, hn::InterleaveLower(d, a, b)),
             ce = hn::BitCast(pairs, hn::InterleaveLower(d, c, e)),
             AB = hn::BitCast(pairs, hn::InterleaveUpper(d, a, b)),
             CE = hn::BitCast(pairs, hn::InterleaveUpper(d, c, e));
  hn::StoreU(hn::BitCast(d, hn::InterleaveLower(pairs, ab, ce)), d, to);
  hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(pairs, ab, ce)), d, to + to_step);
  hn::StoreU(hn::BitCast(d, hn::InterleaveLower(pairs, AB, CE)), d, to + 2 * to_step);
  hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(pairs, AB, CE)), d, to + 3 * to_step);
#endif
}

void FactorOfTile(const float* rows, size_t stride, size_t coefficients, float all, float* HWY_RESTRICT factor) {
  const F d;
  size_t k = 0;
  for (; k + 4 <= coefficients; k += 4)
    for (size_t i = 0; i < sh_tile; i += 4)
      Transpose4(rows + i * stride + k, stride, factor + k * sh_tile + i, sh_tile);
  for (; k < coefficients; ++k)
    for (size_t i = 0; i < sh_tile; ++i) factor[k * sh_tile + i] = rows[i * stride + k];
  for (size_t at = 0; at < coefficients * sh_tile; at += hn::Lanes(d))
    hn::Store(hn::Sub(hn::Set(d, at < sh_tile ? all : 0.0f), hn::Load(d, factor + at)), d, factor + at);
}

void RowsFromTile(const float* tile, size_t coefficients, size_t stride, float* HWY_RESTRICT rows) {
  size_t k = 0;
  for (; k + 4 <= coefficients; k += 4)
    for (size_t i = 0; i < sh_tile; i += 4) Transpose4(tile + k * sh_tile + i, sh_tile, rows + i * stride + k, stride);
  for (; k < stride; ++k)
    for (size_t i = 0; i < sh_tile; ++i) rows[i * stride + k] = k < coefficients ? tile[k * sh_tile + i] : 0.0f;
}

void OpenOfTile(const float* lobe, const float* factor, size_t count, float* open) {
  const F d;
  for (size_t i = 0; i < sh_tile; i += hn::Lanes(d)) {
    auto sum = hn::Zero(d);
    for (size_t k = 0; k < count; ++k)
      sum = hn::MulAdd(hn::Load(d, lobe + k * sh_tile + i), hn::Load(d, factor + k * sh_tile + i), sum);
    sum = hn::Min(hn::Max(sum, hn::Zero(d)), hn::Set(d, 1.0f));
    hn::Store(hn::Mul(sum, hn::Load(d, open + i)), d, open + i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {
namespace {
HWY_EXPORT(MixTile);
HWY_EXPORT(HiddenOfTile);
HWY_EXPORT(FactorOfTile);
HWY_EXPORT(RowsFromTile);
HWY_EXPORT(OpenOfTile);
}  // namespace

void mix_tile(const Shells& shells, const float* log_radii, const float* x, const float* y, const float* z,
              TileMix& mix) {
  HWY_DYNAMIC_DISPATCH(MixTile)(shells, log_radii, x, y, z, mix);
}

void hidden_of_tile(const TileMix& mix, const uint8_t* wanted, size_t side, const float* values, size_t stride,
                    float* rows) {
  HWY_DYNAMIC_DISPATCH(HiddenOfTile)(mix, wanted, side, values, stride, rows);
}

void factor_of_tile(const float* rows, size_t stride, size_t coefficients, float all, float* factor) {
  HWY_DYNAMIC_DISPATCH(FactorOfTile)(rows, stride, coefficients, all, factor);
}

void rows_from_tile(const float* tile, size_t coefficients, size_t stride, float* rows) {
  HWY_DYNAMIC_DISPATCH(RowsFromTile)(tile, coefficients, stride, rows);
}

void open_of_tile(const float* lobe, const float* factor, size_t count, float* open) {
  HWY_DYNAMIC_DISPATCH(OpenOfTile)(lobe, factor, count, open);
}

}  // namespace lambent
#endif
