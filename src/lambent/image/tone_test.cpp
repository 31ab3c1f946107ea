#include <lambent/image/image.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace lambent {
namespace {

constexpr Tone tones[] = {Tone::none, Tone::aces, Tone::agx, Tone::neutral};

TEST(Tone, BlackIsBlackAndMoreLightIsNoDarker) {
  for (Tone tone : tones) {
    const Display display{0, tone};
    EXPECT_LT(shown(Vec3(0), display).x, 1e-3f) << int(tone);  // AgX ends at its darkest stop
    float before = -1;
    for (float stops = -12; stops <= 12; stops += 0.25f) {
      const Vec3 c = shown(Vec3(std::exp2(stops)), display);
      EXPECT_NEAR(c.x, c.y, 2e-3f);
      EXPECT_NEAR(c.x, c.z, 2e-3f);  // grey stays grey, to the matrices' digits
      EXPECT_GE(c.x, before - 1e-6f) << "tone " << int(tone) << " at " << stops << " stops";
      EXPECT_LE(c.x, 1);
      before = c.x;
    }
    EXPECT_GT(before, 0.98f) << int(tone);
  }
}

// What each curve's authors say of it.
TEST(Tone, MiddleGreyIsWhereItsAuthorsPutIt) {
  // AgX turns about (10 / 16.5, 0.5), which is 0.18, before its own power of 2.2; the polynomial is within 0.3 %.
  EXPECT_NEAR(shown(Vec3(0.18f), {0, Tone::agx}).x, std::pow(0.5, 2.2), 0.004);
  // ACES: 4.8 of the 48 nits of a cinema's white; three.js's scale undone.
  EXPECT_NEAR(shown(Vec3(0.18f * 0.6f), {0, Tone::aces}).x, 0.1, 0.01);
  // Neutral takes off the 4 % that a dielectric's Fresnel term adds, and nothing else below 0.76 of what is left.
  const Vec3 c = shown(Vec3(0.6f, 0.3f, 0.1f), {0, Tone::neutral});
  EXPECT_NEAR(c.x, 0.56f, 1e-6f);
  EXPECT_NEAR(c.y, 0.26f, 1e-6f);
  EXPECT_NEAR(c.z, 0.06f, 1e-6f);
  // ... and a peak p of what is left becomes 1 - 0.24^2 / (p - 0.52).
  EXPECT_NEAR(shown(Vec3(4.04f), {0, Tone::neutral}).x, 1 - 0.24f * 0.24f / (4 - 0.52f), 1e-5f);
  EXPECT_EQ(shown(Vec3(0.25f, 0.5f, 2), {1, Tone::none}), Vec3(0.5f, 1, 1));
}

TEST(Tone, BrokenLightIsShownAsSomething) {
  const float inf = std::numeric_limits<float>::infinity(), nan = std::nanf("");
  for (Tone tone : tones)
    for (float stops : {-100.0f, 0.0f, 100.0f})
      for (Vec3 c : {Vec3(nan), Vec3(inf), Vec3(-inf), Vec3(-1, 2, nan), Vec3(3e38f), Vec3(inf, 0, -3)}) {
        const Vec3 seen = shown(c, {stops, tone});
        for (int k = 0; k < 3; ++k) {
          EXPECT_GE(seen[k], 0);
          EXPECT_LE(seen[k], 1);
        }
      }
  for (Tone tone : tones)
    EXPECT_EQ(shown(Vec3(-1, -2, -3), {0, tone}), shown(Vec3(0), {0, tone}));  // darker than black is black
}

TEST(Tone, AutomaticExposureIsOfWhatIsCovered) {
  Image image(10, 10);
  for (size_t i = 0; i < 100; ++i) image.rgb[i] = Vec3(float(i + 1));
  // The 90th of the values 1 to 100, by rank 0.9 * 99 from 0.
  EXPECT_FLOAT_EQ(auto_exposure({&image, 1}), std::log2(0.7f / 90));
  image.coverage.assign(100, 0.0f);
  EXPECT_FLOAT_EQ(auto_exposure({&image, 1}), std::log2(0.7f / 90)) << "none covered: all count";
  for (size_t i = 0; i < 10; ++i) image.coverage[i] = 1;
  EXPECT_FLOAT_EQ(auto_exposure({&image, 1}), std::log2(0.7f / 9));
  image.coverage.clear(), image.alpha.assign(100, 0.0f), image.alpha[3] = 0.5f;
  EXPECT_FLOAT_EQ(auto_exposure({&image, 1}), std::log2(0.7f / 8)) << "rgb is premultiplied";
  Image lamp(10, 10);
  lamp.at(5, 5) = Vec3(1e3f);
  EXPECT_FLOAT_EQ(auto_exposure({&lamp, 1}), std::log2(0.7f / 1e3f)) << "a lamp in the dark";
  EXPECT_EQ(auto_exposure({&lamp, 0}), 0);
  const Image black(4, 4);
  EXPECT_EQ(auto_exposure({&black, 1}), 0);
  const Image both[] = {lamp, image};
  EXPECT_FLOAT_EQ(auto_exposure(both), std::log2(0.7f / 1e3f)) << "the brightest tenth of both";
}

TEST(Tone, ClippingCountsWhatAPngLoses) {
  Image image(4, 1);
  image.rgb = {Vec3(0.5f), Vec3(1.5f), Vec3(-0.1f), Vec3(0, 0, 3)};
  const Clipping none = clipping({&image, 1}, {});
  EXPECT_EQ(none.white, 0.5);
  EXPECT_EQ(none.negative, 0.25);
  EXPECT_EQ(clipping({&image, 1}, {-2, Tone::none}).white, 0);
  EXPECT_EQ(clipping({&image, 1}, {0, Tone::neutral}).white, 0) << "the curve keeps room above white";
  auto png = encode_png(image, {}, "x.png");
  ASSERT_TRUE(png);
  auto back = load_image(*png, "x.png");
  ASSERT_TRUE(back);
  size_t white = 0;
  for (Vec3 c : back->rgb) white += std::max({c.x, c.y, c.z}) >= 1;
  EXPECT_EQ(double(white) / 4, none.white);
}

TEST(Tone, ParsesWhatOptionsSay) {
  Image image(1, 1);
  image.rgb[0] = Vec3(0.7f);
  auto display = parse_display("auto", "agx", {&image, 1});
  ASSERT_TRUE(display);
  EXPECT_NEAR(display->exposure, 0, 1e-5f);
  EXPECT_EQ(display->tone, Tone::agx);
  EXPECT_EQ(parse_display("-2.5", "none", {})->exposure, -2.5f);
  for (const char* wrong : {"", "x", "1x", "nan", "inf", "101", "1e999", " 1"})
    EXPECT_EQ(parse_display(wrong, "none", {}).error().where, "--exposure") << wrong;
  for (const char* wrong : {"", "filmic", "none "}) EXPECT_EQ(check_display("0", wrong).error().where, "--tone");
}

}  // namespace
}  // namespace lambent
