// multiply_sh: orders 2 and 3 in closed form, all others on a grid. A degree of a + b + c - 3 in z (all orders) needs
// (a + b + c - 1) / 2 Gauss-Legendre nodes, rounded down; the same azimuthal frequency needs a + b + c - 2 equal steps.
// Steps come in fours, phi, -phi, pi - phi, pi + phi, which share one set of sums over even and odd cosines and sines.
// SIMD lanes hold nodes of z on the way out and degrees on the way back.
#include <lambent/basis/quadrature.h>
#include <lambent/basis/sh_product.h>
#include <lambent/core/check.h>

#include <array>
#include <memory>
#include <mutex>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/basis/sh_product_grid.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef LAMBENT_SH_PRODUCT_GRID
#define LAMBENT_SH_PRODUCT_GRID
namespace lambent {
namespace {

constexpr size_t grid_lanes = 8;

struct ProductGrid {
  int a, b, c;                    // orders
  size_t nodes;                   // in z, a multiple of grid_lanes; the weights of those beyond what is needed are zero
  size_t quarter;                 // steps of phi over four
  size_t degrees;                 // c rounded up to a multiple of grid_lanes
  AlignedVector<float> legendre;  // [m, l >= m][node], up to the greater of a and b
  AlignedVector<float> turns;     // [step][m] pairs cos(m phi), sin(m phi), max_sh_order pairs a step
  AlignedVector<float> back;      // [m][node][l - m], weights included
};

}  // namespace
}  // namespace lambent
#endif

HWY_BEFORE_NAMESPACE();
namespace lambent {
namespace {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::CappedTag<float, grid_lanes>;
using V = hn::Vec<F>;

// Sums over l at Lanes nodes of z: even and odd m, cosines at 2m, sines at 2m + 1.
template <int fixed>
HWY_INLINE void Spread(int order, const float* c, const float* HWY_RESTRICT legendre, size_t stride, int skip,
                       V* HWY_RESTRICT f) {
  const F d;
  if (fixed) order = fixed;
  for (int m = 0; m < order; ++m) {
    V plus = hn::Zero(d), minus = hn::Zero(d);
    for (int l = m; l < order; ++l, legendre += stride) {
      const V p = hn::LoadU(d, legendre);
      plus = hn::MulAdd(hn::Set(d, c[l * l + l + m]), p, plus);
      if (m > 0) minus = hn::MulAdd(hn::Set(d, c[l * l + l - m]), p, minus);
    }
    legendre += size_t(skip) * stride;
    f[2 * m] = plus, f[2 * m + 1] = minus;
  }
}

// Values at phi, -phi, pi - phi, pi + phi.
template <int fixed>
HWY_INLINE void Turn(int order, const V* HWY_RESTRICT f, const float* HWY_RESTRICT turn, V out[4]) {
  const F d;
  if (fixed) order = fixed;
  V ce = f[0], co = hn::Zero(d), se = co, so = co;
  for (int m = 1; m < order; m += 2) {
    co = hn::MulAdd(hn::Set(d, turn[2 * m]), f[2 * m], co);
    so = hn::MulAdd(hn::Set(d, turn[2 * m + 1]), f[2 * m + 1], so);
  }
  for (int m = 2; m < order; m += 2) {
    ce = hn::MulAdd(hn::Set(d, turn[2 * m]), f[2 * m], ce);
    se = hn::MulAdd(hn::Set(d, turn[2 * m + 1]), f[2 * m + 1], se);
  }
  const V cp = hn::Add(ce, co), cm = hn::Sub(ce, co), sp = hn::Add(se, so), sm = hn::Sub(so, se);
  out[0] = hn::Add(cp, sp), out[1] = hn::Sub(cp, sp), out[2] = hn::Add(cm, sm), out[3] = hn::Sub(cm, sm);
}

template <int fixed>
void MultiplyOnGrid(const ProductGrid& g, const float* a, const float* b, float* out) {
  const F d;
  const size_t lanes = hn::Lanes(d);
  const int na = fixed ? fixed : g.a, nb = fixed ? fixed : g.b, nc = fixed ? fixed : g.c,
            table = fixed ? fixed : std::max(na, nb);
  const size_t degrees = fixed ? (fixed + grid_lanes - 1) / grid_lanes * grid_lanes : g.degrees;
  constexpr int most = fixed ? fixed : max_sh_order;
  constexpr size_t most_degrees = (most + grid_lanes - 1) / grid_lanes * grid_lanes;
  HWY_ALIGN float sums[2 * most * most_degrees];  // [m, sine][l - m]
  for (size_t i = 0; i < 2 * size_t(nc) * degrees; i += lanes) hn::Store(hn::Zero(d), d, sums + i);
  for (size_t z = 0; z < g.nodes; z += lanes) {
    V fa[2 * most], fb[2 * most], fc[2 * most];
    Spread<fixed>(na, a, g.legendre.data() + z, g.nodes, table - na, fa);
    Spread<fixed>(nb, b, g.legendre.data() + z, g.nodes, table - nb, fb);
    for (int m = 0; m < 2 * nc; ++m) fc[m] = hn::Zero(d);
    const float* turn = g.turns.data();
    for (size_t step = 0; step < g.quarter; ++step, turn += 2 * max_sh_order) {
      V p[4], q[4];
      Turn<fixed>(na, fa, turn, p);
      Turn<fixed>(nb, fb, turn, q);
      for (int k = 0; k < 4; ++k) p[k] = hn::Mul(p[k], q[k]);
      const V cp = hn::Add(p[0], p[1]), sp = hn::Sub(p[0], p[1]), cm = hn::Add(p[2], p[3]), sm = hn::Sub(p[2], p[3]);
      const V ce = hn::Add(cp, cm), co = hn::Sub(cp, cm), so = hn::Add(sp, sm), se = hn::Sub(sp, sm);
      fc[0] = hn::Add(fc[0], ce);
      for (int m = 1; m < nc; m += 2) {
        fc[2 * m] = hn::MulAdd(hn::Set(d, turn[2 * m]), co, fc[2 * m]);
        fc[2 * m + 1] = hn::MulAdd(hn::Set(d, turn[2 * m + 1]), so, fc[2 * m + 1]);
      }
      for (int m = 2; m < nc; m += 2) {
        fc[2 * m] = hn::MulAdd(hn::Set(d, turn[2 * m]), ce, fc[2 * m]);
        fc[2 * m + 1] = hn::MulAdd(hn::Set(d, turn[2 * m + 1]), se, fc[2 * m + 1]);
      }
    }
    HWY_ALIGN float plus[grid_lanes], minus[grid_lanes];
    for (int m = 0; m < nc; ++m) {
      hn::Store(fc[2 * m], d, plus), hn::Store(fc[2 * m + 1], d, minus);
      for (size_t l = 0; l < degrees; l += lanes) {
        const float* back = g.back.data() + (size_t(m) * g.nodes + z) * degrees + l;
        float* sum = sums + 2 * size_t(m) * degrees + l;
        V s = hn::Load(d, sum), t = hn::Load(d, sum + degrees);
        for (size_t k = 0; k < lanes; ++k, back += degrees) {
          const V w = hn::LoadU(d, back);
          s = hn::MulAdd(hn::Set(d, plus[k]), w, s), t = hn::MulAdd(hn::Set(d, minus[k]), w, t);
        }
        hn::Store(s, d, sum), hn::Store(t, d, sum + degrees);
      }
    }
  }
  for (int m = 0; m < nc; ++m)
    for (int l = m; l < nc; ++l) {
      const float* sum = sums + 2 * size_t(m) * degrees + size_t(l - m);
      out[l * l + l - m] = sum[degrees], out[l * l + l + m] = sum[0];  // for m = 0 the second is what stays
    }
}

void MultiplySh(const ProductGrid& g, const float* a, const float* b, float* out) {
  switch (g.a == g.b && g.b == g.c ? g.a : 0) {
    case 4: return MultiplyOnGrid<4>(g, a, b, out);
    case 5: return MultiplyOnGrid<5>(g, a, b, out);
    case 6: return MultiplyOnGrid<6>(g, a, b, out);
    case 7: return MultiplyOnGrid<7>(g, a, b, out);
    case 8: return MultiplyOnGrid<8>(g, a, b, out);
    default: return MultiplyOnGrid<0>(g, a, b, out);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace
}  // namespace lambent
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lambent {
namespace {

HWY_EXPORT(MultiplySh);

ProductGrid make_product_grid(int a, int b, int c) {
  ProductGrid g{a, b, c, 0, 0, 0, {}, {}, {}};
  const int needed = (a + b + c - 1) / 2, steps = a + b + c - 2, table = std::max(a, b);
  auto round_up = [](int n, size_t multiple) { return (size_t(n) + multiple - 1) / multiple * multiple; };
  g.nodes = round_up(needed, grid_lanes), g.degrees = round_up(c, grid_lanes), g.quarter = round_up(steps, 4) / 4;
  g.legendre.resize(size_t(table * (table + 1) / 2) * g.nodes);
  g.back.resize(size_t(c) * g.nodes * g.degrees);
  const auto rule = gauss_legendre(needed);
  std::array<double, sh_count(max_sh_order)> y;
  for (size_t i = 0; i < rule.size(); ++i) {
    const double z = rule[i].x, weight = rule[i].weight * 2 * std::numbers::pi / double(4 * g.quarter);
    evaluate_sh(std::max(table, c), Vec3d(std::sqrt(1 - z * z), 0, z), y);
    size_t row = 0;
    for (int m = 0; m < table; ++m)
      for (int l = m; l < table; ++l) g.legendre[row++ * g.nodes + i] = float(y[size_t(sh_index(l, m))]);
    for (int m = 0; m < c; ++m) {
      float* back = g.back.data() + (size_t(m) * g.nodes + i) * g.degrees;
      for (int l = m; l < c; ++l) back[l - m] = float(weight * y[size_t(sh_index(l, m))]);
    }
  }
  for (size_t j = 0; j < g.quarter; ++j)
    for (int m = 0; m < max_sh_order; ++m) {
      const double phi = 2 * std::numbers::pi * (double(j) + 0.5) / double(4 * g.quarter);
      g.turns.push_back(float(std::cos(m * phi))), g.turns.push_back(float(std::sin(m * phi)));
    }
  return g;
}

const ProductGrid& product_grid(int a, int b, int c) {
  struct Slot {
    std::once_flag once;
    std::unique_ptr<const ProductGrid> grid;
  };
  static std::array<Slot, size_t(max_sh_order) * max_sh_order * max_sh_order> slots;
  Slot& slot = slots[size_t(((a - 1) * max_sh_order + b - 1) * max_sh_order + c - 1)];
  std::call_once(slot.once, [&] { slot.grid = std::make_unique<const ProductGrid>(make_product_grid(a, b, c)); });
  return *slot.grid;
}

// f = constant + vector . d + d . tensor d for functions of order up to 3; the tensor is symmetric and traceless.
struct Quadratic {
  float constant = 0;
  Vec3 vector{0.0f};
  float xx = 0, yy = 0, zz = 0, xy = 0, yz = 0, xz = 0;
};
// The factors of 1, x, xy and (3 z^2 - 1) / 2 in y_00, y_11, y_2-2 and y_20.
constexpr float k0 = 0.28209479f, k1 = 0.48860251f, k2 = 1.09254843f, k20 = 0.63078313f;

Quadratic quadratic(const float* f) {
  const float half = 0.5f * k2, axis = -0.5f * k20 * f[6];
  return {k0 * f[0],          k1 * Vec3(-f[3], -f[1], f[2]),
          axis + half * f[8], axis - half * f[8],
          k20 * f[6],         half * f[4],
          -half * f[5],       -half * f[7]};
}

// With <> the mean over the sphere, <di dj> = 1/3 delta and <di dj dk dl> = 1/15 (three pairs of deltas), the product's
// parts are
//   constant  c c' + v.v'/3 + 2/15 Q:Q'       vector  c v' + c' v + 2/5 (Q v' + Q' v)
//   tensor    c Q' + c' Q + traceless symmetric part of (v v' + 4/7 Q Q').
void multiply_quadratic(const float* f, const float* g, float* out) {
  const Quadratic a = quadratic(f), b = quadratic(g);
  auto times = [](const Quadratic& q, Vec3 v) {
    return Vec3(q.xx * v.x + q.xy * v.y + q.xz * v.z, q.xy * v.x + q.yy * v.y + q.yz * v.z,
                q.xz * v.x + q.yz * v.y + q.zz * v.z);
  };
  const float k = 4.0f / 7;
  const float qx = a.xx * b.xx, qy = a.yy * b.yy, qz = a.zz * b.zz, rx = a.yz * b.yz, ry = a.xz * b.xz,
              rz = a.xy * b.xy;
  const Vec3 squares = a.vector * b.vector + k * Vec3(qx + ry + rz, qy + rx + rz, qz + rx + ry);
  const float contraction = qx + qy + qz + 2 * (rx + ry + rz);
  const float constant = a.constant * b.constant + (1.0f / 3) * dot(a.vector, b.vector) + (2.0f / 15) * contraction;
  const Vec3 vector = a.constant * b.vector + b.constant * a.vector + 0.4f * (times(a, b.vector) + times(b, a.vector));
  const float third = (1.0f / 3) * (squares.x + squares.y + squares.z);
  const float xx = a.constant * b.xx + b.constant * a.xx + squares.x - third;
  const float yy = a.constant * b.yy + b.constant * a.yy + squares.y - third;
  const float zz = a.constant * b.zz + b.constant * a.zz + squares.z - third;
  // (Q Q')_xy = xx xy' + xy yy' + xz yz', and so on; halves of the symmetric parts.
  const float xy = a.constant * b.xy + b.constant * a.xy +
                   0.5f * (a.vector.x * b.vector.y + a.vector.y * b.vector.x +
                           k * ((a.xx + a.yy) * b.xy + a.xy * (b.xx + b.yy) + a.xz * b.yz + a.yz * b.xz));
  const float yz = a.constant * b.yz + b.constant * a.yz +
                   0.5f * (a.vector.y * b.vector.z + a.vector.z * b.vector.y +
                           k * ((a.yy + a.zz) * b.yz + a.yz * (b.yy + b.zz) + a.xy * b.xz + a.xz * b.xy));
  const float xz = a.constant * b.xz + b.constant * a.xz +
                   0.5f * (a.vector.x * b.vector.z + a.vector.z * b.vector.x +
                           k * ((a.xx + a.zz) * b.xz + a.xz * (b.xx + b.zz) + a.xy * b.yz + a.yz * b.xy));
  out[0] = constant * (1 / k0);
  out[1] = vector.y * (-1 / k1), out[2] = vector.z * (1 / k1), out[3] = vector.x * (-1 / k1);
  out[4] = xy * (2 / k2), out[5] = yz * (-2 / k2), out[6] = zz * (1 / k20), out[7] = xz * (-2 / k2),
  out[8] = (xx - yy) * (1 / k2);
}

// The same without quadratic parts.
void multiply_linear(const float* f, const float* g, float* out) {
  const float a = f[0], b = g[0];
  const float dot = f[1] * g[1] + f[2] * g[2] + f[3] * g[3];
  const float x = a * g[1] + b * f[1], y = a * g[2] + b * f[2], z = a * g[3] + b * f[3];
  out[0] = k0 * (a * b + dot), out[1] = k0 * x, out[2] = k0 * y, out[3] = k0 * z;
}

// As sh_order, by a table: a square root would be a good part of a small product.
int order_of(size_t count) {
  static constexpr auto orders = [] {
    std::array<int8_t, sh_count(max_sh_order) + 1> table{};
    for (int order = 1; order <= max_sh_order; ++order) table[size_t(sh_count(order))] = int8_t(order);
    return table;
  }();
  LAMBENT_CHECK(count < orders.size() && orders[count] > 0);
  return orders[count];
}

}  // namespace

void multiply_sh(std::span<const float> a, std::span<const float> b, std::span<float> out) {
  if (a.size() == b.size() && a.size() == out.size()) {
    if (a.size() == 4) return multiply_linear(a.data(), b.data(), out.data());
    if (a.size() == 9) return multiply_quadratic(a.data(), b.data(), out.data());
  }
  const ProductGrid& g = product_grid(order_of(a.size()), order_of(b.size()), order_of(out.size()));
  HWY_DYNAMIC_DISPATCH(MultiplySh)(g, a.data(), b.data(), out.data());
}

}  // namespace lambent
#endif
