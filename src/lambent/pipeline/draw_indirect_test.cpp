#include <lambent/baked/baked_file.h>
#include <lambent/pipeline/draw.h>
#include <lambent/pipeline/golden_test-inl.h>
#include <lambent/pipeline/parse.h>
#include <lambent/reference/path_tracer.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// No lamp is its own.
Baked room() {
  auto baked = load_baked(test::golden_request("indirect").baked);
  EXPECT_TRUE(baked);
  return std::move(*baked);
}
// The last triangle glows to both sides, and is the group "panel".
Baked room_with_panel() {
  Baked baked = room();
  Scene& scene = baked.scene;
  const Triangle last = scene.triangles.back();
  Material panel = scene.materials[scene.parts[last.part].material];
  panel.name = "panel", panel.emissive = Vec3(3, 2, 1);
  scene.materials.push_back(panel);
  Part part = scene.parts[last.part];
  part.material = uint32_t(scene.materials.size() - 1);
  scene.parts.push_back(part);
  scene.triangles.back().part = uint32_t(scene.parts.size() - 1), scene.triangles.back().two_sided = true;
  return baked;
}

DrawRequest request() {
  DrawRequest r = test::golden_request("indirect");
  r.lamp.clear(), r.background = "none", r.spp = 16;
  return r;
}

Image drawn(const Baked& baked, const DrawRequest& r) {
  auto drawing = draw(baked, r);
  EXPECT_TRUE(drawing) << drawing.error().text();
  return std::move(drawing->frames.at(0));
}

double mean(const Image& image) {
  double sum = 0;
  for (Vec3 v : image.rgb) sum += double(v.x) + v.y + v.z;
  return sum / double(3 * image.rgb.size());
}

double truth(const Scene& scene, const DrawRequest& r) {
  const auto view = parse_view(r.camera, r.size, scene);
  const Environment env = *load_environment(r.env.empty() ? "uniform:0" : r.env);
  const auto traced = path_trace(scene, env, view->camera,
                                 {.width = view->width,
                                  .height = view->height,
                                  .spp = 1024,
                                  .bounces = 16,
                                  .background = false,
                                  .lamps = true,
                                  .direct = r.show != "indirect"});
  EXPECT_TRUE(traced);
  return mean(traced->image);
}

TEST(IndirectDrawing, OwnLampsLightAsLampsThatMoveDo) {
  Baked baked = room();
  DrawRequest r = request();
  r.lamp.push_back("point@1,1,1.2=3,2,1");
  const Image moving = drawn(baked, r);
  EXPECT_GT(mean(moving), 0.01);
  baked.scene.lights = {{.name = "bulb", .position = Vec3(1, 1, 1.2f), .intensity = Vec3(3, 2, 1)}};
  r.lamp.pop_back();
  const Image own = drawn(baked, r);
  for (size_t i = 0; i < own.rgb.size(); ++i)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(own.rgb[i][c], moving.rgb[i][c], 1e-4 * double(moving.rgb[i][c]) + 1e-6);
  r.lamp.push_back("bulb=2");
  EXPECT_NEAR(mean(drawn(baked, r)), 2 * mean(own), 1e-4 * mean(own));
}

TEST(IndirectDrawing, GlowingSurfacesAreLampsAndAreSeen) {
  const Baked baked = room_with_panel();
  DrawRequest r = request();
  r.lamp = {"panel=0"};
  EXPECT_EQ(mean(drawn(baked, r)), 0);
  r.lamp.clear();
  const double all = mean(drawn(baked, r));
  EXPECT_NEAR(all / truth(baked.scene, r), 1, 0.05);  // 512 surfels, 64 rays each
  r.show = "direct";
  const double direct = mean(drawn(baked, r));
  r.show = "indirect";
  const double indirect = mean(drawn(baked, r));
  EXPECT_NEAR(indirect / truth(baked.scene, r), 1, 0.1);
  EXPECT_NEAR(all, direct + indirect, 1e-5 * all);
  r.lamp = {"moon=1"};
  const auto unknown = draw(baked, r);
  ASSERT_FALSE(unknown);
  EXPECT_NE(unknown.error().text().find("no lamp \"moon\"; it has panel"), std::string::npos) << unknown.error().text();
}

TEST(IndirectDrawing, SkyIsAsBrightAsByPaths) {
  const Baked baked = room();
  DrawRequest r = request();
  r.env = "sky:elevation=60,azimuth=20,turbidity=4,width=64";
  EXPECT_NEAR(mean(drawn(baked, r)) / truth(baked.scene, r), 1, 0.04);
  r.show = "indirect";
  EXPECT_NEAR(mean(drawn(baked, r)) / truth(baked.scene, r), 1, 0.1);
}

TEST(IndirectDrawing, NothingThatShinesIsRefused) {
  const auto refused = draw(room(), request());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, "--lamp");
}

}  // namespace
}  // namespace lambent
