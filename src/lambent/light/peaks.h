#pragma once
// The part of an environment that is too sharp for n bands: what rings. Windows: P.-P. Sloan, "Deringing Spherical
// Harmonics", 2017; here light is taken apart first (docs/deringing.md).
#include <lambent/light/environment.h>

namespace lambent {

// The environment with its peaks cut off: no texel is more luminous than what the brightest 1/order^2 of the sphere, as
// much as a coefficient's share of it, exceeds. Brighter texels keep their hue, so that both this and the rest, env -
// result, are nowhere negative. `order` is 1 at least.
Environment without_peaks(const Environment& env, int order);

}  // namespace lambent
