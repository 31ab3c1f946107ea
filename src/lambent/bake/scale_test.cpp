// No length in the code but in units of the scene: the same scene in other units has the same transfer.
#include <lambent/bake/bake.h>
#include <lambent/receivers/atlas.h>
#include <lambent/receivers/receivers.h>
#include <lambent/scene/procedural.h>
#include <lambent/scene/refine.h>
#include <lambent/trace/tracer.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

Scene scaled(Scene scene, double scale) {
  for (Vec3& p : scene.positions) p = Vec3(Vec3d(p) * scale);
  return scene;
}

// A sphere between walls on a floor, smooth and sharp, touching and apart.
Scene corner() {
  Scene scene;
  const uint32_t stone = add_material(scene, "stone", Vec3(0.6f));
  add_sphere(scene, stone, "ball", Vec3(0.11f, 0.3f, 0.07f), 0.3f, 2);
  add_quad(scene, stone, "floor", Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 6, 6);
  add_box(scene, stone, "block", Vec3(-0.9f, 0, -0.8f), Vec3(-0.5f, 0.7f, -0.1f), 3);
  return scene;
}

std::vector<float> transfer_of(const Scene& scene) {
  auto tracer = Tracer::build(scene);
  EXPECT_TRUE(tracer);
  const Receivers receivers = make_vertex_receivers(scene);
  auto transfer = bake(scene, *tracer, receivers, {.order = 3, .samples = 64, .bounces = 2});
  EXPECT_TRUE(transfer);
  std::vector<float> values;
  for (size_t r = 0; r < transfer->receivers; ++r)
    for (float v : load_receiver(*transfer, r)) values.push_back(v);
  return values;
}

TEST(Scale, TransferIsTheSameInAnyUnit) {
  const std::vector<float> truth = transfer_of(corner());
  // Powers of two change no rounding.
  for (double scale : {0x1p-23, 0x1p20}) EXPECT_EQ(transfer_of(scaled(corner(), scale)), truth) << scale;
  for (double scale : {1e-7, 1e-6, 1e6}) {
    const std::vector<float> values = transfer_of(scaled(corner(), scale));
    ASSERT_EQ(values.size(), truth.size()) << scale;
    double squares = 0, all = 0;
    for (size_t i = 0; i < values.size(); ++i)
      squares += std::pow(double(values[i]) - double(truth[i]), 2), all += std::pow(double(truth[i]), 2);
    EXPECT_LT(std::sqrt(squares / all), 0.01) << scale;  // rays at edges fall on the other side
  }
}

TEST(Scale, AtlasIsTheSameInAnyUnit) {
  Scene one = corner();
  auto truth = make_atlas(one, {.width = 128, .height = 128});
  ASSERT_TRUE(truth);
  for (double scale : {0x1p-23, 0x1p20}) {
    Scene other = scaled(corner(), scale);
    auto atlas = make_atlas(other, {.width = 128, .height = 128});
    ASSERT_TRUE(atlas);
    EXPECT_EQ(atlas->charts, truth->charts) << scale;
    EXPECT_NEAR(atlas->texels_per_unit * scale, truth->texels_per_unit, 1e-3 * truth->texels_per_unit);
  }
}

}  // namespace
}  // namespace lambent
