#pragma once
// Lamps without a surface: what of them arrives where. Units as glTF has them: intensity I in candela, irradiance in
// lux, and emission of surfaces in candela a square metre are one system, so a Lambert surface of albedo a under
// irradiance E sends out a E / pi.
#include <lambent/scene/scene.h>

namespace lambent {

// What arrives of a lamp at a place.
struct LampArrival {
  Vec3 direction;   // unit, from the point to the lamp
  float distance;   // infinite for directional ones
  Vec3 irradiance;  // of a surface at the point that faces the lamp, were nothing in between
};

// Source: KHR_lights_punctual. Inverse square of the distance; spots fall off as clamp((cos t - cos outer) / (cos inner
// - cos outer))^2. `range` is not read: it is a hint for what a renderer may leave out.
LampArrival arriving(const PunctualLight& light, Vec3 p);

// What a file states its lamps in, beside the emission of its surfaces. glTF counts both in lumens: candela and lux
// beside candela a square metre, or both in watts. Blender's exporter keeps emission in watts and writes lamps at 683
// lumens a watt (Standard), or as they are, points and spots in watts all around (Raw, and all before v3.4.40); its
// Unitless files need nothing. Source: io_scene_gltf2/blender/exp/lights.py of glTF-Blender-IO.
enum class LightUnits { lumen, watt, raw };
inline constexpr double lumens_per_watt = 683;

// By asset.generator: what Blender's exporter of that version writes if it is not told otherwise; of others lumen.
LightUnits guess_light_units(const std::string& generator);
// Divides the lamps' intensities so that they go with the emission: by 1; 683; 4 pi, but directional lights by 1.
void convert_lights(std::vector<PunctualLight>& lights, LightUnits units);

// Whether light comes from the side of the triangle that a ray meets.
inline bool emits(const Scene& scene, const Triangle& t, bool front_side) {
  const Vec3 e = scene.materials[scene.parts[t.part].material].emissive;
  return (front_side || t.two_sided) && (e.x > 0 || e.y > 0 || e.z > 0);
}

}  // namespace lambent
