#include <lambent/bake/bake.h>
#include <lambent/basis/sh.h>
#include <lambent/compress/wrinkle.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

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
    for (int k = 0; k < 36; ++k)
      EXPECT_NEAR(t[size_t(x * 36 + k)], y[k] * float(clamped_cosine(sh_band(k)) / std::numbers::pi), 1e-5) << k;
}

// The cross-section's simulation against the baker, on a long groove.
TEST(Wrinkle, IsWhatTheBakeOfALongGrooveFinds) {
  SKIP_UNDER_SANITIZERS();
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
      normals.push_back(normalize(Vec3(-slope, 0, 1)));
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
  const std::vector<float> ours = simulate_wrinkle(6, 33, depth, 0.5f);
  for (int place : {0, 1, 5, 12, 16, 25, 32}) {  // place / 32 - 1/2 = 3 i / 192 - 3/2
    const std::vector<float> row =
        load_receiver(*transfer, receivers.front[size_t(along / 2 * (across + 1) + 64 + 2 * place)]);
    EXPECT_LT(distance(row, &ours[size_t(place) * 36]), 0.03) << place;  // noise of 4,096 rays, and facets
  }
}

// Between the entries, in place and depth, the table is nearly as good as on them, and fitting all entries together is
// what makes it so.
TEST(Wrinkle, LobesCorrespondSoThatTheTableInterpolates) {
  SKIP_UNDER_SANITIZERS();
  double between[2];
  for (int together : {0, 1}) {
    auto table = make_wrinkle_table({.iterations = together ? 200 : 0});
    ASSERT_TRUE(table);
    double error = 0, plain = 0, total = 0;
    for (int row : {6, 14, 25}) {
      const std::vector<float> exact = simulate_wrinkle(6, 63, (float(row) + 0.5f) / 31, 0.5f);
      const std::vector<float> above = simulate_wrinkle(6, 32, float(row) / 31, 0.5f),
                               below = simulate_wrinkle(6, 32, float(row + 1) / 31, 0.5f);
      for (int place = 1; place < 62; ++place) {  // the odd ones lie between entries, the even ones on them
        const float x = float(place) / 62 - 0.5f, p = float(place) / 2, f = p - std::floor(p);
        const size_t i = std::min(size_t(p), size_t{30}) * 36;
        std::vector<float> values(table->texture.transfer.receiver_values());
        sample_groove(table->texture, x, (float(row) + 0.5f) / 31, values);
        const std::vector<float> fit = zonal_harmonics(table->texture.transfer, values);
        for (size_t k = 0; k < 36; ++k) {
          const double t = exact[size_t(place) * 36 + k];
          const double mean = 0.5 *
                              ((1 - f) * (above[i + k] + below[i + k]) + f * (above[i + 36 + k] + below[i + 36 + k]));
          error += std::pow(fit[k] - t, 2), plain += std::pow(mean - t, 2), total += t * t;
        }
      }
    }
    between[together] = std::sqrt(error / total);
    std::printf("%s: entries %.4f, between %.4f, exact vectors between %.4f\n", together ? "together" : "apart",
                table->rms, between[together], std::sqrt(plain / total));
    // What it reports is the error at its own entries; three lobes in place of 35 harmonics leave 0.0553 each fitted by
    // itself (it prints both), and together hardly more.
    double own = 0, all = 0;
    for (int row = 0; row < 32; ++row) {
      const std::vector<float> exact = simulate_wrinkle(6, 32, float(row) / 31, 0.5f);
      for (int place = 0; place < 32; ++place) {
        std::vector<float> values(table->texture.transfer.receiver_values());
        sample_groove(table->texture, float(place) / 31 - 0.5f, float(row) / 31, values);
        const std::vector<float> fit = zonal_harmonics(table->texture.transfer, values);
        for (size_t k = 0; k < 36; ++k) {
          const double t = exact[size_t(place) * 36 + k];
          own += std::pow(fit[k] - t, 2), all += t * t;
        }
      }
    }
    EXPECT_NEAR(table->rms, std::sqrt(own / all), 1e-4);  // the places are rounded, and between entries it is linear
    EXPECT_LT(table->rms, 0.06);
    if (together) {
      EXPECT_LT(between[1], table->rms + std::sqrt(plain / total));
    }
  }
  EXPECT_LT(between[1], 0.8 * between[0]);
}

// The groove's border, grooves of no depth and what lies beyond are the open plane.
TEST(Wrinkle, EndsInThePlane) {
  SKIP_UNDER_SANITIZERS();
  auto table = make_wrinkle_table({});
  ASSERT_TRUE(table);
  float y[36];
  evaluate_sh(6, Vec3(0, 0, 1), y);
  std::vector<float> values(table->texture.transfer.receiver_values());
  for (auto [x, depth] :
       {std::pair(-0.5f, 0.9f), {0.5f, 0.3f}, {0.1f, 0.0f}, {-0.3f, 0.0f}, {0.7f, 1.0f}, {NAN, NAN}}) {
    sample_groove(table->texture, x, depth, values);
    const std::vector<float> sh = zonal_harmonics(table->texture.transfer, values);
    std::vector<float> plane(36);
    for (size_t k = 0; k < 36; ++k) plane[k] = y[k] * float(clamped_cosine(sh_band(int(k))) / std::numbers::pi);
    EXPECT_LT(distance(sh, plane.data()), 0.02) << x << ' ' << depth;
  }
}

TEST(Wrinkle, RefusesWhatMakesNoSense) {
  EXPECT_FALSE(make_wrinkle_table({.lobes = 2}));
  EXPECT_FALSE(make_wrinkle_table({.size = 1}));
  EXPECT_FALSE(make_wrinkle_table({.max_depth = NAN}));
  EXPECT_FALSE(make_wrinkle_table({.albedo = 1}));
}

}  // namespace
}  // namespace lambent
