#include <lambent/scene/exclude.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

Scene three_parts(bool with_dome) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.5f)), sky = add_material(scene, "sky", Vec3(1));
  scene.materials[sky].unlit = true;
  add_quad(scene, grey, "floor", Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 2, 3);
  if (with_dome) add_box(scene, sky, "dome", Vec3(-9), Vec3(9), 2, true);
  add_sphere(scene, grey, "ball", Vec3(0, 1, 0), 0.5f, 1);
  scene.colors.clear();
  for (Vec3 p : scene.positions) scene.colors.push_back(abs(p) * 0.1f);
  return scene;
}

TEST(ExcludeParts, LeaveTheSceneThatNeverHadThem) {
  const Scene expected = three_parts(false);
  for (const char* word : {"dome", "sky", "unlit"}) {
    Scene scene = three_parts(true);
    const std::vector<std::string> words{word, "nobody"};
    EXPECT_EQ(exclude_parts(scene, words), std::vector<std::string>{"nobody"});
    EXPECT_EQ(scene.excluded, std::vector<std::string>{word});
    EXPECT_EQ(scene.positions, expected.positions);
    EXPECT_EQ(scene.normals, expected.normals);
    EXPECT_EQ(scene.colors, expected.colors);
    EXPECT_EQ(scene.texcoords, expected.texcoords);
    ASSERT_EQ(scene.parts.size(), 2u);
    EXPECT_EQ(scene.parts[1].name, "ball");
    EXPECT_EQ(scene.parts[1].first_triangle, expected.parts[1].first_triangle);
    ASSERT_EQ(scene.triangles.size(), expected.triangles.size());
    for (size_t t = 0; t < scene.triangles.size(); ++t) {
      EXPECT_EQ(scene.triangles[t].part, expected.triangles[t].part);
      for (int k = 0; k < 3; ++k) EXPECT_EQ(scene.triangles[t].v[k], expected.triangles[t].v[k]);
    }
  }
}

}  // namespace
}  // namespace lambent
