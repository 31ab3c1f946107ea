#pragma once
// Light in free space, once the lattice's transfer is relit: m^2 coefficients of the light that arrives at any
// position.
#include <lambent/relight/relight.h>
#include <lambent/transfer/lattice.h>

namespace lambent {

// Trilinear between the points, held constant outside of the box. `relit` is the lattice's transfer under a light; out
// takes relit.rows coefficients of incident radiance (basis/sh.h, world axes). `position` must be finite.
void interpolate_lattice(const Lattice& lattice, const Relit& relit, Vec3 position, std::span<Vec3> out);

}  // namespace lambent
