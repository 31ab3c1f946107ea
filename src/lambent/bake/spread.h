#pragma once
// Local regression over receivers on the same surface (thin.h).
#include <lambent/bake/thin.h>

#include <nanoflann.hpp>

namespace lambent {

// The places of some receivers.
struct PointCloud {
  std::span<const Vec3> points;
  std::span<const uint32_t> which;
  size_t kdtree_get_point_count() const { return which.size(); }
  float kdtree_get_pt(size_t i, size_t axis) const { return points[which[i]][int(axis)]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using PointTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, PointCloud>, PointCloud, 3, uint32_t>;

constexpr size_t fewest_neighbours = 5;  // of a plane

bool on_one_surface(const Receivers& r, size_t i, size_t j);

// Neighbours of receiver i among `which` on its surface, nearest first: indices into `which`. `skip`: not that one.
size_t find_neighbours(const PointTree& tree, const Receivers& r, std::span<const uint32_t> which, size_t i,
                       size_t skip, size_t most, uint32_t* out);

// Shares of neighbours in the value at a receiver: weighted least squares of 1, x, y over the tangent plane, the
// normal's two tilts, and, where there are enough, x^2, xy, y^2; its value at the receiver. Fewer of these where the
// receiver lies so far out that the shares would be large. `of`: receivers.
void regress(const Receivers& r, size_t i, const uint32_t* of, size_t count, float* share);

}  // namespace lambent
