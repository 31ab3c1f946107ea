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

// EXT_meshopt_compression and KHR_meshopt_compression: compressed buffer views become plain ones. Views whose stream is
// of a version or has a filter that is not known stay the fallback that they are, if there are bytes for it; else they
// are refused by name. Before anything reads a view.
bool decode_meshopt_views(GltfCheck& check, GltfDocument& document, DecodeBudget& budget);
// The buffers that may have no bytes, or not all: those that say that they are fallbacks, or that compressed views
// stand in.
std::vector<bool> find_placeholders(const GltfDocument& document);

// KHR_draco_mesh_compression: primitives get accessors of their decoded attributes and indices.
bool decode_draco_primitives(GltfCheck& check, GltfDocument& document, DecodeBudget& budget);

// A buffer of the document, of decoded bytes; gives its number.
size_t add_buffer(GltfDocument& document, std::vector<uint8_t> bytes);

}  // namespace lambent
