#pragma once
// Projection of functions on the surface onto a spatial basis: numbers alpha with f ~ sum_i alpha_i B_i.
// Source: radiosity, "Different Projections", "Least Squares Projection", "A Linear System" (M alpha = f).
#include <lambent/receivers/receivers.h>

#include <functional>

namespace lambent {

enum class Projection {
  collocation,  // alpha_i = f at the receiver: fits any basis whose functions are 1 at their own receiver and 0 at the
                // others
  least_squares,  // least integral of (f - sum)^2 over the surface: mass matrix M_ij = integral of B_i B_j
};

// f(point, normal) on the side of the surface that the normal is on; the normal is the geometric one, or, for
// collocation, the receiver's. Least squares integrates by midpoints of triangles cut until their longest edge is at
// most `cell` units (and, for texels, half a texel in the atlas), and solves by conjugate gradients, so any function
// within the basis's span is reproduced whatever the cell. Receivers that no surface reaches get 0.
std::vector<double> project_on_surface(const Scene& scene, const Receivers& receivers, Projection projection,
                                       const std::function<double(Vec3 point, Vec3 normal)>& f, float cell);

// sum_i alpha_i B_i at weights (1-u-v, u, v) of a triangle's side; 0 where that side receives nothing.
double reconstruct_on_surface(const SpatialBasis& basis, const std::vector<double>& alpha, uint32_t triangle, float u,
                              float v, bool front);

}  // namespace lambent
