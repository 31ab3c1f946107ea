#pragma once
// Haar wavelets on a square, and the integral of the product of three functions in them. Sources:
// triple-product-integrals (tripling coefficients); Ng, Ramamoorthi and Hanrahan 2004, "Triple product wavelet
// integrals for all-frequency relighting".
//
// The square has area 1 and 2^levels x 2^levels pixels. The basis is orthonormal: one constant, and for each square of
// level l (side 2^-l) three wavelets of height 2^l, of signs over its quarters (00, 10, 01, 11; x first): + - + -, + +
// - -, + - - +.
#include <lambent/core/vec.h>

#include <span>
#include <vector>

namespace lambent {

// A function on the square, by its wavelets.
struct HaarTree {
  int levels = 0;
  // The constant's, then three a square: squares level by level, along a Morton curve in each.
  std::vector<float> coefficients;
  std::vector<uint8_t> occupied;  // by square: whether it or a square inside it has a coefficient that is not 0
};
// Squares with wavelets, and coefficients, of so many levels.
constexpr size_t haar_squares(int levels) { return ((size_t(1) << 2 * levels) - 1) / 3; }
constexpr size_t haar_count(int levels) { return size_t(1) << 2 * levels; }

// Pixels are row by row; at least 4^levels of them. Reuses the tree's memory.
void haar_transform(int levels, std::span<const float> pixels, HaarTree& out);
std::vector<float> haar_pixels(const HaarTree& tree);

// Non-linear approximation: of the coefficients of all trees together, only this share, the largest, stays.
void keep_largest(std::span<HaarTree> trees, double fraction);

// As kept in so many bits a coefficient, 2 to 16: rounded to steps of the largest over 2^(bits - 1) - 1 (Ng et al.:
// visibility in 8).
void quantise_haar(HaarTree& tree, int bits);

// The integral over the square of the product of three functions, in time linear in their coefficients: sums over the
// squares where at least two have any, with the values of the coarser squares' wavelets passed down. `visited` counts
// squares where it is given.
double haar_triple_product(const HaarTree& a, const HaarTree& b, const HaarTree& c, size_t* visited = nullptr);

// The integral of the product of three basis functions, numbered as the coefficients are, by the theorem's three cases;
// for tests.
double haar_tripling_coefficient(int levels, size_t i, size_t j, size_t k);

}  // namespace lambent
