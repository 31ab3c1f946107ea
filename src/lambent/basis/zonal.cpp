// Follows: local-deformable-prt, sections 3.1, 3.3 and 4.2; Legendre polynomials by Bonnet's recurrence.
#include <lambent/basis/quadrature.h>
#include <lambent/basis/zonal.h>
#include <lambent/core/check.h>

namespace lambent {

void zonal_to_lobe(std::span<double> c) {
  for (size_t l = 0; l < c.size(); ++l) c[l] /= std::sqrt(band_energy(int(l)));
}
void lobe_to_zonal(std::span<double> c) {
  for (size_t l = 0; l < c.size(); ++l) c[l] *= std::sqrt(band_energy(int(l)));
}

void evaluate_legendre(double x, std::span<double> out) {
  for (size_t l = 0; l < out.size(); ++l)
    out[l] = l == 0 ? 1
           : l == 1 ? x
                    : ((2 * double(l) - 1) * x * out[l - 1] - (double(l) - 1) * out[l - 2]) / double(l);
}

std::vector<double> project_zonal(int order, const std::function<double(double)>& f, std::span<const double> kinks) {
  LAMBENT_CHECK(order >= 1 && order <= max_sh_order);
  std::vector<double> g(size_t(order), 0.0), p(size_t(order), 0.0);
  double from = -1;
  for (size_t i = 0; i <= kinks.size(); ++i) {
    const double to = i < kinks.size() ? kinks[i] : 1.0;
    for (const QuadratureNode& node : gauss_legendre(64, from, to)) {
      evaluate_legendre(node.x, p);
      // g*_l = 2 pi times the integral of f P_l over the cosine: the factors of eq. 2 and eq. 4 cancel.
      for (size_t l = 0; l < g.size(); ++l) g[l] += 2 * std::numbers::pi * node.weight * f(node.x) * p[l];
    }
    from = to;
  }
  return g;
}

double evaluate_lobe(std::span<const double> lobe, double cosine) {
  LAMBENT_CHECK(lobe.size() <= size_t(max_sh_order));
  double p[max_sh_order], sum = 0;
  evaluate_legendre(cosine, {p, lobe.size()});
  for (size_t l = 0; l < lobe.size(); ++l) sum += lobe[l] * band_energy(int(l)) * p[l];  // the addition theorem
  return sum;
}

void convolve_sh(std::span<const float> lobe, std::span<const float> sh, std::span<float> out) {
  LAMBENT_CHECK(sh.size() == lobe.size() * lobe.size() && out.size() >= sh.size());
  for (int l = 0; l < int(lobe.size()); ++l)
    for (int k = l * l; k < (l + 1) * (l + 1); ++k) out[size_t(k)] = lobe[size_t(l)] * sh[size_t(k)];
}

Vec3 linear_axis(std::span<const float> sh) {
  LAMBENT_CHECK(sh.size() >= 4);
  return normalize_or({-sh[3], -sh[1], sh[2]}, {0, 0, 1});
}

std::vector<float> closest_lobe(std::span<const float> sh, Vec3 axis) {
  const int order = sh_order(sh.size());
  float y[sh_count(max_sh_order)];
  evaluate_sh(order, axis, y);
  std::vector<float> g(size_t(order), 0.0f);
  for (int l = 0; l < order; ++l) {
    double sum = 0;
    for (int k = l * l; k < (l + 1) * (l + 1); ++k) sum += double(y[k]) * sh[size_t(k)];
    g[size_t(l)] = float(sum / band_energy(l));
  }
  return g;
}

double evaluate_zonal(const ZonalSum& sum, Vec3d d) {
  double value = 0, g[max_sh_order];
  for (size_t i = 0; i < sum.axes.size(); ++i) {
    std::copy_n(sum.lobe(i).data(), sum.order, g);
    value += evaluate_lobe({g, size_t(sum.order)}, dot(Vec3d(sum.axes[i]), d));
  }
  return value;
}

std::vector<float> zonal_to_sh(const ZonalSum& sum) {
  std::vector<float> sh(size_t(sh_count(sum.order)), 0.0f), y(sh.size());
  for (size_t i = 0; i < sum.axes.size(); ++i) {
    evaluate_sh(sum.order, sum.axes[i], y);
    convolve_sh(sum.lobe(i), y, y);
    for (size_t k = 0; k < sh.size(); ++k) sh[k] += y[k];
  }
  return sh;
}

ZonalSum rotate_zonal(const ZonalSum& sum, const Mat3& R) {
  ZonalSum turned = sum;
  for (Vec3& axis : turned.axes) axis = R * axis;
  return turned;
}

std::vector<double> membrane_lobe(int order, double alpha) {
  LAMBENT_CHECK(order >= 1 && order <= max_sh_order);
  std::vector<double> g(size_t(order), 0.0);
  // A mirrored lobe has its odd bands negated.
  for (int l = 0; l < order; ++l) g[size_t(l)] = clamped_cosine(l) / std::numbers::pi * (l % 2 ? 1 - alpha : 1 + alpha);
  return g;
}

}  // namespace lambent
