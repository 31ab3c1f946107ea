#pragma once
// WHERE light is received. Vertices so far: the spatial basis of hats (piecewise linear). A receiver is one side of one
// welded vertex: vertices that share position and normal share it, so that UV seams and part borders cost nothing.
#include <lambent/scene/scene.h>

#include <array>
#include <vector>

namespace lambent {

struct Receivers {
  // Where rays start: the vertex moved off its surface by a hair, and, where its faces do not surround it (borders, creases),
  // a hair towards them, so that a wall's foot does not lie in the wall.
  std::vector<Vec3> origins;
  std::vector<Vec3> normals;  // unit, towards the side that the receiver is on
  // Receiver of each scene vertex, by side; `none` for vertices that no proper triangle uses, and on the back of one-sided
  // surfaces. `back` is empty where the whole scene is one-sided.
  std::vector<uint32_t> front, back;

  size_t count() const { return origins.size(); }
};

// Receivers lie along a space-filling curve, so that neighbours in memory are neighbours in space.
Receivers make_vertex_receivers(const Scene& scene);

// The receivers at the corners of every triangle, and its part, together, since both are wanted at every hit.
struct Corners {
  std::array<uint32_t, 3> receiver{none, none, none};
  uint32_t part = 0;
};
struct CornerReceivers {
  std::vector<Corners> front, back;  // by triangle; `back` is empty where the whole scene is one-sided
  // Corners as seen from a side, or null where that side receives nothing.
  const Corners* find(uint32_t triangle, bool front_side) const {
    const auto& side = front_side ? front : back;
    if (side.empty() || side[triangle].receiver[0] == none) return nullptr;
    return &side[triangle];
  }
  // Asks the caches for what find() will want.
  void prefetch(uint32_t triangle, bool front_side) const {
    const auto& side = front_side ? front : back;
    if (triangle < side.size()) __builtin_prefetch(&side[triangle]);
  }
};
CornerReceivers corner_receivers(const Scene& scene, const std::vector<uint32_t>& front, const std::vector<uint32_t>& back);

}  // namespace lambent
