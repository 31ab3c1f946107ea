#include <lambent/pipeline/live_test-inl.h>

#include <lambent/bake/bake.h>
#include <lambent/pipeline/view_error.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <algorithm>

namespace lambent {
namespace {

using test::drawn;
using test::error_of;
using test::expect_same;
using test::finish;
using test::open_golden;

TEST(LivePicture, OneCoefficientIsItsColumn) {
  const auto [baked, request] = open_golden("diffuse_grey_single");
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture);
  EXPECT_NE(error_of(picture->look_as(Look::coefficient, 1 << 20)), "");
  EXPECT_NE(error_of(picture->look_as(Look::coefficient, -1)), "");
  ASSERT_EQ(error_of(picture->look_as(Look::coefficient, 0)), "");
  finish(*picture);
  const Image first = picture->image();
  // Of the constant harmonic, transfer is nowhere negative (red), and somewhere it is light (blue).
  float most = 0;
  for (const Vec3& pixel : first.rgb) {
    EXPECT_EQ(pixel.x, 0.0f);
    most = std::max(most, pixel.z);
  }
  EXPECT_GT(most, 0.1f);
  for (const Look look : {Look::receivers, Look::density, Look::hits, Look::buried}) {
    ASSERT_EQ(error_of(picture->look_as(look)), "");
    finish(*picture);
    EXPECT_FALSE(std::equal(first.rgb.begin(), first.rgb.end(), picture->image().rgb.begin()));
  }
  ASSERT_EQ(error_of(picture->look_as(Look::picture)), "");
  finish(*picture);
  expect_same(picture->image(), drawn(baked, request));
}

// An open floor sees nothing but sky; in a box every ray meets a wall.
TEST(LiveLook, HitsAreSharesOfRays) {
  for (const bool closed : {false, true}) {
    Scene scene = closed ? make_sphere(2, 2, Vec3(0.5f), true)
                         : make_quad(Vec3(-1, 0, 1), Vec3(2, 0, 0), Vec3(0, 0, -2), 4, 4, Vec3(0.5f));
    const Tracer tracer = *Tracer::build(scene);
    const Receivers receivers = make_vertex_receivers(scene);
    auto transfer = bake(scene, tracer, receivers, {.order = 2, .samples = 16, .bounces = 0});
    ASSERT_TRUE(transfer);
    const Baked baked = make_baked(std::move(scene), receivers, std::move(*transfer), DiffuseRows{});
    DrawRequest request{
        .baked = "scene", .env = "uniform:1", .camera = "0.1,0.9,0.1,0,0,0,60", .size = "8x8", .spp = 1};
    auto picture = LivePicture::make(baked, request);
    ASSERT_TRUE(picture) << picture.error().text();
    ASSERT_EQ(error_of(picture->look_as(Look::hits)), "");
    finish(*picture);
    const Vec3 middle = picture->image().at(4, 4);
    EXPECT_LT(length(middle - false_color(closed ? 1.0f : 0.0f)), 1e-5f) << closed;
    ASSERT_EQ(error_of(picture->look_as(Look::buried)), "");
    finish(*picture);
    EXPECT_EQ(picture->image().at(4, 4), Vec3(0.35f));
  }
}

TEST(LiveLook, ErrorIsAsInspectPaintsIt) {
  Scene scene = make_quad(Vec3(-1, 0, 1), Vec3(2, 0, 0), Vec3(0, 0, -2), 6, 6, Vec3(0.5f));
  const Tracer tracer = *Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  auto transfer = bake(scene, tracer, receivers, {.order = 3, .samples = 16, .bounces = 0});
  ASSERT_TRUE(transfer);
  Baked baked = make_baked(std::move(scene), receivers, std::move(*transfer), DiffuseRows{});
  baked.provenance = R"({"request": {"scene": "s.obj", "output": "s.glb", "bounces": "0"}})";
  DrawRequest request{.baked = "s.glb", .env = "uniform:1", .camera = "0,3,0.01,0,0,0,30", .size = "48x74", .spp = 2};
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture) << picture.error().text();
  ASSERT_EQ(error_of(picture->look_as(Look::error)), "");
  finish(*picture);
  const auto painted = view_error(baked, request.camera, request.size, {});
  ASSERT_TRUE(painted) << painted.error().text();
  EXPECT_EQ(picture->image().rgb, painted->image.rgb);
}

// A ball shows the function that its receiver stores: of an open floor, seen from above, the cosine about +Y.
TEST(LiveLook, BallsAreTransferByDirection) {
  Scene scene = make_quad(Vec3(-1, 0, 1), Vec3(2, 0, 0), Vec3(0, 0, -2), 2, 2, Vec3(0.5f));
  const Tracer tracer = *Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  auto transfer =
      bake(scene, tracer, receivers, {.order = 3, .bounces = 0, .shadows = false, .precision = Precision::single});
  ASSERT_TRUE(transfer);
  const Baked baked = make_baked(std::move(scene), receivers, std::move(*transfer), DiffuseRows{});
  DrawRequest request{.baked = "s.glb", .env = "uniform:1", .camera = "0,30,0.001,0,0,0,3", .size = "70x70", .spp = 1};
  auto picture = LivePicture::make(baked, request);
  ASSERT_TRUE(picture);
  ASSERT_EQ(error_of(picture->look_as(Look::balls)), "");
  finish(*picture);
  // Balls are 5 pixels apart, their middles at 2, 7, ...: three bands of the cosine are 17/16 of it at its pole.
  EXPECT_NEAR(picture->image().at(37, 37).x, 1.0625f, 0.02f);
  EXPECT_LT(picture->image().at(35, 37).x, 0.5f);  // towards its edge
}

TEST(LiveLook, WhatAFileHasNotIsSaid) {
  const struct {
    const char* file;
    Look look;
    int number;
    const char* says;
  } cases[] = {{"diffuse", Look::lobes, 0, "zonal"},        {"blocks", Look::balls, 0, "harmonics"},
               {"blocks", Look::rows, 0, "rows"},           {"diffuse", Look::rows, 1, "rows 0 to 0"},
               {"indirect", Look::rows, 0, "rows"},         {"diffuse_fixed_view", Look::hits, 0, "fixed view"},
               {"lightmap", Look::hits, 0, "vertices"},     {"blocks", Look::error, 0, "diffuse"},
               {"matrix_map", Look::coefficient, 0, "one"}, {"indirect", Look::coefficient, 0, "no coefficients"}};
  for (const auto& c : cases) {
    const auto [baked, request] = open_golden(c.file);
    auto picture = LivePicture::make(baked, request);
    ASSERT_TRUE(picture) << picture.error().text();
    const std::string error = error_of(picture->look_as(c.look, c.number));
    EXPECT_NE(error.find(c.says), std::string::npos) << c.file << ": " << error;
  }
  for (const auto& [file, look] : {std::pair("zonal", Look::lobes), std::pair("zonal", Look::balls),
                                   std::pair("factors", Look::balls), std::pair("matrix_map", Look::rows),
                                   std::pair("compressed_cpca", Look::balls), std::pair("indirect", Look::hits)}) {
    const auto [baked, request] = open_golden(file);
    auto picture = LivePicture::make(baked, request);
    ASSERT_TRUE(picture) << picture.error().text();
    finish(*picture);
    const Image before = picture->image();
    ASSERT_EQ(error_of(picture->look_as(look)), "") << file;
    finish(*picture);
    EXPECT_NE(picture->image().rgb, before.rgb) << file;
    ASSERT_EQ(error_of(picture->look_as(Look::picture)), "");
    finish(*picture);
    expect_same(picture->image(), before);
  }
}

}  // namespace
}  // namespace lambent
