// glTF 2.0 specification (ISO/IEC 12113), sections 3.5 and 3.6; KHR_mesh_quantization.
#include <lambent/scene/gltf_read.h>

#include <lambent/core/check.h>
#include <lambent/core/uri.h>

#include <cstring>

namespace lambent {

using Json = nlohmann::json;

bool GltfCheck::fail(const GltfWhere& where, const std::string& message) {
  if (error_) return false;
  std::string place = path_;
  auto append = [&](const char* kind, size_t index, const char* separator) {
    if (kind) place += (place.empty() ? "" : separator) + std::string(kind) + " " + std::to_string(index);
  };
  append(where.kind, where.index, ": ");
  append(where.inner_kind, where.inner_index, ", ");
  error_ = Error{place, message};
  return false;
}

const Json* GltfCheck::member(const Json& parent, const char* key, const GltfWhere& where) {
  if (!parent.is_object()) {
    fail(where, "is not a JSON object");
    return nullptr;
  }
  auto found = parent.find(key);
  return found == parent.end() ? nullptr : &*found;
}

const Json* GltfCheck::object(const Json& parent, const char* key, const GltfWhere& where) {
  const Json* value = member(parent, key, where);
  if (!value || value->is_object()) return value;
  fail(where, std::string(key) + " is not an object");
  return nullptr;
}

const Json* GltfCheck::array(const Json& parent, const char* key, const GltfWhere& where) {
  const Json* value = member(parent, key, where);
  if (!value || value->is_array()) return value;
  fail(where, std::string(key) + " is not an array");
  return nullptr;
}

std::optional<uint64_t> GltfCheck::integer(const Json& value, const char* name, uint64_t limit,
                                           const GltfWhere& where) {
  std::optional<uint64_t> number;
  if (value.is_number_unsigned()) {
    number = value.get<uint64_t>();
  } else if (value.is_number_float()) {  // "2.0" is an integer too
    constexpr double exact = 9007199254740992.0;
    double x = value.get<double>();
    if (x >= 0 && x <= exact && x == std::floor(x)) number = uint64_t(x);
  }
  if (!number) {
    fail(where, std::string(name) + " is not an integer from 0 on");
  } else if (*number >= limit) {
    fail(where, std::string(name) + " is " + std::to_string(*number) + ", out of range");
    number.reset();
  }
  return number;
}

uint64_t GltfCheck::integer(const Json& parent, const char* key, uint64_t fallback, uint64_t limit,
                            const GltfWhere& where) {
  const Json* value = member(parent, key, where);
  return value ? integer(*value, key, limit, where).value_or(fallback) : fallback;
}

std::optional<size_t> GltfCheck::index(const Json& parent, const char* key, size_t limit, const GltfWhere& where) {
  const Json* value = member(parent, key, where);
  if (!value) return std::nullopt;
  return integer(*value, key, limit, where);
}

double GltfCheck::number(const Json& parent, const char* key, double fallback, const GltfWhere& where) {
  const Json* value = member(parent, key, where);
  if (!value) return fallback;
  if (value->is_number()) return value->get<double>();
  fail(where, std::string(key) + " is not a number");
  return fallback;
}

bool GltfCheck::boolean(const Json& parent, const char* key, bool fallback, const GltfWhere& where) {
  const Json* value = member(parent, key, where);
  if (!value) return fallback;
  if (value->is_boolean()) return value->get<bool>();
  fail(where, std::string(key) + " is neither true nor false");
  return fallback;
}

std::string GltfCheck::text(const Json& parent, const char* key, const GltfWhere& where) {
  const Json* value = member(parent, key, where);
  if (!value) return {};
  if (value->is_string()) return value->get<std::string>();
  fail(where, std::string(key) + " is not a string");
  return {};
}

bool GltfCheck::numbers(const Json& parent, const char* key, std::span<double> values, const GltfWhere& where) {
  const Json* list = array(parent, key, where);
  if (!list) return false;
  bool good = list->size() == values.size();
  for (size_t i = 0; good && i < values.size(); ++i) good = (*list)[i].is_number();
  if (!good) return fail(where, std::string(key) + " is not " + std::to_string(values.size()) + " numbers");
  for (size_t i = 0; i < values.size(); ++i) values[i] = (*list)[i].get<double>();
  return true;
}

size_t gltf_count(const Json& document, const char* key) {
  auto found = document.find(key);
  return found == document.end() ? 0 : found->size();
}

const Json& gltf_item(const Json& document, const char* key, size_t index) {
  LAMBENT_CHECK(index < gltf_count(document, key));
  return (*document.find(key))[index];
}

Json* gltf_member(Json& value, std::initializer_list<const char*> path) {
  Json* at = &value;
  for (const char* key : path) {
    if (!at->is_object()) return nullptr;
    const auto found = at->find(key);
    if (found == at->end()) return nullptr;
    at = &*found;
  }
  return at;
}

size_t component_size(GltfType type) {
  switch (type) {
    case GltfType::i8:
    case GltfType::u8: return 1;
    case GltfType::i16:
    case GltfType::u16: return 2;
    case GltfType::u32:
    case GltfType::f32: return 4;
    case GltfType::none: break;
  }
  return 0;
}

namespace {

// Columns of matrices begin at multiples of four bytes.
size_t column_size(int rows, GltfType type, bool is_matrix) {
  size_t size = size_t(rows) * component_size(type);
  return is_matrix ? (size + 3) / 4 * 4 : size;
}

int matrix_rows(int components) { return components == 4 ? 2 : components == 9 ? 3 : 4; }

template <class T>
T load(const uint8_t* p) {
  T value;
  std::memcpy(&value, p, sizeof value);
  return value;
}

uint32_t load_unsigned(const uint8_t* p, GltfType type) {
  return type == GltfType::u8 ? *p : type == GltfType::u16 ? load<uint16_t>(p) : load<uint32_t>(p);
}

// Whether `count` elements at this stride lie inside `size` bytes.
bool fits(size_t size, size_t count, size_t stride, size_t element_size) {
  return count == 0 || (size >= element_size && (count == 1 || (size - element_size) / stride >= count - 1));
}

GltfType read_component_type(GltfCheck& check, const Json& parent, const GltfWhere& where) {
  uint64_t type = check.integer(parent, "componentType", 0, 1 << 16, where);
  switch (GltfType(type)) {
    case GltfType::i8:
    case GltfType::u8:
    case GltfType::i16:
    case GltfType::u16:
    case GltfType::u32:
    case GltfType::f32: return GltfType(type);
    case GltfType::none: break;
  }
  check.fail(where, "componentType " + std::to_string(type) + " does not exist");
  return GltfType::none;
}

void read_sparse(GltfCheck& check, const GltfDocument& document, const Json& sparse, const GltfWhere& where,
                 GltfAccessor& a) {
  const Json *indices = check.object(sparse, "indices", where), *values = check.object(sparse, "values", where);
  if (!indices || !values) {
    check.fail(where, "sparse lacks indices or values");
    return;
  }
  size_t views = gltf_count(document.json, "bufferViews");
  a.sparse_count = check.integer(sparse, "count", 0, a.count + 1, where);
  a.sparse_type = read_component_type(check, *indices, where);
  auto index_view = check.index(*indices, "bufferView", views, where);
  auto value_view = check.index(*values, "bufferView", views, where);
  uint64_t index_at = check.integer(*indices, "byteOffset", 0, UINT64_MAX, where);
  uint64_t value_at = check.integer(*values, "byteOffset", 0, UINT64_MAX, where);
  if (check.ok() && (!index_view || !value_view)) check.fail(where, "sparse lacks a bufferView");
  if (check.ok() && a.sparse_type != GltfType::u8 && a.sparse_type != GltfType::u16 && a.sparse_type != GltfType::u32) {
    check.fail(where, "sparse indices are not unsigned integers");
  }
  if (!check.ok()) return;
  a.sparse_indices = read_buffer_view(check, document, *index_view, nullptr);
  a.sparse_values = read_buffer_view(check, document, *value_view, nullptr);
  if (!check.ok()) return;
  size_t index_size = component_size(a.sparse_type);
  if (index_at > a.sparse_indices.size() || value_at > a.sparse_values.size() ||
      !fits(a.sparse_indices.size() - index_at, a.sparse_count, index_size, index_size) ||
      !fits(a.sparse_values.size() - value_at, a.sparse_count, a.element_size, a.element_size)) {
    check.fail(where, "sparse elements reach past their buffer view");
    return;
  }
  a.sparse_indices = a.sparse_indices.subspan(index_at), a.sparse_values = a.sparse_values.subspan(value_at);
  uint64_t next = 0;
  for (size_t i = 0; i < a.sparse_count; ++i) {
    uint32_t index = load_unsigned(a.sparse_indices.data() + i * index_size, a.sparse_type);
    if (index < next || index >= a.count) {
      check.fail(where, "sparse index " + std::to_string(i) + " is out of order or out of range");
      return;
    }
    next = uint64_t(index) + 1;
  }
}

}  // namespace

const uint8_t* GltfAccessor::element(size_t i) const {
  if (sparse_count) {
    size_t size = component_size(sparse_type), low = 0, high = sparse_count;
    while (low < high) {
      size_t middle = (low + high) / 2;
      if (load_unsigned(sparse_indices.data() + middle * size, sparse_type) < i) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    if (low < sparse_count && load_unsigned(sparse_indices.data() + low * size, sparse_type) == i) {
      return sparse_values.data() + low * element_size;
    }
  }
  return data.empty() ? nullptr : data.data() + i * stride;
}

double GltfAccessor::component(const uint8_t* element, int c) const {
  if (!element) return 0;
  int rows = is_matrix ? matrix_rows(components) : components;
  const uint8_t* p = element + size_t(c / rows) * column_size(rows, type, is_matrix) +
                     size_t(c % rows) * component_size(type);
  switch (type) {
    case GltfType::i8: return int8_t(*p);
    case GltfType::u8: return *p;
    case GltfType::i16: return load<int16_t>(p);
    case GltfType::u16: return load<uint16_t>(p);
    case GltfType::u32: return load<uint32_t>(p);
    case GltfType::f32: return load<float>(p);
    case GltfType::none: break;
  }
  return 0;
}

void GltfAccessor::read(size_t i, std::span<double> out) const {
  const uint8_t* p = element(i);
  for (int c = 0; c < components && size_t(c) < out.size(); ++c) {
    double x = component(p, c);
    if (normalized) {  // section 3.6.2.2
      switch (type) {
        case GltfType::i8: x = std::max(x / 127.0, -1.0); break;
        case GltfType::u8: x /= 255.0; break;
        case GltfType::i16: x = std::max(x / 32767.0, -1.0); break;
        case GltfType::u16: x /= 65535.0; break;
        default: break;
      }
    }
    out[size_t(c)] = x;
  }
}

Vec3d GltfAccessor::read3(size_t i) const {
  double v[3] = {};
  read(i, v);
  return {v[0], v[1], v[2]};
}

uint32_t GltfAccessor::integer(size_t i) const {
  const uint8_t* p = element(i);
  return p ? load_unsigned(p, type) : 0;
}

std::span<const uint8_t> read_buffer_view(GltfCheck& check, const GltfDocument& document, size_t index,
                                          size_t* stride) {
  const Json& view = gltf_item(document.json, "bufferViews", index);
  GltfWhere where{"buffer view", index};
  auto buffer = check.index(view, "buffer", document.buffers.size(), where);
  uint64_t offset = check.integer(view, "byteOffset", 0, UINT64_MAX, where);
  uint64_t length = check.integer(view, "byteLength", 0, UINT64_MAX, where);
  constexpr uint64_t largest_stride = 252;
  uint64_t view_stride = check.integer(view, "byteStride", 0, largest_stride + 1, where);
  if (check.ok() && !buffer) check.fail(where, "names no buffer");
  if (!check.ok()) return {};
  std::span<const uint8_t> bytes = document.buffers[*buffer];
  if (offset > bytes.size() || length > bytes.size() - offset) {
    check.fail(where, "reaches past the end of buffer " + std::to_string(*buffer));
    return {};
  }
  if (stride) *stride = view_stride;
  return bytes.subspan(offset, length);
}

GltfAccessor read_accessor(GltfCheck& check, const GltfDocument& document, size_t index) {
  const Json& json = gltf_item(document.json, "accessors", index);
  GltfWhere where{"accessor", index};
  GltfAccessor a;
  a.type = read_component_type(check, json, where);
  a.count = check.integer(json, "count", 0, uint64_t{1} << 32, where);
  a.normalized = check.boolean(json, "normalized", false, where);
  std::string shape = check.text(json, "type", where);
  static constexpr struct {
    const char* name;
    int components;
  } shapes[] = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}};
  for (const auto& s : shapes) {
    if (shape == s.name) a.shape = s.name, a.components = s.components;
  }
  a.is_matrix = shape.starts_with("MAT");
  if (check.ok() && a.components == 0) check.fail(where, "type " + in_quotes(shape) + " does not exist");
  if (!check.ok()) return {};
  int rows = a.is_matrix ? matrix_rows(a.components) : a.components;
  a.element_size = column_size(rows, a.type, a.is_matrix) * size_t(a.components / rows);
  a.stride = a.element_size;
  auto view = check.index(json, "bufferView", gltf_count(document.json, "bufferViews"), where);
  uint64_t offset = check.integer(json, "byteOffset", 0, UINT64_MAX, where);
  if (view && check.ok()) {
    size_t stride = 0;
    std::span<const uint8_t> bytes = read_buffer_view(check, document, *view, &stride);
    if (!check.ok()) return {};
    if (stride) a.stride = stride;
    if (a.stride < a.element_size) check.fail(where, "has elements larger than their stride");
    if (check.ok() && (offset > bytes.size() || !fits(bytes.size() - offset, a.count, a.stride, a.element_size))) {
      check.fail(where, "reaches past the end of buffer view " + std::to_string(*view));
    }
    if (!check.ok()) return {};
    a.data = bytes.subspan(offset);
  }
  if (const Json* sparse = check.object(json, "sparse", where)) read_sparse(check, document, *sparse, where, a);
  if (!check.ok()) return {};
  return a;
}

std::optional<GltfAccessor> read_attribute(GltfCheck& check, const GltfDocument& document, const Json& parent,
                                           const char* key, size_t count, const GltfWhere& where) {
  auto index = check.index(parent, key, gltf_count(document.json, "accessors"), where);
  if (!index) return std::nullopt;
  GltfAccessor a = read_accessor(check, document, *index);
  if (check.ok() && a.count != count) {
    check.fail(where, std::string(key) + " has " + std::to_string(a.count) + " elements, but there are " +
                          std::to_string(count) + " vertices");
  }
  if (!check.ok()) return std::nullopt;
  return a;
}

}  // namespace lambent
