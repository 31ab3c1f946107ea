#pragma once
// Primitives without normals, which glTF shows flat.
#include <lambent/scene/gltf_read.h>

namespace lambent {

// Gives the scene's last part, whose arrays are the ends of the scene's, flat normals (make_normals in clean.h), which
// splits vertices at edges. With `attributes`, what each of the document's vertices has but for normals and tangents,
// vertices that are alike in all of these and in their normals then become one, so that a file that names every corner
// apart has no more vertices than one that shares them. Returns how many of the document's vertices are left.
size_t flatten_last_part(Scene& scene, std::span<const GltfAccessor> attributes);

}  // namespace lambent
