// glTF 2.0 specification (ISO/IEC 12113), sections 3.7.2 (meshes, morph targets) and 3.7.3 (skins).
#include <lambent/scene/gltf_geometry.h>

#include <lambent/scene/mesh_file.h>

namespace lambent {

using Json = nlohmann::json;

bool check_gltf_vector(GltfCheck& check, const GltfAccessor& a, const char* name, const GltfWhere& where) {
  if (a.components == 3 && a.type != GltfType::u32) return true;
  return check.fail(where, std::string(name) + " is not three floats or small integers");
}

bool read_morphs(GltfCheck& check, const GltfDocument& document, size_t node, size_t mesh, const Json& primitive,
                 size_t count, const GltfWhere& where, std::vector<GltfMorph>& out) {
  const Json* targets = check.array(primitive, "targets", where);
  if (!targets || targets->empty()) return check.ok();
  const Json& node_json = gltf_item(document.json, "nodes", node);
  bool own = node_json.contains("weights");
  const Json& holder = own ? node_json : gltf_item(document.json, "meshes", mesh);
  std::vector<double> weights(targets->size(), 0.0);
  check.numbers(holder, "weights", weights, own ? GltfWhere{"node", node} : GltfWhere{"mesh", mesh});
  for (size_t t = 0; t < targets->size() && check.ok(); ++t) {
    const Json& target = (*targets)[t];
    if (!target.is_object()) return check.fail(where, "a morph target is not an object");
    GltfMorph morph{weights[t], read_attribute(check, document, target, "POSITION", count, where),
                    read_attribute(check, document, target, "NORMAL", count, where)};
    if (morph.positions && !check_gltf_vector(check, *morph.positions, "a morph target's POSITION", where))
      return false;
    if (morph.normals && !check_gltf_vector(check, *morph.normals, "a morph target's NORMAL", where)) return false;
    for (auto attribute = target.begin(); attribute != target.end(); ++attribute) {
      read_attribute(check, document, target, attribute.key().c_str(), count, where);
    }
    if (morph.weight != 0) out.push_back(std::move(morph));
  }
  return check.ok();
}

namespace {

// Zero stands for broken: repair_normals() finds it. What is unit but for rounding stays as it is, so that a saved
// normal comes back with the same bits.
Vec3 unit_of(Vec3d n) {
  constexpr double rounding = 1e-6;
  double length = lambent::length(n);
  if (!(length > 0) || !std::isfinite(length)) return Vec3(0.0f);
  return Vec3(std::abs(length - 1) < rounding ? n : n / length);
}

}  // namespace

bool read_vertices(GltfCheck& check, const GltfDocument& document, const Json& attributes,
                   const GltfAccessor& positions, const GltfVertices& vertices, const std::vector<GltfMorph>& morphs,
                   const GltfPlacement& placement, const GltfWhere& where, std::vector<Vec3>& out_positions,
                   std::vector<Vec3>& out_normals) {
  auto normals = read_attribute(check, document, attributes, "NORMAL", positions.count, where);
  if (!check.ok() || (normals && !check_gltf_vector(check, *normals, "NORMAL", where))) return false;
  Mat4d world = placement.world;
  Mat3d turn = normal_matrix(world);
  for (size_t k = 0; k < vertices.size(); ++k) {
    const size_t i = vertices[k];
    if (placement.joints) world = placement.at(i), turn = normal_matrix(world);
    Vec3d p = positions.read3(i), n = normals ? normals->read3(i) : Vec3d(0);
    for (const GltfMorph& morph : morphs) {
      if (morph.positions) p += morph.weight * morph.positions->read3(i);
      if (normals && morph.normals) n += morph.weight * morph.normals->read3(i);
    }
    Vec3 position(Vec3d(world * Vec4d(p, 1)));
    if (!is_position(position))
      return check.fail(where, "vertex " + std::to_string(i) + " is not at a finite position or beyond 1e9");
    n = turn * n;
    out_positions.push_back(position);
    out_normals.push_back(unit_of(n));
  }
  return true;
}

}  // namespace lambent
