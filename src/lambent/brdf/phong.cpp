// E. Lafortune and Y. Willems, "Using the modified Phong reflectance model for physically based rendering", 1994.
#include <lambent/brdf/lobes.h>
#include <lambent/core/sampling.h>

namespace lambent {

BrdfValue value_above(const Phong& b, Vec3 wi, Vec3 wo) {
  const float cosine = std::clamp(wi.z * wo.z - wi.x * wo.x - wi.y * wo.y, 0.0f, 1.0f);  // to the mirror image of wo
  const float lobe = std::pow(cosine, b.exponent) / (2 * pi), diffuse = first_share(b.diffuse, b.specular);
  return {b.diffuse / pi + b.specular * ((b.exponent + 2) * lobe),
          diffuse * wi.z / pi + (1 - diffuse) * (b.exponent + 1) * lobe};
}

Vec3 draw(const Phong& b, Vec3 wo, Vec2 u) {
  if (take_first(first_share(b.diffuse, b.specular), u)) return square_to_cosine_hemisphere(u);
  const float cosine = std::pow(1 - u.y, 1 / (b.exponent + 1)), phi = 2 * pi * u.x;
  const float sine = std::sqrt(std::max(0.0f, 1 - cosine * cosine));
  return frame_about(Vec3(-wo.x, -wo.y, wo.z)) * Vec3(sine * std::cos(phi), sine * std::sin(phi), cosine);
}

}  // namespace lambent
