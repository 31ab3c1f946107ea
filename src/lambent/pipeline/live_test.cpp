#include <lambent/pipeline/live_test-inl.h>

#include <lambent/pipeline/bake.h>
#include <lambent/scene/procedural.h>
#include <lambent/scene/refine.h>

#include "temporary_folder.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace lambent {
namespace {

using test::drawn;
using test::error_of;
using test::expect_each_drawn;
using test::expect_same;
using test::finish;
using test::golden_names;
using test::golden_request;
using test::open_golden;

constexpr const char* live_file = "diffuse";

class Live : public testing::TestWithParam<std::string> {};

// Of every kind, whatever was seen before: once nothing is left to do it is the picture that render draws.
TEST_P(Live, BecomesThePicture) {
  const auto [baked, request] = open_golden(GetParam());
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture) << picture.error().text();
  EXPECT_GE(finish(*picture), 1);
  EXPECT_TRUE(picture->done());
  expect_same(picture->image(), drawn(baked, request));
}

TEST_P(Live, FollowsLightAndView) {
  const auto [baked, request] = open_golden(GetParam());
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture) << picture.error().text();
  DrawRequest moved = request;
  const bool turns = !request.env.empty(), looks = GetParam().find("fixed_view") == std::string::npos;
  for (int frame = 0; frame < 5; ++frame) {
    if (turns) moved.env_rotate = std::to_string(30 * frame) + ",0,0";
    if (looks) moved.camera = std::to_string(3 - frame % 2) + ",2,4,1,0.5,1,40";
    ASSERT_EQ(error_of(picture->ask(moved)), "");
    const auto worked = picture->work(true, 1e-5);  // never enough: the coarsest that there is
    ASSERT_TRUE(worked) << worked.error().text();
    EXPECT_TRUE(*worked);
  }
  finish(*picture);
  expect_same(picture->image(), drawn(baked, moved));
  // And back: the same bytes as before.
  ASSERT_EQ(error_of(picture->ask(request)), "");
  finish(*picture);
  expect_same(picture->image(), drawn(baked, request));
}

INSTANTIATE_TEST_SUITE_P(Files, Live, testing::ValuesIn(golden_names()), [](const auto& info) { return info.param; });

TEST(LivePicture, DoesOnlyWhatHasChanged) {
  const auto [baked, request] = open_golden(live_file);
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture);
  EXPECT_EQ(finish(*picture), request.spp);
  EXPECT_FALSE(*picture->work());
  DrawRequest asked = request;
  asked.env_rotate = "90,0,0";
  ASSERT_EQ(error_of(picture->ask(asked)), "");
  ASSERT_TRUE(*picture->work());
  EXPECT_GT(picture->times().relight, 0);
  EXPECT_EQ(picture->times().trace, 0);  // the camera stands
  finish(*picture);
  asked.camera = "3,2.5,4,1,0.5,1,40";
  ASSERT_EQ(error_of(picture->ask(asked)), "");
  ASSERT_TRUE(*picture->work());
  EXPECT_EQ(picture->times().relight, 0);  // nor has the light changed
  EXPECT_GT(picture->times().trace, 0);
  finish(*picture);
  ASSERT_EQ(error_of(picture->ask(asked)), "");
  EXPECT_TRUE(picture->done());
}

// In a hurry receivers that no ray has met are left out, and what is seen is none the less right; at rest all follow.
TEST(LivePicture, OnlyWhatIsSeenIsRelitInAHurry) {
  Scene scene = make_courtyard();
  for (float edge = 0.4f; scene.positions.size() < 20000; edge *= 0.8f) ASSERT_TRUE(split_long_edges(scene, edge));
  const size_t receivers = scene.positions.size();
  BakeRequest bake_it{.order = 3, .bounces = "0"};
  bake_it.samples = 16, bake_it.denoise = "off";
  bake_it.loaded = std::make_shared<const Scene>(std::move(scene));
  const auto baked = bake(bake_it);
  ASSERT_TRUE(baked) << baked.error().text();
  DrawRequest request{.baked = "courtyard", .camera = "2,1.6,2,0,1,0,30", .size = "24x18", .background = "none"};
  request.env = "sky:elevation=30,azimuth=20,turbidity=3,width=64", request.spp = 1;
  auto picture = LivePicture::make(*baked, request);
  ASSERT_TRUE(picture) << picture.error().text();
  const auto hurried = [&](const DrawRequest& next) {
    ASSERT_EQ(error_of(picture->ask(next)), "");
    ASSERT_TRUE(*picture->work(true, 1e3));  // enough for every pixel
    expect_same(picture->image(), drawn(*baked, next));
    EXPECT_FALSE(picture->done());
  };
  hurried(request);
  EXPECT_LT(picture->times().shaded, receivers / 2);
  EXPECT_GT(picture->times().shaded, 0u);
  DrawRequest turned = request, away = request;
  turned.env_rotate = "70,0,0";
  hurried(turned);
  away.env_rotate = "70,0,0", away.camera = "-2,1.2,1,0,1.5,3,40";  // others are seen now
  hurried(away);
  finish(*picture);
  expect_same(picture->image(), drawn(*baked, away));
  // All is known by now.
  ASSERT_EQ(error_of(picture->ask(turned)), "");
  ASSERT_TRUE(*picture->work(true, 1e3));
  EXPECT_EQ(picture->times().relight, 0);
  expect_same(picture->image(), drawn(*baked, turned));
}

// Of blocks a part is shaded in turn while hands move; what comes into view is no dark place until its turn.
TEST(LivePicture, BlocksThatComeIntoViewHaveAValueAtOnce) {
  auto [baked, request] = open_golden("blocks");
  request.env = "sky:elevation=40,azimuth=20,turbidity=4,width=64", request.size = "64x48", request.spp = 1;
  for (const bool rested : {false, true}) {
    auto picture = LivePicture::make(baked, request);
    ASSERT_TRUE(picture) << picture.error().text();
    if (rested) finish(*picture);
    for (const char* camera : {"3,2,4,1,0.5,1,40", "2,0.4,4,1,0.3,1,70", "0.3,3,3,1,0.5,1,50"}) {
      if (rested && camera == request.camera) continue;  // there is nothing to do
      DrawRequest moved = request, coarse = request;
      moved.camera = camera, coarse.camera = camera, coarse.size = "16x12";
      ASSERT_EQ(error_of(picture->ask(moved)), "");
      ASSERT_TRUE(*picture->work(true, 1e-6));
      const Image whole = drawn(baked, coarse);
      ASSERT_EQ(picture->image().rgb.size(), whole.rgb.size());
      for (size_t i = 0; i < whole.rgb.size(); ++i)  // coarse at most
        EXPECT_LE(length(picture->image().rgb[i] - whole.rgb[i]), 0.1f * length(whole.rgb[i]) + 1e-4f)
            << camera << ' ' << i;
    }
  }
}

TEST(LivePicture, KeepsWhatItShowsOnErrors) {
  const auto [baked, request] = open_golden(live_file);
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture);
  finish(*picture);
  const Image before = picture->image();
  for (const auto& [change, part] : std::vector<std::pair<std::function<void(DrawRequest&)>, std::string>>{
           {[](DrawRequest& r) { r.env = "no_such_file.hdr"; }, "no_such_file.hdr"},
           {[](DrawRequest& r) { r.env_rotate = "1,2"; }, "--env-rotate"},
           {[](DrawRequest& r) { r.camera = "0,0,0"; }, "--camera"},
           {[](DrawRequest& r) { r.size = "0x4"; }, "--size"},
           {[](DrawRequest& r) { r.brdf = "phong:0.5,20"; }, "--brdf"},
           {[](DrawRequest& r) { r.show = "bounce:1"; }, "--terms"},
           {[](DrawRequest& r) { r.insert = {"a.obj@0,0,0"}; }, "--insert"},
           {[](DrawRequest& r) { r.place = {"a=a.field.glb@0,0,0"}; }, "--place"},
           {[](DrawRequest& r) { r.transfer_texture = "a.lpt"; }, "a.lpt"},
           {[](DrawRequest& r) { r.tile = "2,2"; }, "--tile"},
           {[](DrawRequest& r) { r.albedo = {"red=1"}; }, "--albedo"},
           {[](DrawRequest& r) { r.animation = "0"; }, ""}}) {
    DrawRequest asked = request;
    change(asked);
    const std::string error = error_of(picture->ask(asked));
    EXPECT_NE(error, "");
    EXPECT_NE(error.find(part), std::string::npos) << error;
    finish(*picture);
    expect_same(picture->image(), before);
  }
}

TEST(LivePicture, ObjectsThatMoveAreDrawnAsRenderDoes) {
  const auto [baked, request] = open_golden("diffuse_lattice");
  const std::string file = golden_request("diffuse_field").baked;
  test::TemporaryFolder folder;
  folder.write("path.json", R"({"times": [0, 2], "places": [[0, 0.8, 0], [1, 0.8, 0.5, 0, 0, 90]]})");
  DrawRequest one = request, two = request, turned = request, later = request;
  one.place = {"a=" + file + "@0,0.8,0,0,0,0,0.5"};
  two.place = {"a=" + file + "@0.5,0.9,0.2,30,0,0,0.5", "b=" + file + "@-0.5,0.6,0,0,0,0,0.4"};
  turned = two, turned.env_rotate = "70,0,0";
  later.place = one.place, later.move = {"a=" + folder.file("path.json")}, later.time = 1.5;
  expect_each_drawn(baked, {one, two, turned, later, request, one});
}

TEST(LivePicture, AnInsertedObjectIsDrawnAsRenderDoesAndTakenHoldOf) {
  const auto [baked, request] = open_golden("diffuse_lattice");
  test::TemporaryFolder folder;
  folder.write("pyramid.obj", "v 0 0 0\nv 1 0 0\nv 0 0 1\nv 0.3 0.8 0.3\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 3 4 1\n");
  DrawRequest one = request, beside = request, turned = request;
  one.insert = {folder.file("pyramid.obj") + "@1,0.5,1,0.8"};
  beside.insert = {folder.file("pyramid.obj") + "@0.4,0.1,0.4,0.8", one.insert.front()};
  turned = beside, turned.env_rotate = "70,0,0";
  expect_each_drawn(baked, {one, turned, request});

  auto picture = LivePicture::make(baked, one);
  ASSERT_TRUE(picture) << picture.error().text();
  finish(*picture);
  size_t on_it = 0, beside_it = 0;
  for (int y = 0; y < 24; ++y)
    for (int x = 0; x < 32; ++x) {
      const Hit hit = picture->pick(Vec2((float(x) + 0.5f) / 32, (float(y) + 0.5f) / 24));
      const std::optional<size_t> object = picture->object_of(hit);
      EXPECT_EQ(object.has_value(), hit.triangle != none && hit.triangle >= baked.scene.triangles.size());
      ++(object ? on_it : beside_it);
    }
  EXPECT_GT(on_it, 0u);
  EXPECT_GT(beside_it, on_it);
}

}  // namespace
}  // namespace lambent
