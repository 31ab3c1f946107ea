// glTF 2.0 specification (ISO/IEC 12113), sections 3.6.1 (buffers and views) and 4 (GLB).
#include <lambent/scene/gltf_write.h>

#include <lambent/core/check.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <type_traits>

namespace lambent {

using Json = nlohmann::json;

namespace {

constexpr int array_buffer = 34962, element_array_buffer = 34963;

size_t round_up(size_t value, size_t multiple) { return (value + multiple - 1) / multiple * multiple; }

void put_u32(std::vector<uint8_t>& out, uint32_t value) {
  for (int shift = 0; shift < 32; shift += 8) out.push_back(uint8_t(value >> shift));
}

template <class T>
std::vector<uint8_t> bytes_of(std::span<const T> values) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::vector<uint8_t> bytes(values.size_bytes());
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

// Writes "min" and "max" of the components, unless one is not finite, for which JSON has no word.
template <class Component>
void add_bounds(Json& accessor, size_t count, int components, Component component) {
  std::vector<double> low(size_t(components), INFINITY), high(size_t(components), -INFINITY);
  for (size_t i = 0; i < count; ++i) {
    for (int c = 0; c < components; ++c) {
      double x = component(i, c);
      if (!std::isfinite(x)) return;
      low[size_t(c)] = std::min(low[size_t(c)], x), high[size_t(c)] = std::max(high[size_t(c)], x);
    }
  }
  accessor["min"] = low, accessor["max"] = high;
}

}  // namespace

Json& GltfWriter::list(const char* key) {
  Json& value = json[key];
  if (!value.is_array()) value = Json::array();
  return value;
}

size_t GltfWriter::push(const char* key, Json item) {
  Json& items = list(key);
  items.push_back(std::move(item));
  return items.size() - 1;
}

void GltfWriter::use_extension(const char* name, bool required) {
  for (const char* key : {"extensionsUsed", "extensionsRequired"}) {
    if (key == std::string_view("extensionsRequired") && !required) break;
    Json& names = list(key);
    if (std::find(names.begin(), names.end(), Json(name)) == names.end()) names.push_back(name);
  }
}

size_t GltfWriter::append(std::span<const uint8_t> bytes, size_t alignment) {
  LAMBENT_CHECK(std::has_single_bit(alignment));
  size_t offset = round_up(size_, alignment);
  pieces_.push_back({offset, bytes, alignment});
  size_ = offset + bytes.size();
  alignment_ = std::max(alignment_, alignment);
  return offset;
}

std::span<const uint8_t> GltfWriter::keep(std::vector<uint8_t> bytes) {
  kept_.push_back(std::move(bytes));
  return kept_.back();
}

size_t GltfWriter::add_view(std::span<const uint8_t> bytes, size_t alignment) {
  size_t offset = append(bytes, alignment);
  return push("bufferViews", {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes.size()}});
}

std::vector<int> GltfWriter::add_views(std::span<const uint8_t> bytes, size_t alignment, size_t most) {
  if (most == 0 || bytes.size() <= most) return {int(add_view(bytes, alignment))};
  std::vector<int> views;
  for (size_t at = 0; at < bytes.size(); at += most)
    views.push_back(int(add_view(bytes.subspan(at, std::min(most, bytes.size() - at)), split_alignment)));
  return views;
}

size_t GltfWriter::add_accessor(Json accessor, std::vector<uint8_t> bytes, int target, size_t stride) {
  const std::string key = content_hash(bytes) + accessor.dump() + std::to_string(target) + "," + std::to_string(stride);
  const auto known = known_.find(key);
  if (known != known_.end()) return known->second;
  accessor["bufferView"] = add_view(keep(std::move(bytes)), 4);
  Json& view = list("bufferViews").back();
  view["target"] = target;
  if (stride) view["byteStride"] = stride;
  return known_[key] = push("accessors", std::move(accessor));
}

size_t GltfWriter::add_vectors(std::span<const float> values, int components, bool with_bounds) {
  const size_t count = values.size() / size_t(components);
  Json accessor = {
      {"componentType", int(GltfType::f32)}, {"count", count}, {"type", "VEC" + std::to_string(components)}};
  if (with_bounds) {
    add_bounds(accessor, count, components,
               [&](size_t i, int c) { return double(values[i * size_t(components) + size_t(c)]); });
  }
  return add_accessor(std::move(accessor), bytes_of(values), array_buffer, 0);
}

size_t GltfWriter::add_indices(std::span<const uint32_t> indices) {
  return add_accessor({{"componentType", int(GltfType::u32)}, {"count", indices.size()}, {"type", "SCALAR"}},
                      bytes_of(indices), element_array_buffer, 0);
}

size_t GltfWriter::add_copy(const GltfAccessor& from, std::span<const uint32_t> source, bool with_bounds) {
  const size_t stride = round_up(from.element_size, 4);  // vertex attributes begin at multiples of four
  std::vector<uint8_t> bytes(source.size() * stride);
  for (size_t i = 0; i < source.size(); ++i) {
    LAMBENT_CHECK(source[i] < from.count);
    if (const uint8_t* element = from.element(source[i]))
      std::memcpy(bytes.data() + i * stride, element, from.element_size);
  }
  Json accessor = {{"componentType", int(from.type)}, {"count", source.size()}, {"type", from.shape}};
  if (from.normalized) accessor["normalized"] = true;
  if (with_bounds) {
    add_bounds(accessor, source.size(), from.components,
               [&](size_t i, int c) { return from.component(from.element(source[i]), c); });
  }
  return add_accessor(std::move(accessor), std::move(bytes), array_buffer, stride != from.element_size ? stride : 0);
}

Result<std::string> GltfWriter::text(const std::string& path) const {
  try {
    return json.dump(-1, ' ', false, Json::error_handler_t::replace);
  } catch (const std::exception& e) {
    return Error{path, std::string("its JSON cannot be written: ") + e.what()};
  }
}

Result<void> GltfWriter::write(const std::string& path) const {
  return file_extension(path) == "gltf" ? write_bins(path) : write_glb(path);
}

Result<void> GltfWriter::write_glb(const std::string& path) const {
  constexpr uint32_t magic = 0x46546c67, version = 2, json_type = 0x4e4f534a, bin_type = 0x004e4942;
  constexpr size_t header_size = 12, chunk_header_size = 8;
  auto dumped = text(path);
  if (!dumped) return dumped.error();
  std::string& text = *dumped;
  const bool has_binary = size_ > 0;
  // Spaces after the JSON bring the binary data to a multiple of the largest alignment in the file.
  const size_t json_at = header_size + chunk_header_size, bin_header = has_binary ? chunk_header_size : 0;
  const size_t json_end = round_up(json_at + text.size() + bin_header, has_binary ? alignment_ : 4) - bin_header;
  text.resize(json_end - json_at, ' ');
  const size_t binary_size = round_up(size_, 4), total = json_end + bin_header + binary_size;
  if (total > UINT32_MAX)
    return Error{path, "would be larger than 4 GiB, which a .glb cannot be: write a .gltf, whose data are beside it"};

  std::vector<uint8_t> header, binary_header;
  for (uint32_t word : {magic, version, uint32_t(total), uint32_t(text.size()), json_type}) put_u32(header, word);
  put_u32(binary_header, uint32_t(binary_size)), put_u32(binary_header, bin_type);
  const std::vector<uint8_t> zeros(alignment_, 0);
  std::vector<std::span<const uint8_t>> spans{header, {reinterpret_cast<const uint8_t*>(text.data()), text.size()}};
  if (has_binary) spans.push_back(binary_header);
  size_t at = 0;
  auto pad_to = [&](size_t offset) {
    if (offset > at) spans.push_back(std::span(zeros).first(offset - at));
    at = offset;
  };
  for (const Piece& piece : pieces_) {
    pad_to(piece.offset);
    spans.push_back(piece.bytes);
    at += piece.bytes.size();
  }
  pad_to(binary_size);
  return write_file_atomically(path, spans);
}

}  // namespace lambent
