#pragma once
// The linear algebra of bases that are not orthonormal: of symmetric positive semi-definite matrices, n x n, such as
// the products of functions with one another, or A^T A.
#include <span>
#include <vector>

namespace lambent {

// symmetric = vectors diag(values) vectors^T.
struct SymmetricEigen {
  std::vector<double> values;   // n, the greatest first
  std::vector<double> vectors;  // n x n, row-major: column i goes with value i, columns are orthonormal
};
SymmetricEigen symmetric_eigen(std::span<const double> symmetric, int n);

// Pseudo-inverse: eigenvalues at or below `cutoff` times the greatest count as zero. The result is symmetric too.
struct PseudoInverse {
  std::vector<double> values;
  int rank = 0;
  double condition = 1;  // greatest over least eigenvalue kept
};
PseudoInverse pseudo_inverse(std::span<const double> symmetric, int n, double cutoff);

}  // namespace lambent
