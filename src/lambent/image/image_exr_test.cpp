#include <lambent/core/file.h>
#include <lambent/core/random.h>
#include <lambent/image/image.h>

#include <ImfMultiPartOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfRgbaFile.h>
#include <exr_maker.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <filesystem>

namespace lambent {
namespace {

using test::Bytes, test::Maker, test::Output;

Bytes encoded(const Image& image) {
  auto bytes = encode_exr(image, "a.exr");
  EXPECT_TRUE(bytes);
  return *bytes;
}

TEST(Exr, SingleRoundTripIsExactBeyondHalf) {
  Image image(7, 4);
  Random random(11);
  for (Vec3& c : image.rgb)
    for (int k = 0; k < 3; ++k) c[k] = 1e6f * float(random.next()) - 1e5f;
  image.rgb[2] = {1.6e5f, 1e-20f, 3e30f};
  auto bytes = encode_exr(image, "a.exr", ExrPrecision::single);
  ASSERT_TRUE(bytes);
  auto back = load_image(*bytes, "a.exr");
  ASSERT_TRUE(back) << back.error().text();
  EXPECT_EQ(back->rgb, image.rgb);
  EXPECT_TRUE(back->alpha.empty());
}

TEST(Exr, HalfRoundTripIsExact) {
  Image image(5, 3);
  Random random(7);
  for (Vec3& c : image.rgb)
    for (int k = 0; k < 3; ++k) c[k] = float(half(1000 * random.next() - 100));
  image.rgb[3] = {65504, -65504, 0x1p-24f};
  image.alpha.assign(15, 0.25f);
  image.alpha[7] = 1;
  auto back = load_image(encoded(image), "a.exr");
  ASSERT_TRUE(back) << back.error().text();
  EXPECT_EQ(back->width, 5);
  EXPECT_EQ(back->rgb, image.rgb);
  EXPECT_EQ(back->alpha, image.alpha);
  image.alpha.clear();
  back = load_image(encoded(image), "a.exr");
  ASSERT_TRUE(back);
  EXPECT_TRUE(back->alpha.empty());
}

TEST(Exr, BeyondHalfIsClampedAndNotANumberKept) {
  Image image(2, 1);
  image.rgb = {Vec3(1e6f, -1e9f, 65505), Vec3(NAN, INFINITY, -INFINITY)};
  auto back = load_image(encoded(image), "a.exr");
  ASSERT_TRUE(back);
  EXPECT_EQ(back->rgb[0], Vec3(65504, -65504, 65504));
  EXPECT_TRUE(std::isnan(back->rgb[1].x));
  EXPECT_EQ(back->rgb[1].y, INFINITY);
  EXPECT_EQ(back->rgb[1].z, -INFINITY);
}

TEST(Exr, LightBeyondHalfIsSavedInSinglePrecision) {
  Image image(2, 1);
  image.rgb = {Vec3(1e6f, -1e9f, 65505), Vec3(0.1f, 2, 3)};
  const std::string path = testing::TempDir() + "/lambent_exr_bright_" + std::to_string(::getpid()) + ".exr";
  ASSERT_TRUE(save_image(path, image));
  auto back = load_image(path);
  std::filesystem::remove(path);
  ASSERT_TRUE(back) << back.error().text();
  EXPECT_EQ(back->rgb, image.rgb);
}

TEST(Exr, SaveWritesTheSameBytesTwice) {
  Image image(9, 4);
  for (size_t i = 0; i < image.rgb.size(); ++i) image.rgb[i] = Vec3(float(i), 1, 2);
  std::string path = testing::TempDir() + "/lambent_exr_" + std::to_string(::getpid()) + ".exr";
  ASSERT_TRUE(save_image(path, image, {3, Tone::none}));
  auto bytes = read_file(path);
  ASSERT_TRUE(bytes);
  EXPECT_EQ(*bytes, encoded(image));
  auto back = load_image(path);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->rgb, image.rgb);  // the exposure does not touch an EXR
  std::filesystem::remove(path);
}

void expect_window(const Image& image, int channels) {
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      for (int c = 0; c < channels; ++c)
        ASSERT_EQ(image.at(x, y)[c], 0.25f * float(c) + float(x) + 16 * float(y)) << x << " " << y;
}

TEST(Exr, EveryLosslessCompressionFloatHalfAndWhole) {
  for (auto compression :
       {Imf::NO_COMPRESSION, Imf::RLE_COMPRESSION, Imf::ZIPS_COMPRESSION, Imf::ZIP_COMPRESSION, Imf::PIZ_COMPRESSION})
    for (bool tiled : {false, true})
      for (auto type : {Imf::FLOAT, Imf::HALF}) {
        Maker maker(10, 7, {"R", "G", "B"}, type);
        maker.header.compression() = compression, maker.tiled = tiled;
        auto image = load_image(maker.bytes(), "a.exr");
        ASSERT_TRUE(image) << image.error().text();
        ASSERT_EQ(image->width, 10);
        ASSERT_EQ(image->height, 7);
        expect_window(*image, 3);
      }
  Maker whole(4, 4, {"R", "G", "B"}, Imf::UINT);
  whole.value = [](size_t c, int x, int y) { return float(100 * int(c) + 10 * y + x); };
  auto image = load_image(whole.bytes(), "a.exr");
  ASSERT_TRUE(image);
  EXPECT_EQ(image->at(3, 2), Vec3(23, 123, 223));
}

TEST(Exr, LossyCompressionsRead) {
  for (auto compression : {Imf::PXR24_COMPRESSION, Imf::B44_COMPRESSION, Imf::B44A_COMPRESSION, Imf::DWAA_COMPRESSION,
                           Imf::DWAB_COMPRESSION}) {
    Maker maker(32, 20, {"R", "G", "B"}, Imf::HALF);
    maker.header.compression() = compression;
    maker.value = [](size_t, int, int) { return 0.5f; };
    auto image = load_image(maker.bytes(), "a.exr");
    ASSERT_TRUE(image) << image.error().text();
    constexpr float loss = 0.01f;  // far above what any of them does to a constant
    EXPECT_NEAR(image->at(17, 11).y, 0.5f, loss);
  }
}

TEST(Exr, DisplayWindowIsThePicture) {
  // 6 x 5 pixels at (2, 1) of a picture whose corner is (-3, 7).
  Maker maker(6, 5, {"R", "G", "B", "A"});
  maker.header.displayWindow() = Imath::Box2i({-3, 7}, {6, 15});
  maker.header.dataWindow() = Imath::Box2i({-1, 8}, {4, 12});
  maker.value = [](size_t c, int x, int y) { return c == 3 ? 1 : 1 + float(c) + float(x) + 16 * float(y); };
  auto image = load_image(maker.bytes(), "a.exr");
  ASSERT_TRUE(image) << image.error().text();
  ASSERT_EQ(image->width, 10);
  ASSERT_EQ(image->height, 9);
  for (int y = 0; y < 9; ++y)
    for (int x = 0; x < 10; ++x) {
      const bool stored = x >= 2 && x < 8 && y >= 1 && y < 6;
      const float v = stored ? 1 + float(x - 2) + 16 * float(y - 1) : 0;
      EXPECT_EQ(image->at(x, y), stored ? Vec3(v, v + 1, v + 2) : Vec3(0)) << x << " " << y;
      EXPECT_EQ(image->alpha[size_t(y * 10 + x)], stored ? 1 : 0);
    }
  // More is stored than shown: what lies outside is left aside.
  maker.header.displayWindow() = Imath::Box2i({0, 9}, {1, 10});
  std::vector<std::string> warnings;
  image = load_image(maker.bytes(), "a.exr", &warnings);
  EXPECT_EQ(warnings, std::vector<std::string>{"a.exr: pixels outside its display window are left aside"});
  ASSERT_TRUE(image) << image.error().text();
  ASSERT_EQ(image->rgb.size(), 4u);
  EXPECT_EQ(image->at(1, 1).x, 1 + 2 + 16 * 2);
  maker.header.displayWindow() = Imath::Box2i({5, 8}, {9, 12});
  EXPECT_EQ(load_image(maker.bytes(), "a.exr").error().text(), "a.exr: its pixels lie outside its display window");
  maker.header.displayWindow() = Imath::Box2i({0, 0}, {32767, 32767});
  EXPECT_EQ(load_image(maker.bytes(), "a.exr").error().text(),
            "a.exr: image of 32768 x 32768 is larger than 2^28 pixels");
}

TEST(Exr, SubsetsOfChannels) {
  auto grey = load_image(Maker(3, 2, {"Y"}).bytes(), "a.exr");
  ASSERT_TRUE(grey);
  EXPECT_EQ(grey->at(2, 1), Vec3(18));
  auto green = load_image(Maker(3, 2, {"G"}).bytes(), "a.exr");
  ASSERT_TRUE(green);
  EXPECT_EQ(green->at(2, 1), Vec3(0, 18, 0));
  Maker depth(3, 2, {"R", "Z"});
  depth.channels[1].second.xSampling = 3,
  depth.channels[1].second.ySampling = 2;  // not asked for, so it may be anything
  auto red = load_image(depth.bytes(), "a.exr");
  ASSERT_TRUE(red) << red.error().text();
  EXPECT_EQ(red->at(2, 1), Vec3(18, 0, 0));
}

TEST(Exr, WhatIsNotReadIsNamed) {
  auto message = [](const Bytes& bytes) {
    auto image = load_image(bytes, "a.exr");
    return image ? std::string("read") : image.error().text();
  };
  EXPECT_EQ(message(Maker(2, 2, {"Z", "depth.V"}).bytes()), "a.exr: no channel named R, G, B or Y; it has Z, depth.V");
  EXPECT_EQ(message(Maker(2, 2, {"normal.X", "normal.Y", "normal.Z"}).bytes()),
            "a.exr: no channel named R, G, B or Y; it has normal.X, normal.Y, normal.Z");
  EXPECT_EQ(message(Maker(2, 2, {"Y", "RY"}).bytes()), "a.exr: has one channel of chroma, RY or BY, and not the other");
  Maker chroma(4, 4, {"Y", "RY", "BY"});
  for (size_t c : {1, 2}) chroma.channels[c].second.xSampling = chroma.channels[c].second.ySampling = 4;
  EXPECT_EQ(message(chroma.bytes()),
            "a.exr: chroma is neither as fine as luminance nor, in the first part, half as fine");
  Maker coarse(2, 2, {"R", "G"});
  coarse.channels[1].second.xSampling = 2;
  EXPECT_EQ(message(coarse.bytes()), "a.exr: channel G is subsampled");
  Bytes bytes = Maker(2, 2, {"R"}).bytes();
  bytes[5] |= 0x08;
  EXPECT_EQ(message(bytes), "a.exr: deep pixels are not read");
  bytes[5] = 0x10;  // says several parts, and has the header of one
  EXPECT_EQ(message(bytes), "read");
  bytes[5] = 0, bytes[4] = 1;
  EXPECT_EQ(message(bytes), "a.exr: OpenEXR version is not 2");
  Maker deep(2, 2, {"R"});
  deep.header.setType(Imf::SCANLINEIMAGE);
  bytes = deep.bytes();
  const std::string kind = "scanlineimage", other = "deepscanlines";
  auto at = std::search(bytes.begin(), bytes.end(), kind.begin(), kind.end());
  ASSERT_NE(at, bytes.end());
  std::copy(other.begin(), other.end(), at);
  EXPECT_EQ(message(bytes), "a.exr: deep pixels are not read");
}

// Puts a data window of the given size into a file that holds a few pixels only.
std::string message_for_window(int x0, int y0, int x1, int y1) {
  Bytes bytes = Maker(2, 2, {"R", "G", "B"}).bytes();
  const std::string name("dataWindow\0box2i\0", 17);
  auto at = std::search(bytes.begin(), bytes.end(), name.begin(), name.end());
  int window[] = {x0, y0, x1, y1};
  std::memcpy(&*at + name.size() + 4, window, sizeof window);
  auto image = load_image(bytes, "a.exr");
  return image ? "read" : image.error().text();
}

TEST(Exr, SizesThatCannotBeAreRefusedBeforeAllocating) {
  EXPECT_EQ(message_for_window(0, 0, 1, 1), "read");
  EXPECT_EQ(message_for_window(0, 0, 65535, 65535), "a.exr: image of 65536 x 65536 is larger than 2^28 pixels");
  EXPECT_EQ(message_for_window(0, 0, 16383, 16383),
            "a.exr: image of 16384 x 16384 does not fit its few bytes: at most 8192 pixels a byte beyond 2^22");
  EXPECT_EQ(message_for_window(0, 0, 0, (1 << 21) - 1), "a.exr: truncated: fewer bytes than the table of rows needs");
  const std::string bad = "a.exr: bad attribute \"dataWindow\" in the header";
  EXPECT_EQ(message_for_window(0, 0, -1, 5), bad);
  EXPECT_EQ(message_for_window(0, 7, 5, 5), bad);
  EXPECT_EQ(message_for_window(-2147483647 - 1, 0, 2147483647, 0), bad);
  EXPECT_EQ(message_for_window(0, 2147483646, 0, 2147483647), bad);
}

TEST(Exr, EveryTruncationIsAnError) {
  for (bool tiled : {false, true}) {
    Maker maker(6, 5, {"R", "G", "B", "A"}, Imf::HALF);
    maker.tiled = tiled;
    Bytes bytes = maker.bytes();
    ASSERT_TRUE(load_image(bytes, "a.exr"));
    for (size_t size = 0; size < bytes.size(); ++size) {
      auto image = load_image(std::span(bytes).first(size), "a.exr");
      ASSERT_FALSE(image) << size << " of " << bytes.size();
      std::string text = image.error().text();
      EXPECT_TRUE(text.find('\n') == text.npos && text.back() != '.' && text.find("a.exr", 5) == text.npos) << text;
    }
  }
}

TEST(Exr, EveryFlippedByteIsSafe) {
  for (auto compression : {Imf::ZIP_COMPRESSION, Imf::PIZ_COMPRESSION, Imf::B44_COMPRESSION, Imf::DWAA_COMPRESSION}) {
    Maker maker(6, 5, {"R", "G", "B"}, Imf::HALF);
    maker.header.compression() = compression;
    Bytes bytes = maker.bytes();
    for (size_t i = 0; i < bytes.size(); ++i) {
      Bytes broken = bytes;
      broken[i] ^= 0xff;
      auto image = load_image(broken, "a.exr");
      if (image) {
        EXPECT_EQ(image->rgb.size(), size_t(image->width) * size_t(image->height));
      }
    }
  }
}

// --- Chromaticities

void expect_matrix(const Mat3& m, const float (&rows)[3][3], float tolerance) {
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(m[c][r], rows[r][c], tolerance) << r << " " << c;
}

TEST(Primaries, PublishedMatrices) {
  constexpr float four_digits = 1e-4f, five_digits = 2e-5f;
  auto rec2020 = rec709_from_primaries({0.708f, 0.292f}, {0.170f, 0.797f}, {0.131f, 0.046f}, {0.3127f, 0.3290f});
  ASSERT_TRUE(rec2020);
  // ITU-R BT.2087, equation for BT.2020 to BT.709.
  expect_matrix(*rec2020, {{1.6605f, -0.5876f, -0.0728f}, {-0.1246f, 1.1329f, -0.0083f}, {-0.0182f, -0.1006f, 1.1187f}},
                four_digits);
  // ACEScg, whose white is not D65, by the Academy's Bradford-adapted matrix.
  auto acescg = rec709_from_primaries({0.713f, 0.293f}, {0.165f, 0.830f}, {0.128f, 0.044f}, {0.32168f, 0.33767f});
  ASSERT_TRUE(acescg);
  expect_matrix(*acescg,
                {{1.70505f, -0.62179f, -0.08326f}, {-0.13026f, 1.14080f, -0.01055f}, {-0.02400f, -0.12897f, 1.15297f}},
                five_digits);
  auto same = rec709_from_primaries({0.64f, 0.33f}, {0.30f, 0.60f}, {0.15f, 0.06f}, {0.3127f, 0.3290f});
  ASSERT_TRUE(same);
  expect_matrix(*same, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, 1e-6f);
}

TEST(Primaries, WhiteStaysWhiteAndNonsenseIsRefused) {
  auto m = rec709_from_primaries({0.7f, 0.28f}, {0.2f, 0.7f}, {0.14f, 0.05f}, {0.3457f, 0.3585f});
  ASSERT_TRUE(m);
  constexpr float rounding = 1e-6f;
  for (int c = 0; c < 3; ++c) EXPECT_NEAR((*m * Vec3(1))[c], 1, rounding);
  EXPECT_FALSE(rec709_from_primaries({0.1f, 0.1f}, {0.2f, 0.2f}, {0.3f, 0.3f}, {0.3127f, 0.3290f}));
  EXPECT_FALSE(rec709_from_primaries({0.64f, 0.33f}, {0.30f, 0.60f}, {0.15f, 0.06f}, {0.3f, 0}));
  EXPECT_FALSE(rec709_from_primaries({NAN, 0.33f}, {0.30f, 0.60f}, {0.15f, 0.06f}, {0.3127f, 0.3290f}));
}

TEST(Primaries, FilesAreConverted) {
  Maker maker(2, 1, {"R", "G", "B"});
  maker.value = [](size_t c, int x, int) { return x == 0 ? (c == 0 ? 1.0f : 0.0f) : 3.0f; };
  Imf::addChromaticities(maker.header,
                         Imf::Chromaticities({0.708f, 0.292f}, {0.170f, 0.797f}, {0.131f, 0.046f}, {0.3127f, 0.3290f}));
  auto image = load_image(maker.bytes(), "a.exr");
  ASSERT_TRUE(image);
  constexpr float four_digits = 1e-4f;
  const float red[] = {1.6605f, -0.1246f, -0.0182f};
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(image->rgb[0][c], red[c], four_digits);
    EXPECT_NEAR(image->rgb[1][c], 3, four_digits);
  }
  // Rec. 709 itself, printed with a rounding error or as ICC profiles adapt it to D50, changes nothing at all.
  for (auto chromaticities :
       {Imf::Chromaticities({0.64001f, 0.33f}, {0.30f, 0.60f}, {0.15f, 0.06f}, {0.31271f, 0.32902f}),
        Imf::Chromaticities({0.6484f, 0.3309f}, {0.3212f, 0.5979f}, {0.1559f, 0.0660f}, {0.3457f, 0.3585f})}) {
    Maker same(2, 1, {"R", "G", "B"});
    Imf::addChromaticities(same.header, chromaticities);
    image = load_image(same.bytes(), "a.exr");
    ASSERT_TRUE(image);
    expect_window(*image, 3);
  }
}

}  // namespace
}  // namespace lambent
