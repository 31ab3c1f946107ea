#include <lambent/core/random.h>
#include <lambent/transfer/zonal_texture.h>

#include <gtest/gtest.h>

#include <filesystem>

namespace lambent {
namespace {

struct Temporary {
  std::string path;
  explicit Temporary(const char* name) : path((std::filesystem::temp_directory_path() / name).string()) {}
  ~Temporary() { std::filesystem::remove(path); }
};

WritableZonalTransfer random_texture(int width, int height) {
  const WritableZonalTransfer w = make_zonal_transfer(6, 3, 1, size_t(width * height), Precision::single);
  for (size_t r = 0; r < w.transfer.receivers; ++r) {
    Random random(9, r);
    std::vector<float> v(w.transfer.receiver_values());
    for (float& x : v) x = random.next();
    store_receiver(w, r, v);
  }
  return w;
}

TEST(ZonalTexture, ComesBackAndRefusesLies) {
  const Temporary file("lambent-texture-test.lpt"), other("lambent-texture-lie.lpt");
  const WritableZonalTransfer w = random_texture(5, 4);
  ASSERT_TRUE(save_zonal_texture(file.path, {5, 4, w.transfer}));
  auto back = load_zonal_texture(file.path);
  ASSERT_TRUE(back) << back.error().text();
  EXPECT_EQ(back->width, 5);
  EXPECT_EQ(back->transfer.lobes, 3);
  EXPECT_TRUE(std::equal(back->transfer.data.begin(), back->transfer.data.end(), w.transfer.data.begin(),
                         w.transfer.data.end()));
  const std::vector<uint8_t> bytes = *read_file(file.path);
  auto accepted = [&](const std::vector<uint8_t>& changed) {
    const std::span<const uint8_t> piece(changed);
    EXPECT_TRUE(write_file_atomically(other.path, {&piece, 1}));
    return bool(load_zonal_texture(other.path));
  };
  for (size_t length = 0; length < bytes.size(); length += length < 64 ? 9 : 131)
    EXPECT_FALSE(accepted({bytes.begin(), bytes.begin() + ptrdiff_t(length)})) << length;
  for (auto [at, value] : {std::pair<size_t, uint8_t>{0, 'X'},
                           {7, '2'},
                           {8, 0},
                           {8, 99},
                           {11, 1},
                           {16, 7},
                           {16, 0},
                           {20, 9},
                           {20, 4},
                           {24, 2},
                           {28, 3},
                           {28, 2}}) {
    std::vector<uint8_t> changed = bytes;
    changed[at] = value;
    EXPECT_FALSE(accepted(changed)) << at << ' ' << int(value);
  }
}

TEST(ZonalTexture, ViewsComeBackRowByRow) {
  const Temporary file("lambent-texture-views.lpt"), other("lambent-texture-views-lie.lpt");
  const WritableZonalTransfer w = make_zonal_transfer(3, 2, 3, 6, Precision::half, 4);
  for (size_t r = 0; r < 6; ++r) {
    Random random(9, r);
    std::vector<float> v(w.transfer.receiver_values());
    for (float& x : v) x = random.next();
    store_receiver(w, r, v);
  }
  ASSERT_TRUE(save_zonal_texture(file.path, {3, 2, w.transfer, 0, 2}));
  auto back = load_zonal_texture(file.path);
  ASSERT_TRUE(back) << back.error().text();
  EXPECT_EQ(back->views, 2);
  EXPECT_EQ(back->transfer.rows, 4);
  std::vector<float> values(w.transfer.row_values());
  const std::vector<float> texel = load_receiver(w.transfer, 4);
  for (size_t row = 0; row < 4; ++row) {
    sample_zonal_texture(*back, {0.5f, 0.75f}, values, row);
    for (size_t k = 0; k < values.size(); ++k)
      EXPECT_NEAR(values[k], texel[row * values.size() + k], 1e-5) << row << " " << k;
  }
  std::vector<uint8_t> bytes = *read_file(file.path);
  for (auto [at, value] :
       {std::pair<size_t, uint8_t>{7, '1'}, {7, '3'}, {32, 1}, {40, 0}, {40, 1}, {40, 3}, {40, 33}}) {
    std::vector<uint8_t> changed = bytes;
    changed[at] = value;
    const std::span<const uint8_t> piece(changed);
    ASSERT_TRUE(write_file_atomically(other.path, {&piece, 1}));
    EXPECT_FALSE(load_zonal_texture(other.path)) << at << " " << int(value);
  }
}

TEST(ZonalTexture, InterpolatesWhatIsExactAndRepeats) {
  const WritableZonalTransfer w = random_texture(5, 4);
  const ZonalTexture texture{5, 4, w.transfer};
  std::vector<float> at(w.transfer.receiver_values()), again(at.size());
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 5; ++i) {
      const std::vector<float> texel = load_receiver(w.transfer, size_t(j * 5 + i));
      sample_zonal_texture(texture, {(float(i) + 0.5f) / 5, (float(j) + 0.5f) / 4}, at);
      sample_zonal_texture(texture, {(float(i) + 0.5f) / 5 - 3, (float(j) + 0.5f) / 4 + 2}, again);
      for (size_t k = 0; k < at.size(); ++k) {
        EXPECT_NEAR(at[k], texel[k], 2e-6);  // of the fraction of the coordinate
        EXPECT_NEAR(again[k], texel[k], 1e-5);
      }
    }
  // Across the seam: the mean of the last and the first texel, and the lobes of one of them.
  sample_zonal_texture(texture, {0.99999f, 0.5f / 4}, at);
  const std::vector<float> first = load_receiver(w.transfer, 0), last = load_receiver(w.transfer, 4);
  EXPECT_NEAR(at[1], 0.5f * (first[1] + last[1]), 1e-3);
  EXPECT_EQ(at[at.size() - 1], last[at.size() - 1]);
  sample_zonal_texture(texture, {NAN, INFINITY}, at);
}

}  // namespace
}  // namespace lambent
