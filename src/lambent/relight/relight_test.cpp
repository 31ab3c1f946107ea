#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/relight/relight.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

TEST(Relight, AgreesWithPlainDotProducts) {
  for (int order : {1, 2, 6, 12})
    for (Precision precision : {Precision::half, Precision::single})
      for (int channels : {1, 3}) {
        const size_t receivers = 101, C = size_t(order * order);
        const WritableTransfer w = make_transfer(order, channels, receivers, precision);
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

TEST(Relight, IsTheSameOnOneThreadAndDoesNotMoveItsOutput) {
  const WritableTransfer w = make_transfer(6, 1, 50000, Precision::single);
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
