#pragma once
// Materials and colour textures of a glTF document.
#include <lambent/scene/gltf_read.h>

namespace lambent {

// A reference of a material to a glTF texture.
struct GltfTextureUse {
  std::optional<size_t> texture;
  uint64_t texcoord_set = 0;  // that the document asks for
  std::array<float, 6> transform{1, 0, 0, 0, 1, 0};
};

struct GltfMaterial {
  Material material;  // its textures not set yet
  GltfTextureUse base_color, metallic_roughness, normal, emissive, transmission;
  bool known_alpha_mode = true;
  bool bends_light = false;  // asks for what straight light through thin surfaces leaves out
};

// All of the document's materials, in its order.
std::vector<GltfMaterial> read_materials(GltfCheck& check, const GltfDocument& document);

// Decodes the images of the materials that `used` marks into scene.textures, each once, and sets the textures of
// scene.materials, whose first ones are the document's. `image_problems` says for each image why its file could not be
// read (empty: it could).
bool read_textures(GltfCheck& check, GltfDocument& document, const std::vector<GltfMaterial>& materials,
                   const std::vector<bool>& used, const std::vector<std::string>& image_problems, Scene& scene);

}  // namespace lambent
