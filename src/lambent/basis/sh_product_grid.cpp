// multiply_sh: order 2 in closed form, 3 and 4 on pairs of opposite points, all others on a grid.
//
// Pairs: at d and -d bands of even degree agree and those of odd degree are opposite, so a function is its even part e
// and odd part o at half of the points, and a product has the parts e e' + o o' and e o' + o e'. Lebedev's rules of 26
// points (exact to degree 7) and 38 (degree 9) have weights in closed form; products need degree 6 and 9.
//
// Grid: a degree of a + b + c - 3 in z (all orders) needs (a + b + c - 1) / 2 Gauss-Legendre nodes, rounded down; the
// same azimuthal frequency needs a + b + c - 2 equal steps. Steps come in fours, phi, -phi, pi - phi, pi + phi, which
// share one set of sums over even and odd cosines and sines. SIMD lanes hold nodes of z on the way out and degrees on
// the way back.
#include <lambent/basis/quadrature.h>
#include <lambent/basis/sh_product.h>
#include <lambent/basis/sh_tables.h>
#include <lambent/core/check.h>

#include <array>
#include <cstring>
#include <memory>
#include <mutex>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lambent/basis/sh_product_grid.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
#include <lambent/basis/everywhere-inl.h>

#ifndef LAMBENT_SH_PRODUCT_GRID
#define LAMBENT_SH_PRODUCT_GRID
namespace lambent {
namespace {

constexpr size_t grid_lanes = 8;

// Coefficients by the parity of their band, the first `evens` or `odds` of a list for the order. Sums over pairs come
// out in three vectors: of even bands 0, 8, -, -, 4 .. 7, of odd ones -, 1, 2, 3 and -, 9 .. 15.
template <int order>
struct PairSizes {
  static constexpr size_t pairs = order == 3 ? 13 : 19, padded = (pairs + grid_lanes - 1) / grid_lanes * grid_lanes;
  static constexpr int evens = 6, odds = order == 3 ? 3 : 10, vectors = order == 3 ? 2 : 3;
};
constexpr int even_coefficients[] = {0, 4, 5, 6, 7, 8}, odd_coefficients[] = {1, 2, 3, 9, 10, 11, 12, 13, 14, 15};
constexpr int pair_sums[3 * grid_lanes] = {0,  8,  -1, -1, 4,  5, 6,  7,  -1, 1,  2,  3,
                                           -1, -1, -1, -1, -1, 9, 10, 11, 12, 13, 14, 15};

template <int order>
struct ProductPairs {
  using Sizes = PairSizes<order>;
  alignas(64) float values[(Sizes::evens + Sizes::odds) * Sizes::padded]{};  // [even, then odd coefficient][pair]
  alignas(64) float back[Sizes::pairs * Sizes::vectors * grid_lanes]{};      // [pair][sum], weights included
};

// The recurrence of sh_tables.h, for the compiler.
template <int order>
constexpr std::array<double, sh_count(order)> harmonics(double x, double y, double z) {
  std::array<double, sh_count(order)> values{};
  double c = 1, s = 0;
  for (int m = 0; m < order; ++m) {
    double q = sh_tables().diagonal[m], below = 0;
    for (int l = m; l < order; ++l) {
      if (l > m) {
        const double next = sh_tables().a[l][m] * z * q + sh_tables().b[l][m] * below;
        below = q, q = next;
      }
      values[size_t(sh_index(l, -m))] = q * s, values[size_t(sh_index(l, m))] = q * c;
    }
    const double next = c * x - s * y;
    s = c * y + s * x, c = next;
  }
  return values;
}

// From one of each two opposite points of Lebedev's rule; the weights of a rule sum to 1. Source: V. I. Lebedev,
// "Quadratures on a sphere", USSR Comput. Math. Math. Phys. 16 (1976).
template <int order>
constexpr ProductPairs<order> make_product_pairs() {
  using Sizes = PairSizes<order>;
  ProductPairs<order> t;
  size_t pair = 0;
  auto add = [&](double x, double y, double z, double weight) {
    const auto values = harmonics<order>(x, y, z);
    for (size_t i = 0; i < Sizes::evens; ++i)
      t.values[i * Sizes::padded + pair] = float(values[size_t(even_coefficients[i])]);
    for (size_t i = 0; i < Sizes::odds; ++i)
      t.values[(Sizes::evens + i) * Sizes::padded + pair] = float(values[size_t(odd_coefficients[i])]);
    for (size_t i = 0, n = Sizes::vectors * grid_lanes; i < n; ++i)
      if (pair_sums[i] >= 0) t.back[pair * n + i] = float(8 * std::numbers::pi * weight * values[size_t(pair_sums[i])]);
    ++pair;
  };
  const double axis = order == 3 ? 1.0 / 21 : 1.0 / 105, r = constant_sqrt(1.0 / 3), h = constant_sqrt(0.5);
  add(1, 0, 0, axis), add(0, 1, 0, axis), add(0, 0, 1, axis);
  for (double x : {-r, r})
    for (double y : {-r, r}) add(x, y, r, 9.0 / 280);
  const double p = order == 3 ? h : constant_sqrt((1 + r) / 2), q = order == 3 ? h : constant_sqrt((1 - r) / 2);
  const double edge = order == 3 ? 4.0 / 105 : 1.0 / 35;
  for (double sign : {-1.0, 1.0}) {
    add(p, sign * q, 0, edge), add(0, p, sign * q, edge), add(sign * q, 0, p, edge);
    if (order > 3) add(q, sign * p, 0, edge), add(0, q, sign * p, edge), add(sign * p, 0, q, edge);
  }
  return t;
}
template <int order>
inline constexpr ProductPairs<order> product_pairs = make_product_pairs<order>();

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

// Adds what the pairs from p on have to the sums, of which there are two sets in turn, so that they wait less for one
// another.
template <int order, size_t p>
HWY_INLINE void AddPairs(const V* HWY_RESTRICT even, const V* HWY_RESTRICT odd, V* HWY_RESTRICT sums,
                         V* HWY_RESTRICT next) {
  using Sizes = PairSizes<order>;
  if constexpr (p < Sizes::pairs) {
    const F d;
    constexpr size_t lanes = hn::MaxLanes(F()), width = grid_lanes / lanes;
    const V e = Everywhere<p>(d, even), o = Everywhere<p>(d, odd);
    const float* back = product_pairs<order>.back + p * Sizes::vectors * grid_lanes;
    for (size_t v = 0; v < Sizes::vectors * width; ++v)
      sums[v] = hn::MulAdd(v < width ? e : o, hn::Load(d, back + v * lanes), sums[v]);
    AddPairs<order, p + 1>(even, odd, next, sums);
  }
}

template <int order>
HWY_INLINE void MultiplyOnPairs(const float* a, const float* b, float* out) {
  using Sizes = PairSizes<order>;
  const F d;
  constexpr size_t lanes = hn::MaxLanes(F()), parts = Sizes::padded / lanes, width = grid_lanes / lanes;
  V ea[parts], eb[parts], oa[parts], ob[parts];
  for (size_t p = 0; p < parts; ++p) ea[p] = eb[p] = oa[p] = ob[p] = hn::Zero(d);
  const float* row = product_pairs<order>.values;
  for (int i = 0; i < Sizes::evens; ++i, row += Sizes::padded) {
    const V ca = hn::Set(d, a[even_coefficients[i]]), cb = hn::Set(d, b[even_coefficients[i]]);
    for (size_t p = 0; p < parts; ++p) {
      const V y = hn::Load(d, row + p * lanes);
      ea[p] = hn::MulAdd(ca, y, ea[p]), eb[p] = hn::MulAdd(cb, y, eb[p]);
    }
  }
  for (int i = 0; i < Sizes::odds; ++i, row += Sizes::padded) {
    const V ca = hn::Set(d, a[odd_coefficients[i]]), cb = hn::Set(d, b[odd_coefficients[i]]);
    for (size_t p = 0; p < parts; ++p) {
      const V y = hn::Load(d, row + p * lanes);
      oa[p] = hn::MulAdd(ca, y, oa[p]), ob[p] = hn::MulAdd(cb, y, ob[p]);
    }
  }
  V even[parts], odd[parts];
  for (size_t p = 0; p < parts; ++p) {
    even[p] = hn::MulAdd(ea[p], eb[p], hn::Mul(oa[p], ob[p]));
    odd[p] = hn::MulAdd(ea[p], ob[p], hn::Mul(oa[p], eb[p]));
  }
  V first[Sizes::vectors * width], second[Sizes::vectors * width];
  for (size_t v = 0; v < Sizes::vectors * width; ++v) first[v] = second[v] = hn::Zero(d);
  AddPairs<order, 0>(even, odd, first, second);
  HWY_ALIGN float result[Sizes::vectors * grid_lanes];
  for (size_t v = 0; v < Sizes::vectors * width; ++v) hn::Store(hn::Add(first[v], second[v]), d, result + v * lanes);
  out[0] = result[0], out[8] = result[1];  // as pair_sums says; a loop over it would become a slow scatter
  std::memcpy(out + 4, result + 4, 4 * sizeof(float));
  std::memcpy(out + 1, result + 9, 3 * sizeof(float));
  if (order == 4) std::memcpy(out + 9, result + 17, 7 * sizeof(float));
}

void MultiplyOrder3(const float* a, const float* b, float* out) { MultiplyOnPairs<3>(a, b, out); }
void MultiplyOrder4(const float* a, const float* b, float* out) { MultiplyOnPairs<4>(a, b, out); }

void MultiplySh(const ProductGrid& g, const float* a, const float* b, float* out) {
  switch (g.a == g.b && g.b == g.c ? g.a : 0) {
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
HWY_EXPORT(MultiplyOrder3);
HWY_EXPORT(MultiplyOrder4);

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

// Order 2: (a + v.d)(b + w.d) with <di dj> = 1/3 delta, and y_00 in front of every term. Four floats at once, as every
// target has them: choosing one at run time would take longer.
void multiply_linear(const float* f, const float* g, float* out) {
  typedef float Four __attribute__((vector_size(16)));
  Four a, b;
  std::memcpy(&a, f, sizeof a), std::memcpy(&b, g, sizeof b);
  const Four product = a * b, rest = {product[1] + product[2] + (product[3] - product[0]), 0, 0, 0};
  const Four result = 0.28209479f * (a[0] * b + b[0] * a + rest);
  std::memcpy(out, &result, sizeof result);
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

// Each apart, so that a small product does not save registers for a big one.
[[gnu::noinline]] void multiply_order_3(const float* a, const float* b, float* out) {
  HWY_DYNAMIC_DISPATCH(MultiplyOrder3)(a, b, out);
}
[[gnu::noinline]] void multiply_order_4(const float* a, const float* b, float* out) {
  HWY_DYNAMIC_DISPATCH(MultiplyOrder4)(a, b, out);
}
[[gnu::noinline]] void multiply_on_grid(std::span<const float> a, std::span<const float> b, std::span<float> out) {
  const ProductGrid& g = product_grid(order_of(a.size()), order_of(b.size()), order_of(out.size()));
  HWY_DYNAMIC_DISPATCH(MultiplySh)(g, a.data(), b.data(), out.data());
}

}  // namespace

void multiply_sh(std::span<const float> a, std::span<const float> b, std::span<float> out) {
  const size_t count = out.size();
  if (a.size() == count && b.size() == count) {
    if (count == 4) return multiply_linear(a.data(), b.data(), out.data());
    if (count == 9) return multiply_order_3(a.data(), b.data(), out.data());
    if (count == 16) return multiply_order_4(a.data(), b.data(), out.data());
  }
  multiply_on_grid(a, b, out);
}

}  // namespace lambent
#endif
