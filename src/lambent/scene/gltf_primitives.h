#pragma once
// The primitives of all shown nodes.
#include <lambent/scene/gltf_read.h>

namespace lambent {

// Appends a part for each, with its vertices in world space and its triangles. With `keep_all`, parts have all vertices
// of their accessors (what was baked counts them), else those that their triangles use. Primitives without normals get
// flat ones, and their vertices that are alike become one (gltf_flat.h). Numbers the inputs. Fails at what is broken,
// and where the scene would grow beyond stated limits.
bool read_primitives(GltfCheck& check, const GltfDocument& document, const GltfPose& pose, bool keep_all, Scene& scene);

}  // namespace lambent
