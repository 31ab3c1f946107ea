// Kinds that are drawn live by steps of their own.
#include <lambent/pipeline/live_test-inl.h>

#include <lambent/compress/wrinkle.h>
#include <lambent/scene/load.h>
#include <lambent/transfer/zonal_texture.h>

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
using test::open_golden;

TEST(LiveIndirect, LampsAndPaintAreDrawnAsRenderDoes) {
  const auto [baked, request] = open_golden("indirect");
  DrawRequest moved = request, more = request, painted = request, sky = request, turned, later = request;
  moved.lamp = {"sphere@0.6,1.1,1.2,0.2=30,20,10"};
  more.lamp = {moved.lamp.front(), "spot@1,1.5,1,1,0,1,50=5", "sun@40,60=0.5"};
  painted.albedo = {"red=0.1,0.8,0.2", "grey=0.9"};
  sky.env = "sky:elevation=60,azimuth=20,turbidity=4,width=64", sky.albedo = painted.albedo;
  turned = sky, turned.background = "none", turned.env_rotate = "70,0,0", turned.lamp = {"sky=2,1,1"};
  later.lamp = {"point@1,1,1=3"}, later.move = {"1@0:1,1,1;2:0.5,0.7,1.3"}, later.time = 1.5;
  DrawRequest part = request;
  part.show = "indirect";
  expect_each_drawn(baked, {request, moved, more, painted, sky, turned, later, part, request});
}

// Lamps that stand keep their light: leaves are lit by the one that moves alone, hurried through or not.
TEST(LiveIndirect, OnlyTheLampThatMovesIsLitAnew) {
  const auto [baked, request] = open_golden("indirect");
  const size_t leaves = std::get<IndirectTransfer>(baked.surface.store).surfels.count();
  DrawRequest three = request;
  three.lamp = {"sphere@0.6,1.1,1.2,0.2=30,20,10", "point@1,1,1=3", "spot@1,1.5,1,1,0,1,50=5"};
  auto picture = LivePicture::make(baked, three);
  ASSERT_TRUE(picture) << picture.error().text();
  ASSERT_TRUE(*picture->work(false, 1e3));
  EXPECT_EQ(picture->times().shaded, 3 * leaves);
  finish(*picture);
  const auto lit = [&](const DrawRequest& next) {
    EXPECT_EQ(error_of(picture->ask(next)), "");
    EXPECT_TRUE(*picture->work(false, 1e3));
    const size_t count = picture->times().shaded;
    finish(*picture);
    expect_same(picture->image(), drawn(baked, next));
    return count;
  };
  DrawRequest moved = three, dimmed = three, fewer = three, swapped = three;
  moved.lamp[1] = "point@0.5,1.2,0.8=3";
  EXPECT_EQ(lit(moved), leaves);
  dimmed.lamp[1] = moved.lamp[1], dimmed.lamp[2] = "spot@1,1.5,1,1,0,1,50=1,2,5";
  EXPECT_EQ(lit(dimmed), leaves);
  EXPECT_EQ(lit(three), 2 * leaves);
  fewer.lamp.erase(fewer.lamp.begin());
  EXPECT_EQ(lit(fewer), 0u);
  std::swap(fewer.lamp[0], fewer.lamp[1]);
  EXPECT_EQ(lit(fewer), 0u);
  EXPECT_EQ(lit(three), leaves);  // one that was not there
  // In a hurry the one that moves is coarse, and the others stay as they were.
  ASSERT_EQ(error_of(picture->ask(moved)), "");
  ASSERT_TRUE(*picture->work(true, 1e3));
  EXPECT_EQ(picture->times().shaded, leaves);
  ASSERT_TRUE(*picture->work(false, 1e3));
  EXPECT_EQ(picture->times().shaded, leaves);
  finish(*picture);
  expect_same(picture->image(), drawn(baked, moved));
  // Begun at rest and gone on with in a hurry, it is still whole in the end.
  ASSERT_EQ(error_of(picture->ask(three)), "");
  ASSERT_TRUE(*picture->work(false, 0));
  ASSERT_TRUE(*picture->work(true, 1e3));
  finish(*picture);
  expect_same(picture->image(), drawn(baked, three));
}

TEST(LiveIndirect, OwnLampsAreScaledAndStandBeside) {
  auto [baked, request] = open_golden("indirect");
  baked.scene.lights = {{.name = "bulb", .position = Vec3(1, 1, 1.2f), .intensity = Vec3(3, 2, 1)}};
  request.lamp = {"bulb=0"};
  DrawRequest on = request, dim = request;
  on.lamp = {}, dim.lamp = {"bulb=0.2,0.5,1", "point@0.5,0.5,0.5=1"};
  auto picture = LivePicture::make(baked, on);
  ASSERT_TRUE(picture) << picture.error().text();
  EXPECT_EQ(picture->lamp_names(), std::vector<std::string>{"bulb"});
  expect_each_drawn(baked, {on, request, dim, on});
  const auto lit = picture->lit_scene();
  EXPECT_EQ(lit->lights.size(), 1u);
}

// In a hurry light is coarser, and close to what it becomes.
TEST(LiveIndirect, HurriesCloseToThePicture) {
  const auto [baked, request] = open_golden("indirect");
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture);
  finish(*picture);
  DrawRequest moved = request;
  moved.lamp = {"sphere@0.8,1.1,1.2,0.1=30,20,10"};
  ASSERT_EQ(error_of(picture->ask(moved)), "");
  ASSERT_TRUE(*picture->work(true, 10));
  const Image hurried = picture->image();
  EXPECT_FALSE(picture->done());
  finish(*picture);
  const Image& whole = picture->image();
  ASSERT_EQ(hurried.rgb.size(), whole.rgb.size());
  double apart = 0, all = 0;
  for (size_t i = 0; i < whole.rgb.size(); ++i)
    apart += double(length(hurried.rgb[i] - whole.rgb[i])), all += double(length(whole.rgb[i]));
  EXPECT_GT(apart, 0);
  EXPECT_LT(apart, 0.25 * all);  // one ray a pixel, where the whole has four
}

TEST(LiveIndirect, KeepsWhatItShowsOnErrors) {
  const auto [baked, request] = open_golden("indirect");
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture);
  finish(*picture);
  const Image before = picture->image();
  for (const auto& change : std::vector<std::function<void(DrawRequest&)>>{
           [](DrawRequest& r) { r.lamp = {"moon=1"}; }, [](DrawRequest& r) { r.lamp = {}; },
           [](DrawRequest& r) { r.lamp = {"point@0,0=1"}; }, [](DrawRequest& r) { r.albedo = {"blue=1"}; },
           [](DrawRequest& r) {
             r.albedo = {"red=0.5", "grey=2"};
           },
           [](DrawRequest& r) { r.move = {"3@0:0,0,0"}; }, [](DrawRequest& r) { r.env = "none.hdr"; },
           [](DrawRequest& r) { r.show = "bounce:1"; }}) {
    DrawRequest asked = request;
    change(asked);
    EXPECT_NE(error_of(picture->ask(asked)), "");
    finish(*picture);
    expect_same(picture->image(), before);
  }
  DrawRequest moved = request;
  moved.lamp = {"point@1,1,1=3"};
  ASSERT_EQ(error_of(picture->ask(moved)), "");
  finish(*picture);
  expect_same(picture->image(), drawn(baked, moved));
}

class LiveTexture : public testing::Test {
 protected:
  test::TemporaryFolder folder;
  void SetUp() override {
    WrinkleOptions wrinkles;
    wrinkles.size = 6;
    auto grooves = make_wrinkle_table(wrinkles);
    ASSERT_TRUE(grooves) << grooves.error().text();
    ASSERT_TRUE(save_zonal_texture(folder.file("grooves.lpt"), grooves->texture));
    folder.write("card.obj",
                 "v 0 0 0\nv 2 0 0\nv 2 0 2\nv 0 0 2\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 4/1 3/2 2/3\nf 4/1 2/3 1/4\n");
  }
  DrawRequest textured(DrawRequest request) const {
    request.transfer_texture = folder.file("grooves.lpt"), request.tile = "5,0";
    return request;
  }
};

// draw() reads its scene itself; the live picture is given it.
TEST_F(LiveTexture, OfASceneThatWasNotBakedIsDrawnAsRenderDoes) {
  Baked plain;
  plain.scene = *load_scene(folder.file("card.obj"));
  DrawRequest request = textured({.baked = folder.file("card.obj"), .camera = "3,2,4,1,0.5,1,40", .size = "16x12"});
  request.spp = 2, request.background = "none", request.env = "sky:elevation=40,azimuth=20,turbidity=4,width=64";
  DrawRequest turned = request, wider = request, near = request, bent = request;
  turned.env_rotate = "60,0,0";
  wider.tile = "3,1", wider.groove_depth = 0.2f, wider.groove_width = 0.5f;
  near.sphere_lamp = {"1,1,1,0.3,9,8,7"};
  bent.deform = "bend:60,x";
  DrawRequest pressed = bent, twisted = bent;
  twisted.deform = "twist:70,x";
  DrawRequest folded = twisted;
  pressed.wrinkle = "strain", folded.wrinkle = "strain,0.3";
  EXPECT_NE(drawn(plain, folded).rgb, drawn(plain, twisted).rgb);
  expect_each_drawn(plain, {request, turned, wider, near, bent, pressed, twisted, folded, pressed, request});
}

TEST_F(LiveTexture, OverABakeIsInTheLightThatArrives) {
  auto [baked, request] = open_golden("matrix_map");
  DrawRequest relief = textured(request), turned = relief;
  turned.env_rotate = "60,0,0";
  expect_each_drawn(baked, {request, relief, turned, request});
  auto picture = LivePicture::make(baked, relief);
  ASSERT_TRUE(picture);
  EXPECT_NE(error_of(picture->look_as(Look::rows)), "");
  DrawRequest wrong = relief;
  wrong.transfer_texture = folder.file("card.obj");
  EXPECT_NE(error_of(picture->ask(wrong)), "");
  finish(*picture);
  expect_same(picture->image(), drawn(baked, relief));
}

// What each kind has of its own to be changed by hand: meshes that bend, lamps, materials, bands, terms.
struct Edits {
  std::string name;
  std::vector<std::function<void(DrawRequest&)>> changes;
};
class LiveEdits : public testing::TestWithParam<Edits> {};

TEST_P(LiveEdits, AreDrawnAsRenderDoes) {
  const auto [baked, request] = open_golden(GetParam().name);
  std::vector<DrawRequest> requests{request};
  for (const auto& change : GetParam().changes) change(requests.emplace_back(request));
  requests.push_back(request);
  expect_each_drawn(baked, requests);
}

const auto bent = [](DrawRequest& r) { r.deform = "bend:60,x"; };
const auto twisted = [](DrawRequest& r) { r.deform = "twist:50,y", r.env_rotate = "80,0,0"; };
const auto two_bands = [](DrawRequest& r) { r.light_order = 2; };
const auto turned_light = [](DrawRequest& r) { r.env_rotate = "80,20,0"; };
const auto green_lamp = [](DrawRequest& r) { r.lamp = {"lamp=0,1,0", "sky=0.5,1,2"}; };
const auto lamp_alone = [](DrawRequest& r) { r.lamp = {"sky=0"}; };
const auto lamp_moved = [](DrawRequest& r) { r.move = {"1@70,20"}; };
const auto lamp_later = [](DrawRequest& r) { r.move = {"1@0:70,20;2:10,60"}, r.time = 1.2; };
const auto phong = [](DrawRequest& r) { r.brdf = "phong:exponent=30,diffuse=0.2,specular=0.5"; };
const auto ggx = [](DrawRequest& r) { r.brdf = "ggx:roughness=0.5", r.env_rotate = "80,0,0"; };

INSTANTIATE_TEST_SUITE_P(Kinds, LiveEdits,
                         testing::Values(Edits{"zonal", {bent, twisted, two_bands}},
                                         Edits{"zonal_glossy", {bent, twisted}},
                                         Edits{"lightmap", {green_lamp, lamp_alone}},
                                         Edits{"diffuse_clusters", {two_bands, turned_light}},
                                         Edits{"compressed_cpca", {two_bands, turned_light}},
                                         Edits{"matrix_map", {phong, ggx}}, Edits{"factors", {phong, ggx}},
                                         Edits{"wavelets", {[](DrawRequest& r) { r.terms = 8; }, turned_light}},
                                         Edits{"diffuse_fixed_view", {two_bands, turned_light}},
                                         Edits{"diffuse_lobes", {turned_light, lamp_moved, lamp_later}},
                                         Edits{"lightmap_prt", {turned_light}}),
                         [](const auto& info) { return info.param.name; });

// A model by name is what --brdf is for all; named for one, the other stays.
TEST(LiveBlocks, MaterialsByName) {
  auto [baked, request] = open_golden("blocks");
  const std::string model = "phong:exponent=20,diffuse=0.3,specular=0.4";
  DrawRequest all = request, each = request, one = request, tinted = request;
  all.brdf = model;
  each.material = {"red=" + model, "grey=" + model};
  one.material = {"red=ward:ax=0.2,ay=0.4"}, tinted.material = {"red=textured:lambert:albedo=1"};
  expect_same(drawn(baked, each), drawn(baked, all));
  expect_same(drawn(baked, tinted), drawn(baked, request));  // its own colour
  expect_each_drawn(baked, {request, each, one, request});
  one.material = {"blue=lambert:albedo=1"};
  EXPECT_FALSE(draw(baked, one));
  one.material = {"red=phong:exponent=-1"};
  EXPECT_FALSE(draw(baked, one));
}

}  // namespace
}  // namespace lambent
