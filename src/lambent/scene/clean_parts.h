#pragma once
// What the sources behind clean.h share.
#include <lambent/scene/scene.h>

#include <numeric>

namespace lambent {

// Corner k of triangle t is number 3 t + k; its edge runs from it to the next corner of the triangle.
inline uint32_t next_corner(uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }
inline uint32_t previous_corner(uint32_t corner) { return corner % 3 == 0 ? corner + 2 : corner - 1; }

// Disjoint sets whose representative is the smallest member.
struct UnionFind {
  std::vector<uint32_t> parent;
  explicit UnionFind(size_t count) : parent(count) { std::iota(parent.begin(), parent.end(), 0u); }
  uint32_t find(uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  }
  void join(uint32_t a, uint32_t b) {
    a = find(a), b = find(b);
    parent[std::max(a, b)] = std::min(a, b);
  }
};

inline Vec3d wide_area_normal(const Scene& s, const Triangle& t) {
  Vec3d a = s.positions[t.v[0]];
  return cross(Vec3d(s.positions[t.v[1]]) - a, Vec3d(s.positions[t.v[2]]) - a);
}

// Marks a part changed whose vertices still are those of its document, if they were so far.
void mark_changed(Part& part);

}  // namespace lambent
