#pragma once
// Direct light with visibility kept as a factor: what a receiver sees of the sky, times the cosine, in n + m - 1 bands.
// For light of n bands the product with it, in the first m bands, is exact, and is a matrix that all receivers share,
// made once a frame. So a receiver keeps (n + m - 1)^2 numbers in place of the n^2 m^2 of a transfer matrix, and light,
// view and material are all free. Source: triple-product-integrals (visibility, lighting and BRDF as factors);
// docs/products.md for the orders.
#include <lambent/relight/relight.h>
#include <lambent/transfer/outgoing.h>

namespace lambent {

// visibility: 1/pi V cos at each receiver in harmonics of world axes, which is diffuse transfer of direct light; one
// channel. light: n^2 coefficients, n = visibility order - m + 1 at least 1, m the incident order of `outgoing`, whose
// kind is map. out: the rows X_j, j < m^2, that `outgoing` reflects (basis/cosine_basis.h).
void relight_factors(const Transfer& visibility, const Outgoing& outgoing, std::span<const Vec3> light, Relit& out);

}  // namespace lambent
