#pragma once
// Transfer that needs no simulation. Source: local-deformable-prt, section 4.2.
#include <lambent/core/vec.h>
#include <lambent/transfer/zonal_transfer.h>

namespace lambent {

// A thin sheet at each receiver that lets the share alphas[r] in [0, 1] of the light through (eq. 22-23): one lobe
// about the normal, for white. Nothing is shadowed.
ZonalTransfer membrane_transfer(int order, std::span<const Vec3> normals, std::span<const float> alphas,
                                Precision precision);

}  // namespace lambent
