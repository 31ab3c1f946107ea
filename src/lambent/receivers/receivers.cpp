#include <lambent/receivers/receivers.h>
#include <lambent/scene/clean.h>

#include <algorithm>
#include <numeric>
#include <tuple>

namespace lambent {
namespace {

// Vertices at one place whose normals agree to this cosine (0.8 degrees) are one receiver.
constexpr float same_normal = 0.9999f;

// A receiver starts this far above its surface, and this far inside its faces' border, as fractions of its shortest
// edge; neither exceeds a fraction of the scene.
constexpr float lift = 1e-3f, lift_limit = 1e-4f;
constexpr float inset = 1e-2f, inset_limit = 1e-3f;
// What rounding of coordinates needs, as a fraction of their magnitude.
constexpr float rounding = 4e-7f;

struct VertexGeometry {
  Vec3 face_normal{0};  // sum of area normals
  // Sum over faces of the integral of unit directions over the corner's wedge, 2 sin(angle/2) times its bisector. It
  // vanishes in the tangent plane where the faces surround the vertex, and points into them where they do not.
  Vec3 inward{0};
  float edge = INFINITY;  // shortest
  bool used = false, two_sided = false;
};

struct Side {
  uint32_t vertex;
  bool back;
  Vec3 normal;
};

uint64_t spread_bits(uint64_t x) {  // 21 bits, two zeros between each
  x &= 0x1fffff;
  x = (x | x << 32) & 0x1f00000000ffffull;
  x = (x | x << 16) & 0x1f0000ff0000ffull;
  x = (x | x << 8) & 0x100f00f00f00f00full;
  x = (x | x << 4) & 0x10c30c30c30c30c3ull;
  return (x | x << 2) & 0x1249249249249249ull;
}

uint64_t morton(Vec3 p, const Bounds& box) {
  Vec3 size = max(box.max - box.min, Vec3(1e-30f));
  float largest = std::max({size.x, size.y, size.z});
  Vec3 q = clamp((p - box.min) / largest, 0.0f, 1.0f) * 2097151.0f;
  return spread_bits(uint64_t(q.x)) | spread_bits(uint64_t(q.y)) << 1 | spread_bits(uint64_t(q.z)) << 2;
}

std::vector<VertexGeometry> vertex_geometry(const Scene& scene) {
  std::vector<VertexGeometry> geometry(scene.positions.size());
  for (const Triangle& t : scene.triangles) {
    const Vec3 normal = area_normal(scene, t);
    if (!(area_length(normal) > 0)) continue;  // degenerate: no ray meets it, no light falls on it
    for (int k = 0; k < 3; ++k) {
      const Vec3 p = scene.positions[t.v[k]];
      const Vec3 e1 = scene.positions[t.v[(k + 1) % 3]] - p, e2 = scene.positions[t.v[(k + 2) % 3]] - p;
      const float l1 = length(e1), l2 = length(e2);
      VertexGeometry& g = geometry[t.v[k]];
      g.used = true, g.two_sided |= t.two_sided;
      g.face_normal += normal;
      if (!(l1 > 0 && l2 > 0)) continue;
      g.edge = std::min({g.edge, l1, l2});
      // The bisector of unit vectors a, b is (a + b) / 2 cos(half); times 2 sin(half) that is (a + b) tan(half).
      const float cosine = std::clamp(dot(e1, e2) / (l1 * l2), -1.0f, 1.0f);
      const float tan_half = std::sqrt((1 - cosine) / std::max(1 + cosine, 1e-6f));
      g.inward += (e1 / l1 + e2 / l2) * tan_half;
    }
  }
  return geometry;
}

// What sides become that share their place and nearly their normal.
struct Welded {
  Vec3 position, normal, inward;
  float edge;
};
struct Welding {
  std::vector<Welded> receivers;
  std::vector<uint32_t> of_side;
};
Welding weld(const Scene& scene, const std::vector<VertexGeometry>& geometry, const std::vector<Side>& sides) {
  auto place = [&](const Side& s) {
    const Vec3 p = scene.positions[s.vertex] + 0.0f;  // -0 becomes 0
    return std::tuple(p.x, p.y, p.z);
  };
  std::vector<uint32_t> by_place(sides.size());
  std::iota(by_place.begin(), by_place.end(), 0u);
  std::sort(by_place.begin(), by_place.end(), [&](uint32_t a, uint32_t b) {
    auto pa = place(sides[a]), pb = place(sides[b]);
    return pa != pb ? pa < pb : a < b;
  });

  Welding out;
  std::vector<Welded>& welded = out.receivers;
  out.of_side.resize(sides.size());
  for (size_t begin = 0; begin < by_place.size();) {
    size_t end = begin;
    while (end < by_place.size() && place(sides[by_place[end]]) == place(sides[by_place[begin]])) ++end;
    const size_t first = welded.size();
    for (size_t i = begin; i < end; ++i) {
      const Side& s = sides[by_place[i]];
      const VertexGeometry& g = geometry[s.vertex];
      size_t w = first;
      while (w < welded.size() && dot(welded[w].normal, s.normal) < same_normal) ++w;
      if (w == welded.size()) welded.push_back({scene.positions[s.vertex], s.normal, Vec3(0), INFINITY});
      welded[w].inward += g.inward, welded[w].edge = std::min(welded[w].edge, g.edge);
      out.of_side[by_place[i]] = uint32_t(w);
    }
    begin = end;
  }
  return out;
}

}  // namespace

std::vector<uint32_t> curve_order(const std::vector<Vec3>& points, const Bounds& box) {
  std::vector<uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0u);
  std::vector<uint64_t> codes(points.size());
  for (size_t i = 0; i < points.size(); ++i) codes[i] = morton(points[i], box);
  std::sort(order.begin(), order.end(),
            [&](uint32_t a, uint32_t b) { return codes[a] != codes[b] ? codes[a] < codes[b] : a < b; });
  return order;
}

float receiver_lift(Vec3 p, float size, float diagonal) {
  const Vec3 magnitude = abs(p);
  const float smallest = rounding * (std::max({magnitude.x, magnitude.y, magnitude.z}) + diagonal);
  return std::max(std::min(lift * size, lift_limit * diagonal), smallest);
}

Receivers make_vertex_receivers(const Scene& scene) {
  const size_t vertices = scene.positions.size();
  const std::vector<VertexGeometry> geometry = vertex_geometry(scene);
  std::vector<Side> sides;
  sides.reserve(vertices);
  bool any_back = false;
  for (uint32_t v = 0; v < vertices; ++v) {
    const VertexGeometry& g = geometry[v];
    if (!g.used) continue;
    Vec3 n = scene.normals[v];
    if (dot(n, g.face_normal) < 0) n = -n;
    sides.push_back({v, false, n});
    if (g.two_sided) sides.push_back({v, true, -n}), any_back = true;
  }
  const Welding welding = weld(scene, geometry, sides);
  const std::vector<Welded>& welded = welding.receivers;
  const Bounds box = bounds(scene);
  std::vector<Vec3> places(welded.size());
  for (size_t i = 0; i < welded.size(); ++i) places[i] = welded[i].position;
  const std::vector<uint32_t> order = curve_order(places, box);

  Receivers r;
  r.origins.resize(welded.size()), r.normals.resize(welded.size());
  std::vector<uint32_t> rank(welded.size());
  const float diagonal = box.diagonal();
  for (size_t i = 0; i < order.size(); ++i) {
    const Welded& w = welded[order[i]];
    rank[order[i]] = uint32_t(i);
    const float edge = std::isfinite(w.edge) ? w.edge : 0.0f;
    const Vec3 inward = w.inward - w.normal * dot(w.inward, w.normal);
    // A border's sum is at most 2 long (a half-plane); a full ring's is about 0, and the inset fades with it.
    r.origins[i] = w.position + w.normal * receiver_lift(w.position, edge, diagonal) +
                   inward * (0.5f * std::min(inset * edge, inset_limit * diagonal));
    r.normals[i] = w.normal;
  }
  r.front.assign(vertices, none);
  if (any_back) r.back.assign(vertices, none);
  for (size_t i = 0; i < sides.size(); ++i)
    (sides[i].back ? r.back : r.front)[sides[i].vertex] = rank[welding.of_side[i]];
  r.basis = corner_receivers(scene, r.front, r.back);
  return r;
}

CornerReceivers corner_receivers(const Scene& scene, const std::vector<uint32_t>& front,
                                 const std::vector<uint32_t>& back) {
  CornerReceivers corners;
  corners.front.resize(scene.triangles.size());
  if (!back.empty()) corners.back.resize(scene.triangles.size());
  auto fill = [](const Triangle& t, const std::vector<uint32_t>& map, Corners& out) {
    out = {{map[t.v[0]], map[t.v[1]], map[t.v[2]]}, t.part};
    if (out.receiver[0] == none || out.receiver[1] == none || out.receiver[2] == none)
      out.receiver = {none, none, none};
  };
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    const Triangle& t = scene.triangles[i];
    fill(t, front, corners.front[i]);
    if (!back.empty() && t.two_sided) fill(t, back, corners.back[i]);
  }
  return corners;
}

Receivers make_patch_receivers(const Scene& scene) {
  struct Side {
    uint32_t triangle;
    bool back;
  };
  std::vector<Side> sides;
  std::vector<Vec3> centres;
  bool any_back = false;
  for (uint32_t i = 0; i < scene.triangles.size(); ++i) {
    const Triangle& t = scene.triangles[i];
    const Vec3 n = area_normal(scene, t);
    if (!(area_length(n) > 0)) continue;
    const Vec3 centre = (scene.positions[t.v[0]] + scene.positions[t.v[1]] + scene.positions[t.v[2]]) / 3.0f;
    for (int back = 0; back <= int(t.two_sided); ++back) sides.push_back({i, back == 1}), centres.push_back(centre);
    any_back |= t.two_sided;
  }
  const Bounds box = bounds(scene);
  const float diagonal = box.diagonal();
  PatchReceivers patches;
  patches.front.resize(scene.triangles.size());
  if (any_back) patches.back.resize(scene.triangles.size());
  Receivers r;
  for (uint32_t i : curve_order(centres, box)) {
    const Triangle& t = scene.triangles[sides[i].triangle];
    Vec3 n = area_normal(scene, t);
    n = n * (1 / area_length(n)) * (sides[i].back ? -1.0f : 1.0f);
    float edge = INFINITY;
    for (int k = 0; k < 3; ++k)
      edge = std::min(edge, length(scene.positions[t.v[k]] - scene.positions[t.v[(k + 1) % 3]]));
    (sides[i].back ? patches.back : patches.front)[sides[i].triangle] = {uint32_t(r.count()), t.part};
    r.origins.push_back(centres[i] + n * receiver_lift(centres[i], edge, diagonal));
    r.normals.push_back(n);
  }
  r.basis = std::move(patches);
  return r;
}

namespace {

using Pairs = std::vector<std::pair<uint32_t, uint32_t>>;

void add_neighbours(const Scene&, const CornerReceivers& corners, const std::vector<uint8_t>& marked, Pairs& pairs) {
  for (const auto* side : {&corners.front, &corners.back})
    for (const Corners& c : *side) {
      if (c.receiver[0] == none) continue;
      for (int k = 0; k < 3; ++k)
        for (int j = 1; j < 3; ++j) {
          const uint32_t r = c.receiver[size_t(k)], other = c.receiver[size_t(k + j) % 3];
          if (marked[r] && r != other) pairs.push_back({r, other});
        }
    }
}

void add_neighbours(const Scene&, const TexelReceivers& t, const std::vector<uint8_t>& marked, Pairs& pairs) {
  const int step[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
  for (int y = 0; y < t.height; ++y)
    for (int x = 0; x < t.width; ++x) {
      const uint32_t r = t.texels[size_t(y) * size_t(t.width) + size_t(x)];
      if (r == none || !marked[r]) continue;
      for (auto [dx, dy] : step) {
        if (x + dx < 0 || y + dy < 0 || x + dx >= t.width || y + dy >= t.height) continue;
        const uint32_t other = t.texels[size_t(y + dy) * size_t(t.width) + size_t(x + dx)];
        if (other != none) pairs.push_back({r, other});
      }
    }
}

// Patches along an edge are paired in a row, so that a thousand sheets on one edge do not make a million pairs.
void add_neighbours(const Scene& scene, const PatchReceivers& patches, const std::vector<uint8_t>& marked,
                    Pairs& pairs) {
  const std::vector<uint32_t> ids = number_positions(scene.positions).ids;
  for (const auto* side : {&patches.front, &patches.back}) {
    std::vector<std::tuple<uint32_t, uint32_t, uint32_t>> edges;
    for (size_t i = 0; i < side->size(); ++i) {
      if ((*side)[i].receiver == none) continue;
      for (int k = 0; k < 3; ++k) {
        const uint32_t a = ids[scene.triangles[i].v[k]], b = ids[scene.triangles[i].v[(k + 1) % 3]];
        edges.push_back({std::min(a, b), std::max(a, b), (*side)[i].receiver});
      }
    }
    std::sort(edges.begin(), edges.end());
    for (size_t i = 1; i < edges.size(); ++i) {
      const auto [a, b, r] = edges[i - 1];
      const auto [c, d, other] = edges[i];
      if (a != c || b != d || r == other) continue;
      if (marked[r]) pairs.push_back({r, other});
      if (marked[other]) pairs.push_back({other, r});
    }
  }
}

void add_neighbours(const Scene&, const PointReceivers& p, const std::vector<uint8_t>& marked, Pairs& pairs) {
  for (size_t v = 0; v + 1 < p.first.size(); ++v)
    for (size_t a = p.first[v]; a < p.first[v + 1]; ++a)
      for (size_t b = p.first[v]; b < p.first[v + 1]; ++b)
        if (a != b && marked[p.points[a]]) pairs.push_back({p.points[a], p.points[b]});
}

}  // namespace

std::vector<std::pair<uint32_t, uint32_t>> neighbours_of(const Scene& scene, const SpatialBasis& basis,
                                                         const std::vector<uint8_t>& marked) {
  Pairs pairs;
  std::visit([&](const auto& b) { add_neighbours(scene, b, marked, pairs); }, basis);
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

}  // namespace lambent
