#pragma once
// Thin singular value decomposition of small matrices.
#include <span>
#include <vector>

namespace lambent {

// A = U diag(s) V^T for A of m x n, row-major; k = min(m, n) singular values, descending.
struct Svd {
  std::vector<double> U;  // m x k, row-major
  std::vector<double> s;  // k
  std::vector<double> V;  // n x k, row-major
  int m = 0, n = 0, k = 0;
};
Svd thin_svd(std::span<const double> A, int m, int n);

}  // namespace lambent
