#include <lambent/core/random.h>
#include <lambent/transfer/visibility.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// Blocks of every kind: even, with few runs, with a change at every texel, and noise.
std::vector<uint8_t> random_levels(int size, int top, Random& random) {
  std::vector<uint8_t> levels(cube_texels(size));
  for (size_t b = 0; b < levels.size() / block_texels; ++b) {
    uint8_t* level = levels.data() + b * block_texels;
    const float kind = random.next();
    int now = random.next() < 0.5f ? 0 : top;
    const float change = kind < 0.4f ? 0.0f : kind < 0.7f ? 0.02f : kind < 0.8f ? 1.0f : 0.5f;
    for (int t = 0; t < block_texels; ++t) {
      if (random.next() < change) now = top == 1 ? 1 - now : (now + 1 + int(random.next() * float(top))) % (top + 1);
      level[t] = uint8_t(now);
    }
  }
  return levels;
}

TEST(Visibility, ComesBackBitForBit) {
  for (int bits : {1, 2, 6, 8})
    for (int size : {16, 32, 64}) {
      Random random(uint64_t(bits * 1000 + size));
      std::vector<std::vector<uint8_t>> truth, pieces(1);
      std::vector<uint32_t> lengths;
      for (int r = 0; r < 50; ++r) {
        truth.push_back(random_levels(size, (1 << bits) - 1, random));
        const size_t before = pieces[0].size();
        encode_visibility(size, bits, truth.back(), pieces[0]);
        lengths.push_back(uint32_t(pieces[0].size() - before));
      }
      const Visibility v = make_visibility(size, bits, std::move(pieces), lengths);
      ASSERT_TRUE(check_visibility(v, "test"));
      std::vector<uint8_t> levels(cube_texels(size));
      for (size_t r = 0; r < 50; ++r) {
        decode_visibility(v, r, levels);
        EXPECT_EQ(levels, truth[r]);
      }
    }
}

TEST(Visibility, EvenBlocksCostTwoBits) {
  std::vector<uint8_t> levels(cube_texels(64), 0), out;
  encode_visibility(64, 1, levels, out);
  EXPECT_EQ(out.size(), 24u);
  std::fill(levels.begin(), levels.end(), uint8_t(63)), out.clear();
  encode_visibility(64, 6, levels, out);
  EXPECT_EQ(out.size(), 24u);
}

TEST(Visibility, VarintsComeBackAndStopAtTheEnd) {
  for (uint64_t value : {uint64_t(0), uint64_t(127), uint64_t(128), uint64_t(256), uint64_t(1) << 35, ~uint64_t(0)}) {
    std::vector<uint8_t> bytes;
    append_varint(bytes, value);
    size_t at = 0;
    uint64_t back = 1;
    ASSERT_TRUE(read_varint(bytes, at, back));
    EXPECT_EQ(back, value);
    EXPECT_EQ(at, bytes.size());
    bytes.pop_back(), at = 0;
    EXPECT_FALSE(read_varint(bytes, at, back));
  }
  const std::vector<uint8_t> endless(11, 0xff);
  size_t at = 0;
  uint64_t value;
  EXPECT_FALSE(read_varint(endless, at, value));
}

// Whatever one byte of a record is changed to, or wherever it is cut, the check refuses it or reading stays inside.
TEST(Visibility, BrokenRecordsAreRefusedOrHarmless) {
  for (int bits : {1, 6}) {
    Random random(uint64_t(bits) + 4);
    std::vector<uint8_t> record;
    encode_visibility(16, bits, random_levels(16, (1 << bits) - 1, random), record);
    size_t refused = 0;
    for (int i = 0; i < 20000; ++i) {
      auto bytes = std::make_shared<std::vector<uint8_t>>(record);
      if (i % 4 == 0) bytes->resize(size_t(random.next() * float(bytes->size())));
      else (*bytes)[size_t(random.next() * float(bytes->size()))] = uint8_t(random.next64());
      bytes->shrink_to_fit();  // so that address sanitizers see the end
      Visibility v{16, bits, 1, *bytes, {0, bytes->size()}, bytes};
      if (!check_visibility(v, "test")) {
        ++refused;
        continue;
      }
      std::vector<uint8_t> levels(cube_texels(16));
      decode_visibility(v, 0, levels);
      for (uint8_t l : levels) EXPECT_LE(l, v.top());
    }
    EXPECT_GT(refused, 5000u);
  }
}

}  // namespace
}  // namespace lambent
