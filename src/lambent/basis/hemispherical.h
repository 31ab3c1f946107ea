#pragma once
// Bases for functions on the upper hemisphere z >= 0, such as outgoing radiance in a tangent frame. Coefficients are
// indexed as in sh.h. Source: general-prt (choice of outgoing basis).
#include <lambent/basis/sh.h>

namespace lambent {

// Hemispherical harmonics: spherical harmonics with 2z - 1 in place of z, times sqrt 2; orthonormal on the hemisphere,
// and not closed under rotations except about z. Zero below. They shrink like sqrt z towards the horizon where m is not
// 0. Source: P. Gautron et al. 2004, "A novel hemispherical basis for accurate and efficient rendering".
void evaluate_hsh(int order, Vec3 d, std::span<float> out);
void evaluate_hsh(int order, Vec3d d, std::span<double> out);
// Coefficients of f by quadrature of exact_order nodes in z and twice as many about it; f is called above the horizon
// only.
std::vector<double> project_hsh(int order, const std::function<double(Vec3d)>& f, int exact_order = 64);
float reconstruct_hsh(std::span<const float> coefficients, Vec3 d);

// Spherical harmonics that need to fit on the hemisphere only, by least squares. Restricted to it they are neither
// orthonormal nor far from dependent: with the Gram matrix G_ij = integral of y_i y_j over the hemisphere, the best
// coefficients are G^+ b, b_i = integral of f y_i over it. Reconstruct with reconstruct_sh, above the horizon only:
// below, the values mean nothing. Source: general-prt, "least-squares optimal hemispherical SH" (Sloan 2003).
struct HemisphereFit {
  int order = 0;
  int rank = 0;                       // directions of G kept
  std::vector<double> gram, inverse;  // order^2 x order^2, row-major
};
// Eigenvalues of G at or below `cutoff` times the greatest are left out. A smaller cutoff fits closer, a greater one
// keeps the coefficients smaller: an error e of the integrals b can grow to e / cutoff.
HemisphereFit make_hemisphere_fit(int order, double cutoff = 1e-6);
// From the integrals b, which are also the coefficients of f extended by zero.
std::vector<double> fit_hemisphere(const HemisphereFit& fit, std::span<const double> integrals);
std::vector<double> project_hemisphere(const HemisphereFit& fit, const std::function<double(Vec3d)>& f,
                                       int exact_order = 64);
// The integrals b alone.
std::vector<double> project_sh_hemisphere(int order, const std::function<double(Vec3d)>& f, int exact_order = 64);

}  // namespace lambent
