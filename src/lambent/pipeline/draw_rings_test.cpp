// Light that is too sharp for its bands, where it rang: on glossy objects that are placed, and beside lobes of light.
#include <lambent/pipeline/bake.h>
#include <lambent/pipeline/draw.h>
#include <lambent/pipeline/field_request.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/scene/append.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"
#include "temporary_folder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace lambent {
namespace {

class DrawRings : public testing::Test {
 protected:
  test::TemporaryFolder folder;
  std::string path(const std::string& name) const { return folder.file(name); }
};

float least(const Image& image) {
  float out = 0;
  for (const Vec3& c : image.rgb) out = std::min({out, c.x, c.y, c.z});
  return out;
}

// As shown, from black to white.
double error(const Image& a, const Image& truth) {
  double sum = 0;
  for (size_t i = 0; i < a.rgb.size(); ++i)
    for (int c = 0; c < 3; ++c)
      sum += std::pow(double(std::clamp(a.rgb[i][c], 0.0f, 1.0f) - std::clamp(truth.rgb[i][c], 0.0f, 1.0f)), 2);
  return std::sqrt(sum / double(3 * a.rgb.size()));
}

Environment sharp_sun() {
  const Vec3 sun = normalize(Vec3(0.7f, 0.6f, -0.4f));
  return make_environment("made", 128, 64,
                          [&](Vec3 d) { return dot(d, sun) > 0.99f ? Vec3(60, 55, 50) : Vec3(0.1f, 0.12f, 0.15f); });
}

TEST_F(DrawRings, AGlossyPlacedObjectIsKeptFromRinging) {
  SKIP_UNDER_SANITIZERS();
  Scene floor;
  add_quad(floor, add_material(floor, "floor", Vec3(0)), "floor", Vec3(-0.1f, -9, -0.1f), Vec3(0, 0, 0.2f),
           Vec3(0.2f, 0, 0), 2, 2);
  BakeRequest below;
  below.loaded = std::make_shared<const Scene>(floor), below.scene = "floor", below.order = 4, below.samples = 64;
  below.bounces = "0", below.lattice = "2,2,2", below.lattice_box = "-2,-2,-2,2,2,2";
  const auto scene = bake(below);
  ASSERT_TRUE(scene) << scene.error().text();
  Scene balls;
  const uint32_t shiny = add_material(balls, "shiny", Vec3(0.8f, 0.6f, 0.4f));
  add_sphere(balls, shiny, "one", Vec3(0.5f, 0, 0), 0.5f, 4);
  add_sphere(balls, shiny, "two", Vec3(-0.4f, 0.1f, 0), 0.35f, 4);
  BakeRequest r;
  r.loaded = std::make_shared<const Scene>(balls), r.scene = "balls", r.transfer = "matrix";
  r.brdf = "ggx:roughness=0.5", r.order = 4, r.incident_order = 6, r.samples = 512, r.bounces = "0", r.outgoing = "map";
  const auto own = bake(r);
  ASSERT_TRUE(own) << own.error().text();
  ASSERT_TRUE(save_baked(path("balls.glb"), *own));
  FieldRequest field{path("balls.glb"), path("balls.field.glb")};
  field.shells = 8, field.side = 8, field.samples = 64, field.given = {"shells", "side", "samples"};
  const auto made = field_to_file(field);
  ASSERT_TRUE(made) << made.error().text();
  DrawRequest d{.baked = "floor", .env = "made", .camera = "0,1,4,0,0,0,30", .size = "48x36"};
  d.spp = 16, d.background = "none", d.environment = std::make_shared<const Environment>(sharp_sun());
  d.place = {"a=" + path("balls.field.glb") + "@0.1,0.2,0,35,20,10"}, d.given = {"place"};
  const auto drawn = [&](const char* window) {
    d.window = window;
    auto drawing = draw(*scene, d);
    EXPECT_TRUE(drawing) << drawing.error().text();
    return drawing->frames[0];
  };
  const Image none = drawn("none"), held = drawn("auto");
  Scene joint = scene->scene, moved = own->scene;
  const Mat3 turn = rotation_from_yaw_pitch_roll({35, 20, 10});
  const Bounds box = bounds(moved);
  for (Vec3& p : moved.positions) p = Vec3(0.1f, 0.2f, 0) + turn * (p - 0.5f * (box.min + box.max));
  for (Vec3& n : moved.normals) n = turn * n;
  append_scene(joint, moved);
  const auto truth = path_trace(joint, *d.environment, parse_view(d.camera, d.size, joint)->camera,
                                {.width = 48,
                                 .height = 36,
                                 .spp = 256,
                                 .bounces = 0,
                                 .background = false,
                                 .reflection = *parse_reflection(r.brdf)});
  ASSERT_TRUE(truth) << truth.error().text();
  RecordProperty("least", std::to_string(least(none)) + " " + std::to_string(least(held)));
  RecordProperty("errors", std::to_string(error(none, truth->image)) + " " + std::to_string(error(held, truth->image)));
  EXPECT_LT(least(none), -0.05f);
  EXPECT_GE(least(held), 0);
  EXPECT_LT(error(held, truth->image), error(none, truth->image));
}

// A room that is open towards +x, where the sun stands that it was baked for.
Scene room() {
  Scene scene;
  const uint32_t white = add_material(scene, "white", Vec3(0.7f));
  const auto wall = [&](Vec3 low, Vec3 high) { add_box(scene, white, "wall", low, high, 12); };
  wall(Vec3(-1, -0.1f, -1), Vec3(1, 0, 1)), wall(Vec3(-1, 1.2f, -1), Vec3(1, 1.3f, 1));
  wall(Vec3(-1.1f, 0, -1), Vec3(-1, 1.2f, 1));
  wall(Vec3(-1, 0, -1.1f), Vec3(1, 1.2f, -1)), wall(Vec3(-1, 0, 1), Vec3(1, 1.2f, 1.1f));
  return scene;
}

TEST_F(DrawRings, LightThatLeavesItsLobesIsKeptFromRinging) {
  SKIP_UNDER_SANITIZERS();
  const std::string sky = "sky:elevation=30,azimuth=20,turbidity=3,width=256";
  BakeRequest r;
  r.loaded = std::make_shared<const Scene>(room()), r.scene = "room", r.light = "sh:5+lamps:1@" + sky;
  r.samples = 512, r.bounces = "0", r.given = {"light", "samples", "bounces"};
  const auto baked = bake(r);
  ASSERT_TRUE(baked) << baked.error().text();
  const auto env = load_environment(sky);
  ASSERT_TRUE(env);
  DrawRequest d{.baked = "room", .env = sky, .camera = "3,0.8,0.3,0,0.6,0,35", .size = "48x36"};
  d.spp = 8, d.background = "none";
  double sharp = 0;
  const auto drawn = [&](const char* window) {
    d.window = window;
    auto drawing = draw(*baked, d);
    EXPECT_TRUE(drawing) << drawing.error().text();
    sharp = drawing->summary.json["sharp_light"].get<double>();
    return drawing->frames[0];
  };
  const auto truth = [&](const Mat3& turn) {
    auto traced = path_trace(baked->scene, rotated(*env, turn), parse_view(d.camera, d.size, baked->scene)->camera,
                             {.width = 48, .height = 36, .spp = 256, .bounces = 0, .background = false});
    EXPECT_TRUE(traced) << traced.error().text();
    return traced->image;
  };
  const auto hold = [&](const std::string& what, const Mat3& turn, bool rings) {
    const Image none = drawn("none"), held = drawn("auto"), traced = truth(turn);
    const double before = error(none, traced), after = error(held, traced);
    RecordProperty(what, std::to_string(least(none)) + " " + std::to_string(before) + " " + std::to_string(after) +
                             " sharp " + std::to_string(sharp));
    EXPECT_LE(after, before * 1.001) << what;
    if (!rings) return;
    EXPECT_LT(least(none), -0.02f) << what;
    EXPECT_GE(least(held), 0) << what;
    EXPECT_LT(after, before) << what;
    EXPECT_GT(sharp, 0.05) << what;
  };
  hold("stands", Mat3(1.0f), false);
  d.env_rotate = "130,0,0";
  hold("turned", rotation_from_yaw_pitch_roll({130, 0, 0}), true);
  d.env_rotate = "", d.move = {"1@150,30"};
  const Image none = drawn("none"), held = drawn("auto");
  EXPECT_LT(least(none), -0.01f);
  EXPECT_GE(least(held), 0);
  EXPECT_GT(sharp, 0.05);
}

}  // namespace
}  // namespace lambent
