#pragma once
// T with its light fixed: one column, "the light is on". Of a transfer matrix this is a surface light field, radiance
// over place and view. Source: general-prt, "Special cases".
#include <lambent/relight/relight.h>

namespace lambent {

// light: as relight() takes it. The result has three channels, and one column named `name`.
Transfer fix_light(const Transfer& transfer, std::span<const Vec3> light, const std::string& name);

}  // namespace lambent
