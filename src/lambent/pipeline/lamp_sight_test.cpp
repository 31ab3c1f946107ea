// Lamps that move over a scene, among objects, against the path tracer's joint scene.
#include <lambent/bake/bake.h>
#include <lambent/bake/shells.h>
#include <lambent/pipeline/lamp_sight.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/scene/append.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lambent {
namespace {

struct Placed {
  Scene scene;
  HiddenLight hides;
  ShiningLight shines;
  PlacedObject object;
  PlacedLamp lamp;
  Placed(Scene s, int order, Vec3 emissive, const RigidPlace& place) : scene(std::move(s)) {
    scene.materials[0].emissive = emissive;
    const ShellOptions options{.order = order, .samples = 256};
    auto tracer = Tracer::build(scene);
    auto shells = make_shells(scene, options);
    hides = hidden_light(*bake_hidden(*tracer, *shells, options), order);
    object = place_object(hides, place);
    if (emissive == Vec3(0.0f)) return;
    shines = shining_light(*bake_shining(scene, *tracer, *shells, options), order);
    lamp = place_lamp(shines, place);
  }
  Scene there() const {
    Scene out = scene;
    const RigidPlace& at = object.place;
    for (Vec3& p : out.positions) p = at.position + at.scale * (at.rotation * (p - hides.shells.center));
    for (Vec3& n : out.normals) n = at.rotation * n;
    return out;
  }
};

// Of a square lamp over a floor with a wall, a ball between or not, by fields of that order.
double joint_decibels(int order, bool with_ball) {
  Scene scene;
  add_quad(scene, add_material(scene, "floor", Vec3(0.7f)), "floor", Vec3(-3, 0, -3), Vec3(0, 0, 6), Vec3(6, 0, 0), 24,
           24);
  add_box(scene, add_material(scene, "wall", Vec3(0.6f)), "wall", Vec3(1.2f, 0, -2), Vec3(1.4f, 1.5f, 2), 10);
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  const WritableTransfer none = make_transfer({.order = 1}, 1, 1, receivers.count(), Precision::single);
  const MovingReceivers moving = moving_receivers(none.transfer, receivers.origins, receivers.normals);
  const Placed lamp(make_quad(Vec3(-1, 0, -1), Vec3(2, 0, 0), Vec3(0, 0, 2), 4, 4, Vec3(0.0f)), order, Vec3(4, 3, 2),
                    {Vec3(-0.8f, 2, 0), rotation_from_yaw_pitch_roll({20, 10, 15}), 0.5f});
  const Placed ball(make_sphere(0.5f, 3, Vec3(0.5f)), order, Vec3(0.0f), {Vec3(-1.2f, 0.9f, 0.5f), Mat3(1.0f), 0.8f});
  const Bounds box = bounds(scene);
  const std::vector<ShiningPoint> points = shining_points(lamp.scene, 32);
  const std::vector<float> open =
      lamp_in_sight(*tracer, length(box.max - box.min), moving, points, lamp.hides.shells.center, lamp.lamp.place);
  const SeenLamp lamps[] = {{&lamp.lamp, &lamp.object, open}};
  const std::vector<const PlacedObject*> objects{&lamp.object, with_ball ? &ball.object : &lamp.object};
  Relit relit;
  relit.values.assign((moving.count + transfer_block - 1) / transfer_block * 3 * transfer_block, 0.0f);
  LampShader().add(moving, lamps, objects, LampResponse::cosine, relit);
  Scene joint = scene;
  append_scene(joint, lamp.there());
  if (with_ball) append_scene(joint, ball.there());
  std::vector<Vec3> at, normals, ours;
  for (size_t r = 0; r < receivers.count(); r += 3)
    at.push_back(receivers.origins[r]), normals.push_back(receivers.normals[r]), ours.push_back(relit.at(r));
  double squares = 0, peak = 0;
  const Environment night = make_environment("night", 16, 8, [](Vec3) { return Vec3(0.0f); });
  const auto truth = exit_radiances(joint, night, at, normals, 0, 256, 3, {}, true);
  for (size_t i = 0; i < at.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      squares += std::pow(double(ours[i][c] - truth[i].mean[c]), 2);
      peak = std::max(peak, double(truth[i].mean[c]));
    }
  return 10 * std::log10(peak * peak * 3 * double(at.size()) / squares);
}

TEST(LampSight, ALampOverASceneWithAWallIsAsThePathTracerSays) {
  SKIP_UNDER_SANITIZERS();
  const double decibels = joint_decibels(4, false);
  RecordProperty("decibels", std::to_string(decibels));
  EXPECT_GT(decibels, 30);
}

TEST(LampSight, AndSoItIsWhereABallIsInItsWay) {
  SKIP_UNDER_SANITIZERS();
  const double decibels = joint_decibels(8, true);
  RecordProperty("decibels", std::to_string(decibels));
  EXPECT_GT(decibels, 35);
}

TEST(LampSight, PointsLieOnWhatShinesAlone) {
  Scene scene = make_quad(Vec3(0, 0, 0), Vec3(0, 0, 1), Vec3(1, 0, 0), 2, 2, Vec3(0.5f));
  EXPECT_TRUE(shining_points(scene, 8).empty());
  const uint32_t lamp = add_material(scene, "lamp", Vec3(0.0f));
  scene.materials[lamp].emissive = Vec3(1.0f);
  add_quad(scene, lamp, "lamp", Vec3(5, 0, 0), Vec3(0, 0, 1), Vec3(1, 0, 0), 2, 2);
  const std::vector<ShiningPoint> points = shining_points(scene, 64);
  ASSERT_EQ(points.size(), 64u);
  Vec3 mean(0.0f);
  for (const ShiningPoint& p : points) mean += p.position / 64.0f;
  EXPECT_NEAR(mean.x, 5.5f, 0.05f);
  EXPECT_NEAR(mean.z, 0.5f, 0.05f);
}

}  // namespace
}  // namespace lambent
