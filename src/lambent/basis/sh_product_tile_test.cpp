#include <lambent/basis/sh_product_tile.h>
#include <lambent/core/random.h>

#include <gtest/gtest.h>

#include <array>

namespace lambent {
namespace {

TEST(ShProductTile, IsThePlainProductInEveryLane) {
  for (const auto& [a, b, c] : {std::array{4, 4, 4}, {1, 3, 2}, {6, 4, 4}, {6, 4, 6}, {5, 8, 3}}) {
    const TriplingTensor tensor = make_tripling_tensor(a, b, c);
    const ShTileProduct product = make_sh_tile_product(a, b, c);
    Random random(3);
    AlignedVector<float> x(size_t(sh_count(a)) * sh_tile), y(size_t(sh_count(b)) * sh_tile),
        out(size_t(sh_count(c)) * sh_tile);
    for (AlignedVector<float>* values : {&x, &y})
      for (float& v : *values) v = random.next() - 0.5f;
    multiply_sh_tile(product, x.data(), y.data(), out.data());
    for (size_t i = 0; i < sh_tile; ++i) {
      auto lane = [&](const AlignedVector<float>& values) {
        std::vector<float> one(values.size() / sh_tile);
        for (size_t k = 0; k < one.size(); ++k) one[k] = values[k * sh_tile + i];
        return one;
      };
      std::vector<float> plain(size_t(sh_count(c)));
      multiply_sh_plain(tensor, std::span<const float>(lane(x)), std::span<const float>(lane(y)),
                        std::span<float>(plain));
      for (size_t k = 0; k < plain.size(); ++k) EXPECT_NEAR(out[k * sh_tile + i], plain[k], 1e-5f);
    }
  }
}

TEST(ShProductTile, SumsLightInEveryLane) {
  AlignedVector<float> rows(4 * sh_tile), out(3 * sh_tile);
  for (size_t i = 0; i < rows.size(); ++i) rows[i] = float(i % 7);
  const std::vector<Vec3> light{Vec3(1, 2, 3), Vec3(0, 1, 0), Vec3(-1, 0, 2), Vec3(0.5f)};
  dot_sh_tile(rows.data(), light, out.data());
  for (size_t i = 0; i < sh_tile; ++i) {
    Vec3 sum(0.0f);
    for (size_t k = 0; k < 4; ++k) sum += rows[k * sh_tile + i] * light[k];
    for (int c = 0; c < 3; ++c) EXPECT_FLOAT_EQ(out[size_t(c) * sh_tile + i], sum[c]);
  }
}

}  // namespace
}  // namespace lambent
