#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/light/cube_light.h>
#include <lambent/light/cube_parts.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// A sky with no symmetry and a sun of one texel, 50,000 times as bright.
Environment sunny(int width) {
  Environment env = make_environment(
      "sunny", width, width / 2, [](Vec3 d) { return Vec3(0.5f + 0.3f * d.y, 0.6f + 0.2f * d.x, 0.7f - 0.1f * d.z); });
  env.image.at(width / 3, width / 9) = Vec3(30000, 25000, 20000);
  return env;
}

Vec3d energy(const Environment& env) {
  Vec3d sum(0);
  for (int y = 0; y < env.image.height; ++y)
    for (int x = 0; x < env.image.width; ++x)
      sum += Vec3d(env.image.at(x, y)) * texel_solid_angle(y, env.image.width, env.image.height);
  return sum;
}

TEST(CubeLight, LosesNoEnergyAtAnySizeOrRotation) {
  for (int width : {8, 100, 512})
    for (int size : {16, 64})
      for (Vec3 turn : {Vec3(0), Vec3(33, 20, -71)}) {
        const Environment env = sunny(width);
        const CubeLight light = cube_light(env, size, rotation_from_yaw_pitch_roll(turn));
        Vec3d sum(0);
        for (Vec3 e : light.energy) sum += Vec3d(e);
        const Vec3d whole = energy(env);
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c] / whole[c], 1, 2e-6) << width << " " << size;
      }
}

TEST(CubeLight, AnEvenSkyStaysEven) {
  for (int width : {8, 256, 1000}) {
    const Environment env = make_environment("even", width, width / 2, [](Vec3) { return Vec3(1); });
    const CubeLight light = cube_light(env, 64, rotation_from_yaw_pitch_roll({10, 20, 30}));
    for (int face = 0; face < 6; ++face)
      for (int row = 0; row < 64; ++row)
        for (int column = 0; column < 64; ++column)
          EXPECT_NEAR(light.energy[cube_texel(64, face, column, row)].x / float(cube_solid_angle(64, column, row)), 1,
                      1e-3);
  }
}

// Against points drawn over the texels of the map, in each texel of a coarse cube.
TEST(CubeLight, EachTexelHasItsShare) {
  const Environment env =
      make_environment("steep", 64, 32, [](Vec3 d) { return Vec3(std::exp(3 * d.x), 1 + d.y, d.z * d.z); });
  const Mat3 R = rotation_from_yaw_pitch_roll({50, -30, 15});
  const CubeLight light = cube_light(env, 16, R);
  std::vector<Vec3d> drawn(cube_texels(16), Vec3d(0));
  const int draws = 1 << 22;
  for (int i = 0; i < draws; ++i) {
    const Vec3 d = square_to_sphere(sobol_owen(uint32_t(i), 5));
    const CubePlace p = cube_place(R * d);
    auto cell = [](float u) { return std::min(int((u + 1) * 8), 15); };
    drawn[cube_texel(16, p.face, cell(p.u), cell(p.v))] += Vec3d(radiance(env, d)) * (4 * std::numbers::pi / draws);
  }
  double difference = 0, total = 0;
  for (size_t t = 0; t < drawn.size(); ++t)
    for (int c = 0; c < 3; ++c) difference += std::abs(drawn[t][c] - double(light.energy[t][c])), total += drawn[t][c];
  EXPECT_LT(difference / total, 0.01);  // 2,700 points a texel
}

// Texels cut in SIMD lanes against those cut one at a time.
TEST(CubeLight, IsThatOfTexelsCutOneByOne) {
  for (int size : {16, 64})
    for (int width : {100, 256, 512}) {
      const Environment env = sunny(width);
      const Mat3 turn = rotation_from_yaw_pitch_roll({33, 20, -71});
      const CubeLight light = cube_light(env, size, turn);
      const int split = std::max(1, (4 * size + width - 1) / width), w = width * split, h = width / 2 * split;
      std::vector<Vec3d> energy(cube_texels(size), Vec3d(0)), moment = energy;
      CubeParts parts;
      for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x) {
          auto corner = [&](int i, int j) {
            return cube_corner(size, turn * latlong_direction(Vec2(float(i) / float(w), float(j) / float(h))));
          };
          const CubeCorner a = corner(x, y), b = corner(x + 1, y), c = corner(x + 1, y + 1), d = corner(x, y + 1);
          cut_texel(size, {&a, &b, &c, &d}, parts);
          const Vec3 radiance = env.image.at(x / split, y / split);
          for (int k = 0; k < parts.count; ++k) {
            const CubePart& p = parts.at[k];
            const double share = double(p.solid_angle / parts.total) * texel_solid_angle(y, w, h);
            const size_t t = cube_texel(size, p.face, p.column, p.row);
            energy[t] += share * Vec3d(radiance);
            moment[t] += share * double(radiance.x + radiance.y + radiance.z) * Vec3d(p.direction);
          }
        }
      const double texel = 2.0 / size;
      for (size_t t = 0; t < energy.size(); ++t) {
        // A texel a hair across a border counts for less than a thousandth of what it has. Where one lies within a
        // texel of the cube, its middle is that of its area, and not the mean of its corners, which at the poles are
        // three.
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(light.energy[t][c] / energy[t][c], 1, 1e-3);
        EXPECT_LT(length(Vec3d(light.direction[t]) - normalize(moment[t])), 0.03 * texel);
      }
    }
}

// The aim of the issue is 0.1 %. The directions know where in its texel the sun is; only texels across the plane's
// horizon err.
TEST(CubeLight, GivesThePlanesIrradiance) {
  const Environment env = sunny(512);
  const CubeLight light = cube_light(env, 64);
  Random random(9);
  for (int i = 0; i < 200; ++i) {
    const Vec3 n = square_to_sphere(random.next2());
    if (std::abs(dot(n, texel_direction(512 / 3, 512 / 9, 512, 256))) < 0.03f)
      continue;  // the sun stands on the horizon
    Vec3d sum(0);
    for (size_t t = 0; t < light.energy.size(); ++t)
      sum += Vec3d(light.energy[t] * std::max(0.0f, dot(light.direction[t], n)));
    const Vec3 truth = irradiance(env, n);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum[c] / double(truth[c]), 1, 1e-3);
  }
}

TEST(CubeLight, ReducingKeepsEnergyAndSaysWhereOneTexelHasItAll) {
  const Environment env = sunny(512), half = reduced(env, 256);
  EXPECT_EQ(half.image.width, 256);
  const Vec3d before = energy(env), after = energy(half);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(after[c] / before[c], 1, 1e-6);
  EXPECT_EQ(reduced(env, 512).image.width, 512);
  Environment dark = make_environment("dark", 256, 128, [](Vec3) { return Vec3(0); });
  EXPECT_EQ(largest_share(cube_light(dark, 16)), 0);
  dark.image.at(128, 64) = Vec3(1);
  EXPECT_GT(largest_share(cube_light(dark, 16)), 0.24f);
  EXPECT_LT(largest_share(cube_light(make_environment("even", 64, 32, [](Vec3) { return Vec3(1); }), 16)), 0.002f);
}

}  // namespace
}  // namespace lambent
