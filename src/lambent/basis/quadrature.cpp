// Follows: W. Press et al., "Numerical recipes", on Gauss-Legendre nodes by Newton's method from Tricomi's starting
// point.
#include <lambent/basis/quadrature.h>
#include <lambent/core/check.h>

namespace lambent {

std::vector<QuadratureNode> gauss_legendre(int count, double from, double to) {
  LAMBENT_CHECK(count >= 1);
  std::vector<QuadratureNode> nodes;
  const double middle = 0.5 * (from + to), half = 0.5 * (to - from);
  for (int i = 0; i < count; ++i) {
    double x = std::cos(std::numbers::pi * (i + 0.75) / (count + 0.5)), slope = 1;
    for (int step = 0; step < 100; ++step) {
      double p0 = 1, p1 = x;
      for (int k = 2; k <= count; ++k) {
        const double p = ((2 * k - 1) * x * p1 - (k - 1) * p0) / k;
        p0 = p1, p1 = p;
      }
      slope = count * (x * p1 - p0) / (x * x - 1);
      const double dx = p1 / slope;
      x -= dx;
      if (std::abs(dx) < 1e-15) break;
    }
    nodes.push_back({middle + half * x, half * 2 / ((1 - x * x) * slope * slope)});
  }
  return nodes;
}

std::vector<DirectionNode> direction_quadrature(int exact_order, double z_from, double z_to) {
  LAMBENT_CHECK(exact_order >= 1 && z_from >= -1 && z_to <= 1 && z_from < z_to);
  const int turns = 2 * exact_order;
  std::vector<DirectionNode> nodes;
  nodes.reserve(size_t(exact_order * turns));
  for (auto [z, weight] : gauss_legendre(exact_order, z_from, z_to)) {
    const double r = std::sqrt(std::max(0.0, 1 - z * z));
    for (int j = 0; j < turns; ++j) {
      const double phi = 2 * std::numbers::pi * (j + 0.5) / turns;
      nodes.push_back({Vec3d(r * std::cos(phi), r * std::sin(phi), z), weight * 2 * std::numbers::pi / turns});
    }
  }
  return nodes;
}

}  // namespace lambent
