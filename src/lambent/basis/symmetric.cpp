#include <lambent/basis/symmetric.h>
#include <lambent/core/check.h>

#include <Eigen/Eigenvalues>

namespace lambent {

SymmetricEigen symmetric_eigen(std::span<const double> symmetric, int n) {
  LAMBENT_CHECK(n >= 1 && symmetric.size() == size_t(n) * size_t(n));
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(Eigen::Map<const Matrix>(symmetric.data(), n, n));
  LAMBENT_CHECK(solver.info() == Eigen::Success);
  SymmetricEigen result{std::vector<double>(size_t(n)), std::vector<double>(symmetric.size())};
  for (int i = 0; i < n; ++i) {
    result.values[size_t(i)] = solver.eigenvalues()[n - 1 - i];  // the solver's ascend
    for (int k = 0; k < n; ++k) result.vectors[size_t(k * n + i)] = solver.eigenvectors()(k, n - 1 - i);
  }
  return result;
}

PseudoInverse pseudo_inverse(std::span<const double> symmetric, int n, double cutoff) {
  LAMBENT_CHECK(cutoff >= 0);
  const SymmetricEigen d = symmetric_eigen(symmetric, n);
  PseudoInverse result;
  while (result.rank < n && d.values[size_t(result.rank)] > cutoff * d.values[0]) ++result.rank;
  if (result.rank > 0) result.condition = d.values[0] / d.values[size_t(result.rank - 1)];
  result.values.resize(symmetric.size());
  for (int i = 0; i < n; ++i)
    for (int j = i; j < n; ++j) {
      double sum = 0;
      for (int k = 0; k < result.rank; ++k)
        sum += d.vectors[size_t(i * n + k)] * d.vectors[size_t(j * n + k)] / d.values[size_t(k)];
      result.values[size_t(i * n + j)] = result.values[size_t(j * n + i)] = sum;
    }
  return result;
}

}  // namespace lambent
