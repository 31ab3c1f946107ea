#include <lambent/basis/cosine_basis.h>
#include <lambent/basis/quadrature.h>
#include <lambent/core/check.h>

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

}  // namespace lambent
