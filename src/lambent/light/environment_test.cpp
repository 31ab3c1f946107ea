#include <lambent/core/random.h>
#include <lambent/light/environment.h>

#include <chi_square.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

namespace lambent {
namespace {

constexpr double pi_d = std::numbers::pi;

// Different in every texel, no symmetry.
Environment skewed(int width, int height, uint64_t seed = 1) {
  Random random(seed);
  return make_environment("skewed", width, height, [&](Vec3 d) {
    return Vec3(1 + d.x + random.next(), 2 + d.y + random.next(), 0.5f + std::abs(d.z) + random.next());
  });
}

void expect_near(Vec3 a, Vec3 b, float tolerance) {
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(a[k], b[k], tolerance) << k;
}

TEST(LatLong, KnownDirections) {
  constexpr float rounding = 1e-6f;
  expect_near(latlong_direction({0.5f, 0.5f}), {1, 0, 0}, rounding);   // image centre
  expect_near(latlong_direction({0.75f, 0.5f}), {0, 0, 1}, rounding);  // three quarters of the way right
  expect_near(latlong_direction({0.25f, 0.5f}), {0, 0, -1}, rounding);
  expect_near(latlong_direction({0, 0.5f}), {-1, 0, 0}, rounding);
  expect_near(latlong_direction({0.3f, 0}), {0, 1, 0}, rounding);  // first row
  expect_near(latlong_direction({0.3f, 1}), {0, -1, 0}, rounding);
  // Corner texels of a 4 x 2 map: theta = 45 degrees, phi = -135, 135 degrees.
  const float h = 0.5f, s = std::sqrt(0.5f);
  expect_near(texel_direction(0, 0, 4, 2), {-h, s, -h}, rounding);
  expect_near(texel_direction(3, 0, 4, 2), {-h, s, h}, rounding);
  expect_near(texel_direction(0, 1, 4, 2), {-h, -s, -h}, rounding);
  expect_near(texel_direction(3, 1, 4, 2), {-h, -s, h}, rounding);
}

TEST(LatLong, LookUpsFindTheTexel) {
  Environment env = skewed(14, 7);
  for (int y = 0; y < 7; ++y)
    for (int x = 0; x < 14; ++x) {
      Vec3 d = texel_direction(x, y, 14, 7);
      EXPECT_EQ(radiance(env, d), env.image.at(x, y)) << x << " " << y;
      EXPECT_EQ(radiance(env, d * 1.001f), env.image.at(x, y));
      constexpr float interpolation_rounding = 1e-5f;
      expect_near(radiance_bilinear(env, d), env.image.at(x, y), interpolation_rounding);
    }
}

TEST(LatLong, BilinearBetweenTexelsAndAcrossTheSeam) {
  Environment env = skewed(8, 4);
  constexpr float rounding = 1e-5f;
  auto at = [&](float x, float y) { return radiance_bilinear(env, latlong_direction({x / 8, y / 4})); };
  expect_near(at(3.0f, 1.5f), (env.image.at(2, 1) + env.image.at(3, 1)) * 0.5f, rounding);
  Vec3 expected = 0.75f * 0.5f * (env.image.at(2, 1) + env.image.at(2, 2)) +
                  0.25f * 0.5f * (env.image.at(3, 1) + env.image.at(3, 2));
  expect_near(at(2.75f, 2.0f), expected, rounding);
  expect_near(at(0.25f, 2.5f), 0.75f * env.image.at(0, 2) + 0.25f * env.image.at(7, 2), rounding);
  expect_near(at(7.75f, 2.5f), 0.75f * env.image.at(7, 2) + 0.25f * env.image.at(0, 2), rounding);
  expect_near(at(4.5f, 0.1f), env.image.at(4, 0), rounding);
  expect_near(at(4.5f, 3.9f), env.image.at(4, 3), rounding);
}

TEST(LatLong, StrangeDirectionsStayInside) {
  Environment env = skewed(6, 3);
  for (Vec3 d : {Vec3(0), Vec3(NAN), Vec3(INFINITY, 0, 1), Vec3(0, 1.0001f, 0), Vec3(0, -1.0001f, 0),
                 Vec3(-1, 0, -0.0f), Vec3(-1, 0, 0), Vec3(1e-30f), Vec3(-1, 0, 1e-20f), Vec3(1e30f, -1e30f, 1)}) {
    Vec2 uv = latlong_uv(d);
    EXPECT_TRUE(uv.x >= 0 && uv.x <= 1 && uv.y >= 0 && uv.y <= 1) << d.x << " " << d.y << " " << d.z;
    EXPECT_TRUE(is_finite(radiance(env, d)));
    EXPECT_TRUE(is_finite(radiance_bilinear(env, d)));
  }
  EXPECT_EQ(latlong_uv(Vec3(0, 1.0001f, 0)).y, 0);
}

TEST(LatLong, SolidAnglesSumToTheSphere) {
  constexpr double relative = 1e-12;
  for (auto [w, h] : {std::pair{4, 2}, {1024, 512}, {7, 5}, {1, 1}, {4096, 2048}}) {
    double sum = 0;
    for (int y = 0; y < h; ++y) sum += w * texel_solid_angle(y, w, h);
    EXPECT_NEAR(sum / (4 * pi_d), 1, relative) << w;
  }
  EXPECT_NEAR(texel_solid_angle(0, 4, 4), pi_d / 2 * (1 - std::sqrt(0.5)), relative);
  EXPECT_NEAR(texel_solid_angle(1, 4, 4), pi_d / 2 * std::sqrt(0.5), relative);
}

TEST(Irradiance, ClosedForms) {
  auto uniform = load_environment("uniform:2,3,0.25");
  ASSERT_TRUE(uniform);
  Environment upper = make_environment("upper", 256, 128, [](Vec3 d) { return d.y > 0 ? Vec3(1) : Vec3(0); });
  Environment front = make_environment("front", 256, 128, [](Vec3 d) { return d.z > 0 ? Vec3(1) : Vec3(0); });
  constexpr float horizon_texels = 1e-4f;  // relative; texels that the plane's horizon cuts through
  for (float degrees : {0.0f, 17.0f, 45.0f, 90.0f, 120.0f, 180.0f}) {
    float t = radians(degrees);
    Vec3 n = normalize(Vec3(std::sin(t) * 0.8f, std::cos(t), std::sin(t) * 0.6f));
    expect_near(irradiance(*uniform, n) / (pi * Vec3(2, 3, 0.25f)), Vec3(1), horizon_texels);
    EXPECT_NEAR(irradiance(upper, n).x, pi * (1 + std::cos(t)) / 2, pi * horizon_texels) << degrees;
    EXPECT_NEAR(irradiance(front, n).x, pi * (1 + n.z) / 2, pi * horizon_texels) << degrees;
  }
}

TEST(Rotated, WholeTurnsMoveTexelsExactly) {
  Environment env = skewed(16, 8);
  Environment same = rotated(env, Mat3(1), 3);
  constexpr float rounding = 1e-6f;
  for (size_t i = 0; i < env.image.rgb.size(); ++i) expect_near(same.image.rgb[i], env.image.rgb[i], rounding * 4);
  // R turns +X to +Z: what was seen at the centre is then three quarters to the right.
  Mat3 R(Vec3(0, 0, 1), Vec3(0, 1, 0), Vec3(-1, 0, 0));
  Environment turned = rotated(env, R, 2);
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 16; ++x) expect_near(turned.image.at((x + 4) % 16, y), env.image.at(x, y), rounding * 4);
}

TEST(Rotated, IrradianceTurnsAlong) {
  Environment env =
      make_environment("smooth", 64, 32, [](Vec3 d) { return Vec3(1 + 0.8f * d.x, 1 + d.y * d.z, 2 + d.z); });
  Mat3 R = rotation_from_yaw_pitch_roll({35, -50, 110});
  Environment turned = rotated(env, R);
  constexpr float resampling = 0.01f;
  for (Vec3 n : {Vec3(1, 0, 0), Vec3(0, 1, 0), normalize(Vec3(1, -2, 3))})
    expect_near(irradiance(turned, R * n), irradiance(env, n), resampling);
}

// --- Loading

TEST(LoadEnvironment, Uniform) {
  auto env = load_environment("uniform:0.5");
  ASSERT_TRUE(env);
  EXPECT_EQ(env->image.at(3, 3), Vec3(0.5f));
  EXPECT_EQ(env->name, "uniform");
  EXPECT_EQ(load_environment("uniform:1,2,3e-1")->image.at(0, 0), Vec3(1, 2, 0.3f));
  for (const char* bad : {"uniform:", "uniform:1,2", "uniform:1,2,3,4", "uniform:1,2,3,", "uniform:-1", "uniform:nan",
                          "uniform:inf", "uniform:a", "uniform:1;2;3"})
    EXPECT_FALSE(load_environment(bad)) << bad;
}

TEST(LoadEnvironment, MendsAndCountsWhatIsNoRadiance) {
  Image image(4, 2);
  for (Vec3& c : image.rgb) c = Vec3(1);
  image.rgb[0] = {-1, 2, -3}, image.rgb[3] = {-INFINITY, 5, -1}, image.rgb[5].z = INFINITY, image.rgb[6].y = -1e-8f;
  image.alpha.assign(8, 0.5f);
  auto env = environment_from_image("a", image);
  ASSERT_TRUE(env);
  EXPECT_EQ(env->warnings, (std::vector<std::string>{
                               "3 pixels with a channel that is negative: taken as 0",
                               "1 pixel with a channel that is infinite: taken as 5, the largest of the others"}));
  EXPECT_EQ(env->image.rgb[0], Vec3(0, 2, 0));
  EXPECT_EQ(env->image.rgb[3], Vec3(0, 5, 0));
  EXPECT_EQ(env->image.rgb[5], Vec3(1, 1, 5));
  EXPECT_TRUE(env->image.alpha.empty());
  std::vector<std::string> warnings;
  clamp_radiance(image, 65504, warnings);
  EXPECT_EQ(image.rgb[5], Vec3(1, 1, 65504));
  EXPECT_EQ(warnings[1],
            "1 pixel with a channel that is infinite: taken as 65504, the largest that its half floats hold");
  EXPECT_EQ(environment_from_image("b", Image(3, 3)).error().text(),
            "b: a lat-long map is twice as wide as high, not 3 x 3");
  EXPECT_TRUE(environment_from_image("c", Image(4, 2))->warnings.empty());
  EXPECT_TRUE(environment_from_image("d", Image(5, 2)));
}

TEST(LoadEnvironment, WhatIsNotANumberIsTheMeanOfItsNeighbours) {
  Environment env = skewed(8, 4);
  const Image& given = env.image;
  Image image = given;
  image.at(0, 2) = Vec3(NAN);  // its neighbours are beyond the seam, too
  image.at(4, 0).y = NAN;      // a pole: five neighbours
  auto mended = environment_from_image("a", image);
  ASSERT_TRUE(mended);
  EXPECT_EQ(
      mended->warnings,
      std::vector<std::string>{"2 pixels with a channel that is not a number: taken as the mean of their neighbours"});
  Vec3 seam(0), pole(0);
  for (auto [x, y] : {std::pair{7, 1}, {0, 1}, {1, 1}, {7, 2}, {1, 2}, {7, 3}, {0, 3}, {1, 3}})
    seam += given.at(x, y) / 8.0f;
  for (auto [x, y] : {std::pair{3, 0}, {5, 0}, {3, 1}, {4, 1}, {5, 1}}) pole += given.at(x, y) / 5.0f;
  constexpr float rounding = 1e-6f;
  expect_near(mended->image.at(0, 2), seam, rounding * 4);
  EXPECT_NEAR(mended->image.at(4, 0).y, pole.y, rounding * 4);
  EXPECT_EQ(mended->image.at(4, 0).x, given.at(4, 0).x);  // the others stay
  // A whole region of a constant map takes its constant, from the rim inwards; a map of nothing is black.
  Image even(64, 32);
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 64; ++x) even.at(x, y) = y < 20 ? Vec3(NAN) : Vec3(0.5f, 1, 2);
  mended = environment_from_image("b", even);
  for (const Vec3& c : mended->image.rgb) EXPECT_EQ(c, Vec3(0.5f, 1, 2));
  std::fill(even.rgb.begin(), even.rgb.end(), Vec3(NAN));
  mended = environment_from_image("c", even);
  for (const Vec3& c : mended->image.rgb) EXPECT_EQ(c, Vec3(0));
}

TEST(LoadEnvironment, FilesAndErrors) {
  std::string base = testing::TempDir() + "/lambent_env_" + std::to_string(::getpid());
  Image image(4, 2);
  image.at(2, 0) = {1, 2, 3};
  ASSERT_TRUE(save_image(base + ".exr", image));
  ASSERT_TRUE(save_image(base + ".png", image));
  auto env = load_environment(base + ".exr");
  ASSERT_TRUE(env) << env.error().text();
  EXPECT_EQ(env->name, std::filesystem::path(base).filename().string());
  EXPECT_EQ(env->image.at(2, 0), Vec3(1, 2, 3));
  auto low = load_environment(base + ".png");  // clamped to 1, and said
  ASSERT_TRUE(low) << low.error().text();
  EXPECT_EQ(low->image.at(2, 0), Vec3(1));
  ASSERT_EQ(low->warnings.size(), 1u);
  EXPECT_TRUE(
      low->warnings[0].ends_with(".png: decoded from sRGB, where radiance ends at 1: lamps and the sun are cut off"))
      << low->warnings[0];
  EXPECT_EQ(load_environment(base + ".hdr").error().message, "no such file");
  std::filesystem::remove(base + ".exr");
  std::filesystem::remove(base + ".png");
}

TEST(LoadEnvironment, RealFiles) {
  const char* named = std::getenv("LAMBENT_DATA");
  std::filesystem::path data = named ? std::filesystem::path(named)
                                     : std::filesystem::path(__FILE__).parent_path() / "../../../../shared/data";
  std::filesystem::path folder = data / "environments";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << "no test data: set LAMBENT_DATA";
  size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    auto env = load_environment(entry.path().string());
    ASSERT_TRUE(env) << env.error().text();
    ++count;
    EXPECT_EQ(env->image.width, 2 * env->image.height);
    EXPECT_TRUE(env->image.width == 1024 || env->image.width == 512);
    EXPECT_EQ(env->name, entry.path().stem());
    // Pixels with a negative channel as stored. The chromaticities of city.exr are Rec. 709 adapted to D50, so nothing
    // is added.
    if (env->name == "city" || env->name == "courtyard_dwab") {
      ASSERT_EQ(env->warnings.size(), 1u) << env->name;
      std::string expected = env->name == "city" ? "299" : "1188";
      EXPECT_EQ(env->warnings[0],
                entry.path().string() + ": " + expected + " pixels with a channel that is negative: taken as 0");
    } else {
      EXPECT_TRUE(env->warnings.empty()) << env->name << ": " << env->warnings[0];
    }
  }
  EXPECT_EQ(count, 16u);
}

// --- Sampling

// Texel of a direction, as an index.
size_t texel_of(const Environment& env, Vec3 d) {
  Vec2 uv = latlong_uv(d);
  int x = std::min(int(uv.x * float(env.image.width)), env.image.width - 1),
      y = std::min(int(uv.y * float(env.image.height)), env.image.height - 1);
  return size_t(y) * size_t(env.image.width) + size_t(x);
}

TEST(EnvironmentSampler, PdfIntegratesToOne) {
  Environment env = skewed(32, 16);
  env.image.at(5, 3) = Vec3(1e4f), env.image.at(9, 9) = Vec3(0);
  EnvironmentSampler sampler = make_environment_sampler(env);
  double sum = 0;
  for (int y = 0; y < 16; ++y)
    for (int x = 0; x < 32; ++x)
      sum += double(environment_pdf(sampler, texel_direction(x, y, 32, 16))) * texel_solid_angle(y, 32, 16);
  constexpr double float_pdf = 1e-6;
  EXPECT_NEAR(sum, 1, float_pdf);
  EXPECT_EQ(environment_pdf(sampler, texel_direction(9, 9, 32, 16)), 0);
}

TEST(EnvironmentSampler, ChiSquareOverTexels) {
  Environment env = skewed(12, 6, 3);
  env.image.at(7, 1) *= 20.0f, env.image.at(2, 4) = Vec3(0);
  EnvironmentSampler sampler = make_environment_sampler(env);
  constexpr size_t draws = 200000;
  std::vector<double> counts(72);
  Random random(11);
  for (size_t i = 0; i < draws; ++i) {
    EnvironmentSample s = sample_environment(sampler, random.next2());
    ++counts[texel_of(env, s.direction)];
  }
  std::vector<double> expected(72);
  for (int y = 0; y < 6; ++y)
    for (int x = 0; x < 12; ++x) {
      double& e = expected[size_t(y * 12 + x)];
      e = double(environment_pdf(sampler, texel_direction(x, y, 12, 6))) * texel_solid_angle(y, 12, 6) * draws;
      if (e == 0) {
        EXPECT_EQ(counts[size_t(y * 12 + x)], 0);
      }
    }
  test::expect_chi_square(counts, expected);
}

TEST(EnvironmentSampler, UniformWithinATexel) {
  // One big texel: moments of direction over it against their integrals.
  Environment env = make_environment("one", 4, 2, [](Vec3) { return Vec3(0); });
  env.image.at(2, 0) =
      Vec3(1);  // phi in [0, 90], theta in [0, 90] degrees: an octant, whose mean direction is (1, 1, 1) / 2
  EnvironmentSampler sampler = make_environment_sampler(env);
  Vec3d sum(0);
  constexpr int side = 200;
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      EnvironmentSample s = sample_environment(sampler, {(float(i) + 0.5f) / side, (float(j) + 0.5f) / side});
      EXPECT_TRUE(s.direction.x >= -1e-6f && s.direction.y >= -1e-6f && s.direction.z >= -1e-6f);
      ASSERT_NEAR(s.pdf, 2 / pi, 1e-6f);
      sum += Vec3d(s.direction);
    }
  constexpr float midpoint_rule = 1e-4f;
  expect_near(Vec3(sum / double(side * side)), Vec3(0.5f), midpoint_rule);
}

TEST(EnvironmentSampler, EstimatesThePowerOfNegativeLightToo) {
  Environment env = skewed(24, 12, 5);
  for (size_t i = 0; i < env.image.rgb.size(); i += 3) env.image.rgb[i] *= -0.7f;
  // Luminance cancels here, yet blue must not be missed.
  env.image.at(4, 4) = Vec3(-0.0722f, 0, 0.2126f) * 3000.0f;
  EnvironmentSampler sampler = make_environment_sampler(env);
  Vec3d exact(0), estimate(0), squares(0);
  for (int y = 0; y < 12; ++y)
    for (int x = 0; x < 24; ++x) exact += Vec3d(env.image.at(x, y)) * texel_solid_angle(y, 24, 12);
  constexpr int draws = 200000;
  Random random(2);
  for (int i = 0; i < draws; ++i) {
    EnvironmentSample s = sample_environment(sampler, random.next2());
    ASSERT_GT(s.pdf, 0);
    Vec3d value = Vec3d(s.radiance) / double(s.pdf);
    estimate += value / double(draws), squares += value * value / double(draws);
  }
  constexpr double sigmas = 4;
  for (int k = 0; k < 3; ++k)
    EXPECT_NEAR(estimate[k], exact[k], sigmas * std::sqrt((squares[k] - estimate[k] * estimate[k]) / draws)) << k;
}

TEST(EnvironmentSampler, SampleAgreesWithLookUps) {
  Environment env = skewed(40, 20, 8);
  EnvironmentSampler sampler = make_environment_sampler(env);
  Random random(3);
  int different = 0;
  for (int i = 0; i < 20000; ++i) {
    EnvironmentSample s = sample_environment(sampler, random.next2());
    EXPECT_NEAR(length(s.direction), 1, 1e-6f);
    different += radiance(env, s.direction) != s.radiance || environment_pdf(sampler, s.direction) != s.pdf;
  }
  constexpr int on_borders = 10;  // directions rounded across the border between two texels
  EXPECT_LE(different, on_borders);
}

TEST(EnvironmentSampler, EndsOfTheSquareAndBlackMaps) {
  Environment env = make_environment("spot", 8, 4, [](Vec3) { return Vec3(0); });
  EXPECT_EQ(sample_environment(make_environment_sampler(env), {0.3f, 0.6f}).pdf, 0);
  EXPECT_EQ(environment_pdf(make_environment_sampler(env), {1, 0, 0}), 0);
  env.image.at(3, 1) = {0, 0, -2};
  EnvironmentSampler sampler = make_environment_sampler(env);
  for (float u : {0.0f, 0.5f, std::nextafter(1.0f, 0.0f), 1.0f})
    for (float v : {0.0f, 0.5f, std::nextafter(1.0f, 0.0f), 1.0f}) {
      EnvironmentSample s = sample_environment(sampler, {u, v});
      EXPECT_EQ(s.radiance, Vec3(0, 0, -2)) << u << " " << v;
      EXPECT_NEAR(double(s.pdf) * texel_solid_angle(1, 8, 4), 1, 1e-6);
    }
}

}  // namespace
}  // namespace lambent
