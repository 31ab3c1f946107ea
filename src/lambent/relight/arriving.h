#pragma once
// The light that arrives at receivers, shadows and bounces of the scene included, as harmonics over the whole sphere,
// for what is finer than the receivers: a relief that a transfer texture holds ("bi-scale"). Source: general-prt,
// "Bi-Scale Radiance Transfer" (Sloan et al. 2003).
#include <lambent/relight/relight.h>
#include <lambent/transfer/outgoing.h>

namespace lambent {

// Incident radiance at each receiver, in harmonics.
struct ArrivingLight {
  int order = 0;
  std::vector<Vec3> light;  // [receiver][order^2], world axes
};

// `relit` are the rows that `outgoing`, whose kind is map, reflects: incident light above each receiver's horizon.
// Below it, of what agrees with that there, the light with the least of it is taken.
ArrivingLight arriving_light(const Relit& relit, const Outgoing& outgoing);

}  // namespace lambent
