#pragma once
// From radiance to what a screen shows: exposure, then a tone curve, then sRGB. The page (web/) uses the same names and
// numbers.
#include <lambent/core/result.h>
#include <lambent/core/vec.h>

#include <cstdint>
#include <span>
#include <string>

namespace lambent {

struct Image;

// none: clamped. aces: Stephen Hill's fit of the ACES reference and output transforms, scaled by 1 / 0.6 as three.js
// does. agx: Troy Sobotka's AgX in Rec. 2020 primaries, its curve as a polynomial of degree 6. neutral: Khronos PBR
// Neutral, which leaves colours below 0.76 as they are but for a Fresnel's 4 %.
enum class Tone : uint8_t { none, aces, agx, neutral };
inline constexpr const char* tone_names = "neutral|agx|aces|none";
// How radiance is shown.
struct Display {
  float exposure = 0;  // stops
  Tone tone = Tone::none;
};

// What is shown of a radiance, linear Rec. 709 in [0, 1]: times 2^exposure, negative and NaN as 0, through the curve.
Vec3 shown(Vec3 radiance, const Display& display);

// Stops at which 90 % of the surfaces that pictures show are no brighter than 0.7: of the pixels that are covered at
// least by half (of all, where none is), luminance, negative as 0. In [-20, 20]; 0 where all is black. Frames of a film
// share one.
float auto_exposure(std::span<const Image> frames);

// "auto" or a number of stops in [-100, 100], and a tone's name. Errors: anything else, naming the option.
Result<Display> parse_display(const std::string& exposure, const std::string& tone, std::span<const Image> frames);
// Without pictures: whether that would do.
Result<void> check_display(const std::string& exposure, const std::string& tone);

// Shares of the covered pixels, [0, 1]: of those with a channel of 255 as a PNG, and of those whose luminance is
// negative.
struct Clipping {
  double white = 0, negative = 0;
};
Clipping clipping(std::span<const Image> frames, const Display& display);

}  // namespace lambent
