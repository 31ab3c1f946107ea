// Transfer matrices by simulated paths, against the recursion where that is right and against the reference where it is
// not.
#include <lambent/bake/materials.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/light/project.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/relight/relight.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

// A rough floor before a metal wall that begins at `foot` above it, and whose cells can be coarse.
Scene bare_corner(int floor_cells, int wall_cells, float foot, float roughness, float metallic) {
  Scene scene;
  const uint32_t floor = add_material(scene, "floor", Vec3(0.7f, 0.5f, 0.4f)),
                 wall = add_material(scene, "wall", Vec3(0.9f, 0.7f, 0.3f));
  scene.materials[floor].metallic = 0, scene.materials[floor].roughness = 1;
  scene.materials[wall].metallic = metallic, scene.materials[wall].roughness = roughness;
  add_quad(scene, floor, "floor", Vec3(-1.5f, 0, -1), Vec3(0, 0, 2.5f), Vec3(3, 0, 0), floor_cells, floor_cells);
  add_quad(scene, wall, "wall", Vec3(-1.5f, foot, -1), Vec3(3, 0, 0), Vec3(0, 2, 0), wall_cells, wall_cells);
  return scene;
}

// The same with a box between.
Scene metal_corner(int wall_cells, float roughness, float metallic) {
  Scene scene = bare_corner(12, wall_cells, 0.05f, roughness, metallic);
  add_box(scene, 0, "box", Vec3(-0.2f, 0.05f, -0.1f), Vec3(0.4f, 0.7f, 0.4f), 4);
  return scene;
}

std::vector<Vec3> uneven_light(int order) {
  Random random(23);
  std::vector<Vec3> light(size_t(sh_count(order)));
  for (size_t k = 0; k < light.size(); ++k)
    light[k] = (Vec3(random.next(), random.next(), random.next()) - 0.5f) * 3.0f / float(1 + sh_band(int(k)));
  light[0] = Vec3(3, 2.5f, 2);
  return light;
}

struct Baking {
  Scene scene;
  Receivers receivers;
  MatrixBake baked;
  Relit relit;
  BakeReport report;
};

constexpr int light_order = 4;

Baking bake_corner(Scene scene, const Reflection& reflection, int samples, int bounces, bool simulate) {
  Baking b{std::move(scene), {}, {}, {}, {}};
  auto tracer = Tracer::build(b.scene);
  EXPECT_TRUE(tracer);
  b.receivers = make_vertex_receivers(b.scene);
  MatrixOptions matrix{.incident_order = 4, .outgoing = OutgoingKind::map, .grid = 16};
  matrix.simulate_paths = simulate;
  auto baked =
      bake_matrix(b.scene, *tracer, b.receivers, make_receiver_materials(b.scene, b.receivers, reflection),
                  {.order = light_order, .samples = samples, .bounces = bounces, .precision = Precision::single},
                  matrix, &b.report);
  EXPECT_TRUE(baked) << (baked ? "" : baked.error().text());
  if (baked) b.baked = std::move(*baked), relight(b.baked.transfer, uneven_light(light_order), b.relit);
  return b;
}

// Relative RMS over all rows of all receivers.
double apart(const Relit& a, const Relit& b, size_t receivers) {
  double difference = 0, total = 0;
  for (size_t r = 0; r < receivers; ++r)
    for (int row = 0; row < a.rows; ++row) {
      const Vec3 d = a.at(r, row) - b.at(r, row);
      difference += dot(d, d), total += dot(b.at(r, row), b.at(r, row));
    }
  return std::sqrt(difference / total);
}

Reflection by_materials() {
  Reflection r;
  r.model = Reflection::Model::materials;
  return r;
}

TEST(SimulatedPaths, AreTheRecursionWhereThatIsRight) {
  SKIP_UNDER_SANITIZERS();
  // Fine cells, smooth materials and no contact, beside which hats are wrong.
  for (const bool glossy : {false, true}) {
    const Scene scene = bare_corner(20, 20, 0.4f, glossy ? 0.7f : 1.0f, glossy ? 1.0f : 0.0f);
    const Reflection reflection = glossy ? by_materials() : Reflection{};
    const Baking recursion = bake_corner(scene, reflection, 4096, 2, false),
                 paths = bake_corner(scene, reflection, 4096, 2, true);
    const size_t n = paths.receivers.count();
    const double difference = apart(paths.relit, recursion.relit, n);
    RecordProperty(glossy ? "glossy" : "diffuse", std::to_string(difference));
    EXPECT_LT(difference,
              0.02);  // the noise of 4,096 paths in 16 rows, and what hats (glossy: and eight rows) leave out
    // Bounces are no small part of it, so that their absence would show.
    const Baking direct = bake_corner(scene, reflection, 4096, 0, false);
    EXPECT_GT(apart(direct.relit, paths.relit, n), 0.1);
  }
}

TEST(SimulatedPaths, CarryCausticsOffCoarseMetal) {
  SKIP_UNDER_SANITIZERS();
  const Scene scene = metal_corner(1, 0.25f, 1);
  const std::vector<Vec3> light = uneven_light(light_order);
  const Environment env = reconstruct_environment(light, 256);
  const Baking paths = bake_corner(scene, by_materials(), 4096, 2, true),
               recursion = bake_corner(scene, by_materials(), 4096, 2, false);
  std::vector<Vec3> origins, normals;
  std::vector<size_t> chosen;
  for (size_t r = 0; r < paths.receivers.count(); r += 3)
    if (paths.receivers.normals[r].y > 0.9f && paths.receivers.origins[r].y < 0.1f &&
        std::abs(paths.receivers.origins[r].x) < 1.4f)
      chosen.push_back(r), origins.push_back(paths.receivers.origins[r]), normals.push_back(paths.receivers.normals[r]);
  ASSERT_GT(chosen.size(), 20u);
  const auto truth = exit_radiances(scene, env, origins, normals, 2, 4096, 3, by_materials());
  double of_paths = 0, of_recursion = 0, total = 0;
  for (size_t i = 0; i < chosen.size(); ++i) {
    const Vec3 a = paths.relit.at(chosen[i]) - truth[i].mean, b = recursion.relit.at(chosen[i]) - truth[i].mean;
    of_paths += dot(a, a), of_recursion += dot(b, b), total += dot(truth[i].mean, truth[i].mean);
  }
  of_paths = std::sqrt(of_paths / total), of_recursion = std::sqrt(of_recursion / total);
  RecordProperty("paths", std::to_string(of_paths)), RecordProperty("recursion", std::to_string(of_recursion));
  EXPECT_LT(of_paths, 0.012);             // the noise of 4,096 paths on either side
  EXPECT_GT(of_recursion, 2 * of_paths);  // a wall of four receivers cannot carry it
}

TEST(SimulatedPaths, AreTheSameOnOneThread) {
  const Baking two = bake_corner(metal_corner(2, 0.3f, 1), by_materials(), 64, 3, true);
  EXPECT_GT(two.report.error, 0);
  ThreadLimit one(1);
  const Baking alone = bake_corner(metal_corner(2, 0.3f, 1), by_materials(), 64, 3, true);
  EXPECT_TRUE(std::equal(two.baked.transfer.data.begin(), two.baked.transfer.data.end(),
                         alone.baked.transfer.data.begin(), alone.baked.transfer.data.end()));
}

}  // namespace
}  // namespace lambent
