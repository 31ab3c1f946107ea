#include <lambent/basis/haar.h>
#include <lambent/core/random.h>

#include <gtest/gtest.h>

#include <functional>

namespace lambent {
namespace {

std::vector<float> noise(int levels, uint64_t seed) {
  Random random(seed);
  std::vector<float> pixels(haar_count(levels));
  for (float& p : pixels) p = random.next() - 0.3f;
  return pixels;
}
HaarTree tree_of(int levels, std::span<const float> pixels) {
  HaarTree t;
  haar_transform(levels, pixels, t);
  return t;
}
std::vector<float> basis_function(int levels, size_t i) {
  HaarTree t;
  t.levels = levels, t.coefficients.assign(haar_count(levels), 0), t.coefficients[i] = 1;
  return haar_pixels(t);
}

TEST(Haar, IsOrthonormalAndComesBack) {
  const int levels = 3;
  for (size_t i = 0; i < haar_count(levels); ++i) {
    const HaarTree t = tree_of(levels, basis_function(levels, i));
    for (size_t j = 0; j < haar_count(levels); ++j) EXPECT_NEAR(t.coefficients[j], i == j, 1e-6);
  }
  const std::vector<float> pixels = noise(6, 1), back = haar_pixels(tree_of(6, pixels));
  for (size_t i = 0; i < pixels.size(); ++i) EXPECT_NEAR(back[i], pixels[i], 1e-5);
}

// The theorem against the sum over pixels, for every triple of an 8 x 8 square.
TEST(Haar, TriplingCoefficientsAreTheIntegrals) {
  const int levels = 3;
  const size_t n = haar_count(levels);
  std::vector<std::vector<float>> f;
  for (size_t i = 0; i < n; ++i) f.push_back(basis_function(levels, i));
  size_t others = 0;
  for (size_t i = 0; i < n; ++i)
    for (size_t j = 0; j < n; ++j)
      for (size_t k = 0; k < n; ++k) {
        double sum = 0;
        for (size_t p = 0; p < n; ++p) sum += double(f[i][p]) * double(f[j][p]) * double(f[k][p]) / double(n);
        ASSERT_NEAR(haar_tripling_coefficient(levels, i, j, k), sum, 1e-9) << i << " " << j << " " << k;
        others += sum != 0;
      }
  EXPECT_GT(others, 600u);
}

TEST(Haar, TripleProductIsTheSumOverPixels) {
  for (int levels : {1, 2, 4, 6}) {
    const std::vector<float> a = noise(levels, 2), b = noise(levels, 3), c = noise(levels, 4);
    double sum = 0;
    for (size_t p = 0; p < a.size(); ++p) sum += double(a[p]) * double(b[p]) * double(c[p]) / double(a.size());
    size_t visited = 0;
    EXPECT_NEAR(haar_triple_product(tree_of(levels, a), tree_of(levels, b), tree_of(levels, c), &visited), sum, 1e-6);
    EXPECT_EQ(visited, haar_squares(levels));
  }
}

// The same from what non-linear approximation leaves, and fewer squares are looked at.
TEST(Haar, TripleProductOfWhatIsLeft) {
  const int levels = 5;
  HaarTree a = tree_of(levels, noise(levels, 5)), b = tree_of(levels, noise(levels, 6)),
           c = tree_of(levels, noise(levels, 7));
  keep_largest({&a, 1}, 0.03), keep_largest({&b, 1}, 0.05);
  const size_t left =
      size_t(std::count_if(a.coefficients.begin(), a.coefficients.end(), [](float x) { return x != 0; }));
  EXPECT_EQ(left, size_t(std::ceil(0.03 * 1024)));
  const std::vector<float> pa = haar_pixels(a), pb = haar_pixels(b), pc = haar_pixels(c);
  double sum = 0;
  for (size_t p = 0; p < pa.size(); ++p) sum += double(pa[p]) * double(pb[p]) * double(pc[p]) / double(pa.size());
  size_t visited = 0;
  EXPECT_NEAR(haar_triple_product(a, b, c, &visited), sum, 1e-6);
  EXPECT_LT(visited, haar_squares(levels));
}

TEST(Haar, QuantisedCoefficientsAreStepsApart) {
  Random random(8);
  std::vector<float> pixels(256);
  for (float& p : pixels) p = random.next() - 0.4f;
  HaarTree tree, rounded;
  haar_transform(4, pixels, tree);
  rounded = tree;
  quantise_haar(rounded, 8);
  float most = 0;
  for (float c : tree.coefficients) most = std::max(most, std::abs(c));
  for (size_t i = 0; i < tree.coefficients.size(); ++i) {
    const float steps = rounded.coefficients[i] / most * 127;
    EXPECT_NEAR(steps, std::round(steps), 1e-3);
    EXPECT_NEAR(rounded.coefficients[i], tree.coefficients[i], 0.501f * most / 127);
  }
  EXPECT_NE(rounded.coefficients, tree.coefficients);
  HaarTree zero;
  haar_transform(4, std::vector<float>(256, 0.0f), zero);
  quantise_haar(zero, 8);
  EXPECT_EQ(zero.coefficients, std::vector<float>(256, 0.0f));
}

}  // namespace
}  // namespace lambent
