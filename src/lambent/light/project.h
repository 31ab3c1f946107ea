#pragma once
#include <lambent/basis/directional.h>
#include <lambent/light/environment.h>

#include <span>
#include <vector>

namespace lambent {

// Spherical-harmonic coefficients (basis/sh.h) of the environment's radiance, order^2 of them: a sum over texels with
// exact solid angles; texels wider than a third of a degree are sampled at several points.
std::vector<Vec3> project_environment(const Environment& env, int order);

// The least-squares coefficients in a basis with lobes (basis/directional.h), of the environment turned by `rotation`:
// the dual functions applied to integrals against harmonics, as above and turned as coefficients, and against lobes,
// which take the place of the sun on the environment before it is turned and are integrated over every texel however
// much sharper they are.
std::vector<Vec3> project_environment(const Environment& env, const DirectionalBasis& basis,
                                      const Mat3& rotation = Mat3(1.0f));

// The same of the environment's harmonics, turned already, for a basis of harmonics and band-limited lobes within them.
std::vector<Vec3> project_harmonics(std::span<const Vec3> sh, const DirectionalBasis& basis);

// The band-limited environment with these coefficients as a map; it may be negative in places.
Environment reconstruct_environment(std::span<const Vec3> light, int width = 1024);

// The same of a basis with lobes. Lobes are averaged over texels, so energy is right at any width; width 0 chooses one
// whose texels are no wider than half the standard deviation of the sharpest lobe, from 1024 to 4096.
Environment reconstruct_environment(const DirectionalBasis& basis, std::span<const Vec3> light, int width = 0);

// The integral of the squared radiance over the sphere, channels summed: of an environment within the bands, what they
// keep of it.
double squared_radiance(const Environment& env);

}  // namespace lambent
