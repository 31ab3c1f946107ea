#include <lambent/core/random.h>
#include <lambent/image/compare.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

Image constant(int width, int height, Vec3 color) {
  Image image(width, height);
  std::fill(image.rgb.begin(), image.rgb.end(), color);
  return image;
}

Image noise(int width, int height, uint64_t seed) {
  Image image(width, height);
  Random random(seed);
  for (Vec3& c : image.rgb) c = {random.next(), random.next(), random.next()};
  return image;
}

double mean(const std::vector<float>& values) {
  double sum = 0;
  for (float v : values) sum += double(v);
  return sum / double(values.size());
}

// --- FLIP written out from the paper's formulas: two-dimensional filters, double precision, one pixel at a time.

struct SlowFlip {
  double ppd;
  int width, height;
  using Field = std::vector<Vec3d>;

  static constexpr double m[3][3] = {
      {0.41239080, 0.35758434, 0.18048079}, {0.21263901, 0.71516868, 0.07219232}, {0.01933082, 0.11919478, 0.95053215}};
  static constexpr double inv[3][3] = {{3.24096994, -1.53738318, -0.49861076},
                                       {-0.96924364, 1.87596750, 0.04155506},
                                       {0.05563008, -0.20397696, 1.05697151}};
  static Vec3d apply(const double (&a)[3][3], Vec3d v) {
    return {a[0][0] * v.x + a[0][1] * v.y + a[0][2] * v.z, a[1][0] * v.x + a[1][1] * v.y + a[1][2] * v.z,
            a[2][0] * v.x + a[2][1] * v.y + a[2][2] * v.z};
  }
  static Vec3d white() { return apply(m, Vec3d(1)); }

  static Vec3d hunt_lab(Vec3d linear) {
    Vec3d t = apply(m, linear) / white();
    for (int k = 0; k < 3; ++k) t[k] = t[k] > 216.0 / 24389 ? std::cbrt(t[k]) : (24389.0 / 27 * t[k] + 16) / 116;
    double L = 116 * t.y - 16;
    return {L, 0.01 * L * 500 * (t.x - t.y), 0.01 * L * 200 * (t.y - t.z)};
  }
  static double hyab(Vec3d a, Vec3d b) { return std::abs(a.x - b.x) + std::hypot(a.y - b.y, a.z - b.z); }

  template <class Weight>  // of offset (x, y) in pixels
  double filter(const Field& f, int k, int px, int py, int radius, Weight weight, bool by_sign) const {
    double value = 0, positive = 0, negative = 0;
    for (int pass = 0; pass < 2; ++pass)
      for (int y = -radius; y <= radius; ++y)
        for (int x = -radius; x <= radius; ++x) {
          double w = weight(x, y);
          if (pass == 0) {
            (w > 0 || !by_sign ? positive : negative) += w;
          } else {
            int sx = std::clamp(px + x, 0, width - 1), sy = std::clamp(py + y, 0, height - 1);
            value += (w > 0 || !by_sign ? w / positive : w / -negative) * f[size_t(sy * width + sx)][k];
          }
        }
    return value;
  }

  Field opponent(const Image& image) const {
    Field out;
    for (Vec3 c : image.rgb) {
      Vec3d linear;
      for (int k = 0; k < 3; ++k)
        linear[k] = c[k] <= 0.04045 ? c[k] / 12.92 : std::pow((double(c[k]) + 0.055) / 1.055, 2.4);
      Vec3d t = apply(m, linear) / white();
      out.push_back({116 * t.y - 16, 500 * (t.x - t.y), 200 * (t.y - t.z)});
    }
    return out;
  }

  Vec3d perceived(const Field& f, int px, int py) const {
    static constexpr double parameters[3][4] = {{1, 0.0047, 0, 1e-5}, {1, 0.0053, 0, 1e-5}, {34.1, 0.04, 13.5, 0.025}};
    const double pi2 = std::pow(std::acos(-1.0), 2);
    int radius = int(std::ceil(3 * std::sqrt(0.04 / (2 * pi2)) * ppd));
    Vec3d c;
    for (int k = 0; k < 3; ++k) {
      auto [a1, b1, a2, b2] = parameters[k];
      c[k] = filter(
          f, k, px, py, radius,
          [&, a1 = a1, b1 = b1, a2 = a2, b2 = b2](double x, double y) {
            double d2 = (x * x + y * y) / (ppd * ppd);
            return a1 * std::sqrt(std::acos(-1.0) / b1) * std::exp(-pi2 * d2 / b1) +
                   a2 * std::sqrt(std::acos(-1.0) / b2) * std::exp(-pi2 * d2 / b2);
          },
          false);
    }
    double y = (c.x + 16) / 116;
    Vec3d linear = apply(inv, Vec3d(y + c.y / 500, y, y - c.z / 200) * white());
    return hunt_lab(clamp(linear, Vec3d(0), Vec3d(1)));
  }

  // Edge and point strength.
  Vec2d features(const Field& f, int px, int py) const {
    double s = 0.5 * 0.082 * ppd;
    int radius = int(std::ceil(3 * s));
    auto g = [s](double x, double y) { return std::exp(-(x * x + y * y) / (2 * s * s)); };
    auto strength = [&](auto weight) {
      double x = filter(f, 0, px, py, radius, weight, true);
      double y = filter(
          f, 0, px, py, radius, [&](double u, double v) { return weight(v, u); }, true);
      return std::hypot(x, y) / 116;  // both detectors are blind to the constant 16
    };
    return {strength([&](double x, double y) { return -x * g(x, y); }),
            strength([&](double x, double y) { return (x * x / (s * s) - 1) * g(x, y); })};
  }

  static double redistribute(double hyab_distance) {
    double cmax = std::pow(hyab(hunt_lab({0, 1, 0}), hunt_lab({0, 0, 1})), 0.7), e = std::pow(hyab_distance, 0.7),
           knee = 0.4 * cmax;
    return e < knee ? 0.95 / knee * e : 0.95 + (e - knee) / (cmax - knee) * 0.05;
  }

  double error(const Field& a, const Field& b, int px, int py) const {
    double color = redistribute(hyab(perceived(a, px, py), perceived(b, px, py)));
    Vec2d fa = features(a, px, py), fb = features(b, px, py);
    double feature = std::sqrt(std::max(std::abs(fa.x - fb.x), std::abs(fa.y - fb.y)) / std::sqrt(2.0));
    return std::pow(color, 1 - feature);
  }
};

TEST(Flip, AgreesWithTheFormulasWrittenOut) {
  constexpr float float_rounding = 2e-4f;  // the features' square root enlarges single-precision errors near 0
  for (float ppd : {20.0f, 67.0f}) {
    Image a = noise(23, 17, 1), b = noise(23, 17, 2);
    for (size_t i = 0; i < a.rgb.size(); i += 2) b.rgb[i] = a.rgb[i];
    SlowFlip slow{double(ppd), a.width, a.height};
    auto fa = slow.opponent(a), fb = slow.opponent(b);
    auto fast = flip_map(a, b, ppd);
    for (int y = 0; y < a.height; y += 3)
      for (int x = 0; x < a.width; x += 2)
        EXPECT_NEAR(fast[size_t(y * a.width + x)], slow.error(fa, fb, x, y), float_rounding) << x << " " << y;
  }
}

TEST(Flip, HyabOfKnownColours) {
  // CIELAB of the primaries by hand from CIE 15 and the Rec. 709 matrix.
  constexpr float rounding = 1e-2f;
  const Vec3 white(100, 0, 0), green(87.7355f, -86.1816f, 83.1866f), blue(32.3009f, 79.1953f, -107.8555f);
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(cielab(Vec3(1))[k], white[k], rounding);
    EXPECT_NEAR(cielab({0, 1, 0})[k], green[k], rounding);
    EXPECT_NEAR(cielab({0, 0, 1})[k], blue[k], rounding);
  }
  EXPECT_FLOAT_EQ(hyab({50, 3, 4}, {40, 0, 0}), 15);  // 10 + 5
  EXPECT_FLOAT_EQ(hyab({40, 0, 0}, {50, 3, 4}), 15);
  EXPECT_NEAR(hyab(green, blue), 308.1135f, 1e-3f);
}

TEST(Flip, ConstantPictures) {
  // Filters of sum 1 leave them alone and the detectors see nothing, so the error is the redistributed HyAB distance:
  // black and white: 100^0.7 = 25.1189, cmax = 203.305^0.7 = 41.2766, 0.95 + 0.05 (25.1189 - 16.5106) / (41.2766
  // - 16.5106)
  constexpr float rounding = 2e-4f;  // rounding of the constant's sums leaves a feature of 1e-7, whose root counts
  auto error = [](Vec3 a, Vec3 b) {
    auto map = flip_map(constant(9, 6, a), constant(9, 6, b));
    for (float v : map) EXPECT_NEAR(v, map[0], rounding);
    return map[0];
  };
  EXPECT_NEAR(error(Vec3(0), Vec3(1)), 0.967379f, rounding);
  EXPECT_NEAR(error(Vec3(1), Vec3(0)), 0.967379f, rounding);
  EXPECT_NEAR(error({0, 1, 0}, {0, 0, 1}), 1.0f, rounding);        // the largest difference there is
  EXPECT_NEAR(error(Vec3(0), Vec3(0.5f)), 0.931485f, rounding);    // L* 53.389: below the knee
  EXPECT_NEAR(error({1, 0, 0}, Vec3(0.5f)), 0.950381f, rounding);  // Hunt-adjusted red (53.237, 42.638, 35.777)
}

TEST(Flip, IdenticalIsZeroAndOrderDoesNotMatter) {
  Image a = noise(31, 20, 5), b = noise(31, 20, 6);
  for (float v : flip_map(a, a)) EXPECT_EQ(v, 0);
  EXPECT_EQ(flip_map(a, b), flip_map(b, a));
  for (float v : flip_map(a, b)) {
    EXPECT_GE(v, 0);
    EXPECT_LE(v, 1);
  }
}

TEST(Flip, GrowsWithNoiseAndBlur) {
  Image scene(64, 48);
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x)
      scene.at(x, y) = x / 8 % 2 == y / 8 % 2 ? Vec3(0.8f, 0.7f, 0.3f) : Vec3(0.1f, 0.3f, 0.4f);
  Image grain = noise(64, 48, 9);
  double last = 0;
  for (float amplitude : {0.05f, 0.1f, 0.2f, 0.4f}) {
    Image test = scene;
    for (size_t i = 0; i < test.rgb.size(); ++i)
      test.rgb[i] = clamp(test.rgb[i] + amplitude * (grain.rgb[i] - Vec3(0.5f)), Vec3(0), Vec3(1));
    double now = mean(flip_map(scene, test));
    EXPECT_GT(now, last) << amplitude;
    last = now;
  }
  last = 0;
  for (int radius : {1, 2, 4}) {
    Image test = scene;
    for (int y = 0; y < 48; ++y)
      for (int x = 0; x < 64; ++x) {
        Vec3 sum(0);
        for (int v = -radius; v <= radius; ++v)
          for (int u = -radius; u <= radius; ++u) sum += scene.at(std::clamp(x + u, 0, 63), std::clamp(y + v, 0, 47));
        test.at(x, y) = sum / float((2 * radius + 1) * (2 * radius + 1));
      }
    double now = mean(flip_map(scene, test));
    EXPECT_GT(now, last) << radius;
    last = now;
  }
}

TEST(Flip, SmallAndNarrowPictures) {
  for (auto [w, h] : {std::pair{1, 1}, {1, 40}, {40, 1}, {2, 3}})
    EXPECT_EQ(flip_map(noise(w, h, 1), noise(w, h, 2)).size(), size_t(w * h));
}

TEST(Compare, NumbersByHand) {
  Image a(2, 1), b(2, 1);
  a.rgb = {Vec3(1, 0.5f, 0), Vec3(0.2f)};
  b.rgb = {Vec3(0, 0.5f, 0), Vec3(0.4f)};
  auto d = compare_images(a, b);
  ASSERT_TRUE(d) << d.error().text();
  constexpr double rounding = 1e-6;
  EXPECT_EQ(d->pixels, 2u);
  EXPECT_NEAR(d->rmse, std::sqrt((1 + 3 * 0.04) / 6), rounding);
  EXPECT_NEAR(d->relative_mse, (1 / 0.01 + 3 * 0.04 / 0.17) / 6, 1e-5);
  // sRGB of 0.2 is 0.484529, of 0.4 is 0.665185.
  EXPECT_NEAR(d->psnr, -10 * std::log10((1 + 3 * std::pow(0.665185 - 0.484529, 2)) / 6), 1e-4);
  EXPECT_NEAR(d->mean_a, (0.2126 + 0.5 * 0.7152 + 0.2) / 2, rounding);
  EXPECT_NEAR(d->mean_b, (0.5 * 0.7152 + 0.4) / 2, rounding);
  EXPECT_NEAR(d->flip, mean(flip_map(displayed(b, {}), displayed(a, {}))), rounding);
  auto same = compare_images(a, a);
  ASSERT_TRUE(same);
  EXPECT_EQ(same->rmse, 0);
  EXPECT_EQ(same->flip, 0);
  EXPECT_EQ(same->psnr, INFINITY);
}

TEST(Compare, ExposureTouchesWhatIsShownAlone) {
  Image a = constant(4, 4, Vec3(0.1f)), b = constant(4, 4, Vec3(0.12f));
  auto plain = compare_images(a, b), brighter = compare_images(a, b, {1, Tone::none}),
       burnt = compare_images(a, b, {10, Tone::none});
  ASSERT_TRUE(plain && brighter && burnt);
  EXPECT_EQ(plain->rmse, brighter->rmse);
  EXPECT_GT(plain->psnr, brighter->psnr);
  EXPECT_EQ(burnt->psnr, INFINITY);  // both clamped to white
}

TEST(Compare, OnlyCoveredPixelsCount) {
  Image a = constant(3, 1, Vec3(0.5f)), b = a;
  a.rgb[0] = Vec3(NAN), b.rgb[1] = Vec3(0.25f);
  a.alpha = {0, 0.5f, 0}, b.alpha = {0, 0, 1};
  auto d = compare_images(a, b);
  ASSERT_TRUE(d) << d.error().text();
  EXPECT_EQ(d->pixels, 2u);
  EXPECT_DOUBLE_EQ(d->rmse, std::sqrt(0.0625 / 2));
  EXPECT_TRUE(std::isfinite(d->flip));
  b.alpha.clear();  // the one that has alpha decides
  d = compare_images(a, b);
  ASSERT_TRUE(d);
  EXPECT_EQ(d->pixels, 1u);
  d = compare_images(b, a);
  ASSERT_TRUE(d);
  EXPECT_EQ(d->pixels, 1u);
}

TEST(Compare, AllCountsTheSurroundingsToo) {
  // An object of one pixel, half off, in four: 1/16 over it alone, 1/64 over all.
  Image a = constant(2, 2, Vec3(0)), b = a;
  a.at(0, 0) = Vec3(0.5f), b.at(0, 0) = Vec3(0.25f);
  a.alpha = b.alpha = {1, 0, 0, 0};
  auto covered = compare_images(a, b), all = compare_images(a, b, {}, true);
  ASSERT_TRUE(covered && all);
  EXPECT_EQ(covered->pixels, 1u);
  EXPECT_EQ(all->pixels, 4u);
  EXPECT_DOUBLE_EQ(covered->rmse * covered->rmse, 1 / 16.0);
  EXPECT_DOUBLE_EQ(all->rmse * all->rmse, 1 / 64.0);
  EXPECT_NEAR(all->psnr - covered->psnr, 10 * std::log10(4), 1e-9);
  EXPECT_DOUBLE_EQ(covered->mean_a, 4 * all->mean_a);
  EXPECT_GT(covered->flip, all->flip);
  b.alpha = {0, 1, 0, 0};  // what either covers
  EXPECT_EQ(compare_images(a, b)->pixels, 2u);
}

TEST(Compare, TwoNoisyReferencesSayWhatOneOfThemCannot) {
  // Off by 0.01 as displayed, each reference by noise of 0.05 / sqrt(3) at every pixel.
  constexpr int size = 128;
  auto shown = [](float v) { return srgb_decode(v); };
  Image a = constant(size, size, Vec3(shown(0.51f))), b = a, c = a;
  Random random(7);
  for (Image* image : {&b, &c})
    for (Vec3& v : image->rgb)
      for (int k = 0; k < 3; ++k) v[k] = shown(0.5f + 0.1f * (random.next() - 0.5f));
  auto d = compare_to_two(a, b, c);
  ASSERT_TRUE(d);
  EXPECT_NEAR(d->psnr, 40, 0.4);
  EXPECT_LT(d->least, 40);
  EXPECT_GT(d->most, 40);
  EXPECT_LT(d->most - d->least, 1);
  EXPECT_NEAR(d->noise, -10 * std::log10(0.01 / 12 / 2), 0.1);  // of the mean of both
  EXPECT_NEAR(d->sloped, 40, 1);                                // linear noise has another mean
  EXPECT_LT(compare_images(a, mean_of(b, c))->psnr, 34);
  EXPECT_EQ(compare_to_two(a, b, constant(3, 2, Vec3(0))).error().text(),
            "pictures differ in size: 128 x 128 and 3 x 2");
  EXPECT_EQ(compare_to_two(a, a, a)->psnr, INFINITY);
}

TEST(Compare, NoiseThatADisplayClipsCountsNotBySlope) {
  // Dark, and off by as much; references whose noise is ten times that light.
  constexpr int size = 128;
  const float dark = 0.001f;
  Image a = constant(size, size, Vec3(2 * dark)), b = a, c = a;
  Random random(8);
  for (Image* image : {&b, &c})
    for (Vec3& v : image->rgb)
      for (int k = 0; k < 3; ++k) v[k] = dark * (1 + 20 * (random.next() - 0.5f));
  const double off = 12.92 * double(dark), expected = -10 * std::log10(off * off);
  const auto d = compare_to_two(a, b, c);
  EXPECT_NEAR(d->sloped, expected, 3);
  EXPECT_GT(std::abs(d->psnr - expected), 3);
}

TEST(Compare, LitPlacesThatAreLostInBlack) {
  // Of eight pixels, b shows six lit; a has two of those, and a dark one, at 9 % of b, and one at 11 %.
  Image b = constant(4, 2, Vec3(0.5f)), a = b;
  a.at(0, 0) = b.at(0, 0) = b.at(1, 0) = Vec3(0.04f);
  a.at(1, 0) = 0.09f * b.at(1, 0);
  a.at(2, 0) = a.at(3, 1) = Vec3(0.045f), a.at(0, 1) = Vec3(0.055f);
  EXPECT_DOUBLE_EQ(compare_images(a, b)->black, 2.0 / 6);
  EXPECT_EQ(compare_images(b, a)->black, 0);
  EXPECT_EQ(compare_images(a, constant(4, 2, Vec3(0)))->black, 0);
}

TEST(Compare, Errors) {
  Image a = constant(3, 2, Vec3(0.5f));
  EXPECT_EQ(compare_images(a, constant(2, 3, Vec3(0))).error().text(), "pictures differ in size: 3 x 2 and 2 x 3");
  Image bad = a;
  bad.at(1, 1).y = INFINITY;
  EXPECT_EQ(compare_images(a, bad).error().text(), "pixel (1, 1) of the second picture is not finite");
  EXPECT_EQ(compare_images(bad, a).error().text(), "pixel (1, 1) of the first picture is not finite");
  Image empty = a;
  empty.alpha.assign(6, 0);
  EXPECT_EQ(compare_images(empty, empty).error().text(), "no pixel is covered");
  EXPECT_EQ(compare_images(Image(), Image()).error().text(), "no pixel is covered");
}

TEST(DifferencePicture, PanelsAndScale) {
  Image a = constant(60, 20, Vec3(0.25f)), b = a;
  b.at(30, 10) = Vec3(0.25f, 0.25f, 1);
  Image picture = difference_picture(a, b, {1, Tone::none}, 0.5f);
  EXPECT_EQ(picture.width, 180);
  EXPECT_EQ(picture.height, 20 + 2 * 11);
  constexpr float rounding = 1e-5f;
  EXPECT_NEAR(picture.at(30, 21).z, 0.5f, rounding);  // A, one stop brighter
  EXPECT_NEAR(picture.at(90, 21).z, 1.0f, rounding);  // B, clamped
  EXPECT_EQ(picture.at(121, 12), Vec3(0));            // no difference
  Vec3 expected = false_color((1 - srgb_encode(0.5f)) / 0.5f);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(picture.at(150, 21)[c], expected[c], 1e-4f);
  difference_picture(constant(3, 2, Vec3(0)), constant(3, 2, Vec3(1)));  // too small for labels
}

}  // namespace
}  // namespace lambent
