#pragma once
// The glTF 2.0 container: keeping a document, writing GLB.
#include <lambent/core/file.h>
#include <lambent/core/glb.h>
#include <lambent/scene/scene.h>

#include <nlohmann/json.hpp>

#include <deque>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace lambent {

struct GltfDocument {
  nlohmann::json json;                            // as in the file, less its data URIs
  std::vector<std::span<const uint8_t>> buffers;  // bytes of each buffer: GLB chunk, external file or data URI
  std::vector<std::span<const uint8_t>> images;   // bytes of images given by URI; empty for those in buffer views
  std::vector<int> textures;                      // for each of Scene::textures, the glTF texture that it came from
  std::deque<std::vector<uint8_t>> owned;         // storage behind the spans that is not mapped
  MappedFile mapping;                             // storage behind the rest
};

// As load_gltf, but buffers that lie in the mapping are used in place, not copied; the document keeps the mapping.
Result<Scene> load_gltf(const MappedFile& file, const std::string& path, const std::string& folder);

// A piece of binary data to put into a GLB. `bytes` must outlive the write.
struct GltfBlob {
  std::span<const uint8_t> bytes;
  size_t alignment = 4;  // power of two, of the piece's place in the file
};

// Writes the scene as one self-contained GLB. With a document: the document as it came, its buffers and external images
// embedded, changed parts rewritten (a mesh that several nodes share is copied for the changed node), new parts added
// as nodes; without: nodes, meshes, materials and textures made from the scene. Changed parts that copy document
// vertices (Part::source) keep all their attributes; others lose skin and morph targets and stand in their rest pose.
// On return of the JSON to `extend` (which may be empty), part_nodes[i] and part_primitives[i] say where part i now
// stands; `extend` may edit the JSON (add an extension) and names appended blobs by buffer-view index: blob i becomes
// buffer view first_view + i. The same input gives the same bytes. Errors: more than 4 GiB, a texture without its
// encoded bytes, the disk's.
struct GltfPlaces {
  std::vector<int> part_nodes, part_primitives;
  int first_view = 0;
};
Result<void> save_glb(const std::string& path, const Scene& scene, std::span<const GltfBlob> blobs,
                      const std::function<void(nlohmann::json& document, const GltfPlaces& places)>& extend);

}  // namespace lambent
