// Which of the layers and parts of an OpenEXR file is read, and its chroma.
#include <lambent/core/file.h>
#include <lambent/image/image.h>

#include <ImfMultiPartOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfRgbaFile.h>
#include <exr_maker.h>
#include <gtest/gtest.h>

#include <array>

#include "temporary_folder.h"

namespace lambent {
namespace {

using test::Bytes, test::Maker, test::Output;

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

}  // namespace
}  // namespace lambent
