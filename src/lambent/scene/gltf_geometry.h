#pragma once
// Positions and normals of one primitive of one node: morph targets, then skin or node transform.
#include <lambent/scene/gltf_read.h>

namespace lambent {

struct GltfMorph {
  double weight;
  std::optional<GltfAccessor> positions, normals;
};

// POSITION and NORMAL, and those of morph targets: three floats, or small integers by KHR_mesh_quantization. Fails
// otherwise.
bool check_gltf_vector(GltfCheck& check, const GltfAccessor& accessor, const char* name, const GltfWhere& where);

// The targets of weights other than zero, by the node's weights or else the mesh's. The others are checked too, for the
// writer copies them.
bool read_morphs(GltfCheck& check, const GltfDocument& document, size_t node, size_t mesh,
                 const nlohmann::json& primitive, size_t vertex_count, const GltfWhere& where,
                 std::vector<GltfMorph>& morphs);

// Appends the vertices in world space. Normals are unit; zero where the file has none, or broken ones. Fails at places
// that are not finite or beyond max_coordinate.
bool read_vertices(GltfCheck& check, const GltfDocument& document, const nlohmann::json& attributes,
                   const GltfAccessor& positions, const GltfVertices& vertices, const std::vector<GltfMorph>& morphs,
                   const GltfPlacement& placement, const GltfWhere& where, std::vector<Vec3>& out_positions,
                   std::vector<Vec3>& out_normals);

}  // namespace lambent
