// Direct-to-indirect transport in a baked file.
#include <lambent/baked/extension.h>
#include <lambent/core/half.h>
#include <lambent/core/huffman.h>

#include <algorithm>
#include <cmath>

namespace lambent {

using nlohmann::json;

namespace {

// Indices of one byte, two or four, as they need.
constexpr size_t index_bytes(size_t limit) { return limit <= 256 ? 1 : limit <= 65536 ? 2 : 4; }
json add_indices(const std::vector<uint32_t>& values, size_t limit, BlobWriter& out) {
  if (index_bytes(limit) == 1) return out.add_copy(std::vector<uint8_t>(values.begin(), values.end()));
  if (index_bytes(limit) == 2) return out.add_copy(std::vector<uint16_t>(values.begin(), values.end()));
  return out.add_copy(values);
}
Result<std::vector<uint32_t>> read_indices(const BlobReader& in, const json& object, const char* key, size_t count,
                                           size_t bytes, const std::string& where) {
  const auto widened = [](auto values) -> Result<std::vector<uint32_t>> {
    if (!values) return values.error();
    return std::vector<uint32_t>(values->begin(), values->end());
  };
  if (bytes == 1) return widened(read_values<uint8_t>(in, object, key, count, where));
  if (bytes == 2) return widened(read_values<uint16_t>(in, object, key, count, where));
  return read_values<uint32_t>(in, object, key, count, where);
}

// Levels whose surfels have parents of the level above, those that are not their own.
size_t level_above_limit(const Surfels& s) { return s.levels() > 1 ? s.counts[s.levels() - 2] : 1; }

// Bytes by how often each is there: {"bytes": how many, "coded": a view}.
json encode_bytes(const std::vector<uint8_t>& bytes, BlobWriter& out) {
  return {{"bytes", bytes.size()}, {"coded", out.add_copy(huffman_encode(bytes))}};
}
// Those, or a view of them as they are.
Result<std::vector<uint8_t>> decode_bytes(const BlobReader& in, const json& object, const char* key,
                                          const std::string& where) {
  const auto member = object.find(key);
  if (member == object.end() || !member->is_object()) return read_all_values<uint8_t>(in, object, key, where);
  auto count = read_count(*member, "bytes", SIZE_MAX / 2, where);
  if (!count) return count.error();
  auto coded = read_view(in, *member, "coded", where);
  if (!coded) return coded.error();
  auto bytes = huffman_decode(coded->bytes, *count);
  if (!bytes) return Error{where, std::string("\"") + key + "\" is broken"};
  return std::move(*bytes);
}

json encode_rows(const NodeRows& rows, BlobWriter& out) {
  return {{"entries", rows.nodes.size()},
          {"bufferView", encode_bytes(pack_rows(rows), out)},
          {"weights", encode_bytes(rows.weights, out)},
          {"scales", out.add(bytes_of(rows.scales))}};
}

Result<void> decode_rows(const BlobReader& in, const json& object, size_t count, NodeRows& rows,
                         const std::string& where) {
  auto entries = read_count(object, "entries", 0x7fffffff, where);
  if (!entries) return entries.error();
  auto packed = decode_bytes(in, object, "bufferView", where), weights = decode_bytes(in, object, "weights", where);
  for (const auto* bytes : {&packed, &weights})
    if (!*bytes) return bytes->error();
  if (weights->size() != *entries) return Error{where, "there are not as many weights as entries"};
  if (auto ok = unpack_rows(*packed, count, *entries, rows, where); !ok) return ok;
  auto scales = read_values<float>(in, object, "scales", count, where);
  if (!scales) return scales.error();
  rows.weights = std::move(*weights), rows.scales = std::move(*scales);
  return {};
}

json encode_surfels(const Surfels& s, BlobWriter& out) {
  const Bounds box = surfel_box(s);
  std::vector<uint64_t> places;
  std::vector<uint32_t> directions, parents;
  std::vector<uint16_t> areas, albedos;
  for (size_t i = 0; i < s.count(); ++i) {
    places.push_back(pack_place(s.positions[i], box)), directions.push_back(pack_normal(s.normals[i]));
    areas.push_back(pack_area(s.areas[i]));
    for (int c = 0; c < 3; ++c) albedos.push_back(float_to_half(s.albedos[i][c]));
  }
  for (size_t l = 1; l < s.levels(); ++l)
    parents.insert(parents.end(), s.parents.begin() + ptrdiff_t(s.first_parent(l) + s.counts[l - 1]),
                   s.parents.begin() + ptrdiff_t(s.first_parent(l) + s.counts[l]));
  return {{"levels", s.counts},
          {"spacings", s.spacings},
          {"min", {box.min.x, box.min.y, box.min.z}},
          {"max", {box.max.x, box.max.y, box.max.z}},
          {"places", out.add_copy(places)},
          {"directions", out.add_copy(directions)},
          {"weights", out.add_copy(areas)},
          {"albedos", out.add_copy(albedos)},
          {"materials", add_indices(s.materials, s.names.size(), out)},
          {"names", s.names},
          {"parents", add_indices(parents, level_above_limit(s), out)}};
}

// How many surfels there are by level, and what their materials are called.
Result<Surfels> decode_levels(const json& object, const std::string& where) {
  Surfels s;
  const auto levels = object.find("levels"), names = object.find("names");
  if (levels == object.end() || !levels->is_array() || levels->empty() || levels->size() > max_surfel_levels ||
      !std::all_of(levels->begin(), levels->end(),
                   [](const json& n) { return n.is_number_unsigned() && n.get<uint64_t>() <= max_surfels; }))
    return Error{where, "\"levels\" is not a list of numbers of surfels"};
  s.counts = levels->get<std::vector<uint32_t>>();
  if (!std::is_sorted(s.counts.begin(), s.counts.end())) return Error{where, "\"levels\" falls"};
  if (names == object.end() || !names->is_array() || names->size() > max_surfels ||
      !std::all_of(names->begin(), names->end(), [](const json& n) { return n.is_string(); }))
    return Error{where, "\"names\" is not a list of materials"};
  s.names = names->get<std::vector<std::string>>();
  auto spacings = read_numbers(object, "spacings", s.levels(), where);
  if (!spacings) return spacings.error();
  s.spacings = std::move(*spacings);
  return s;
}

// Places, normals and areas as single floats, materials of two bytes at least, all parents: as files had them first.
Result<void> decode_whole_surfels(const BlobReader& in, const json& object, Surfels& s, const std::string& where) {
  const size_t n = s.counts.back();
  auto positions = read_values<Vec3>(in, object, "positions", n, where),
       normals = read_values<Vec3>(in, object, "normals", n, where);
  for (const auto* values : {&positions, &normals})
    if (!*values) return values->error();
  auto areas = read_values<float>(in, object, "areas", n, where);
  if (!areas) return areas.error();
  auto materials = read_indices(in, object, "materials", n, std::max<size_t>(index_bytes(s.names.size()), 2), where);
  if (!materials) return materials.error();
  auto parents = read_values<uint32_t>(in, object, "parents", s.nodes() - s.counts[0], where);
  if (!parents) return parents.error();
  s.positions = std::move(*positions), s.normals = std::move(*normals), s.areas = std::move(*areas);
  s.materials = std::move(*materials), s.parents = std::move(*parents);
  return {};
}

Result<void> decode_packed_surfels(const BlobReader& in, const json& object, Surfels& s, const std::string& where) {
  const size_t n = s.counts.back();
  auto min = read_numbers(object, "min", 3, where), max = read_numbers(object, "max", 3, where);
  for (const auto* list : {&min, &max})
    if (!*list) return list->error();
  const Bounds box{{(*min)[0], (*min)[1], (*min)[2]}, {(*max)[0], (*max)[1], (*max)[2]}};
  auto places = read_values<uint64_t>(in, object, "places", n, where);
  if (!places) return places.error();
  auto directions = read_values<uint32_t>(in, object, "directions", n, where);
  if (!directions) return directions.error();
  auto areas = read_values<uint16_t>(in, object, "weights", n, where);
  if (!areas) return areas.error();
  auto materials = read_indices(in, object, "materials", n, index_bytes(s.names.size()), where);
  if (!materials) return materials.error();
  auto parents = read_indices(in, object, "parents", n - s.counts[0], index_bytes(level_above_limit(s)), where);
  if (!parents) return parents.error();
  for (size_t i = 0; i < n; ++i) {
    s.positions.push_back(unpack_place((*places)[i], box)), s.normals.push_back(unpack_normal((*directions)[i]));
    s.areas.push_back(unpack_area((*areas)[i]));
  }
  for (size_t l = 1; l < s.levels(); ++l) {
    for (uint32_t i = 0; i < s.counts[l - 1]; ++i) s.parents.push_back(i);
    const auto first = parents->begin() + ptrdiff_t(s.counts[l - 1] - s.counts[0]);
    s.parents.insert(s.parents.end(), first, first + ptrdiff_t(s.counts[l] - s.counts[l - 1]));
  }
  s.materials = std::move(*materials);
  return {};
}

Result<Surfels> decode_surfels(const BlobReader& in, const json& object, const std::string& where) {
  auto s = decode_levels(object, where);
  if (!s) return s;
  const size_t n = s->counts.back();
  auto albedos = read_values<uint16_t>(in, object, "albedos", 3 * n, where);
  if (!albedos) return albedos.error();
  for (size_t i = 0; i < n; ++i)
    s->albedos.emplace_back(half_to_float((*albedos)[3 * i]), half_to_float((*albedos)[3 * i + 1]),
                            half_to_float((*albedos)[3 * i + 2]));
  const bool packed = object.contains("places");
  if (auto ok = packed ? decode_packed_surfels(in, object, *s, where) : decode_whole_surfels(in, object, *s, where);
      !ok)
    return ok.error();
  return s;
}

Result<void> decode_kernels(const BlobReader& in, const json& object, IndirectTransfer& t, const std::string& where) {
  if (object.contains("bufferView")) {
    auto packed = decode_bytes(in, object, "bufferView", where);
    if (!packed) return packed.error();
    return unpack_kernels(*packed, t, where);
  }
  // Eight surfels a receiver and as many halves: as files had them first.
  if (t.receivers > in.buffers.room() / kernel_slots) return Error{where, "there is no room for so many receivers"};
  auto readers = read_indices(in, object, "surfels", t.receivers * kernel_slots,
                              std::max<size_t>(index_bytes(t.gathering()), 2), where);
  if (!readers) return readers.error();
  auto weights = read_values<uint16_t>(in, object, "weights", t.receivers * kernel_slots, where);
  if (!weights) return weights.error();
  t.reader_surfels = std::move(*readers), t.reader_weights = std::move(*weights);
  return {};
}

json encode_free_space(const IndirectLattice& f, BlobWriter& out) {
  json object = encode_points(f.lattice, f.order, f.valid, out);
  object.update(encode_rows(f.rows, out));
  return object;
}

Result<IndirectLattice> decode_free_space(const BlobReader& in, const json& object, const std::string& where) {
  IndirectLattice f;
  auto lattice = decode_points(object, f.order, where);
  if (!lattice) return lattice.error();
  f.lattice = *lattice;
  auto valid = read_values<uint8_t>(in, object, "valid", f.lattice.count(), where);
  if (!valid) return valid.error();
  f.valid = std::move(*valid);
  if (auto ok = decode_rows(in, object, f.lattice.count(), f.rows, where); !ok) return ok.error();
  return f;
}

}  // namespace

json encode_indirect(const IndirectTransfer& t, BlobWriter& out) {
  json object = encode_rows(t.gather, out);
  object.update({{"surfels", encode_surfels(t.surfels, out)},
                 {"gatherLevel", t.gather_level},
                 {"kernels", {{"bufferView", encode_bytes(pack_kernels(t), out)}}},
                 {"error", t.error}});
  if (t.lattice) object["lattice"] = encode_free_space(*t.lattice, out);
  return object;
}

Result<Field> decode_indirect(const BlobReader& in, const json& object, size_t receivers, const std::string& where) {
  IndirectTransfer t;
  for (const char* member : {"surfels", "kernels"})
    if (!object.contains(member) || !object[member].is_object())
      return Error{where, std::string("\"") + member + "\" is missing"};
  auto surfels = decode_surfels(in, object["surfels"], where + ": surfels");
  if (!surfels) return surfels.error();
  t.surfels = std::move(*surfels), t.receivers = receivers;
  auto level = read_count(object, "gatherLevel", t.surfels.levels() - 1, where);
  if (!level) return level.error();
  t.gather_level = uint32_t(*level);
  if (auto ok = decode_rows(in, object, t.gathering(), t.gather, where); !ok) return ok.error();
  if (auto ok = decode_kernels(in, object["kernels"], t, where + ": kernels"); !ok) return ok.error();
  if (const auto lattice = object.find("lattice"); lattice != object.end()) {
    auto decoded = decode_free_space(in, *lattice, where + ": lattice");
    if (!decoded) return decoded.error();
    t.lattice = std::move(*decoded);
  }
  if (const auto error = object.find("error"); error != object.end() && error->is_number())
    t.error = error->get<double>();
  const auto kind = decode_directional(object, where);
  if (!kind) return kind.error();
  if (*kind == DirectionalKind::hl2)
    return Error{where, "directional light of direct-to-indirect transport is sh:2, sh:3 or vector"};
  t.rows = directional_rows(*kind);
  if (auto ok = check_indirect(t, where); !ok) return ok.error();
  // Files of older builds as they would be written now, so that writing them does not change them.
  if (!object["surfels"].contains("places")) round_surfels(t.surfels);
  if (!object["kernels"].contains("bufferView"))
    if (auto ok = unpack_kernels(pack_kernels(t), t, where); !ok) return ok.error();
  if (*kind == DirectionalKind::none) return Field{{}, std::move(t), DiffuseRows{}};
  return Field{{}, std::move(t), DirectionalRows{*kind}};
}

}  // namespace lambent
