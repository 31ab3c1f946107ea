#pragma once
// The linear algebra of bases that are not orthonormal.
#include <span>
#include <vector>

namespace lambent {

// Pseudo-inverse of a symmetric positive semi-definite matrix, n x n: eigenvalues at or below `cutoff` times the
// greatest count as zero. The result is symmetric too.
struct PseudoInverse {
  std::vector<double> values;
  int rank = 0;
  double condition = 1;  // greatest over least eigenvalue kept
};
PseudoInverse pseudo_inverse(std::span<const double> symmetric, int n, double cutoff);

}  // namespace lambent
