#pragma once
// Products of functions on the sphere given by real spherical harmonics (sh.h): (ab)_k = sum_ij a_i b_j C_ijk with the
// tripling coefficients C_ijk = integral of y_i y_j y_k. Sources: triple-product-integrals; general-prt (triple
// products); the orders that make a product exact: docs/products.md.
#include <lambent/basis/sh.h>
#include <lambent/core/aligned.h>

namespace lambent {

// C_ijk for i < order_a^2, j < order_b^2, k < order_c^2, orders 1 .. max_sh_order; only those other than zero. The
// entries of k are begin[k] .. begin[k+1], ordered by (i, j).
struct TriplingTensor {
  int order_a = 0, order_b = 0, order_c = 0;
  std::vector<uint32_t> begin;
  std::vector<uint16_t> i, j;
  std::vector<double> value;
  std::vector<float> single;  // the same values, rounded
};
TriplingTensor make_tripling_tensor(int order_a, int order_b, int order_c);

// One coefficient C_ijk, from Wigner 3j symbols; any i, j, k >= 0.
double tripling_coefficient(int i, int j, int k);

// The product of two functions, projected to order_c: the sum over the tensor, as it stands. Slow, and what the fast
// one is tested against. Spans have order^2 values; out may not overlap the others.
void multiply_sh_plain(const TriplingTensor& tensor, std::span<const double> a, std::span<const double> b,
                       std::span<double> out);
void multiply_sh_plain(const TriplingTensor& tensor, std::span<const float> a, std::span<const float> b,
                       std::span<float> out);

// The same product, fast; orders come from the sizes of the spans (squares, orders 1 .. max_sh_order). Orders 2 and 3
// throughout go by scalars, vectors and 3 x 3 tensors. All others are evaluated on a grid just fine enough to be exact,
// by separated Legendre and Fourier sums, multiplied there and projected back: O(n^3) instead of O(n^5), unrolled for
// equal orders 4 .. 8. out may be a or b. The first call for a triple of orders builds its tables; later ones neither
// allocate nor lock. Errors are float rounding of the values multiplied, about 1e-6 of |a| |b|.
void multiply_sh(std::span<const float> a, std::span<const float> b, std::span<float> out);

// The matrix of multiplication by f, T_ij = sum_k C_ijk f_k = integral of y_i f y_j for i, j < order^2, row-major,
// symmetric: (T g)_i are the coefficients of f g. It is exact for an unlimited f as soon as f's coefficients of order 2
// order - 1 are there; the tensor has orders (order, order, order of f).
std::vector<double> sh_product_matrix(const TriplingTensor& tensor, std::span<const double> f);

// T_mn = the integral of T(wi, wo) y_m(wi) y_n(wo) over both spheres, order_in^2 x order_out^2, row-major: the matrix
// of a two-direction function such as a reflectance. Exact for functions within `exact_order` bands in each direction.
std::vector<double> project_sh_pair(int order_in, int order_out, const std::function<double(Vec3d wi, Vec3d wo)>& T,
                                    int exact_order = 32);

}  // namespace lambent
