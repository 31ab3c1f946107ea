// KHR_lights_punctual (Khronos, ratified).
#include <lambent/scene/lights.h>

namespace lambent {

LampArrival arriving(const PunctualLight& light, Vec3 p) {
  if (light.kind == PunctualLight::Kind::directional) return {-light.direction, INFINITY, light.intensity};
  const Vec3 d = light.position - p;
  const float distance2 = dot(d, d);
  if (!(distance2 > 0)) return {Vec3(0, 1, 0), 0, Vec3(0)};
  const float distance = std::sqrt(distance2);
  LampArrival out{d / distance, distance, light.intensity / distance2};
  if (light.kind == PunctualLight::Kind::spot) {
    const float cosine = -dot(out.direction, light.direction), outer = std::cos(light.outer_cone),
                inner = std::cos(light.inner_cone);
    const float share = std::clamp((cosine - outer) / std::max(inner - outer, 1e-4f), 0.0f, 1.0f);
    out.irradiance *= share * share;
  }
  return out;
}

}  // namespace lambent
