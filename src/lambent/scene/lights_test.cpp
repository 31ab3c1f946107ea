#include <lambent/scene/lights.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// What Blender's exporter writes in each of its modes (glTF-Blender-IO, exp/lights.py): 60 W bulbs and a sun of 3 W/m2
// come back as the light they are in Blender: 60 W over the sphere, 3 W on a square metre that faces the sun.
TEST(LightUnits, BlendersModesAreTheSameLight) {
  constexpr double watts = 60, sun = 3, around = 4 * std::numbers::pi;
  struct Mode {
    LightUnits units;
    double bulb, sun;
  };
  for (const Mode& mode : {Mode{LightUnits::watt, watts / around * 683, sun * 683},  // Standard
                           Mode{LightUnits::lumen, watts / around, sun},             // Unitless
                           Mode{LightUnits::raw, watts, sun}}) {                     // Raw
    std::vector<PunctualLight> lights(3);
    lights[0].position = {0, 2, 0};
    lights[1].kind = PunctualLight::Kind::spot, lights[1].position = {0, 2, 0}, lights[1].direction = {0, -1, 0};
    lights[2].kind = PunctualLight::Kind::directional, lights[2].direction = {0, -1, 0};
    for (int i = 0; i < 3; ++i) lights[size_t(i)].intensity = Vec3(float(i < 2 ? mode.bulb : mode.sun));
    convert_lights(lights, mode.units);
    for (int i = 0; i < 3; ++i) {
      const double expected = i < 2 ? watts / (around * 4) : sun;
      EXPECT_NEAR(arriving(lights[size_t(i)], Vec3(0)).irradiance.x, expected, 1e-6 * expected) << int(mode.units) << i;
    }
  }
}

TEST(LightUnits, AreGuessedByTheGenerator) {
  EXPECT_EQ(guess_light_units("Khronos glTF Blender I/O v4.2.70"), LightUnits::watt);
  EXPECT_EQ(guess_light_units("Khronos glTF Blender I/O v3.4.40"), LightUnits::watt);
  EXPECT_EQ(guess_light_units("Khronos glTF Blender I/O v10.0.1"), LightUnits::watt);
  EXPECT_EQ(guess_light_units("Khronos glTF Blender I/O"), LightUnits::watt);
  // Released versions before it had modes: Blender 2.83 to 3.3.
  EXPECT_EQ(guess_light_units("Khronos glTF Blender I/O v3.3.35"), LightUnits::raw);
  EXPECT_EQ(guess_light_units("Khronos glTF Blender I/O v3.4.39"), LightUnits::raw);
  EXPECT_EQ(guess_light_units("Khronos glTF Blender I/O v1.8.19"), LightUnits::raw);
  for (const char* other : {"", "Blender", "babylon.js glTF exporter for 3dsmax", "COLLADA2GLTF"})
    EXPECT_EQ(guess_light_units(other), LightUnits::lumen) << other;
  // Whatever stands there.
  for (const char* odd : {"Khronos glTF Blender I/O v", "Khronos glTF Blender I/O v.", "Khronos glTF Blender I/O v3",
                          "Khronos glTF Blender I/O v99999999999999999999.1", "Khronos glTF Blender I/O v-1.-1.-1"})
    EXPECT_NE(guess_light_units(odd), LightUnits::lumen) << odd;
}

}  // namespace
}  // namespace lambent
