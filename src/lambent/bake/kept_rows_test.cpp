#include <lambent/bake/kept_rows.h>
#include <lambent/bake/shared_exponent.h>
#include <lambent/core/half.h>
#include <lambent/core/random.h>

#include <gtest/gtest.h>

#include <filesystem>

namespace lambent {
namespace {

SparseBlock random_block(uint64_t seed, int channels, uint32_t receivers) {
  Random random(seed);
  SparseBlock b;
  b.row_count = 1 + size_t(random.next() * 64);
  for (uint32_t column = uint32_t(random.next() * 300); column < receivers;
       column += 1 + uint32_t(std::exp(random.next() * 12))) {
    const size_t before = b.rows.size();
    for (size_t row = 0; row < b.row_count; ++row) {
      if (random.next() < 0.7f) continue;
      b.rows.push_back(uint8_t(row));
      float w[3], rounded[3];
      const float dither[3] = {0.5f, 0.1f, 0.9f};
      for (float& x : w) x = std::exp(18 * random.next() - 12);
      round_shared(w, dither, rounded);
      for (int c = 0; c < channels; ++c) b.weights.push_back(float_to_half(channels == 3 ? rounded[c] : w[c]));
    }
    if (b.rows.size() > before) b.columns.push_back(column), b.ends.push_back(uint32_t(b.rows.size()));
  }
  return b;
}

TEST(SharedExponent, RoundsToANeighbourAndStaysAHalf) {
  Random random(3);
  for (int i = 0; i < 20000; ++i) {
    float w[3], r[3], back[3], dither[3];
    for (float& x : w) x = random.next() < 0.1f ? 0.0f : std::exp(24 * random.next() - 13);
    for (float& x : w) x = std::min(x, 65000.0f);
    for (float& d : dither) d = random.next();
    round_shared(w, dither, r);
    const float most = std::max({w[0], w[1], w[2]});
    for (int c = 0; c < 3; ++c) {
      EXPECT_LE(std::abs(r[c] - w[c]), std::max(most / 255, 0x1p-24f)) << w[c];
      EXPECT_EQ(half_to_float(float_to_half(r[c])), r[c]);
    }
    unpack_shared(pack_shared(r), back);
    for (int c = 0; c < 3; ++c) EXPECT_EQ(back[c], r[c]) << w[0] << " " << w[1] << " " << w[2];
  }
  // Weights of an interpolation that its rounding has taken below 0.
  for (const float below : {-1e-9f, -0.01f}) {
    const float w[3] = {below, below, 2 * below}, dither[3] = {0, 0.5f, 0.999f};
    float r[3];
    round_shared(w, dither, r);
    for (float value : r) EXPECT_EQ(value, 0);
  }
}

TEST(SharedExponent, IsRightInTheMean) {
  Random random(4);
  const float w[3] = {0.9f, 0.1234f, 0.0107f};
  double sums[3] = {};
  constexpr int count = 20000;
  for (int i = 0; i < count; ++i) {
    float r[3];
    const float dither[3] = {random.next(), random.next(), random.next()};
    round_shared(w, dither, r);
    for (int c = 0; c < 3; ++c) sums[c] += double(r[c]) / count;
  }
  // A step is 1/512, so that the mean of so many is off by 1/512 / 2 / sqrt(20000) at most, here four times that.
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(sums[c], double(w[c]), 4 * 7e-6) << c;
}

TEST(KeptRows, PackedBlocksComeBackAndBrokenOnesAreTold) {
  constexpr uint32_t receivers = 1u << 22;
  for (int channels : {1, 3})
    for (uint64_t seed = 0; seed < 20; ++seed) {
      const SparseBlock block = random_block(seed, channels, receivers);
      std::vector<uint8_t> bytes;
      pack(block, bytes);
      SparseBlock back;
      ASSERT_TRUE(unpack(bytes, receivers, channels, back));
      EXPECT_EQ(back.row_count, block.row_count);
      EXPECT_EQ(back.columns, block.columns);
      EXPECT_EQ(back.ends, block.ends);
      EXPECT_EQ(back.rows, block.rows);
      EXPECT_EQ(back.weights, block.weights);
      EXPECT_FALSE(unpack(bytes, block.columns.back(), channels, back)) << "a column that there is not";
      EXPECT_FALSE(unpack(std::span(bytes).first(bytes.size() - 1), receivers, channels, back));
      EXPECT_FALSE(unpack(bytes, receivers, 4 - channels, back));
      // Whatever is accepted can be multiplied.
      Random random(seed, 1);
      for (int i = 0; i < 2000; ++i) {
        std::vector<uint8_t> broken = bytes;
        const size_t at = size_t(random.next() * float(std::min<size_t>(bytes.size(), 16 + block.columns.size() * 3)));
        broken[at] ^= uint8_t(1 + random.next() * 254);
        if (!unpack(broken, receivers, channels, back)) continue;
        EXPECT_TRUE(std::is_sorted(back.columns.begin(), back.columns.end()) && back.columns.back() < receivers);
        EXPECT_TRUE(std::is_sorted(back.ends.begin(), back.ends.end()) && back.ends.back() == back.rows.size());
        for (uint8_t row : back.rows) ASSERT_LT(row, back.row_count);
      }
    }
  std::vector<uint8_t> bytes;
  pack({}, bytes);
  SparseBlock back;
  EXPECT_TRUE(unpack(bytes, 0, 3, back));
  EXPECT_TRUE(back.columns.empty());
  EXPECT_FALSE(unpack({}, 1, 1, back));
}

TEST(KeptRows, GoIntoAFileBeyondTheirBudget) {
  constexpr uint32_t receivers = 1u << 16;
  std::vector<PackedBlock> blocks(40);
  size_t all = 0;
  for (size_t b = 0; b < blocks.size(); ++b) {
    pack(random_block(b, 3, receivers), blocks[b].rows), pack(random_block(100 + b, 3, 500), blocks[b].half_rows);
    all += blocks[b].rows.size() + blocks[b].half_rows.size();
  }
  const std::string folder = std::filesystem::temp_directory_path().string();
  for (const std::string& scratch : {folder, std::string(), std::string("/nowhere")}) {
    KeptRows kept(blocks.size(), all / 3, 1 << 20, scratch);
    for (size_t b = 0; b < blocks.size(); ++b) kept.keep(b, blocks[b]);
    EXPECT_LE(kept.bytes(), all / 3);
    EXPECT_EQ(kept.fraction() == 1, scratch == folder);
    EXPECT_EQ(kept.file_bytes(), scratch == folder ? all - kept.bytes() : 0);
    for (size_t b = 0; b < blocks.size(); ++b) {
      std::vector<uint8_t> buffer;
      KeptRows::Block found;
      if (!kept.find(b, buffer, found)) {
        EXPECT_NE(scratch, folder);
        continue;
      }
      EXPECT_TRUE(std::equal(found.rows.begin(), found.rows.end(), blocks[b].rows.begin(), blocks[b].rows.end()));
      EXPECT_TRUE(std::equal(found.half_rows.begin(), found.half_rows.end(), blocks[b].half_rows.begin(),
                             blocks[b].half_rows.end()));
    }
  }
}

}  // namespace
}  // namespace lambent
