#pragma once
// Directional lightmaps: what arrives at a receiver as a function of the normal that a normal map gives it there, in
// few rows. Sources: radiosity, "Discussion 3" and the slides on Half-Life 2; G. McTaggart, "Half-Life 2 / Valve Source
// Shading", 2004.
#include <lambent/bake/lamps.h>
#include <lambent/bake/operator.h>
#include <lambent/transfer/directional.h>

namespace lambent {

// The last gather, by the same rays as the operator's and with their directions: for receivers [first, first + count),
// the light of `lamps` and what the hits reflect of the solution x ([receiver][group][channel], `width` floats a row),
// for each row of `kind`; out: [receiver][row][width], zero on entry.
void gather_directional(const GatherSetup& setup, const Lamps& lamps, int lamp_samples, DirectionalKind kind,
                        const float* x, size_t width, size_t first, size_t count, float* out);

}  // namespace lambent
