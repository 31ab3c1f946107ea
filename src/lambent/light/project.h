#pragma once
#include <lambent/light/environment.h>

#include <span>
#include <vector>

namespace lambent {

// Spherical-harmonic coefficients (basis/sh.h) of the environment's radiance, order^2 of them: a sum over texels with exact
// solid angles; texels wider than a third of a degree are sampled at several points.
std::vector<Vec3> project_environment(const Environment& env, int order);

// The band-limited environment with these coefficients as a map; it may be negative in places.
Environment reconstruct_environment(std::span<const Vec3> light, int width = 1024);

}  // namespace lambent
