// glTF 2.0, section 3.9.4 (alpha coverage); KHR_materials_transmission.
#include <lambent/scene/see_through.h>

#include <algorithm>

namespace lambent {
namespace {

// A number that is none leaves a surface as it would be without: `solid`.
float share(float x, float solid) { return std::isnan(x) ? solid : std::clamp(x, 0.0f, 1.0f); }

const Material& material_of(const Scene& scene, const Triangle& t) {
  return scene.materials[scene.parts[t.part].material];
}

}  // namespace

float coverage(const Scene& scene, const Triangle& triangle, float u, float v) {
  const Material& m = material_of(scene, triangle);
  if (m.alpha_mode == AlphaMode::opaque) return 1.0f;
  float alpha = share(m.alpha, 1);
  if (m.base_color_texture >= 0)
    alpha *= sample_alpha(scene.textures[size_t(m.base_color_texture)],
                          texture_place(scene, triangle, u, v, m.texcoord_set, m.uv_transform));
  if (m.alpha_mode == AlphaMode::blend) return alpha;
  return alpha < m.alpha_cutoff ? 0.0f : 1.0f;
}

float transmission(const Scene& scene, const Triangle& triangle, float u, float v) {
  const Material& m = material_of(scene, triangle);
  float t = share(m.transmission, 0);
  if (!(t > 0)) return 0.0f;
  if (m.transmission_texture >= 0)
    t *= sample_linear_texture(scene.textures[size_t(m.transmission_texture)],
                               texture_place(scene, triangle, u, v, m.transmission_set, m.transmission_transform))
             .x;
  return t * (1 - metallic_roughness(scene, triangle, u, v).x);
}

Vec3 transmittance(const Scene& scene, const Triangle& triangle, float u, float v) {
  const float a = coverage(scene, triangle, u, v), t = a > 0 ? transmission(scene, triangle, u, v) : 0.0f;
  return t > 0 ? Vec3(1 - a) + base_color(scene, triangle, u, v) * (a * t) : Vec3(1 - a);
}

bool is_see_through(const Scene& scene, const Material& m) {
  if (share(m.transmission, 0) > 0 && (m.metallic < 1 || m.metallic_roughness_texture >= 0)) return true;
  if (m.alpha_mode == AlphaMode::opaque) return false;
  uint8_t least = 255;
  if (m.base_color_texture >= 0) {
    const std::vector<uint8_t>& alpha = scene.textures[size_t(m.base_color_texture)].alpha;
    if (!alpha.empty()) least = *std::min_element(alpha.begin(), alpha.end());
  }
  const float alpha = share(m.alpha, 1) * (float(least) / 255.0f);
  return m.alpha_mode == AlphaMode::blend ? alpha < 1 : alpha < m.alpha_cutoff;
}

std::vector<uint8_t> see_through_materials(const Scene& scene) {
  std::vector<uint8_t> out;
  bool any = false;
  for (const Material& m : scene.materials) out.push_back(is_see_through(scene, m)), any |= out.back() != 0;
  return any ? out : std::vector<uint8_t>{};
}

}  // namespace lambent
