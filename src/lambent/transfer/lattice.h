#pragma once
// Light in free space ("neighbourhood transfer"): at the points of a lattice a transfer matrix that takes the light's
// coefficients to those of the light that arrives there, over the whole sphere and in world axes, for objects that the
// bake did not know. A lattice point is a receiver of the transfer; its rows are incident harmonics. Source:
// general-prt ("Secondary goal").
#include <lambent/core/vec.h>
#include <lambent/transfer/transfer.h>

#include <array>

namespace lambent {

inline constexpr int max_lattice_points = 64;  // an axis

// Points evenly spaced from face to face of a box; an axis with one point has it in the middle.
struct Lattice {
  Vec3 min{0.0f}, max{0.0f};
  int nx = 1, ny = 1, nz = 1;

  size_t count() const { return size_t(nx) * size_t(ny) * size_t(nz); }
  size_t index(int x, int y, int z) const { return (size_t(z) * size_t(ny) + size_t(y)) * size_t(nx) + size_t(x); }
  std::array<int, 3> place(size_t index) const {
    return {int(index % size_t(nx)), int(index / size_t(nx) % size_t(ny)), int(index / (size_t(nx) * size_t(ny)))};
  }
  Vec3 position(size_t index) const {
    const std::array<int, 3> at = place(index), n{nx, ny, nz};
    Vec3 t;
    for (int k = 0; k < 3; ++k) t[k] = n[size_t(k)] > 1 ? float(at[size_t(k)]) / float(n[size_t(k)] - 1) : 0.5f;
    return min + t * (max - min);
  }
};

// A lattice with its transfer.
struct LatticeTransfer {
  Lattice lattice;
  int order = 0;      // m: the transfer has m^2 rows, incident radiance = sum over rows j of (T light)_j y_j(w)
  Transfer transfer;  // receivers: points, in the order of Lattice::index
  std::vector<uint8_t> valid;  // by point; 0: it lies inside something and has its neighbours' values
};

}  // namespace lambent
