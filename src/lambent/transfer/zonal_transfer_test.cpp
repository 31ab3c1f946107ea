#include <lambent/basis/zonal.h>
#include <lambent/core/half.h>
#include <lambent/core/random.h>
#include <lambent/transfer/zonal_transfer.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

std::vector<float> random_values(const ZonalTransfer& t, uint64_t key) {
  Random random(key);
  std::vector<float> v(t.receiver_values());
  for (float& x : v) x = half_to_float(float_to_half(2 * random.next() - 1));
  return v;
}

TEST(ZonalTransfer, KeepsWhatIsStored) {
  for (Precision precision : {Precision::half, Precision::single})
    for (int channels : {1, 3})
      for (int lobes : {1, 4}) {
        const WritableZonalTransfer w = make_zonal_transfer(6, lobes, channels, 37, precision);
        const size_t per_lobe = 3 + size_t(channels) * (lobes == 1 ? 5 : 4);
        EXPECT_EQ(w.transfer.receiver_values(), size_t(channels) * (lobes == 1 ? 1 : 4) + size_t(lobes) * per_lobe);
        EXPECT_EQ(w.transfer.data.size(),
                  3 * 16 * w.transfer.receiver_values() * (precision == Precision::half ? 2 : 4));
        for (size_t r = 0; r < 37; ++r) store_receiver(w, r, random_values(w.transfer, r));
        for (size_t r = 0; r < 37; ++r) EXPECT_EQ(load_receiver(w.transfer, r), random_values(w.transfer, r));
      }
}

TEST(ZonalTransfer, StandsForTheSumOfItsLobes) {
  const Mat3 skew = rotation_from_yaw_pitch_roll({37, -52, 113});
  for (int lobes : {1, 2, 3, 5}) {
    const ZonalTransfer t = make_zonal_transfer(6, lobes, 3, 1, Precision::single).transfer;
    const std::vector<float> values = random_values(t, uint64_t(lobes));
    const std::vector<float> sh = zonal_harmonics(t, values), turned = zonal_harmonics(t, values, skew);
    const size_t exact = size_t(t.exact_bands());
    for (size_t c = 0; c < 3; ++c) {
      ZonalSum sum{6, {}, {}};
      for (int i = 0; i < lobes; ++i) {
        sum.axes.push_back(lobe_axis(t, values, i));
        const float* g = values.data() + t.exact_values() + size_t(i) * t.lobe_values() + 3 + c * (6 - exact);
        sum.coefficients.resize(sum.coefficients.size() + exact);
        sum.coefficients.insert(sum.coefficients.end(), g, g + 6 - exact);
      }
      std::vector<float> expected = zonal_to_sh(sum), rotated(36);
      for (size_t k = 0; k < exact * exact; ++k) expected[k] = values[c * exact * exact + k];
      rotate_sh(make_sh_rotation(6, skew), expected, rotated);
      for (size_t k = 0; k < 36; ++k) {
        EXPECT_NEAR(sh[c * 36 + k], expected[k], 1e-5);
        EXPECT_NEAR(turned[c * 36 + k], rotated[k], 1e-5);
      }
    }
  }
}

}  // namespace
}  // namespace lambent
