#include <lambent/bake/response.h>
#include <lambent/brdf/load_measured.h>
#include <lambent/brdf/measured.h>
#include <lambent/core/sampling.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// O_j(wo) = integral of f z_j cos by cosine-distributed points: no use of the BRDF's own sampling, of symmetries or of
// moments.
std::vector<Vec4d> plain_response(const LinearMaterial& m, const CosineBasis& basis, Vec3 wo, uint32_t points) {
  std::vector<Vec4d> O(size_t(basis.count()), Vec4d(0.0));
  std::vector<float> z(O.size());
  for (uint32_t i = 0; i < points; ++i) {
    const Vec3 wi = square_to_cosine_hemisphere(sobol_owen(i, 77));
    const Vec3 a = evaluate(m.black, wi, wo) * pi, both = evaluate(m.white, wi, wo) * pi;
    evaluate_cosine_basis(basis, wi, z);
    for (size_t j = 0; j < z.size(); ++j) O[j] += Vec4d(a, luminance(both - a)) * (double(z[j]) / points);
  }
  return O;
}

LinearMaterial same(const Brdf& brdf) { return {brdf, brdf}; }

TEST(Response, IsTheIntegralInEveryView) {
  auto table = std::make_shared<MeasuredTable>();
  table->theta_h = 30, table->theta_d = 8, table->phi_d = 8;
  for (int h = 0; h < table->theta_h; ++h)
    for (int d = 0; d < table->theta_d; ++d)
      for (int p = 0; p < table->phi_d; ++p) {
        const float slope = std::tan(std::min(cell_angles(*table, h, d, p).theta_h, 1.5f)) / 0.4f;
        table->f.push_back(Vec3(0.15f, 0.1f, 0.05f) + Vec3(0.5f, 0.4f, 0.6f) * std::exp(-slope * slope));
      }
  prepare_sampling(*table);
  const MetallicRoughness black{Vec3(0), 0.3f, 0.6f}, white{Vec3(1), 0.3f, 0.6f};
  const std::vector<LinearMaterial> materials{
      {Lambert{Vec3(0)}, Lambert{Vec3(1)}},
      same(Phong{Vec3(0.3f, 0.2f, 0.1f), Vec3(0.7f, 0.6f, 0.2f), 8}),
      same(Ggx{Vec3(0.9f, 0.6f, 0.3f), Vec2(0.5f)}),
      same(Ggx{Vec3(0.9f, 0.6f, 0.3f), Vec2(0.3f, 0.8f)}),
      same(Ward{Vec3(0.3f, 0.2f, 0.1f), Vec3(0.7f, 0.5f, 0.3f), Vec2(0.6f, 0.25f)}),
      same(CookTorrance{Vec3(0.3f), Vec3(0.6f), Vec3(0.5f), 0.4f}),
      {black, white},
      same(Measured{table}),
  };
  const CosineBasis basis = make_cosine_basis(4);
  for (int grid : {8, 9}) {  // without a node in the middle, and with one
    auto maps = make_responses(materials, basis, grid, 4096);
    ASSERT_TRUE(maps);
    ASSERT_EQ(maps->size(), materials.size());
    for (size_t m = 0; m < materials.size(); ++m)
      // One node of each quadrant and the ones next to the middle, on both diagonals; the horizon apart.
      for (const auto& [x, y] : {std::pair(2, 3), std::pair(5, 2), std::pair(1, 6), std::pair(6, 5), std::pair(4, 4),
                                 std::pair(3, 4), std::pair(2, 2), std::pair(5, 5)}) {
        const Vec3 wo = view_map_direction(grid, x, y);
        const std::vector<Vec4d> expected = plain_response(materials[m], basis, wo, 1 << 15);
        for (size_t j = 0; j < expected.size(); ++j)
          for (int c = 0; c < 4; ++c)
            EXPECT_NEAR(double((*maps)[m].values[(size_t(y) * size_t(grid) + size_t(x)) * expected.size() + j][c]),
                        expected[j][c], 0.004)
                << "material " << m << " view " << x << ", " << y << " of " << grid << " row " << j << " part " << c;
      }
  }
}

// 1 - sum c_j^2 / (1/pi integral of f^2 cos), by cosine-distributed points and not by the BRDF's own.
double plain_beyond(const Brdf& brdf, const CosineBasis& basis) {
  constexpr uint32_t points = 1 << 14, views = 32;
  double all = 0, held = 0;
  std::vector<float> z(size_t(basis.count()));
  for (uint32_t v = 0; v < views; ++v) {
    const Vec3 wo = square_to_cosine_hemisphere(sobol_owen(v, 5));
    std::vector<double> c(z.size(), 0.0);
    for (uint32_t i = 0; i < points; ++i) {
      const Vec3 wi = square_to_cosine_hemisphere(sobol_owen(i, 78));
      const double f = double(luminance(evaluate(brdf, wi, wo)));
      evaluate_cosine_basis(basis, wi, z);
      for (size_t j = 0; j < z.size(); ++j) c[j] += f * double(z[j]) / points;
      all += f * f / points;
    }
    for (double x : c) held += x * x;
  }
  return 1 - held / all;
}

TEST(Response, WhatTheBandsDoNotHoldIsTheIntegral) {
  const CosineBasis four = make_cosine_basis(4), six = make_cosine_basis(6);
  EXPECT_EQ(energy_beyond(Lambert{Vec3(0.5f)}, four), 0);
  for (const float alpha : {0.36f, 0.6f}) {
    const Ggx ggx{Vec3(0.9f, 0.6f, 0.3f), Vec2(alpha)};
    EXPECT_NEAR(energy_beyond(ggx, four), plain_beyond(ggx, four), 0.04) << alpha;
    EXPECT_NEAR(energy_beyond(ggx, six), plain_beyond(ggx, six), 0.04) << alpha;
  }
  // A lobe of few bands is held, one that is nearly a mirror is not.
  EXPECT_LT(energy_beyond(Phong{Vec3(0.2f), Vec3(0.5f), 1}, six), 0.02);
  EXPECT_GT(energy_beyond(Ggx{Vec3(1), Vec2(0.01f)}, six), 0.99);
}

// Against the responses themselves, view by view.
double misfit_of_lobes(const ViewMap& response, int count) {
  const std::vector<Lobe> lobes = outgoing_lobes(count);
  const auto parts = project_response(response, OutgoingKind::directional, 0, lobes);
  const Outgoing outgoing{
      .kind = OutgoingKind::directional, .order = 1, .has_b = false, .frames = {Mat3(1.0f)}, .lobes = lobes};
  std::vector<ViewWeights> weights(lobes.size());
  double off = 0, all = 0;
  for (int y = 0; y < response.grid; ++y)
    for (int x = 0; x < response.grid; ++x) {
      const Vec3 wo = view_map_direction(response.grid, x, y);
      evaluate_outgoing(outgoing, 0, wo, weights);
      for (size_t j = 0; j < size_t(response.rows); ++j) {
        const double O = double(response.values[size_t(y * response.grid + x) * size_t(response.rows) + j].x);
        double sum = 0;
        for (size_t k = 0; k < lobes.size(); ++k)
          sum += double(weights[k].x) * double(parts[0][k * size_t(response.rows) + j]);
        off += double(wo.z) * (sum - O) * (sum - O), all += double(wo.z) * O * O;
      }
    }
  return std::sqrt(off / all);
}

TEST(Response, CompactLobesHoldReflectionAndAViewMeetsAFew) {
  const LinearMaterial material = same(Ggx{Vec3(0.9f), Vec2(0.36f)});
  auto maps = make_responses({&material, 1}, make_cosine_basis(5), 32, 1024);
  ASSERT_TRUE(maps);
  const double few = misfit_of_lobes((*maps)[0], 25), some = misfit_of_lobes((*maps)[0], 64),
               many = misfit_of_lobes((*maps)[0], 128);
  EXPECT_LT(few, 0.08);
  EXPECT_LT(some, 0.03);
  EXPECT_LT(many, 0.02);
  EXPECT_LT(many, some);
  EXPECT_LT(some, few);
  for (int count : {4, 25, 64, 128}) {
    const std::vector<Lobe> lobes = outgoing_lobes(count);
    ASSERT_EQ(lobes.size(), size_t(count));
    for (Vec3 v : even_directions(200)) {
      if (v.z < 0) continue;
      int met = 0;
      for (const Lobe& lobe : lobes) {
        EXPECT_TRUE(is_lobe(LobeKind::compact, lobe));
        met += lobe_value(LobeKind::compact, lobe.sharpness, double(dot(lobe.axis, v))) > 0;
      }
      EXPECT_GE(met, 2) << count;
      EXPECT_LE(met, 14) << count;
    }
  }
}

}  // namespace
}  // namespace lambent
