#pragma once
// Materials and colour textures of a glTF document.
#include <lambent/scene/gltf_read.h>

namespace lambent {

struct GltfMaterial {
  Material material;  // its texture not set yet
  std::optional<size_t> texture;  // glTF texture of the base colour
  uint64_t texcoord_set = 0;      // that the document asks for
  bool opaque = true, emissive_texture = false;
};

// All of the document's materials, in its order.
std::vector<GltfMaterial> read_materials(GltfCheck& check, const GltfDocument& document);

// Decodes the base colour images of the materials that `used` marks into scene.textures, each once, and sets the texture of
// scene.materials, whose first ones are the document's. `image_problems` says for each image why its file could not be read
// (empty: it could).
bool read_textures(GltfCheck& check, GltfDocument& document, const std::vector<GltfMaterial>& materials,
                   const std::vector<bool>& used, const std::vector<std::string>& image_problems, Scene& scene);

}  // namespace lambent
