#include <lambent/basis/cosine_basis.h>
#include <lambent/basis/symmetric.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

TEST(CosineBasis, IsOrthonormalUnderTheCosine) {
  // Against plain midpoint sums over height and azimuth.
  const CosineBasis basis = make_cosine_basis(5);
  const size_t n = 25;
  std::vector<double> gram(n * n, 0.0);
  std::vector<float> z(n);
  const int rings = 2000, spokes = 24;
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < spokes; ++j) {
      const double h = (i + 0.5) / rings, r = std::sqrt(1 - h * h), phi = 2 * std::numbers::pi * (j + 0.5) / spokes;
      evaluate_cosine_basis(basis, Vec3(Vec3d(r * std::cos(phi), r * std::sin(phi), h)), z);
      for (size_t a = 0; a < n; ++a)
        for (size_t b = 0; b < n; ++b) gram[a * n + b] += double(z[a]) * z[b] * 2 * h / (rings * spokes);
    }
  // The midpoint rule's error: the second derivative, some thousands for polynomials of degree 8 up to 10 at the
  // horizon, over 24 rings^2.
  for (size_t a = 0; a < n; ++a)
    for (size_t b = 0; b < n; ++b) EXPECT_NEAR(gram[a * n + b], a == b ? 1.0 : 0.0, 2e-4) << a << " " << b;
}

TEST(CosineBasis, BeginsWithOneAndGoesBackToHarmonics) {
  for (int order : {1, 3, 6, max_incident_order}) {
    const CosineBasis basis = make_cosine_basis(order);
    const size_t n = size_t(basis.count());
    Random random{uint64_t(order)};
    std::vector<float> z(n), y(n);
    for (int i = 0; i < 20; ++i) {
      const Vec3 d = square_to_cosine_hemisphere(random.next2());
      evaluate_cosine_basis(basis, d, z);
      evaluate_sh(order, d, y);
      EXPECT_NEAR(z[0], 1, 1e-6);
      for (size_t k = 0; k < n; ++k) {
        double sum = 0, size = 0;
        for (size_t j = 0; j <= k; ++j)
          sum += basis.to_sh[k * n + j] * z[j], size += std::abs(basis.to_sh[k * n + j] * z[j]);
        EXPECT_NEAR(sum, y[k], 1e-5 * (1 + size));  // float rounding of the values summed
      }
    }
  }
}

TEST(SymmetricEigen, MultipliesBackAndIsOrthonormal) {
  for (const auto& [m, n] : {std::pair{7, 4}, {4, 7}, {5, 5}}) {  // A^T A; of the second three values are 0
    std::vector<double> A(size_t(m * n)), gram(size_t(n * n), 0.0);
    Random random{uint64_t(m * 10 + n)};
    for (double& a : A) a = random.next() - 0.4;
    for (int i = 0; i < m; ++i)
      for (int j = 0; j < n; ++j)
        for (int k = 0; k < n; ++k) gram[size_t(j * n + k)] += A[size_t(i * n + j)] * A[size_t(i * n + k)];
    const SymmetricEigen d = symmetric_eigen(gram, n);
    for (int a = 0; a < n; ++a) {
      if (a > 0) EXPECT_LE(d.values[size_t(a)], d.values[size_t(a - 1)]);
      if (a >= m) EXPECT_NEAR(d.values[size_t(a)], 0, 1e-12);
      for (int b = 0; b < n; ++b) {
        double product = 0, across = 0;
        for (int k = 0; k < n; ++k) {
          product += d.vectors[size_t(a * n + k)] * d.values[size_t(k)] * d.vectors[size_t(b * n + k)];
          across += d.vectors[size_t(k * n + a)] * d.vectors[size_t(k * n + b)];
        }
        EXPECT_NEAR(product, gram[size_t(a * n + b)], 1e-12);
        EXPECT_NEAR(across, a == b ? 1 : 0, 1e-12);
      }
    }
  }
}

}  // namespace
}  // namespace lambent
