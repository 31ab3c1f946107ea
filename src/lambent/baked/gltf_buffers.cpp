#include <lambent/baked/gltf_buffers.h>

#include <lambent/baked/extension.h>
#include <lambent/core/uri.h>

#include <algorithm>

namespace lambent {

using nlohmann::json;

namespace {

constexpr size_t most_views = 65536;  // of one list
constexpr size_t most_bytes = SIZE_MAX / 4;

const json& list_of(const json& document, const char* key) {
  static const json none = json::array();
  const auto found = document.find(key);
  return found != document.end() && found->is_array() ? *found : none;
}

}  // namespace

Result<GltfBuffers> GltfBuffers::open(const MappedFile& file, const std::string& path, const std::string& folder) {
  if (file.bytes().empty()) return Error{path, "is empty"};
  auto chunks = split_gltf(file.bytes(), path);
  if (!chunks) return chunks.error();
  GltfBuffers out;
  out.chunks_ = std::move(*chunks), out.file_ = file, out.folder_ = folder;
  out.buffers_.resize(list_of(out.json(), "buffers").size());
  return out;
}

size_t GltfBuffers::room() const {
  size_t sum = chunks_.binary.size();
  for (const nlohmann::json& buffer : list_of(json(), "buffers"))
    if (auto bytes = read_count(buffer, "byteLength", most_bytes, ""); bytes && buffer.contains("uri"))
      sum = std::min(sum + *bytes, most_bytes);
  return sum;
}

Result<const GltfBuffers::Buffer*> GltfBuffers::buffer(size_t index, const std::string& where) const {
  std::optional<Buffer>& known = buffers_[index];
  if (known) return &*known;
  const nlohmann::json& object = list_of(json(), "buffers")[index];
  const std::string place = where + ": buffer " + std::to_string(index);
  auto length = read_count(object, "byteLength", most_bytes, place);
  if (!length) return length.error();
  const auto uri = object.find("uri");
  Buffer found;
  if (uri == object.end()) {
    if (index != 0 || !chunks_.binary.data()) return Error{place, "has no bytes: neither a uri nor a GLB chunk"};
    found = {chunks_.binary, file_, {}};  // the chunk is padded, and may be longer
  } else if (!uri->is_string()) {
    return Error{place, "uri is not a string"};
  } else if (const std::string text = uri->get<std::string>(); is_data_uri(text)) {
    auto bytes = decode_data_uri(text, place);
    if (!bytes) return bytes.error();
    found.file = MappedFile::copy_of(*bytes);
    found.bytes = found.file.bytes();
  } else {
    auto path = find_external_file(text, folder_, place);
    if (!path) return path.error();
    auto mapped = MappedFile::open(*path);
    if (!mapped) return Error{place, in_quotes(text) + " cannot be read: " + mapped.error().message};
    found = {mapped->bytes(), *mapped, *path};
  }
  if (found.bytes.size() < *length)
    return Error{
        place, "is truncated: has " + std::to_string(found.bytes.size()) + " of " + std::to_string(*length) + " bytes"};
  if (uri != object.end()) found.bytes = found.bytes.first(*length);
  known = std::move(found);
  return &*known;
}

Result<GltfBuffers::Claim> GltfBuffers::claim(const nlohmann::json& number, const std::string& where) const {
  const nlohmann::json& views = list_of(json(), "bufferViews");
  if (!number.is_number_unsigned()) return Error{where, "a buffer view is not a number from 0 on"};
  const std::string place = where + ": buffer view " + number.dump();
  if (number.get<uint64_t>() >= views.size()) return Error{place, "does not exist"};
  const nlohmann::json& view = views[number.get<size_t>()];
  if (buffers_.empty()) return Error{place, "names no buffer"};
  auto index = read_count(view, "buffer", buffers_.size() - 1, place);
  if (!index) return index.error();
  auto bytes = buffer(*index, where);
  if (!bytes) return bytes.error();
  Claim out{*index};
  const size_t whole = (*bytes)->bytes.size();
  if (view.contains("byteOffset")) {
    auto given = read_count(view, "byteOffset", whole, place);
    if (!given) return given.error();
    out.offset = *given;
  }
  auto length = read_count(view, "byteLength", whole - out.offset, place);
  if (!length) return length.error();
  out.length = *length;
  return out;
}

Result<ViewBytes> GltfBuffers::view(const nlohmann::json& view, const std::string& where) const {
  if (!view.is_array()) {
    auto one = claim(view, where);
    if (!one) return one.error();
    const Buffer& buffer = *buffers_[one->buffer];
    return ViewBytes{buffer.bytes.subspan(one->offset, one->length), buffer.file};
  }
  if (view.empty() || view.size() > most_views) return Error{where, "a list of buffer views is empty or too long"};
  std::vector<Claim> claims;
  for (const nlohmann::json& number : view) {
    auto one = claim(number, where);
    if (!one) return one.error();
    claims.push_back(*one);
  }
  std::vector<Claim> sorted = claims;
  std::sort(sorted.begin(), sorted.end(), [](const Claim& a, const Claim& b) {
    return std::pair(a.buffer, a.offset) < std::pair(b.buffer, b.offset);
  });
  for (size_t i = 1; i < sorted.size(); ++i)
    if (sorted[i].buffer == sorted[i - 1].buffer && sorted[i].offset < sorted[i - 1].offset + sorted[i - 1].length)
      return Error{where, "buffer views of one list overlap"};
  return joined(claims, where);
}

Result<ViewBytes> GltfBuffers::joined(std::span<const Claim> claims, const std::string& where) const {
  std::vector<MappedFile::Part> parts;
  bool files = true;
  for (const Claim& c : claims) {
    parts.push_back({buffers_[c.buffer]->path, c.offset, c.length});
    files = files && !parts.back().path.empty();
  }
  if (files) {
    auto mapped = MappedFile::open_parts(parts);
    if (!mapped) return Error{where, mapped.error().text()};
    return ViewBytes{mapped->bytes(), *mapped};
  }
  std::vector<uint8_t> all;
  for (const Claim& c : claims) {
    const auto bytes = buffers_[c.buffer]->bytes.subspan(c.offset, c.length);
    all.insert(all.end(), bytes.begin(), bytes.end());
  }
  const MappedFile copy = MappedFile::copy_of(all);
  return ViewBytes{copy.bytes(), copy};
}

}  // namespace lambent
