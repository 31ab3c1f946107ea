// Follows: radiosity, "Discussion" (lightmaps need a parametrisation of the scene). Charts grow from flat seeds, as in
// variational shape approximation (Cohen-Steiner, Alliez and Desbrun 2004) with one pass and a bound on the normal.
#include <lambent/receivers/charts.h>
#include <lambent/scene/clean.h>

#include <algorithm>
#include <numeric>
#include <queue>
#include <tuple>

namespace lambent {
namespace {

struct Edge {
  uint32_t a, b, triangle;  // a < b: numbers of positions
  uint8_t corner;
  bool reversed;
};

// Neighbour of each triangle across each of its edges, or none.
std::vector<std::array<uint32_t, 3>> triangle_neighbours(const Scene& scene, const std::vector<Vec3>& normals) {
  const std::vector<uint32_t> ids = number_positions(scene.positions).ids;
  std::vector<Edge> edges;
  edges.reserve(3 * scene.triangles.size());
  for (uint32_t i = 0; i < scene.triangles.size(); ++i) {
    if (normals[i] == Vec3(0)) continue;
    for (uint8_t k = 0; k < 3; ++k) {
      const uint32_t a = ids[scene.triangles[i].v[k]], b = ids[scene.triangles[i].v[(k + 1) % 3]];
      edges.push_back({std::min(a, b), std::max(a, b), i, k, a > b});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& x, const Edge& y) {
    return std::tie(x.a, x.b, x.triangle, x.corner) < std::tie(y.a, y.b, y.triangle, y.corner);
  });
  std::vector<std::array<uint32_t, 3>> neighbours(scene.triangles.size(), {none, none, none});
  for (size_t begin = 0, end; begin < edges.size(); begin = end) {
    for (end = begin; end < edges.size() && edges[end].a == edges[begin].a && edges[end].b == edges[begin].b;) ++end;
    if (end - begin != 2) continue;
    const Edge &x = edges[begin], &y = edges[begin + 1];
    if (x.reversed == y.reversed || x.triangle == y.triangle) continue;
    if (scene.triangles[x.triangle].two_sided != scene.triangles[y.triangle].two_sided) continue;
    neighbours[x.triangle][x.corner] = y.triangle, neighbours[y.triangle][y.corner] = x.triangle;
  }
  return neighbours;
}

std::vector<Vec3> face_normals(const Scene& scene, std::vector<float>* areas) {
  std::vector<Vec3> normals(scene.triangles.size(), Vec3(0));
  if (areas) areas->assign(scene.triangles.size(), 0.0f);
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    normals[i] = unit_normal(scene, scene.triangles[i]);
    if (areas && normals[i] != Vec3(0)) (*areas)[i] = area_length(area_normal(scene, scene.triangles[i]));
  }
  return normals;
}

// The first triangle of each chart in order of area, ties by number: its seed.
std::vector<uint32_t> by_area(const std::vector<float>& areas) {
  std::vector<uint32_t> order(areas.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(),
            [&](uint32_t a, uint32_t b) { return areas[a] != areas[b] ? areas[a] > areas[b] : a < b; });
  return order;
}

}  // namespace

Charts make_charts(const Scene& scene, const std::vector<uint8_t>& layers) {
  std::vector<float> areas;
  const std::vector<Vec3> normals = face_normals(scene, &areas);
  const auto neighbours = triangle_neighbours(scene, normals);
  Charts charts;
  charts.of_triangle.assign(scene.triangles.size(), none);
  auto layer = [&](uint32_t t) { return layers.empty() ? uint8_t(0) : layers[t]; };
  for (uint32_t seed : by_area(areas)) {
    if (charts.of_triangle[seed] != none || normals[seed] == Vec3(0)) continue;
    const uint32_t chart = charts.count++;
    // Nearest normals first, so that what is flat stays together; ties by number.
    using Candidate = std::pair<float, uint32_t>;
    auto later = [](const Candidate& x, const Candidate& y) {
      return x.first != y.first ? x.first < y.first : x.second > y.second;
    };
    std::priority_queue<Candidate, std::vector<Candidate>, decltype(later)> queue(later);
    queue.push({1.0f, seed});
    while (!queue.empty()) {
      const uint32_t t = queue.top().second;
      queue.pop();
      if (charts.of_triangle[t] != none) continue;
      charts.of_triangle[t] = chart;
      for (uint32_t next : neighbours[t]) {
        if (next == none || charts.of_triangle[next] != none || layer(next) != layer(seed)) continue;
        const float cosine = dot(normals[next], normals[seed]);
        if (cosine >= chart_cosine) queue.push({cosine, next});
      }
    }
  }
  return charts;
}

FlatCharts flatten(const Scene& scene, const Charts& charts) {
  std::vector<float> areas;
  const std::vector<Vec3> normals = face_normals(scene, &areas);
  FlatCharts flat;
  flat.corners.assign(scene.triangles.size(), {Vec2(0), Vec2(0), Vec2(0)});
  flat.size.assign(charts.count, Vec2(0));
  // Triangles grouped by chart, the seed first.
  std::vector<uint32_t> order = by_area(areas);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return charts.of_triangle[a] < charts.of_triangle[b]; });
  for (size_t begin = 0, end; begin < order.size() && charts.of_triangle[order[begin]] != none; begin = end) {
    const uint32_t chart = charts.of_triangle[order[begin]], seed = order[begin];
    for (end = begin; end < order.size() && charts.of_triangle[order[end]] == chart;) ++end;
    const Mat3 frame = frame_about(normals[seed]);
    const Vec3 origin = scene.positions[scene.triangles[seed].v[0]];
    auto project = [&](uint32_t v) {
      const Vec3 d = scene.positions[v] - origin;
      return Vec2(dot(d, frame[0]), dot(d, frame[1]));
    };
    // The least box among those along an edge of the seed, or along its plane's axes.
    Vec2 best_axis(1, 0), best_low(0), best_high(0);
    float best = INFINITY;
    for (int k = 0; k < 4; ++k) {
      Vec2 axis(1, 0);
      if (k < 3) {
        const Vec2 e = project(scene.triangles[seed].v[(k + 1) % 3]) - project(scene.triangles[seed].v[k]);
        if (!(dot(e, e) > 0)) continue;
        axis = normalize(e);
      }
      Vec2 low(INFINITY), high(-INFINITY);
      for (size_t i = begin; i < end; ++i)
        for (uint32_t v : scene.triangles[order[i]].v) {
          const Vec2 p = project(v), q(dot(p, axis), axis.x * p.y - axis.y * p.x);
          low = min(low, q), high = max(high, q);
        }
      const float area = (high.x - low.x) * (high.y - low.y);
      if (area < best) best = area, best_axis = axis, best_low = low, best_high = high;
    }
    const Vec2 extent = best_high - best_low;
    const bool turn = extent.y > extent.x;  // lay it down: (x, y) becomes (y, -x), which does not mirror
    flat.size[chart] = turn ? Vec2(extent.y, extent.x) : extent;
    for (size_t i = begin; i < end; ++i)
      for (size_t k = 0; k < 3; ++k) {
        const Vec2 p = project(scene.triangles[order[i]].v[k]);
        const Vec2 q = Vec2(dot(p, best_axis), best_axis.x * p.y - best_axis.y * p.x) - best_low;
        flat.corners[order[i]][k] = turn ? Vec2(q.y, extent.x - q.x) : q;
      }
  }
  return flat;
}

}  // namespace lambent
