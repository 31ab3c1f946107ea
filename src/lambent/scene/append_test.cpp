#include <lambent/scene/append.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include "test_meshes.h"

namespace lambent {
namespace {

TEST(AppendScene, KeepsBothAsTheyWere) {
  Scene a = make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 2, 2, Vec3(0.2f, 0.4f, 0.6f)),
        b = make_sphere(0.5f, 1, Vec3(0.9f, 0.1f, 0.3f));
  Texture texture;
  texture.width = texture.height = 1, texture.rgb = {255, 0, 128};
  a.textures.push_back(texture);
  texture.rgb = {10, 200, 30};
  b.textures.push_back(texture);
  b.materials[0].base_color_texture = b.materials[0].metallic_roughness_texture = b.materials[0].emissive_texture = 0;
  b.materials[0].emissive = Vec3(2);
  b.tangents.assign(b.positions.size(), Vec4(1, 0, 0, -1));
  b.colors.assign(b.positions.size(), Vec3(0.5f));
  b.texcoords[1].assign(b.positions.size(), Vec2(0.25f, 0.75f));
  Scene both = a;
  append_scene(both, b);
  EXPECT_EQ(test::broken_invariant(both), "");
  ASSERT_EQ(both.triangles.size(), a.triangles.size() + b.triangles.size());
  for (size_t t = 0; t < both.triangles.size(); ++t) {
    const bool first = t < a.triangles.size();
    const Scene& from = first ? a : b;
    const Triangle& before = from.triangles[first ? t : t - a.triangles.size()];
    EXPECT_EQ(albedo(both, both.triangles[t], 0.2f, 0.3f), albedo(from, before, 0.2f, 0.3f));
    EXPECT_EQ(metallic_roughness(both, both.triangles[t], 0.2f, 0.3f), metallic_roughness(from, before, 0.2f, 0.3f));
    EXPECT_EQ(emission(both, both.triangles[t], 0.2f, 0.3f), emission(from, before, 0.2f, 0.3f));
    EXPECT_EQ(both.tangents[both.triangles[t].v[0]], first ? Vec4(0) : Vec4(1, 0, 0, -1));
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(both.positions[both.triangles[t].v[k]], from.positions[before.v[k]]);
      EXPECT_EQ(both.normals[both.triangles[t].v[k]], from.normals[before.v[k]]);
    }
  }
  EXPECT_EQ(both.texcoords[1].back(), Vec2(0.25f, 0.75f));
  EXPECT_TRUE(both.texcoords[0].empty());
}

TEST(AppendScene, PlacesTheMiddleOfTheBottom) {
  Scene s;
  add_box(s, add_material(s, "grey", Vec3(0.5f)), "box", Vec3(1, 2, 3), Vec3(3, 6, 9), 2);
  place_scene(s, Vec3(-5, 7, 11), 0.5f);
  const Bounds box = bounds(s);
  EXPECT_LT(length(box.min - Vec3(-5.5f, 7, 9.5f)), 1e-5f);
  EXPECT_LT(length(box.max - Vec3(-4.5f, 9, 12.5f)), 1e-5f);
}

}  // namespace
}  // namespace lambent
