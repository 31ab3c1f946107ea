#include <lambent/baked/extension.h>

#include <algorithm>
#include <cmath>

namespace lambent {

using nlohmann::json;

namespace {

constexpr const char* view_key = "$view";

}  // namespace

json BlobWriter::add(std::span<const uint8_t> bytes, size_t alignment) {
  blobs.push_back({bytes, alignment});
  return {{view_key, blobs.size() - 1}};
}

void resolve_views(json& value, int first_view) {
  if (value.is_object() && value.size() == 1 && value.contains(view_key)) {
    value = first_view + value[view_key].get<int>();
  } else if (value.is_structured()) {
    for (json& item : value) resolve_views(item, first_view);
  }
}

Result<size_t> read_count(const json& object, const char* key, size_t limit, const std::string& where) {
  const auto it = object.is_object() ? object.find(key) : object.end();
  if (!object.is_object() || it == object.end() || !it->is_number_unsigned() || it->get<uint64_t>() > limit)
    return Error{where, std::string("\"") + key + "\" is missing or out of range"};
  return it->get<size_t>();
}

Result<std::vector<float>> read_numbers(const json& object, const char* key, size_t count, const std::string& where) {
  const auto list = object.find(key);
  const auto fits = [](const json& x) { return x.is_number() && std::abs(x.get<double>()) <= 1e9; };
  if (list == object.end() || !list->is_array() || list->size() != count ||
      !std::all_of(list->begin(), list->end(), fits))
    return Error{where,
                 "\"" + std::string(key) + "\" is not a list of " + std::to_string(count) + " numbers within 1e9"};
  return list->get<std::vector<float>>();
}

Result<std::span<const uint8_t>> view_bytes(const BlobReader& in, size_t index, const std::string& where) {
  const json& document = in.chunks.json;
  const size_t whole = in.chunks.binary.size();
  const std::string place = where + ": buffer view " + std::to_string(index);
  if (!document.contains("bufferViews") || !document["bufferViews"].is_array() ||
      index >= document["bufferViews"].size())
    return Error{place, "does not exist"};
  const json& view = document["bufferViews"][index];
  auto buffer = read_count(view, "buffer", 0, place);
  if (!buffer) return buffer.error();
  size_t offset = 0;
  if (view.contains("byteOffset")) {
    auto given = read_count(view, "byteOffset", whole, place);
    if (!given) return given.error();
    offset = *given;
  }
  auto length = read_count(view, "byteLength", whole - offset, place);
  if (!length) return length.error();
  return in.chunks.binary.subspan(offset, *length);
}

}  // namespace lambent
