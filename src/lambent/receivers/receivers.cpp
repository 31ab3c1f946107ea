#include <lambent/receivers/receivers.h>

#include <algorithm>
#include <numeric>
#include <tuple>

namespace lambent {
namespace {

// Vertices at one place whose normals agree to this cosine (0.8 degrees) are one receiver.
constexpr float same_normal = 0.9999f;

// A receiver starts this far above its surface, and this far inside its faces' border, as fractions of its shortest edge;
// neither exceeds a fraction of the scene.
constexpr float lift = 1e-3f, lift_limit = 1e-4f;
constexpr float inset = 1e-2f, inset_limit = 1e-3f;
// What rounding of coordinates needs, as a fraction of their magnitude.
constexpr float rounding = 4e-7f;

struct VertexGeometry {
  Vec3 face_normal{0};  // sum of area normals
  // Sum over faces of the integral of unit directions over the corner's wedge, 2 sin(angle/2) times its bisector. It vanishes
  // in the tangent plane where the faces surround the vertex, and points into them where they do not.
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
  Vec3 size = glm::max(box.max - box.min, Vec3(1e-30f));
  float largest = std::max({size.x, size.y, size.z});
  Vec3 q = glm::clamp((p - box.min) / largest, 0.0f, 1.0f) * 2097151.0f;
  return spread_bits(uint64_t(q.x)) | spread_bits(uint64_t(q.y)) << 1 | spread_bits(uint64_t(q.z)) << 2;
}

}  // namespace

Receivers make_vertex_receivers(const Scene& scene) {
  const size_t vertices = scene.positions.size();
  std::vector<VertexGeometry> geometry(vertices);
  for (const Triangle& t : scene.triangles) {
    const Vec3 normal = area_normal(scene, t);
    if (!(glm::dot(normal, normal) > 0)) continue;  // degenerate: no ray meets it, no light falls on it
    for (int k = 0; k < 3; ++k) {
      const Vec3 p = scene.positions[t.v[k]];
      const Vec3 e1 = scene.positions[t.v[(k + 1) % 3]] - p, e2 = scene.positions[t.v[(k + 2) % 3]] - p;
      const float l1 = glm::length(e1), l2 = glm::length(e2);
      VertexGeometry& g = geometry[t.v[k]];
      g.used = true, g.two_sided |= t.two_sided;
      g.face_normal += normal;
      if (!(l1 > 0 && l2 > 0)) continue;
      g.edge = std::min({g.edge, l1, l2});
      // The bisector of unit vectors a, b is (a + b) / 2 cos(half); times 2 sin(half) that is (a + b) tan(half).
      const float cosine = std::clamp(glm::dot(e1, e2) / (l1 * l2), -1.0f, 1.0f);
      const float tan_half = std::sqrt((1 - cosine) / std::max(1 + cosine, 1e-6f));
      g.inward += (e1 / l1 + e2 / l2) * tan_half;
    }
  }

  std::vector<Side> sides;
  sides.reserve(vertices);
  bool any_back = false;
  for (uint32_t v = 0; v < vertices; ++v) {
    const VertexGeometry& g = geometry[v];
    if (!g.used) continue;
    Vec3 n = scene.normals[v];
    if (glm::dot(n, g.face_normal) < 0) n = -n;
    sides.push_back({v, false, n});
    if (g.two_sided) sides.push_back({v, true, -n}), any_back = true;
  }
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

  // Weld within each place.
  struct Welded {
    Vec3 position, normal, inward;
    float edge;
  };
  std::vector<Welded> welded;
  std::vector<uint32_t> receiver_of_side(sides.size());
  for (size_t begin = 0; begin < by_place.size();) {
    size_t end = begin;
    while (end < by_place.size() && place(sides[by_place[end]]) == place(sides[by_place[begin]])) ++end;
    const size_t first = welded.size();
    for (size_t i = begin; i < end; ++i) {
      const Side& s = sides[by_place[i]];
      const VertexGeometry& g = geometry[s.vertex];
      size_t w = first;
      while (w < welded.size() && glm::dot(welded[w].normal, s.normal) < same_normal) ++w;
      if (w == welded.size()) welded.push_back({scene.positions[s.vertex], s.normal, Vec3(0), INFINITY});
      welded[w].inward += g.inward, welded[w].edge = std::min(welded[w].edge, g.edge);
      receiver_of_side[by_place[i]] = uint32_t(w);
    }
    begin = end;
  }

  const Bounds box = bounds(scene);
  std::vector<uint32_t> order(welded.size());
  std::iota(order.begin(), order.end(), 0u);
  std::vector<uint64_t> codes(welded.size());
  for (size_t i = 0; i < welded.size(); ++i) codes[i] = morton(welded[i].position, box);
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return codes[a] != codes[b] ? codes[a] < codes[b] : a < b; });

  Receivers r;
  r.origins.resize(welded.size()), r.normals.resize(welded.size());
  std::vector<uint32_t> rank(welded.size());
  const float diagonal = box.diagonal();
  for (size_t i = 0; i < order.size(); ++i) {
    const Welded& w = welded[order[i]];
    rank[order[i]] = uint32_t(i);
    const Vec3 magnitude = glm::abs(w.position);
    const float smallest = rounding * (std::max({magnitude.x, magnitude.y, magnitude.z}) + diagonal);
    const float edge = std::isfinite(w.edge) ? w.edge : 0.0f;
    const Vec3 inward = w.inward - w.normal * glm::dot(w.inward, w.normal);
    // A border's sum is at most 2 long (a half-plane); a full ring's is about 0, and the inset fades with it.
    r.origins[i] = w.position + w.normal * std::max(std::min(lift * edge, lift_limit * diagonal), smallest) +
                   inward * (0.5f * std::min(inset * edge, inset_limit * diagonal));
    r.normals[i] = w.normal;
  }
  r.front.assign(vertices, none);
  if (any_back) r.back.assign(vertices, none);
  for (size_t i = 0; i < sides.size(); ++i) (sides[i].back ? r.back : r.front)[sides[i].vertex] = rank[receiver_of_side[i]];
  return r;
}

CornerReceivers corner_receivers(const Scene& scene, const std::vector<uint32_t>& front, const std::vector<uint32_t>& back) {
  CornerReceivers corners;
  corners.front.resize(scene.triangles.size());
  if (!back.empty()) corners.back.resize(scene.triangles.size());
  auto fill = [](const Triangle& t, const std::vector<uint32_t>& map, Corners& out) {
    out = {{map[t.v[0]], map[t.v[1]], map[t.v[2]]}, t.part};
    if (out.receiver[0] == none || out.receiver[1] == none || out.receiver[2] == none) out.receiver = {none, none, none};
  };
  for (size_t i = 0; i < scene.triangles.size(); ++i) {
    const Triangle& t = scene.triangles[i];
    fill(t, front, corners.front[i]);
    if (!back.empty() && t.two_sided) fill(t, back, corners.back[i]);
  }
  return corners;
}

}  // namespace lambent
