#pragma once
#include <lambent/scene/scene.h>

namespace lambent {

// Adds the materials of the given names (those of an OBJ's parts, "" for none) to the scene, with their textures, and
// returns their numbers, one a name. `libraries`: what the mtllib lines say. A library that cannot be had gives a
// warning, names that none defines give one together, and their parts get the default material, of albedo `fallback`.
// So do pictures that cannot be had or
// read. Error: malformed MTL.
Result<std::vector<uint32_t>> load_materials(Scene& scene, const std::vector<std::string>& libraries,
                                             const std::vector<std::string>& names, Vec3 fallback,
                                             const std::string& folder);

}  // namespace lambent
