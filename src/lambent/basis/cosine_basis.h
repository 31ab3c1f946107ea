#pragma once
// The incident basis {z_j} of transfer matrices (general-prt, "Basic idea"): functions on the hemisphere z >= 0 that
// span the spherical harmonics of some order there and are orthonormal under the cosine measure of reflection,
//   1/pi * integral over z >= 0 of z_i z_j cos = delta_ij,
// made by Gram and Schmidt in the harmonics' order, so z_0 = 1. A reflectance f(wi, wo) enters radiance as the integral
// of f L cos; with X_j = 1/pi * integral of z_j L cos and O_j = integral of f z_j cos it is sum_j O_j X_j, exactly so
// wherever f or L lies in the span. For Lambert's law O = (albedo, 0, 0, ...): diffuse transfer is the one-row case.
#include <lambent/basis/sh.h>

namespace lambent {

inline constexpr int max_incident_order = 8;  // beyond it the harmonics are too nearly dependent on the hemisphere

struct CosineBasis {
  int order = 0;
  std::vector<double> from_sh;  // W, order^2 x order^2, row-major, lower triangular: z_j = sum_k W_jk y_k
  std::vector<double> to_sh;    // its inverse
  int count() const { return sh_count(order); }
};
CosineBasis make_cosine_basis(int order);

// Values of z_j at a unit direction of the upper hemisphere.
void evaluate_cosine_basis(const CosineBasis& basis, Vec3 d, std::span<float> out);

// order^2 x order^2, row-major, from X_j = 1/pi * integral of z_j L cos to harmonics over the whole sphere: those l
// that minimise 1/pi * the integral of (sum l_k y_k - L)^2 cos above the horizon, plus `below` times that of (sum l_k
// y_k)^2 under it. With `below` = 0 they agree with L's projection above, and are far too large under it.
std::vector<double> extend_below(const CosineBasis& basis, double below);

}  // namespace lambent
