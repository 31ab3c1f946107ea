#pragma once
// Light whose lamps have moved from where they were baked.
#include <lambent/relight/light.h>

namespace lambent {

// The integral of the square of a light without a window, channels summed.
double squared_radiance(const LightProjection& light);

// Of project_light()'s, without a window and not turned yet: harmonics turned, and each lobe's light about another
// axis, fitted anew to the functions of the bake.
struct MovedLight {
  LightProjection projection;
  double lost = 0, whole = 0;  // integrals of squares, channels summed: of what no column holds, of all
};
MovedLight move_light(const LightProjection& still, const LightBasis& columns, const Mat3& rotation,
                      std::span<const Vec3> axes, int order = 0, ShWindow window = ShWindow::none);

}  // namespace lambent
