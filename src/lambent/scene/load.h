#pragma once
#include <lambent/scene/scene.h>

#include <span>

namespace lambent {

// Loads .gltf, .glb, .obj (with its .mtl) or .ply, chosen by extension, validates and cleans it:
//   - every index, count, offset and number is checked; a file without a usable triangle is an error, and so are NaN
//   and infinite positions in glTF; in OBJ and PLY, faces that use such vertices are left out and counted in a warning;
//   - missing or broken normals are computed (make_normals in clean.h);
//   - exact duplicate triangles are dropped, and coincident opposite ones marked two-sided;
//   - OBJ and PLY carry no sidedness: a connected component that is closed and faces outward is one-sided, others
//   two-sided;
//   - coordinates far from 0 count from Scene::origin.
// External buffers and images must lie inside the scene file's folder.
Result<Scene> load_scene(const std::string& path);

// The loaders behind it, from bytes, for tests and fuzzers. `path` names the file in messages; `folder` is where
// external files are looked up, and an empty folder refuses all of them.
Result<Scene> load_gltf(std::span<const uint8_t> bytes, const std::string& path, const std::string& folder);
Result<Scene> load_obj(std::span<const uint8_t> bytes, const std::string& path, const std::string& folder);
Result<Scene> load_ply(std::span<const uint8_t> bytes, const std::string& path, const std::string& folder = {});

}  // namespace lambent
