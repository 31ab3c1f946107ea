#pragma once
// What a baked file holds beside its scene, read without it: the surface's field, others beside it, and whose vertices
// they are. This is all that an engine needs to relight; the format is in docs/file-format.md.
#include <lambent/core/file.h>
#include <lambent/transfer/field.h>

namespace lambent {

// The version that is written, and the only one that is read.
inline constexpr int baked_file_version = 1;

// One triangle primitive of one node: its run of the placement's vertices (of patches, triangles).
struct BakedPart {
  int node = -1, primitive = -1;
  size_t first = 0, count = 0;
};

// All of a baked file but its scene.
struct BakedFields {
  Field surface;
  std::vector<BakedPart> parts;  // runs of the placement's vertices (of patches, triangles); none of a fixed view
  std::vector<Field> more;       // for the same light: light in free space, where it was baked
  // Terms of the surface's Neumann series, one by one, where they were kept: light that has met k surfaces between lamp
  // and receiver, k = 0, 1, ...; placed and meant as the surface's. Their sum is the surface's store.
  std::vector<Transfer> terms;
  std::vector<std::string> excluded;  // parts that were left out of the bake, as it was asked for
  std::string provenance = "{}";  // JSON text: the request, inputs and their hashes, version, what the bake reported
};

// Data are read in place and keep the mapping alive; the .bin files of a .gltf are looked up beside `path`. Errors: not
// a baked file, another version, anything that does not fit or is not there; all in one line that names the file.
Result<BakedFields> read_fields(const MappedFile& file, const std::string& path);
Result<BakedFields> read_fields(const std::string& path);

}  // namespace lambent
