#pragma once
// Environment -> the light that a transfer's columns stand for.
#include <lambent/light/environment.h>
#include <lambent/transfer/transfer.h>

#include <span>

namespace lambent {

// A light as coefficients, and the functions that they belong to.
struct LightProjection {
  std::vector<Vec3> light;    // one coefficient a column; of the scene's own lamps (groups) 0
  std::vector<float> window;  // factors a band that the harmonics were multiplied by
  DirectionalBasis basis;     // the harmonics and lobes that these are coefficients of; empty without either
};

// The least-squares coefficients of the environment turned by `rotation`. Harmonics turn with it; lobes stand still in
// a bake, so they are projected onto anew. `window` is applied to the harmonics alone. With `order` > 0 bands from it
// on are left out of the basis: their coefficients are 0 and the others those that fit best without them.
LightProjection project_light(const Environment& env, const LightBasis& basis, const Mat3& rotation = Mat3(1.0f),
                              int order = 0, ShWindow window = ShWindow::none);
// Whether all its functions are harmonics, or within bands of them: steerable lobes.
bool is_within_bands(const LightBasis& basis);
// project_light() of the environment's first harmonics, unturned, for a basis within bands: as many bands as it has,
// or, of harmonics alone, fewer.
LightProjection project_light(std::span<const Vec3> harmonics, const LightBasis& basis, const Mat3& rotation,
                              ShWindow window = ShWindow::none);

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
