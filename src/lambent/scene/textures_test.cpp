#include <lambent/core/file.h>
#include <lambent/scene/textures.h>

#include <gtest/gtest.h>

#include "test_meshes.h"

namespace lambent {
namespace {

// A PNG header alone, for an image of the given size: 8 bits, RGB. Its checksum is left out, which decoders look at
// later.
std::vector<uint8_t> png_header(uint32_t width, uint32_t height) {
  std::vector<uint8_t> bytes{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n', 0, 0, 0, 13, 'I', 'H', 'D', 'R'};
  for (uint32_t side : {width, height})
    for (int shift : {24, 16, 8, 0}) bytes.push_back(uint8_t(side >> shift));
  for (uint8_t b : {8, 2, 0, 0, 0, 0, 0, 0, 0}) bytes.push_back(b);
  return bytes;
}

TEST(DecodeTexture, RefusesWhatIsNoImage) {
  for (std::vector<uint8_t> bytes : {std::vector<uint8_t>{}, {'G', 'I', 'F', '8', '9', 'a'}, {0xff, 0xd8}}) {
    auto texture = decode_texture(bytes, "a.png");
    ASSERT_FALSE(texture);
    EXPECT_EQ(texture.error().text(), "a.png: is no PNG, JPEG, WebP, TGA, BMP, PSD or PNM");
  }
  EXPECT_FALSE(decode_texture({0xff, 0xd8, 0xff, 0xe0}, "a"));
  for (auto [width, height] : {std::pair{0u, 1u},
                               {1u, 0u},
                               {16385u, 1u},
                               {1u, 16385u},
                               {16384u, 16384u},
                               {100'000'000u, 100'000'000u},
                               {4u, 4u}})
    EXPECT_FALSE(decode_texture(png_header(width, height), "a")) << width << " " << height;
}

TEST(DecodeTexture, ReadsAndTruncatesJpeg) {
  std::string folder = test::data_folder();
  if (folder.empty()) GTEST_SKIP() << "no data folder";
  auto bytes = read_file(folder + "/textures/Tiles036_1K_Color.jpg");  // stored as one channel
  ASSERT_TRUE(bytes);
  auto texture = decode_texture(*bytes, "tiles");
  ASSERT_TRUE(texture);
  EXPECT_EQ(texture->mime_type, "image/jpeg");
  EXPECT_EQ(texture->width, 1024);
  EXPECT_EQ(texture->height, 1024);
  EXPECT_EQ(texture->rgb.size(), size_t{3} << 20);
  EXPECT_EQ(texture->encoded, *bytes);
  EXPECT_EQ(texture->name, "tiles");
  for (size_t length : {0, 1, 2, 3, 10, 100, 300}) {
    EXPECT_FALSE(decode_texture({bytes->begin(), bytes->begin() + std::ptrdiff_t(length)}, "cut")) << length;
  }
}

}  // namespace
}  // namespace lambent
