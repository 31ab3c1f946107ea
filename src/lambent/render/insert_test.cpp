#include <lambent/bake/lattice.h>
#include <lambent/bake/matrix.h>
#include <lambent/core/random.h>
#include <lambent/light/project.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/render/insert.h>
#include <lambent/scene/append.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

// A room open above and in front, every wall in a colour of its own, with a block in it.
Scene coloured_room() {
  Scene scene;
  const int n = 24;
  add_quad(scene, add_material(scene, "floor", Vec3(0.8f, 0.7f, 0.3f)), "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4),
           Vec3(4, 0, 0), n, n);
  add_quad(scene, add_material(scene, "back", Vec3(0.3f, 0.8f, 0.4f)), "back", Vec3(-2, 0, -2), Vec3(4, 0, 0),
           Vec3(0, 3, 0), n, n);
  add_quad(scene, add_material(scene, "left", Vec3(0.9f, 0.2f, 0.1f)), "left", Vec3(-2, 0, -2), Vec3(0, 3, 0),
           Vec3(0, 0, 4), n, n);
  add_box(scene, add_material(scene, "block", Vec3(0.2f, 0.3f, 0.9f)), "block", Vec3(0.2f, 0.01f, -1.0f),
          Vec3(1.2f, 1.4f, 0), 8);
  return scene;
}

std::vector<Vec3> uneven_light(int order) {
  Random random(11);
  std::vector<Vec3> light(size_t(sh_count(order)));
  for (size_t k = 0; k < light.size(); ++k)
    light[k] = (Vec3(random.next(), random.next(), random.next()) - 0.5f) * 2.0f / float(1 + sh_band(int(k)));
  light[0] = Vec3(3, 2.5f, 2);
  return light;
}

constexpr int light_order = 4, lattice_order = 6;

struct Room {
  Scene scene = coloured_room();
  Tracer tracer = *Tracer::build(scene);
  Receivers receivers = make_vertex_receivers(scene);
  std::vector<Vec3> light = uneven_light(light_order);
};

RelitScene relit_scene(const Room& room, const Transfer& transfer, std::optional<Outgoing> outgoing = {}) {
  RelitScene drawn{room.scene, room.receivers.front, room.receivers.back, room.receivers.count(),
                   {},         std::move(outgoing)};
  relight(transfer, room.light, drawn.relit);
  return drawn;
}

struct Ball {
  Scene scene = make_sphere(0.02f, 1, Vec3(0.5f));
  Receivers receivers;
  Transfer transfer;
  explicit Ball(Vec3 foot) {
    place_scene(scene, foot, 1);
    auto tracer = Tracer::build(scene);
    receivers = make_vertex_receivers(scene);
    transfer = *bake(scene, *tracer, receivers,
                     {.order = lattice_order, .samples = 2048, .bounces = 1, .precision = Precision::single});
  }
};

// Relative RMS difference of the balls' exit radiance from the path tracer's, whose rays know nothing of them.
double error_of_balls(const Room& room, const Transfer& transfer, const Lattice& lattice,
                      const LatticeTransfer& free_space, std::span<const Vec3> feet, int surface_bounces) {
  Relit light;
  relight(free_space.transfer, room.light, light);
  const Environment env = reconstruct_environment(room.light, 256);
  double difference = 0, total = 0;
  for (const Vec3& foot : feet) {
    const Ball ball(foot);
    RelitScene drawn = relit_scene(room, transfer);
    const size_t first = drawn.receivers;
    EXPECT_TRUE(insert_object(drawn, ball.scene, ball.receivers, ball.transfer, lattice, light));
    const auto truth =
        exit_radiances(room.scene, env, ball.receivers.origins, ball.receivers.normals, surface_bounces + 1, 2048, 7);
    for (size_t r = 0; r < truth.size(); ++r) {
      const Vec3d d = Vec3d(drawn.relit.at(first + r)) - Vec3d(truth[r].mean), t(truth[r].mean);
      difference += dot(d, d), total += dot(t, t);
    }
  }
  return std::sqrt(difference / total);
}

TEST(Insert, LightsATinyBallAsThePathTracerDoes) {
  SKIP_UNDER_SANITIZERS();
  const Room room;
  auto transfer = bake(room.scene, room.tracer, room.receivers, {.order = light_order, .samples = 1024, .bounces = 2});
  ASSERT_TRUE(transfer);
  auto at_points = [&](const Lattice& lattice, std::span<const Vec3> feet) {
    auto free_space = bake_lattice(room.scene, room.tracer, room.receivers, *transfer, nullptr, lattice,
                                   {.order = lattice_order, .samples = 4096});
    EXPECT_TRUE(free_space);
    return error_of_balls(room, *transfer, lattice, *free_space, feet, 2);
  };
  // At the lattice's points, in four corners of the room: what six bands leave out (a cosine's seventh is 1/64), the
  // noise of both.
  const Lattice corners{Vec3(-1.9f, 0.12f, -1.88f), Vec3(1.5f, 0.12f, -1.2f), 2, 1, 2};
  std::vector<Vec3> feet;
  for (size_t p = 0; p < corners.count(); ++p) feet.push_back(corners.position(p) - Vec3(0, 0.02f, 0));
  const double error = at_points(corners, feet);
  RecordProperty("error_at_points", std::to_string(error));
  EXPECT_LT(error, 0.015);
  // Between points a quarter of a metre apart light is nearly linear, as near to walls as half of that.
  const Lattice room_lattice{Vec3(-1.95f, 0.05f, -1.95f), Vec3(1.95f, 2.8f, 1.95f), 16, 12, 16};
  const double between = at_points(
      room_lattice, std::vector<Vec3>{Vec3(-1.81f, 0.15f, -1.77f), Vec3(-0.33f, 0.4f, -0.6f), Vec3(0.9f, 1.9f, -0.4f)});
  RecordProperty("error_between_points", std::to_string(between));
  EXPECT_LT(between, 0.02);
}

TEST(Insert, DrawsADiffuseObjectAmongGlossyRows) {
  const Room room;
  const Ball ball(Vec3(-1, 0.5f, 1));
  const BakeOptions options{.order = light_order, .samples = 64, .bounces = 0, .precision = Precision::single};
  ReceiverMaterials materials;
  materials.materials = {{MetallicRoughness{Vec3(0), 0, 0.4f}, MetallicRoughness{Vec3(1), 0, 0.4f}}};
  materials.of_receiver.assign(room.receivers.count(), 0);
  for (const Vec3& n : room.receivers.normals) materials.frames.push_back(frame_about(n));
  auto diffuse = bake(room.scene, room.tracer, room.receivers, options);
  ASSERT_TRUE(diffuse);
  const Lattice lattice{Vec3(-1.5f, 0.2f, -1.5f), Vec3(1.5f, 2, 1.5f), 3, 2, 3};
  auto free_space = bake_lattice(room.scene, room.tracer, room.receivers, *diffuse, nullptr, lattice,
                                 {.order = lattice_order, .samples = 64});
  ASSERT_TRUE(free_space);
  Relit light;
  relight(free_space->transfer, room.light, light);
  const size_t first = room.receivers.count();
  RelitScene plain = relit_scene(room, *diffuse);
  ASSERT_TRUE(insert_object(plain, ball.scene, ball.receivers, ball.transfer, lattice, light));
  EXPECT_EQ(plain.receivers, first + ball.receivers.count());
  EXPECT_EQ(plain.front.size(), plain.scene.positions.size());
  const Relit before = relit_scene(room, *diffuse).relit;
  for (size_t r = 0; r < first; ++r) EXPECT_EQ(plain.relit.at(r), before.at(r));

  for (OutgoingKind kind : {OutgoingKind::map, OutgoingKind::svd, OutgoingKind::sh, OutgoingKind::hemisphere,
                            OutgoingKind::hsh, OutgoingKind::directional}) {
    auto glossy = bake_matrix(room.scene, room.tracer, room.receivers, materials, options,
                              {.incident_order = 3, .outgoing = kind, .outgoing_order = 3, .grid = 8});
    ASSERT_TRUE(glossy);
    RelitScene drawn = relit_scene(room, glossy->transfer, glossy->outgoing);
    const RelitScene alone = drawn;
    auto ok = insert_object(drawn, ball.scene, ball.receivers, ball.transfer, lattice, light);
    if (kind != OutgoingKind::map && kind != OutgoingKind::svd) {
      ASSERT_FALSE(ok);
      EXPECT_NE(ok.error().message.find(outgoing_names[int(kind)]), std::string::npos);
      continue;
    }
    ASSERT_TRUE(ok) << ok.error().text();
    std::vector<ViewWeights> weights(size_t(drawn.relit.rows)), unchanged(weights);
    for (size_t r = 0; r < drawn.receivers; ++r) {
      const Vec3 view = normalize_or(Vec3(0.3f, 0.8f, -0.4f), Vec3(0)), colour(0.2f, 0.5f, 0.9f);
      evaluate_outgoing(*drawn.outgoing, r, view, weights);
      const Vec3 radiance = reflect_rows(weights, colour, [&](size_t row) { return drawn.relit.at(r, int(row)); });
      if (r < first) {
        evaluate_outgoing(*alone.outgoing, r, view, unchanged);
        EXPECT_EQ(radiance, reflect_rows(unchanged, colour, [&](size_t row) { return alone.relit.at(r, int(row)); }));
      } else {
        EXPECT_LT(length(radiance - colour * plain.relit.at(r)), 1e-5f);
      }
    }
  }
}

}  // namespace
}  // namespace lambent
