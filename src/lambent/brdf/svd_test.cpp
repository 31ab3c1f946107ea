#include <lambent/basis/sh.h>
#include <lambent/brdf/svd.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

const Brdf glossy = Ward{Vec3(0.2f, 0.1f, 0.05f), Vec3(0.5f, 0.6f, 0.7f), Vec2(0.3f, 0.5f)};

// Squared error of the sum of products against the BRDF itself, at the grid's directions: mean over wo, integral over wi.
double squared_error(const Brdf& brdf, const FactoredBrdf& factored) {
  const int n = factored.size, cells = n * n;
  double sum = 0;
  for (int o = 0; o < cells; ++o)
    for (int i = 0; i < cells; ++i) {
      const Vec3 wo = grid_direction(n, o % n, o / n), wi = grid_direction(n, i % n, i / n);
      Vec3 approximation(0);
      for (int r = 0; r < factored.terms; ++r) approximation += factored.g[size_t(r * cells + o)] * factored.h[size_t(r * cells + i)];
      const glm::dvec3 error(approximation - evaluate(brdf, wi, wo) * wi.z);
      sum += glm::dot(error, error) * std::numbers::pi / cells / double(wi.z) / cells;
    }
  return sum;
}

TEST(FactoriseBrdf, ErrorIsTheDiscardedSingularValues) {
  constexpr int n = 8, cells = n * n;
  double before = INFINITY;
  for (int terms : {1, 2, 4, 8, 16, 32, cells}) {
    const FactoredBrdf factored = factorise_brdf(glossy, terms, n);
    ASSERT_EQ(factored.singular_values.size(), size_t(cells));
    double discarded = 0, all = 0;
    for (size_t r = 0; r < size_t(cells); ++r) {
      const double s2 = std::pow(factored.singular_values[r], 2);
      all += s2, discarded += int(r) >= terms ? s2 : 0;
      if (r > 0) {
        EXPECT_LE(factored.singular_values[r], factored.singular_values[r - 1]);
      }
    }
    const double error = squared_error(glossy, factored);
    constexpr double float_rounding = 1e-12;  // factors are floats: 1e-7 of each entry, squared, with room
    EXPECT_NEAR(error, discarded, 1e-4 * discarded + float_rounding * all) << terms;
    EXPECT_LT(error, before);
    before = error;
  }
  EXPECT_LT(before, 1e-11);  // full rank reproduces
}

TEST(FactoriseBrdf, OneTermIsEnoughForLambert) {
  // f cos = albedo / pi cos: h = cos / |cos|, |cos|^2 = 2 pi / 3.
  const Vec3 albedo(0.8f, 0.5f, 0.1f);
  const FactoredBrdf factored = factorise_brdf(Lambert{albedo}, 1, 32);
  EXPECT_LT(factored.singular_values[1], 1e-6 * factored.singular_values[0]);
  std::vector<Vec3> g;
  const float norm = std::sqrt(2 * pi / 3), sign = factored.h[0] < 0 ? -1.0f : 1.0f;
  Random random(1);
  for (int i = 0; i < 300; ++i) {
    const Vec3 wo = square_to_cosine_hemisphere(random.next2()), wi = square_to_cosine_hemisphere(random.next2());
    evaluate_view_factors(factored, wo, g);
    ASSERT_EQ(g.size(), 1u);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(g[0][c] * sign, albedo[c] / pi * norm, 1e-3f);
    // Bilinear between centres h = 1/16 apart in the disk's radius r, where the cosine is z = sqrt(1 - r^2): h^2 / 8 of its second
    // derivative, at most 2 / z^3; a quarter of h of its slope r / z at the diagonals, where the map has a crease; and at the rim,
    // beyond the last centre, at most the cosine there, 0.25.
    const float z = wi.z, crease = std::sqrt(1 - z * z) / z / 64, curve = 1e-3f / (z * z * z);
    EXPECT_NEAR(evaluate_light_factor(factored, 0, wi) * sign, z / norm, (std::min(crease + curve, 0.25f) + 1e-3f) / norm);
  }
  // Its harmonics: those of the clamped cosine about +z.
  const std::vector<float> sh = project_light_factor(factored, 0, 6);
  for (int l = 0; l < 6; ++l)
    for (int m = -l; m <= l; ++m) {
      const double expected = m == 0 ? clamped_cosine(l) * std::sqrt((2 * l + 1) / (4 * std::numbers::pi)) / double(norm) : 0;
      EXPECT_NEAR(sh[size_t(sh_index(l, m))] * sign, expected, 2e-3) << l << " " << m;
    }
  evaluate_view_factors(factored, Vec3(0.6f, 0, -0.8f), g);
  EXPECT_EQ(g[0], Vec3(0));
  EXPECT_EQ(evaluate_light_factor(factored, 0, Vec3(0.6f, 0, -0.8f)), 0);
}

TEST(FactoriseBrdf, ReflectsAnEnvironmentOfFewBands) {
  // What the factors are for: sum_r g_r(wo) (h_r . light) against quadrature of f cos light, for an asymmetric light of order 4.
  constexpr int order = 4, terms = 24;
  Random random(2);
  std::vector<float> light;
  for (int i = 0; i < sh_count(order); ++i) light.push_back(random.next() - 0.5f);
  light[0] = 3;
  const FactoredBrdf factored = factorise_brdf(glossy, terms, 24);
  std::vector<float> rows;
  for (int r = 0; r < terms; ++r) {
    const std::vector<float> row = project_light_factor(factored, r, order);
    float sum = 0;
    for (size_t k = 0; k < row.size(); ++k) sum += row[k] * light[k];
    rows.push_back(sum);
  }
  std::vector<Vec3> g;
  for (Vec3 wo : {Vec3(0, 0, 1), glm::normalize(Vec3(0.5f, -0.3f, 0.7f)), glm::normalize(Vec3(-0.2f, 0.8f, 0.5f))}) {
    evaluate_view_factors(factored, wo, g);
    Vec3 result(0);
    for (size_t r = 0; r < size_t(terms); ++r) result += g[r] * rows[r];
    glm::dvec3 expected(0);
    constexpr int steps = 200;
    for (int i = 0; i < steps; ++i)
      for (int j = 0; j < steps; ++j) {
        const Vec3 wi = square_to_cosine_hemisphere({(float(i) + 0.5f) / steps, (float(j) + 0.5f) / steps});
        expected += glm::dvec3(evaluate(glossy, wi, wo) * reconstruct_sh(light, wi)) * (std::numbers::pi / (steps * steps));
      }
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(result[c], expected[c], 0.01 * std::abs(expected[c])) << wo.z;  // grids of 24 x 24
  }
}

}  // namespace
}  // namespace lambent
