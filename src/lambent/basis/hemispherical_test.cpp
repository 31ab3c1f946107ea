#include <lambent/basis/hemispherical.h>
#include <lambent/basis/quadrature.h>
#include <lambent/core/random.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// Double rounding over quadratures of some thousand nodes.
constexpr double double_rounding = 1e-11;
// Float rounding over 36 terms.
constexpr double float_rounding = 2e-5;

// Smooth, without symmetry, and far from zero at the horizon.
double asymmetric(Vec3d d) { return 1.2 + std::exp(2 * dot(d, normalize(Vec3d(0.8, -0.3, 0.4)))) - 0.5 * d.y; }

double value(std::span<const double> c, Vec3d d, bool hemispherical) {
  std::vector<double> y(c.size());
  const int order = sh_order(c.size());
  hemispherical ? evaluate_hsh(order, d, y) : evaluate_sh(order, d, y);
  double sum = 0;
  for (size_t i = 0; i < c.size(); ++i) sum += c[i] * y[i];
  return sum;
}

// Root mean square over the hemisphere of the error of a reconstruction.
double error(std::span<const double> c, const std::function<double(Vec3d)>& f, bool hemispherical) {
  double sum = 0;
  for (const DirectionNode& node : direction_quadrature(40, 0, 1)) {
    const double e = value(c, node.direction, hemispherical) - f(node.direction);
    sum += node.weight * e * e;
  }
  return std::sqrt(sum / (2 * std::numbers::pi));
}

TEST(Hemispherical, HarmonicsAreOrthonormalOnTheHemisphere) {
  const int order = 12;
  const size_t n = size_t(sh_count(order));
  std::vector<double> gram(n * n), y(n);
  for (const DirectionNode& node : direction_quadrature(2 * order, 0, 1)) {
    evaluate_hsh(order, node.direction, y);
    for (size_t i = 0; i < n; ++i)
      for (size_t j = 0; j < n; ++j) gram[i * n + j] += node.weight * y[i] * y[j];
  }
  for (size_t i = 0; i < n; ++i)
    for (size_t j = 0; j < n; ++j) EXPECT_NEAR(gram[i * n + j], i == j ? 1 : 0, double_rounding) << i << " " << j;
}

TEST(Hemispherical, LowHarmonicsAreTheKnownFunctions) {
  const Vec3d d = normalize(Vec3d(0.4, -0.7, 0.5));
  double y[4];
  evaluate_hsh(2, d, y);
  const double pi = std::numbers::pi, phi = std::atan2(d.y, d.x), r = std::sqrt(d.z * (1 - d.z));
  EXPECT_NEAR(y[0], 1 / std::sqrt(2 * pi), 1e-14);
  EXPECT_NEAR(y[1], -std::sqrt(6 / pi) * r * std::sin(phi), 1e-14);
  EXPECT_NEAR(y[2], std::sqrt(3 / (2 * pi)) * (2 * d.z - 1), 1e-14);
  EXPECT_NEAR(y[3], -std::sqrt(6 / pi) * r * std::cos(phi), 1e-14);
  evaluate_hsh(2, Vec3d(d.x, d.y, -d.z), y);
  for (double v : y) EXPECT_EQ(v, 0) << "below the horizon";
}

TEST(Hemispherical, HarmonicsReproduceTheirSpan) {
  const int order = 6;
  Random random(4);
  std::vector<double> c(36);
  for (double& x : c) x = 2 * random.next() - 1;
  const auto again = project_hsh(
      order, [&](Vec3d d) { return value(c, d, true); }, 2 * order);
  std::vector<float> single(again.begin(), again.end());
  for (size_t i = 0; i < c.size(); ++i) EXPECT_NEAR(again[i], c[i], double_rounding) << i;
  const Vec3 d = normalize(Vec3(-0.2f, 0.5f, 0.9f));
  EXPECT_NEAR(reconstruct_hsh(single, d), value(c, d, true), float_rounding);
  EXPECT_EQ(reconstruct_hsh(single, -d), 0);
}

TEST(Hemispherical, HarmonicsConvergeToAFunctionThatIsZeroAtTheHorizon) {
  auto f = [](Vec3d d) { return d.z * std::exp(d.x - 0.5 * d.y); };
  double before = 1;
  for (int order : {2, 4, 8}) {
    const double e = error(project_hsh(order, f), f, true);
    EXPECT_LT(e, 0.5 * before) << order;
    before = e;
  }
}

TEST(Hemispherical, GramMatrixHasItsKnownEntries) {
  const HemisphereFit fit = make_hemisphere_fit(4);
  auto G = [&](int i, int j) { return fit.gram[size_t(i * 16 + j)]; };
  for (int i = 0; i < 16; ++i)
    for (int j = 0; j < 16; ++j) {
      if (i == j) {
        EXPECT_NEAR(G(i, j), 0.5, double_rounding) << "half of an even square";
      } else if ((sh_band(i) + sh_band(j)) % 2 == 0) {
        EXPECT_NEAR(G(i, j), 0, double_rounding) << "half of zero";
      }
    }
  EXPECT_NEAR(G(0, 2), std::sqrt(3.0) / 4, double_rounding);  // 2 pi y_00 sqrt(3/4pi) / 2
}

TEST(Hemispherical, LeastSquaresReproducesBandLimitedFunctions) {
  const int order = 5;
  Random random(8);
  std::vector<double> c(25);
  for (double& x : c) x = 2 * random.next() - 1;
  const auto f = [&](Vec3d d) { return value(c, d, false); };
  const HemisphereFit exact = make_hemisphere_fit(order, 1e-13);
  EXPECT_EQ(exact.rank, 25);
  const auto again = project_hemisphere(exact, f, 2 * order);
  EXPECT_LT(error(again, f, false), 1e-8);
  // With the cutoff that keeps coefficients small, what is left out has at most the square root of it.
  const double cutoff = 1e-6;
  const HemisphereFit regular = make_hemisphere_fit(order, cutoff);
  EXPECT_LT(error(project_hemisphere(regular, f, 2 * order), f, false), std::sqrt(cutoff * 25));
}

TEST(Hemispherical, LeastSquaresBeatsExtendingByZero) {
  for (int order : {3, 4, 6}) {
    const HemisphereFit fit = make_hemisphere_fit(order);
    const auto integrals = project_sh_hemisphere(order, asymmetric);
    const auto best = fit_hemisphere(fit, integrals);
    EXPECT_LT(error(best, asymmetric, false), 0.25 * error(integrals, asymmetric, false)) << order;
    // It is the optimum: no step along any coefficient improves it.
    const double least = error(best, asymmetric, false);
    for (size_t i = 0; i < best.size(); ++i)
      for (double step : {-1e-2, 1e-2}) {
        auto other = best;
        other[i] += step;
        EXPECT_GT(error(other, asymmetric, false), least);
      }
  }
}

}  // namespace
}  // namespace lambent
