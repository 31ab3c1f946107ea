#pragma once
// Tables of measured isotropic reflection over half and difference angles. Source: S. Rusinkiewicz, "A new change of
// variables for efficient BRDF representation", 1998; the spacing is that of W. Matusik et al., "A data-driven
// reflectance model", 2003 (MERL).
#include <lambent/brdf/brdf.h>

#include <string>
#include <vector>

namespace lambent {

// A pair of directions, turned about the normal so that h = (sin(theta_h), 0, cos(theta_h)).
struct HalfDifference {
  float theta_h;  // of h from the normal, [0, pi/2]
  float theta_d;  // of wi from h, [0, pi/2]
  float phi_d;  // of wi about h from the direction in which theta_h grows, [0, pi): wi and wo swapped are the same pair
};
HalfDifference half_difference(Vec3 wi, Vec3 wo);
struct DirectionPair {
  Vec3 wi, wo;  // may lie below the horizon
};
DirectionPair directions(const HalfDifference& angles);

struct MeasuredTable {
  std::string name;
  // Cells: theta_h in steps of its square root, theta_d and phi_d in even steps. At least one of each.
  int theta_h = 0, theta_d = 0, phi_d = 0;
  std::vector<Vec3> f;  // [theta_h][theta_d][phi_d], values at the cells' centres, finite, not negative
  // Density of half vectors per steradian, constant over each cell of theta_h, and its running integral from 0 to 1:
  // what `sample` uses, together with a cosine lobe.
  std::vector<float> lobe, cumulative;

  size_t index(int h, int d, int p) const {
    return (size_t(h) * size_t(theta_d) + size_t(d)) * size_t(phi_d) + size_t(p);
  }
};

// Angles at the centre of a cell.
HalfDifference cell_angles(const MeasuredTable& table, int h, int d, int p);

// The table's f is set: fills lobe and cumulative.
void prepare_sampling(MeasuredTable& table);

}  // namespace lambent
