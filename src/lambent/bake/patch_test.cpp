#include <lambent/bake/patch.h>
#include <lambent/basis/sh.h>
#include <lambent/core/random.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <array>

#include "sanitizers.h"

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
    for (int k = 0; k < 36; ++k)
      EXPECT_NEAR(row[size_t(k)], y[k] * float(clamped_cosine(sh_band(k)) / std::numbers::pi), 2e-3)
          << k;  // noise of 4096 rays
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
  for (int i = 3; i < n - 3; ++i)
    EXPECT_GT(patch.receivers.normals[size_t(5 * n + i)].x, 0.2f);  // slopes down to +u, so faces it
  HeightField down{n, {}};
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) down.heights.push_back(0.3f * float(n - j) / n);
  EXPECT_LT(make_patch(down, Vec3(0.5f)).receivers.normals[size_t(5 * n + 5)].y,
            -0.2f);  // down towards larger v, which is -y
}

TEST(Patch, RepeatsAndDoesNotFeelItsSeams) {
  SKIP_UNDER_SANITIZERS();
  // The same relief shifted by half a period has the same transfer, shifted.
  const int n = 16;
  HeightField field{n, {}}, shifted{n, {}};
  auto height = [&](int i, int j) {
    return 0.08f * std::sin(2 * pi * float(i) / n) * std::cos(4 * pi * float(j) / n + 1);
  };
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) field.heights.push_back(height(i, j)), shifted.heights.push_back(height(i + 8, j + 8));
  EXPECT_LT(seam_jump(field), 2);
  const Transfer a = baked(make_patch(field, Vec3(0.7f)), 4096, 2), b = baked(make_patch(shifted, Vec3(0.7f)), 4096, 2);
  double error = 0, total = 0;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const std::vector<float> u = load_receiver(a, size_t((j + 8) % n * n + (i + 8) % n)),
                               v = load_receiver(b, size_t(j * n + i));
      for (size_t k = 0; k < 36; ++k) error += std::pow(u[k] - v[k], 2), total += u[k] * u[k];
    }
  EXPECT_LT(std::sqrt(error / total), 0.01);  // noise of 4,096 rays, twice
}

// A deep groove that reflects everything, evenly lit, gives back what it hides as bounces go on.
TEST(Patch, BouncesBetweenItsWalls) {
  const int n = 16;
  HeightField field{n, {}};
  for (int k = 0; k < n * n; ++k) field.heights.push_back(0.3f * std::cos(2 * pi * float(k % n) / n));
  auto mean = [&](int bounces) {
    const Transfer t = baked(make_patch(field, Vec3(1)), 1024, bounces);
    double sum = 0;
    for (size_t r = 0; r < t.receivers; ++r)
      sum += load_receiver(t, r)[0] * std::sqrt(4 * std::numbers::pi) / double(t.receivers);
    return sum;
  };
  EXPECT_LT(mean(0), 0.75);
  EXPECT_NEAR(mean(40), 1, 0.01);  // rays that meet the relief's outermost rows from behind are few
}

// The middle repetition of a relief, cut out as a mesh.
Scene as_mesh(const PatchScene& patch, int n) {
  Scene tile;
  add_material(tile, "relief", Vec3(0.7f));
  std::vector<Vec3> positions, normals;
  std::vector<uint32_t> indices;
  const int side = 3 * n, row = side + 1;
  for (int j = n; j <= 2 * n; ++j)
    for (int i = n; i <= 2 * n; ++i)
      positions.push_back(patch.scene.positions[size_t(j * row + i)] * 5.0f + Vec3(1, 2, 3)),
          normals.push_back(patch.scene.normals[size_t(j * row + i)]);
  for (uint32_t j = 0; j < uint32_t(n); ++j)
    for (uint32_t i = 0; i < uint32_t(n); ++i) {
      const uint32_t a = j * uint32_t(n + 1) + i, b = a + 1, c = a + uint32_t(n) + 1, d = c + 1;
      indices.insert(indices.end(), {a, c, b, b, c, d});
    }
  add_mesh(tile, 0, "relief", positions, normals, indices);
  return tile;
}

TEST(Patch, OfAMeshIsThatOfItsHeights) {
  SKIP_UNDER_SANITIZERS();
  // The mesh begins at the middle of the first texel, and its own texels lie between those of the field, at twice as
  // many.
  const int n = 16;
  HeightField field{n, {}};
  for (int k = 0; k < n * n; ++k)
    field.heights.push_back(0.1f * std::sin(2 * pi * float(k % n) / n) * std::cos(2 * pi * float(k / n) / n + 1));
  const PatchScene relief = make_patch(field, Vec3(0.7f));
  HeightField heights;
  auto mesh = make_mesh_patch(as_mesh(relief, n), 2 * n, &heights);
  ASSERT_TRUE(mesh) << mesh.error().text();
  const float least = *std::min_element(field.heights.begin(), field.heights.end());
  EXPECT_LT(seam_jump(heights), 2);
  const Transfer a = baked(relief, 4096, 3), b = baked(*mesh, 4096, 3), direct = baked(*mesh, 1024, 0);
  double error = 0, unbounced = 0, total = 0;
  for (int j = 0; j < n - 1; ++j)
    for (int i = 0; i < n - 1; ++i) {
      // Four of the field's texels about the centre of a cell; texels of the mesh about the same.
      std::array<float, 36> u{}, v{}, w{};
      for (int k = 0; k < 4; ++k) {
        const std::vector<float> x = load_receiver(a, size_t((j + k / 2) * n + i + k % 2)),
                                 y = load_receiver(b, size_t((2 * j + k / 2) * 2 * n + 2 * i + k % 2)),
                                 z = load_receiver(direct, size_t((2 * j + k / 2) * 2 * n + 2 * i + k % 2));
        for (size_t c = 0; c < 36; ++c) u[c] += x[c] / 4, v[c] += y[c] / 4, w[c] += z[c] / 4;
      }
      for (size_t c = 0; c < 36; ++c)
        error += std::pow(u[c] - v[c], 2), unbounced += std::pow(u[c] - w[c], 2), total += u[c] * u[c];
      // The mesh's texel lies a quarter into the cell, on the triangle of its first corner and that corner's
      // neighbours.
      const auto corner = [&](int y, int x) { return field.heights[size_t(y * n + x)]; };
      EXPECT_NEAR(heights.heights[size_t(2 * j * 2 * n + 2 * i)],
                  corner(j, i) / 2 + corner(j, i + 1) / 4 + corner(j + 1, i) / 4 - least, 1e-6);
    }
  EXPECT_LT(std::sqrt(error / total), 0.015);      // curvature within a cell, noise
  EXPECT_GT(std::sqrt(unbounced / total), 0.025);  // so that bounces are held
}

TEST(Patch, RefusesMeshesThatDoNotRepeat) {
  auto refused = [](const Scene& tile, int size = 4) { return !make_mesh_patch(tile, size); };
  EXPECT_FALSE(refused(make_quad(Vec3(0), Vec3(2, 0, 0), Vec3(0, 2, 0), 1, 1, Vec3(1))));
  EXPECT_TRUE(refused(make_quad(Vec3(0), Vec3(2, 0, 0), Vec3(0, 2, 0), 1, 1, Vec3(1)), 1));
  EXPECT_TRUE(refused(make_quad(Vec3(0), Vec3(2, 0, 0), Vec3(0, 1, 0), 1, 1, Vec3(1))));  // not square
  EXPECT_TRUE(refused(make_quad(Vec3(0), Vec3(2, 0, 0), Vec3(0, 0, 2), 1, 1, Vec3(1))));  // no extent along y
  EXPECT_TRUE(refused(make_quad(Vec3(0), Vec3(0, 2, 0), Vec3(2, 0, 0), 1, 1, Vec3(1))));  // faces away
  EXPECT_TRUE(refused(make_sphere(1, 2, Vec3(1)), 32));                                   // holes at its corners
}

TEST(Patch, MakesHeightFieldsOfPictures) {
  const std::vector<float> values{0, 1, 2, 3};
  auto field = make_height_field(values, 2, 2, 2, 0.5f);
  ASSERT_TRUE(field);
  // Over its own texel a pixel's tent has the mean 3/4, and 1/4 is its neighbours', which repeat: values x + 2 y become
  // those of x, y = 1/4 and 3/4. All of it is exact in binary.
  for (int k = 0; k < 4; ++k)
    EXPECT_EQ(field->heights[size_t(k)], 0.5f * ((k % 2 ? 0.75f : 0.25f) + 2 * (k / 2 ? 0.75f : 0.25f))) << k;
  EXPECT_FALSE(make_height_field(std::vector<float>{1}, 1, 1, 8, 1));
  EXPECT_FALSE(make_height_field(std::vector<float>{1, NAN, 0, 0}, 2, 2, 8, 1));
  EXPECT_FALSE(make_height_field(values, 2, 2, 1, 1));
  EXPECT_FALSE(make_height_field(values, 2, 2, 8, NAN));
  HeightField ramp{16, {}};
  for (int k = 0; k < 256; ++k) ramp.heights.push_back(float(k % 16));
  EXPECT_GT(seam_jump(ramp), 5);
}

// At the bottom of a steep valley the normal may point into its other side; what is received there is still what
// arrives there.
TEST(Patch, SteepValleysAreNotTakenForBuried) {
  const int n = 16;
  HeightField field{n, {}};
  for (int k = 0; k < n * n; ++k) {
    Random random(4, uint64_t(k));
    field.heights.push_back(0.3f * random.next());
  }
  const PatchScene patch = make_patch(field, Vec3(0.5f));
  auto tracer = Tracer::build(patch.scene);
  BakeReport report;
  auto transfer = bake(patch.scene, *tracer, patch.receivers,
                       {.order = 1, .samples = 1024, .bounces = 0, .precision = Precision::single}, &report);
  ASSERT_TRUE(transfer);
  EXPECT_EQ(report.buried, 0u);
  const Environment env = *load_environment("uniform:1");
  const std::vector<ExitRadiance> truth =
      exit_radiances(patch.scene, env, patch.receivers.origins, patch.receivers.normals, 0, 1024, 1);
  double error = 0;
  for (size_t r = 0; r < truth.size(); ++r)
    error += std::pow(load_receiver(*transfer, r)[0] * std::sqrt(4 * std::numbers::pi) - truth[r].mean.x, 2);
  EXPECT_LT(std::sqrt(error / double(truth.size())), 0.01);
}

}  // namespace
}  // namespace lambent
