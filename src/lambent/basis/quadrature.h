#pragma once
// Quadrature that is exact for polynomials, on an interval and on (a zone of) the sphere.
#include <lambent/core/vec.h>

#include <vector>

namespace lambent {

struct QuadratureNode {
  double x, weight;
};
// The Gauss-Legendre rule of `count` >= 1 nodes on [from, to], descending; exact for polynomials of degree 2 count - 1.
std::vector<QuadratureNode> gauss_legendre(int count, double from = -1, double to = 1);

struct DirectionNode {
  Vec3d direction;
  double weight;  // solid angle, sr
};
// A product rule on the zone z_from <= z <= z_to (Gauss in z, even spacing about it), exact there for products of two
// functions of `exact_order` bands whose part of each azimuthal frequency is a polynomial in z; on the whole sphere
// these are all products of spherical harmonics.
std::vector<DirectionNode> direction_quadrature(int exact_order, double z_from = -1, double z_to = 1);

}  // namespace lambent
