// Lobes of BRDFs in SIMD lanes, for one view: included once for each target (Highway's way). After brdf/microfacet.cpp,
// phong.cpp, ward.cpp and measured.cpp, which say where the formulas are from; half vectors are kept as wi + wo, of
// whatever length, where that saves roots and quotients.
#if defined(LAMBENT_PRODUCT_LOBES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LAMBENT_PRODUCT_LOBES_INL_H_
#undef LAMBENT_PRODUCT_LOBES_INL_H_
#else
#define LAMBENT_PRODUCT_LOBES_INL_H_
#endif

#include <lambent/brdf/measured.h>
#include <lambent/relight/product_kernels.h>

#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;
using F = hn::CappedTag<float, 16>;
using V = hn::Vec<F>;

HWY_INLINE V Fill(float x) { return hn::Set(F(), x); }
HWY_INLINE V Along(Vec3 a, V x, V y, V z) {
  return hn::MulAdd(Fill(a.x), x, hn::MulAdd(Fill(a.y), y, hn::Mul(Fill(a.z), z)));
}

// 2^x for x in [-90, 0].
HWY_INLINE V Exp2(V x) {
  const hn::RebindToSigned<F> di;
  const V whole = hn::Round(x), r = hn::Sub(x, whole);
  V p = Fill(1.54035304e-4f);  // Taylor's: below half a unit in the last place for |r| <= 1/2
  for (float c : {1.33335581e-3f, 9.61812911e-3f, 5.55041087e-2f, 2.40226507e-1f, 6.93147181e-1f, 1.0f})
    p = hn::MulAdd(p, r, Fill(c));
  return hn::BitCast(F(), hn::Add(hn::BitCast(di, p), hn::ShiftLeft<23>(hn::ConvertTo(di, whole))));
}
HWY_INLINE V ExpOfNegative(V x) { return Exp2(hn::Max(hn::Mul(x, Fill(std::numbers::log2e_v<float>)), Fill(-90.0f))); }

// Each lobe gives s_k(wi), `count` of them, for unit wi of the world. Above the horizon alone, but for Phong's, which
// visibility ends there. What does not depend on wi is made once.
struct PhongLobe {
  static constexpr int count = 1;
  const Terms& t;
  float exponent, scale, least;  // of the cosine: its power is 2^-90 there, and smaller numbers are slow
  int whole;                     // the exponent, where it is, to be taken by squares
  explicit PhongLobe(const Terms& terms)
      : t(terms),
        exponent(t.exponent),
        scale((t.exponent + 2) / (2 * pi)),
        least(std::exp2(-90 / std::max(t.exponent, 1.0f))),
        whole(t.exponent == float(int(t.exponent)) ? int(t.exponent) : -1) {}
  HWY_INLINE void operator()(V x, V y, V z, V* s) const {
    V square = hn::Min(hn::Max(Along(t.mirror, x, y, z), Fill(least)), Fill(1.0f)), power = Fill(1.0f);
    if (whole < 0) power = ExpOfNegative(hn::Mul(Fill(exponent), hn::Log(F(), square)));
    for (int bits = whole; bits > 0;) {
      if (bits & 1) power = hn::Mul(power, square);
      if (bits >>= 1) square = hn::Mul(square, square);
    }
    s[0] = hn::Mul(Fill(scale), power);
  }
};

HWY_INLINE V AlongPlus(Vec3 a, float plus, V x, V y, V z) {
  return hn::MulAdd(Fill(a.x), x, hn::MulAdd(Fill(a.y), y, hn::MulAdd(Fill(a.z), z, Fill(plus))));
}
// To all digits but the last.
HWY_INLINE V Reciprocal(V x) {
  const V r = hn::ApproximateReciprocal(x);
  return hn::Mul(r, hn::NegMulAdd(x, r, Fill(2.0f)));
}

// wi in the frame, and wi + wo there.
struct Halfway {
  V wx, wy, wz, hx, hy, hz, square;  // square: of its length
  hn::Mask<F> above;
  HWY_INLINE Halfway(const Terms& t, V x, V y, V z)
      : wx(Along(t.frame[0], x, y, z)),
        wy(Along(t.frame[1], x, y, z)),
        wz(Along(t.frame[2], x, y, z)),
        hx(hn::Add(wx, Fill(t.wo.x))),
        hy(hn::Add(wy, Fill(t.wo.y))),
        hz(hn::Max(hn::Add(wz, Fill(t.wo.z)), Fill(1e-6f))),
        square(hn::Max(hn::MulAdd(hx, hx, hn::MulAdd(hy, hy, hn::Mul(hz, hz))), Fill(1e-12f))),
        above(hn::Gt(wz, Fill(least_cosine))) {}
};

// All that is wanted of wi + wo are its slopes and its length: these straight from wi.
struct WardLobe {
  static constexpr int count = 1;
  const Terms& t;
  Vec3 along, across, up, twice;
  float plus_x, plus_y, plus_z, scale;
  explicit WardLobe(const Terms& terms)
      : t(terms),
        along(t.frame[0] / t.alpha.x),
        across(t.frame[1] / t.alpha.y),
        up(t.frame[2]),
        twice(2 * (t.frame * t.wo)),
        plus_x(t.wo.x / t.alpha.x),
        plus_y(t.wo.y / t.alpha.y),
        plus_z(t.wo.z),
        scale(1 / (pi * t.alpha.x * t.alpha.y)) {}
  HWY_INLINE void operator()(V x, V y, V z, V* s) const {
    const V hx = AlongPlus(along, plus_x, x, y, z), hy = AlongPlus(across, plus_y, x, y, z),
            hz = hn::Max(AlongPlus(up, plus_z, x, y, z), Fill(1e-6f)), square = AlongPlus(twice, 2, x, y, z);
    const V inverse = Reciprocal(hn::Mul(hz, hz));
    const V bell = ExpOfNegative(hn::Neg(hn::Mul(hn::MulAdd(hx, hx, hn::Mul(hy, hy)), inverse)));
    const V over = hn::Mul(hn::Mul(square, Fill(scale)), hn::Mul(inverse, inverse));
    s[0] = hn::IfThenElseZero(hn::Gt(hz, Fill(plus_z + least_cosine)), hn::Mul(bell, over));
  }
};

// Of one Fresnel term and one without; with a base below it the third term.
template <bool layered>
struct GgxLobe {
  static constexpr int count = layered ? 3 : 2;
  const Terms& t;
  float narrow_x, narrow_y, scale, root_o;
  explicit GgxLobe(const Terms& terms)
      : t(terms),
        narrow_x(1 / t.alpha.x),
        narrow_y(1 / t.alpha.y),
        scale(1 / (4 * pi * t.alpha.x * t.alpha.y)),
        root_o(0.5f * length(Vec3(t.alpha.x * t.wo.x, t.alpha.y * t.wo.y, t.wo.z))) {}
  HWY_INLINE V HalfRoot(V x, V y, V z) const {
    const V sx = hn::Mul(x, Fill(t.alpha.x)), sy = hn::Mul(y, Fill(t.alpha.y));
    return hn::Mul(Fill(0.5f), hn::Sqrt(hn::MulAdd(sx, sx, hn::MulAdd(sy, sy, hn::Mul(z, z)))));
  }
  HWY_INLINE void operator()(V x, V y, V z, V* s) const {
    const Halfway h(t, x, y, z);
    const V one = Fill(1.0f), ax = hn::Mul(h.hx, Fill(narrow_x)), ay = hn::Mul(h.hy, Fill(narrow_y));
    const V slopes = hn::MulAdd(ax, ax, hn::MulAdd(ay, ay, hn::Mul(h.hz, h.hz)));  // times the squared length
    const V masking = hn::MulAdd(Fill(t.wo.z), HalfRoot(h.wx, h.wy, h.wz), hn::Mul(h.wz, Fill(root_o)));
    const V share = hn::Div(h.square, slopes);
    const V lobe = hn::IfThenElseZero(h.above, hn::Div(hn::Mul(Fill(scale), hn::Mul(share, share)), masking));
    const V q = hn::Max(hn::NegMulAdd(Fill(0.5f), hn::Sqrt(h.square), one), hn::Zero(F())), q2 = hn::Mul(q, q);
    const V schlick = hn::Mul(hn::Mul(q2, q2), q);
    s[0] = hn::Mul(lobe, hn::Sub(one, schlick)), s[1] = hn::Mul(lobe, schlick);
    if constexpr (layered) s[2] = hn::IfThenElseZero(h.above, hn::Sub(one, schlick));
  }
};

// A term for each channel; one where they reflect alike.
template <int channels>
struct CookTorranceLobe {
  static constexpr int count = channels;
  const Terms& t;
  float narrow, scale;
  explicit CookTorranceLobe(const Terms& terms)
      : t(terms), narrow(1 / (t.alpha.x * t.alpha.x)), scale(4 * pi * t.alpha.x * t.alpha.x * t.wo.z) {}
  HWY_INLINE V Fresnel(float index, V c) const {
    if (!(index > 0)) return Fill(1.0f);  // that of an f0 of 1
    const V one = Fill(1.0f), g = hn::Sqrt(hn::MulAdd(c, c, Fill(index * index - 1)));
    const V a = hn::Div(hn::Sub(g, c), hn::Add(g, c));
    const V q = hn::Div(hn::MulSub(c, hn::Add(g, c), one), hn::MulAdd(c, hn::Sub(g, c), one));
    return hn::Mul(hn::Mul(Fill(0.5f), hn::Mul(a, a)), hn::MulAdd(q, q, one));
  }
  HWY_INLINE void operator()(V x, V y, V z, V* s) const {
    const Halfway h(t, x, y, z);
    const V one = Fill(1.0f), length = hn::Sqrt(h.square), cosine = hn::Mul(Fill(0.5f), length);
    const V hz = hn::Div(h.hz, length), inverse = hn::Div(one, hn::Mul(h.hz, h.hz));
    const V slopes = hn::Mul(hn::MulAdd(h.hx, h.hx, hn::Mul(h.hy, h.hy)), hn::Mul(inverse, Fill(narrow)));
    const V bell = ExpOfNegative(hn::Neg(slopes));
    const V wz = hn::Max(h.wz, Fill(least_cosine));
    const V masking = hn::Min(one, hn::Div(hn::Mul(hn::Add(hz, hz), hn::Min(wz, Fill(t.wo.z))), cosine));
    const V hz2 = hn::Mul(hz, hz);
    const V lobe = hn::IfThenElseZero(
        h.above, hn::Div(hn::Mul(bell, masking), hn::Mul(hn::Mul(Fill(scale), wz), hn::Mul(hz2, hz2))));
    for (int k = 0; k < channels; ++k) s[k] = hn::Mul(lobe, Fresnel(t.index[k], cosine));
  }
};

// Trilinear between the cells of the table, a number a channel.
struct MeasuredLobe {
  static constexpr int count = 3;
  using I = hn::RebindToSigned<F>;
  using VI = hn::Vec<I>;
  const Terms& t;
  // Of y >= 0.
  static HWY_INLINE V Angle(V y, V x) {
    const V ax = hn::Abs(x), most = hn::Max(hn::Max(ax, y), Fill(1e-30f));
    V a = hn::Atan(F(), hn::Div(hn::Min(ax, y), most));
    a = hn::IfThenElse(hn::Gt(y, ax), hn::Sub(Fill(pi / 2), a), a);
    return hn::IfThenElse(hn::Lt(x, hn::Zero(F())), hn::Sub(Fill(pi), a), a);
  }
  struct Tap {
    VI first, second;
    V share;
  };
  static HWY_INLINE Tap TapOf(V fraction, int cells, bool periodic) {
    const I di;
    const V at = hn::MulAdd(fraction, Fill(float(cells)), Fill(-0.5f)), whole = hn::Floor(at);
    const VI i = hn::ConvertTo(di, whole), j = hn::Add(i, hn::Set(di, 1)), zero = hn::Zero(di),
             all = hn::Set(di, cells), last = hn::Set(di, cells - 1);
    const V share = hn::Sub(at, whole);
    if (periodic)
      return {hn::IfThenElse(hn::Lt(i, zero), hn::Add(i, all), i), hn::IfThenElse(hn::Gt(j, last), hn::Sub(j, all), j),
              share};
    return {hn::Min(hn::Max(i, zero), last), hn::Min(hn::Max(j, zero), last), share};
  }
  HWY_INLINE void operator()(V x, V y, V z, V* s) const {
    const F d;
    const I di;
    const MeasuredTable& table = *t.table;
    const Halfway h(t, x, y, z);
    const V one = Fill(1.0f), zero = hn::Zero(d);
    const V length = hn::Sqrt(h.square), inverse = hn::Div(one, length);
    const V nx = hn::Mul(h.hx, inverse), ny = hn::Mul(h.hy, inverse), nz = hn::Mul(h.hz, inverse);
    const V dx = hn::Sub(h.wx, Fill(t.wo.x)), dy = hn::Sub(h.wy, Fill(t.wo.y)), dz = hn::Sub(h.wz, Fill(t.wo.z));
    // The frame about h, as half_difference() has it: `along` is where theta_h grows.
    const V sine = hn::Sqrt(hn::MulAdd(nx, nx, hn::Mul(ny, ny))), upright = hn::Max(sine, Fill(1e-20f)),
            by = hn::Div(one, upright);
    const auto tilted = hn::Gt(sine, Fill(1e-18f));
    const V ex = hn::IfThenElse(tilted, hn::Mul(nx, by), one), ey = hn::IfThenElse(tilted, hn::Mul(ny, by), zero);
    V px = hn::NegMulAdd(sine, dz, hn::Mul(nz, hn::MulAdd(ex, dx, hn::Mul(ey, dy))));
    V py = hn::Sub(hn::Mul(ex, dy), hn::Mul(ey, dx));
    const auto swapped = hn::Lt(py, zero);
    px = hn::IfThenElse(swapped, hn::Neg(px), px), py = hn::Abs(py);
    const V difference = hn::Sqrt(hn::MulAdd(dx, dx, hn::MulAdd(dy, dy, hn::Mul(dz, dz))));
    const Tap th = TapOf(hn::Sqrt(hn::Min(hn::Mul(Angle(sine, nz), Fill(2 / pi)), one)), table.theta_h, false),
              td = TapOf(hn::Min(hn::Mul(Angle(difference, length), Fill(2 / pi)), one), table.theta_d, false),
              tp = TapOf(hn::Min(hn::Mul(Angle(py, px), Fill(1 / pi)), one), table.phi_d, true);
    const float* values = &table.f[0].x;
    for (int k = 0; k < 3; ++k) s[k] = zero;
    for (int corner = 0; corner < 8; ++corner) {
      const VI ih = corner & 4 ? th.second : th.first, id = corner & 2 ? td.second : td.first,
               ip = corner & 1 ? tp.second : tp.first;
      const V w = hn::Mul(
          hn::Mul(corner & 4 ? th.share : hn::Sub(one, th.share), corner & 2 ? td.share : hn::Sub(one, td.share)),
          corner & 1 ? tp.share : hn::Sub(one, tp.share));
      const VI cell =
          hn::Add(hn::Mul(hn::Add(hn::Mul(ih, hn::Set(di, table.theta_d)), id), hn::Set(di, table.phi_d)), ip);
      const VI at = hn::Mul(cell, hn::Set(di, 3));
      for (int k = 0; k < 3; ++k) s[k] = hn::MulAdd(w, hn::GatherIndex(d, values + k, at), s[k]);
    }
    for (int k = 0; k < 3; ++k) s[k] = hn::IfThenElseZero(h.above, s[k]);
  }
};

// Calls f with the lobe of these terms.
template <class Use>
HWY_INLINE void WithLobe(const Terms& t, Use use) {
  using K = Terms::Kind;
  if (t.kind == K::phong) use(PhongLobe(t));
  else if (t.kind == K::ward) use(WardLobe(t));
  else if (t.kind == K::ggx && t.count == 3) use(GgxLobe<true>(t));
  else if (t.kind == K::ggx) use(GgxLobe<false>(t));
  else if (t.kind == K::cook_torrance && t.count == 3) use(CookTorranceLobe<3>(t));
  else if (t.kind == K::cook_torrance) use(CookTorranceLobe<1>(t));
  else if (t.kind == K::measured) use(MeasuredLobe{t});
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();
#endif
