#pragma once
// Separable BRDFs: f(wi, wo) cos(theta_i) = sum_r g_r(wo) h_r(wi), the best of each number of terms. Sources: J. Kautz and M. McCool,
// "Interactive rendering with arbitrary BRDFs using separable approximations", 1999; Z. Wang, J. Ng, D. Lischinski and P. Hanrahan 2004 and
// X. Liu, P.-P. Sloan, H.-Y. Shum and J. Snyder 2004 for its use in light transport; general-prt, "Choice of BRDF & Outgoing Basis".
#include <lambent/brdf/brdf.h>

#include <vector>

namespace lambent {

// Both grids: n x n cells of the square that square_to_cosine_hemisphere() maps onto the hemisphere, row by row in the square's second
// coordinate, sampled at their centres. Every cell holds the same projected solid angle, pi / n^2. Directions are in the shading frame.
struct FactoredBrdf {
  int size = 0;   // n
  int terms = 0;  // R
  std::vector<Vec3> g;   // [R][n^2] over wo, in colour
  std::vector<float> h;  // [R][n^2] over wi; orthonormal over the hemisphere: the integral of h_r h_s over solid angle is 1 or 0
  // Singular values, falling: all of them, the discarded ones too. The mean over wo (over projected solid angle) of the squared error,
  // integrated over wi and summed over the channels, is the sum of the squares of the discarded ones.
  std::vector<double> singular_values;
};

// `terms` in [1, size^2]; size in [2, 64]. Costs a symmetric eigenproblem of size^2 unknowns.
FactoredBrdf factorise_brdf(const Brdf& brdf, int terms, int size = 32);

// The grid's direction at the centre of cell (x, y).
Vec3 grid_direction(int size, int x, int y);

// g_r for r = 0 .. terms-1 at wo, bilinear over the square (out: `terms` colours); 0 below the horizon.
void evaluate_view_factors(const FactoredBrdf& factored, Vec3 wo, std::vector<Vec3>& out);

// h_r at wi, bilinear like g.
float evaluate_light_factor(const FactoredBrdf& factored, int r, Vec3 wi);

// Coefficients of h_r in the first order^2 harmonics (sh.h) of the shading frame, by a sum over the grid's cells.
std::vector<float> project_light_factor(const FactoredBrdf& factored, int r, int order);

}  // namespace lambent
