#pragma once
// Inside brdf/: what each alternative of Brdf provides. wi and wo lie above the horizon. `draw` gives a direction of
// density `pdf`, or one below the horizon where nothing is drawn.
#include <lambent/brdf/brdf.h>

namespace lambent {

BrdfValue value_above(const Lambert& b, Vec3 wi, Vec3 wo);
BrdfValue value_above(const Phong& b, Vec3 wi, Vec3 wo);
BrdfValue value_above(const Ggx& b, Vec3 wi, Vec3 wo);
BrdfValue value_above(const CookTorrance& b, Vec3 wi, Vec3 wo);
BrdfValue value_above(const Ward& b, Vec3 wi, Vec3 wo);
BrdfValue value_above(const MetallicRoughness& b, Vec3 wi, Vec3 wo);
BrdfValue value_above(const Measured& b, Vec3 wi, Vec3 wo);

Vec3 draw(const Lambert& b, Vec3 wo, Vec2 u);
Vec3 draw(const Phong& b, Vec3 wo, Vec2 u);
Vec3 draw(const Ggx& b, Vec3 wo, Vec2 u);
Vec3 draw(const CookTorrance& b, Vec3 wo, Vec2 u);
Vec3 draw(const Ward& b, Vec3 wo, Vec2 u);
Vec3 draw(const MetallicRoughness& b, Vec3 wo, Vec2 u);
Vec3 draw(const Measured& b, Vec3 wo, Vec2 u);

// Share of the diffuse lobe where two lobes are sampled in proportion to the luminances of their colours.
inline float first_share(Vec3 first, Vec3 second) {
  float a = luminance(first), b = luminance(second);
  return a + b > 0 ? a / (a + b) : 1.0f;
}

// Chooses the first of two lobes with probability `share`, and stretches u.x over [0, 1) again.
inline bool take_first(float share, Vec2& u) {
  const bool first = u.x < share;
  u.x = first ? u.x / share : (u.x - share) / (1 - share);
  u.x = std::min(u.x, 1 - 0x1p-24f);
  return first;
}

inline Vec3 reflect_about(Vec3 h, Vec3 w) { return 2 * dot(w, h) * h - w; }

// Half vectors whose slopes h_x/h_z and h_y/h_z are Gaussian of variances alpha^2 / 2: Beckmann's normals weighted by
// their cosine. Density per steradian of h: exp(-(h_x^2/a_x^2 + h_y^2/a_y^2) / h_z^2) / (pi a_x a_y h_z^3).
float gaussian_slope_density(Vec2 alpha, Vec3 h);
Vec3 draw_gaussian_slopes(Vec2 alpha, Vec2 u);

}  // namespace lambent
