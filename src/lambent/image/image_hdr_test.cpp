// What Radiance's header says of the pixels. References: "Radiance File Formats"; ra_xyze of the Radiance distribution.
#include <lambent/image/image.h>

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace lambent {
namespace {

using Bytes = std::vector<uint8_t>;
using Rgbe = std::array<uint8_t, 4>;

Bytes hdr(const std::string& lines, const std::string& resolution, const std::vector<Rgbe>& pixels) {
  const std::string head = "#?RADIANCE\n" + lines + "\n" + resolution + "\n";
  Bytes out(head.begin(), head.end());
  for (const Rgbe& p : pixels) out.insert(out.end(), p.begin(), p.end());
  return out;
}

// 128 2^(129 - 136) = 1 for the mantissa 128.
constexpr Rgbe ones{128, 128, 128, 129}, colored{128, 64, 32, 129};

ImageFile loaded(const Bytes& bytes) {
  auto file = load_image_file(bytes, "a.hdr");
  EXPECT_TRUE(file) << file.error().text();
  return file ? *file : ImageFile{.image = Image(1, 1)};
}

void expect_near(Vec3 a, Vec3 b, float tolerance) {
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(a[k], b[k], tolerance) << k;
}

TEST(HdrHeader, ExposureAndCorrectionAreDividedOut) {
  ImageFile file = loaded(hdr("EXPOSURE= 2.5\nEXPOSURE=4\nCOLORCORR=2 1 0.5\n", "-Y 1 +X 1", {ones}));
  EXPECT_EQ(file.image.rgb[0], Vec3(0.05f, 0.1f, 0.2f));
  EXPECT_EQ(file.warnings, std::vector<std::string>{"a.hdr: EXPOSURE 10 and COLORCORR divided out of the pixels"});
  // Indented lines are those of pictures that this one was made of.
  file =
      loaded(hdr("\tEXPOSURE=7\nEXPOSURE=1.0000000000000\nGAMMA=1\nPRIMARIES=0 0 0 0 0 0 0 0\n", "-Y 1 +X 1", {ones}));
  EXPECT_EQ(file.image.rgb[0], Vec3(1));
  EXPECT_TRUE(file.warnings.empty());
  file = loaded(hdr("EXPOSURE=-1\nCOLORCORR=1 2\nGAMMA=2.2\nPRIMARIES=1 2 3\n", "-Y 1 +X 1", {ones}));
  EXPECT_EQ(file.image.rgb[0], Vec3(1));
  EXPECT_EQ(file.warnings, (std::vector<std::string>{"a.hdr: EXPOSURE is left aside: it is no positive number",
                                                     "a.hdr: COLORCORR is left aside: it is not three positive numbers",
                                                     "a.hdr: GAMMA is left aside: pixels are taken as linear",
                                                     "a.hdr: PRIMARIES is left aside: it is not eight numbers"}));
  EXPECT_EQ(load_image(hdr("EXPOSURE=1e-30\nEXPOSURE=1e-30\n", "-Y 1 +X 1", {ones}), "a.hdr").error().text(),
            "a.hdr: its EXPOSURE and COLORCORR are out of range");
}

TEST(HdrHeader, AllEightOrientations) {
  // A picture of 3 x 2 whose pixel (x, y) from the top left has the mantissa 128 + 10 y + x.
  const auto value = [](int x, int y) { return uint8_t(128 + 10 * y + x); };
  for (const std::string y_axis : {"-Y", "+Y"})
    for (const std::string x_axis : {"+X", "-X"})
      for (bool columns : {false, true}) {
        // As a writer would: y falls from the top with -Y, x grows from the left with +X.
        std::vector<Rgbe> pixels;
        for (int i = 0; i < 6; ++i) {
          const int first = columns ? i / 2 : i / 3, second = columns ? i % 2 : i % 3;
          int x = columns ? first : second, y = columns ? second : first;
          if (x_axis == "-X") x = 2 - x;
          if (y_axis == "+Y") y = 1 - y;
          pixels.push_back({value(x, y), 0, 0, 136});
        }
        const std::string line = columns ? x_axis + " 3 " + y_axis + " 2" : y_axis + " 2 " + x_axis + " 3";
        const Image image = loaded(hdr("", line, pixels)).image;
        ASSERT_EQ(image.width, 3) << line;
        ASSERT_EQ(image.height, 2) << line;
        for (int y = 0; y < 2; ++y)
          for (int x = 0; x < 3; ++x) EXPECT_EQ(image.at(x, y).x, float(value(x, y))) << line << " " << x << " " << y;
      }
}

TEST(HdrHeader, ColumnsInRunsToo) {
  // The newer code over a column of 8: runs of one value a plane.
  Bytes bytes = hdr("", "+X 2 -Y 8", {});
  for (uint8_t red : {7, 9})
    for (int v : {2, 2, 0, 8, 136, int(red), 136, 1, 136, 2, 136, 136}) bytes.push_back(uint8_t(v));
  const Image image = loaded(bytes).image;
  ASSERT_EQ(image.width, 2);
  ASSERT_EQ(image.height, 8);
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 2; ++x) EXPECT_EQ(image.at(x, y), Vec3(x == 0 ? 7.0f : 9.0f, 1, 2));
}

TEST(HdrHeader, XyzIsConverted) {
  const std::string xyze = "FORMAT=32-bit_rle_xyze\n";
  // Radiance's white is that of equal energy, X = Y = Z.
  constexpr float rounding = 2e-4f;
  expect_near(loaded(hdr(xyze, "-Y 1 +X 1", {ones})).image.rgb[0], Vec3(1), rounding);
  // With Rec. 709's white: XYZ of its green, by IEC 61966-2-1, is (0.3576, 0.7152, 0.1192).
  const std::string rec709 = "PRIMARIES=0.640 0.330 0.300 0.600 0.150 0.060 0.3127 0.3290\n";
  constexpr float half_step = 0.5f / 128;
  const Rgbe green{uint8_t(std::lround(0.3576 * 256)), uint8_t(std::lround(0.7152 * 256)),
                   uint8_t(std::lround(0.1192 * 256)), 128};
  expect_near(loaded(hdr(xyze + rec709, "-Y 1 +X 1", {green})).image.rgb[0], {0, 1, 0}, 3.3f * half_step);
  // ra_xyze's change from watts to candelas is no exposure: as stored.
  ImageFile file = loaded(hdr(xyze + "EXPOSURE=5.586592e-03\n", "-Y 1 +X 1", {ones}));
  expect_near(file.image.rgb[0], Vec3(1), rounding);
  EXPECT_TRUE(file.warnings.empty());
  expect_near(loaded(hdr(xyze + "EXPOSURE=2\n", "-Y 1 +X 1", {ones})).image.rgb[0], Vec3(0.5f), rounding);
}

TEST(HdrHeader, PrimariesAreConverted) {
  // Red of Rec. 2020 (ITU-R BT.2087).
  const std::string rec2020 = "PRIMARIES=0.708 0.292 0.170 0.797 0.131 0.046 0.3127 0.3290\n";
  constexpr float four_digits = 1e-4f;
  expect_near(loaded(hdr(rec2020, "-Y 1 +X 1", {{128, 0, 0, 129}})).image.rgb[0], {1.6605f, -0.1246f, -0.0182f},
              four_digits);
  const std::string rec709 = "PRIMARIES=0.640 0.330 0.300 0.600 0.150 0.060 0.3127 0.3290\n";
  EXPECT_EQ(loaded(hdr(rec709, "-Y 1 +X 1", {colored})).image.rgb[0], Vec3(1, 0.5f, 0.25f));
  EXPECT_EQ(load_image(hdr("PRIMARIES=1 1 1 1 1 1 1 1\n", "-Y 1 +X 1", {ones}), "a.hdr").error().text(),
            "a.hdr: PRIMARIES: chromaticities do not span a colour space");
}

}  // namespace
}  // namespace lambent
