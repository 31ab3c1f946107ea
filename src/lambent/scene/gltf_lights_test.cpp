#include <lambent/scene/gltf_test-inl.h>
#include <lambent/scene/lights.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

using namespace test;

Builder lit_triangle(const Json& light, const Json& node) {
  Builder b = triangle();
  b.json["extensions"]["KHR_lights_punctual"]["lights"] = Json::array({light});
  Json holder = node;
  holder["extensions"]["KHR_lights_punctual"]["light"] = 0;
  b.json["nodes"].push_back(holder);
  return b;
}

TEST(GltfLights, StandAndShineAsTheirNodesSay) {
  // A quarter turn about +Y takes -Z to -X; the parent moves and scales, which does not change the lamp.
  Builder b = lit_triangle({{"type", "spot"},
                            {"color", {1, 0.5, 0.25}},
                            {"intensity", 8},
                            {"name", "desk"},
                            {"spot", {{"innerConeAngle", 0.2}, {"outerConeAngle", 0.6}}}},
                           {{"translation", {1, 2, 3}}, {"rotation", {0, std::sqrt(0.5), 0, std::sqrt(0.5)}}});
  b.json["nodes"].push_back({{"children", {1}}, {"translation", {10, 0, 0}}, {"scale", {2, 2, 2}}});
  auto scene = b.load();
  ASSERT_TRUE(scene) << scene.error().text();
  ASSERT_EQ(scene->lights.size(), 1u);
  const PunctualLight& l = scene->lights[0];
  EXPECT_EQ(l.name, "desk");
  EXPECT_EQ(l.kind, PunctualLight::Kind::spot);
  EXPECT_EQ(l.position, Vec3(12, 4, 6));
  EXPECT_LT(length(l.direction - Vec3(-1, 0, 0)), 1e-6f);
  EXPECT_EQ(l.intensity, Vec3(8, 4, 2));
  EXPECT_FLOAT_EQ(l.inner_cone, 0.2f);
  EXPECT_FLOAT_EQ(l.outer_cone, 0.6f);
  // On the axis the full intensity over the squared distance; beyond the outer cone nothing.
  const LampArrival on = arriving(l, Vec3(10, 4, 6)), off = arriving(l, Vec3(11, 4, 7));
  EXPECT_FLOAT_EQ(on.irradiance.x, 2);
  EXPECT_FLOAT_EQ(on.distance, 2);
  EXPECT_LT(length(on.direction - Vec3(1, 0, 0)), 1e-6f);
  EXPECT_EQ(off.irradiance, Vec3(0));
}

TEST(GltfLights, DefaultsAndNames) {
  for (const char* type : {"point", "directional"}) {
    auto scene = lit_triangle({{"type", type}}, {{"name", "lamp node"}}).load();
    ASSERT_TRUE(scene) << scene.error().text();
    EXPECT_EQ(scene->lights.at(0).name, "lamp node");
    EXPECT_EQ(scene->lights[0].intensity, Vec3(1));
    EXPECT_EQ(scene->lights[0].direction, Vec3(0, 0, -1));
  }
  const PunctualLight sun{.kind = PunctualLight::Kind::directional, .direction = Vec3(0, -1, 0), .intensity = Vec3(5)};
  EXPECT_EQ(arriving(sun, Vec3(7)).irradiance, Vec3(5));
  EXPECT_EQ(arriving(sun, Vec3(7)).direction, Vec3(0, 1, 0));
}

// A lamp that is none is left out with a warning; what is not lit by lamps never fails by them.
TEST(GltfLights, WhatIsNoLampIsLeftOut) {
  const auto left_out = [](const Builder& b) {
    auto scene = b.load();
    if (!scene) return "refused: " + scene.error().text();
    EXPECT_TRUE(scene->lights.empty());
    EXPECT_EQ(scene->warnings.size(), 1u);
    return scene->warnings.empty() ? std::string() : scene->warnings[0];
  };
  const std::pair<Json, const char*> wrong[] = {
      {{{"type", "tube"}}, "light 0: type \"tube\" is not point, spot or directional"},
      {{{"color", {1, 1, 1}}}, "type"},
      {{{"type", "point"}, {"intensity", -1}}, "negative or too large"},
      {{{"type", "point"}, {"intensity", 1e300}}, "negative or too large"},
      {{{"type", "spot"}, {"spot", 5}}, "spot is not an object"},
      {5, "object"}};
  for (const auto& [light, message] : wrong) {
    const std::string text = left_out(lit_triangle(light, Json::object()));
    EXPECT_TRUE(text.starts_with("a lamp is left out: ")) << text;
    EXPECT_NE(text.find(message), std::string::npos) << text;
  }
  EXPECT_NE(left_out(lit_triangle({{"type", "point"}}, {{"translation", {0, 1e19, 0}}})).find("beyond 1e9"),
            std::string::npos);
  Builder b = lit_triangle({{"type", "point"}}, Json::object());
  b.json["nodes"][1]["extensions"]["KHR_lights_punctual"]["light"] = 7;
  EXPECT_NE(left_out(b).find("light is 7, out of range"), std::string::npos);
  b.json["nodes"][1]["extensions"]["KHR_lights_punctual"] = Json::object();
  EXPECT_NE(left_out(b).find("names no light"), std::string::npos);
  b.json["nodes"].push_back(b.json["nodes"][1]);
  EXPECT_NE(left_out(b).find("(and 1 more lamps)"), std::string::npos);
  b.json["extensions"].erase("KHR_lights_punctual");
  left_out(b);
}

TEST(GltfLights, ConesAreClamped) {
  const auto spot = [](Json cones) {
    auto scene = lit_triangle({{"type", "spot"}, {"spot", std::move(cones)}}, Json::object()).load();
    EXPECT_TRUE(scene) << scene.error().text();
    return *scene;
  };
  // A hard edge: all within the cone alike, nothing beyond.
  const Scene hard = spot({{"innerConeAngle", 0.4}, {"outerConeAngle", 0.4}});
  ASSERT_EQ(hard.warnings.size(), 1u);
  EXPECT_NE(hard.warnings[0].find("clamped"), std::string::npos);
  const auto at = [&](float angle) {
    return arriving(hard.lights.at(0), 3.0f * Vec3(std::sin(angle), 0, -std::cos(angle))).irradiance.x;
  };
  EXPECT_FLOAT_EQ(at(0), 1 / 9.0f);
  EXPECT_FLOAT_EQ(at(0.39f), 1 / 9.0f);
  EXPECT_EQ(at(0.41f), 0);
  const PunctualLight wide = spot({{"innerConeAngle", 0.1}, {"outerConeAngle", 1.6}}).lights.at(0);
  EXPECT_FLOAT_EQ(wide.outer_cone, pi / 2);
  EXPECT_FLOAT_EQ(wide.inner_cone, 0.1f);
  const PunctualLight crossed = spot({{"innerConeAngle", 1.0}}).lights.at(0);
  EXPECT_FLOAT_EQ(crossed.inner_cone, pi / 4);
  EXPECT_FLOAT_EQ(crossed.outer_cone, pi / 4);
  EXPECT_TRUE(spot({{"innerConeAngle", 0}, {"outerConeAngle", 1.5707963267948966}}).warnings.empty());
}

}  // namespace
}  // namespace lambent
