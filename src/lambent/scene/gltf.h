#pragma once
// The glTF 2.0 container: keeping a document, writing one.
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
  MappedFile mapping;                             // storage behind the rest: the document's file
  std::vector<MappedFile> files;                  // and those that it names
};

// As load_gltf, but buffers that lie in the mapping are used in place, not copied; the document keeps the mapping.
Result<Scene> load_gltf(const MappedFile& file, const std::string& path, const std::string& folder);

// A piece of binary data to put into a glTF. `bytes` must outlive the write.
struct GltfBlob {
  std::span<const uint8_t> bytes;
  size_t alignment = 4;    // power of two, of the piece's place in its file
  bool may_split = false;  // into views of several .bin files, where it is too long for one
};

// Pieces of split data are whole multiples of this, and begin at one in their files: so any system can map them side by
// side.
inline constexpr size_t split_alignment = 65536;

// Writes the scene as a self-contained GLB or, where `path` ends in .gltf, as JSON with its binary data in NAME.0.bin,
// NAME.1.bin, ... beside it, each of at most `bin_limit` bytes (>= split_alignment); all of them appear together, and
// those of the file that they replace go. With a document: the document as it came, its buffers and external images
// embedded, changed parts rewritten (a mesh that several nodes share is copied for the changed node), new parts added
// as nodes; without: nodes, meshes, materials and textures made from the scene. Changed parts that copy document
// vertices (Part::source) keep all their attributes; others lose skin and morph targets and stand in their rest pose.
// On return of the JSON to `extend` (which may be empty), part_nodes[i] and part_primitives[i] say where part i now
// stands; `extend` may edit the JSON (add an extension) and names appended blobs by buffer-view index: blob i becomes
// buffer views views[i], one unless it was split. The same input gives the same bytes. Errors: a GLB of more than
// 4 GiB, a texture without its encoded bytes, the disk's.
struct GltfPlaces {
  std::vector<int> part_nodes, part_primitives;
  std::vector<std::vector<int>> views;
};
Result<void> save_gltf(const std::string& path, const Scene& scene, std::span<const GltfBlob> blobs,
                       const std::function<void(nlohmann::json& document, const GltfPlaces& places)>& extend,
                       size_t bin_limit = size_t{1} << 30);

}  // namespace lambent
