#pragma once
// Low-discrepancy points and warps from the unit square.
#include <lambent/core/vec.h>

#include <cstdint>

namespace lambent {

// Point `index` of the 2-D Sobol' sequence with Owen scrambling keyed by `seed`; any power-of-two run that starts at a
// multiple of its length is stratified in every elementary interval.
// Source: Burley 2020, "Practical hash-based Owen scrambling".
Vec2 sobol_owen(uint32_t index, uint32_t seed);

// Unit disk, area-preserving with low distortion (Shirley and Chiu 1997).
Vec2 square_to_disk(Vec2 u);
// Its inverse: the point of [0, 1]^2, for a point of the unit disk.
Vec2 disk_to_square(Vec2 d);

// Hemisphere about +z with density cos(theta)/pi.
Vec3 square_to_cosine_hemisphere(Vec2 u);

// Whole sphere, uniform density 1/(4 pi).
Vec3 square_to_sphere(Vec2 u);

}  // namespace lambent
