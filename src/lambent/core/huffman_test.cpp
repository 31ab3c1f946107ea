#include <lambent/core/huffman.h>
#include <lambent/core/random.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

TEST(Huffman, BytesComeBackInAboutTheirEntropy) {
  Random random(7);
  std::vector<uint8_t> bytes;
  double entropy = 0;
  for (int i = 0; i < 20000; ++i) {
    int k = 0;
    while (k < 255 && random.next() < 0.7f) ++k;
    bytes.push_back(uint8_t(k));
  }
  std::vector<double> often(256);
  for (uint8_t b : bytes) often[b] += 1.0 / double(bytes.size());
  for (double p : often) entropy -= p > 0 ? p * std::log2(p) : 0;
  const std::vector<uint8_t> coded = huffman_encode(bytes);
  EXPECT_LT(double(coded.size() - 128) * 8, (entropy + 0.1) * double(bytes.size()));
  const auto back = huffman_decode(coded, bytes.size());
  ASSERT_TRUE(back);
  EXPECT_EQ(*back, bytes);
}

TEST(Huffman, AnyBytesComeBack) {
  std::vector<std::vector<uint8_t>> all{{}, {7}, std::vector<uint8_t>(100, 3), {0, 255, 0, 0, 255}};
  // So uneven that a plain tree would be 30 deep.
  std::vector<uint8_t> uneven;
  for (size_t b = 0, a = 1, c = 1; b < 24; ++b, c = std::exchange(a, a + c)) uneven.insert(uneven.end(), c, uint8_t(b));
  all.push_back(uneven);
  for (const auto& bytes : all) {
    const auto back = huffman_decode(huffman_encode(bytes), bytes.size());
    ASSERT_TRUE(back) << bytes.size();
    EXPECT_EQ(*back, bytes);
  }
}

TEST(Huffman, WhatIsBrokenIsRefused) {
  const std::vector<uint8_t> coded = huffman_encode(std::vector<uint8_t>{1, 2, 3, 1, 1, 2, 9, 1, 1, 1});
  EXPECT_FALSE(huffman_decode({}, 0));
  EXPECT_FALSE(huffman_decode(coded, 4));
  EXPECT_FALSE(huffman_decode(coded, 1000));
  EXPECT_FALSE(huffman_decode({coded.data(), coded.size() - 1}, 10));
  std::vector<uint8_t> longer = coded;
  longer.push_back(0);
  EXPECT_FALSE(huffman_decode(longer, 10));
  std::vector<uint8_t> twice = coded;
  std::fill_n(twice.begin(), 128, uint8_t(0x11));  // 256 codes of one bit
  EXPECT_FALSE(huffman_decode(twice, 10));
  Random random(3);
  for (int i = 0; i < 500; ++i) {
    std::vector<uint8_t> noise(140);
    for (uint8_t& b : noise) b = uint8_t(random.next64());
    huffman_decode(noise, size_t(i));  // ends
  }
}

}  // namespace
}  // namespace lambent
