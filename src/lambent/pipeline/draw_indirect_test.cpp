#include <lambent/baked/baked_file.h>
#include <lambent/pipeline/bake.h>
#include <lambent/pipeline/draw.h>
#include <lambent/pipeline/golden_test-inl.h>
#include <lambent/pipeline/moving_lamps.h>
#include <lambent/pipeline/parse.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/scene/append.h>
#include <lambent/scene/load.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

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

// Texels with directions, and light in free space.
const Baked& with_all_outputs() {
  static const Baked baked = [] {
    BakeRequest r;
    Scene scene;
    add_box(scene, add_material(scene, "grey", Vec3(0.6f, 0.5f, 0.4f)), "shell", Vec3(-2, 0, -2), Vec3(2, 3, 2), 4,
            true);
    r.loaded = std::make_shared<const Scene>(std::move(scene));
    r.scene = "room.glb", r.transfer = "indirect", r.surfels = 512, r.samples = 128, r.receivers = "texels";
    r.atlas = "48x48", r.directional = "sh:3", r.lattice = "3,3,3";
    auto made = bake(r);
    EXPECT_TRUE(made) << made.error().text();
    return std::move(*made);
  }();
  return baked;
}

const char* inside = "1.7,1.6,1.7,0,1,0,70";

double difference(const Image& a, const Image& b) {
  double wrong = 0, right = 0;
  for (size_t i = 0; i < a.rgb.size(); ++i) {
    const Vec3 e = a.rgb[i] - b.rgb[i];
    wrong += double(dot(e, e)), right += double(dot(b.rgb[i], b.rgb[i]));
  }
  return std::sqrt(wrong / right);
}

TEST(IndirectDrawing, TexelsHaveWhatPixelsRead) {
  DrawRequest r = request();
  r.lamp = {"point@1,2,1=9,7,5"}, r.show = "indirect", r.camera = inside;
  const Image pixels = drawn(with_all_outputs(), r);
  r.at = "receivers";
  EXPECT_LT(difference(drawn(with_all_outputs(), r), pixels), 0.08);  // sh:3 of their own normals, and texels
  Baked plain = with_all_outputs();
  plain.surface.rows = DiffuseRows{}, std::get<IndirectTransfer>(plain.surface.store).rows = 1;
  EXPECT_LT(difference(drawn(plain, r), pixels), 0.04);
}

TEST(IndirectDrawing, ObjectsAreLitByTheLattice) {
  const std::string path = (std::filesystem::temp_directory_path() / "lambent_lit_object.obj").string();
  {
    std::ofstream file(path);
    for (int i = 0; i < 8; ++i) file << "v " << (i & 1) << " " << (i >> 1 & 1) << " " << (i >> 2) << "\n";
    for (const char* face : {"1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"})
      file << "f " << face << "\n";
  }
  DrawRequest r = request();
  r.lamp = {"point@1,2,1=9,7,5"}, r.show = "indirect", r.size = "24x18", r.camera = inside;
  const Image without = drawn(with_all_outputs(), r);
  r.insert = {path + "@-0.3,0.8,-0.2,0.6"};
  const Image with = drawn(with_all_outputs(), r);
  Scene scene = with_all_outputs().scene, object = *load_scene(path);
  scene.lights = {{.position = Vec3(1, 2, 1), .intensity = Vec3(9, 7, 5)}};
  place_scene(object, Vec3(-0.3f, 0.8f, -0.2f), 0.6f), append_scene(scene, object);
  const auto view = parse_view(r.camera, r.size, with_all_outputs().scene);
  const auto truth = path_trace(scene, *load_environment("uniform:0"), view->camera,
                                {.width = view->width,
                                 .height = view->height,
                                 .spp = 512,
                                 .bounces = 12,
                                 .background = false,
                                 .lamps = true,
                                 .direct = false});
  ASSERT_TRUE(truth);
  double ours = 0, right = 0;
  size_t pixels = 0;
  for (size_t i = 0; i < with.rgb.size(); ++i)
    if (with.rgb[i] != without.rgb[i]) ++pixels, ours += double(with.rgb[i].y), right += double(truth->image.rgb[i].y);
  EXPECT_GT(pixels, 6u);
  EXPECT_NEAR(ours / right, 1, 0.1);  // three points an axis
  std::filesystem::remove(path);
}

TEST(IndirectDrawing, LampsThatMovedAloneAreLitAnew) {
  DrawRequest r = request();
  r.lamp = {"point@1,1,1.2=3,2,1", "point@0.6,0.8,1.2=1"}, r.move = {"2@0:0.6,0.8,1.2;1:0.8,0.8,1.2"}, r.frames = "0:1";
  const auto frames = draw(room(), r);
  ASSERT_TRUE(frames) << frames.error().text();
  EXPECT_EQ(frames->summary.json["lamps_evaluated"], 1);
  r.frames.clear(), r.time = 1;
  EXPECT_LT(difference(frames->frames.back(), drawn(room(), r)), 2e-3);
  // A bounce a frame comes to the same, over some of them.
  r.time = 0, r.frames = "0:0.001:0.0001", r.frame_bounces = 2;
  r.move = {"2@0:0.6,0.8,1.2;1:0.60001,0.8,1.2"};
  const auto settled = draw(room(), r);
  ASSERT_TRUE(settled) << settled.error().text();
  EXPECT_LT(difference(settled->frames.back(), frames->frames.at(0)), 5e-3);
  EXPECT_GT(difference(settled->frames.front(), frames->frames.at(0)), 5e-3);
}

TEST(IndirectDrawing, FewLeavesAFrameFollowALampAndComeToTheSame) {
  DrawRequest r = request();
  r.show = "indirect", r.lamp = {"point@0.6,0.8,1.2=3"}, r.move = {"1@0:0.6,0.8,1.2;1:1.3,0.9,1.1"};
  const auto pictures = [&](const char* frames, int leaves) {
    r.frames = frames, r.frame_leaves = leaves;
    auto drawing = draw(room(), r);
    EXPECT_TRUE(drawing) << drawing.error().text();
    return std::move(*drawing);
  };
  const Drawing all = pictures("0:1:0.25", 0), few = pictures("0:1:0.25", 60);
  EXPECT_GT(all.summary.json["leaves_lit"], 240);
  EXPECT_EQ(few.summary.json["leaves_lit"], 60);
  // On the way, far nearer to what it is to be than the light that they began with.
  const double start = difference(all.frames[0], all.frames[4]), behind = difference(few.frames[4], all.frames[4]);
  EXPECT_GT(start, 0.05);
  EXPECT_GT(behind, 0);
  EXPECT_LT(behind, 0.25 * start);
  // Where it stands still they all come to see it, and no more rays are sent.
  const Drawing settled = pictures("0:4:0.25", 60);
  EXPECT_EQ(settled.summary.json["leaves_lit"], 0);
  EXPECT_EQ(settled.summary.json["lamps_evaluated"], 0);
  EXPECT_LT(difference(settled.frames.back(), all.frames.back()), 2e-3);
}

TEST(IndirectDrawing, LampsInsideWallsHugeOrManyAreTaken) {
  // Within what is solid, or about all of the scene: a warning, and no light.
  for (const char* lamp : {"point@0.5,-0.5,0.5=3", "sphere@1,1,1,1000=3", "point@1e8,1e8,1e8=3"}) {
    DrawRequest r = request();
    r.lamp = {lamp}, r.show = "indirect", r.spp = 1;
    for (Vec3 v : drawn(room(), r).rgb) ASSERT_TRUE(is_finite(v) && largest(v) < 1e-3f) << lamp;
  }
  // A thousand are one that is a thousand times as bright.
  DrawRequest r = request();
  r.show = "indirect", r.spp = 1, r.near_rays = 0, r.lamp = {"point@0.6,0.8,1.2=3"};
  const Image one = drawn(room(), r);
  r.lamp.assign(1000, "point@0.6,0.8,1.2=0.003");
  EXPECT_LT(difference(drawn(room(), r), one), 1e-3);
}

TEST(IndirectDrawing, SaysHowManyLampsAreBeyondThoseThatItLooksAtClosely) {
  DrawRequest r = request();
  r.spp = 1, r.size = "4x4";
  for (const size_t count : {64, 67}) {
    std::vector<std::string> said;
    r.lamp.assign(count, "point@0.6,0.8,1.2=0.003");
    const Job job{nullptr, [&](const std::string& line) { said.push_back(line); }};
    ASSERT_TRUE(draw(room(), r, job));
    ASSERT_EQ(said.size(), count == 64 ? 0u : 1u);
    if (count > 64) {
      EXPECT_NE(said[0].find("what 3 lamps light near"), std::string::npos) << said[0];
    }
  }
}

// Its bounced light is smaller than what surfels can tell apart, and brighter than their means.
TEST(IndirectDrawing, BesideAWallTheFirstBounceIsGatheredAtThePixel) {
  const Baked baked = room();
  DrawRequest r = request();
  r.lamp = {"point@0.1,1,1=100"}, r.show = "indirect", r.spp = 64;
  const Image gathered = drawn(baked, r);
  r.near_rays = 0;
  const Image read = drawn(baked, r);
  const auto lamp = parse_moving_lamps(r.lamp);
  ASSERT_TRUE(lamp);
  Scene scene = baked.scene;
  add_lamps(scene, *lamp);
  const auto view = parse_view(r.camera, r.size, scene);
  const auto paths = path_trace(scene, *load_environment("uniform:0"), view->camera,
                                {.width = view->width,
                                 .height = view->height,
                                 .spp = 2048,
                                 .bounces = 16,
                                 .background = false,
                                 .lamps = true,
                                 .direct = false});
  ASSERT_TRUE(paths);
  const auto squared = [&](const Image& image) {
    double sum = 0;
    for (size_t i = 0; i < image.rgb.size(); ++i) {
      const Vec3 off = image.rgb[i] - paths->image.rgb[i];
      sum += double(dot(off, off));
    }
    return sum;
  };
  // A tenth of the error, by enough paths; these have noise of their own.
  EXPECT_LT(squared(gathered), 0.25 * squared(read));
  EXPECT_NEAR(mean(gathered), mean(paths->image), 0.02 * mean(paths->image));
}

TEST(IndirectDrawing, BlackWallsGiveNothingBack) {
  DrawRequest r = request();
  r.lamp = {"point@0.6,0.8,1.2=3"}, r.show = "indirect", r.spp = 1;
  Baked baked = room();
  for (const Material& m : baked.scene.materials) r.albedo.push_back(m.name + "=0,0,0");
  for (Vec3 v : drawn(baked, r).rgb) ASSERT_EQ(v, Vec3(0));
}

TEST(IndirectDrawing, TreesWithCyclesOrChildrenOutOfRangeAreRefused) {
  const auto seeds = std::filesystem::path(__FILE__).parent_path() / "../../../fuzz/corpus_baked";
  for (const auto& [name, what] : {std::pair("indirect_cycle.glb", "is not its own parent on level 0"),
                                   std::pair("indirect_child.glb", "parent 92 does not exist on level 0")}) {
    const auto refused = load_baked((seeds / name).string());
    ASSERT_FALSE(refused) << name;
    EXPECT_NE(refused.error().text().find(what), std::string::npos) << refused.error().text();
  }
  EXPECT_TRUE(load_baked((seeds / "indirect.glb").string()));
}

TEST(IndirectDrawing, NothingThatShinesIsRefused) {
  const auto refused = draw(room(), request());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, "--lamp");
}

}  // namespace
}  // namespace lambent
