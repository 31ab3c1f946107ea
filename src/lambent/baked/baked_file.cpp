#include <lambent/baked/baked_file.h>
#include <lambent/basis/sh.h>
#include <lambent/core/check.h>
#include <lambent/core/half.h>
#include <lambent/scene/gltf.h>
#include <lambent/scene/load.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>

namespace lambent {
namespace {

static_assert(std::endian::native == std::endian::little, "the file and its in-place reader are little-endian");

using nlohmann::json;
const char* const extension_name = "LAMBENT_transfer";

template <class T>
std::span<const uint8_t> bytes_of(std::span<const T> values) {
  return {reinterpret_cast<const uint8_t*>(values.data()), values.size_bytes()};
}

// A non-negative integer member, at most `limit`.
Result<size_t> read_count(const json& object, const char* key, size_t limit, const std::string& where) {
  const auto it = object.is_object() ? object.find(key) : object.end();
  if (!object.is_object() || it == object.end() || !it->is_number_unsigned() || it->get<uint64_t>() > limit)
    return Error{where, std::string("\"") + key + "\" is missing or out of range"};
  return it->get<size_t>();
}

const std::map<LobeKind, std::string> lobe_names{{LobeKind::cosine_power, "cosine_power"}, {LobeKind::von_mises_fisher, "von_mises_fisher"}};

void write_light(json& object, const LightBasis& light) {
  object["basis"] = "sh";
  object["order"] = light.order;
  if (!light.lobes.empty()) {
    json lobes = json::array();
    for (const Lobe& l : light.lobes) lobes.push_back({l.axis.x, l.axis.y, l.axis.z, l.sharpness});
    object["lobeKind"] = lobe_names.at(light.lobe_kind);
    object["lobes"] = std::move(lobes);
  }
  if (!light.groups.empty()) object["groups"] = light.groups;
}

Result<LightBasis> read_light(const json& object, const std::string& where) {
  LightBasis light;
  if (!object.contains("basis") || object["basis"] != "sh") return Error{where, "the light basis is not known to this program"};
  auto order = read_count(object, "order", size_t(max_sh_order), where);
  if (!order) return order.error();
  light.order = int(*order);
  if (const auto lobes = object.find("lobes"); lobes != object.end()) {
    if (!lobes->is_array() || lobes->size() > max_columns) return Error{where, "\"lobes\" is not a list, or too long a one"};
    const auto kind = std::find_if(lobe_names.begin(), lobe_names.end(), [&](const auto& k) { return object.contains("lobeKind") && object["lobeKind"] == k.second; });
    if (kind == lobe_names.end()) return Error{where, "the kind of lobes is not known to this program"};
    light.lobe_kind = kind->first;
    for (const json& l : *lobes) {
      if (!l.is_array() || l.size() != 4 || !std::all_of(l.begin(), l.end(), [](const json& x) { return x.is_number(); }))
        return Error{where, "a lobe is not four numbers"};
      const Lobe lobe{{l[0].get<float>(), l[1].get<float>(), l[2].get<float>()}, l[3].get<float>()};
      if (!is_lobe(light.lobe_kind, lobe)) return Error{where, "a lobe has no unit axis, or a sharpness out of range"};
      light.lobes.push_back(lobe);
    }
  }
  if (const auto groups = object.find("groups"); groups != object.end()) {
    if (!groups->is_array() || groups->size() > max_columns || !std::all_of(groups->begin(), groups->end(), [](const json& x) { return x.is_string(); }))
      return Error{where, "\"groups\" is not a list of names, or too long a one"};
    light.groups = groups->get<std::vector<std::string>>();
  }
  if (light.count() < 1 || light.count() > max_columns) return Error{where, "the transfer has no columns, or too many"};
  return light;
}

// The bytes of a buffer view of the (single) binary chunk.
Result<std::span<const uint8_t>> view_bytes(const GltfChunks& chunks, size_t index, const std::string& where) {
  const json& document = chunks.json;
  const std::string place = where + ": buffer view " + std::to_string(index);
  if (!document.contains("bufferViews") || !document["bufferViews"].is_array() || index >= document["bufferViews"].size())
    return Error{place, "does not exist"};
  const json& view = document["bufferViews"][index];
  auto buffer = read_count(view, "buffer", 0, place);
  if (!buffer) return buffer.error();
  size_t offset = 0;
  if (view.contains("byteOffset")) {
    auto given = read_count(view, "byteOffset", chunks.binary.size(), place);
    if (!given) return given.error();
    offset = *given;
  }
  auto length = read_count(view, "byteLength", chunks.binary.size() - offset, place);
  if (!length) return length.error();
  return chunks.binary.subspan(offset, *length);
}

// The last reflection as bulk data: view maps as halves [map][y][x][row][a.r, a.g, a.b, b]; by receiver, the map and a frame's
// tangent and normal.
struct OutgoingBlobs {
  std::vector<uint16_t> maps, map_of;
  std::vector<Vec3> frames;
};

OutgoingBlobs outgoing_blobs(const Outgoing& o) {
  OutgoingBlobs b;
  for (const ViewMap& map : o.maps)
    for (const ViewWeights& w : map.values)
      for (int c = 0; c < 4; ++c) b.maps.push_back(float_to_half(w[c]));
  b.map_of = o.map_of;
  for (const Mat3& f : o.frames) b.frames.push_back(f[0]), b.frames.push_back(f[2]);
  return b;
}

template <class T>
Result<std::vector<T>> read_values(const GltfChunks& chunks, const json& object, const char* key, size_t count, const std::string& where) {
  auto index = read_count(object, key, 0x7fffffff, where);
  if (!index) return index.error();
  auto bytes = view_bytes(chunks, *index, where);
  if (!bytes) return bytes.error();
  if (bytes->size() != count * sizeof(T))
    return Error{where, std::string("\"") + key + "\" holds " + std::to_string(bytes->size()) + " bytes where " + std::to_string(count * sizeof(T)) + " belong"};
  std::vector<T> values(count);
  if (count) std::memcpy(values.data(), bytes->data(), bytes->size());
  return values;
}

Result<Outgoing> read_outgoing(const GltfChunks& chunks, const json& object, const Transfer& transfer, const std::string& where) {
  Outgoing o;
  const auto kind = std::find_if(std::begin(outgoing_names), std::end(outgoing_names), [&](const char* name) { return object.contains("kind") && object["kind"] == name; });
  if (kind == std::end(outgoing_names)) return Error{where, "the outgoing basis is not known to this program"};
  o.kind = OutgoingKind(kind - std::begin(outgoing_names));
  auto order = read_count(object, "order", size_t(max_sh_order), where);
  if (!order) return order.error();
  o.order = int(*order);
  o.has_b = object.value("hasB", true);
  if (o.order < 1) return Error{where, "the outgoing order is 0"};
  const size_t receivers = transfer.receivers;
  if (o.kind == OutgoingKind::map || o.kind == OutgoingKind::svd) {
    auto grid = read_count(object, "grid", 256, where), maps = read_count(object, "mapCount", 65535, where);
    for (const auto* count : {&grid, &maps})
      if (!*count) return count->error();
    if (*grid < 2 || *maps < 1) return Error{where, "view maps have no size"};
    const size_t each = *grid * *grid * size_t(transfer.rows);
    if (*maps > chunks.binary.size() / (8 * each)) return Error{where, "there is no room for so many view maps"};
    auto halves = read_values<uint16_t>(chunks, object, "maps", *maps * each * 4, where);
    if (!halves) return halves.error();
    const uint16_t* p = halves->data();
    for (size_t m = 0; m < *maps; ++m) {
      ViewMap map{int(*grid), transfer.rows, std::vector<ViewWeights>(each)};
      for (ViewWeights& w : map.values)
        for (int c = 0; c < 4; ++c) w[c] = half_to_float(*p++);
      o.maps.push_back(std::move(map));
    }
    auto map_of = read_values<uint16_t>(chunks, object, "mapOf", receivers, where);
    if (!map_of) return map_of.error();
    for (uint16_t m : *map_of)
      if (m >= *maps) return Error{where, "view map " + std::to_string(m) + " does not exist"};
    o.map_of = std::move(*map_of);
  }
  auto frames = read_values<Vec3>(chunks, object, "frames", 2 * receivers, where);
  if (!frames) return frames.error();
  for (size_t r = 0; r < receivers; ++r) {
    const Vec3 t = (*frames)[2 * r], n = (*frames)[2 * r + 1];
    if (!is_finite(t) || !is_finite(n) || glm::dot(t, t) > 2 || glm::dot(n, n) > 2) return Error{where, "a receiver's frame is broken"};
    o.frames.push_back(Mat3(t, glm::cross(n, t), n));
  }
  if (o.rows() != transfer.rows) return Error{where, "\"rows\" does not fit the outgoing basis"};
  return o;
}

Result<std::vector<uint32_t>> read_map(const GltfChunks& chunks, const json& part, const char* key, const Part& target,
                                       size_t receivers, const std::string& where) {
  auto index = read_count(part, key, 0x7fffffff, where);
  if (!index) return index.error();
  auto bytes = view_bytes(chunks, *index, where);
  if (!bytes) return bytes.error();
  std::vector<uint32_t> map(target.vertex_count);
  if (bytes->size() != map.size() * 4) return Error{where, std::string("\"") + key + "\" does not have one entry a vertex"};
  if (!map.empty()) std::memcpy(map.data(), bytes->data(), bytes->size());
  for (uint32_t r : map)
    if (r != none && r >= receivers) return Error{where, "receiver " + std::to_string(r) + " is out of range"};
  return map;
}

}  // namespace

Result<void> save_baked(const std::string& path, const Scene& scene, const Receivers& receivers, const Transfer& transfer,
                        const std::string& provenance, const Outgoing* outgoing) {
  LAMBENT_CHECK(transfer.rows == (outgoing ? outgoing->rows() : 1));
  const OutgoingBlobs last = outgoing ? outgoing_blobs(*outgoing) : OutgoingBlobs{};
  std::vector<GltfBlob> blobs{{transfer.data, 64}};
  for (const auto* map : {&receivers.front, &receivers.back})
    if (!map->empty())
      for (const Part& part : scene.parts)
        blobs.push_back({bytes_of(std::span<const uint32_t>(*map).subspan(part.first_vertex, part.vertex_count)), 4});
  const size_t outgoing_view = blobs.size();
  if (outgoing) {
    blobs.push_back({bytes_of(std::span<const Vec3>(last.frames)), 4});
    if (!last.maps.empty()) blobs.push_back({bytes_of(std::span<const uint16_t>(last.maps)), 4}), blobs.push_back({bytes_of(std::span<const uint16_t>(last.map_of)), 4});
  }
  return save_glb(path, scene, blobs, [&](json& document, const GltfPlaces& places) {
    json extension;
    extension["version"] = baked_file_version;
    extension["transfer"] = {{"kind", outgoing ? "matrix" : "diffuse"},
                             {"channels", transfer.channels},
                             {"precision", transfer.precision == Precision::half ? "half" : "single"},
                             {"receivers", transfer.receivers},
                             {"bufferView", places.first_view}};
    write_light(extension["transfer"], transfer.light);
    if (outgoing) {
      extension["transfer"]["rows"] = transfer.rows;
      const int first = places.first_view + int(outgoing_view);
      json& o = extension["transfer"]["outgoing"];
      o = {{"kind", outgoing_names[int(outgoing->kind)]}, {"order", outgoing->order}, {"frames", first}};
      if (outgoing->maps.empty()) {
        o["hasB"] = outgoing->has_b;
      } else {
        o["grid"] = outgoing->maps[0].grid, o["mapCount"] = outgoing->maps.size(), o["maps"] = first + 1, o["mapOf"] = first + 2;
      }
    }
    json parts = json::array();
    for (size_t i = 0; i < scene.parts.size(); ++i) {
      json part{{"node", places.part_nodes[i]}, {"primitive", places.part_primitives[i]}, {"front", places.first_view + 1 + int(i)}};
      if (!receivers.back.empty()) part["back"] = places.first_view + 1 + int(scene.parts.size() + i);
      parts.push_back(std::move(part));
    }
    extension["parts"] = std::move(parts);
    extension["provenance"] = json::parse(provenance, nullptr, false);
    LAMBENT_CHECK(!extension["provenance"].is_discarded());
    document["extensions"][extension_name] = std::move(extension);
    json& used = document["extensionsUsed"];
    if (!used.is_array()) used = json::array();
    if (std::find(used.begin(), used.end(), extension_name) == used.end()) used.push_back(extension_name);
  });
}

Result<Baked> load_baked(const std::string& path) {
  auto file = MappedFile::open(path);
  if (!file) return file.error();
  return load_baked(*file, path);
}

Result<Baked> load_baked(const MappedFile& file, const std::string& path) {
  if (file.bytes().empty()) return Error{path, "is empty"};
  auto chunks = split_gltf(file.bytes(), path);
  if (!chunks) return chunks.error();
  const json& document = chunks->json;
  const auto extensions = document.find("extensions");
  if (extensions == document.end() || !extensions->is_object() || !extensions->contains(extension_name))
    return Error{path, "is not a baked file: it has no LAMBENT_transfer extension (make one with `lambent bake`)"};
  const json& extension = (*extensions)[extension_name];
  const std::string where = path + ": " + extension_name;
  auto version = read_count(extension, "version", 0x7fffffff, where);
  if (!version) return version.error();
  if (*version != size_t(baked_file_version))
    return Error{path, "was baked with file version " + std::to_string(*version) + "; this program reads version " +
                           std::to_string(baked_file_version)};

  Baked baked;
  const auto t = extension.find("transfer");
  if (t == extension.end() || !t->is_object()) return Error{where, "\"transfer\" is missing"};
  auto text = [&](const char* key) { return t->contains(key) && (*t)[key].is_string() ? (*t)[key].get<std::string>() : ""; };
  const bool is_matrix = text("kind") == "matrix";
  if (!is_matrix && text("kind") != "diffuse") return Error{where, "transfer of kind \"" + text("kind") + "\" is not known to this program"};
  if (text("precision") != "half" && text("precision") != "single") return Error{where, "\"precision\" must be half or single"};
  auto light = read_light(*t, where);
  if (!light) return light.error();
  auto channels = read_count(*t, "channels", 3, where);
  auto receivers = read_count(*t, "receivers", 0xfffffffe, where);
  auto view = read_count(*t, "bufferView", 0x7fffffff, where);
  for (const auto* count : {&channels, &receivers, &view})
    if (!*count) return count->error();
  if (*channels != 1 && *channels != 3) return Error{where, "\"channels\" is out of range"};
  baked.transfer.light = std::move(*light), baked.transfer.channels = int(*channels), baked.transfer.receivers = *receivers;
  baked.transfer.precision = text("precision") == "half" ? Precision::half : Precision::single;
  if (is_matrix) {
    auto rows = read_count(*t, "rows", 2 * sh_count(max_sh_order), where);
    if (!rows) return rows.error();
    if (*rows < 1) return Error{where, "the transfer has no rows"};
    baked.transfer.rows = int(*rows);
  }
  auto data = view_bytes(*chunks, *view, where);
  if (!data) return data.error();
  if (data->size() != baked.transfer.bytes())
    return Error{where, "the transfer holds " + std::to_string(data->size()) + " bytes where its header makes " +
                            std::to_string(baked.transfer.bytes())};
  if (reinterpret_cast<uintptr_t>(data->data()) % baked.transfer.value_bytes()) return Error{where, "the transfer is not aligned"};
  baked.transfer.data = *data;
  baked.transfer.storage = std::make_shared<MappedFile>(file);
  if (is_matrix) {
    if (!t->contains("outgoing") || !(*t)["outgoing"].is_object()) return Error{where, "\"outgoing\" is missing"};
    auto outgoing = read_outgoing(*chunks, (*t)["outgoing"], baked.transfer, where + ": outgoing");
    if (!outgoing) return outgoing.error();
    baked.outgoing = std::move(*outgoing);
  }

  const std::string folder = std::filesystem::path(path).parent_path().string();
  auto scene = load_gltf(file, path, folder.empty() ? "." : folder);
  if (!scene) return scene.error();
  baked.scene = std::move(*scene);
  baked.front.assign(baked.scene.positions.size(), none);
  const auto parts = extension.find("parts");
  if (parts == extension.end() || !parts->is_array()) return Error{where, "\"parts\" is missing"};
  std::map<std::pair<size_t, size_t>, const json*> by_place;
  for (const json& part : *parts) {
    auto node = read_count(part, "node", 0x7fffffff, where), primitive = read_count(part, "primitive", 0x7fffffff, where);
    if (!node) return node.error();
    if (!primitive) return primitive.error();
    by_place[{*node, *primitive}] = &part;
  }
  for (const Part& part : baked.scene.parts) {
    const auto entry = by_place.find({size_t(part.node), size_t(part.primitive)});
    const std::string place = where + ": node " + std::to_string(part.node) + ", primitive " + std::to_string(part.primitive);
    if (entry == by_place.end()) return Error{place, "has no receivers"};
    for (const char* side : {"front", "back"}) {
      const bool is_back = side[0] == 'b';
      if (is_back && !entry->second->contains("back")) continue;
      auto map = read_map(*chunks, *entry->second, side, part, *receivers, place);
      if (!map) return map.error();
      if (is_back && baked.back.empty()) baked.back.assign(baked.scene.positions.size(), none);
      std::copy(map->begin(), map->end(), (is_back ? baked.back : baked.front).begin() + part.first_vertex);
    }
  }
  const auto provenance = extension.find("provenance");
  baked.provenance = provenance == extension.end() ? "{}" : provenance->dump(-1, ' ', false, json::error_handler_t::replace);
  return baked;
}

bool is_baked(const std::string& path) {
  auto file = MappedFile::open(path);
  if (!file || file->bytes().empty()) return false;
  auto chunks = split_gltf(file->bytes(), path);
  if (!chunks) return false;
  const auto extensions = chunks->json.find("extensions");
  return extensions != chunks->json.end() && extensions->is_object() && extensions->contains(extension_name);
}

}  // namespace lambent
