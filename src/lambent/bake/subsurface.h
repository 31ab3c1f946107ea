#pragma once
// Light that goes through things: diffuse transfer of surfaces that bound a homogeneous medium, by random walks in it.
// Source: local-deformable-prt, section 6, which simulates subsurface scattering as part of local transport. See
// docs/zonal.md.
#include <lambent/bake/bake.h>
#include <lambent/bake/medium.h>

namespace lambent {

struct SubsurfaceOptions {
  Medium medium;
  // The scene repeats along x and y after so much, and its middle is [0, period) x (-period, 0] as in make_patch; 0: it
  // does not.
  float period = 0;
  int most_events = 1 << 16;  // scatterings and reflections of a walk, which is given up after so many
};

struct SubsurfaceReport {
  double lost = 0;    // share of the walks given up; what they would have brought is missing
  double events = 0;  // scatterings and reflections of a walk, on average
};

// The medium lies behind the front of every surface, and what is nested or overlaps is one body. Transfer is that of
// the light that leaves the medium at a receiver, as if it left evenly in all directions: irradiance from inside, what
// the boundary lets through of it, over pi. What the outside of the boundary mirrors is not in it. Light that enters a
// body after it left another place of it counts as a bounce; the base colour is multiplied each time that light leaves.
// One channel if colours do not differ, else three. Harmonics alone; shadows are always on. Errors: as bake(); medium
// out of range.
Result<Transfer> bake_subsurface(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                 const BakeOptions& options, const SubsurfaceOptions& subsurface,
                                 BakeReport* report = nullptr, SubsurfaceReport* walks = nullptr,
                                 Progress* progress = nullptr);

}  // namespace lambent
