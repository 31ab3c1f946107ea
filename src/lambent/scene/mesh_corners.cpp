// From faces whose corners name positions, texture coordinates and normals apart to parts of plain vertices.
#include <lambent/scene/index_table.h>
#include <lambent/scene/mesh_file.h>
#include <lambent/scene/mesh_text.h>

#include <fmt/format.h>

#include <numeric>

namespace lambent {
namespace {

class Assembler {
 public:
  Assembler(const CornerMesh& mesh, Scene& scene) : mesh_(mesh), scene_(scene) {
    has_texcoords_ = std::any_of(mesh.corners.begin(), mesh.corners.end(), [](MeshCorner c) { return c.vt != none; });
    positions_ = place_positions(scene, mesh.v, mesh.corners.size(), [&](size_t c) { return mesh.corners[c].v; });
  }

  LeftOut assemble() {
    std::vector<std::vector<uint32_t>> faces_of(mesh_.groups.size());
    for (uint32_t f = 0; f < mesh_.faces.size(); ++f) faces_of[mesh_.faces[f].group].push_back(f);
    for (uint32_t g = 0; g < mesh_.groups.size(); ++g) add_part(g, faces_of[g]);
    scene_.input_count = uint32_t(mesh_.v.size());
    return left_out_;
  }

 private:
  void add_part(uint32_t group, const std::vector<uint32_t>& faces) {
    triangles_.clear();
    for (uint32_t f : faces) cut_face(mesh_.faces[f]);

    // Number the distinct corners, then order them.
    IndexTable table(3 * triangles_.size());
    corners_.clear();
    std::vector<uint32_t> number(3 * triangles_.size());
    for (size_t i = 0; i < number.size(); ++i) {
      MeshCorner corner = mesh_.corners[triangles_[i / 3][i % 3]];
      uint64_t hash = hash64(uint64_t(corner.v) << 32 | corner.vt, corner.vn);
      number[i] =
          table.find_or_insert(hash, uint32_t(corners_.size()), [&](uint32_t k) { return corners_[k] == corner; });
      if (number[i] == corners_.size()) corners_.push_back(corner);
    }
    std::vector<uint32_t> order(corners_.size()), place(corners_.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return corners_[a] < corners_[b]; });
    for (uint32_t i = 0; i < order.size(); ++i) place[order[i]] = i;

    Part part;
    part.name = mesh_.groups[group].empty() ? file_stem(scene_.path) : mesh_.groups[group];
    part.material = group;
    part.first_vertex = uint32_t(scene_.positions.size()), part.vertex_count = uint32_t(order.size());
    part.first_triangle = uint32_t(scene_.triangles.size()), part.triangle_count = uint32_t(triangles_.size());
    for (uint32_t i : order) add_vertex(corners_[i]);
    for (size_t t = 0; t < triangles_.size(); ++t) {
      Triangle triangle{{}, uint32_t(scene_.parts.size()), true};
      for (int k = 0; k < 3; ++k) triangle.v[k] = part.first_vertex + place[number[3 * t + size_t(k)]];
      scene_.triangles.push_back(triangle);
    }
    scene_.parts.push_back(std::move(part));
  }

  void add_vertex(MeshCorner c) {
    scene_.positions.push_back(positions_[c.v]), scene_.input.push_back(c.v);
    scene_.normals.push_back(c.vn == none ? Vec3(0) : mesh_.vn[c.vn]);
    if (has_texcoords_) scene_.texcoords[0].push_back(c.vt == none ? Vec2(0) : mesh_.vt[c.vt]);
    if (!mesh_.colors.empty()) scene_.colors.push_back(mesh_.colors[c.v]);
  }

  // Appends the face's triangles as indices of corners.
  void cut_face(const MeshFace& face) {
    polygon_.clear(), cuts_.clear();
    for (size_t c = face.first; c < face.first + face.count; ++c) polygon_.push_back(mesh_.corners[c].v);
    if (std::any_of(polygon_.begin(), polygon_.end(), [&](uint32_t v) { return is_broken(positions_[v]); })) {
      ++left_out_.broken;
      return;
    }
    left_out_.repeated += !triangulator_.cut(polygon_, positions_, cuts_);
    auto corner = [&](uint32_t i) { return uint32_t(face.first) + i; };
    for (auto cut : cuts_) triangles_.push_back({corner(cut[0]), corner(cut[1]), corner(cut[2])});
  }

  const CornerMesh& mesh_;
  Scene& scene_;
  std::vector<Vec3> positions_;
  bool has_texcoords_;
  LeftOut left_out_;
  Triangulator triangulator_;
  std::vector<std::array<uint32_t, 3>> triangles_, cuts_;  // of indices into CornerMesh::corners; into polygon_
  std::vector<uint32_t> polygon_;                          // positions of a face
  std::vector<MeshCorner> corners_;
};

}  // namespace

LeftOut assemble_mesh(const CornerMesh& mesh, Scene& scene) { return Assembler(mesh, scene).assemble(); }

Vec3d far_origin(Vec3d low, Vec3d high) {
  constexpr double far = 100;  // sizes: floats then lose 7 of their 24 bits
  if (!(low.x <= high.x)) return Vec3d(0);
  Vec3d size = high - low, reach = max(-1.0 * low, high);
  double extent = std::max({size.x, size.y, size.z}), farthest = std::max({reach.x, reach.y, reach.z});
  if (!(farthest > far * extent) || extent == 0) return Vec3d(0);
  double step = std::exp2(std::ceil(std::log2(std::max(extent, farthest * 0x1p-23))));
  return round((low + size * 0.5) / step) * step + 0.0;  // no -0
}

Result<void> tell_left_out(Scene& scene, LeftOut left_out) {
  constexpr const char* broken = "use vertices that are not finite or beyond 1e9";
  if (scene.triangles.empty() && left_out.broken > 0)
    return Error{scene.path, fmt::format("no triangles: {} faces {}", left_out.broken, broken)};
  if (left_out.repeated > 0)
    scene.warnings.push_back(fmt::format("{}: {} faces with repeated corners dropped", scene.path, left_out.repeated));
  if (left_out.broken > 0)
    scene.warnings.push_back(fmt::format("{}: {} faces left out: they {}", scene.path, left_out.broken, broken));
  return {};
}

void leave_colors_to_pictures(Scene& scene) {
  size_t whitened = 0;
  for (const Part& part : scene.parts) {
    if (scene.colors.empty() || scene.materials[part.material].base_color_texture < 0) continue;
    auto first = scene.colors.begin() + part.first_vertex;
    std::fill(first, first + part.vertex_count, Vec3(1));
    ++whitened;
  }
  if (whitened == scene.parts.size()) scene.colors.clear();
  if (whitened > 0)
    scene.warnings.push_back(fmt::format("{}: colours at vertices give way to the picture of the surface", scene.path));
}

}  // namespace lambent
