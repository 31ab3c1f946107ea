#pragma once
// Direct light with visibility kept as a factor: what a receiver sees of the sky, times the cosine, in n + m - 1 bands.
// For light of n bands the product with it, in the first m bands, is exact, and is a matrix that all receivers share,
// made once a frame. So a receiver keeps (n + m - 1)^2 numbers in place of the n^2 m^2 of a transfer matrix, and light,
// view and material are all free. Source: triple-product-integrals (visibility, lighting and BRDF as factors);
// docs/products.md for the orders.
#include <lambent/basis/cosine_basis.h>
#include <lambent/basis/sh_product.h>
#include <lambent/relight/relight.h>
#include <lambent/transfer/outgoing.h>

namespace lambent {

// What all receivers share under one light; the first two are of the orders alone.
struct FactorLight {
  CosineBasis basis;
  TriplingTensor tensor;
  std::vector<float> product;  // [r, g, b][j < m^2][k]: sum_i C_ijk L_i
};
// light: n^2 coefficients at least. Allocates the first time only.
void set_light(FactorLight& out, int light_order, int incident_order, std::span<const Vec3> light);

// visibility: 1/pi V cos at each receiver in harmonics of world axes, which is diffuse transfer of direct light; one
// channel, n + m - 1 bands, n of the light and m the incident order of `outgoing`, whose kind is map. out: the rows
// X_j, j < m^2, that `outgoing` reflects (basis/cosine_basis.h). Sizes `out` on first use and allocates nothing after
// that.
void relight_factors(const Transfer& visibility, const Outgoing& outgoing, const FactorLight& light, Relit& out);

// Both, for a light that is used once.
void relight_factors(const Transfer& visibility, const Outgoing& outgoing, std::span<const Vec3> light, Relit& out);

}  // namespace lambent
