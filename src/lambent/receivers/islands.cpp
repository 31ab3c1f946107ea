#include <lambent/receivers/islands.h>
#include <lambent/receivers/raster.h>
#include <lambent/scene/clean.h>

#include <algorithm>
#include <numeric>
#include <tuple>

namespace lambent {
namespace {

constexpr size_t most_alike = 32;    // edges of one place that an edge is held against: hostile files have millions
constexpr float just_short = 1e-3f;  // texels that a tent ends before the next but one begins

struct Edge {
  uint32_t a, b;  // numbers of positions, a < b
  Vec2 at_a, at_b;
  uint32_t triangle;
};

bool is_near(Vec2 p, Vec2 q, float most) { return std::max(std::abs(p.x - q.x), std::abs(p.y - q.y)) <= most; }

uint32_t root_of(std::vector<uint32_t>& parent, uint32_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

// Whether the open square of half side `half` meets the triangle: no axis of either's edges parts them.
bool meets_square(const std::array<Vec2, 3>& t, Vec2 centre, float half) {
  for (size_t k = 0; k < 5; ++k) {
    const Vec2 edge = t[(k + 1) % 3] - t[k % 3];
    const Vec2 axis = k == 3 ? Vec2(1, 0) : k == 4 ? Vec2(0, 1) : Vec2(-edge.y, edge.x);
    const float reach = half * (std::abs(axis.x) + std::abs(axis.y));
    float low = INFINITY, high = -INFINITY;
    for (Vec2 p : t) {
      const float along = dot(p - centre, axis);
      low = std::min(low, along), high = std::max(high, along);
    }
    if (low >= reach || high <= -reach) return false;
  }
  return true;
}

}  // namespace

std::vector<uint32_t> islands_of(const Scene& scene, const std::vector<Vec2>& at, float rounding) {
  const std::vector<uint32_t> ids = number_positions(scene.positions).ids;
  std::vector<uint32_t> parent(scene.triangles.size());
  std::iota(parent.begin(), parent.end(), 0u);
  std::vector<Edge> edges;
  for (uint32_t i = 0; i < scene.triangles.size(); ++i) {
    const Triangle& t = scene.triangles[i];
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t v = t.v[k], w = t.v[(k + 1) % 3];
      if (ids[v] < ids[w]) edges.push_back({ids[v], ids[w], at[v], at[w], i});
      else edges.push_back({ids[w], ids[v], at[w], at[v], i});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) {
    return std::tie(x.a, x.b, x.at_a.x, x.triangle) < std::tie(y.a, y.b, y.at_a.x, y.triangle);
  });
  for (size_t i = 0; i < edges.size(); ++i)
    for (size_t j = i + 1; j < std::min(edges.size(), i + most_alike); ++j) {
      const Edge &x = edges[i], &y = edges[j];
      if (std::tie(x.a, x.b) != std::tie(y.a, y.b) || y.at_a.x - x.at_a.x > rounding) break;
      if (is_near(x.at_a, y.at_a, rounding) && is_near(x.at_b, y.at_b, rounding))
        parent[root_of(parent, y.triangle)] = root_of(parent, x.triangle);
    }
  for (uint32_t i = 0; i < parent.size(); ++i) parent[i] = root_of(parent, i);
  for (uint32_t i = 0; i < parent.size(); ++i)
    if (const Vec3 n = area_normal(scene, scene.triangles[i]); !(dot(n, n) > 0)) parent[i] = none;
  return parent;
}

size_t count_shared_texels(const Scene& scene, const std::vector<uint32_t>& islands, const std::vector<Vec2>& front,
                           const std::vector<Vec2>& back, int width, int height) {
  // Island and side of the first that reaches a texel.
  std::vector<uint32_t> first(size_t(width) * size_t(height), none);
  std::vector<uint8_t> behind(back.empty() ? 0 : first.size(), 0), shared(first.size(), 0);
  size_t count = 0;
  for (uint32_t i = 0; i < scene.triangles.size(); ++i) {
    const Triangle& t = scene.triangles[i];
    if (islands[i] == none) continue;
    for (const std::vector<Vec2>* places : {&front, &back}) {
      const bool is_back = places == &back;
      if (is_back && (back.empty() || !t.two_sided)) continue;
      const std::array<Vec2, 3> corners{(*places)[t.v[0]], (*places)[t.v[1]], (*places)[t.v[2]]};
      each_texel(corners, 1, width, height, [&](int x, int y) {
        const size_t k = size_t(y) * size_t(width) + size_t(x);
        if (shared[k] || (first[k] == islands[i] && (behind.empty() || behind[k] == is_back))) return;
        if (!meets_square(corners, Vec2(float(x) + 0.5f, float(y) + 0.5f), 1 - just_short)) return;
        if (first[k] == none) {
          first[k] = islands[i];
          if (!behind.empty()) behind[k] = is_back;
        } else {
          shared[k] = 1, ++count;
        }
      });
    }
  }
  return count;
}

}  // namespace lambent
