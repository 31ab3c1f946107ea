#pragma once
// An environment on a cubemap, every texel with exactly what it receives. Source: locally-adaptive-products, section 4.
#include <lambent/basis/cubemap.h>
#include <lambent/light/environment.h>

namespace lambent {

// Integrals over each texel of a cube, in its order (basis/cubemap.h).
struct CubeLight {
  int size = 0;
  std::vector<Vec3> energy;  // of radiance
  // Unit: where in the texel its energy comes from on average, so that energy * dot(direction, n) is what a plane that
  // sees all of it receives, wherever in the texel the sun stands. The texel's centre where it is dark.
  std::vector<Vec3> direction;
};

// Texels of the map are cut along the texels of the cube, by area: whatever their sizes, the sum of energy is that of
// the map but for rounding, and an even sky stays even to one part in a thousand. The environment is turned by
// `rotation`.
CubeLight cube_light(const Environment& env, int size, const Mat3& rotation = Mat3(1.0f));

// The map with `factor` x `factor` texels made one, energy kept, so that it is at most `width` wide; as it is where it
// is no wider or its sides do not divide. For light that turns many times a second.
Environment reduced(const Environment& env, int width);

// The largest share of the light's energy (summed over channels) in one texel: above one half, binary visibility shows
// as steps.
float largest_share(const CubeLight& light);

}  // namespace lambent
