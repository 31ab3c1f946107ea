#include <lambent/basis/quadrature.h>
#include <lambent/basis/sh_product.h>
#include <lambent/core/random.h>

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "sanitizers.h"

namespace lambent {
namespace {

// Double rounding of Wigner symbols against that of sums over some hundred nodes.
constexpr double coefficient_tolerance = 1e-10;
// Rounding of float sums, as a fraction of |a| |b|.
constexpr double float_rounding = 2e-7;

template <class T>
std::vector<T> random_coefficients(int order, uint64_t seed) {
  Random random(seed);
  std::vector<T> c(size_t(sh_count(order)));
  for (T& x : c) x = T(2 * random.next() - 1);
  return c;
}

double value_at(std::span<const double> c, Vec3d d) {
  std::vector<double> y(c.size());
  evaluate_sh(sh_order(c.size()), d, y);
  double sum = 0;
  for (size_t i = 0; i < c.size(); ++i) sum += c[i] * y[i];
  return sum;
}

double length(std::span<const float> c) {
  double sum = 0;
  for (float x : c) sum += double(x) * x;
  return std::sqrt(sum);
}

// Weight-free values of the harmonics at nodes where products of three functions of these orders are integrated
// exactly.
struct Sampled {
  std::vector<DirectionNode> nodes;
  std::vector<double> y;
  size_t count;
  Sampled(int order, int exact_order) : nodes(direction_quadrature(exact_order)), count(size_t(sh_count(order))) {
    y.resize(nodes.size() * count);
    for (size_t s = 0; s < nodes.size(); ++s)
      evaluate_sh(order, nodes[s].direction, std::span(y).subspan(s * count, count));
  }
  double triple(size_t i, size_t j, size_t k) const {
    double sum = 0;
    for (size_t s = 0; s < nodes.size(); ++s)
      sum += nodes[s].weight * y[s * count + i] * y[s * count + j] * y[s * count + k];
    return sum;
  }
};

TEST(ShProduct, TensorIsTheIntegralOfThreeHarmonics) {
  const TriplingTensor t = make_tripling_tensor(3, 4, 5);
  const Sampled sampled(5, 7);
  for (size_t k = 0; k < 25; ++k) {
    std::vector<double> dense(9 * 16);
    for (uint32_t e = t.begin[k]; e < t.begin[k + 1]; ++e) dense[t.i[e] * 16u + t.j[e]] = t.value[e];
    for (size_t i = 0; i < 9; ++i)
      for (size_t j = 0; j < 16; ++j) {
        EXPECT_NEAR(dense[i * 16 + j], sampled.triple(i, j, k), coefficient_tolerance) << i << " " << j << " " << k;
        EXPECT_NEAR(tripling_coefficient(int(i), int(j), int(k)), dense[i * 16 + j], coefficient_tolerance)
            << i << " " << j << " " << k;
      }
  }
}

TEST(ShProduct, TensorIsRightAtOrderTwelve) {
  const TriplingTensor t = make_tripling_tensor(12, 12, 12);
  const Sampled sampled(12, 18);
  Random random(2);
  int negative = 0;
  for (size_t e = 0; e < t.value.size(); e += 1 + size_t(500 * random.next())) {
    const size_t k = size_t(std::upper_bound(t.begin.begin(), t.begin.end(), uint32_t(e)) - t.begin.begin()) - 1;
    EXPECT_NEAR(t.value[e], sampled.triple(t.i[e], t.j[e], k), coefficient_tolerance)
        << t.i[e] << " " << t.j[e] << " " << k;
    negative += int(t.i[e]) < sh_index(sh_band(t.i[e]), 0);
  }
  EXPECT_GT(negative, 50);
  // Nothing is left out: the sum of all C^2 is the integral of a product of three kernels.
  double squares = 0, exact = 0;
  for (double c : t.value) squares += c * c;
  // sum over i of y_i(d) y_i(e) = K(d.e), so the sum of C^2 is the double integral of K^3 = 8 pi^2 int K(z)^3 dz.
  for (auto [z, w] : gauss_legendre(24)) {
    double y[sh_count(12)], kernel = 0;
    evaluate_sh(12, Vec3d(std::sqrt(1 - z * z), 0, z), y);
    for (int l = 0; l < 12; ++l) kernel += std::sqrt((2 * l + 1) / (4 * std::numbers::pi)) * y[sh_index(l, 0)];
    exact += 8 * std::numbers::pi * std::numbers::pi * w * kernel * kernel * kernel;
  }
  EXPECT_NEAR(squares / exact, 1, coefficient_tolerance);
}

TEST(ShProduct, IsExactWithAllItsBandsAndProjectsWithFewer) {
  const int orders[][2] = {{1, 4}, {3, 3}, {5, 3}, {6, 6}};
  for (auto [na, nb] : orders) {
    const int full = na + nb - 1;
    const auto a = random_coefficients<double>(na, 1), b = random_coefficients<double>(nb, 2);
    std::vector<double> product(size_t(sh_count(full)));
    multiply_sh_plain(make_tripling_tensor(na, nb, full), a, b, product);
    Random random(9);
    for (int i = 0; i < 20; ++i) {
      const Vec3d d = normalize(Vec3d(random.next() - 0.4, 0.7 - random.next(), random.next() - 0.5));
      EXPECT_NEAR(value_at(product, d), value_at(a, d) * value_at(b, d), coefficient_tolerance) << na << " " << nb;
    }
    std::vector<double> fewer(size_t(sh_count(full - 1)));
    multiply_sh_plain(make_tripling_tensor(na, nb, full - 1), a, b, fewer);
    for (size_t k = 0; k < fewer.size(); ++k) EXPECT_NEAR(fewer[k], product[k], coefficient_tolerance);
  }
}

TEST(ShProduct, FastAgreesWithPlainForAllOrders) {
  SKIP_UNDER_SANITIZERS();
  auto check = [](int na, int nb, int nc) {
    const auto a = random_coefficients<float>(na, 3), b = random_coefficients<float>(nb, 4);
    const std::vector<double> da(a.begin(), a.end()), db(b.begin(), b.end());
    std::vector<float> fast(size_t(sh_count(nc)));
    std::vector<double> plain(fast.size());
    multiply_sh(a, b, fast);
    multiply_sh_plain(make_tripling_tensor(na, nb, nc), da, db, plain);
    const double tolerance = float_rounding * length(a) * length(b);
    for (size_t k = 0; k < fast.size(); ++k)
      ASSERT_NEAR(fast[k], plain[k], tolerance) << na << " " << nb << " " << nc << " coefficient " << k;
  };
  for (int na = 1; na <= 6; ++na)
    for (int nb = 1; nb <= 6; ++nb)
      for (int nc = 1; nc <= 6; ++nc) check(na, nb, nc);
  for (int n = 7; n <= 12; ++n) check(n, n, n);
  check(6, 11, 6), check(2, 16, 9), check(12, 5, 16), check(8, 8, 15), check(16, 16, 16);
}

TEST(ShProduct, FastWorksInPlaceOnEverySimdTarget) {
  for (int n : {2, 3, 4, 5, 6, 7, 8, 11}) {
    const auto a = random_coefficients<float>(n, 5), b = random_coefficients<float>(n, 6);
    const double tolerance = float_rounding * length(a) * length(b);
    std::vector<float> plain(a.size());
    multiply_sh_plain(make_tripling_tensor(n, n, n), a, b, plain);
    for (int64_t target : hwy::SupportedAndGeneratedTargets()) {
      hwy::SetSupportedTargetsForTest(target);
      std::vector<float> product = a;
      multiply_sh(product, b, product);
      hwy::SetSupportedTargetsForTest(0);
      for (size_t k = 0; k < plain.size(); ++k)
        EXPECT_NEAR(product[k], plain[k], tolerance) << hwy::TargetName(target) << " " << n << " " << k;
    }
  }
}

// A visibility with sharp edges and no symmetry. Sums over the nodes stand for integrals throughout, so that what
// follows holds to rounding: y_i y_j is a sum of the first 2n - 1 bands at each node.
double visibility(Vec3d d) { return d.z > 0.2 * d.x && (d.y < 0.4 || d.x > 0.3) ? 1 : 0; }

TEST(ShProduct, MatrixIsExactWithTwiceTheBands) {
  const int n = 4, nodes = 24;
  const size_t count = size_t(sh_count(n));
  std::vector<double> exact(count * count), y(count);
  for (const DirectionNode& s : direction_quadrature(nodes)) {
    evaluate_sh(n, s.direction, y);
    for (size_t i = 0; i < count; ++i)
      for (size_t j = 0; j < count; ++j) exact[i * count + j] += s.weight * visibility(s.direction) * y[i] * y[j];
  }
  auto worst = [&](int order) {
    std::vector<double> v(size_t(sh_count(order))), all(v.size());
    for (const DirectionNode& s : direction_quadrature(nodes)) {
      evaluate_sh(order, s.direction, all);
      for (size_t k = 0; k < v.size(); ++k) v[k] += s.weight * visibility(s.direction) * all[k];
    }
    const std::vector<double> T = sh_product_matrix(make_tripling_tensor(n, n, order), v);
    double error = 0;
    for (size_t i = 0; i < count; ++i)
      for (size_t j = 0; j < count; ++j) {
        error = std::max(error, std::abs(T[i * count + j] - exact[i * count + j]));
        EXPECT_NEAR(T[i * count + j], T[j * count + i], coefficient_tolerance);
      }
    return error;
  };
  EXPECT_LT(worst(2 * n - 1), coefficient_tolerance);
  EXPECT_LT(worst(2 * n + 2), coefficient_tolerance) << "more bands change nothing";
  EXPECT_GT(worst(2 * n - 2), 1e-3);
  EXPECT_GT(worst(n), 1e-2);
}

// Light of order n, reflectance of order o: the triple product needs the visibility to order n + o, and no more.
TEST(ShProduct, TripleProductNeedsVisibilityOfTheSumOfOrders) {
  const int n = 4, o = 3, nodes = 24;
  const auto light = random_coefficients<double>(n, 7), brdf = random_coefficients<double>(o, 8);
  double exact = 0;
  for (const DirectionNode& s : direction_quadrature(nodes))
    exact += s.weight * value_at(light, s.direction) * visibility(s.direction) * value_at(brdf, s.direction);
  auto error = [&](int order) {
    std::vector<double> v(size_t(sh_count(order))), all(v.size()), product(size_t(sh_count(o)));
    for (const DirectionNode& s : direction_quadrature(nodes)) {
      evaluate_sh(order, s.direction, all);
      for (size_t k = 0; k < v.size(); ++k) v[k] += s.weight * visibility(s.direction) * all[k];
    }
    multiply_sh_plain(make_tripling_tensor(n, order, o), light, v, product);
    double sum = 0;
    for (size_t k = 0; k < product.size(); ++k) sum += product[k] * brdf[k];
    return std::abs(sum - exact);
  };
  EXPECT_LT(error(n + o), coefficient_tolerance);
  EXPECT_GT(error(n + o - 2), 1e-4);
  EXPECT_GT(error(n), 1e-4);
}

TEST(ShProduct, MatrixMultipliesAsTheTensorDoes) {
  const int n = 5;
  const auto f = random_coefficients<double>(6, 1), g = random_coefficients<double>(n, 2);
  const std::vector<double> T = sh_product_matrix(make_tripling_tensor(n, n, 6), f);
  std::vector<double> product(g.size());
  multiply_sh_plain(make_tripling_tensor(6, n, n), f, g, product);
  for (size_t i = 0; i < g.size(); ++i) {
    double sum = 0;
    for (size_t j = 0; j < g.size(); ++j) sum += T[i * g.size() + j] * g[j];
    EXPECT_NEAR(sum, product[i], coefficient_tolerance);
  }
}

TEST(ShProduct, DoubleProjectionFindsTheMatrixOfABandLimitedFunction) {
  const int in = 3, out = 4;
  std::vector<double> M(9 * 16);
  for (size_t i = 0; i < M.size(); ++i) M[i] = std::sin(double(i * i + 1));
  auto T = [&](Vec3d wi, Vec3d wo) {
    double yi[9], yo[16], sum = 0;
    evaluate_sh(in, wi, yi), evaluate_sh(out, wo, yo);
    for (size_t m = 0; m < 9; ++m)
      for (size_t n = 0; n < 16; ++n) sum += M[m * 16 + n] * yi[m] * yo[n];
    return sum;
  };
  const std::vector<double> again = project_sh_pair(in, out, T, 5);
  for (size_t i = 0; i < M.size(); ++i) EXPECT_NEAR(again[i], M[i], coefficient_tolerance) << i;
  // A function of the angle between the two directions is diagonal with one value a band (Funk-Hecke): 3/4 + z^2/4
  // here.
  auto zonal_T = [](Vec3d a, Vec3d b) { return 0.75 + 0.25 * dot(a, b) * dot(a, b); };
  const std::vector<double> zonal = project_sh_pair(3, 3, zonal_T, 5);
  const double band[3] = {10 * std::numbers::pi / 3, 0, 2 * std::numbers::pi / 15};
  for (int m = 0; m < 9; ++m)
    for (int n = 0; n < 9; ++n)
      EXPECT_NEAR(zonal[size_t(m * 9 + n)], m == n ? band[sh_band(m)] : 0, coefficient_tolerance) << m << " " << n;
}

}  // namespace
}  // namespace lambent
