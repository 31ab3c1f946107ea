#include <lambent/bake/patch.h>
#include <lambent/basis/sh.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

Transfer baked(const PatchScene& patch, int samples, int bounces) {
  auto tracer = Tracer::build(patch.scene);
  BakeOptions options;
  options.samples = samples, options.bounces = bounces, options.precision = Precision::single;
  return *bake(patch.scene, *tracer, patch.receivers, options);
}

TEST(Patch, FlatReliefIsAnOpenPlane) {
  const PatchScene patch = make_patch({8, std::vector<float>(64, 0.3f)}, Vec3(0.5f));
  const Transfer t = baked(patch, 4096, 1);
  float y[36];
  evaluate_sh(6, Vec3(0, 0, 1), y);
  for (size_t r : {size_t{0}, size_t{27}, size_t{63}}) {
    const std::vector<float> row = load_receiver(t, r);
    for (int k = 0; k < 36; ++k) EXPECT_NEAR(row[size_t(k)], y[k] * float(clamped_cosine(sh_band(k)) / std::numbers::pi), 2e-3) << k;  // noise of 4096 rays
  }
}

// Grooves along v that fall steeply towards +u: light from +u is hidden, and the frame is the stated one.
TEST(Patch, KnowsItsAxes) {
  const int n = 16;
  HeightField field{n, {}};
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) field.heights.push_back(0.3f * float(n - i) / n);
  const PatchScene patch = make_patch(field, Vec3(0.5f));
  EXPECT_GT(area_normal(patch.scene, patch.scene.triangles[0]).z, 0);
  for (int i = 3; i < n - 3; ++i) EXPECT_GT(patch.receivers.normals[size_t(5 * n + i)].x, 0.2f);  // slopes down to +u, so faces it
  HeightField down{n, {}};
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) down.heights.push_back(0.3f * float(n - j) / n);
  EXPECT_LT(make_patch(down, Vec3(0.5f)).receivers.normals[size_t(5 * n + 5)].y, -0.2f);  // down towards larger v, which is -y
}

TEST(Patch, RepeatsAndDoesNotFeelItsSeams) {
  // The same relief shifted by half a period has the same transfer, shifted.
  const int n = 16;
  HeightField field{n, {}}, shifted{n, {}};
  auto height = [&](int i, int j) { return 0.08f * std::sin(2 * pi * float(i) / n) * std::cos(4 * pi * float(j) / n + 1); };
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) field.heights.push_back(height(i, j)), shifted.heights.push_back(height(i + 8, j + 8));
  EXPECT_LT(seam_jump(field), 2);
  const Transfer a = baked(make_patch(field, Vec3(0.7f)), 4096, 2), b = baked(make_patch(shifted, Vec3(0.7f)), 4096, 2);
  double error = 0, total = 0;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const std::vector<float> u = load_receiver(a, size_t((j + 8) % n * n + (i + 8) % n)), v = load_receiver(b, size_t(j * n + i));
      for (size_t k = 0; k < 36; ++k) error += std::pow(u[k] - v[k], 2), total += u[k] * u[k];
    }
  EXPECT_LT(std::sqrt(error / total), 0.01);  // noise of 4,096 rays, twice
}

TEST(Patch, MakesHeightFieldsOfPictures) {
  const std::vector<float> values{0, 1, 2, 3};
  auto field = make_height_field(values, 2, 2, 2, 0.5f);
  ASSERT_TRUE(field);
  for (float h : field->heights) EXPECT_NEAR(h, 0.75f, 0.51f);
  EXPECT_LT(field->heights[0], field->heights[3]);
  EXPECT_FALSE(make_height_field(std::vector<float>{1}, 1, 1, 8, 1));
  EXPECT_FALSE(make_height_field(std::vector<float>{1, NAN, 0, 0}, 2, 2, 8, 1));
  EXPECT_FALSE(make_height_field(values, 2, 2, 1, 1));
  EXPECT_FALSE(make_height_field(values, 2, 2, 8, NAN));
  HeightField ramp{16, {}};
  for (int k = 0; k < 256; ++k) ramp.heights.push_back(float(k % 16));
  EXPECT_GT(seam_jump(ramp), 5);
}

}  // namespace
}  // namespace lambent
