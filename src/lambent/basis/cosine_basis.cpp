#include <lambent/basis/cosine_basis.h>
#include <lambent/basis/quadrature.h>
#include <lambent/core/check.h>

#include <algorithm>

namespace lambent {

CosineBasis make_cosine_basis(int order) {
  LAMBENT_CHECK(order >= 1 && order <= max_incident_order);
  CosineBasis basis;
  basis.order = order;
  const size_t n = size_t(sh_count(order));
  // The Gram matrix of the harmonics under cos / pi; y_i y_j z has at most 2 order - 1 bands, and on the hemisphere
  // parts of odd azimuthal frequency vanish.
  std::vector<double> gram(n * n, 0.0), y(n);
  for (const DirectionNode& node : direction_quadrature(2 * order + 2, 0, 1)) {
    evaluate_sh(order, node.direction, y);
    const double w = node.weight * node.direction.z / std::numbers::pi;
    for (size_t i = 0; i < n; ++i)
      for (size_t j = 0; j <= i; ++j) gram[i * n + j] += w * y[i] * y[j];
  }
  // G = C C^T; W = C^-1.
  std::vector<double> C(n * n, 0.0);
  for (size_t i = 0; i < n; ++i)
    for (size_t j = 0; j <= i; ++j) {
      double sum = gram[i * n + j];
      for (size_t k = 0; k < j; ++k) sum -= C[i * n + k] * C[j * n + k];
      if (i == j) {
        LAMBENT_CHECK(sum > 0);
        C[i * n + i] = std::sqrt(sum);
      } else {
        C[i * n + j] = sum / C[j * n + j];
      }
    }
  basis.from_sh.assign(n * n, 0.0);
  for (size_t j = 0; j < n; ++j) {
    basis.from_sh[j * n + j] = 1 / C[j * n + j];
    for (size_t i = j + 1; i < n; ++i) {
      double sum = 0;
      for (size_t k = j; k < i; ++k) sum -= C[i * n + k] * basis.from_sh[k * n + j];
      basis.from_sh[i * n + j] = sum / C[i * n + i];
    }
  }
  basis.to_sh = std::move(C);
  return basis;
}

void evaluate_cosine_basis(const CosineBasis& basis, Vec3 d, std::span<float> out) {
  const size_t n = size_t(basis.count());
  LAMBENT_CHECK(out.size() >= n);
  double y[sh_count(max_incident_order)];
  evaluate_sh(basis.order, Vec3d(d), {y, n});
  for (size_t j = 0; j < n; ++j) {
    double sum = 0;
    for (size_t k = 0; k <= j; ++k) sum += basis.from_sh[j * n + k] * y[k];
    out[j] = float(sum);
  }
}

std::vector<double> extend_below(const CosineBasis& basis, double below) {
  const size_t n = size_t(basis.count());
  const std::vector<double>& C = basis.to_sh;  // y = C z, so 1/pi * integral of y L cos is C X, and the Gram is C C^T
  std::vector<double> A(n * n, 0.0), out(C), y(n);
  for (const DirectionNode& node : direction_quadrature(2 * basis.order + 2, -1, 0)) {
    evaluate_sh(basis.order, node.direction, y);
    for (size_t i = 0; i < n; ++i)
      for (size_t j = 0; j < n; ++j) A[i * n + j] += below * node.weight * y[i] * y[j];
  }
  for (size_t i = 0; i < n; ++i)
    for (size_t j = 0; j < n; ++j)
      for (size_t k = 0; k <= std::min(i, j); ++k) A[i * n + j] += C[i * n + k] * C[j * n + k];
  // Gauss: A is symmetric and positive, so no pivots are sought.
  for (size_t p = 0; p < n; ++p)
    for (size_t i = p + 1; i < n; ++i) {
      const double f = A[i * n + p] / A[p * n + p];
      for (size_t j = p; j < n; ++j) A[i * n + j] -= f * A[p * n + j];
      for (size_t j = 0; j < n; ++j) out[i * n + j] -= f * out[p * n + j];
    }
  for (size_t p = n; p-- > 0;)
    for (size_t j = 0; j < n; ++j) {
      double sum = out[p * n + j];
      for (size_t k = p + 1; k < n; ++k) sum -= A[p * n + k] * out[k * n + j];
      out[p * n + j] = sum / A[p * n + p];
    }
  return out;
}

}  // namespace lambent
