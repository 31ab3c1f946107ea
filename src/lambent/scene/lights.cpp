// KHR_lights_punctual (Khronos, ratified). Units: glTF-Blender-IO, io_scene_gltf2/blender/exp/lights.py.
#include <lambent/scene/lights.h>

#include <charconv>

namespace lambent {

LightUnits guess_light_units(const std::string& generator) {
  constexpr std::string_view blender = "Khronos glTF Blender I/O";
  // The first that knew of lumens.
  constexpr std::array<int, 3> first_standard{3, 4, 40};
  if (!generator.starts_with(blender)) return LightUnits::lumen;
  std::array<int, 3> version{};
  const char *at = generator.data() + std::min(generator.find('v', blender.size()), generator.size()),
             *end = generator.data() + generator.size();
  if (at == end) return LightUnits::watt;
  for (int& number : version) {
    if (at == end) break;
    at = std::from_chars(at + 1, end, number).ptr;
  }
  return version < first_standard ? LightUnits::raw : LightUnits::watt;
}

void convert_lights(std::vector<PunctualLight>& lights, LightUnits units) {
  for (PunctualLight& light : lights) {
    const bool directional = light.kind == PunctualLight::Kind::directional;
    if (units == LightUnits::watt) light.intensity /= float(lumens_per_watt);
    if (units == LightUnits::raw && !directional) light.intensity /= 4 * pi;
  }
}

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
