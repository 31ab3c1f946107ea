#include <lambent/bake/bake.h>
#include <lambent/basis/sh.h>
#include <lambent/compress/wrinkle.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

double distance(const std::vector<float>& a, const float* b) {
  double error = 0, total = 0;
  for (size_t k = 0; k < a.size(); ++k) error += std::pow(double(a[k]) - b[k], 2), total += double(b[k]) * b[k];
  return std::sqrt(error / total);
}

TEST(Wrinkle, NoGrooveIsAnOpenPlane) {
  const std::vector<float> t = simulate_wrinkle(6, 4, 0, 0.5f);
  float y[36];
  evaluate_sh(6, Vec3(0, 0, 1), y);
  for (int x = 0; x < 4; ++x)
    for (int k = 0; k < 36; ++k) EXPECT_NEAR(t[size_t(x * 36 + k)], y[k] * float(clamped_cosine(sh_band(k)) / std::numbers::pi), 1e-5) << k;
}

// The cross-section's simulation against the baker, on a long groove.
TEST(Wrinkle, IsWhatTheBakeOfALongGrooveFinds) {
  constexpr int across = 192, along = 40;
  constexpr float depth = 0.7f, length = 60;
  std::vector<Vec3> positions, normals;
  std::vector<uint32_t> indices;
  for (int j = 0; j <= along; ++j)
    for (int i = 0; i <= across; ++i) {
      const float x = 1.5f * (2 * float(i) / across - 1), c = std::abs(x) < 0.5f ? std::cos(pi * x) : 0.0f;
      const float slope = std::abs(x) < 0.5f ? depth * pi * std::sin(2 * pi * x) : 0.0f;
      // Finer in the middle, where it is looked at.
      const float s = 2 * float(j) / along - 1;
      positions.push_back({x, length * s * s * s, -depth * c * c});
      normals.push_back(glm::normalize(Vec3(-slope, 0, 1)));
    }
  for (uint32_t j = 0; j < along; ++j)
    for (uint32_t i = 0; i < across; ++i) {
      const uint32_t a = j * (across + 1) + i, b = a + 1, c = a + across + 1, d = c + 1;
      for (uint32_t k : {a, b, c, b, d, c}) indices.push_back(k);
    }
  Scene scene;
  add_mesh(scene, add_material(scene, "skin", Vec3(0.5f)), "groove", positions, normals, indices);
  ASSERT_GT(area_normal(scene, scene.triangles[0]).z, 0);
  const Receivers receivers = make_vertex_receivers(scene);
  auto tracer = Tracer::build(scene);
  BakeOptions options;
  options.samples = 4096, options.bounces = 6, options.precision = Precision::single;
  auto transfer = bake(scene, *tracer, receivers, options);
  ASSERT_TRUE(transfer);
  const std::vector<float> ours = simulate_wrinkle(6, 32, depth, 0.5f);
  for (int place : {0, 5, 12, 16, 25}) {  // (place + 1/2) / 32 - 1/2 = 3 i / 192 - 3/2
    const std::vector<float> row = load_receiver(*transfer, receivers.front[size_t(along / 2 * (across + 1) + 65 + 2 * place)]);
    EXPECT_LT(distance(row, &ours[size_t(place) * 36]), 0.03) << place;  // noise of 4,096 rays, and facets
  }
}

TEST(Wrinkle, LobesCorrespondSoThatTheTableInterpolates) {
  auto table = make_wrinkle_table({});
  ASSERT_TRUE(table);
  EXPECT_LT(table->rms, 0.07);
  // Between the entries, in place and depth. What interpolation of the exact vectors would miss is counted as well: the table's lobes must
  // not add much to it, as they would if they were mixed up.
  double error = 0, plain = 0, total = 0;
  for (int row : {6, 14, 25}) {
    const std::vector<float> exact = simulate_wrinkle(6, 64, (float(row) + 1.5f) / 32, 0.5f);
    const std::vector<float> above = simulate_wrinkle(6, 32, (float(row) + 1) / 32, 0.5f), below = simulate_wrinkle(6, 32, (float(row) + 2) / 32, 0.5f);
    for (int place = 1; place < 63; ++place) {
      const float x = (float(place) + 0.5f) / 64 - 0.5f, p = (x + 0.5f) * 32 - 0.5f, f = p - std::floor(p);
      const size_t i = size_t(p) * 36;
      const std::vector<float> fit = zonal_harmonics(table->transfer, sample_wrinkle(*table, x, (float(row) + 1.5f) / 32));
      for (size_t k = 0; k < 36; ++k) {
        const double t = exact[size_t(place) * 36 + k];
        const double mean = 0.5 * ((1 - f) * (above[i + k] + below[i + k]) + f * (above[i + 36 + k] + below[i + 36 + k]));
        error += std::pow(fit[k] - t, 2), plain += std::pow(mean - t, 2), total += t * t;
      }
    }
  }
  std::printf("entries %.4f, between %.4f, exact vectors between %.4f\n", table->rms, std::sqrt(error / total), std::sqrt(plain / total));
  EXPECT_LT(std::sqrt(error / total), std::sqrt(plain / total) + 1.5 * table->rms);
}

TEST(Wrinkle, RefusesWhatMakesNoSense) {
  EXPECT_FALSE(make_wrinkle_table({.lobes = 2}));
  EXPECT_FALSE(make_wrinkle_table({.size = 1}));
  EXPECT_FALSE(make_wrinkle_table({.max_depth = NAN}));
  EXPECT_FALSE(make_wrinkle_table({.albedo = 1}));
}

}  // namespace
}  // namespace lambent
