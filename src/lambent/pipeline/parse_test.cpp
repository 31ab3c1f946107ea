#include <lambent/pipeline/draw_request.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

TEST(Parse, Numbers) {
  const auto n = parse_numbers("1,-2.5,3e2", 3, "--x");
  ASSERT_TRUE(n);
  EXPECT_EQ(*n, (std::vector<float>{1, -2.5f, 300}));
  for (const char* wrong : {"", "1,2", "1,2,3,4", "1,2,nan", "1,2,inf", "1,2,x", "1,2,3 ", "1,,3", "1,2,1e99"}) {
    const auto refused = parse_numbers(wrong, 3, "--x");
    ASSERT_FALSE(refused) << wrong;
    EXPECT_EQ(refused.error().where, "--x");
  }
}

TEST(Parse, NamesMayHoldEqualSigns) {
  const auto lamp = parse_named_color("a=b=1,0.5,0", "--lamp");
  ASSERT_TRUE(lamp);
  EXPECT_EQ(lamp->name, "a=b");
  EXPECT_EQ(lamp->color, Vec3(1, 0.5f, 0));
  EXPECT_EQ(parse_named_color("a=0.5", "--lamp")->color, Vec3(0.5f));
  for (const char* wrong : {"=1,1,1", "a", "a=", "a=1,", "a=1,1", "a=-1", "a=1,-1,1"})
    EXPECT_FALSE(parse_named_color(wrong, "--lamp")) << wrong;
}

TEST(Parse, SizesAndCameras) {
  const auto size = parse_size("16384x1", "--size");
  ASSERT_TRUE(size);
  EXPECT_EQ(*size, (std::array<int, 2>{16384, 1}));
  for (const char* wrong : {"0x1", "1x16385", "12", "x", "1x2x3", "-1x2", "1.5x2"})
    EXPECT_FALSE(parse_size(wrong, "--size")) << wrong;
  const auto camera = parse_camera("1,2,3,4,5,6,30");
  ASSERT_TRUE(camera && *camera);
  EXPECT_EQ((*camera)->eye, Vec3(1, 2, 3));
  EXPECT_EQ((*camera)->target, Vec3(4, 5, 6));
  EXPECT_EQ((*camera)->fov, 30);
  for (const char* far : {"1e19,2,3,4,5,6,30", "1,2,3,4,5,-1.1e9,30"}) {
    const auto beyond = parse_camera(far);
    ASSERT_FALSE(beyond) << far;
    EXPECT_EQ(beyond.error().message, "numbers must lie within 1e9");
  }
  const auto automatic = parse_camera("auto");
  ASSERT_TRUE(automatic);
  EXPECT_FALSE(*automatic);
  for (const char* wrong : {"", "1,2,3,4,5,6", "1,2,3,1,2,3,30", "1,2,3,4,5,6,0", "1,2,3,4,5,6,180"})
    EXPECT_FALSE(parse_camera(wrong)) << wrong;
}

TEST(Parse, FramesAreEvenlySpaced) {
  const auto five = parse_frames("0:1:0.25");
  ASSERT_TRUE(five);
  EXPECT_EQ(*five, (std::vector<double>{0, 0.25, 0.5, 0.75, 1}));
  const auto six = parse_frames("1:2");
  ASSERT_TRUE(six);
  ASSERT_EQ(six->size(), 6u);
  EXPECT_DOUBLE_EQ(six->back(), 2);
  const auto one = parse_frames("3:3");
  ASSERT_TRUE(one);
  EXPECT_EQ(*one, std::vector<double>{3});
  for (const char* wrong : {"1", "2:1", "0:1:0", "0:1:-1", "0:1:0.001", "0:1:2:3", "0:nan", "a:b"})
    EXPECT_FALSE(parse_frames(wrong)) << wrong;
}

TEST(Parse, InsertionsAndLamps) {
  const auto cup = parse_insertion("a@b.obj@1,2,3,0.5");
  ASSERT_TRUE(cup);
  EXPECT_EQ(cup->path, "a@b.obj");
  EXPECT_EQ(cup->foot, Vec3(1, 2, 3));
  EXPECT_EQ(cup->scale, 0.5f);
  for (const char* wrong : {"cup.obj", "@1,2,3", "c@1,2", "c@1,2,3,0", "c@2e9,0,0"})
    EXPECT_FALSE(parse_insertion(wrong)) << wrong;
  const auto lamps = parse_sphere_lamps({"1,2,3,0.5,4,5,6"});
  ASSERT_TRUE(lamps);
  ASSERT_EQ(lamps->size(), 1u);
  EXPECT_EQ(lamps->front().centre, Vec3(1, 2, 3));
  EXPECT_EQ(lamps->front().radiance, Vec3(4, 5, 6));
  EXPECT_FALSE(parse_sphere_lamps({"1,2,3,0,4,5,6"}));
}

TEST(Parse, WhatIsShown) {
  const auto bounce = parse_show("bounce:2");
  ASSERT_TRUE(bounce);
  EXPECT_EQ(bounce->part, Show::Part::bounce);
  EXPECT_EQ(bounce->term, 2);
  const auto sum = parse_show("sum:0");
  ASSERT_TRUE(sum);
  EXPECT_EQ(sum->part, Show::Part::sum);
  for (const char* wrong : {"", "bounce", "bounce:", "bounce:-1", "bounce:1x", "sum:99999999999", "colour"})
    EXPECT_FALSE(parse_show(wrong)) << wrong;
}

}  // namespace
}  // namespace lambent
