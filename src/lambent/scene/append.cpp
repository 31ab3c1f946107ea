#include <lambent/core/check.h>
#include <lambent/scene/append.h>

namespace lambent {
namespace {

// Attributes that a scene has for all its vertices or for none.
template <class T>
void append_attribute(std::vector<T>& a, size_t a_count, const std::vector<T>& b, size_t b_count, T fallback) {
  if (a.empty() && b.empty()) return;
  a.resize(a_count, fallback);
  a.insert(a.end(), b.begin(), b.end());
  a.resize(a_count + b_count, fallback);
}

}  // namespace

void place_scene(Scene& scene, Vec3 foot, float scale) {
  LAMBENT_CHECK(scale > 0);
  const Bounds box = bounds(scene);
  const Vec3 base(box.centre().x, box.min.y, box.centre().z);
  for (Vec3& p : scene.positions) p = (p - base) * scale + foot;
}

void append_scene(Scene& a, const Scene& b) {
  const size_t vertices = a.positions.size(), added = b.positions.size();
  LAMBENT_CHECK(vertices + added < none && a.triangles.size() + b.triangles.size() < none);
  append_attribute(a.colors, vertices, b.colors, added, Vec3(1)),
      append_attribute(a.tangents, vertices, b.tangents, added, Vec4(0));
  if (!a.input.empty()) a.input.resize(vertices + added, none);
  a.texcoords.resize(std::max(a.texcoords.size(), b.texcoords.size()));
  for (size_t set = 0; set < a.texcoords.size(); ++set)
    append_attribute(a.texcoords[set], vertices, set < b.texcoords.size() ? b.texcoords[set] : std::vector<Vec2>(),
                     added, Vec2(0));
  a.positions.insert(a.positions.end(), b.positions.begin(), b.positions.end());
  a.normals.insert(a.normals.end(), b.normals.begin(), b.normals.end());

  const uint32_t first_part = uint32_t(a.parts.size()), first_material = uint32_t(a.materials.size()),
                 first_triangle = uint32_t(a.triangles.size());
  for (Triangle t : b.triangles) {
    for (uint32_t& v : t.v) v += uint32_t(vertices);
    t.part += first_part;
    a.triangles.push_back(t);
  }
  for (Part part : b.parts) {
    part.material += first_material, part.first_vertex += uint32_t(vertices), part.first_triangle += first_triangle;
    part.node = part.primitive = -1, part.changed = false, part.source.clear();
    a.parts.push_back(std::move(part));
  }
  for (Material material : b.materials) {
    for (int* texture : {&material.base_color_texture, &material.transmission_texture,
                         &material.metallic_roughness_texture, &material.normal_texture, &material.emissive_texture})
      if (*texture >= 0) *texture += int(a.textures.size());
    a.materials.push_back(std::move(material));
  }
  a.textures.insert(a.textures.end(), b.textures.begin(), b.textures.end());
}

}  // namespace lambent
