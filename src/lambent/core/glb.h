#pragma once
// The container of glTF 2.0 as bytes: JSON and one binary chunk.
#include <lambent/core/result.h>

#include <nlohmann/json.hpp>

#include <cstdint>
#include <span>
#include <string>

namespace lambent {

struct GltfChunks {
  nlohmann::json json;
  std::span<const uint8_t> binary;
};
// Splits GLB (or plain .gltf) bytes into JSON and the binary chunk. Errors: not glTF, version not 2, truncated, lengths
// that do not fit, JSON that does not parse or nests deeper than 64.
Result<GltfChunks> split_gltf(std::span<const uint8_t> bytes, const std::string& path);

}  // namespace lambent
