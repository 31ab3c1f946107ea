#pragma once
// How a function on surfaces becomes numbers at receivers, alpha with f ~ sum_i alpha_i B_i: its value where each
// receiver is (point collocation), or the least integral of the squared difference, M alpha = (integral of B_i f), with
// the mass matrix M_ij = integral of B_i B_j. Of boxes M is their areas, and alpha are means.
// Source: radiosity, "Different Projections", "Least Squares Projection", "Easy Special Case: Box Functions".
#include <lambent/receivers/receivers.h>

namespace lambent {

// Places over each receiver's basis function, as dense as it is high: the mean of f over them is about the integral of
// B_i f over that of B_i. Stratified; places start off their surfaces as receivers do.
struct SpreadPlaces {
  size_t each = 0;                     // a receiver
  std::vector<Vec3> origins, normals;  // [receiver][each]
};

// N_ij = M_ij / integral of B_i, row by row: its rows sum to 1.
struct MassMatrix {
  std::vector<size_t> first;      // of row i, into the two below; one more at the end
  std::vector<uint32_t> columns;  // rising within a row
  std::vector<float> weights;
  // Eigenvalues of M over its diagonal, at least and at most. Sources: A. Wathen, "Realistic eigenvalue bounds for the
  // Galerkin mass matrix", 1987: [1/2, 2] for hats, [1/4, 9/4] for whole tents; at most 4 for tents that a chart's
  // border cuts a little, four of which meet at a point.
  float least = 1, most = 1;
  bool is_diagonal() const { return columns.size() + 1 == first.size(); }
};

struct LeastSquares {
  SpreadPlaces places;
  MassMatrix mass;
};

// Of hats and boxes exact; of tents by 16 points a texel; of kernels about points none. A tent that the surface has
// less than 0.7 of, at a chart's border, stays where it is, by collocation, and has a row of its own alone.
LeastSquares make_least_squares(const Scene& scene, const Receivers& receivers, size_t places, uint32_t seed);

// Solves N x = b for all columns, in place; x is [row][stride], of which `width` are solved for. By as many steps of
// Chebyshev's iteration (Golub and Varga 1961) as leave 3e-5 of it: 11 for hats, 22 for tents. All cores; sums in a
// fixed order.
void solve_mass(const MassMatrix& mass, float* x, size_t stride, size_t width);

}  // namespace lambent
