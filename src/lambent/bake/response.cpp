#include <lambent/bake/response.h>
#include <lambent/basis/hemispherical.h>
#include <lambent/basis/symmetric.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/core/sampling.h>

#include <algorithm>
#include <array>

namespace lambent {

namespace {

bool is_isotropic(const Brdf& brdf) {
  if (const auto* g = std::get_if<Ggx>(&brdf)) return g->alpha.x == g->alpha.y;
  if (const auto* w = std::get_if<Ward>(&brdf)) return w->alpha.x == w->alpha.y;
  return true;
}

// Where a node's O comes from: a view that is integrated, and how it is turned or mirrored from there.
struct NodeSource {
  size_t view;
  float cosine = 1, sine = 0;  // turned about z
  bool mirror_x = false, mirror_y = false;
};
struct Views {
  std::vector<Vec3> directions;
  std::vector<NodeSource> nodes;  // [y][x]
};

// Nodes lie on squares about the middle, which the map takes to circles of one height: ring k has nodes whose farther
// coordinate is k steps from the middle.
Views make_views(int grid, bool isotropic) {
  Views v;
  const int last = grid - 1, rings = grid / 2 + grid % 2;
  if (isotropic)
    for (int k = 0; k < rings; ++k) {  // towards +x
      const float z = view_map_direction(grid, grid / 2 + k, grid / 2).z;
      v.directions.push_back({std::sqrt(std::max(0.0f, 1 - z * z)), 0, z});
    }
  for (int y = 0; y < grid; ++y)
    for (int x = 0; x < grid; ++x) {
      const int far_x = std::max(x, last - x), far_y = std::max(y, last - y);
      const Vec3 wo = view_map_direction(grid, x, y);
      if (isotropic) {
        const Vec3 flat = normalize_or(Vec3(wo.x, wo.y, 0), Vec3(1, 0, 0));
        v.nodes.push_back({size_t(std::max(far_x, far_y) - grid / 2), flat.x, flat.y});
      } else {
        const size_t view = size_t((far_y - grid / 2) * rings + far_x - grid / 2);
        v.nodes.push_back({view, 1, 0, x != far_x, y != far_y});
      }
    }
  if (!isotropic)
    for (int y = grid / 2; y < grid; ++y)
      for (int x = grid / 2; x < grid; ++x) v.directions.push_back(view_map_direction(grid, x, y));
  return v;
}

// O(wo) by the same points for every view, so that noise does not vary from node to node: moments of harmonics, then
// the basis, once.
std::vector<Vec4d> integrate_view(const LinearMaterial& material, const CosineBasis& basis, Vec3 wo, int samples) {
  const size_t n = size_t(basis.count());
  std::vector<Vec4d> moments(n, Vec4d(0.0)), out(n, Vec4d(0.0));
  double y[sh_count(max_incident_order)];
  for (int s = 0; s < samples; ++s) {
    const BrdfSample drawn = sample(material.white, wo, sobol_owen(uint32_t(s), 0x0b5e));
    if (!(drawn.pdf > 0)) continue;
    const Vec3 a = evaluate(material.black, drawn.wi, wo) * (drawn.wi.z / drawn.pdf);
    const Vec4d value(a, luminance(drawn.weight - a));
    evaluate_sh(basis.order, Vec3d(drawn.wi), {y, n});
    for (size_t k = 0; k < n; ++k) moments[k] += value * y[k];
  }
  for (size_t j = 0; j < n; ++j)
    for (size_t k = 0; k <= j; ++k) out[j] += moments[k] * (basis.from_sh[j * n + k] / double(samples));
  return out;
}

// O of a node from that of its view: rows (l, m) and (l, -m) go with cos and sin of m times the azimuth.
void place_node(const NodeSource& from, const std::vector<Vec4d>& O, int order, bool isotropic, ViewWeights* out) {
  double c = 1, s = 0;  // of m times the angle
  for (int m = 0; m < order; ++m) {
    const double even_x = from.mirror_x && m % 2 ? -1 : 1,
                 odd = (from.mirror_x ? -even_x : 1.0) * (from.mirror_y ? -1 : 1);
    for (int l = m; l < order; ++l) {
      const Vec4d &p = O[size_t(sh_index(l, m))], &q = O[size_t(sh_index(l, -m))];
      if (m == 0) {
        out[sh_index(l, 0)] = ViewWeights(p);
        continue;
      }
      out[sh_index(l, m)] = ViewWeights(p * (isotropic ? c : even_x));
      out[sh_index(l, -m)] = ViewWeights(isotropic ? p * s : q * odd);
    }
    const double next = c * double(from.cosine) - s * double(from.sine);
    s = s * double(from.cosine) + c * double(from.sine), c = next;
  }
}

}  // namespace

Result<std::vector<ViewMap>> make_responses(std::span<const LinearMaterial> materials, const CosineBasis& basis,
                                            int grid, int samples, Progress* progress) {
  const size_t n = size_t(basis.count()), nodes = size_t(grid) * size_t(grid);
  const Views around[2] = {make_views(grid, false), make_views(grid, true)};
  std::vector<ViewMap> maps(materials.size(), ViewMap{grid, int(n), {}});
  struct Task {
    size_t material, view;
  };
  std::vector<Task> tasks;
  std::vector<uint8_t> isotropic(materials.size());
  std::vector<std::vector<std::vector<Vec4d>>> O(materials.size());  // [material][view][row]
  for (size_t m = 0; m < materials.size(); ++m) {
    const auto* black = std::get_if<Lambert>(&materials[m].black);
    const auto* white = std::get_if<Lambert>(&materials[m].white);
    maps[m].values.resize(nodes * n, ViewWeights(0.0f));
    if (black && white) {  // exact: z_0 = 1, and the others are orthogonal to it
      for (size_t i = 0; i < nodes; ++i)
        maps[m].values[i * n] = ViewWeights(black->albedo, white->albedo.x - black->albedo.x);
      continue;
    }
    isotropic[m] = is_isotropic(materials[m].black) && is_isotropic(materials[m].white);
    O[m].resize(around[isotropic[m]].directions.size());
    for (size_t v = 0; v < O[m].size(); ++v) tasks.push_back({m, v});
  }
  ProgressStage stage(progress, "materials", tasks.size());
  parallel_for(tasks.size(), 1, [&](size_t begin, size_t) {
    if (stage.cancelled()) return;
    const auto [m, v] = tasks[begin];
    O[m][v] = integrate_view(materials[m], basis, around[isotropic[m]].directions[v], samples);
    stage.advance();
  });
  if (stage.cancelled()) return Error{"", "cancelled"};
  parallel_for(materials.size() * nodes, size_t(grid), [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const size_t m = i / nodes;
      if (O[m].empty()) continue;
      const NodeSource& from = around[isotropic[m]].nodes[i % nodes];
      place_node(from, O[m][from.view], basis.order, isotropic[m], maps[m].values.data() + i % nodes * n);
    }
  });
  return maps;
}

double energy_beyond(const Brdf& brdf, const CosineBasis& basis, int samples) {
  constexpr int views = 8;
  if (std::holds_alternative<Lambert>(brdf)) return 0;
  // f is a colour: its luminance alone counts, in both sums. With c_j = 1/pi integral of f z_j cos, the span holds
  // pi sum c_j^2.
  const size_t n = size_t(basis.count());
  double all = 0, held = 0;
  std::vector<double> O(n);
  std::vector<float> z(n);
  for (int v = 0; v < views; ++v) {
    const float cosine = std::sqrt((float(v) + 0.5f) / views), sine = std::sqrt(1 - cosine * cosine);
    const float turn = 0.25f * pi * (float(v) + 0.5f) / views;  // between the axes of what is anisotropic
    const Vec3 wo(sine * std::cos(turn), sine * std::sin(turn), cosine);
    std::fill(O.begin(), O.end(), 0.0);
    double squares = 0;
    for (int s = 0; s < samples; ++s) {
      const BrdfSample drawn = sample(brdf, wo, sobol_owen(uint32_t(s), 0x0b5e));
      if (!(drawn.pdf > 0)) continue;
      const double weight = double(luminance(drawn.weight));
      evaluate_cosine_basis(basis, drawn.wi, z);
      for (size_t j = 0; j < n; ++j) O[j] += weight * double(z[j]) / samples;
      squares += weight * double(luminance(evaluate(brdf, drawn.wi, wo))) / samples;
    }
    all += squares;
    for (double o : O) held += o * o / double(pi);
  }
  return all > 0 ? std::clamp(1 - held / all, 0.0, 1.0) : 0.0;
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
  // A = U S V^T by the eigenvectors V of A^T A, n x n: singular values below 1e-8 of the greatest are rounding.
  std::vector<double> gram(size_t(n) * size_t(n));
  for (size_t at = 0; at < A.size(); at += size_t(n))
    for (size_t j = 0; j < size_t(n); ++j)
      for (size_t k = 0; k < size_t(n); ++k) gram[j * size_t(n) + k] += A[at + j] * A[at + k];
  const SymmetricEigen d = symmetric_eigen(gram, n);
  FactoredResponse f;
  double total = 0;
  for (double square : d.values) {
    total += std::max(square, 0.0);
    f.singular_values.push_back(std::sqrt(std::max(square, 0.0)));
  }
  double left = total;
  while (f.rows < std::min(max_rows, n) && (f.rows == 0 || left > tolerance * tolerance * total))
    left -= std::max(d.values[size_t(f.rows)], 0.0), ++f.rows;
  f.error = total > 0 ? std::sqrt(std::max(left, 0.0) / total) : 0;
  f.h.resize(size_t(f.rows) * size_t(n));
  for (int r = 0; r < f.rows; ++r)
    for (int j = 0; j < n; ++j) f.h[size_t(r * n + j)] = float(d.vectors[size_t(j * n + r)]);
  f.g = {response.grid, f.rows, std::vector<ViewWeights>(size_t(nodes) * size_t(f.rows))};
  for (int i = 0; i < nodes; ++i)
    for (int r = 0; r < f.rows; ++r)
      for (int c = 0; c < 4; ++c) {
        double sum = 0;
        for (int j = 0; j < n; ++j)
          sum += A[(size_t(i) * 4 + size_t(c)) * size_t(n) + size_t(j)] * d.vectors[size_t(j * n + r)];
        f.g.values[size_t(i * f.rows + r)][c] = float(sum / seen[size_t(i)]);
      }
  f.constant = f.rows == 1;
  for (const ViewWeights& w : f.g.values) {
    const ViewWeights apart = abs(w - f.g.values[0]);
    f.constant = f.constant && std::max({apart.x, apart.y, apart.z, apart.w}) < 1e-5f * length(w);
  }
  return f;
}

namespace {

std::vector<double> multiply(std::span<const double> square, std::span<const double> x) {
  std::vector<double> out(x.size());
  for (size_t i = 0; i < x.size(); ++i)
    for (size_t j = 0; j < x.size(); ++j) out[i] += square[i * x.size() + j] * x[j];
  return out;
}

}  // namespace

std::array<std::vector<float>, 4> project_response(const ViewMap& response, OutgoingKind kind, int order,
                                                   std::span<const Lobe> lobes) {
  const bool of_lobes = kind == OutgoingKind::directional, hemisphere = kind == OutgoingKind::hemisphere;
  LAMBENT_CHECK(kind == OutgoingKind::sh || hemisphere || kind == OutgoingKind::hsh || of_lobes);
  const size_t rows = of_lobes ? lobes.size() : size_t(sh_count(order)), n = size_t(response.rows),
               nodes = size_t(response.grid);
  // The map has equal areas: a node stands for 2 pi / (grid - 1)^2 of solid angle, half of it on an edge, a quarter in
  // a corner.
  std::vector<std::vector<double>> sums(4, std::vector<double>(rows * n, 0.0));
  std::vector<float> y(rows);
  std::vector<double> gram(of_lobes ? rows * rows : 0, 0.0);
  for (size_t row = 0; row < nodes; ++row)
    for (size_t column = 0; column < nodes; ++column) {
      auto share = [&](size_t i) { return i == 0 || i == nodes - 1 ? 0.5 : 1.0; };
      const double w = share(row) * share(column) * 2 * std::numbers::pi / double((nodes - 1) * (nodes - 1));
      const Vec3 wo = view_map_direction(response.grid, int(column), int(row));
      if (of_lobes)
        for (size_t q = 0; q < rows; ++q)
          y[q] = float(lobe_value(LobeKind::compact, lobes[q].sharpness, double(dot(lobes[q].axis, wo))));
      else if (kind == OutgoingKind::hsh) evaluate_hsh(order, wo, y);
      else evaluate_sh(order, wo, y);
      for (size_t q = 0; q < gram.size(); ++q) gram[q] += w * double(y[q / rows]) * double(y[q % rows]);
      const ViewWeights* O = response.values.data() + (row * nodes + column) * n;
      for (size_t q = 0; q < rows; ++q)
        for (size_t j = 0; j < n; ++j)
          for (size_t c = 0; c < 4; ++c) sums[c][q * n + j] += w * y[q] * O[j][int(c)];
    }
  std::array<std::vector<float>, 4> out;
  const HemisphereFit fit = hemisphere ? make_hemisphere_fit(order, 1e-4) : HemisphereFit{};
  const PseudoInverse dual = of_lobes ? pseudo_inverse(gram, int(rows), 1e-4) : PseudoInverse{};
  for (size_t c = 0; c < 4; ++c) {
    out[c].resize(rows * n);
    for (size_t j = 0; j < n; ++j) {
      std::vector<double> column(rows);
      for (size_t q = 0; q < rows; ++q) column[q] = sums[c][q * n + j];
      if (hemisphere) column = fit_hemisphere(fit, column);
      if (of_lobes) column = multiply(dual.values, column);
      for (size_t q = 0; q < rows; ++q) out[c][q * n + j] = float(column[q]);
    }
  }
  return out;
}

}  // namespace lambent
