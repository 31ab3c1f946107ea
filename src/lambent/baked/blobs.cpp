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

void resolve_views(json& value, std::span<const std::vector<int>> views) {
  if (value.is_object() && value.size() == 1 && value.contains(view_key)) {
    const std::vector<int>& numbers = views[value[view_key].get<size_t>()];
    value = numbers.size() == 1 ? json(numbers[0]) : json(numbers);
  } else if (value.is_structured()) {
    for (json& item : value) resolve_views(item, views);
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

Result<ViewBytes> read_view(const BlobReader& in, const json& object, const char* key, const std::string& where) {
  const auto it = object.is_object() ? object.find(key) : object.end();
  if (!object.is_object() || it == object.end() || !(it->is_number_unsigned() || it->is_array()))
    return Error{where, std::string("\"") + key + "\" is missing or out of range"};
  return in.buffers.view(*it, where);
}

}  // namespace lambent
