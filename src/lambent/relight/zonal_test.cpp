#include <lambent/core/half.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/relight/zonal.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

struct Case {
  WritableZonalTransfer w;
  std::vector<Mat3> rotations;
  std::vector<Vec3> light;
};

Case make_case(int order, int lobes, int channels, size_t receivers, Precision precision) {
  Case c{make_zonal_transfer(order, lobes, channels, receivers, precision), {}, {}};
  Random random(uint64_t(order * 100 + lobes * 10 + channels));
  for (size_t r = 0; r < receivers; ++r) {
    std::vector<float> v(c.w.transfer.receiver_values());
    for (float& x : v) x = 2 * random.next() - 1;
    for (int i = 0; i < lobes; ++i) {  // axes of unit length up to the rounding
      float* a = v.data() + c.w.transfer.exact_values() + size_t(i) * c.w.transfer.lobe_values();
      const Vec3 axis = normalize_or({a[0], a[1], a[2]}, {1, 0, 0});
      for (int k = 0; k < 3; ++k) a[k] = axis[k];
    }
    store_receiver(c.w, r, v);
    c.rotations.push_back(
        rotation_from_yaw_pitch_roll({360 * random.next(), 180 * random.next() - 90, 360 * random.next()}));
  }
  for (int k = 0; k < sh_count(order) + 2; ++k)
    c.light.push_back({random.next(), random.next() - 0.5f, -random.next()});
  return c;
}

Vec3 plain(const Case& c, size_t r, bool turned) {
  const ZonalTransfer& t = c.w.transfer;
  const std::vector<float> sh = zonal_harmonics(t, load_receiver(t, r), turned ? c.rotations[r] : Mat3(1.0f));
  const size_t C = size_t(sh_count(t.order));
  Vec3 sum(0.0f);
  for (int ch = 0; ch < 3; ++ch)
    for (size_t k = 0; k < C; ++k) sum[ch] += sh[(t.channels == 3 ? size_t(ch) * C : 0) + k] * c.light[k][ch];
  return sum;
}

TEST(RelightZonal, DirectIsTheDotProductOfTheTurnedHarmonics) {
  for (int order : {1, 2, 3, 6, 11, 16})
    for (int lobes : {1, 4})
      for (int channels : {1, 3})
        for (Precision precision : {Precision::half, Precision::single}) {
          const Case c = make_case(order, lobes, channels, 37, precision);
          const ReceiverFrames frames = make_receiver_frames(c.rotations);
          Relit out;
          for (bool turned : {false, true}) {
            relight_zonal(c.w.transfer, turned ? &frames : nullptr, c.light, out);
            for (size_t r = 0; r < 37; ++r) {
              const Vec3 expected = plain(c, r, turned);
              const Vec3 alone = shade_zonal(c.w.transfer, load_receiver(c.w.transfer, r),
                                             turned ? c.rotations[r] : Mat3(1.0f), c.light);
              for (int k = 0; k < 3; ++k) {
                EXPECT_NEAR(out.at(r)[k], expected[k], 2e-6 * order * order * lobes) << order << ' ' << lobes;
                EXPECT_NEAR(alone[k], expected[k], 2e-6 * order * order * lobes) << order << ' ' << lobes;
              }
            }
          }
        }
}

TEST(RelightZonal, TheTableHoldsTheLightsBands) {
  const Case c = make_case(6, 4, 1, 1, Precision::single);
  ZonalLight light;
  specialise_light(c.w.transfer, c.light, light);
  float y[36];
  for (int row : {0, 5, 17, 31})
    for (int column : {0, 9, 40, 64}) {
      const float theta = pi * float(row) / 31, phi = 2 * pi * float(column) / 64;
      evaluate_sh(6, Vec3(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)), y);
      for (int l = 2; l < 6; ++l) {
        Vec3 sum(0.0f);
        for (int k = l * l; k < (l + 1) * (l + 1); ++k) sum += y[k] * c.light[size_t(k)];
        for (int ch = 0; ch < 3; ++ch)
          EXPECT_NEAR(light.texels[size_t((row * 65 + column) * 16 + 4 * ch + l - 2)], sum[ch], 1e-5);
      }
    }
}

TEST(RelightZonal, TheTableIsNearlyAsGoodAsTheDirectSum) {
  for (int order : {1, 2, 3, 6, 7, 16})
    for (int lobes : {1, 4})
      for (int channels : {1, 3})
        for (Precision precision : {Precision::half, Precision::single}) {
          const Case c = make_case(order, lobes, channels, 203, precision);
          const ReceiverFrames frames = make_receiver_frames(c.rotations);
          ZonalLight light;
          specialise_light(c.w.transfer, c.light, light);
          Relit direct, table;
          for (bool turned : {false, true}) {
            const ReceiverFrames* f = turned ? &frames : nullptr;
            relight_zonal(c.w.transfer, f, c.light, direct);
            relight_zonal(c.w.transfer, f, light, table);
            double error = 0, total = 0;
            for (size_t r = 0; r < 203; ++r) {
              const Vec3d a = direct.at(r), b = table.at(r);
              error += dot(a - b, a - b), total += dot(a, a);
            }
            // Linear interpolation over h = pi / 31 misses up to h^2 / 8 times the second derivative, n^2 at most, and
            // on the mean over a cell half of that.
            EXPECT_LT(std::sqrt(error / total), 0.0013 / 2 * order * order + 1e-4)
                << order << ' ' << lobes << ' ' << channels;
          }
        }
}

TEST(RelightZonal, IsTheSameOnOneThreadAndDoesNotMoveItsOutput) {
  const Case c = make_case(6, 4, 1, 30000, Precision::half);
  const ReceiverFrames frames = make_receiver_frames(c.rotations);
  ZonalLight light;
  specialise_light(c.w.transfer, c.light, light);
  Relit a, b;
  relight_zonal(c.w.transfer, &frames, light, a);
  const float* place = a.values.data();
  const float* texels = light.texels.data();
  specialise_light(c.w.transfer, c.light, light);
  relight_zonal(c.w.transfer, &frames, light, a);
  EXPECT_EQ(a.values.data(), place);
  EXPECT_EQ(light.texels.data(), texels);
  ThreadLimit one(1);
  relight_zonal(c.w.transfer, &frames, light, b);
  EXPECT_EQ(a.values, b.values);
}

// Rows of one receiver are turned alike, and each is what it is alone.
TEST(RelightZonal, RowsAreReceiversThatTurnTogether) {
  const int rows = 3;
  const Case alone = make_case(5, 3, 3, 40 * rows, Precision::half);
  const WritableZonalTransfer w = make_zonal_transfer(5, 3, 3, 40, Precision::half, rows);
  const size_t each = w.transfer.row_values();
  ASSERT_EQ(w.transfer.receiver_values(), 3 * each);
  std::vector<Mat3> rotations;
  for (size_t r = 0; r < 40; ++r) {
    std::vector<float> all;
    for (size_t row = 0; row < 3; ++row) {
      const std::vector<float> v = load_receiver(alone.w.transfer, r * 3 + row);
      all.insert(all.end(), v.begin(), v.end());
    }
    store_receiver(w, r, all);
    rotations.push_back(alone.rotations[r]);
  }
  const ReceiverFrames frames = make_receiver_frames(rotations);
  ZonalLight light;
  specialise_light(w.transfer, alone.light, light);
  Relit direct, table;
  relight_zonal(w.transfer, &frames, alone.light, direct);
  relight_zonal(w.transfer, &frames, light, table);
  ASSERT_EQ(direct.rows, rows);
  ASSERT_EQ(table.rows, rows);
  for (size_t r = 0; r < 40; ++r)
    for (int row = 0; row < rows; ++row) {
      const Vec3 truth = shade_zonal(alone.w.transfer, load_receiver(alone.w.transfer, r * 3 + size_t(row)),
                                     rotations[r], alone.light);
      EXPECT_LT(length(direct.at(r, row) - truth), 1e-4f * (1 + length(truth)));
      EXPECT_LT(length(table.at(r, row) - truth), 0.05f * (1 + length(truth)));
    }
}

TEST(RelightZonal, BrokenNumbersDoNotLeadAstray) {
  // What a hostile file may hold: axes of zero, infinite and not numbers.
  const WritableZonalTransfer w = make_zonal_transfer(6, 3, 1, 16, Precision::half);
  for (size_t r = 0; r < 16; ++r)
    store_receiver(w, r,
                   std::vector<float>(w.transfer.receiver_values(), r % 4 == 0   ? 0.0f
                                                                    : r % 4 == 1 ? INFINITY
                                                                    : r % 4 == 2 ? NAN
                                                                                 : -6e4f));
  const std::vector<Vec3> e(36, Vec3(1.0f));
  ZonalLight light;
  specialise_light(w.transfer, e, light);
  Relit out;
  relight_zonal(w.transfer, nullptr, light, out);
  relight_zonal(w.transfer, nullptr, e, out);
  EXPECT_EQ(out.at(0), Vec3(0.0f));
}

}  // namespace
}  // namespace lambent
