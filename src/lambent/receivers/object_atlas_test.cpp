#include <lambent/receivers/atlas.h>
#include <lambent/receivers/object_atlas.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// What a bilinear look-up finds in a picture, texels beside its border clamped.
float look_up(const std::vector<float>& picture, int width, int height, Vec2 at) {
  const float x = std::clamp(at.x - 0.5f, 0.0f, float(width - 1)), y = std::clamp(at.y - 0.5f, 0.0f, float(height - 1));
  const int i = std::min(int(x), std::max(0, width - 2)), j = std::min(int(y), std::max(0, height - 2));
  const float s = x - float(i), t = y - float(j);
  auto value = [&](int a, int b) { return picture[size_t(std::min(b, height - 1) * width + std::min(a, width - 1))]; };
  return (1 - t) * ((1 - s) * value(i, j) + s * value(i + 1, j)) +
         t * ((1 - s) * value(i, j + 1) + s * value(i + 1, j + 1));
}

TEST(ObjectAtlas, FindsTheWholeAtlasValues) {
  Scene scene;
  const uint32_t m = add_material(scene, "grey", Vec3(0.5f));
  add_box(scene, m, "box", Vec3(-1), Vec3(2, 1, 1.5f), 2, true);
  add_sphere(scene, m, "ball", Vec3(0.2f, 0.1f, 0), 0.4f, 2);
  add_box(scene, m, "box", Vec3(3, 0, 0), Vec3(4, 1, 1), 1, false);
  add_quad(scene, m, "sheet", Vec3(-0.5f, 0.6f, -0.5f), Vec3(0.7f, 0.2f, 0), Vec3(0, 0.1f, 0.8f), 3, 2);
  for (Triangle& t : scene.triangles) t.two_sided = scene.parts[t.part].name == "sheet";
  auto atlas = make_atlas(scene, {.texels_per_unit = 9});
  ASSERT_TRUE(atlas);
  const Receivers receivers = make_texel_receivers(scene, *atlas);
  const auto whole = std::get<TexelReceivers>(receivers.basis);
  std::vector<float> picture(size_t(whole.width) * size_t(whole.height));
  for (size_t i = 0; i < picture.size(); ++i) picture[i] = float(i * 7919 % 1000);
  TexelReceivers split = whole;
  const std::vector<ObjectAtlas> objects = split_atlas(scene, split);
  ASSERT_EQ(objects.size(), scene.parts.size());
  EXPECT_EQ(objects[0].name, "box");
  EXPECT_EQ(objects[2].name, "box_2");
  size_t looked = 0;
  for (const ObjectAtlas& object : objects) {
    const std::vector<float> own = values_of(object, picture);
    ASSERT_EQ(own.size(), size_t(object.width) * size_t(object.height));
    for (size_t i = 0; i < scene.triangles.size(); ++i) {
      if (scene.triangles[i].part != object.parts[0]) continue;
      for (bool front : {true, false}) {
        const TexelTriangle *a = whole.find(uint32_t(i), front), *b = split.find(uint32_t(i), front);
        ASSERT_EQ(a == nullptr, b == nullptr);
        if (!a) continue;
        const Vec2 size(float(object.width) / float(whole.width), float(object.height) / float(whole.height));
        for (const Vec3& w : {Vec3(1, 0, 0), Vec3(0.2f, 0.5f, 0.3f), Vec3(0.4f, 0, 0.6f)}) {
          const Vec2 there = w.x * a->at[0] + w.y * a->at[1] + w.z * a->at[2],
                     here = (w.x * b->at[0] + w.y * b->at[1] + w.z * b->at[2]) * size;
          EXPECT_NEAR(look_up(picture, whole.width, whole.height, there),
                      look_up(own, object.width, object.height, here), 0.5f);
          ++looked;
        }
      }
    }
  }
  EXPECT_GT(looked, 500u);
}

}  // namespace
}  // namespace lambent
