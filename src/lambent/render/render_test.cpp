#include <lambent/bake/materials.h>
#include <lambent/bake/matrix.h>
#include <lambent/core/random.h>
#include <lambent/render/render.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

Scene red_and_green() {
  Scene scene;
  add_quad(scene, add_material(scene, "floor", Vec3(0.8f, 0.2f, 0.1f)), "floor", Vec3(-1, 0, -1), Vec3(0, 0, 2),
           Vec3(2, 0, 0), 6, 6);
  add_box(scene, add_material(scene, "block", Vec3(0.2f, 0.7f, 0.3f)), "block", Vec3(-0.4f, 0.01f, -0.4f),
          Vec3(0.2f, 0.8f, 0.2f), 3);
  return scene;
}

struct View {
  Camera camera{Vec3(1.5f, 1.8f, 2.2f), Vec3(0, 0.2f, 0), Vec3(0, 1, 0), 50};
  RenderOptions options{24, 18, 9};
};

void expect_same_pictures(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                          const Transfer& transfer, const Outgoing* outgoing) {
  View v;
  v.options.outgoing = outgoing;
  auto fixed = fix_view(scene, tracer, receivers.basis, transfer, v.camera, v.options);
  ASSERT_TRUE(fixed);
  EXPECT_EQ(fixed->transfer.receivers, size_t(24 * 18));
  EXPECT_EQ(fixed->transfer.rows, 1);
  EXPECT_EQ(fixed->transfer.channels, 3);
  Random random(4);
  for (int turn = 0; turn < 2; ++turn) {
    std::vector<Vec3> light(transfer.columns());
    for (Vec3& l : light) l = Vec3(random.next(), random.next(), random.next()) - 0.3f;
    Relit relit, pixels;
    relight(transfer, light, relit);
    relight(fixed->transfer, light, pixels);
    auto drawn = render(scene, tracer, receivers.basis, relit, v.camera, v.options);
    ASSERT_TRUE(drawn);
    const Image image = pixels_image(pixels, fixed->coverage, v.camera, 24, 18, nullptr);
    size_t covered = 0;
    for (size_t i = 0; i < image.rgb.size(); ++i) {
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(image.rgb[i][c], drawn->rgb[i][c], 2e-5f * (1 + std::abs(drawn->rgb[i][c]))) << i;
      EXPECT_EQ(image.alpha[i], drawn->alpha[i]);
      covered += image.alpha[i] > 0;
    }
    EXPECT_GT(covered, 100u);
    EXPECT_LT(covered, size_t(24 * 18));
  }
}

// Whether light comes first or the view, the picture is the same: (O T) light = O (T light).
TEST(Render, FixedViewIsThePictureForAnyLight) {
  const Scene scene = red_and_green();
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  BakeOptions options{.order = 3, .samples = 64, .bounces = 1, .precision = Precision::single};
  auto coloured = bake(scene, *tracer, receivers, options);
  ASSERT_TRUE(coloured);
  ASSERT_EQ(coloured->channels, 3);
  expect_same_pictures(scene, *tracer, receivers, *coloured, nullptr);
  options.bounces = 0;
  auto grey = bake(scene, *tracer, receivers, options);
  ASSERT_EQ(grey->channels, 1);
  expect_same_pictures(scene, *tracer, receivers, *grey, nullptr);
  for (OutgoingKind kind : {OutgoingKind::map, OutgoingKind::sh, OutgoingKind::directional}) {
    auto glossy = bake_matrix(
        scene, *tracer, receivers, make_receiver_materials(scene, receivers, {.everywhere = Ggx{.alpha = Vec2(0.2f)}}),
        options, {.incident_order = 3, .outgoing = kind, .outgoing_order = 3, .grid = 8, .response_samples = 64});
    ASSERT_TRUE(glossy);
    expect_same_pictures(scene, *tracer, receivers, glossy->transfer, &glossy->outgoing);
  }
}

// Closed form: an open white plane that fills the picture, under light of one colour: exit radiance is that colour.
TEST(Render, FixedViewOfAnOpenPlaneIsTheLightItself) {
  const Scene scene = make_quad(Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 2, 2, Vec3(1));
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  auto transfer = bake(scene, *tracer, receivers, {.order = 2, .shadows = false, .precision = Precision::single});
  auto fixed = fix_view(scene, *tracer, receivers.basis, *transfer,
                        Camera{Vec3(0, 1, 0.01f), Vec3(0), Vec3(0, 1, 0), 20}, {4, 4, 4});
  ASSERT_TRUE(fixed);
  std::vector<Vec3> light(4, Vec3(0.0f));
  light[0] = Vec3(0.5f, 1, 2) * std::sqrt(4 * pi);
  Relit pixels;
  relight(fixed->transfer, light, pixels);
  for (size_t i = 0; i < 16; ++i) {
    EXPECT_EQ(fixed->coverage[i], 1.0f);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(pixels.at(i)[c], (Vec3(0.5f, 1, 2))[c], 1e-5f);
  }
}

}  // namespace
}  // namespace lambent
