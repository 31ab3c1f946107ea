#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/receivers/atlas.h>
#include <lambent/receivers/project.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace lambent {
namespace {

double linear(Vec3 p) { return 0.3 + 1.5 * double(p.x) - 0.7 * double(p.y) + 0.4 * double(p.z); }

Scene slanted_quad() { return make_quad(Vec3(0.2f, 0.1f, 0), Vec3(1, 0.3f, 0), Vec3(0.1f, 0.2f, 1), 3, 4, Vec3(0.5f)); }

// Integrals of B_i, B_i f and B_i B_j over all sides, by cells of each triangle.
struct Integrals {
  std::vector<double> of_one, of_f;
  std::map<std::pair<uint32_t, uint32_t>, double> products;
};
Integrals integrate(const Scene& scene, const Receivers& r, int cells, double (*f)(Vec3)) {
  Integrals out{std::vector<double>(r.count()), std::vector<double>(r.count()), {}};
  std::visit(
      [&](const auto& basis) {
        for (uint32_t t = 0; t < scene.triangles.size(); ++t) {
          const auto* at = basis.find(t, true);
          const double each = 0.5 * double(area_length(area_normal(scene, scene.triangles[t]))) / (cells * cells);
          for (int a = 0; at && a < cells; ++a)
            for (int b = 0; a + b < cells; ++b)
              for (int upper = 0; upper <= (a + b + 1 < cells); ++upper) {
                const float third = float(1 + upper) / 3;
                const float u = (float(a) + third) / float(cells), v = (float(b) + third) / float(cells);
                std::vector<std::pair<uint32_t, double>> met;
                basis.spread(*at, u, v, [&](uint32_t i, float w) { met.emplace_back(i, double(w)); });
                const double value = f(interpolate(scene.positions, scene.triangles[t], u, v));
                for (const auto& [i, w] : met) {
                  out.of_one[i] += each * w, out.of_f[i] += each * w * value;
                  for (const auto& [j, other] : met) out.products[{i, j}] += each * w * other;
                }
              }
        }
      },
      r.basis);
  return out;
}

double weight_of(const MassMatrix& m, uint32_t row, uint32_t column) {
  for (size_t e = m.first[row]; e < m.first[row + 1]; ++e)
    if (m.columns[e] == column) return double(m.weights[e]);
  return 0;
}

TEST(Projection, MassMatricesAreTheirQuadrature) {
  Scene scene = slanted_quad();
  auto atlas = make_atlas(scene, {.texels_per_unit = 7.7f});
  ASSERT_TRUE(atlas);
  const Receivers all[] = {make_vertex_receivers(scene), make_patch_receivers(scene),
                           make_texel_receivers(scene, *atlas)};
  for (const Receivers& r : all) {
    const bool exact = !std::holds_alternative<TexelReceivers>(r.basis);
    const Integrals by_cells = integrate(scene, r, 96, linear);
    const MassMatrix m = make_least_squares(scene, r, 4, 1).mass;
    ASSERT_EQ(m.first.size(), r.count() + 1);
    EXPECT_EQ(m.is_diagonal(), std::holds_alternative<PatchReceivers>(r.basis));
    for (uint32_t i = 0; i < r.count(); ++i) {
      double sum = 0;
      for (size_t e = m.first[i]; e < m.first[i + 1]; ++e) sum += double(m.weights[e]);
      EXPECT_NEAR(sum, 1, 1e-6);
      // A texel that has not most of its tent on the surface stays where it is.
      const bool partial = !exact && by_cells.of_one[i] < 0.72 / (7.7 * 7.7);
      if (partial) {
        EXPECT_TRUE(by_cells.of_one[i] > 0.68 / (7.7 * 7.7) || m.first[i + 1] == m.first[i] + 1);
        continue;
      }
      for (size_t e = m.first[i]; e < m.first[i + 1]; ++e)
        EXPECT_NEAR(double(m.weights[e]), by_cells.products.at({i, m.columns[e]}) / by_cells.of_one[i],
                    exact ? 2e-4 : 0.03);
    }
    // Symmetric, times the functions' integrals.
    for (const auto& [pair, product] : by_cells.products)
      if (exact || by_cells.of_one[pair.first] > 0.72 / (7.7 * 7.7))
        EXPECT_NEAR(weight_of(m, pair.first, pair.second) * by_cells.of_one[pair.first], product,
                    (exact ? 5e-4 : 0.04) * by_cells.of_one[pair.first] + 1e-6);
  }
}

TEST(Projection, HatsKeepLinearFunctionsAndBoxesTakeMeans) {
  Scene scene = slanted_quad();
  const Receivers hats = make_vertex_receivers(scene), boxes = make_patch_receivers(scene);
  for (const Receivers* r : {&hats, &boxes}) {
    const Integrals by_cells = integrate(scene, *r, 96, linear);
    const LeastSquares least = make_least_squares(scene, *r, 1, 1);
    // Two columns of a wider row: the function, and a constant.
    std::vector<float> x(3 * r->count(), 7.0f);
    for (size_t i = 0; i < r->count(); ++i)
      x[3 * i] = float(by_cells.of_f[i] / by_cells.of_one[i]), x[3 * i + 1] = 0.25f;
    solve_mass(least.mass, x.data(), 3, 2);
    for (size_t i = 0; i < r->count(); ++i) {
      EXPECT_NEAR(x[3 * i + 1], 0.25f, 1e-6f);
      EXPECT_EQ(x[3 * i + 2], 7.0f);
    }
    for (size_t v = 0; r == &hats && v < scene.positions.size(); ++v)
      EXPECT_NEAR(double(x[3 * hats.front[v]]), linear(scene.positions[v]), 5e-4);
    for (uint32_t t = 0; r == &boxes && t < scene.triangles.size(); ++t)
      EXPECT_NEAR(double(x[3 * std::get<PatchReceivers>(boxes.basis).front[t].receiver]),
                  linear(interpolate(scene.positions, scene.triangles[t], 1.0f / 3, 1.0f / 3)), 1e-4);
  }
}

// What is lost of a function that bends is a quarter with edges half as long, and least squares lose less of it than
// its values at the vertices do.
TEST(Projection, HatsComeNearerToWhatBendsByTheSquareOfTheirEdges) {
  const auto bent = [](Vec3 p) { return std::sin(3 * double(p.x)) * std::cos(2 * double(p.z)); };
  double before = 0;
  for (int n : {4, 8, 16}) {
    const Scene scene = make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), n, n, Vec3(0.5f));
    const Receivers r = make_vertex_receivers(scene);
    const Integrals by_cells = integrate(scene, r, 24, bent);
    std::vector<float> least(r.count()), there(r.count());
    for (size_t i = 0; i < r.count(); ++i) least[i] = float(by_cells.of_f[i] / by_cells.of_one[i]);
    for (size_t v = 0; v < scene.positions.size(); ++v) there[r.front[v]] = float(bent(scene.positions[v]));
    solve_mass(make_least_squares(scene, r, 1, 1).mass, least.data(), 1, 1);
    double lost[2] = {};
    Random random(3);
    for (uint32_t t = 0; t < scene.triangles.size(); ++t)
      for (int k = 0; k < 64; ++k) {
        const Vec2 s = sobol_owen(uint32_t(k), t);
        const float u = std::sqrt(s.x) * (1 - s.y), v = std::sqrt(s.x) * s.y;
        const double truth = bent(interpolate(scene.positions, scene.triangles[t], u, v));
        const auto& basis = std::get<CornerReceivers>(r.basis);
        double sum[2] = {};
        basis.spread(*basis.find(t, true), u, v,
                     [&](uint32_t i, float w) { sum[0] += double(w * least[i]), sum[1] += double(w * there[i]); });
        for (int j : {0, 1}) lost[j] += (sum[j] - truth) * (sum[j] - truth);
      }
    const double rms = std::sqrt(lost[0] / (64 * double(scene.triangles.size())));
    EXPECT_LT(lost[0], 0.6 * lost[1]) << n;
    if (before > 0) {
      EXPECT_NEAR(before / rms, 4, 0.8) << n;
    }
    before = rms;
  }
}

TEST(Projection, PlacesAreAsDenseAsFunctionsAreHigh) {
  Scene scene = slanted_quad();
  auto atlas = make_atlas(scene, {.texels_per_unit = 7.7f});
  ASSERT_TRUE(atlas);
  const Receivers all[] = {make_vertex_receivers(scene), make_patch_receivers(scene),
                           make_texel_receivers(scene, *atlas)};
  for (const Receivers& r : all) {
    const Integrals by_cells = integrate(scene, r, 96, linear);
    const SpreadPlaces places = make_least_squares(scene, r, 256, 5).places;
    ASSERT_EQ(places.origins.size(), 256 * r.count());
    for (size_t i = 0; i < r.count(); ++i) {
      const bool texel = std::holds_alternative<TexelReceivers>(r.basis);
      if (texel && by_cells.of_one[i] < 0.72 / (7.7 * 7.7)) continue;
      double mean = 0;
      for (size_t k = 0; k < 256; ++k) {
        mean += linear(places.origins[256 * i + k]) / 256;
        EXPECT_GT(dot(places.normals[256 * i + k], r.normals[i]), 0.999f);
      }
      EXPECT_NEAR(mean, by_cells.of_f[i] / by_cells.of_one[i], 0.02);
    }
  }
}

TEST(Projection, FunctionsWithoutASurfaceStayWhereTheyAre) {
  // A texel's worth of scene: all texels around it take part, and some are met by no point.
  Scene scene = make_quad(Vec3(0), Vec3(0, 0, 0.01f), Vec3(0.01f, 0, 0), 1, 1, Vec3(0.5f));
  auto atlas = make_atlas(scene, {.texels_per_unit = 1});
  ASSERT_TRUE(atlas);
  const Receivers r = make_texel_receivers(scene, *atlas);
  const LeastSquares least = make_least_squares(scene, r, 8, 1);
  std::vector<float> x(r.count(), 0.5f);
  solve_mass(least.mass, x.data(), 1, 1);
  for (float v : x) EXPECT_NEAR(v, 0.5f, 1e-5f);
  for (const Vec3& p : least.places.origins) EXPECT_TRUE(is_finite(p) && length(p) < 0.1f);
}

}  // namespace
}  // namespace lambent
