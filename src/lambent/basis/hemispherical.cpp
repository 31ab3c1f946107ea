// Follows: P. Gautron, J. Krivanek, S. Pattanaik, K. Bouatouch, "A novel hemispherical basis for accurate and efficient
// rendering" (2004); general-prt (least-squares optimal hemispherical SH).
#include <lambent/basis/hemispherical.h>
#include <lambent/basis/symmetric.h>
#include <lambent/basis/quadrature.h>
#include <lambent/core/check.h>

#include <array>

namespace lambent {
namespace {

// The direction at 2z - 1: its radius sqrt(1 - (2z-1)^2) over sqrt(1 - z^2) is 2 sqrt(z / (1 + z)), which the pole does
// not disturb.
template <class T>
void evaluate(int order, Vector<T, 3> d, std::span<T> out) {
  LAMBENT_CHECK(order >= 1 && out.size() >= size_t(sh_count(order)));
  if (!(d.z >= 0)) {
    std::fill(out.begin(), out.begin() + sh_count(order), T(0));
    return;
  }
  const T scale = 2 * std::sqrt(d.z / (1 + d.z));
  evaluate_sh(order, Vector<T, 3>(scale * d.x, scale * d.y, 2 * d.z - 1), out);
  for (int i = 0; i < sh_count(order); ++i) out[size_t(i)] *= std::numbers::sqrt2_v<T>;
}

template <class Evaluate>
std::vector<double> project(int order, const std::function<double(Vec3d)>& f, int exact_order, Evaluate evaluate) {
  std::vector<double> result(size_t(sh_count(order))), y(result.size());
  for (const DirectionNode& node : direction_quadrature(std::max(order, exact_order), 0, 1)) {
    evaluate(order, node.direction, y);
    const double value = f(node.direction) * node.weight;
    for (size_t i = 0; i < y.size(); ++i) result[i] += value * y[i];
  }
  return result;
}

}  // namespace

void evaluate_hsh(int order, Vec3 d, std::span<float> out) { evaluate<float>(order, d, out); }
void evaluate_hsh(int order, Vec3d d, std::span<double> out) { evaluate<double>(order, d, out); }

std::vector<double> project_hsh(int order, const std::function<double(Vec3d)>& f, int exact_order) {
  return project(order, f, exact_order, [](int n, Vec3d d, std::span<double> y) { evaluate_hsh(n, d, y); });
}

float reconstruct_hsh(std::span<const float> c, Vec3 d) {
  std::array<float, sh_count(max_sh_order)> y;
  evaluate_hsh(sh_order(c.size()), d, y);
  float sum = 0;
  for (size_t i = 0; i < c.size(); ++i) sum += c[i] * y[i];
  return sum;
}

std::vector<double> project_sh_hemisphere(int order, const std::function<double(Vec3d)>& f, int exact_order) {
  return project(order, f, exact_order, [](int n, Vec3d d, std::span<double> y) { evaluate_sh(n, d, y); });
}

HemisphereFit make_hemisphere_fit(int order, double cutoff) {
  LAMBENT_CHECK(order >= 1 && order <= max_sh_order);
  const size_t n = size_t(sh_count(order));
  HemisphereFit fit{order, 0, std::vector<double>(n * n), {}};
  std::vector<double> y(n);
  for (const DirectionNode& node : direction_quadrature(order, 0, 1)) {
    evaluate_sh(order, node.direction, y);
    for (size_t i = 0; i < n; ++i)
      for (size_t j = 0; j < n; ++j) fit.gram[i * n + j] += node.weight * y[i] * y[j];
  }
  PseudoInverse inverse = pseudo_inverse(fit.gram, int(n), cutoff);
  fit.inverse = std::move(inverse.values), fit.rank = inverse.rank;
  return fit;
}

std::vector<double> fit_hemisphere(const HemisphereFit& fit, std::span<const double> integrals) {
  const size_t n = size_t(sh_count(fit.order));
  LAMBENT_CHECK(integrals.size() == n);
  std::vector<double> result(n);
  for (size_t i = 0; i < n; ++i)
    for (size_t j = 0; j < n; ++j) result[i] += fit.inverse[i * n + j] * integrals[j];
  return result;
}

std::vector<double> project_hemisphere(const HemisphereFit& fit, const std::function<double(Vec3d)>& f,
                                       int exact_order) {
  return fit_hemisphere(fit, project_sh_hemisphere(fit.order, f, exact_order));
}

}  // namespace lambent
