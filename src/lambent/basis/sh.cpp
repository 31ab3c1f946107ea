#include <lambent/basis/sh.h>
#include <lambent/core/check.h>

#include <array>

namespace lambent {

std::vector<double> project_sh(int order, const std::function<double(Vec3d)>& f, int exact_order) {
  const int nodes = std::max(order, exact_order) + 1, turns = 2 * nodes;
  std::vector<double> result(size_t(sh_count(order))), y(result.size());
  for (int i = 0; i < nodes; ++i) {
    // Gauss-Legendre node i by Newton's method from Tricomi's starting point.
    double z = std::cos(std::numbers::pi * (i + 0.75) / (nodes + 0.5)), slope = 1;
    for (int step = 0; step < 100; ++step) {
      double p0 = 1, p1 = z;
      for (int k = 2; k <= nodes; ++k) {
        double p = ((2 * k - 1) * z * p1 - (k - 1) * p0) / k;
        p0 = p1, p1 = p;
      }
      slope = nodes * (z * p1 - p0) / (z * z - 1);
      double dz = p1 / slope;
      z -= dz;
      if (std::abs(dz) < 1e-15) break;
    }
    double weight = 2 / ((1 - z * z) * slope * slope) * (2 * std::numbers::pi / turns), r = std::sqrt(1 - z * z);
    for (int j = 0; j < turns; ++j) {
      double phi = 2 * std::numbers::pi * (j + 0.5) / turns;
      Vec3d d(r * std::cos(phi), r * std::sin(phi), z);
      evaluate_sh(order, d, y);
      double value = f(d) * weight;
      for (size_t k = 0; k < y.size(); ++k) result[k] += value * y[k];
    }
  }
  return result;
}

int sh_order(size_t coefficient_count) {
  int order = int(std::lround(std::sqrt(double(coefficient_count))));
  LAMBENT_CHECK(order >= 1 && order <= max_sh_order && size_t(sh_count(order)) == coefficient_count);
  return order;
}

float reconstruct_sh(std::span<const float> c, Vec3 d) {
  std::array<float, sh_count(max_sh_order)> y;
  evaluate_sh(sh_order(c.size()), d, y);
  float sum = 0;
  for (size_t i = 0; i < c.size(); ++i) sum += c[i] * y[i];
  return sum;
}

Vec3 reconstruct_sh(std::span<const Vec3> c, Vec3 d) {
  std::array<float, sh_count(max_sh_order)> y;
  evaluate_sh(sh_order(c.size()), d, y);
  Vec3 sum(0.0f);
  for (size_t i = 0; i < c.size(); ++i) sum += c[i] * y[i];
  return sum;
}

double clamped_cosine(int l) {
  if (l == 0) return std::numbers::pi;
  if (l == 1) return 2 * std::numbers::pi / 3;
  if (l % 2) return 0;
  double central = 1;  // l! / (2^l (l/2)!^2)
  for (int k = 1; k <= l / 2; ++k) central *= (2.0 * k - 1) / (2.0 * k);
  return 2 * std::numbers::pi * ((l / 2) % 2 ? 1 : -1) / ((l + 2.0) * (l - 1.0)) * central;
}

std::vector<float> sh_window(ShWindow window, int order) {
  std::vector<float> w(size_t(order), 1.0f);
  for (int l = 1; l < order; ++l) {
    float x = pi * float(l) / float(order);
    if (window == ShWindow::hann) w[size_t(l)] = 0.5f * (1 + std::cos(x));
    if (window == ShWindow::lanczos) w[size_t(l)] = std::sin(x) / x;
  }
  return w;
}

namespace {

// Lowest luminance of the irradiance of a windowed light over evenly spread normals, as a fraction of the mean.
double lowest_irradiance(std::span<const Vec3> light, std::span<const float> window) {
  std::vector<float> lum(light.size());
  for (size_t i = 0; i < light.size(); ++i) {
    int l = sh_band(int(i));
    lum[i] = luminance(light[i]) * window[size_t(l)] * float(clamped_cosine(l));
  }
  const int n = 2048;  // a Fibonacci lattice; spacing about 4 degrees, well under the finest lobe of order 16
  float lowest = INFINITY;
  for (int i = 0; i < n; ++i) {
    float z = 1 - (2 * float(i) + 1) / n, r = std::sqrt(1 - z * z), phi = float(i) * 2.39996323f;
    lowest = std::min(lowest, reconstruct_sh(lum, Vec3(r * std::cos(phi), r * std::sin(phi), z)));
  }
  double mean = lum[0] * std::sqrt(1 / (4 * std::numbers::pi));
  return mean > 0 ? lowest / mean : 0.0;
}

}  // namespace

std::vector<float> apply_sh_window(ShWindow window, std::span<Vec3> light) {
  const int order = sh_order(light.size());
  std::vector<float> w = sh_window(window, order);
  if (window == ShWindow::automatic) {
    auto laplacian = [&](double k) {
      for (int l = 0; l < order; ++l) w[size_t(l)] = float(1 / (1 + k * double(l * l) * double((l + 1) * (l + 1))));
    };
    const double tolerance = -1e-3;
    double low = 0, high = 0;
    laplacian(0);
    if (lowest_irradiance(light, w) < tolerance) {
      for (high = 1e-4; high < 1e3; high *= 4) {
        laplacian(high);
        if (lowest_irradiance(light, w) >= tolerance) break;
      }
      for (int i = 0; i < 24; ++i) {
        double middle = 0.5 * (low + high);
        laplacian(middle);
        (lowest_irradiance(light, w) >= tolerance ? high : low) = middle;
      }
    }
    laplacian(high);
  }
  for (size_t i = 0; i < light.size(); ++i) light[i] *= w[size_t(sh_band(int(i)))];
  return w;
}

}  // namespace lambent
