#include <lambent/light/sky.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

Environment sky(SkyOptions options) {
  auto env = make_sky(options);
  EXPECT_TRUE(env) << (env ? "" : env.error().text());
  return *env;
}

Vec3 mean_above(const Environment& env) {
  Vec3d sum(0);
  double weight = 0;
  for (int y = 0; y < env.image.height / 2; ++y)
    for (int x = 0; x < env.image.width; ++x) {
      double w = texel_solid_angle(y, env.image.width, env.image.height);
      sum += w * Vec3d(env.image.at(x, y)), weight += w;
    }
  return Vec3(sum / weight);
}

// Sum of radiance x solid angle of a map: the irradiance of its directions without the cosine.
Vec3d power(const Environment& env, int rows) {
  Vec3d sum(0);
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < env.image.width; ++x)
      sum += Vec3d(env.image.at(x, y)) * texel_solid_angle(y, env.image.width, env.image.height);
  return sum;
}

TEST(Sky, PlausibleBrightness) {
  SkyOptions options;
  options.sun = false, options.width = 128;
  float mean = luminance(mean_above(sky(options)));
  EXPECT_GT(mean, 0.3f);  // a clear sky's mean is 3,000 to 10,000 cd/m^2
  EXPECT_LT(mean, 1.0f);
  // Outside the haze, a high sun gives 80 to 110 klx on a plane that faces it.
  EXPECT_GT(luminance(sun_irradiance(60, 2)), 8);
  EXPECT_LT(luminance(sun_irradiance(60, 2)), 11);
  EXPECT_LT(luminance(sun_irradiance(60, 6)), luminance(sun_irradiance(60, 2)));
}

TEST(Sky, ZenithByTheFormulas) {
  // T = 3, sun at 30 degrees: chi = (4/9 - 0.025) 60 degrees = 0.439214,
  // Yz = 7.1649 tan(chi) - 0.6465 + 2.4192 = 5.139 kcd/m^2 (tan = 0.470002).
  SkyOptions options;
  options.elevation = 30, options.sun = false, options.width = 1024;
  Environment env = sky(options);
  constexpr float texel_off_the_zenith = 2e-3f;
  EXPECT_NEAR(luminance(env.image.at(0, 0)), 0.51402f, texel_off_the_zenith);
}

TEST(Sky, BlueAboveAndBrighterAroundTheSun) {
  SkyOptions options;
  options.elevation = 40, options.azimuth = 120, options.sun = false, options.width = 256;
  Environment env = sky(options);
  Vec3 zenith = radiance(env, {0, 1, 0});
  EXPECT_GT(zenith.z, 1.5f * zenith.x);
  float e = radians(40.0f), a = radians(120.0f);
  Vec3 toward(std::cos(e) * std::cos(a), std::sin(e), std::cos(e) * std::sin(a)), away(-toward.x, toward.y, -toward.z);
  Vec3 mirrored(toward.x, toward.y, -toward.z);
  EXPECT_GT(luminance(radiance(env, toward)), 2 * luminance(radiance(env, away)));
  EXPECT_GT(luminance(radiance(env, toward)), 2 * luminance(radiance(env, mirrored)));
}

TEST(Sky, DiscStandsWhereAskedAndItsEnergyIsExactAtAnySize) {
  SKIP_UNDER_SANITIZERS();
  for (int width : {8, 64, 1024, 2048})
    for (float elevation : {35.0f, 89.9f}) {
      SkyOptions with;
      with.width = width, with.elevation = elevation, with.azimuth = 200;
      SkyOptions without = with;
      without.sun = false;
      Environment a = sky(with), b = sky(without);
      Vec3d disc = power(a, width / 4) - power(b, width / 4);
      Vec3 expected = sun_irradiance(elevation, 3);
      constexpr double float_texels =
          1e-5;  // relative: the texels hold floats, and the disc is a difference of sums of them
      for (int k = 0; k < 3; ++k)
        EXPECT_NEAR(disc[k] / double(expected[k]), 1, float_texels) << width << " " << elevation;
      float e = radians(elevation), phi = radians(200.0f);
      Vec3 toward(std::cos(e) * std::cos(phi), std::sin(e), std::cos(e) * std::sin(phi));
      EXPECT_GT(luminance(radiance(a, toward)), luminance(radiance(b, toward)) * 1.5f) << width << " " << elevation;
    }
}

TEST(Sky, DiscHasItsSizeAndRadianceOnAFineMap) {
  SKIP_UNDER_SANITIZERS();
  SkyOptions options;
  options.width = 4096, options.elevation = 20;
  Environment env = sky(options);
  double covered = 0;
  for (int y = 0; y < env.image.height / 2; ++y)
    for (int x = 0; x < env.image.width; ++x)
      if (luminance(env.image.at(x, y)) > 100) covered += texel_solid_angle(y, env.image.width, env.image.height);
  double disc = 2 * std::numbers::pi * (1 - std::cos(0.2665 * std::numbers::pi / 180));
  constexpr double border_texels = 0.5;  // the disc is 6 texels across
  EXPECT_NEAR(covered / disc, 1, border_texels);
}

TEST(Sky, GroundIsLambert) {
  SkyOptions options;
  options.ground = {0.1f, 0.4f, 1.0f}, options.width = 256;
  Environment env = sky(options);
  Environment above = env;
  for (int y = 128 / 2; y < 128; ++y)
    for (int x = 0; x < 256; ++x) above.image.at(x, y) = Vec3(0);
  Vec3 expected = options.ground * irradiance(above, {0, 1, 0}) / pi;
  constexpr float relative = 1e-5f;
  for (Vec3 d : {Vec3(0, -1, 0), normalize(Vec3(1, -0.1f, 2))})
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(radiance(env, d)[k] / expected[k], 1, relative);
  SkyOptions shade = options;
  shade.sun = false;
  EXPECT_LT(radiance(sky(shade), {0, -1, 0}).y, 0.7f * expected.y);
}

TEST(Sky, SunReddensAndFadesAsItSinks) {
  float redness = 0, brightness = INFINITY;
  for (float elevation : {90.0f, 50.0f, 20.0f, 8.0f, 3.0f, 1.0f}) {
    Vec3 c = sun_irradiance(elevation, 3);
    EXPECT_GT(c.x / c.y, redness) << elevation;
    EXPECT_LT(luminance(c), brightness) << elevation;
    redness = c.x / c.y, brightness = luminance(c);
  }
}

TEST(Sky, ContinuousAcrossTheHorizonAndNeverNegative) {
  for (float turbidity : {1.7f, 1.99f, 2.01f, 3.0f, 10.0f}) {
    float last = -1;
    for (int step = -40; step <= 60; ++step) {
      SkyOptions options;
      options.elevation = float(step) * 0.05f, options.turbidity = turbidity, options.width = 32;
      Environment env = sky(options);
      for (const Vec3& c : env.image.rgb) {
        ASSERT_TRUE(is_finite(c));
        ASSERT_GE(std::min({c.x, c.y, c.z}), 0);
      }
      float now = luminance(irradiance(env, {0, 1, 0}));
      constexpr float jump =
          0.1f;  // relative, for a step of 0.05 degrees: the fade makes 0.033; haze 10 rises from near 0
      if (last >= 0) {
        EXPECT_NEAR(now / last, 1, jump) << options.elevation << " " << turbidity;
      }
      last = now;
    }
  }
  SkyOptions down;
  down.elevation = -2, down.width = 64;
  SkyOptions dark = down;
  dark.sun = false;
  EXPECT_EQ(sky(down).image.rgb, sky(dark).image.rgb);
}

TEST(Sky, ContinuousInTurbidityAtItsFloor) {
  SkyOptions low, two;
  low.sun = two.sun = false, low.width = two.width = 32, low.turbidity = 1.8f, two.turbidity = 2;
  EXPECT_EQ(sky(low).image.rgb, sky(two).image.rgb);  // the sky's floor
  EXPECT_GT(luminance(sun_irradiance(30, 1.8f)), luminance(sun_irradiance(30, 2)));
}

TEST(Sky, Parsing) {
  auto options = parse_sky("elevation=10.5,azimuth=-300,turbidity=4,ground=0.3,sun=off,width=64");
  ASSERT_TRUE(options) << options.error().text();
  EXPECT_EQ(options->elevation, 10.5f);
  EXPECT_EQ(options->azimuth, -300);
  EXPECT_EQ(options->turbidity, 4);
  EXPECT_EQ(options->ground, Vec3(0.3f));
  EXPECT_FALSE(options->sun);
  EXPECT_EQ(options->width, 64);
  ASSERT_TRUE(parse_sky(""));
  EXPECT_EQ(parse_sky("sun=on")->elevation, SkyOptions().elevation);
  for (const char* bad : {"elevation", "elevation=", "elevation=x", "elevation=1x", "elevation=nan", "height=3",
                          "sun=1", "sun", "width=1e9", "width=9.5", "=", ",,"})
    EXPECT_FALSE(parse_sky(bad)) << bad;
  EXPECT_EQ(parse_sky("height=3").error().text(),
            "sky: unknown key \"height\": elevation, azimuth, turbidity, ground, sun or width");
  for (const char* bad : {"sky:elevation=-3", "sky:elevation=91", "sky:turbidity=1", "sky:turbidity=11",
                          "sky:ground=1.5", "sky:ground=-1", "sky:width=0", "sky:width=9"})
    EXPECT_FALSE(load_environment(bad)) << bad;
  auto env = load_environment("sky:elevation=60,width=32");
  ASSERT_TRUE(env);
  EXPECT_EQ(env->image.height, 16);
  EXPECT_EQ(env->name, "sky");
}

}  // namespace
}  // namespace lambent
