// The matrix A holds f cos(theta_i), a row for each wo and channel and a column for each wi, weighted so that sums of squares are
// integrals: wi by solid angle, wo by projected solid angle over pi. Its right singular vectors are the eigenvectors of A^T A: n^2
// unknowns in place of 3 n^2 by n^2. Squaring costs half of a double's digits, of which the seven left are as many as floats hold.
#include <lambent/brdf/svd.h>
#include <lambent/basis/sh.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/core/sampling.h>

#include <Eigen/Dense>

namespace lambent {
namespace {

// Bilinear look-up of a grid of n x n cells, clamped at the border.
struct Tap {
  size_t index[4];
  float weight[4];
};
Tap tap(int n, Vec3 w) {
  const Vec2 at = disk_to_square(Vec2(w.x, w.y)) * float(n) - 0.5f, low = glm::floor(at), share = at - low;
  const int x = std::clamp(int(low.x), 0, n - 1), y = std::clamp(int(low.y), 0, n - 1);
  const int x1 = std::min(int(low.x) + 1, n - 1), y1 = std::min(int(low.y) + 1, n - 1);
  return {{size_t(y * n + x), size_t(y * n + x1), size_t(y1 * n + x), size_t(y1 * n + x1)},
          {(1 - share.x) * (1 - share.y), share.x * (1 - share.y), (1 - share.x) * share.y, share.x * share.y}};
}

template <class T>
T interpolate(const T* values, const Tap& t) {
  return values[t.index[0]] * t.weight[0] + values[t.index[1]] * t.weight[1] + values[t.index[2]] * t.weight[2] +
         values[t.index[3]] * t.weight[3];
}

}  // namespace

Vec3 grid_direction(int size, int x, int y) {
  return square_to_cosine_hemisphere((Vec2(float(x), float(y)) + 0.5f) / float(size));
}

FactoredBrdf factorise_brdf(const Brdf& brdf, int terms, int size) {
  LAMBENT_CHECK(size >= 2 && size <= 64 && terms >= 1 && terms <= size * size);
  const int cells = size * size;
  std::vector<Vec3> directions;
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) directions.push_back(grid_direction(size, x, y));
  // A cell's solid angle is pi / cells / cos; A holds f cos sqrt(solid angle).
  const double cell = std::numbers::pi / cells;
  Eigen::MatrixXd a(3 * cells, cells);
  parallel_for(size_t(cells), 16, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      for (size_t o = 0; o < size_t(cells); ++o) {
        const Vec3 f = evaluate(brdf, directions[i], directions[o]);
        const double weight = std::sqrt(double(directions[i].z) * cell / cells);
        for (int c = 0; c < 3; ++c) a(Eigen::Index(3 * o) + c, Eigen::Index(i)) = double(f[c]) * weight;
      }
  });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(a.transpose() * a);
  LAMBENT_CHECK(solver.info() == Eigen::Success);

  FactoredBrdf result;
  result.size = size, result.terms = terms;
  for (int r = cells - 1; r >= 0; --r) result.singular_values.push_back(std::sqrt(std::max(solver.eigenvalues()[r], 0.0)));
  const Eigen::MatrixXd v = solver.eigenvectors().rightCols(terms).rowwise().reverse(), av = a * v;
  for (int r = 0; r < terms; ++r) {
    for (int o = 0; o < cells; ++o)
      result.g.push_back(Vec3(glm::dvec3(av(3 * o, r), av(3 * o + 1, r), av(3 * o + 2, r)) * std::sqrt(double(cells))));
    for (int i = 0; i < cells; ++i) result.h.push_back(float(v(i, r) * std::sqrt(double(directions[size_t(i)].z) / cell)));
  }
  return result;
}

void evaluate_view_factors(const FactoredBrdf& factored, Vec3 wo, std::vector<Vec3>& out) {
  out.assign(size_t(factored.terms), Vec3(0));
  if (!(wo.z > 0)) return;
  const Tap t = tap(factored.size, wo);
  const size_t cells = size_t(factored.size) * size_t(factored.size);
  for (size_t r = 0; r < out.size(); ++r) out[r] = interpolate(factored.g.data() + r * cells, t);
}

float evaluate_light_factor(const FactoredBrdf& factored, int r, Vec3 wi) {
  LAMBENT_CHECK(r >= 0 && r < factored.terms);
  if (!(wi.z > 0)) return 0;
  const size_t cells = size_t(factored.size) * size_t(factored.size);
  return interpolate(factored.h.data() + size_t(r) * cells, tap(factored.size, wi));
}

std::vector<float> project_light_factor(const FactoredBrdf& factored, int r, int order) {
  LAMBENT_CHECK(r >= 0 && r < factored.terms && order >= 1 && order <= max_sh_order);
  // Within a cell h is taken as its value at the centre times the cosine over that at the centre: it holds the cosine, which is steep
  // where cells are wide.
  constexpr int fine = 4;
  const int n = factored.size;
  std::vector<double> sum(size_t(sh_count(order))), y(sum.size());
  for (int j = 0; j < n * fine; ++j)
    for (int i = 0; i < n * fine; ++i) {
      const int x = i / fine, cell = j / fine * n + x;
      evaluate_sh(order, glm::dvec3(grid_direction(n * fine, i, j)), std::span<double>(y));
      const double centre = double(grid_direction(n, x, j / fine).z), area = std::numbers::pi / (n * n * fine * fine);
      const double value = double(factored.h[size_t(r) * size_t(n * n) + size_t(cell)]) / centre * area;
      for (size_t k = 0; k < sum.size(); ++k) sum[k] += value * y[k];
    }
  return {sum.begin(), sum.end()};
}

}  // namespace lambent
