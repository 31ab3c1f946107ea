#include <lambent/compress/cpca.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/relight/relight.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// Receivers in `groups` affine subspaces of dimension `rank`, in runs that do not match any clusters' first guess.
WritableTransfer clustered(size_t receivers, int groups, int rank, int rows, int channels) {
  WritableTransfer w = make_transfer({.order = 4}, rows, channels, receivers, Precision::single);
  const size_t D = w.transfer.receiver_values();
  Random random(12);
  std::vector<std::vector<float>> vectors(size_t(groups * (1 + rank)), std::vector<float>(D));
  for (auto& v : vectors)
    for (float& x : v) x = random.next() - 0.5f;
  std::vector<float> value(D);
  for (size_t r = 0; r < receivers; ++r) {
    const size_t g = (r * 7 / 50) % size_t(groups) * size_t(1 + rank);
    value = vectors[g];
    for (auto& x : value) x *= 4;
    for (int k = 1; k <= rank; ++k) {
      const float f = random.next() - 0.5f;
      for (size_t i = 0; i < D; ++i) value[i] += f * vectors[g + size_t(k)][i];
    }
    store_receiver(w, r, value);
  }
  return w;
}

TEST(Cpca, FindsTheClustersThatAreThere) {
  for (int channels : {1, 3}) {
    const WritableTransfer w = clustered(1000, 5, 3, 2, channels);
    double error = 1;
    auto c = compress_cpca(w.transfer, {.clusters = 10, .rank = 3, .iterations = 8}, &error);
    ASSERT_TRUE(c);
    // Weights are halves: 2^-11 of components that are a quarter of the whole.
    EXPECT_LT(error, 3e-4);
    EXPECT_LT(c->bytes(), w.transfer.bytes());
    double difference = 0, total = 0;  // the error that is told is the error that is there
    for (size_t r = 0; r < 1000; ++r) {
      const std::vector<float> a = load_receiver(w.transfer, r), b = load_receiver(*c, r);
      for (size_t k = 0; k < a.size(); ++k) difference += (a[k] - b[k]) * (a[k] - b[k]), total += a[k] * a[k];
    }
    EXPECT_NEAR(error, std::sqrt(difference / total), 1e-6);
  }
}

TEST(Cpca, ErrorFallsWithRankAndIsThatOfPcaForOneCluster) {
  WritableTransfer w = make_transfer({.order = 3}, 1, 1, 400, Precision::single);
  Random random(5);
  std::vector<float> v(9);
  // Independent coordinates of known spread: the best rank-k fit leaves the smallest.
  for (size_t r = 0; r < 400; ++r) {
    for (size_t k = 0; k < 9; ++k) v[k] = (random.next() + random.next() - 1) * std::pow(0.5f, float(k));
    store_receiver(w, r, v);
  }
  double last = 1;
  for (int rank : {0, 1, 3, 6, 9}) {
    double error = 0;
    ASSERT_TRUE(compress_cpca(w.transfer, {.clusters = 1, .rank = rank, .iterations = 3}, &error));
    double left = 0, all = 0;
    for (int k = 0; k < 9; ++k) all += std::pow(0.25, k), left += k >= rank ? std::pow(0.25, k) : 0;
    // The spreads are those of 400 samples: 1 / sqrt(2 * 400) of them uncertain, and correlated by chance.
    EXPECT_NEAR(error, std::sqrt(left / all), 0.12 * std::sqrt(left / all) + 3e-4);
    EXPECT_LT(error, last + 1e-6);
    last = error;
  }
}

TEST(Cpca, RelightsWhatItHolds) {
  for (int channels : {1, 3}) {
    const WritableTransfer w = clustered(333, 4, 2, 3, channels);
    auto c = compress_cpca(w.transfer, {.clusters = 6, .rank = 2, .iterations = 3});
    ASSERT_TRUE(c);
    Random random(9);
    std::vector<Vec3> light(16);
    for (Vec3& l : light) l = Vec3(random.next(), random.next(), random.next()) - 0.4f;
    Relit out;
    relight(*c, light, out);
    for (size_t r = 0; r < 333; ++r) {
      const std::vector<float> t = load_receiver(*c, r);
      for (int row = 0; row < 3; ++row)
        for (int ch = 0; ch < 3; ++ch) {
          double sum = 0;
          for (size_t k = 0; k < 16; ++k)
            sum += double(t[(size_t(row) * size_t(channels) + (channels == 3 ? size_t(ch) : 0)) * 16 + k]) *
                   light[k][ch];
          EXPECT_NEAR(out.at(r, row)[ch], sum, 2e-5);  // float rounding of 16 terms of some units
        }
    }
  }
}

TEST(Cpca, IsTheSameOnOneThreadAndRefusesNonsense) {
  const WritableTransfer w = clustered(500, 5, 2, 1, 1);
  auto a = compress_cpca(w.transfer, {.clusters = 7, .rank = 2});
  ThreadLimit one(1);
  auto b = compress_cpca(w.transfer, {.clusters = 7, .rank = 2});
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->vectors, b->vectors);
  EXPECT_EQ(a->weights, b->weights);
  EXPECT_FALSE(compress_cpca(w.transfer, {.clusters = 0}));
  EXPECT_FALSE(compress_cpca(w.transfer, {.clusters = 501}));
  EXPECT_FALSE(compress_cpca(w.transfer, {.clusters = 2, .rank = -1}));
  EXPECT_FALSE(compress_cpca(w.transfer, {.clusters = 2, .rank = 100}));
}

}  // namespace
}  // namespace lambent
