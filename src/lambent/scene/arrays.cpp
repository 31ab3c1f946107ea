#include <lambent/core/file.h>
#include <lambent/scene/arrays.h>
#include <lambent/scene/mesh_file.h>

#include <fmt/format.h>

namespace lambent {
namespace {

constexpr const char* place = "arrays";

template <class T>
std::string hash_of(std::span<const T> values) {
  return content_hash({reinterpret_cast<const uint8_t*>(values.data()), values.size_bytes()});
}

bool finite(Vec2 v) { return std::isfinite(v.x) && std::isfinite(v.y); }
bool finite(Vec3 v) { return is_finite(v); }

template <class T>
Result<void> check_attribute(std::span<const T> values, size_t vertices, const char* name) {
  if (!values.empty() && values.size() != vertices)
    return Error{name, fmt::format("has {} rows where there are {} vertices", values.size(), vertices), true};
  for (size_t i = 0; i < values.size(); ++i)
    if (!finite(values[i])) return Error{fmt::format("{}[{}]", name, i), "is not finite", true};
  return {};
}

Result<void> check(const MeshArrays& a) {
  if (a.vertices.size() >= max_corners || a.faces.size() > max_corners)
    return Error{place, fmt::format("hold more than {} vertices or corners", max_corners), true};
  if (a.faces.size() % 3) return Error{"faces", "are not three vertices each", true};
  for (size_t i = 0; i < a.vertices.size(); ++i)
    if (!is_position(a.vertices[i]))
      return Error{fmt::format("vertices[{}]", i), "is not finite or lies beyond 1e9", true};
  for (size_t i = 0; i < a.faces.size(); ++i)
    if (a.faces[i] >= a.vertices.size())
      return Error{fmt::format("faces[{}]", i / 3), fmt::format("names vertex {} of {}", a.faces[i], a.vertices.size()),
                   true};
  if (auto ok = check_attribute(a.normals, a.vertices.size(), "normals"); !ok) return ok;
  if (auto ok = check_attribute(a.texcoords, a.vertices.size(), "texcoords"); !ok) return ok;
  if (auto ok = check_attribute(a.colors, a.vertices.size(), "colors"); !ok) return ok;
  for (size_t i = 0; i < a.colors.size(); ++i)
    if (!all_at_most(Vec3(0), a.colors[i]) || !all_at_most(a.colors[i], Vec3(1)))
      return Error{fmt::format("colors[{}]", i), "is no albedo: it must lie between 0 and 1", true};
  return {};
}

}  // namespace

Result<Scene> scene_from_arrays(const MeshArrays& a) {
  if (auto ok = check(a); !ok) return ok.error();
  CornerMesh mesh;
  mesh.v.assign(a.vertices.begin(), a.vertices.end()), mesh.colors.assign(a.colors.begin(), a.colors.end());
  mesh.vn.assign(a.normals.begin(), a.normals.end()), mesh.vt.assign(a.texcoords.begin(), a.texcoords.end());
  mesh.groups = {""};
  mesh.corners.reserve(a.faces.size()), mesh.faces.reserve(a.faces.size() / 3);
  for (uint32_t v : a.faces) mesh.corners.push_back({v, mesh.vt.empty() ? none : v, mesh.vn.empty() ? none : v});
  for (size_t f = 0; f < a.faces.size(); f += 3) mesh.faces.push_back({f, 3, 0, f / 3});
  Scene scene;
  scene.path = place;
  scene.hash = hash_of(a.vertices) + hash_of(a.faces) + hash_of(a.normals) + hash_of(a.colors) + hash_of(a.texcoords);
  scene.hash = hash_of(std::span<const char>(scene.hash));
  if (auto told = tell_left_out(scene, assemble_mesh(mesh, scene)); !told) return told.error();
  Material material;
  material.name = "default", material.metallic = 0;
  material.base_color = mesh.colors.empty() ? Vec3(default_albedo) : Vec3(1);
  scene.materials.push_back(std::move(material));
  if (auto finished = finish_mesh(scene); !finished) return finished.error();
  return scene;
}

}  // namespace lambent
