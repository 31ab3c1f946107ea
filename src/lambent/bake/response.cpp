#include <lambent/bake/response.h>
#include <lambent/basis/hemispherical.h>
#include <lambent/basis/svd.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/core/sampling.h>

#include <array>

namespace lambent {

ViewMap make_response(const LinearMaterial& material, const CosineBasis& basis, int grid, int samples) {
  const size_t n = size_t(basis.count());
  ViewMap map{grid, int(n), std::vector<ViewWeights>(size_t(grid) * size_t(grid) * n, ViewWeights(0.0f))};
  const auto* black = std::get_if<Lambert>(&material.black);
  const auto* white = std::get_if<Lambert>(&material.white);
  if (black && white) {  // exact: z_0 = 1, and the others are orthogonal to it
    for (size_t i = 0; i < map.values.size(); i += n)
      map.values[i] = ViewWeights(black->albedo, white->albedo.x - black->albedo.x);
    return map;
  }
  parallel_for(size_t(grid), 1, [&](size_t begin, size_t end) {
    std::vector<float> z(n);
    std::vector<Vec4d> sum(n);
    for (size_t y = begin; y < end; ++y)
      for (int x = 0; x < grid; ++x) {
        const Vec3 wo = view_map_direction(grid, x, int(y));
        std::fill(sum.begin(), sum.end(), Vec4d(0.0));
        for (int s = 0; s < samples; ++s) {
          // The same points for every view, so that noise does not vary from node to node.
          const BrdfSample drawn = sample(material.white, wo, sobol_owen(uint32_t(s), 0x0b5e));
          if (!(drawn.pdf > 0)) continue;
          const Vec3 a = evaluate(material.black, drawn.wi, wo) * (drawn.wi.z / drawn.pdf);
          const float b = luminance(drawn.weight - a);
          evaluate_cosine_basis(basis, drawn.wi, z);
          for (size_t j = 0; j < n; ++j) sum[j] += Vec4d(a, b) * double(z[j]);
        }
        ViewWeights* out = map.values.data() + (y * size_t(grid) + size_t(x)) * n;
        for (size_t j = 0; j < n; ++j) out[j] = ViewWeights(sum[j] / double(samples));
      }
  });
  return map;
}

std::vector<double> phong_convolution(float exponent, int order) {
  const double n = exponent;
  std::vector<double> bands{(n + 2) / (n + 1), 1.0};
  for (int l = 2; l < order; ++l) bands.push_back(bands[size_t(l - 2)] * (n - l + 2) / (n + l + 1));
  bands.resize(size_t(order));
  return bands;
}

std::vector<float> convolve_phong(const LinearMaterial& material, const CosineBasis& basis, int channel) {
  const Phong* phong = std::get_if<Phong>(&material.black);
  const Lambert *black = std::get_if<Lambert>(&material.black), *white = std::get_if<Lambert>(&material.white);
  if (!phong && !(black && white)) return {};
  const size_t J = size_t(basis.count());
  std::vector<float> rows((J + 2) * J, 0.0f);
  rows[J * J] = phong ? phong->diffuse[channel] : black->albedo[channel];  // z_0 = 1: X_0 is irradiance over pi
  rows[(J + 1) * J] = phong ? 0 : white->albedo[channel] - black->albedo[channel];
  if (!phong) return rows;
  // y_k = sum_j S_kj z_j on the hemisphere, so that sum_j S_kj X_j is 1/pi * integral of L V cos y_k.
  const std::vector<double> bands = phong_convolution(phong->exponent, basis.order);
  for (size_t k = 0; k < J; ++k)
    for (size_t j = 0; j <= k; ++j)
      rows[k * J + j] =
          float(std::numbers::pi * bands[size_t(sh_band(int(k)))] * phong->specular[channel] * basis.to_sh[k * J + j]);
  return rows;
}

FactoredResponse factor_response(const ViewMap& response, int max_rows, double tolerance) {
  const int nodes = response.grid * response.grid, n = response.rows;
  // One row of the matrix for each node and component, weighed by how much of a picture, or of the rays that meet a
  // surface, sees it so: the cosine of its view (the map has equal areas; a grazing view keeps a little).
  std::vector<double> A(size_t(nodes) * 4 * size_t(n)), seen;
  for (int i = 0; i < nodes; ++i) {
    seen.push_back(
        std::sqrt(std::max(0.02, double(view_map_direction(response.grid, i % response.grid, i / response.grid).z))));
    for (int c = 0; c < 4; ++c)
      for (int j = 0; j < n; ++j)
        A[(size_t(i) * 4 + size_t(c)) * size_t(n) + size_t(j)] = seen.back() * response.values[size_t(i * n + j)][c];
  }
  const Svd d = thin_svd(A, nodes * 4, n);
  FactoredResponse f;
  f.singular_values = d.s;
  double total = 0;
  for (double s : d.s) total += s * s;
  double left = total;
  while (f.rows < std::min(max_rows, d.k) && (f.rows == 0 || left > tolerance * tolerance * total))
    left -= d.s[size_t(f.rows)] * d.s[size_t(f.rows)], ++f.rows;
  f.error = total > 0 ? std::sqrt(std::max(left, 0.0) / total) : 0;
  f.h.resize(size_t(f.rows) * size_t(n));
  for (int r = 0; r < f.rows; ++r)
    for (int j = 0; j < n; ++j) f.h[size_t(r * n + j)] = float(d.V[size_t(j * d.k + r)]);
  f.g = {response.grid, f.rows, std::vector<ViewWeights>(size_t(nodes) * size_t(f.rows))};
  for (int i = 0; i < nodes; ++i)
    for (int r = 0; r < f.rows; ++r)
      for (int c = 0; c < 4; ++c)
        f.g.values[size_t(i * f.rows + r)][c] =
            float(d.U[(size_t(i) * 4 + size_t(c)) * size_t(d.k) + size_t(r)] * d.s[size_t(r)] / seen[size_t(i)]);
  f.constant = f.rows == 1;
  for (const ViewWeights& w : f.g.values) {
    const ViewWeights apart = abs(w - f.g.values[0]);
    f.constant = f.constant && std::max({apart.x, apart.y, apart.z, apart.w}) < 1e-5f * length(w);
  }
  return f;
}

std::array<std::vector<float>, 4> project_response(const ViewMap& response, OutgoingKind kind, int order) {
  LAMBENT_CHECK(kind == OutgoingKind::sh || kind == OutgoingKind::hemisphere || kind == OutgoingKind::hsh);
  const size_t rows = size_t(sh_count(order)), n = size_t(response.rows), nodes = size_t(response.grid);
  // The map has equal areas: a node stands for 2 pi / (grid - 1)^2 of solid angle, half of it on an edge, a quarter in
  // a corner.
  std::vector<std::vector<double>> sums(4, std::vector<double>(rows * n, 0.0));
  std::vector<float> y(rows);
  for (size_t row = 0; row < nodes; ++row)
    for (size_t column = 0; column < nodes; ++column) {
      auto share = [&](size_t i) { return i == 0 || i == nodes - 1 ? 0.5 : 1.0; };
      const double w = share(row) * share(column) * 2 * std::numbers::pi / double((nodes - 1) * (nodes - 1));
      const Vec3 wo = view_map_direction(response.grid, int(column), int(row));
      if (kind == OutgoingKind::hsh) evaluate_hsh(order, wo, y);
      else evaluate_sh(order, wo, y);
      const ViewWeights* O = response.values.data() + (row * nodes + column) * n;
      for (size_t q = 0; q < rows; ++q)
        for (size_t j = 0; j < n; ++j)
          for (size_t c = 0; c < 4; ++c) sums[c][q * n + j] += w * y[q] * O[j][int(c)];
    }
  std::array<std::vector<float>, 4> out;
  const HemisphereFit fit = kind == OutgoingKind::hemisphere ? make_hemisphere_fit(order, 1e-4) : HemisphereFit{};
  for (size_t c = 0; c < 4; ++c) {
    out[c].resize(rows * n);
    for (size_t j = 0; j < n; ++j) {
      std::vector<double> column(rows);
      for (size_t q = 0; q < rows; ++q) column[q] = sums[c][q * n + j];
      if (kind == OutgoingKind::hemisphere) column = fit_hemisphere(fit, column);
      for (size_t q = 0; q < rows; ++q) out[c][q * n + j] = float(column[q]);
    }
  }
  return out;
}

}  // namespace lambent
