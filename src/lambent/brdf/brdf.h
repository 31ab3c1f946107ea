#pragma once
// Reflection of light at a point. Directions are unit and in the shading frame: normal +z, wi towards the light, wo towards
// the eye. Reflection only: where wi or wo lies below the horizon (z <= 0), values and densities are 0. A closed set: add an
// alternative to Brdf and a case to each function.
#include <lambent/core/vec.h>

#include <variant>

namespace lambent {

struct Lambert {
  Vec3 albedo{0.8f};
};

using Brdf = std::variant<Lambert>;

// f(wi, wo), per steradian, without the cosine.
Vec3 evaluate(const Brdf& brdf, Vec3 wi, Vec3 wo);

struct BrdfSample {
  Vec3 wi;
  Vec3 weight;  // f cos(theta_i) / pdf
  float pdf;    // per steradian; 0 when nothing was drawn
};
BrdfSample sample(const Brdf& brdf, Vec3 wo, Vec2 u);

// Density of `sample` at wi.
float pdf(const Brdf& brdf, Vec3 wi, Vec3 wo);

}  // namespace lambent
