#include <lambent/core/half.h>
#include <lambent/core/random.h>
#include <lambent/transfer/transfer.h>

#include <gtest/gtest.h>

#include <cmath>

namespace lambent {
namespace {

TEST(Half, RoundsToNearestEvenAndComesBack) {
  for (uint32_t h = 0; h < 0x10000; ++h) {
    const float f = half_to_float(uint16_t(h));
    if (std::isnan(f)) {
      EXPECT_TRUE(std::isnan(half_to_float(float_to_half(f))));
    } else {
      EXPECT_EQ(float_to_half(f), uint16_t(h)) << h;
    }
  }
  EXPECT_EQ(float_to_half(1.0f), 0x3c00);
  EXPECT_EQ(float_to_half(65504.0f), 0x7bff);
  EXPECT_EQ(float_to_half(65520.0f), 0x7c00);         // halfway to the next: infinity
  EXPECT_EQ(float_to_half(1.0f + 0x1p-11f), 0x3c00);  // ties go to the even one
  EXPECT_EQ(float_to_half(1.0f + 3 * 0x1p-11f), 0x3c02);
  EXPECT_EQ(float_to_half(0x1p-25f), 0);
  EXPECT_EQ(float_to_half(0x1.8p-25f), 1);
  Random random(1);
  for (int i = 0; i < 10000; ++i) {
    const float f = (random.next() - 0.5f) * 100;
    EXPECT_LE(std::abs(half_to_float(float_to_half(f)) - f), std::max(std::abs(f) * 0x1p-11f, 0x1p-25f));
  }
}

TEST(Transfer, KeepsWhatIsStored) {
  for (Precision precision : {Precision::half, Precision::single})
    for (int channels : {1, 3}) {
      const WritableTransfer w = make_transfer({.order = 3}, 1, channels, 37, precision);
      EXPECT_EQ(w.transfer.data.size(), 3u * 16 * size_t(channels) * 9 * (precision == Precision::half ? 2 : 4));
      Random random(3);
      std::vector<std::vector<float>> rows(37);
      for (size_t r = 0; r < 37; ++r) {
        rows[r].resize(size_t(channels) * 9);
        for (float& v : rows[r]) v = half_to_float(float_to_half(random.next() - 0.5f));
        store_receiver(w, r, rows[r]);
      }
      for (size_t r = 0; r < 37; ++r) EXPECT_EQ(load_receiver(w.transfer, r), rows[r]);
    }
}

}  // namespace
}  // namespace lambent
