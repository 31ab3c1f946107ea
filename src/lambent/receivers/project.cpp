// Follows: radiosity, "Turns Out To Be Simple", "Easy Special Case: Box Functions" (there M is the areas, and alpha
// area means).
#include <lambent/receivers/project.h>

#include <cmath>

namespace lambent {
namespace {

constexpr int most_steps = 500;
constexpr double enough = 1e-10;
// Pieces of one triangle, a side.
constexpr int most_cuts = 256;

struct Point {
  std::array<uint32_t, 4> receiver;
  std::array<float, 4> weight;
  int count = 0;
  double area = 0, f = 0;
};

float longest_edge(const Scene& s, const Triangle& t) {
  float longest = 0;
  for (int k = 0; k < 3; ++k) longest = std::max(longest, length(s.positions[t.v[k]] - s.positions[t.v[(k + 1) % 3]]));
  return longest;
}

// Into how many parts each edge of a triangle is cut.
template <class At>
int cuts_of(const At&, float longest, float cell) {
  return std::clamp(int(std::ceil(longest / cell)), 1, most_cuts);
}
int cuts_of(const TexelTriangle& at, float longest, float cell) {
  float texels = 0;
  for (int k = 0; k < 3; ++k) texels = std::max(texels, length(at.at[k] - at.at[(k + 1) % 3]));
  return std::clamp(int(std::ceil(std::max(longest / cell, 2 * texels))), 1, most_cuts);
}

template <class Basis>
std::vector<Point> quadrature(const Scene& scene, const Basis& basis, const std::function<double(Vec3, Vec3)>& f,
                              float cell) {
  std::vector<Point> points;
  for (uint32_t i = 0; i < scene.triangles.size(); ++i)
    for (const bool front : {true, false}) {
      const auto* at = basis.find(i, front);
      if (!at) continue;
      const Triangle& t = scene.triangles[i];
      const Vec3 n = area_normal(scene, t);
      const double area = 0.5 * double(area_length(n));
      if (!(area > 0)) continue;
      const Vec3 side = n * (1 / area_length(n)) * (front ? 1.0f : -1.0f);
      const int cuts = cuts_of(*at, longest_edge(scene, t), cell);
      auto add = [&](float u, float v) {
        Point p;
        p.area = area / (double(cuts) * cuts);
        basis.spread(*at, u, v, [&](uint32_t r, float w) {
          p.receiver[size_t(p.count)] = r, p.weight[size_t(p.count)] = w, ++p.count;
        });
        p.f = f(interpolate(scene.positions, t, u, v), side);
        points.push_back(p);
      };
      const float h = 1.0f / float(cuts);
      for (int a = 0; a < cuts; ++a)
        for (int b = 0; a + b < cuts; ++b) {
          add((float(a) + 1.0f / 3) * h, (float(b) + 1.0f / 3) * h);
          if (a + b + 1 < cuts) add((float(a) + 2.0f / 3) * h, (float(b) + 2.0f / 3) * h);
        }
    }
  return points;
}

}  // namespace

std::vector<double> project_on_surface(const Scene& scene, const Receivers& receivers, Projection projection,
                                       const std::function<double(Vec3, Vec3)>& f, float cell) {
  const size_t n = receivers.count();
  std::vector<double> alpha(n, 0.0);
  if (projection == Projection::collocation) {
    for (size_t i = 0; i < n; ++i) alpha[i] = f(receivers.origins[i], receivers.normals[i]);
    return alpha;
  }
  const std::vector<Point> points =
      std::visit([&](const auto& basis) { return quadrature(scene, basis, f, cell); }, receivers.basis);
  std::vector<double> diagonal(n, 0.0), r(n, 0.0), p(n, 0.0), z(n, 0.0), Mp(n, 0.0);
  for (const Point& q : points)
    for (int k = 0; k < q.count; ++k) {
      const double w = double(q.weight[size_t(k)]);
      diagonal[q.receiver[size_t(k)]] += q.area * w * w, r[q.receiver[size_t(k)]] += q.area * w * q.f;
    }
  auto dot = [n](const std::vector<double>& a, const std::vector<double>& b) {
    double sum = 0;
    for (size_t i = 0; i < n; ++i) sum += a[i] * b[i];
    return sum;
  };
  auto precondition = [&] {
    for (size_t i = 0; i < n; ++i) z[i] = diagonal[i] > 0 ? r[i] / diagonal[i] : 0.0;
  };
  precondition();
  p = z;
  double rz = dot(r, z);
  const double first = rz;
  for (int step = 0; step < most_steps && rz > enough * enough * first; ++step) {
    std::fill(Mp.begin(), Mp.end(), 0.0);
    for (const Point& q : points) {
      double value = 0;
      for (int k = 0; k < q.count; ++k) value += double(q.weight[size_t(k)]) * p[q.receiver[size_t(k)]];
      for (int k = 0; k < q.count; ++k) Mp[q.receiver[size_t(k)]] += q.area * double(q.weight[size_t(k)]) * value;
    }
    const double pMp = dot(p, Mp);
    if (!(pMp > 0)) break;
    for (size_t i = 0; i < n; ++i) alpha[i] += rz / pMp * p[i], r[i] -= rz / pMp * Mp[i];
    precondition();
    const double next = dot(r, z);
    for (size_t i = 0; i < n; ++i) p[i] = z[i] + next / rz * p[i];
    rz = next;
  }
  return alpha;
}

double reconstruct_on_surface(const SpatialBasis& basis, const std::vector<double>& alpha, uint32_t triangle, float u,
                              float v, bool front) {
  double sum = 0;
  std::visit(
      [&](const auto& b) {
        if (const auto* at = b.find(triangle, front))
          b.spread(*at, u, v, [&](uint32_t r, float w) { sum += double(w) * alpha[r]; });
      },
      basis);
  return sum;
}

}  // namespace lambent
