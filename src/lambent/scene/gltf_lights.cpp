// KHR_lights_punctual (Khronos, ratified): lights shine along the -Z of their node; its scale does not matter.
#include <lambent/core/uri.h>
#include <lambent/scene/gltf_read.h>
#include <lambent/scene/mesh_file.h>

namespace lambent {
namespace {

using Json = nlohmann::json;

// Brighter lamps are refused, so that sums of light stay finite.
constexpr double brightest = 1e30;

void read_cones(GltfCheck& check, const Json& json, const GltfWhere& where, PunctualLight& light, bool& clamped) {
  double inner = 0, outer = std::numbers::pi / 4;
  if (const Json* spot = check.object(json, "spot", where))
    inner = check.number(*spot, "innerConeAngle", inner, where),
    outer = check.number(*spot, "outerConeAngle", outer, where);
  constexpr double widest = std::numbers::pi / 2, rounding = 1e-6;
  clamped = !(inner >= 0 && inner < outer && outer <= widest + rounding);
  light.outer_cone = float(std::clamp(outer, 0.0, widest));
  light.inner_cone = std::clamp(float(inner), 0.0f, light.outer_cone);
}

bool read_light(GltfCheck& check, const Json& json, size_t index, PunctualLight& light, bool& clamped) {
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
  if (type == "point") light.kind = PunctualLight::Kind::point;
  else if (type == "directional") light.kind = PunctualLight::Kind::directional;
  else if (type == "spot") light.kind = PunctualLight::Kind::spot, read_cones(check, json, where, light, clamped);
  else return check.fail(where, "type " + in_quotes(type) + " is not point, spot or directional");
  return check.ok();
}

// The lamp of a node; nullopt where it has none, or (then the check has failed) a broken one.
std::optional<PunctualLight> lamp_of(GltfCheck& check, const GltfDocument& document, const GltfPose& pose, size_t node,
                                     bool& clamped) {
  const GltfWhere where{"node", node};
  const Json& json = gltf_item(document.json, "nodes", node);
  const Json* own = check.object(json, "extensions", where);
  const Json* reference = own ? check.object(*own, "KHR_lights_punctual", where) : nullptr;
  if (!reference) return std::nullopt;
  const Json* extensions = check.object(document.json, "extensions", {});
  const Json* extension = extensions ? check.object(*extensions, "KHR_lights_punctual", {}) : nullptr;
  const Json* lights = extension ? check.array(*extension, "lights", {}) : nullptr;
  if (!check.ok()) return std::nullopt;
  const auto index = check.index(*reference, "light", lights ? lights->size() : 0, where);
  PunctualLight light;
  if (check.ok() && !index) check.fail(where, "its KHR_lights_punctual names no light");
  if (!check.ok() || !read_light(check, (*lights)[*index], *index, light, clamped)) return std::nullopt;
  if (light.name.empty()) light.name = check.text(json, "name", where);
  if (light.name.empty()) light.name = "light " + std::to_string(*index);
  const Mat4d& world = pose.world[node];
  light.position = Vec3(Vec3d(world[3]));
  const Vec3d forward = -Vec3d(world[2]);
  const double length = lambent::length(forward);
  if (!is_position(light.position)) check.fail(where, "its light is not at a finite position or beyond 1e9");
  light.direction = length > 0 && std::isfinite(length) ? Vec3(forward / length) : Vec3(0, 0, -1);
  return check.ok() ? std::optional(std::move(light)) : std::nullopt;
}

}  // namespace

void read_lights(const GltfDocument& document, const GltfPose& pose, Scene& scene) {
  GltfTold left_out, clamped_cones;
  for (size_t n : pose.shown) {
    GltfCheck check("");  // bakes without lamps do not fail by them
    bool clamped = false;
    auto lamp = lamp_of(check, document, pose, n, clamped);
    if (!check.ok()) left_out.add("a lamp is left out: " + check.error().text());
    if (!lamp) continue;
    if (clamped)
      clamped_cones.add("the cones of " + in_quotes(lamp->name) + " are not 0 <= inner < outer <= pi/2: clamped");
    scene.lights.push_back(std::move(*lamp));
  }
  left_out.tell(scene.warnings, "lamps");
  clamped_cones.tell(scene.warnings, "lamps");
}

}  // namespace lambent
