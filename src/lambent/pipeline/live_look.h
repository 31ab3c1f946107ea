#pragma once
// What pixels of a live picture show in place of it.
#include <lambent/pipeline/live.h>

namespace lambent {

// `relit`: of Look::coefficient, the values of that column alone. What it is made of must outlive it.
std::function<SurfaceShade()> look_shade(Look look, const Scene& scene, const SpatialBasis& basis, const Relit& relit);

}  // namespace lambent
