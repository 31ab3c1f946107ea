#pragma once
// Transfer in free space: after the surface solution one more gather, at every point of a lattice, over the whole
// sphere,
//   T_ji(p) = integral over all w of L^i(p <- w) y_j(w),
// with L^i the light that arrives when the environment is y_i: y_i itself where the sky is seen, and elsewhere what the
// surface transfer says that leaves the hit towards p. It lights objects that the bake did not know. They must be
// small: they cast no shadow and no light on the scene. Source: general-prt ("Transferred incident radiance",
// neighbourhood transfer); triple-product-integrals.
#include <lambent/bake/bake.h>
#include <lambent/transfer/lattice.h>
#include <lambent/transfer/outgoing.h>

namespace lambent {

// What a bake of free space is asked for.
struct LatticeOptions {
  int order = 4;       // m, bands of incident light; light's order + m <= max_sh_order + 1. A diffuse object needs 3,
                       // self-shadows more
  int samples = 1024;  // rays a point, [1, 2^20]
  size_t memory = size_t{4} << 30;  // bytes for the result and the work
  uint32_t seed = 1;
  Precision precision = Precision::half;
};

// What it says of itself.
struct LatticeReport {
  size_t points = 0, invalid = 0;  // invalid: inside something, filled from their neighbours
  size_t rays = 0;
  size_t bytes = 0;  // of the transfer
  double seconds = 0;
  size_t neighbours = 0, walled = 0;  // pairs of valid neighbours along the axes; those with a solid surface between
                                      // them, through which interpolated light leaks
};

// From the first point to the last of so many an axis, each in the middle of a cell of the scene's bounds: half a cell
// inside them, so that outer points do not lie in a room's walls and floor.
Bounds default_lattice_box(const Scene& scene, int nx, int ny, int nz);

// Bytes that the lattice itself takes.
size_t lattice_bytes(const Lattice& lattice, const LightBasis& light, int order, int channels, Precision precision);

// What can be told before the surfaces are baked. Errors: options out of range; a box that is none; memory too small.
Result<void> check_lattice(const Lattice& lattice, const LightBasis& light, const LatticeOptions& options);

// `surface` is the scene's bake, of harmonics and perhaps lobes: sharp ones get rays of their own at every point, as at
// surfaces (lobes.h). And `outgoing` its last reflection, null for a diffuse one. The
// lattice's light has been reflected once more than the surfaces'. Points most of whose rays meet backs of one-sided
// surfaces are invalid. Errors: as above; every point invalid; cancelled.
Result<LatticeTransfer> bake_lattice(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                     const Transfer& surface, const Outgoing* outgoing, const Lattice& lattice,
                                     const LatticeOptions& options, LatticeReport* report = nullptr,
                                     Progress* progress = nullptr);

}  // namespace lambent
