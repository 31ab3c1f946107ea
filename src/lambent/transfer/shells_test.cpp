#include <lambent/core/sampling.h>
#include <lambent/transfer/shells.h>

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

namespace lambent {
namespace {

Shells some_shells() { return {Vec3(1, 2, 3), 0.5f, {0.25f, 0.5f, 1, 4}, 9}; }

std::vector<float> logarithms(const Shells& s) {
  std::vector<float> out;
  for (float r : s.radii) out.push_back(std::log2(r));
  return out;
}

TEST(Shells, TheFoldedSquareIsTheSphere) {
  for (uint32_t i = 0; i < 500; ++i) {
    const Vec3 d = square_to_sphere(sobol_owen(i, 5));
    const Vec2 p = fold_octahedron(3.0f * d);
    EXPECT_LE(std::max(std::abs(p.x), std::abs(p.y)), 1.000001f);
    EXPECT_LT(length(unfold_octahedron(p) - d), 1e-5f);
  }
}

TEST(Shells, APointHasItsOwnValueAlone) {
  const Shells s = some_shells();
  const std::vector<float> logs = logarithms(s);
  for (size_t point = 0; point < s.count(); ++point) {
    const Vec3 from = shell_point(s, point) - s.center;
    const ShellMix mix = mix_shells(s, logs, from);
    float there = 0;
    for (size_t m = 0; m < mix.points.size(); ++m)
      if (length(shell_point(s, mix.points[m]) - s.center - from) < 1e-4f) there += mix.weights[m];
    EXPECT_NEAR(there, 1, 2e-4f) << point;
  }
}

TEST(Shells, ValuesHoldWithinAndShrinkWithTheSquareBeyond) {
  const Shells s = some_shells();
  const std::vector<float> logs = logarithms(s);
  for (uint32_t i = 0; i < 200; ++i)
    for (float distance : {0.0f, 0.1f, 0.3f, 0.9f, 3.9f, 4.0f, 8.0f}) {
      const ShellMix mix = mix_shells(s, logs, distance * square_to_sphere(sobol_owen(i, 1)));
      for (uint32_t p : mix.points) EXPECT_LT(p, s.count());
      // Of a value that is the square of the nearer shell's share of the distance, as a solid angle is far away.
      float sum = 0;
      for (size_t m = 0; m < mix.points.size(); ++m) {
        const float r = s.radii[mix.points[m] / 81];
        sum += mix.fade * mix.weights[m] * (distance < 0.5f ? 1 : 1 / (r * r));
      }
      EXPECT_NEAR(sum, distance < 0.5f ? 1 : 1 / (distance * distance), 1e-4f) << distance;
    }
}

TEST(Shells, OnesThatDoNotRiseAreRefused) {
  Shells s = some_shells();
  EXPECT_TRUE(is_consistent(s));
  s.radii[2] = s.radii[1];
  EXPECT_FALSE(is_consistent(s));
  s = some_shells(), s.side = 1;
  EXPECT_FALSE(is_consistent(s));
  s = some_shells(), s.radii.back() = NAN;
  EXPECT_FALSE(is_consistent(s));
}

}  // namespace
}  // namespace lambent
