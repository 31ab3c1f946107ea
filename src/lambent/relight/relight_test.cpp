#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/relight/fix_light.h>
#include <lambent/relight/relight.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

TEST(Relight, AgreesWithPlainDotProducts) {
  for (int order : {1, 2, 6, 12})
    for (Precision precision : {Precision::half, Precision::single})
      for (int channels : {1, 3}) {
        const size_t receivers = 101, C = size_t(order * order);
        const WritableTransfer w = make_transfer({.order = order}, 1, channels, receivers, precision);
        Random random(uint64_t(order * 10 + channels));
        std::vector<float> row(C * size_t(channels));
        for (size_t r = 0; r < receivers; ++r) {
          for (float& v : row) v = random.next() - 0.5f;
          store_receiver(w, r, row);
        }
        std::vector<Vec3> light(C + 3, Vec3(1e6f));  // longer than needed: the rest must not count
        for (size_t k = 0; k < C; ++k) light[k] = {random.next(), random.next() - 0.5f, -random.next()};
        Relit out;
        relight(w.transfer, light, out);
        for (size_t r = 0; r < receivers; ++r) {
          const std::vector<float> t = load_receiver(w.transfer, r);
          for (int c = 0; c < 3; ++c) {
            double sum = 0;
            for (size_t k = 0; k < C; ++k) sum += double(t[(channels == 3 ? size_t(c) * C : 0) + k]) * light[k][c];
            EXPECT_NEAR(out.at(r)[c], sum, 1e-6 * double(C));  // float rounding over C terms below 1
          }
        }
      }
}

TEST(Relight, RowsAreDotProductsOfTheirOwn) {
  const int rows = 5;
  const size_t receivers = 37, C = 4 + 2 + 1;  // harmonics, lobes, a group
  LightBasis light{.order = 2, .lobes = {{Vec3(0, 0, 1), 8}, {Vec3(1, 0, 0), 20}}, .groups = {"lamp"}};
  ASSERT_EQ(light.count(), C);
  for (int channels : {1, 3}) {
    const WritableTransfer w = make_transfer(light, rows, channels, receivers, Precision::single);
    Random random(uint64_t(90 + channels));
    std::vector<float> values(w.transfer.receiver_values());
    for (size_t r = 0; r < receivers; ++r) {
      for (float& v : values) v = random.next() - 0.5f;
      store_receiver(w, r, values);
    }
    std::vector<Vec3> coefficients(C);
    for (Vec3& l : coefficients) l = {random.next(), -random.next(), random.next() - 0.5f};
    Relit out;
    relight(w.transfer, coefficients, out);
    for (size_t r = 0; r < receivers; ++r) {
      const std::vector<float> t = load_receiver(w.transfer, r);
      for (int row = 0; row < rows; ++row)
        for (int c = 0; c < 3; ++c) {
          const float* values = t.data() + (size_t(row) * size_t(channels) + (channels == 3 ? size_t(c) : 0)) * C;
          double sum = 0;
          for (size_t k = 0; k < C; ++k) sum += double(values[k]) * coefficients[k][c];
          EXPECT_NEAR(out.at(r, row)[c], sum, 1e-6 * double(C));  // float rounding over C terms below 1
        }
    }
  }
}

TEST(FixLight, KeepsWhatRelightingGives) {
  const WritableTransfer w = make_transfer({.order = 3}, 4, 3, 50, Precision::single);
  Random random(31);
  std::vector<float> values(w.transfer.receiver_values());
  for (size_t r = 0; r < 50; ++r) {
    for (float& v : values) v = random.next() - 0.5f;
    store_receiver(w, r, values);
  }
  std::vector<Vec3> light(9);
  for (Vec3& l : light) l = {random.next(), -random.next(), random.next()};
  Relit a, b;
  relight(w.transfer, light, a);
  const Transfer fixed = fix_light(w.transfer, light, "light");
  ASSERT_EQ(fixed.columns(), 1u);
  EXPECT_EQ(fixed.light.groups[0], "light");
  const Vec3 half_red(0.5f, 1, 1);  // what is left of the light is its brightness
  relight(fixed, {&half_red, 1}, b);
  for (size_t r = 0; r < 50; ++r)
    for (int row = 0; row < 4; ++row) EXPECT_LT(length(b.at(r, row) - half_red * a.at(r, row)), 1e-6f);
}

TEST(Relight, IsTheSameOnOneThreadAndDoesNotMoveItsOutput) {
  const WritableTransfer w = make_transfer({.order = 6}, 1, 1, 50000, Precision::single);
  Random random(4);
  std::vector<float> row(36);
  for (size_t r = 0; r < 50000; r += 7) {
    for (float& v : row) v = random.next();
    store_receiver(w, r, row);
  }
  const std::vector<Vec3> light(36, Vec3(0.1f, 0.2f, 0.3f));
  Relit a, b;
  relight(w.transfer, light, a);
  const float* place = a.values.data();
  relight(w.transfer, light, a);
  EXPECT_EQ(a.values.data(), place);
  ThreadLimit one(1);
  relight(w.transfer, light, b);
  EXPECT_EQ(a.values, b.values);
}

}  // namespace
}  // namespace lambent
