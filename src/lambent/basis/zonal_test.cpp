#include <lambent/basis/quadrature.h>
#include <lambent/basis/zonal.h>
#include <lambent/core/random.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

const Mat3 skew = rotation_from_yaw_pitch_roll({37, -52, 113});

Vec3 random_axis(Random& random) {
  Vec3 v;
  do v = 2.0f * Vec3(random.next(), random.next(), random.next()) - 1.0f;
  while (dot(v, v) > 1 || dot(v, v) < 0.01f);
  return normalize(v);
}

ZonalSum random_sum(int order, int lobes, uint64_t key) {
  Random random(key);
  ZonalSum sum{order, {}, {}};
  for (int i = 0; i < lobes; ++i) sum.axes.push_back(random_axis(random));
  for (int i = 0; i < lobes * order; ++i) sum.coefficients.push_back(2 * random.next() - 1);
  return sum;
}

// One-sided and with all bands.
double bump(double z) { return z > 0.2 ? (z - 0.2) * std::exp(z) : 0.1 * z; }

TEST(Zonal, ProjectsToTheHarmonicsAboutThePole) {
  auto smooth = [](double z) { return std::exp(1.3 * z) + z * z * z; };
  std::vector<double> g = project_zonal(8, smooth);
  const std::vector<double> sh = project_sh(8, [&](Vec3d d) { return smooth(d.z); });
  lobe_to_zonal(g);
  for (int l = 0; l < 8; ++l) EXPECT_NEAR(g[size_t(l)], sh[size_t(sh_index(l, 0))], 1e-12) << l;
}

TEST(Zonal, ScalesThereAndBack) {
  std::vector<double> g{1, -2, 3, 4};
  zonal_to_lobe(g);
  EXPECT_NEAR(g[0], std::sqrt(4 * std::numbers::pi), 1e-14);
  EXPECT_NEAR(g[2], 3 * std::sqrt(4 * std::numbers::pi / 5), 1e-14);
  lobe_to_zonal(g);
  EXPECT_NEAR(g[1], -2, 1e-14);
  EXPECT_NEAR(g[3], 4, 1e-14);
}

TEST(Zonal, HasTheHarmonicsOfItsValues) {
  const ZonalSum sum = random_sum(6, 3, 1);
  const std::vector<double> projected = project_sh(
      6, [&](Vec3d d) { return evaluate_zonal(sum, d); }, 8);
  const std::vector<float> sh = zonal_to_sh(sum);
  for (size_t k = 0; k < sh.size(); ++k)
    EXPECT_NEAR(sh[k], projected[k], 2e-6) << k;  // float rounding of values up to 3
}

TEST(Zonal, RotatesAsTheHarmonicsItStandsFor) {
  for (int order : {1, 2, 6, 12}) {
    const ZonalSum sum = random_sum(order, 4, uint64_t(order));
    std::vector<float> turned(size_t(sh_count(order)), 0.0f);
    rotate_sh(make_sh_rotation(order, skew), zonal_to_sh(sum), turned);
    const std::vector<float> ours = zonal_to_sh(rotate_zonal(sum, skew));
    double norm = 0, error = 0;
    for (size_t k = 0; k < ours.size(); ++k) {
      norm += double(turned[k]) * turned[k];
      error = std::max(error, std::abs(double(ours[k]) - turned[k]));
    }
    EXPECT_LT(error, 1e-6 * std::max(1.0, std::sqrt(norm))) << order;
    // And as the function does.
    const Vec3d d = normalize(Vec3d(0.3, -0.8, 0.4));
    EXPECT_NEAR(evaluate_zonal(rotate_zonal(sum, skew), Mat3d(skew) * d), evaluate_zonal(sum, d), 1e-5);
  }
}

TEST(Zonal, ConvolvesAsTheIntegralDoes) {
  // (f * g)(s) is the integral of f times g turned to s (eq. 3 and 5).
  const int order = 6;
  const double kink = 0.2;
  const std::vector<double> lobe = project_zonal(order, bump, {&kink, 1});
  const std::vector<float> g(lobe.begin(), lobe.end());
  std::vector<float> f(size_t(sh_count(order))), out(f.size());
  Random random(5);
  for (float& c : f) c = 2 * random.next() - 1;
  convolve_sh(g, f, out);
  for (int i = 0; i < 5; ++i) {
    const Vec3 s = random_axis(random);
    double integral = 0;
    for (const DirectionNode& node : direction_quadrature(order))
      integral += node.weight * reconstruct_sh(f, Vec3(node.direction)) *
                  evaluate_lobe(lobe, dot(Vec3d(s), node.direction));
    EXPECT_NEAR(reconstruct_sh(out, s), integral, 2e-5);
  }
}

TEST(Zonal, NegatedAxesAndOddBandsAreTheSameLobe) {
  ZonalSum sum = random_sum(7, 1, 9);
  const std::vector<float> before = zonal_to_sh(sum);
  sum.axes[0] = -sum.axes[0];
  for (size_t l = 1; l < 7; l += 2) sum.coefficients[l] = -sum.coefficients[l];
  const std::vector<float> after = zonal_to_sh(sum);
  for (size_t k = 0; k < before.size(); ++k) EXPECT_NEAR(before[k], after[k], 1e-6);
}

TEST(Zonal, ClosestLobeIsALeastSquaresFit) {
  Random random(3);
  std::vector<float> f(36);
  for (float& c : f) c = 2 * random.next() - 1;
  const Vec3 axis = random_axis(random);
  auto error = [&](const std::vector<float>& g) {
    const std::vector<float> fit = zonal_to_sh({6, {axis}, g});
    double sum = 0;
    for (size_t k = 0; k < fit.size(); ++k) sum += (double(fit[k]) - f[k]) * (double(fit[k]) - f[k]);
    return sum;
  };
  const std::vector<float> best = closest_lobe(f, axis);
  // A parabola in each coefficient: equal errors to both sides of its minimum.
  for (size_t l = 0; l < 6; ++l) {
    std::vector<float> more = best, less = best;
    more[l] += 0.125f, less[l] -= 0.125f;
    EXPECT_NEAR(error(more), error(less), 2e-5);
    EXPECT_GT(error(more), error(best));
  }
  // A function that is a lobe is found exactly.
  const std::vector<float> own = closest_lobe(zonal_to_sh({6, {axis}, {1, -2, 3, -4, 5, 6}}), axis);
  for (size_t l = 0; l < 6; ++l) EXPECT_NEAR(own[l], (std::vector<float>{1, -2, 3, -4, 5, 6})[l], 1e-5);
}

TEST(Zonal, LinearAxisIsWhereTheLinearBandPeaks) {
  std::vector<float> f{0.3f, -0.7f, 0.2f, 0.5f};
  const Vec3 axis = linear_axis(f);
  std::vector<float> linear = f;
  linear[0] = 0;
  const float peak = reconstruct_sh(linear, axis);
  Random random(8);
  for (int i = 0; i < 1000; ++i) EXPECT_LE(reconstruct_sh(linear, random_axis(random)), peak + 1e-6f);
  EXPECT_EQ(linear_axis(std::vector<float>(9, 0.0f)), Vec3(0, 0, 1));
}

TEST(Zonal, MembraneIsWhatEquation22Projects) {
  const double kink = 0;
  for (double alpha : {0.0, 0.37, 1.0}) {
    const std::vector<double> numeric =
        project_zonal(12, [&](double z) { return (z >= 0 ? z : -alpha * z) / std::numbers::pi; }, {&kink, 1});
    const std::vector<double> closed = membrane_lobe(12, alpha);
    for (size_t l = 0; l < 12; ++l) {
      EXPECT_NEAR(closed[l], numeric[l], 1e-12) << l;
      // Equation 23 as printed; it has no slip: the division by pi that the text adds is already in it.
      double factorial = 1, power = 1, half = 1;  // l!, 2^l, (l/2)!
      for (size_t k = 1; k <= l; ++k) factorial *= double(k), power *= 2;
      for (size_t k = 1; k <= l / 2; ++k) half *= double(k);
      const double L = double(l), sign = (l / 2) % 2 ? 1 : -1;  // (-1)^(l/2 - 1)
      const double printed = l == 1 ? 2.0 / 3 * (1 - alpha)
                           : l % 2  ? 0.0
                                    : 2 * (1 + alpha) * sign / ((L + 2) * (L - 1)) * factorial / (power * half * half);
      EXPECT_NEAR(printed, numeric[l], 1e-12) << l;
    }
  }
}

}  // namespace
}  // namespace lambent
