#pragma once
// An analytic clear sky with sun, and flat ground below the horizon.
#include <lambent/light/environment.h>

namespace lambent {

// What a sky is asked for.
struct SkyOptions {
  float elevation = 35.0f;  // degrees of the sun's centre above the horizon, [-2, 90]
  float azimuth = 45.0f;    // degrees of the sun from +X towards +Z, any
  float turbidity = 3.0f;   // haze, [1.7, 10]
  Vec3 ground{0.2f};        // Lambert albedo of the ground seen below the horizon, lit by this sky and sun, [0, 1]
  bool sun = true;          // false: no sun at all, neither the disc nor its light on the ground
  int width = 1024;         // of the map, texels, even, [8, 16384]; height is half
};

// Unit of radiance: 10,000 cd/m^2 (a clear sky is then around 0.5, and the sun gives about 10 of irradiance). The sun's
// disc (0.533 degrees across) is spread over the texels it covers by covered area, so its irradiance is exact at any
// size of map. The part of the disc below the horizon gives no light. Limits of the model: it was fitted to the sun
// above the horizon and turbidity 2 to 6. Below turbidity 2 the sky is that of 2 (where its brightness stays sensible),
// the sun that of the turbidity asked for. Below the horizon the sky of a sun at 0 degrees is dimmed by e every 1.5
// degrees, as twilight roughly does; a sun at 0 degrees leaves the model's sky several times brighter than a real one.
// Colours outside Rec. 709 are clamped. Source: Preetham, Shirley and Smits 1999, "A practical analytic model for
// daylight" (sky: Perez form; sun: their appendix).
Result<Environment> make_sky(const SkyOptions& options);

// Irradiance of the sun on a plane that faces it, with the whole disc in view, linear Rec. 709 in the unit above.
Vec3 sun_irradiance(float elevation, float turbidity);

// Parses "elevation=35,azimuth=120,…" (what follows "sky:"): the options' names, ground a single number, sun on or off.
// Errors: unknown key, not a number, out of range.
Result<SkyOptions> parse_sky(const std::string& spec);

}  // namespace lambent
