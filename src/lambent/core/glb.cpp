// glTF 2.0 specification (ISO/IEC 12113), section 4 (GLB).
#include <lambent/core/glb.h>

namespace lambent {
namespace {

using Json = nlohmann::json;

constexpr uint32_t glb_magic = 0x46546c67, json_chunk = 0x4e4f534a, bin_chunk = 0x004e4942;
constexpr size_t glb_header_size = 12, chunk_header_size = 8;
constexpr int max_depth = 64;

uint32_t load_u32(std::span<const uint8_t> bytes, size_t at) {
  return uint32_t(bytes[at]) | uint32_t(bytes[at + 1]) << 8 | uint32_t(bytes[at + 2]) << 16 |
         uint32_t(bytes[at + 3]) << 24;
}

// Whether the text nests so deep that working on it recursively could overflow the stack.
bool nests_too_deep(std::span<const uint8_t> text) {
  int depth = 0;
  bool in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    uint8_t c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '{' || c == '[') {
      if (++depth > max_depth) return true;
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return false;
}

Result<Json> parse_json(std::span<const uint8_t> text, const std::string& path) {
  if (nests_too_deep(text)) return Error{path, "JSON nests deeper than " + std::to_string(max_depth)};
  Json json = Json::parse(text.begin(), text.end(), nullptr, false);
  if (json.is_discarded()) return Error{path, "JSON does not parse"};
  if (!json.is_object()) return Error{path, "not glTF: the JSON is not an object"};
  return json;
}

}  // namespace

Result<GltfChunks> split_gltf(std::span<const uint8_t> bytes, const std::string& path) {
  GltfChunks chunks;
  if (bytes.size() < 4 || load_u32(bytes, 0) != glb_magic) {
    if (bytes.empty()) return Error{path, "is empty"};
    auto json = parse_json(bytes, path);
    if (!json) return json.error();
    chunks.json = std::move(*json);
    return chunks;
  }
  if (bytes.size() < glb_header_size + chunk_header_size) return Error{path, "truncated"};
  uint32_t version = load_u32(bytes, 4), length = load_u32(bytes, 8);
  if (version != 2) return Error{path, "GLB version " + std::to_string(version) + " is not supported, only 2"};
  if (length > bytes.size()) {
    return Error{path, "truncated: has " + std::to_string(bytes.size()) + " of " + std::to_string(length) + " bytes"};
  }
  if (length < glb_header_size + chunk_header_size)
    return Error{path, "the GLB header gives a length too small for it"};
  bytes = bytes.first(length);
  bool have_json = false, have_binary = false;
  size_t at = glb_header_size;
  while (bytes.size() - at >= chunk_header_size) {
    uint32_t size = load_u32(bytes, at), type = load_u32(bytes, at + 4);
    at += chunk_header_size;
    if (size > bytes.size() - at) return Error{path, "a GLB chunk reaches past the end of the file"};
    std::span<const uint8_t> data = bytes.subspan(at, size);
    at += size;
    if (!have_json) {
      if (type != json_chunk) return Error{path, "the first GLB chunk is not JSON"};
      auto json = parse_json(data, path);
      if (!json) return json.error();
      chunks.json = std::move(*json), have_json = true;
    } else if (type == bin_chunk && !have_binary) {
      chunks.binary = data, have_binary = true;
    }  // chunks of unknown types are to be ignored
  }
  if (at != bytes.size()) return Error{path, "ends in the middle of a GLB chunk header"};
  return chunks;
}

}  // namespace lambent
