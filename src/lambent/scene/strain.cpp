#include <lambent/scene/strain.h>

#include <lambent/core/check.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace lambent {
namespace {

// Symmetric, of two directions.
struct Form {
  double xx = 0, xy = 0, yy = 0;
  double of(Vec2d t) const { return xx * t.x * t.x + 2 * xy * t.x * t.y + yy * t.y * t.y; }
};

struct Edges {
  Vec2d d1, d2;  // of texture coordinates
  double area;   // twice that of the triangle there, signed
};
std::optional<Edges> edges_of(const Scene& scene, const Triangle& t) {
  const std::vector<Vec2>& uv = scene.texcoords[0];
  const Vec2d d1(uv[t.v[1]] - uv[t.v[0]]), d2(uv[t.v[2]] - uv[t.v[0]]);
  const double area = d1.x * d2.y - d2.x * d1.y;
  if (!(std::abs(area) > 0) || !std::isfinite(area)) return {};
  return Edges{d1, d2, area};
}

// A triangle as it lies: what unit steps of u and v are.
struct Laid {
  Form metric;
  double area;  // of the unit square of texture coordinates
  // The inverse of the metric, by which gradients of texture coordinates are measured.
  Form inverse() const {
    const double square = area * area;
    return {metric.yy / square, -metric.xy / square, metric.xx / square};
  }
};
std::optional<Laid> laid(const std::vector<Vec3>& positions, const Triangle& t, const Edges& e) {
  const Vec3d p(positions[t.v[0]]), e1 = Vec3d(positions[t.v[1]]) - p, e2 = Vec3d(positions[t.v[2]]) - p;
  const Vec3d u = (e1 * e.d2.y - e2 * e.d1.y) / e.area, v = (e2 * e.d1.x - e1 * e.d2.x) / e.area;
  const Laid out{{dot(u, u), dot(u, v), dot(v, v)}, length(cross(u, v))};
  const Form i = out.inverse();
  if (!(out.area > 0) || !std::isfinite(i.xx + i.xy + i.yy)) return {};
  return out;
}

}  // namespace

double groove_length(double depth) {
  // A complete elliptic integral of the second kind, of a modulus that is imaginary.
  const double k = std::numbers::pi * depth;
  return 2 / std::numbers::pi * std::sqrt(1 + k * k) * std::comp_ellint_2(k / std::sqrt(1 + k * k));
}

std::vector<Vec2> pressed_directions(const Scene& scene, std::span<const std::vector<Vec3>> poses, float repetitions,
                                     Vec2 otherwise) {
  std::vector<Vec2> tile(scene.triangles.size(), otherwise);
  if (scene.texcoords[0].empty()) return tile;
  // By part: the strain of gradients, in a frame of the surface at rest that begins along u, and that frame.
  struct Mean {
    Form strain;
    double along = 0, skew = 0, up = 0;  // du and dv are (along, 0) and (skew, up) there
  };
  std::vector<Mean> parts(scene.parts.size());
  for (const Triangle& t : scene.triangles) {
    const auto edges = edges_of(scene, t);
    const auto rest = edges ? laid(scene.positions, t, *edges) : std::nullopt;
    if (!rest) continue;
    const double weight = rest->area * std::abs(edges->area), along = std::sqrt(rest->metric.xx),
                 skew = rest->metric.xy / along, up = rest->area / along;
    Mean& m = parts[t.part];
    m.along += weight * along, m.skew += weight * skew, m.up += weight * up;
    for (const std::vector<Vec3>& pose : poses)
      if (const auto now = laid(pose, t, *edges)) {
        const Form i = now->inverse();
        m.strain.xx += weight * (along * along * i.xx + 2 * along * skew * i.xy + skew * skew * i.yy - 1);
        m.strain.xy += weight * up * (along * i.xy + skew * i.yy);
        m.strain.yy += weight * (up * up * i.yy - 1);
      }
  }
  for (size_t k = 0; k < scene.triangles.size(); ++k) {
    const Mean& m = parts[scene.triangles[k].part];
    const Form& s = m.strain;
    // The direction in which gradients grow most, as what lies across them draws together.
    const double angle = 0.5 * std::atan2(2 * s.xy, s.xx - s.yy);
    const Vec2d n(std::cos(angle), std::sin(angle)), t(m.along * n.x, m.skew * n.x + m.up * n.y);
    const double size = std::hypot(t.x, t.y);
    if (s.of(n) > 0 && size > 0 && std::isfinite(size)) tile[k] = Vec2(t * (double(repetitions) / size));
  }
  return tile;
}

std::vector<float> pressed_depths(const Scene& scene, const std::vector<Vec3>& pose, std::span<const Vec2> tile,
                                  float width, float most) {
  LAMBENT_CHECK(pose.size() == scene.positions.size() && tile.size() == scene.triangles.size() && width > 0);
  std::vector<float> depths(pose.size(), 0.0f);
  if (scene.texcoords[0].empty()) return depths;
  std::vector<double> excess(pose.size(), 0.0), areas(pose.size(), 0.0);
  for (size_t k = 0; k < scene.triangles.size(); ++k) {
    const Triangle& t = scene.triangles[k];
    const auto edges = edges_of(scene, t);
    const auto rest = edges ? laid(scene.positions, t, *edges) : std::nullopt;
    const auto now = rest ? laid(pose, t, *edges) : std::nullopt;
    if (!now) continue;
    const double area = rest->area * std::abs(edges->area),
                 pressed = std::sqrt(now->inverse().of(Vec2d(tile[k])) / rest->inverse().of(Vec2d(tile[k]))) - 1;
    if (!std::isfinite(pressed)) continue;
    for (const uint32_t v : t.v) excess[v] += area * pressed, areas[v] += area;
  }
  // Lengths by squares of depths, between which lines are right for shallow grooves, too.
  constexpr size_t steps = 1024;
  const double last = double(most) * double(most);
  std::vector<double> lengths(steps + 1);
  for (size_t i = 0; i <= steps; ++i) lengths[i] = groove_length(std::sqrt(last * double(i) / steps));
  for (size_t v = 0; v < pose.size(); ++v) {
    if (!(areas[v] > 0 && excess[v] > 0)) continue;
    const double wanted = 1 + excess[v] / areas[v] / double(width);
    const size_t i =
        std::max<size_t>(1, size_t(std::upper_bound(lengths.begin(), lengths.end(), wanted) - lengths.begin()));
    // Rounding may have put it below the first.
    const double between = i > steps ? 0 : std::max(0.0, (wanted - lengths[i - 1]) / (lengths[i] - lengths[i - 1]));
    const double square = double(i - 1) + between;
    depths[v] = float(std::sqrt(last * square / steps));
  }
  return depths;
}

}  // namespace lambent
