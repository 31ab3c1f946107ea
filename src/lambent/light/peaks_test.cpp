#include <lambent/light/peaks.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

TEST(Peaks, AreWhatTheSharpestShareOfTheSphereHasAboveTheRest) {
  // 1 everywhere, 50 about +Y within an angle of 20 degrees: 3 % of the sphere; a coefficient of order 4 has 6 %.
  const Environment env = make_environment(
      "lamp", 256, 128, [](Vec3 d) { return d.y > std::cos(0.349066f) ? Vec3(50, 25, 100) : Vec3(1); });
  const Environment soft = without_peaks(env, 4);
  for (size_t i = 0; i < env.image.rgb.size(); ++i) {
    EXPECT_NEAR(luminance(soft.image.rgb[i]), 1, 1e-5);
    EXPECT_NEAR(soft.image.rgb[i].x * env.image.rgb[i].z, soft.image.rgb[i].z * env.image.rgb[i].x, 1e-4) << "hue";
  }
  // Of order 7 a coefficient has 2 %: the lamp is no peak.
  EXPECT_EQ(without_peaks(env, 7).image.rgb, env.image.rgb);
}

TEST(Peaks, EvenLightHasNone) {
  const Environment env = make_environment("even", 32, 16, [](Vec3) { return Vec3(0.3f, 0.5f, 2); });
  EXPECT_EQ(without_peaks(env, 6).image.rgb, env.image.rgb);
}

}  // namespace
}  // namespace lambent
