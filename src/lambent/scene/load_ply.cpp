// From what a PLY file holds to a scene.
#include <lambent/scene/index_table.h>
#include <lambent/scene/load.h>
#include <lambent/scene/mesh_file.h>
#include <lambent/scene/mesh_text.h>
#include <lambent/scene/named_file.h>
#include <lambent/scene/ply_file.h>

#include <fmt/format.h>

#include <bit>

namespace lambent {
namespace {

// Puts the mesh into the scene as one part; its vertices are the file's.
LeftOut add_plain_part(PlyMesh& mesh, Scene& scene) {
  scene.positions =
      place_positions(scene, mesh.positions, mesh.corners.size(), [&](size_t c) { return mesh.corners[c]; });
  mesh.positions = {};
  scene.triangles.reserve(mesh.corners.size() - std::min(mesh.corners.size(), 2 * mesh.corner_counts.size()));
  const bool any_broken = std::any_of(scene.positions.begin(), scene.positions.end(), is_broken);
  Triangulator triangulator;
  std::vector<std::array<uint32_t, 3>> cuts;
  LeftOut left_out;
  size_t first = 0;
  for (uint32_t count : mesh.corner_counts) {
    const std::span<const uint32_t> polygon(mesh.corners.data() + first, count);
    first += count;
    if (any_broken &&
        std::any_of(polygon.begin(), polygon.end(), [&](uint32_t v) { return is_broken(scene.positions[v]); })) {
      ++left_out.broken;
      continue;
    }
    if (count == 3 && polygon[0] != polygon[1] && polygon[1] != polygon[2] && polygon[2] != polygon[0]) {
      scene.triangles.push_back({{polygon[0], polygon[1], polygon[2]}, 0, true});
      continue;
    }
    cuts.clear();
    left_out.repeated += !triangulator.cut(polygon, scene.positions, cuts);
    for (auto cut : cuts) scene.triangles.push_back({{polygon[cut[0]], polygon[cut[1]], polygon[cut[2]]}, 0, true});
  }
  scene.normals = std::move(mesh.normals);
  scene.normals.resize(scene.positions.size(), Vec3(0));
  scene.texcoords[0] = std::move(mesh.texcoords);
  scene.colors = std::move(mesh.colors);
  number_inputs(scene);
  Part part;
  part.name = file_stem(scene.path);
  part.vertex_count = uint32_t(scene.positions.size()), part.triangle_count = uint32_t(scene.triangles.size());
  scene.parts.push_back(part);
  return left_out;
}

// The same where corners of one vertex may differ in texture coordinates, or faces in their textures: a part a texture,
// whose material is the texture's number.
LeftOut add_parts(PlyMesh& mesh, size_t textures, Scene& scene) {
  CornerMesh out;
  out.v = std::move(mesh.positions), out.colors = std::move(mesh.colors), out.vn = std::move(mesh.normals);
  const bool per_corner = !mesh.corner_texcoords.empty(), has_normals = !out.vn.empty();
  if (!per_corner) out.vt = std::move(mesh.texcoords);
  IndexTable table(per_corner ? mesh.corners.size() : 0);
  for (size_t c = 0; c < mesh.corners.size(); ++c) {
    MeshCorner corner{mesh.corners[c]};
    if (has_normals) corner.vn = corner.v;
    if (per_corner) {
      Vec2 uv = mesh.corner_texcoords[c] + 0.0f;  // -0 becomes 0
      uint64_t hash = hash64(std::bit_cast<uint32_t>(uv.x), std::bit_cast<uint32_t>(uv.y));
      corner.vt = table.find_or_insert(hash, uint32_t(out.vt.size()), [&](uint32_t k) { return out.vt[k] == uv; });
      if (corner.vt == out.vt.size()) out.vt.push_back(uv);
    } else if (!out.vt.empty()) {
      corner.vt = corner.v;
    }
    out.corners.push_back(corner);
  }
  out.groups.resize(textures + 1);  // the last: faces of no texture
  if (textures > 1)
    for (size_t i = 0; i <= textures; ++i) out.groups[i] = fmt::format("{}/{}", file_stem(scene.path), i);
  size_t first = 0;
  for (size_t f = 0; f < mesh.corner_counts.size(); ++f) {
    size_t texture = mesh.face_textures.empty() ? 0 : mesh.face_textures[f];
    out.faces.push_back({first, mesh.corner_counts[f], uint32_t(std::min(texture, textures)), 0});
    first += mesh.corner_counts[f];
  }
  return assemble_mesh(out, scene);
}

// A material a texture, then one without where that is used.
void add_materials(const std::vector<std::string>& files, const std::string& folder, Scene& scene) {
  LostPictures lost;
  const bool has_texcoords = !scene.texcoords[0].empty();
  std::vector<bool> used(files.size() + 1);
  for (const Part& part : scene.parts) used[part.material] = true;
  for (size_t i = 0; i < files.size() + used.back(); ++i) {
    Material material;
    material.name = "default", material.metallic = 0;
    material.base_color = scene.colors.empty() ? Vec3(default_albedo) : Vec3(1);
    if (i < files.size() && used[i]) {
      material.name = short_name(files[i]);
      auto texture = has_texcoords ? read_named_picture(files[i], folder, scene.path)
                                   : Result<Texture>(Error{scene.path, "TextureFile, but no texture coordinates"});
      if (texture) {
        material.base_color_texture = int(scene.textures.size()), material.base_color = Vec3(1);
        scene.textures.push_back(std::move(*texture));
      } else {
        lost.add(texture.error());
      }
    }
    scene.materials.push_back(std::move(material));
  }
  lost.tell(scene);
}

}  // namespace

Result<Scene> load_ply(std::span<const uint8_t> bytes, const std::string& path, const std::string& folder) {
  auto mesh = read_ply(bytes, path);
  if (!mesh) return mesh.error();
  const std::vector<std::string> textures = std::move(mesh->textures);

  Scene scene;
  scene.path = path;
  const size_t odd = mesh->odd_texcoords;
  const bool in_parts = !mesh->corner_texcoords.empty() || (textures.size() > 1 && !mesh->face_textures.empty());
  LeftOut left_out = in_parts ? add_parts(*mesh, textures.size(), scene) : add_plain_part(*mesh, scene);
  *mesh = {};
  if (auto told = tell_left_out(scene, left_out); !told) return told.error();
  if (odd > 0)
    scene.warnings.push_back(fmt::format("{}: {} faces do not have a texture coordinate a corner", path, odd));
  add_materials(textures, folder, scene);
  leave_colors_to_pictures(scene);
  if (auto finished = finish_mesh(scene); !finished) return finished.error();
  return scene;
}

}  // namespace lambent
