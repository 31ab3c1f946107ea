#pragma once
// Geometry that a glTF document holds compressed. It is decoded when a document is read, into buffers of the document's
// own, so that all who come after, the writer too, see plain glTF and files that are written need no decoder.
#include <lambent/scene/gltf_read.h>

namespace lambent {

// What decoding may still add to a document, in bytes. At first: 512 MiB and 256 for each byte of its buffers, in all
// no more than 4 GiB. Asked before memory is taken.
class DecodeBudget {
 public:
  explicit DecodeBudget(const GltfDocument& document);
  bool take(uint64_t bytes);  // false, and nothing taken, where too little is left

 private:
  uint64_t left_;
};

// EXT_meshopt_compression and KHR_meshopt_compression (version 0 of the attribute codec): compressed buffer views
// become plain ones. Views whose stream is of a kind that is not read stay the fallback that they say they are, if
// there are bytes for it; else they are refused by name. Before anything reads a view.
bool decode_meshopt_views(GltfCheck& check, GltfDocument& document, DecodeBudget& budget);
// Whether a buffer has bytes only for readers that know nothing of these extensions; it need not have any.
bool is_fallback_buffer(const nlohmann::json& buffer);

// KHR_draco_mesh_compression: primitives get accessors of their decoded attributes and indices.
bool decode_draco_primitives(GltfCheck& check, GltfDocument& document, DecodeBudget& budget);

// A buffer of the document, of decoded bytes; gives its number.
size_t add_buffer(GltfDocument& document, std::vector<uint8_t> bytes);

}  // namespace lambent
