#pragma once
// EXT_mesh_gpu_instancing, spelled out: a mesh drawn many times by one node becomes as many nodes.
#include <lambent/scene/gltf_read.h>

namespace lambent {

// Takes the mesh of every node with the extension to new children of it, one an instance, which stand where
// TRANSLATION, ROTATION and SCALE say, and takes the extension out. Animations of the node's weights move all of them.
// A node with a skin stays as it is, shown once: skins do not heed transforms. What is not read goes into `warnings`.
// Fails at attributes that are broken or do not fit, and beyond 2^20 instances.
bool expand_instances(GltfCheck& check, GltfDocument& document, std::vector<std::string>& warnings);

}  // namespace lambent
