// Coordinates far from 0: Scene::origin.
#include <lambent/scene/gltf.h>
#include <lambent/scene/load.h>
#include <lambent/scene/mesh_file.h>
#include <lambent/scene/refine.h>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "temporary_folder.h"
#include "test_meshes.h"

namespace lambent {
namespace {

Scene must_load(const std::string& text) {
  auto scene = load_obj(test::bytes_of(text), "t.obj", "");
  EXPECT_TRUE(scene) << scene.error().text();
  return scene ? *scene : test::bare_cube();
}

TEST(Origin, IsNearBoxesThatAreFarAlone) {
  EXPECT_EQ(far_origin(Vec3d(INFINITY), Vec3d(-INFINITY)), Vec3d(0));
  EXPECT_EQ(far_origin(Vec3d(-1, 0, 0), Vec3d(1, 2, 99)), Vec3d(0));
  EXPECT_EQ(far_origin(Vec3d(50, 0, 0), Vec3d(51, 1, 1)), Vec3d(0));
  EXPECT_EQ(far_origin(Vec3d(1000, 0, -2000), Vec3d(1001, 1, -1999)), Vec3d(1001, 1, -2000));
  for (double scale : {1e-7, 1e-3, 1.0, 1e6}) {
    const Vec3d low = Vec3d(5e5, 250, 5.4e6) * scale, high = Vec3d(5e5 + 700, 300, 5.4e6 + 900) * scale,
                origin = far_origin(low, high);
    for (size_t k = 0; k < 3; ++k) EXPECT_LT(std::abs((low[k] + high[k]) / 2 - origin[k]), 1024 * scale) << scale;
  }
}

TEST(Origin, SurveyedCoordinatesKeepTheirMillimetres) {
  // A shed of 4 x 3 x 5 m in UTM coordinates whose corners have millimetres; the same about 0 is the truth.
  const Vec3d size(4.123, 3.017, 5.031), far(431234.567, 251.25, 5412345.678);
  for (double sign : {1.0, -1.0}) {
    std::string near_text, far_text;
    for (int i = 0; i < 8; ++i) {
      Vec3d p(i & 1 ? size.x : 0, i & 2 ? size.y : 0, i & 4 ? size.z : 0), q = p + far * sign;
      near_text += fmt::format("v {:.3f} {:.3f} {:.3f}\n", p.x, p.y, p.z);
      far_text += fmt::format("v {:.3f} {:.3f} {:.3f}\n", q.x, q.y, q.z);
    }
    const std::string faces = "f 1 5 7 3\nf 2 4 8 6\nf 1 2 6 5\nf 3 7 8 4\nf 1 3 4 2\nf 5 6 8 7\n";
    Scene near = must_load(near_text + faces), far_scene = must_load("v 0 0 0\n" + far_text + "f -8 -4 -2 -6\n" +
                                                                     "f -7 -5 -1 -3\nf -8 -7 -3 -4\nf -6 -2 -1 -5\n"
                                                                     "f -8 -6 -5 -7\nf -4 -3 -1 -2\n");
    EXPECT_EQ(near.origin, Vec3d(0));
    EXPECT_NE(far_scene.origin, Vec3d(0));
    ASSERT_EQ(far_scene.positions.size(), near.positions.size());
    for (size_t v = 0; v < near.positions.size(); ++v) {
      Vec3d p = Vec3d(far_scene.positions[v]) + far_scene.origin - far * sign;
      EXPECT_LT(length(p - Vec3d(near.positions[v])), 2e-6) << v;  // half a float's step at 16 m, thrice
    }
    for (int k = 0; k < 3; ++k) EXPECT_EQ(far_scene.origin[k], double(float(far_scene.origin[k])));
  }
}

TEST(Origin, FarSceneComesBackToTheBit) {
  // A cube of millimetres in surveyed coordinates: from the OBJ, through the file and, with a floor, through it again.
  std::string obj = "o shed\n";
  for (int i = 0; i < 8; ++i)
    obj += "v " + std::string(i & 1 ? "500004.127" : "500000.004") + (i & 2 ? " 253.011 " : " 250.002 ") +
           (i & 4 ? "5400003.119\n" : "5399998.008\n");
  obj += "f 1 5 7 3\nf 2 4 8 6\nf 1 2 6 5\nf 3 7 8 4\nf 1 3 4 2\nf 5 6 8 7\n";
  auto scene = load_obj({reinterpret_cast<const uint8_t*>(obj.data()), obj.size()}, "t.obj", "");
  ASSERT_TRUE(scene);
  ASSERT_NE(scene->origin, Vec3d(0));
  test::TemporaryFolder folder;
  auto round_trip = [&](const Scene& s) {
    auto saved = save_gltf(folder.file("a.glb"), s, {}, {});
    EXPECT_TRUE(saved);
    auto loaded = load_scene(folder.file("a.glb"));
    EXPECT_TRUE(loaded);
    return loaded ? *loaded : Scene();
  };
  const Scene once = round_trip(*scene);
  EXPECT_EQ(once.origin, scene->origin);
  EXPECT_EQ(once.positions, scene->positions);
  EXPECT_EQ(once.normals, scene->normals);
  const auto node = once.document->json["nodes"][0];
  for (size_t k = 0; k < 3; ++k) EXPECT_EQ(node["translation"][k].get<double>(), scene->origin[k]);
  Scene grounded = once;
  for (Vec3& p : grounded.positions) p = p * 2.0f;  // so that the part is written anew, in the frame of its node
  grounded.parts[0].changed = true;
  add_ground(grounded);
  const Scene twice = round_trip(grounded);
  EXPECT_EQ(twice.origin, scene->origin);
  ASSERT_EQ(twice.positions.size(), grounded.positions.size());
  for (size_t v = 0; v < twice.positions.size(); ++v) EXPECT_EQ(twice.positions[v], grounded.positions[v]);
}

}  // namespace
}  // namespace lambent
