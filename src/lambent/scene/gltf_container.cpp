// glTF 2.0 specification (ISO/IEC 12113), section 4 (GLB); RFC 3986 (percent-encoding); RFC 2397 and 4648 (data URIs,
// base64).
#include <lambent/scene/gltf_container.h>

#include <lambent/core/file.h>
#include <lambent/scene/gltf.h>
#include <lambent/scene/load.h>

#include <algorithm>
#include <filesystem>

namespace lambent {

using Json = nlohmann::json;

namespace {

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

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

// A "%" that starts no escape stands for itself.
std::string percent_decode(const std::string& text) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    int high = -1, low = -1;
    if (text[i] == '%' && i + 2 < text.size()) high = hex_digit(text[i + 1]), low = hex_digit(text[i + 2]);
    if (high >= 0 && low >= 0) {
      out += char(high * 16 + low), i += 2;
    } else {
      out += text[i];
    }
  }
  return out;
}

// "http:", "file:", "C:" and the like.
bool has_scheme(const std::string& uri) {
  size_t colon = uri.find(':');
  if (colon == std::string::npos || colon == 0) return false;
  return uri.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789+-.") == colon;
}

int base64_digit(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  return c == '+' ? 62 : c == '/' ? 63 : -1;
}

// False for characters outside the alphabet, wrong lengths, and padding elsewhere than at the end.
bool base64_decode(std::string_view text, std::vector<uint8_t>& out) {
  size_t padding = 0;
  while (padding < 2 && !text.empty() && text.back() == '=') text.remove_suffix(1), ++padding;
  if (text.size() % 4 == 1 || (padding && (text.size() + padding) % 4 != 0)) return false;
  out.reserve(text.size() / 4 * 3 + 2);
  uint32_t bits = 0;
  int held = 0;
  for (char c : text) {
    int digit = base64_digit(c);
    if (digit < 0) return false;
    bits = bits << 6 | uint32_t(digit), held += 6;
    if (held >= 8) held -= 8, out.push_back(uint8_t(bits >> held));
  }
  return true;
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

std::string in_quotes(const std::string& text) {
  constexpr size_t longest = 120;
  std::string out = "\"" + text.substr(0, longest);
  std::replace_if(
      out.begin(), out.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return out + (text.size() > longest ? "...\"" : "\"");
}

bool is_data_uri(const std::string& uri) { return uri.starts_with("data:"); }

Result<std::vector<uint8_t>> decode_data_uri(const std::string& uri, const std::string& where, std::string* mime_type) {
  constexpr size_t scheme_size = 5;  // "data:"
  constexpr std::string_view marker = ";base64";
  size_t comma = uri.find(',');
  if (comma == std::string::npos) return Error{where, "data URI has no comma"};
  std::string_view head = std::string_view(uri).substr(scheme_size, comma - scheme_size);
  if (!head.ends_with(marker)) return Error{where, "data URI is not base64"};
  if (mime_type) *mime_type = std::string(head.substr(0, head.find(';')));
  std::vector<uint8_t> bytes;
  if (!base64_decode(std::string_view(uri).substr(comma + 1), bytes))
    return Error{where, "data URI holds broken base64"};
  return bytes;
}

Result<std::vector<uint8_t>> read_external_file(const std::string& uri, const std::string& folder,
                                                const std::string& referrer) {
  namespace fs = std::filesystem;
  auto refuse = [&](const std::string& why) { return Error{referrer, in_quotes(uri) + " " + why}; };
  if (folder.empty()) return refuse("is an external file, which is not allowed here");
  if (has_scheme(uri)) return refuse("is not a relative path");
  std::string name = percent_decode(uri);
  std::replace(name.begin(), name.end(), '\\', '/');
  if (name.empty() || name.find('\0') != std::string::npos) return refuse("is not a file name");
  if (name.front() == '/' || has_scheme(name)) return refuse("is not a relative path");
  for (const fs::path& step : fs::path(name)) {
    if (step == "..") return refuse("lies outside the scene's folder");
  }
  std::error_code failed;
  fs::path inside = fs::canonical(folder, failed);
  if (failed) return refuse("cannot be read: " + failed.message());
  fs::path file = fs::canonical(fs::path(folder) / name, failed);
  if (failed == std::errc::no_such_file_or_directory) return refuse("was not found");
  if (failed) return refuse("cannot be read: " + failed.message());
  // Both are free of links now: the file is inside if its path begins with all steps of the folder's.
  if (std::mismatch(inside.begin(), inside.end(), file.begin(), file.end()).first != inside.end()) {
    return refuse("leads outside the scene's folder");
  }
  auto bytes = read_file(file.string());
  if (!bytes) return refuse("cannot be read: " + bytes.error().message);
  return bytes;
}

}  // namespace lambent
