#pragma once
// What throwing surfels and finding them share: points in cells, and whether one place stands for another.
#include <lambent/bake/surfels.h>
#include <lambent/core/random.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace lambent {

// Normals alike: cosine at least.
inline constexpr float alike_normals = 0.5f;

// Points in cells of a lattice of their own, found by hashes of the cells; grows.
class PointGrid {
 public:
  PointGrid(float cell, size_t expected) : cell_(double(cell)) {
    size_t size = 64;
    while (size < 2 * expected) size *= 2;
    heads_.assign(size, none);
  }
  void insert(Vec3 p) {
    const uint64_t key = key_of(place(p.x), place(p.y), place(p.z));
    uint32_t& head = heads_[key & (heads_.size() - 1)];
    next_.push_back(head), keys_.push_back(key), head = uint32_t(next_.size() - 1);
  }
  // Calls f with the points of all cells that come within `radius`.
  void near(Vec3 p, float radius, auto f) const {
    const double r = double(radius);
    const int64_t x1 = place(double(p.x) + r), y1 = place(double(p.y) + r), z1 = place(double(p.z) + r);
    for (int64_t z = place(double(p.z) - r); z <= z1; ++z)
      for (int64_t y = place(double(p.y) - r); y <= y1; ++y)
        for (int64_t x = place(double(p.x) - r); x <= x1; ++x) {
          const uint64_t key = key_of(x, y, z);
          for (uint32_t i = heads_[key & (heads_.size() - 1)]; i != none; i = next_[i])
            if (keys_[i] == key) f(i);
        }
  }

 private:
  int64_t place(double x) const { return int64_t(std::floor(std::clamp(x / cell_, -1e15, 1e15))); }
  static uint64_t key_of(int64_t x, int64_t y, int64_t z) {
    return hash64(hash64(uint64_t(x), uint64_t(y)), uint64_t(z));
  }
  double cell_;
  std::vector<uint32_t> heads_, next_;
  std::vector<uint64_t> keys_;
};

// How far two places are from standing for one another; infinite where the cosine of their normals is below `least`.
float distance_between(Vec3 p, Vec3 n, Vec3 q, Vec3 m, float least = alike_normals);

// How far above a place something else is; what is farther than `most` does not matter.
float headroom_above(const Tracer& tracer, Vec3 p, Vec3 n, float smallest, float most);

// A surfel in a gap that is narrower than surfels are apart does not stand for a place outside, which is seen and lit
// otherwise.
inline bool is_outside(float place, float surfel, float gap) { return surfel < gap && place > 3 * surfel; }

// Whether a straight way leads from one to the other just above the surface, or `over_edge`, above an edge between
// them; both know their headroom.
bool is_open(const Tracer& tracer, const SurfacePlace& a, const SurfacePlace& b, float smallest,
             bool over_edge = false);

// What stands for a place, nearest first.
struct NearSurfel {
  float distance;
  uint32_t index;
  bool operator<(const NearSurfel& o) const { return distance != o.distance ? distance < o.distance : index < o.index; }
};

}  // namespace lambent
