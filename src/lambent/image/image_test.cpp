#include <lambent/core/file.h>
#include <lambent/core/random.h>
#include <lambent/image/compare.h>
#include <lambent/image/image.h>

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <set>

namespace lambent {
namespace {

using Bytes = std::vector<uint8_t>;

std::string temporary(const std::string& name) {
  return testing::TempDir() + "/lambent_image_" + std::to_string(::getpid()) + "_" + name;
}

std::string data_folder() {
  if (const char* named = std::getenv("LAMBENT_DATA")) return named;
  return (std::filesystem::path(__FILE__).parent_path() / "../../../../shared/data").lexically_normal().string();
}

void append(Bytes& out, const std::string& text) { out.insert(out.end(), text.begin(), text.end()); }

Bytes hdr_header(int width, int height, const std::string& lines = "FORMAT=32-bit_rle_rgbe\n") {
  Bytes out;
  append(out, "#?RADIANCE\n" + lines + "\n-Y " + std::to_string(height) + " +X " + std::to_string(width) + "\n");
  return out;
}

// Pixel i of the test pictures: mantissas and exponents that differ in all channels.
std::array<uint8_t, 4> test_rgbe(size_t i) {
  return {uint8_t(128 + i * 7 % 100), uint8_t(3 + i * 5 % 200), uint8_t(i * 11 % 250), uint8_t(120 + i % 12)};
}

Bytes flat_hdr(int width, int height) {
  Bytes out = hdr_header(width, height);
  for (size_t i = 0; i < size_t(width * height); ++i)
    for (uint8_t v : test_rgbe(i)) out.push_back(v);
  return out;
}

// Newer run-length code: literals, and one run a plane where `run` pixels are equal at the row's start.
Bytes planes_hdr(int width, int height, int run) {
  Bytes out = hdr_header(width, height);
  for (int y = 0; y < height; ++y) {
    for (int v : {2, 2, width >> 8, width & 255}) out.push_back(uint8_t(v));
    for (size_t c = 0; c < 4; ++c) {
      out.push_back(uint8_t(128 + run)), out.push_back(test_rgbe(size_t(y * width))[c]);
      out.push_back(uint8_t(width - run));
      for (int x = run; x < width; ++x) out.push_back(test_rgbe(size_t(y * width + x))[c]);
    }
  }
  return out;
}

Vec3 expected_rgbe(size_t i) {
  auto p = test_rgbe(i);
  float scale = float(std::pow(2.0, double(p[3]) - 136));
  return {float(p[0]) * scale, float(p[1]) * scale, float(p[2]) * scale};
}

TEST(Hdr, FlatPixels) {
  Bytes bytes = flat_hdr(5, 3);
  auto image = load_image(bytes, "a.hdr");
  ASSERT_TRUE(image) << image.error().text();
  ASSERT_EQ(image->width, 5);
  ASSERT_EQ(image->height, 3);
  for (size_t i = 0; i < 15; ++i) EXPECT_EQ(image->rgb[i], expected_rgbe(i)) << i;
}

TEST(Hdr, NewerRunLengths) {
  auto image = load_image(planes_hdr(12, 2, 5), "a.hdr");
  ASSERT_TRUE(image) << image.error().text();
  for (size_t y = 0; y < 2; ++y)
    for (size_t x = 0; x < 12; ++x)
      EXPECT_EQ(image->rgb[y * 12 + x], expected_rgbe(x < 5 ? y * 12 : y * 12 + x)) << x << " " << y;
}

TEST(Hdr, OlderRunLengths) {
  // 300 = 1 + 43 + 256: two repeat pixels in a row, the second counting in units of 256.
  Bytes bytes = hdr_header(302, 1);
  for (int v : {10, 20, 30, 129, 1, 1, 1, 43, 1, 1, 1, 1, 40, 50, 60, 130, 1, 1, 1, 1}) bytes.push_back(uint8_t(v));
  auto image = load_image(bytes, "a.hdr");
  ASSERT_TRUE(image) << image.error().text();
  for (size_t x = 0; x < 302; ++x) {
    float scale = x < 300 ? 1 / 128.0f : 1 / 64.0f;
    EXPECT_EQ(image->rgb[x], (x < 300 ? Vec3(10, 20, 30) : Vec3(40, 50, 60)) * scale) << x;
  }
}

TEST(Hdr, HeaderLinesAndMessages) {
  auto with = [](const std::string& lines, const std::string& size) {
    Bytes out;
    append(out, "#?RGBE\n" + lines + "\n" + size + "\n");
    for (int i = 0; i < 2 * 4; ++i) out.push_back(128);
    return load_image(out, "a.hdr");
  };
  EXPECT_TRUE(with("# made by hand\nEXPOSURE=2.5\nFORMAT=32-bit_rle_rgbe\n", "-Y 1 +X 2"));
  EXPECT_EQ(with("EXPOSURE=2\n", "-Y 2 +X 1")->rgb[0], Vec3(0.25f));  // 128 * 2^(128 - 136) / 2
  EXPECT_EQ(with("FORMAT=other\n", "-Y 1 +X 2").error().text(), "a.hdr: unknown pixel format");
  EXPECT_EQ(with("", "-Y 0 +X 2").error().text(), "a.hdr: image has no pixels");
  EXPECT_EQ(with("", "-Y 65536 +X 65536").error().text(), "a.hdr: image of 65536 x 65536 is larger than 2^28 pixels");
  EXPECT_EQ(with("", "-Y 16384 +X 16384").error().text(),
            "a.hdr: image of 16384 x 16384 does not fit its few bytes: at most 64 pixels a byte beyond 2^22");
  for (const char* bad :
       {"-Y 1", "-Y 1 +X", "-Y 1 +X 2 3", "-Y -1 +X 2", "-Y 1 -Y 2", "-Y 1.5 +X 2", "", "-Y 99999999999999999999 +X 1"})
    EXPECT_EQ(with("", bad).error().text(), "a.hdr: bad resolution line") << bad;
}

TEST(Hdr, RunsThatLeaveTheRowAreErrors) {
  auto bad_row = [](std::initializer_list<int> row) {
    Bytes bytes = hdr_header(8, 1);
    for (int v : row) bytes.push_back(uint8_t(v));
    bytes.resize(bytes.size() + 64, 1);
    auto image = load_image(bytes, "a.hdr");
    return image ? std::string() : image.error().text();
  };
  EXPECT_EQ(bad_row({2, 2, 0, 8, 128 + 9, 5}), "a.hdr: bad run in row 0");
  EXPECT_EQ(bad_row({2, 2, 0, 8, 0, 5}), "a.hdr: bad run in row 0");
  EXPECT_EQ(bad_row({1, 1, 1, 3}), "a.hdr: bad run in row 0");              // nothing to repeat yet
  EXPECT_EQ(bad_row({9, 9, 9, 9, 1, 1, 1, 8}), "a.hdr: bad run in row 0");  // one too many
}

TEST(Hdr, EveryTruncationIsAnError) {
  for (const Bytes& bytes : {flat_hdr(3, 3), planes_hdr(12, 2, 5)}) {
    ASSERT_TRUE(load_image(bytes, "a.hdr"));
    for (size_t size = 0; size < bytes.size(); ++size)
      EXPECT_FALSE(load_image(std::span(bytes).first(size), "a.hdr")) << size << " of " << bytes.size();
  }
}

Image random_image(int width, int height, bool alpha, uint64_t seed) {
  Image image(width, height);
  Random random(seed);
  for (Vec3& c : image.rgb) c = {random.next(), random.next(), random.next()};
  if (alpha)
    for (Vec3& c : image.rgb) image.alpha.push_back(random.next()), c *= image.alpha.back();
  return image;
}

TEST(Png, RoundTripWithinHalfAStep) {
  Image image = random_image(7, 5, false, 1);
  std::string path = temporary("a.png");
  ASSERT_TRUE(save_image(path, image));
  auto back = load_image(path);
  ASSERT_TRUE(back) << back.error().text();
  EXPECT_TRUE(back->alpha.empty());
  constexpr float half_step = 0.5f / 255 + 1e-6f;  // of the encoded value, and rounding
  for (size_t i = 0; i < image.rgb.size(); ++i)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(srgb_encode(back->rgb[i][c]), srgb_encode(image.rgb[i][c]), half_step);
  std::filesystem::remove(path);
}

TEST(Png, StoresStraightAlpha) {
  Image image(3, 1);
  image.rgb = {Vec3(0.25f, 0.125f, 0), Vec3(0.9f), Vec3(0)};
  image.alpha = {0.5f, 1.0f, 0.0f};
  std::string path = temporary("b.png");
  ASSERT_TRUE(save_image(path, image));
  auto back = load_image(path);
  ASSERT_TRUE(back) << back.error().text();
  ASSERT_EQ(back->alpha.size(), 3u);
  EXPECT_EQ(back->alpha[0], 128 / 255.0f);  // 0.5 rounds up
  // The straight colour 0.5 is 187.5 in sRGB, so 188, whose linear value is 0.50289; times the coverage.
  constexpr float rounding = 1e-5f;
  EXPECT_NEAR(back->rgb[0].x, 0.50289f * 128 / 255, rounding);
  EXPECT_EQ(back->alpha[2], 0);
  EXPECT_EQ(back->rgb[2], Vec3(0));
  std::filesystem::remove(path);
}

TEST(Png, ExposureAndClamping) {
  Image image(4, 1);
  image.rgb = {Vec3(0.25f), Vec3(9), Vec3(-1), Vec3(NAN, INFINITY, -INFINITY)};
  std::string path = temporary("c.png");
  ASSERT_TRUE(save_image(path, image, {1, Tone::none}));
  auto back = load_image(path);
  ASSERT_TRUE(back) << back.error().text();
  EXPECT_EQ(back->rgb[0], Vec3(srgb_decode(188 / 255.0f)));  // linear 0.5 as above
  EXPECT_EQ(back->rgb[1], Vec3(1));
  EXPECT_EQ(back->rgb[2], Vec3(0));
  EXPECT_EQ(back->rgb[3], Vec3(0, 1, 0));
  std::filesystem::remove(path);
}

// --- A 16-bit PNG by hand: one stored deflate block.

uint32_t crc32(std::span<const uint8_t> bytes) {
  uint32_t crc = ~0u;
  for (uint8_t byte : bytes) {
    crc ^= byte;
    for (int k = 0; k < 8; ++k) crc = crc & 1 ? crc >> 1 ^ 0xedb88320u : crc >> 1;
  }
  return ~crc;
}

void put_u32(Bytes& out, uint32_t v) {
  for (int shift : {24, 16, 8, 0}) out.push_back(uint8_t(v >> shift));
}

void put_chunk(Bytes& out, const std::string& type, const Bytes& data) {
  put_u32(out, uint32_t(data.size()));
  Bytes body(type.begin(), type.end());
  body.insert(body.end(), data.begin(), data.end());
  out.insert(out.end(), body.begin(), body.end());
  put_u32(out, crc32(body));
}

Bytes png16(int width, int height, const std::vector<uint16_t>& grey) {
  Bytes out{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'}, header, raw, zlib{0x78, 0x01, 1};
  put_u32(header, uint32_t(width)), put_u32(header, uint32_t(height));
  for (int v : {16, 0, 0, 0, 0}) header.push_back(uint8_t(v));
  for (int y = 0; y < height; ++y) {
    raw.push_back(0);
    for (int x = 0; x < width; ++x)
      raw.push_back(uint8_t(grey[size_t(y * width + x)] >> 8)), raw.push_back(uint8_t(grey[size_t(y * width + x)]));
  }
  uint16_t size = uint16_t(raw.size());
  for (int v : {size & 255, size >> 8, ~size & 255, (~size >> 8) & 255}) zlib.push_back(uint8_t(v));
  zlib.insert(zlib.end(), raw.begin(), raw.end());
  uint32_t a = 1, b = 0;
  for (uint8_t v : raw) a = (a + v) % 65521, b = (b + a) % 65521;
  put_u32(zlib, b << 16 | a);
  put_chunk(out, "IHDR", header), put_chunk(out, "IDAT", zlib), put_chunk(out, "IEND", {});
  return out;
}

TEST(Png, SixteenBits) {
  auto image = load_image(png16(2, 2, {0, 65535, 32768, 257}), "a.png");
  ASSERT_TRUE(image) << image.error().text();
  EXPECT_EQ(image->rgb[0], Vec3(0));
  EXPECT_EQ(image->rgb[1], Vec3(1));
  constexpr float rounding = 1e-7f;
  EXPECT_NEAR(image->rgb[2].x, 0.2140482f, rounding);  // ((32768/65535 + 0.055) / 1.055)^2.4
  EXPECT_NEAR(image->rgb[3].y, 257 / 65535.0f / 12.92f, rounding);
}

TEST(Png, AHundredMegapixelsOfOneColourAreRefusedByTheirSize) {
  // The header alone tells: 10,000 x 10,000 in what deflate makes of a constant, 1/1030.
  Bytes bytes = png16(2, 2, {0, 0, 0, 0});
  for (size_t at : {16, 20})
    for (size_t k = 0; k < 4; ++k) bytes[at + k] = uint8_t(10000 >> (24 - 8 * k));
  const Bytes head(bytes.begin() + 12, bytes.begin() + 29);
  for (size_t k = 0; k < 4; ++k) bytes[29 + k] = uint8_t(crc32(head) >> (24 - 8 * k));
  bytes.resize(200000, 0);
  EXPECT_EQ(load_image(bytes, "a.png").error().text(),
            "a.png: image of 10000 x 10000 does not fit its few bytes: at most 64 pixels a byte beyond 2^22");
}

TEST(Png, EveryTruncationIsAnError) {
  std::string path = temporary("d.png");
  ASSERT_TRUE(save_image(path, random_image(6, 6, true, 3)));
  auto bytes = read_file(path);
  ASSERT_TRUE(bytes);
  size_t tail = 12;  // the closing chunk holds nothing; a file cut inside it may be taken
  for (size_t size = 0; size + tail < bytes->size(); ++size)
    EXPECT_FALSE(load_image(std::span(*bytes).first(size), "d.png")) << size << " of " << bytes->size();
  std::filesystem::remove(path);
}

TEST(Jpeg, RealFileAndItsTruncations) {
  std::string path = data_folder() + "/textures/Tiles036_1K_Roughness.jpg";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "no test data: set LAMBENT_DATA";
  auto bytes = read_file(path);
  ASSERT_TRUE(bytes);
  auto image = load_image(*bytes, path);
  ASSERT_TRUE(image) << image.error().text();
  EXPECT_EQ(image->width, 1024);
  EXPECT_EQ(image->height, 1024);
  for (size_t size = 0; size < bytes->size(); size += size < 700 ? 1 : 9973)
    EXPECT_FALSE(load_image(std::span(*bytes).first(size), path)) << size;
}

TEST(LoadImage, TellsWhatIsWrong) {
  EXPECT_EQ(load_image(Bytes{}, "a.exr").error().text(), "a.exr: empty file");
  EXPECT_EQ(load_image(Bytes(40, 'x'), "a.exr").error().text(), "a.exr: does not begin as an .exr file does");
  EXPECT_EQ(load_image(Bytes(40, 'x'), "a.txt").error().text(),
            "a.txt: not an image that can be read (.exr, .hdr, .png, .jpg)");
  EXPECT_EQ(load_image(Bytes{0xab, 'K', 'T', 'X', ' ', '2', '0', 0xbb, 13, 10}, "a.ktx2").error().text(),
            "a.ktx2: KTX2 is not read: convert it to .exr, .hdr or .png");
  EXPECT_EQ(load_image(Bytes{'D', 'D', 'S', ' ', 124, 0}, "a.dds").error().text(),
            "a.dds: DDS is not read: convert it to .exr, .hdr or .png");
  EXPECT_EQ(load_image("/nowhere/a.exr").error().text(), "/nowhere/a.exr: no such file");
  EXPECT_EQ(save_image("a.hdr", Image(1, 1)).error().text(), "a.hdr: pictures are written as .exr or .png");
}

TEST(Srgb, KnownValuesAndInverse) {
  constexpr float rounding = 1e-6f;
  EXPECT_EQ(srgb_encode(0), 0);
  EXPECT_NEAR(srgb_encode(1), 1, rounding);
  EXPECT_NEAR(srgb_encode(0.18f), 0.461356f, rounding);  // 1.055 * 0.18^(1/2.4) - 0.055
  EXPECT_NEAR(srgb_encode(0.002f), 0.02584f, rounding);
  EXPECT_EQ(srgb_encode(NAN), 0);
  EXPECT_NEAR(srgb_encode(7), 1, rounding);
  for (int i = 0; i <= 255; ++i) EXPECT_NEAR(srgb_encode(srgb_decode(float(i) / 255)), float(i) / 255, rounding) << i;
  Image image(2, 1);
  image.rgb = {Vec3(0.09f), Vec3(-1, 0.5f, 4)};
  Image shown = displayed(image, {1, Tone::none});
  EXPECT_NEAR(shown.rgb[0].x, 0.461356f, rounding);
  EXPECT_EQ(shown.rgb[1].x, 0);
  EXPECT_NEAR(shown.rgb[1].z, 1, rounding);
}

TEST(FalseColor, LightnessIsEven) {
  EXPECT_EQ(false_color(0), Vec3(0));
  EXPECT_EQ(false_color(-3), Vec3(0));
  EXPECT_EQ(false_color(NAN), Vec3(0));
  constexpr float gamut_rounding = 1e-3f;
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(false_color(1)[c], 1, gamut_rounding);
  float last = -1;
  constexpr float tolerance =
      0.1f;  // of 100: the matrices have seven digits, and colours near the gamut's edge are clamped
  for (int i = 0; i <= 500; ++i) {
    float x = float(i) / 500, L = cielab(false_color(x)).x;
    EXPECT_NEAR(L, 100 * x, tolerance);
    EXPECT_GT(L, last) << x;
    last = L;
  }
}

TEST(Beside, KeepsPixelsAndAlpha) {
  std::vector<Image> images{random_image(3, 2, false, 4), random_image(1, 2, true, 5)};
  Image both = beside(images);
  ASSERT_EQ(both.width, 4);
  EXPECT_EQ(both.at(2, 1), images[0].at(2, 1));
  EXPECT_EQ(both.at(3, 0), images[1].at(0, 0));
  EXPECT_EQ(both.at(3, 1), images[1].at(0, 1));
  ASSERT_EQ(both.alpha.size(), 8u);
  EXPECT_EQ(both.alpha[0], 1);
  EXPECT_EQ(both.alpha[7], images[1].alpha[1]);
}

TEST(DrawText, DotsScaleAndClipping) {
  Image image(12, 9);
  draw_text(image, 0, 0, "L", Vec3(1, 0, 0), 1);
  size_t lit = 0;
  for (const Vec3& c : image.rgb) lit += c.x > 0;
  EXPECT_EQ(lit, 11u);  // seven dots down, four more along the foot
  EXPECT_EQ(image.at(0, 0), Vec3(1, 0, 0));
  EXPECT_EQ(image.at(4, 6), Vec3(1, 0, 0));
  EXPECT_EQ(image.at(4, 0), Vec3(0));

  Image big(24, 18);
  draw_text(big, 0, 0, "L", Vec3(1, 0, 0), 2);
  for (int y = 0; y < 18; ++y)
    for (int x = 0; x < 24; ++x) EXPECT_EQ(big.at(x, y), image.at(x / 2, y / 2));

  draw_text(image, -1000, -3, "edges", Vec3(1), 3);
  draw_text(image, 11, 8, "edges\nedges", Vec3(1), 1);
  draw_text(image, 2147483000, 2147483000, "far", Vec3(1), 1000);
}

TEST(DrawText, GlyphsDiffer) {
  std::set<std::vector<bool>> seen;
  for (char c = ' '; c <= '~'; ++c) {
    Image image(6, 7);
    draw_text(image, 0, 0, std::string(1, c), Vec3(1));
    std::vector<bool> dots;
    for (const Vec3& v : image.rgb) dots.push_back(v.x > 0);
    EXPECT_TRUE(seen.insert(dots).second) << c;
  }
}

}  // namespace
}  // namespace lambent
