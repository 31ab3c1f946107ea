#include "packed.h"

#include "extension.h"

#include <lambent/core/glb.h>
#include <lambent/core/half.h>
#include <lambent/core/huffman.h>

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstring>
#include <optional>
#include <vector>

namespace lambent {
namespace {

using nlohmann::json;

using Bytes = std::vector<uint8_t>;

void put(Bytes& out, uint32_t value) {
  for (int i = 0; i < 4; ++i) out.push_back(uint8_t(value >> (8 * i)));
}

// How many bytes there are, how many they are coded, and the codes.
void put_coded(Bytes& out, std::span<const uint8_t> symbols) {
  const Bytes coded = huffman_encode(symbols);
  put(out, uint32_t(symbols.size()));
  put(out, uint32_t(coded.size()));
  out.insert(out.end(), coded.begin(), coded.end());
}

// 0, -1, 1, -2, ... as 0, 1, 2, 3, ...: below 252 a byte, else 251 + n and n bytes, the lowest first.
void put_number(Bytes& symbols, int32_t value) {
  const uint32_t folded = (uint32_t(value) << 1) ^ uint32_t(value >> 31);
  if (folded < 252) {
    symbols.push_back(uint8_t(folded));
    return;
  }
  const int n = folded < 0x100 ? 1 : folded < 0x10000 ? 2 : folded < 0x1000000 ? 3 : 4;
  symbols.push_back(uint8_t(251 + n));
  for (int i = 0; i < n; ++i) symbols.push_back(uint8_t(folded >> (8 * i)));
}

double cost_of(std::span<const int32_t> residuals) {
  double bits = 0;
  for (int32_t r : residuals) bits += std::log2(1.0 + 2.0 * std::abs(double(r)));
  return bits;
}

// A byte, which of `ways` of telling a column was taken, and its residuals.
template <class Residuals>
void put_column(Bytes& out, std::initializer_list<int> ways, const Residuals& residuals) {
  std::vector<int32_t> best;
  double least = 0;
  int taken = -1;
  for (int way : ways) {
    std::vector<int32_t> tried = residuals(way);
    const double cost = cost_of(tried);
    if (taken >= 0 && cost >= least) continue;
    best = std::move(tried), least = cost, taken = way;
  }
  out.push_back(uint8_t(taken));
  Bytes symbols;
  for (int32_t r : best) put_number(symbols, r);
  put_coded(out, symbols);
}

int32_t minus(int32_t a, int32_t b) { return int32_t(uint32_t(a) - uint32_t(b)); }

// Each told from the one so many before it; 0: from none.
Bytes pack_integers(std::span<const int32_t> values) {
  Bytes out;
  put_column(out, {0, 1, 3}, [&](int lag) {
    std::vector<int32_t> residuals(values.begin(), values.end());
    for (size_t i = size_t(lag); lag > 0 && i < values.size(); ++i) residuals[i] = minus(values[i], values[i - lag]);
    return residuals;
  });
  return out;
}

// Of each row, how far before it the one lies that is most like it; 0 of the first.
Bytes find_parents(std::span<const int32_t> values, size_t columns) {
  const size_t rows = values.size() / columns,
               window = std::clamp<size_t>((size_t{1} << 31) / std::max<size_t>(values.size(), 1), 1, 255);
  Bytes parents(rows);
  for (size_t r = 1; r < rows; ++r) {
    const int32_t* row = values.data() + r * columns;
    int64_t least = INT64_MAX;
    for (size_t back = 1; back <= std::min(window, r) && least > 0; ++back) {
      const int32_t* other = row - back * columns;
      int64_t sum = 0;
      for (size_t c = 0; c < columns && sum < least; ++c) sum += std::abs(int64_t(row[c]) - other[c]);
      if (sum < least) least = sum, parents[r] = uint8_t(back);
    }
  }
  return parents;
}

// [row][group][column]: parents, then column after column in the order that is given, in each the groups. Way 1: less
// the parent's; 2: less the first group's, of both; 3: both. `lengths`: of all bytes after each column.
struct PackedRows {
  Bytes bytes;
  std::vector<size_t> lengths;
};
PackedRows pack_rows(std::span<const int32_t> values, size_t groups, const std::vector<size_t>& columns) {
  const size_t width = groups * columns.size(), rows = values.size() / width;
  const Bytes parents = find_parents(values, width);
  PackedRows out;
  put_coded(out.bytes, parents);
  for (size_t c : columns) {
    for (size_t g = 0; g < groups; ++g) {
      const auto residuals = [&](int way) {
        std::vector<int32_t> found(rows);
        for (size_t r = 0; r < rows; ++r) {
          const auto value = [&](size_t row) {
            const int32_t* at = values.data() + row * width + c;
            return (way & 2) != 0 ? minus(at[g * columns.size()], at[0]) : at[g * columns.size()];
          };
          found[r] = (way & 1) != 0 && parents[r] > 0 ? minus(value(r), value(r - parents[r])) : value(r);
        }
        return found;
      };
      if (g == 0) put_column(out.bytes, {0, 1}, residuals);
      else put_column(out.bytes, {0, 1, 2, 3}, residuals);
    }
    out.lengths.push_back(out.bytes.size());
  }
  return out;
}
std::vector<size_t> rising(size_t count) {
  std::vector<size_t> out(count);
  for (size_t i = 0; i < count; ++i) out[i] = i;
  return out;
}

struct PackedView {
  json description;
  Bytes bytes;
};

int32_t rounded(float value, float step) {
  return int32_t(std::clamp(std::round(double(value) / step), -1073741823.0, 1073741823.0));
}

std::optional<PackedView> pack_floats(std::span<const uint8_t> bytes, size_t components, float step) {
  std::vector<int32_t> values(bytes.size() / 4);
  for (size_t i = 0; i < values.size(); ++i) {
    float value = 0;
    std::memcpy(&value, bytes.data() + 4 * i, 4);
    if (!std::isfinite(value) || std::abs(value / step) > 1e6f) return std::nullopt;
    values[i] = rounded(value, step);
  }
  return PackedView{{{"form", "floats"}, {"columns", components}, {"step", step}},
                    pack_rows(values, 1, rising(components)).bytes};
}

PackedView pack_indices(std::span<const uint8_t> bytes, size_t size) {
  std::vector<int32_t> values(bytes.size() / size);
  for (size_t i = 0; i < values.size(); ++i) std::memcpy(&values[i], bytes.data() + size * i, size);
  return {{{"form", size == 2 ? "u16" : "u32"}}, pack_integers(values)};
}

// A first picture is of so many bands: nine columns have most of what is diffuse.
constexpr size_t first_order = 3;

// [block][group][column][16] as the transfer of a file has them; columns are harmonics, then lamps.
struct Layout {
  size_t receivers, groups, columns, lamps;
  bool half;
  bool has_first() const { return columns - lamps > first_order * first_order; }
  size_t size() const { return (receivers + 15) / 16 * 16 * groups * columns * (half ? 2 : 4); }
};

// The first bands, lamps, and all else.
std::vector<size_t> column_order(const Layout& l) {
  std::vector<size_t> out = rising(l.columns);
  if (l.has_first()) std::rotate(out.begin() + first_order * first_order, out.end() - ptrdiff_t(l.lamps), out.end());
  return out;
}

struct PackedTransfer : PackedView {
  float error = 0;
};
// None where a value is no number.
std::optional<PackedTransfer> pack_transfer(std::span<const uint8_t> bytes, const Layout& l, float error) {
  const size_t width = l.groups * l.columns;
  std::vector<float> values(l.receivers * width);
  double squares = 0;
  for (size_t r = 0; r < l.receivers; ++r)
    for (size_t k = 0; k < width; ++k) {
      const size_t at = (r / 16 * width + k) * 16 + r % 16;
      float value = 0;
      if (l.half) {
        uint16_t bits = 0;
        std::memcpy(&bits, bytes.data() + 2 * at, 2);
        value = half_to_float(bits);
      } else std::memcpy(&value, bytes.data() + 4 * at, 4);
      if (!std::isfinite(value)) return std::nullopt;
      values[r * width + k] = value;
      squares += double(value) * value;
    }
  // What is rounded to a step is off by its square root of a twelfth.
  const double rms = std::sqrt(squares / double(std::max<size_t>(values.size(), 1)));
  const float step = rms > 0 ? std::max(float(error * std::sqrt(12.0) * rms), FLT_MIN) : 1;
  std::vector<int32_t> steps(values.size());
  double off = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    steps[i] = rounded(values[i], step);
    float back = float(steps[i]) * step;
    if (l.half) back = half_to_float(float_to_half(back));
    off += (double(back) - values[i]) * (double(back) - values[i]);
  }
  PackedTransfer packed;
  packed.description = {{"form", l.half ? "half blocks" : "single blocks"},
                        {"rows", l.receivers},
                        {"groups", l.groups},
                        {"columns", l.columns},
                        {"step", step}};
  PackedRows rows = pack_rows(steps, l.groups, column_order(l));
  packed.bytes = std::move(rows.bytes);
  if (l.has_first()) {
    const size_t length = rows.lengths[first_order * first_order + l.lamps - 1];
    packed.description["first"] = {{"order", first_order}, {"lamps", l.lamps}, {"byteLength", length}};
  }
  packed.error = squares > 0 ? float(std::sqrt(off / squares)) : 0;
  return packed;
}

// The extension's transfer, where it is dense and in one view.
Result<Layout> layout_of(const json& transfer, const std::string& path) {
  const std::string kind = transfer.value("kind", "");
  if ((kind != "diffuse" && kind != "matrix") || transfer.contains("cpca") || transfer.contains("lobes"))
    return Error{path, "--pack takes dense transfer by harmonics and the scene's lamps, and this is " +
                           (transfer.contains("cpca")    ? "clusters"
                            : transfer.contains("lobes") ? "lobes of light"
                                                         : kind)};
  if (!transfer["bufferView"].is_number_unsigned()) return Error{path, "--pack takes transfer in one buffer view"};
  const std::string directional = transfer.value("directional", "none");
  const size_t rows = directional == "sh:2" ? 4
                    : directional == "sh:3" ? 9
                    : directional != "none" ? 3
                                            : transfer.value("rows", size_t{1}),
               order = transfer["order"].get<size_t>(),
               groups = transfer.contains("groups") ? transfer["groups"].size() : 0;
  return Layout{transfer["receivers"].get<size_t>(), rows * transfer["channels"].get<size_t>(), order * order + groups,
                groups, transfer["precision"] == "half"};
}

// What a view holds, by the one accessor that has all of it.
struct Held {
  enum Kind : uint8_t { unknown, positions, normals, coordinates, indices } kind = unknown;
  size_t components = 1, size = 4;
  size_t users = 0;
};

std::vector<Held> held_by(const json& document) {
  std::vector<Held> held(document["bufferViews"].size());
  std::vector<Held::Kind> kind_of(document["accessors"].size(), Held::unknown);
  for (const json& mesh : document.value("meshes", json::array()))
    for (const json& primitive : mesh["primitives"]) {
      if (primitive.contains("indices")) kind_of[primitive["indices"].get<size_t>()] = Held::indices;
      for (const auto& [name, accessor] : primitive["attributes"].items())
        kind_of[accessor.get<size_t>()] = name == "POSITION"            ? Held::positions
                                        : name == "NORMAL"              ? Held::normals
                                        : name.starts_with("TEXCOORD_") ? Held::coordinates
                                                                        : Held::unknown;
    }
  for (size_t i = 0; i < kind_of.size(); ++i) {
    const json& accessor = document["accessors"][i];
    if (!accessor.contains("bufferView")) continue;
    Held& view = held[accessor["bufferView"].get<size_t>()];
    const json& buffer_view = document["bufferViews"][accessor["bufferView"].get<size_t>()];
    const std::string type = accessor["type"];
    const int component = accessor["componentType"];
    const size_t components = type == "SCALAR" ? 1
                            : type == "VEC2"   ? 2
                            : type == "VEC3"   ? 3
                                               : 4,
                 size = component == 5126 || component == 5125 ? 4
                      : component == 5123                      ? 2
                                                               : 1;
    const bool whole = accessor["count"].get<size_t>() * components * size == buffer_view["byteLength"].get<size_t>(),
               right = kind_of[i] == Held::indices ? size >= 2 : component == 5126;
    ++view.users;
    if (whole && right && view.users == 1 && !buffer_view.contains("byteStride")) {
      view.kind = kind_of[i];
      view.components = components;
      view.size = size;
    } else view.kind = Held::unknown;
  }
  return held;
}

// A power of two, so that all meshes round alike.
float position_step(const json& document) {
  double most = 0;
  for (const json& accessor : document["accessors"])
    for (const char* bound : {"min", "max"})
      if (accessor.value("type", "") == "VEC3" && accessor.contains(bound))
        for (const json& v : accessor[bound]) most = std::max(most, std::abs(v.get<double>()));
  return float(std::exp2(std::floor(std::log2(std::max(most, 1e-20))) - 15));
}

std::optional<PackedView> pack_view(std::span<const uint8_t> bytes, const Held& held, float position_step) {
  switch (held.kind) {
    case Held::positions: return pack_floats(bytes, held.components, position_step);
    case Held::normals: return pack_floats(bytes, held.components, 1.0f / 1024);
    case Held::coordinates: return pack_floats(bytes, held.components, 1.0f / 32768);
    case Held::indices: return pack_indices(bytes, held.size);
    case Held::unknown: break;
  }
  return std::nullopt;
}

std::string join_glb(const json& document, const Bytes& binary) {
  std::string text = document.dump(-1, ' ', false, json::error_handler_t::replace);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  Bytes head;
  for (uint32_t word :
       {0x46546c67u, 2u, uint32_t(28 + text.size() + binary.size()), uint32_t(text.size()), 0x4e4f534au})
    put(head, word);
  std::string out(head.begin(), head.end());
  out += text;
  head.clear();
  put(head, uint32_t(binary.size())), put(head, 0x004e4942u);
  out.append(head.begin(), head.end());
  out.append(binary.begin(), binary.end());
  return out;
}

}  // namespace

float default_packing_error(std::span<const uint8_t> bytes, const std::string& path) {
  constexpr float most = 0.005f;
  const auto chunks = split_gltf(bytes, path);
  if (!chunks) return most;
  const json error =
      chunks->json.value(json::json_pointer("/extensions/LAMBENT_transfer/provenance/report/error"), json());
  return error.is_number() && error.get<float>() > 0 ? std::clamp(error.get<float>() / 4, 1e-4f, most) : most;
}

Result<PackedFile> pack_baked(std::span<const uint8_t> bytes, float error, const std::string& path) {
  if (!(error >= 1e-5f && error <= 0.1f)) return Error{path, "--pack takes an error from 0.00001 to 0.1"};
  auto chunks = split_gltf(bytes, path);
  if (!chunks) return chunks.error();
  if (chunks->binary.empty()) return Error{path, "--pack takes a .glb"};
  json& document = chunks->json;
  json& extension = document["extensions"][extension_name];
  const json& transfer = extension["transfer"];
  auto layout = layout_of(transfer, path);
  if (!layout) return layout.error();
  const size_t transfer_view = transfer["bufferView"].get<size_t>();
  if (transfer_view >= document["bufferViews"].size()) return Error{path, "holds no transfer"};
  const bool vertices = !extension.contains("surface");
  std::vector<Held> held = held_by(document);
  // Receivers of vertices, and which of the input's they are.
  for (const json& part : extension["parts"])
    for (const char* key : {"front", "back", "input"})
      if (part.contains(key) && part[key].is_number() && (vertices || key == std::string_view("input")))
        held[part[key].get<size_t>()].kind = Held::indices;
  const float step = position_step(document);
  PackedFile out;
  Bytes binary;
  // Transfer comes last, so that a picture can be drawn before all of it is there.
  std::vector<size_t> order = rising(held.size());
  std::rotate(order.begin() + ptrdiff_t(transfer_view), order.begin() + ptrdiff_t(transfer_view) + 1, order.end());
  for (size_t i : order) {
    json& view = document["bufferViews"][i];
    const size_t begin = view.value("byteOffset", size_t{0}), length = view["byteLength"].get<size_t>(),
                 there = chunks->binary.size();
    if (view.value("buffer", size_t{0}) != 0 || view.contains("extensions") || begin > there || length > there - begin)
      return Error{path,
                   "--pack takes a .glb whose buffer views lie in it as they are, and one is compressed or elsewhere"};
    const auto own = chunks->binary.subspan(begin, length);
    std::optional<PackedView> packed;
    if (i == transfer_view) {
      if (own.size() != layout->size()) return Error{path, "holds transfer of another length than its header makes"};
      auto whole = pack_transfer(own, *layout, error);
      if (!whole) return Error{path, "holds transfer that is not a finite number"};
      if (whole->bytes.size() < own.size()) out.error = whole->error;
      packed = std::move(*whole);
    } else packed = pack_view(own, held[i], step);
    binary.resize((binary.size() + 3) / 4 * 4);
    view["byteOffset"] = binary.size();
    if (packed && packed->bytes.size() < own.size()) {
      packed->description["byteLength"] = own.size();
      view["extensions"][extension_name] = std::move(packed->description);
      view["byteLength"] = packed->bytes.size();
      binary.insert(binary.end(), packed->bytes.begin(), packed->bytes.end());
    } else binary.insert(binary.end(), own.begin(), own.end());
  }
  binary.resize((binary.size() + 3) / 4 * 4);
  document["buffers"][0]["byteLength"] = binary.size();
  document["extensionsRequired"].push_back(extension_name);
  if (extension.contains("written")) extension["written"]["byteLength"] = binary.size();
  extension["packed"] = {{"error", out.error}};
  out.bytes = join_glb(document, binary);
  return out;
}

}  // namespace lambent
