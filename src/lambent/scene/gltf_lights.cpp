// KHR_lights_punctual (Khronos, ratified): lights shine along the -Z of their node; its scale does not matter.
#include <lambent/scene/gltf_container.h>
#include <lambent/scene/gltf_read.h>

namespace lambent {
namespace {

using Json = nlohmann::json;

// Brighter lamps are refused, so that sums of light stay finite.
constexpr double brightest = 1e30;

bool read_light(GltfCheck& check, const Json& json, size_t index, PunctualLight& light) {
  const GltfWhere where{"light", index};
  if (!json.is_object()) return check.fail(where, "is not an object");
  light.name = check.text(json, "name", where);
  const std::string type = check.text(json, "type", where);
  double color[3] = {1, 1, 1};
  check.numbers(json, "color", color, where);
  const double intensity = check.number(json, "intensity", 1, where);
  if (!check.ok()) return false;
  for (int c = 0; c < 3; ++c) {
    const double value = color[c] * intensity;
    if (!(value >= 0 && value <= brightest))
      return check.fail(where, "its colour times intensity is negative or too large");
    light.intensity[c] = float(value);
  }
  if (type == "point") {
    light.kind = PunctualLight::Kind::point;
  } else if (type == "directional") {
    light.kind = PunctualLight::Kind::directional;
  } else if (type == "spot") {
    light.kind = PunctualLight::Kind::spot;
    const Json* spot = check.object(json, "spot", where);
    double inner = 0, outer = std::numbers::pi / 4;
    if (spot)
      inner = check.number(*spot, "innerConeAngle", inner, where),
      outer = check.number(*spot, "outerConeAngle", outer, where);
    if (check.ok() && !(inner >= 0 && inner < outer && outer <= std::numbers::pi / 2 + 1e-6))
      return check.fail(where, "its cone angles are not 0 <= inner < outer <= pi/2");
    light.inner_cone = float(inner), light.outer_cone = float(outer);
  } else {
    return check.fail(where, "type " + in_quotes(type) + " is not point, spot or directional");
  }
  return check.ok();
}

}  // namespace

bool read_lights(GltfCheck& check, const GltfDocument& document, const GltfPose& pose, Scene& scene) {
  const Json* extensions = check.object(document.json, "extensions", {});
  const Json* extension = extensions ? check.object(*extensions, "KHR_lights_punctual", {}) : nullptr;
  const Json* lights = extension ? check.array(*extension, "lights", {}) : nullptr;
  for (size_t n : pose.shown) {
    const GltfWhere where{"node", n};
    const Json& node = gltf_item(document.json, "nodes", n);
    const Json* own = check.object(node, "extensions", where);
    const Json* reference = own ? check.object(*own, "KHR_lights_punctual", where) : nullptr;
    if (!check.ok()) return false;
    if (!reference) continue;
    const auto index = check.index(*reference, "light", lights ? lights->size() : 0, where);
    if (!check.ok()) return false;
    if (!index) return check.fail(where, "its KHR_lights_punctual names no light");
    PunctualLight light;
    if (!read_light(check, (*lights)[*index], *index, light)) return false;
    if (light.name.empty()) light.name = check.text(node, "name", where);
    if (light.name.empty()) light.name = "light " + std::to_string(*index);
    const Mat4d& world = pose.world[n];
    light.position = Vec3(Vec3d(world[3]));
    const Vec3d forward = -Vec3d(world[2]);
    const double length = lambent::length(forward);
    if (!is_finite(light.position)) return check.fail(where, "its light is not at a finite position");
    light.direction = length > 0 && std::isfinite(length) ? Vec3(forward / length) : Vec3(0, 0, -1);
    scene.lights.push_back(std::move(light));
  }
  return check.ok();
}

}  // namespace lambent
