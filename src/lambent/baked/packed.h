#pragma once
// Baked files as they travel to a browser: buffer views whose numbers are rounded to a stated error, told from what is
// near them, and coded by how often they are there (docs/file-format.md, "Packed for a browser").
#include <lambent/core/result.h>

#include <cstdint>
#include <span>
#include <string>

namespace lambent {

struct PackedFile {
  std::string bytes;  // GLB
  float error = 0;    // of the transfer as it was rounded, relative RMS
};
// `bytes` is a baked .glb of dense transfer. Its transfer is rounded so that the relative RMS error is about `error`
// (0.00001 to 0.1), positions of vertices to a 65,536th of the scene's largest coordinate or less, normals to 1/2,048,
// texture coordinates to 1/65,536; integers stay as they are. Errors: a .gltf; views in other files or compressed;
// transfer of other stores, or that is not finite; another `error`.
Result<PackedFile> pack_baked(std::span<const uint8_t> bytes, float error, const std::string& path);

// A quarter of the error that the bake measured, 0.005 at most and where it measured none.
float default_packing_error(std::span<const uint8_t> bytes, const std::string& path);

}  // namespace lambent
