#pragma once
// The primitives of all shown nodes.
#include <lambent/scene/gltf_read.h>

namespace lambent {

// Appends a part for each, with its vertices in world space and its triangles. With `keep_all`, parts have all vertices
// of their accessors (what was baked counts them), else those that their triangles use. `without_normals`: the parts
// that the document gives none. Fails at what is broken, and where the scene would grow beyond stated limits.
bool read_primitives(GltfCheck& check, const GltfDocument& document, const GltfPose& pose, bool keep_all, Scene& scene,
                     std::vector<size_t>& without_normals);

}  // namespace lambent
