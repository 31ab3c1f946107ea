// Follows: triple-product-integrals (tripling coefficients from Wigner 3j symbols, transfer matrices by double
// projection); general-prt (triple products). With Y the complex harmonics with Condon-Shortley sign and Gaunt's
// integral
//   int Y_1 Y_2 Y_3 = sqrt((2 l1+1)(2 l2+1)(2 l3+1) / 4 pi) (l1 l2 l3; 0 0 0) (l1 l2 l3; m1 m2 m3),
// the real ones of sh.h are, for m > 0, y_lm = (Y_lm + (-1)^m Y_l-m) / sqrt 2 and y_l-m = (Y_lm - (-1)^m Y_l-m) / (i
// sqrt 2).
#include <lambent/basis/quadrature.h>
#include <lambent/basis/sh_product.h>
#include <lambent/basis/wigner.h>
#include <lambent/core/check.h>

#include <complex>

namespace lambent {
namespace {

struct ComplexTerm {
  int m;
  std::complex<double> weight;
};
// The real harmonic (l, m) as a sum of one or two complex ones.
int complex_terms(int m, ComplexTerm out[2]) {
  const double h = std::numbers::sqrt2 / 2, sign = m % 2 ? -1 : 1;
  if (m == 0) return out[0] = {0, 1.0}, 1;
  if (m > 0) return out[0] = {m, h}, out[1] = {-m, sign * h}, 2;
  return out[0] = {-m, {0.0, -h}}, out[1] = {m, {0.0, sign * h}}, 2;
}

// Whether C vanishes for every l: the number of sines must be even and the frequencies must be able to cancel.
bool frequencies_cancel(int ma, int mb, int mc) {
  if ((ma < 0) ^ (mb < 0) ^ (mc < 0)) return false;
  const int a = std::abs(ma), b = std::abs(mb), c = std::abs(mc);
  return a + b == c || a + c == b || b + c == a;
}

template <class T>
void multiply_plain(const TriplingTensor& t, const std::vector<T>& values, std::span<const T> a, std::span<const T> b,
                    std::span<T> out) {
  const size_t count = size_t(sh_count(t.order_c));
  LAMBENT_CHECK(a.size() == size_t(sh_count(t.order_a)) && b.size() == size_t(sh_count(t.order_b)) &&
                out.size() == count);
  for (size_t k = 0; k < count; ++k) {
    T sum = 0;
    for (uint32_t e = t.begin[k]; e < t.begin[k + 1]; ++e) sum += values[e] * a[t.i[e]] * b[t.j[e]];
    out[k] = sum;
  }
}

}  // namespace

TriplingTensor make_tripling_tensor(int order_a, int order_b, int order_c) {
  for (int order : {order_a, order_b, order_c}) LAMBENT_CHECK(order >= 1 && order <= max_sh_order);
  TriplingTensor t{order_a, order_b, order_c, {0}, {}, {}, {}, {}};
  struct Entry {
    uint16_t i, j;
    double value;
  };
  std::vector<Entry> entries;
  std::vector<double> sums(static_cast<size_t>(order_a));  // over la, for one (i's m, j, k)
  for (int k = 0; k < sh_count(order_c); ++k) {
    entries.clear();
    const int lc = sh_band(k), mc = k - sh_index(lc, 0);
    for (int j = 0; j < sh_count(order_b); ++j) {
      const int lb = sh_band(j), mb = j - sh_index(lb, 0);
      const Wigner3jFamily zeros = wigner_3j_family(lb, lc, 0, 0);
      for (int ma = -(order_a - 1); ma < order_a; ++ma) {
        if (!frequencies_cancel(ma, mb, mc)) continue;
        std::fill(sums.begin(), sums.end(), 0.0);
        ComplexTerm ta[2], tb[2], tc[2];
        const int na = complex_terms(ma, ta), nb = complex_terms(mb, tb), nc = complex_terms(mc, tc);
        for (int p = 0; p < na; ++p)
          for (int q = 0; q < nb; ++q)
            for (int r = 0; r < nc; ++r) {
              if (ta[p].m + tb[q].m + tc[r].m != 0) continue;
              const double weight = (ta[p].weight * tb[q].weight * tc[r].weight).real();
              const Wigner3jFamily w = wigner_3j_family(lb, lc, tb[q].m, tc[r].m);
              for (int la = w.first; la <= std::min(lb + lc, order_a - 1); ++la)
                sums[size_t(la)] += weight * w.values[size_t(la - w.first)];
            }
        for (int la = std::max(std::abs(ma), std::abs(lb - lc)); la <= std::min(lb + lc, order_a - 1); ++la) {
          if ((la + lb + lc) % 2) continue;
          const double norm = std::sqrt((2.0 * la + 1) * (2.0 * lb + 1) * (2.0 * lc + 1) / (4 * std::numbers::pi));
          const double value = norm * zeros.values[size_t(la - zeros.first)] * sums[size_t(la)];
          // A few more vanish by accident; what is left of them is rounding.
          if (std::abs(value) > 1e-12) entries.push_back({uint16_t(sh_index(la, ma)), uint16_t(j), value});
        }
      }
    }
    std::sort(entries.begin(), entries.end(),
              [](const Entry& x, const Entry& y) { return x.i != y.i ? x.i < y.i : x.j < y.j; });
    for (const Entry& e : entries) {
      t.i.push_back(e.i), t.j.push_back(e.j);
      t.value.push_back(e.value), t.single.push_back(float(e.value));
    }
    t.begin.push_back(uint32_t(t.value.size()));
  }
  return t;
}

double tripling_coefficient(int i, int j, int k) {
  LAMBENT_CHECK(i >= 0 && j >= 0 && k >= 0);
  const int la = sh_band(i), lb = sh_band(j), lc = sh_band(k);
  ComplexTerm ta[2], tb[2], tc[2];
  const int na = complex_terms(i - sh_index(la, 0), ta), nb = complex_terms(j - sh_index(lb, 0), tb);
  const int nc = complex_terms(k - sh_index(lc, 0), tc);
  double sum = 0;
  for (int p = 0; p < na; ++p)
    for (int q = 0; q < nb; ++q)
      for (int r = 0; r < nc; ++r)
        sum += (ta[p].weight * tb[q].weight * tc[r].weight).real() * wigner_3j(la, lb, lc, ta[p].m, tb[q].m, tc[r].m);
  return std::sqrt((2.0 * la + 1) * (2.0 * lb + 1) * (2.0 * lc + 1) / (4 * std::numbers::pi)) *
         wigner_3j(la, lb, lc, 0, 0, 0) * sum;
}

void multiply_sh_plain(const TriplingTensor& t, std::span<const double> a, std::span<const double> b,
                       std::span<double> out) {
  multiply_plain(t, t.value, a, b, out);
}
void multiply_sh_plain(const TriplingTensor& t, std::span<const float> a, std::span<const float> b,
                       std::span<float> out) {
  multiply_plain(t, t.single, a, b, out);
}

std::vector<double> sh_product_matrix(const TriplingTensor& t, std::span<const double> f) {
  LAMBENT_CHECK(t.order_a == t.order_b && f.size() == size_t(sh_count(t.order_c)));
  const size_t n = size_t(sh_count(t.order_a));
  std::vector<double> T(n * n);
  for (size_t k = 0; k < f.size(); ++k)
    for (uint32_t e = t.begin[k]; e < t.begin[k + 1]; ++e) T[t.i[e] * n + t.j[e]] += t.value[e] * f[k];
  return T;
}

std::vector<double> project_sh_pair(int order_in, int order_out, const std::function<double(Vec3d, Vec3d)>& T,
                                    int exact_order) {
  const size_t rows = size_t(sh_count(order_in)), columns = size_t(sh_count(order_out));
  const std::vector<DirectionNode> nodes = direction_quadrature(std::max({order_in, order_out, exact_order}));
  std::vector<double> in(nodes.size() * rows), inner(rows), y(columns), result(rows * columns);
  for (size_t s = 0; s < nodes.size(); ++s) {
    evaluate_sh(order_in, nodes[s].direction, std::span(in).subspan(s * rows, rows));
    for (size_t m = 0; m < rows; ++m) in[s * rows + m] *= nodes[s].weight;
  }
  for (const DirectionNode& wo : nodes) {
    std::fill(inner.begin(), inner.end(), 0.0);  // T_m(wo)
    for (size_t s = 0; s < nodes.size(); ++s) {
      const double value = T(nodes[s].direction, wo.direction);
      for (size_t m = 0; m < rows; ++m) inner[m] += value * in[s * rows + m];
    }
    evaluate_sh(order_out, wo.direction, y);
    for (size_t m = 0; m < rows; ++m)
      for (size_t n = 0; n < columns; ++n) result[m * columns + n] += inner[m] * y[n] * wo.weight;
  }
  return result;
}

}  // namespace lambent
