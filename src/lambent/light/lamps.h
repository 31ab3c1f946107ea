#pragma once
// The lamps of an environment, as lobes for a light basis of harmonics and lamps (basis/directional.h). Source:
// general-prt (custom light bases: harmonics for the sky, directional functions for a few small lamps).
#include <lambent/basis/directional.h>
#include <lambent/light/environment.h>

namespace lambent {

// The `count` strongest lamps, strongest first; fewer where fewer stand out. A lamp is a connected region of texels
// around one that is brighter than any beside the lamps already found, down to a fifth of its radiance and to four
// times the mean radiance of the environment, with the ring of texels around that, which it may cover in part; its
// strength is the integral of its radiance. It becomes a von Mises-Fisher lobe with the region's mean direction and as
// sharp as makes its mean cosine the region's. Of two lamps that are nearly one lobe (overlap above 0.8) the weaker is
// left out.
std::vector<Lobe> find_lamps(const Environment& env, int count);

}  // namespace lambent
