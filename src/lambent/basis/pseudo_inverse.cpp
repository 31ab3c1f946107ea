#include <lambent/basis/pseudo_inverse.h>
#include <lambent/core/check.h>

#include <Eigen/Dense>

namespace lambent {

PseudoInverse pseudo_inverse(std::span<const double> symmetric, int n, double cutoff) {
  LAMBENT_CHECK(n >= 1 && symmetric.size() == size_t(n) * size_t(n) && cutoff >= 0);
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(Eigen::Map<const Matrix>(symmetric.data(), n, n));
  LAMBENT_CHECK(solver.info() == Eigen::Success);
  const Eigen::VectorXd& eigenvalues = solver.eigenvalues();  // ascending
  PseudoInverse result;
  Eigen::VectorXd inverse = Eigen::VectorXd::Zero(n);
  for (int i = n - 1; i >= 0; --i) {
    if (!(eigenvalues[i] > cutoff * eigenvalues[n - 1])) break;
    inverse[i] = 1 / eigenvalues[i];
    result.condition = eigenvalues[n - 1] / eigenvalues[i];
    ++result.rank;
  }
  const Matrix full = solver.eigenvectors() * inverse.asDiagonal() * solver.eigenvectors().transpose();
  result.values.resize(symmetric.size());
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) result.values[size_t(i * n + j)] = 0.5 * (full(i, j) + full(j, i));
  return result;
}

}  // namespace lambent
