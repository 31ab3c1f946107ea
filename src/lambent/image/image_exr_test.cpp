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

#include "temporary_folder.h"

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

// --- Layers, parts, chroma

std::string taken(const Bytes& bytes, float* red = nullptr, const std::string& path = "a.exr") {
  auto file = load_image_file(bytes, path);
  if (!file) return file.error().text();
  if (red) *red = file->image.rgb[0].x;
  return file->warnings.empty() ? "" : file->warnings[0];
}

// Channel c is c + 1 everywhere.
Bytes layers(std::initializer_list<const char*> names) {
  Maker maker(2, 2, names);
  maker.value = [](size_t c, int, int) { return float(c) + 1; };
  return maker.bytes();
}

TEST(ExrLayers, TheOneThatCanBeMeantIsTaken) {
  float red = 0;
  EXPECT_EQ(taken(layers({"depth.Z", "ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B"}), &red),
            "");
  EXPECT_EQ(red, 2);
  EXPECT_EQ(taken(layers({"left.R", "left.G", "left.B", "R", "G", "B"}), &red), "");  // the one without a name
  EXPECT_EQ(red, 4);
  EXPECT_EQ(taken(layers({"sky.red", "sky.green", "sky.blue", "sky.alpha"}), &red), "");
  EXPECT_EQ(red, 1);
  EXPECT_EQ(taken(layers({"light.Y", "normal.X", "normal.Y", "normal.Z"}), &red), "");
  EXPECT_EQ(red, 1);
  EXPECT_EQ(taken(layers({"Crypto00.r", "Crypto00.g", "Crypto00.b", "V.Beauty.R", "V.Beauty.G"}), &red), "");
  EXPECT_EQ(red, 4);
  EXPECT_EQ(taken(layers({"V.DiffCol.R", "V.Emit.R", "V.Combined.R"}), &red),
            "a.exr: of its pictures V.Combined is taken, and left aside V.DiffCol, V.Emit");
  EXPECT_EQ(red, 3);
  EXPECT_EQ(taken(layers({"V.Combined.R", "Composite.Combined.R"}), &red),
            "a.exr: of its pictures Composite.Combined is taken, and left aside V.Combined");
  EXPECT_EQ(red, 2);
  EXPECT_EQ(
      taken(layers({"V.DiffCol.R", "V.Emit.R"})),
      "a.exr: has several pictures, and none that alone can be meant: V.DiffCol, V.Emit; FILE.exr#NAME takes one");
}

// Parts of one channel each, named by the part, of which every pixel is 1 for the first, 2 for the second.
Bytes parts(const std::vector<std::pair<std::string, std::string>>& named,
            const std::vector<Imath::Box2i>& windows = {}) {
  std::vector<Imf::Header> headers;
  for (size_t i = 0; i < named.size(); ++i) {
    Imf::Header header(4, 3);
    if (i < windows.size()) header.dataWindow() = windows[i];
    header.setName(named[i].first), header.setType(Imf::SCANLINEIMAGE);
    header.channels().insert(named[i].second, Imf::Channel(Imf::FLOAT));
    headers.push_back(header);
  }
  Output out;
  {
    Imf::MultiPartOutputFile file(out, headers.data(), int(headers.size()), false, 0);
    for (size_t i = 0; i < named.size(); ++i) {
      const Imath::Box2i window = headers[i].dataWindow();
      const size_t width = size_t(window.max.x - window.min.x + 1), height = size_t(window.max.y - window.min.y + 1);
      std::vector<float> plane(width * height, float(i) + 1);
      Imf::FrameBuffer slices;
      slices.insert(named[i].second,
                    Imf::Slice::Make(Imf::FLOAT, plane.data(), window, sizeof(float), sizeof(float) * width));
      Imf::OutputPart part(file, int(i));
      part.setFrameBuffer(slices);
      part.writePixels(int(height));
    }
  }
  return std::move(out.bytes);
}

TEST(ExrLayers, OneMayBeNamed) {
  float red = 0;
  const Bytes two = layers({"V.DiffCol.R", "V.Emit.R", "R", "V.Emit.Z"});
  EXPECT_EQ(taken(two, &red, "a.exr#V.Emit"), "");
  EXPECT_EQ(red, 2);
  EXPECT_EQ(taken(two, &red, "a.exr#V.DiffCol"), "");
  EXPECT_EQ(red, 1);
  EXPECT_EQ(taken(two, &red, "a.exr#R, G, B"), "");
  EXPECT_EQ(red, 3);
  EXPECT_EQ(taken(two, &red, "a.exr#Emit"), "a.exr#Emit: no picture is called that; it has R, G, B, V.DiffCol, V.Emit");
  const Bytes in_parts = parts({{"diffuse", "R"}, {"specular", "key.R"}, {"coat", "key.R"}});
  EXPECT_EQ(taken(in_parts, &red, "a.EXR#specular"), "");
  EXPECT_EQ(red, 2);
  EXPECT_EQ(taken(in_parts, &red, "a.exr#coat/key"), "");
  EXPECT_EQ(red, 3);
  EXPECT_EQ(taken(in_parts, &red, "a.exr#key"),
            "a.exr#key: more than one picture is called that; it has diffuse, specular/key, coat/key");
  const std::string png = "\x89PNG\r\n\x1a\n";
  EXPECT_EQ(taken(Bytes(png.begin(), png.end()), &red, "a.exr#key"), "a.exr#key: only OpenEXR files have layers");
}

// From a file, whose own name may have a # in it.
TEST(ExrLayers, AreNamedBehindTheFile) {
  const test::TemporaryFolder folder;
  const Bytes two = layers({"V.DiffCol.R", "V.Emit.R"});
  for (const char* name : {"a.exr", "b#1.exr", "c.exr#2.exr"})
    ASSERT_TRUE(write_file_atomically(folder.file(name), std::string(two.begin(), two.end())));
  for (const char* name : {"a.exr", "b#1.exr", "c.exr#2.exr"}) {
    const std::string file = folder.file(name);
    auto emitted = load_image(file + "#V.Emit");
    ASSERT_TRUE(emitted) << emitted.error().text();
    EXPECT_EQ(emitted->rgb[0].x, 2);
    EXPECT_FALSE(load_image(file));
  }
  EXPECT_FALSE(load_image(folder.file("d.exr#V.Emit")));
}

TEST(ExrParts, TheOneThatCanBeMeantIsTaken) {
  float red = 0;
  EXPECT_EQ(taken(parts({{"depth", "Z"}, {"light", "R"}}), &red), "");
  EXPECT_EQ(red, 2);
  EXPECT_EQ(taken(parts({{"diffuse", "R"}, {"rgba", "R"}}), &red),
            "a.exr: of its pictures rgba is taken, and left aside diffuse");
  EXPECT_EQ(red, 2);
  EXPECT_EQ(taken(parts({{"main", "R"}, {"diffuse", "diffuse.R"}}), &red), "");  // the one without a layer
  EXPECT_EQ(red, 1);
  EXPECT_EQ(taken(parts({{"left", "R"}, {"right", "R"}, {"depth", "Z"}})),
            "a.exr: has several pictures, and none that alone can be meant: left, right; FILE.exr#NAME takes one");
  EXPECT_EQ(taken(parts({{"a", "Z"}, {"b", "V"}})), "a.exr: no channel named R, G, B or Y; it has a/Z, b/V");
  // Its own data window in the display window of all.
  auto image = load_image(parts({{"depth", "Z"}, {"light", "R"}}, {{{0, 0}, {3, 2}}, {{1, 1}, {2, 1}}}), "a.exr");
  ASSERT_TRUE(image) << image.error().text();
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 4; ++x) EXPECT_EQ(image->at(x, y).x, y == 1 && (x == 1 || x == 2) ? 2 : 0) << x << " " << y;
}

TEST(ExrParts, EveryTruncationAndFlippedByteIsSafe) {
  const Bytes bytes = parts({{"depth", "Z"}, {"light", "R"}});
  for (size_t size = 0; size < bytes.size(); ++size)
    ASSERT_FALSE(load_image(std::span(bytes).first(size), "a.exr")) << size << " of " << bytes.size();
  for (size_t i = 0; i < bytes.size(); ++i) {
    Bytes broken = bytes;
    broken[i] ^= 0xff;
    auto image = load_image(broken, "a.exr");
    if (!image) {
      EXPECT_EQ(image.error().text().find('\n'), std::string::npos);
    }
  }
}

TEST(ExrChroma, AsFineAsLuminanceByItsDefinition) {
  // RGB (0.8, 0.4, 0.1): Y = 0.2126 R + 0.7152 G + 0.0722 B, RY = (R - Y) / Y, BY = (B - Y) / Y.
  const float y = 0.2126f * 0.8f + 0.7152f * 0.4f + 0.0722f * 0.1f;
  Maker maker(3, 2, {"Y", "RY", "BY", "A"});
  maker.value = [&](size_t c, int, int) { return std::array{y, (0.8f - y) / y, (0.1f - y) / y, 0.5f}[c]; };
  auto image = load_image(maker.bytes(), "a.exr");
  ASSERT_TRUE(image) << image.error().text();
  constexpr float four_digits = 1e-4f;
  EXPECT_NEAR(image->at(2, 1).x, 0.8f, four_digits);
  EXPECT_NEAR(image->at(2, 1).y, 0.4f, four_digits);
  EXPECT_NEAR(image->at(2, 1).z, 0.1f, four_digits);
  EXPECT_EQ(image->alpha[5], 0.5f);
}

TEST(ExrChroma, HalfAsFineIsWhatWasWritten) {
  // By OpenEXR's own writer, from colours that its filters keep: smooth ones.
  constexpr int width = 64, height = 32;
  const auto color = [](int x, int y) {
    const float s = 0.5f + 0.3f * std::sin(float(x) / 12), t = 0.5f + 0.3f * std::cos(float(y) / 9);
    return Vec3(1 + s, 1 + t, 2 - s * t);
  };
  std::vector<Imf::Rgba> pixels(width * height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const Vec3 c = color(x, y);
      pixels[size_t(y * width + x)] = Imf::Rgba(c.x, c.y, c.z, 0.25f);
    }
  Output out;
  {
    Imf::Header header(width, height);
    header.dataWindow() = header.displayWindow() = Imath::Box2i({4, -6}, {4 + width - 1, -6 + height - 1});
    Imf::RgbaOutputFile file(out, header, Imf::WRITE_YCA, 0);
    file.setFrameBuffer(pixels.data() - 4 + 6 * width, 1, width);
    file.writePixels(height);
  }
  auto image = load_image(out.bytes, "a.exr");
  ASSERT_TRUE(image) << image.error().text();
  ASSERT_EQ(image->width, width);
  constexpr float loss = 0.02f;  // seven bits of luminance and five of chroma are kept
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(image->at(x, y)[k] / color(x, y)[k], 1, loss) << x << " " << y;
  EXPECT_EQ(image->alpha[7], 0.25f);
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
