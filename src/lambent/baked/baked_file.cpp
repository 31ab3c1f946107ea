#include <lambent/baked/baked_file.h>
#include <lambent/baked/extension.h>
#include <lambent/basis/cosine_basis.h>
#include <lambent/basis/sh.h>
#include <lambent/core/check.h>
#include <lambent/core/half.h>
#include <lambent/scene/gltf.h>
#include <lambent/scene/load.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>

namespace lambent {
namespace {

using nlohmann::json;

// A non-negative integer member, at most `limit`.
Result<size_t> read_count(const json& object, const char* key, size_t limit, const std::string& where) {
  const auto it = object.is_object() ? object.find(key) : object.end();
  if (!object.is_object() || it == object.end() || !it->is_number_unsigned() || it->get<uint64_t>() > limit)
    return Error{where, std::string("\"") + key + "\" is missing or out of range"};
  return it->get<size_t>();
}

// Rows of a transfer matrix.
Result<int> read_rows(const json& transfer, const std::string& where) {
  auto count = read_count(transfer, "rows", 2 * sh_count(max_sh_order), where);
  if (!count) return count.error();
  if (*count < 1) return Error{where, "the transfer has no rows"};
  return int(*count);
}

Result<LightBasis> read_light(const json& object, const std::string& where) {
  LightBasis light;
  if (!object.contains("basis") || object["basis"] != "sh")
    return Error{where, "the light basis is not known to this program"};
  auto order = read_count(object, "order", size_t(max_sh_order), where);
  if (!order) return order.error();
  light.order = int(*order);
  if (const auto lobes = object.find("lobes"); lobes != object.end()) {
    if (!lobes->is_array() || lobes->size() > max_columns)
      return Error{where, "\"lobes\" is not a list, or too long a one"};
    const auto kind = std::find_if(lobe_names.begin(), lobe_names.end(), [&](const auto& k) {
      return object.contains("lobeKind") && object["lobeKind"] == k.second;
    });
    if (kind == lobe_names.end()) return Error{where, "the kind of lobes is not known to this program"};
    light.lobe_kind = kind->first;
    for (const json& l : *lobes) {
      if (!l.is_array() || l.size() != 4 ||
          !std::all_of(l.begin(), l.end(), [](const json& x) { return x.is_number(); }))
        return Error{where, "a lobe is not four numbers"};
      const Lobe lobe{{l[0].get<float>(), l[1].get<float>(), l[2].get<float>()}, l[3].get<float>()};
      if (!is_lobe(light.lobe_kind, lobe)) return Error{where, "a lobe has no unit axis, or a sharpness out of range"};
      light.lobes.push_back(lobe);
    }
  }
  if (const auto groups = object.find("groups"); groups != object.end()) {
    if (!groups->is_array() || groups->size() > max_columns ||
        !std::all_of(groups->begin(), groups->end(), [](const json& x) { return x.is_string(); }))
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
  if (!document.contains("bufferViews") || !document["bufferViews"].is_array() ||
      index >= document["bufferViews"].size())
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

// Values of type T, exactly `count`, that member `key` names.
template <class T>
Result<std::vector<T>> read_values(const GltfChunks& chunks, const json& object, const char* key, size_t count,
                                   const std::string& where) {
  auto index = read_count(object, key, 0x7fffffff, where);
  if (!index) return index.error();
  auto bytes = view_bytes(chunks, *index, where);
  if (!bytes) return bytes.error();
  if (bytes->size() / sizeof(T) != count || bytes->size() % sizeof(T))
    return Error{where, std::string("\"") + key + "\" holds " + std::to_string(bytes->size()) + " bytes where " +
                            std::to_string(count * sizeof(T)) + " are due"};
  std::vector<T> values(count);
  if (count) std::memcpy(static_cast<void*>(values.data()), bytes->data(), bytes->size());
  return values;
}

Result<Outgoing> read_outgoing(const GltfChunks& chunks, const json& object, int rows, size_t receivers,
                               const std::string& where) {
  if (!object.is_object()) return Error{where, "is not an object"};
  Outgoing o;
  const auto kind = std::find_if(std::begin(outgoing_names), std::end(outgoing_names),
                                 [&](const char* name) { return object.contains("kind") && object["kind"] == name; });
  if (kind == std::end(outgoing_names)) return Error{where, "the outgoing basis is not known to this program"};
  o.kind = OutgoingKind(kind - std::begin(outgoing_names));
  auto order = read_count(object, "order", size_t(max_sh_order), where);
  if (!order) return order.error();
  o.order = int(*order);
  if (const auto b = object.find("hasB"); b != object.end()) {
    if (!b->is_boolean()) return Error{where, "\"hasB\" is neither true nor false"};
    o.has_b = b->get<bool>();
  }
  if (o.order < 1) return Error{where, "the outgoing order is 0"};
  if (o.kind == OutgoingKind::map || o.kind == OutgoingKind::svd) {
    auto grid = read_count(object, "grid", 256, where), maps = read_count(object, "mapCount", 65535, where);
    for (const auto* count : {&grid, &maps})
      if (!*count) return count->error();
    if (*grid < 2 || *maps < 1) return Error{where, "view maps have no size"};
    const size_t each = *grid * *grid * size_t(rows);
    if (*maps > chunks.binary.size() / (8 * each)) return Error{where, "there is no room for so many view maps"};
    auto halves = read_values<uint16_t>(chunks, object, "maps", *maps * each * 4, where);
    if (!halves) return halves.error();
    const uint16_t* p = halves->data();
    for (size_t m = 0; m < *maps; ++m) {
      ViewMap map{int(*grid), rows, std::vector<ViewWeights>(each)};
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
    if (!is_finite(t) || !is_finite(n) || dot(t, t) > 2 || dot(n, n) > 2)
      return Error{where, "a receiver's frame is broken"};
    o.frames.push_back(Mat3(t, cross(n, t), n));
  }
  if (o.rows() != rows) return Error{where, "\"rows\" does not fit the outgoing basis"};
  return o;
}

// Precision, channels and the bulk data of a transfer whose light, rows and receivers are set.
template <class T>
Result<void> read_transfer_data(const GltfChunks& chunks, const MappedFile& file, const json& object, T& t,
                                const std::string& where) {
  const auto precision = object.find("precision");
  const bool half = precision != object.end() && *precision == "half";
  if (!half && (precision == object.end() || *precision != "single"))
    return Error{where, "\"precision\" must be half or single"};
  auto channels = read_count(object, "channels", 3, where), view = read_count(object, "bufferView", 0x7fffffff, where);
  for (const auto* count : {&channels, &view})
    if (!*count) return count->error();
  if (*channels != 1 && *channels != 3) return Error{where, "\"channels\" is out of range"};
  t.channels = int(*channels), t.precision = half ? Precision::half : Precision::single;
  auto data = view_bytes(chunks, *view, where);
  if (!data) return data.error();
  if (data->size() != t.bytes())
    return Error{where, "the transfer holds " + std::to_string(data->size()) + " bytes where its header makes " +
                            std::to_string(t.bytes())};
  if (reinterpret_cast<uintptr_t>(data->data()) % t.value_bytes()) return Error{where, "the transfer is not aligned"};
  t.data = *data;
  t.storage = std::make_shared<MappedFile>(file);
  return {};
}

// Light, rows and receivers are set.
Result<void> read_cpca(const GltfChunks& chunks, const json& transfer, CpcaTransfer& c, const std::string& where) {
  const json& object = transfer["cpca"];
  auto clusters = read_count(object, "clusters", size_t(max_cpca_clusters), where),
       rank = read_count(object, "rank", size_t(max_cpca_rank), where);
  auto channels = read_count(transfer, "channels", 3, where);
  for (const auto* count : {&clusters, &rank, &channels})
    if (!*count) return count->error();
  if (*clusters < 1) return Error{where, "there are no clusters"};
  if (*channels != 1 && *channels != 3) return Error{where, "\"channels\" is out of range"};
  c.clusters = int(*clusters), c.rank = int(*rank), c.channels = int(*channels);
  if (c.receivers > chunks.binary.size() / 2) return Error{where, "there is no room for so many receivers"};
  auto vectors =
      read_values<float>(chunks, transfer, "bufferView", *clusters * (1 + *rank) * c.receiver_values(), where);
  if (!vectors) return vectors.error();
  for (float v : *vectors)
    if (!std::isfinite(v)) return Error{where, "a cluster's vector is not finite"};
  auto cluster_of = read_values<uint16_t>(chunks, object, "clusterOf", c.receivers, where);
  if (!cluster_of) return cluster_of.error();
  for (uint16_t k : *cluster_of)
    if (k >= *clusters) return Error{where, "cluster " + std::to_string(k) + " does not exist"};
  auto weights = read_values<uint16_t>(chunks, object, "weights", c.receivers * *rank, where);
  if (!weights) return weights.error();
  c.vectors = std::move(*vectors), c.cluster_of = std::move(*cluster_of), c.weights = std::move(*weights);
  return {};
}

// So many finite numbers within 1e9.
Result<std::vector<float>> read_numbers(const json& object, const char* key, size_t count, const std::string& where) {
  const auto list = object.find(key);
  const auto fits = [](const json& x) { return x.is_number() && std::abs(x.get<double>()) <= 1e9; };
  if (list == object.end() || !list->is_array() || list->size() != count ||
      !std::all_of(list->begin(), list->end(), fits))
    return Error{where,
                 "\"" + std::string(key) + "\" is not a list of " + std::to_string(count) + " numbers within 1e9"};
  return list->get<std::vector<float>>();
}

Result<FixedView> read_view(const GltfChunks& chunks, const json& object, size_t receivers, const std::string& where) {
  if (!object.is_object()) return Error{where, "is not an object"};
  FixedView view;
  auto width = read_count(object, "width", 1 << 16, where), height = read_count(object, "height", 1 << 16, where);
  for (const auto* count : {&width, &height})
    if (!*count) return count->error();
  if (*width < 1 || *height < 1 || *width * *height != receivers)
    return Error{where, "has not as many pixels as there are receivers"};
  view.width = int(*width), view.height = int(*height);
  auto eye = read_numbers(object, "eye", 3, where), target = read_numbers(object, "target", 3, where);
  for (const auto* list : {&eye, &target})
    if (!*list) return list->error();
  const auto fov = object.find("fov");
  if (fov == object.end() || !fov->is_number() || !(fov->get<double>() > 0 && fov->get<double>() < 180))
    return Error{where, "\"fov\" is out of range"};
  view.camera.eye = {(*eye)[0], (*eye)[1], (*eye)[2]}, view.camera.target = {(*target)[0], (*target)[1], (*target)[2]};
  view.camera.fov = fov->get<float>();
  auto coverage = read_values<float>(chunks, object, "coverage", receivers, where);
  if (!coverage) return coverage.error();
  for (float c : *coverage)
    if (!(c >= 0 && c <= 1)) return Error{where, "a pixel's coverage is out of range"};
  view.coverage = std::move(*coverage);
  return view;
}

Result<Visibility> read_visibility(const GltfChunks& chunks, const MappedFile& file, const json& object,
                                   const std::string& where) {
  Visibility v;
  auto size = read_count(object, "cube", size_t(max_cube_size), where),
       bits = read_count(object, "bits", size_t(max_visibility_bits), where),
       receivers = read_count(object, "receivers", 0xfffffffe, where),
       data = read_count(object, "bufferView", 0x7fffffff, where),
       lengths = read_count(object, "lengths", 0x7fffffff, where);
  for (const auto* count : {&size, &bits, &receivers, &data, &lengths})
    if (!*count) return count->error();
  if (!is_cube_size(int(*size)))
    return Error{where, "\"cube\" must be a multiple of 16 up to " + std::to_string(max_cube_size)};
  if (*bits < 1) return Error{where, "\"bits\" is 0"};
  auto records = view_bytes(chunks, *data, where), numbers = view_bytes(chunks, *lengths, where);
  if (!records) return records.error();
  if (!numbers) return numbers.error();
  if (*receivers > numbers->size()) return Error{where, "there are fewer lengths than receivers"};
  v.size = int(*size), v.bits = int(*bits), v.receivers = *receivers, v.data = *records;
  v.begin.reserve(*receivers + 1), v.begin.push_back(0);
  size_t at = 0;
  for (size_t r = 0; r < *receivers; ++r) {
    uint64_t length = 0;
    if (!read_varint(*numbers, at, length) || length > records->size() - v.begin.back())
      return Error{where, "the length of receiver " + std::to_string(r) + " is broken"};
    v.begin.push_back(v.begin.back() + length);
  }
  if (at != numbers->size()) return Error{where, "there are more lengths than receivers"};
  if (auto ok = check_visibility(v, where); !ok) return ok.error();
  v.storage = std::make_shared<MappedFile>(file);
  return v;
}

Result<LatticeTransfer> read_lattice(const GltfChunks& chunks, const MappedFile& file, const json& object,
                                     const LightBasis& light, const std::string& where) {
  if (!object.is_object()) return Error{where, "is not an object"};
  LatticeTransfer l;
  auto min = read_numbers(object, "min", 3, where), max = read_numbers(object, "max", 3, where);
  for (const auto* list : {&min, &max})
    if (!*list) return list->error();
  l.lattice.min = {(*min)[0], (*min)[1], (*min)[2]}, l.lattice.max = {(*max)[0], (*max)[1], (*max)[2]};
  for (int k = 0; k < 3; ++k)
    if (l.lattice.min[k] > l.lattice.max[k]) return Error{where, "its box is empty"};
  const auto points = object.find("points");
  if (points == object.end() || !points->is_array() || points->size() != 3)
    return Error{where, "\"points\" is not three numbers"};
  for (size_t k = 0; k < 3; ++k) {
    const json& n = (*points)[k];
    if (!n.is_number_unsigned() || n.get<uint64_t>() < 1 || n.get<uint64_t>() > uint64_t(max_lattice_points))
      return Error{where, "an axis must have from 1 to " + std::to_string(max_lattice_points) + " points"};
    (k == 0 ? l.lattice.nx : k == 1 ? l.lattice.ny : l.lattice.nz) = n.get<int>();
  }
  auto order = read_count(object, "order", size_t(max_sh_order), where);
  if (!order) return order.error();
  if (*order < 1) return Error{where, "its order is 0"};
  l.order = int(*order);
  l.transfer.light = light, l.transfer.rows = sh_count(l.order), l.transfer.receivers = l.lattice.count();
  if (auto ok = read_transfer_data(chunks, file, object, l.transfer, where); !ok) return ok.error();
  auto valid = read_values<uint8_t>(chunks, object, "valid", l.lattice.count(), where);
  if (!valid) return valid.error();
  l.valid = std::move(*valid);
  return l;
}

Result<std::vector<uint32_t>> read_receivers(const GltfChunks& chunks, const json& object, const char* key,
                                             size_t count, size_t receivers, const std::string& where) {
  auto map = read_values<uint32_t>(chunks, object, key, count, where);
  if (!map) return map.error();
  for (uint32_t r : *map)
    if (r != none && r >= receivers) return Error{where, "receiver " + std::to_string(r) + " is out of range"};
  return map;
}

// Gathers the parts' sides into a spatial basis.
struct SurfaceReader {
  const GltfChunks& chunks;
  Baked& baked;
  size_t receivers;
  SurfaceKind kind = SurfaceKind::vertices;
  int width = 0, height = 0;
  std::vector<uint32_t> texels, front, back;  // back: empty until a part has one
  std::vector<Vec2> front_at, back_at;

  Result<void> begin(const json& extension, const std::string& where) {
    const auto surface = extension.find("surface");
    if (surface != extension.end()) {
      if (!surface->is_object() || !surface->contains("kind")) return Error{where, "\"surface\" has no kind"};
      const auto name = std::find_if(std::begin(surface_kind_names), std::end(surface_kind_names),
                                     [&](const char* n) { return (*surface)["kind"] == n; });
      if (name == std::end(surface_kind_names))
        return Error{where, "receivers of this kind are not known to this program"};
      kind = SurfaceKind(name - std::begin(surface_kind_names));
    }
    if (kind == SurfaceKind::texels) {
      auto w = read_count(*surface, "width", 1 << 16, where), h = read_count(*surface, "height", 1 << 16, where);
      if (!w) return w.error();
      if (!h) return h.error();
      if (*w < 1 || *h < 1) return Error{where, "the atlas is empty"};
      auto map = read_receivers(chunks, *surface, "texels", *w * *h, receivers, where);
      if (!map) return map.error();
      width = int(*w), height = int(*h), texels = std::move(*map);
    }
    if (kind == SurfaceKind::texels) front_at.assign(elements(), Vec2(0));
    else front.assign(elements(), none);
    return {};
  }
  size_t elements() const {
    return kind == SurfaceKind::patches ? baked.scene.triangles.size() : baked.scene.positions.size();
  }

  Result<void> read_part(const json& entry, const Part& part, const std::string& where) {
    const size_t first = kind == SurfaceKind::patches ? part.first_triangle : part.first_vertex;
    const size_t count = kind == SurfaceKind::patches ? part.triangle_count : part.vertex_count;
    for (const char* side : {"front", "back"}) {
      const bool is_back = side[0] == 'b';
      if (is_back && !entry.contains("back")) continue;
      if (kind == SurfaceKind::texels) {
        auto at = read_values<Vec2>(chunks, entry, side, count, where);
        if (!at) return at.error();
        for (Vec2 p : *at)
          if (!(p.x >= 0 && p.x <= float(width) && p.y >= 0 && p.y <= float(height)))
            return Error{where, "a place lies outside the atlas"};
        if (is_back && back_at.empty()) back_at.assign(elements(), Vec2(0));
        std::copy(at->begin(), at->end(), (is_back ? back_at : front_at).begin() + ptrdiff_t(first));
      } else {
        auto map = read_receivers(chunks, entry, side, count, receivers, where);
        if (!map) return map.error();
        if (is_back && back.empty()) back.assign(elements(), none);
        std::copy(map->begin(), map->end(), (is_back ? back : front).begin() + ptrdiff_t(first));
      }
    }
    return {};
  }

  void finish() {
    const Scene& scene = baked.scene;
    if (kind == SurfaceKind::texels) {
      baked.basis = texel_receivers(scene, width, height, front_at, back_at, std::move(texels));
    } else if (kind == SurfaceKind::patches) {
      PatchReceivers patches;
      patches.front.resize(front.size()), patches.back.resize(back.size());
      for (size_t i = 0; i < front.size(); ++i) patches.front[i] = {front[i], scene.triangles[i].part};
      for (size_t i = 0; i < back.size(); ++i) patches.back[i] = {back[i], scene.triangles[i].part};
      baked.basis = std::move(patches);
    } else {
      baked.basis = corner_receivers(scene, front, back);
      baked.front = std::move(front), baked.back = std::move(back);
    }
  }
};

}  // namespace

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
  auto text = [&](const char* key) {
    return t->contains(key) && (*t)[key].is_string() ? (*t)[key].get<std::string>() : "";
  };
  baked.factors = text("kind") == "factors";
  const bool is_matrix = text("kind") == "matrix" || baked.factors, is_zonal = text("kind") == "zonal",
             is_blocks = text("kind") == "blocks";
  if (!is_matrix && !is_zonal && !is_blocks && text("kind") != "diffuse")
    return Error{where, "transfer of kind \"" + text("kind") + "\" is not known to this program"};
  auto light = is_blocks ? Result<LightBasis>(LightBasis{}) : read_light(*t, where);
  if (!light) return light.error();
  auto receivers = read_count(*t, "receivers", 0xfffffffe, where);
  if (!receivers) return receivers.error();
  if (t->contains("directional")) {
    const auto kind = directional_kind(text("directional"));
    if (!kind) return Error{where, "directional light \"" + text("directional") + "\" is not known to this program"};
    baked.directional = *kind;
    if (text("kind") != "diffuse" && *kind != DirectionalKind::none)
      return Error{where, "directional light is of diffuse transfer alone"};
  }
  if (is_blocks) {
    if (extension.contains("surface")) return Error{where, "visibility in blocks is baked at vertices"};
    auto visibility = read_visibility(*chunks, file, *t, where);
    if (!visibility) return visibility.error();
    baked.visibility = std::move(*visibility);
  } else if (is_zonal) {
    if (extension.contains("surface")) return Error{where, "zonal transfer is baked at vertices"};
    auto lobes = read_count(*t, "lobeCount", size_t(max_stored_lobes), where);
    if (!lobes) return lobes.error();
    if (*lobes < 1) return Error{where, "there are no lobes"};
    if (light->order < 1 || light->count() != size_t(sh_count(light->order)))
      return Error{where, "zonal transfer is of spherical harmonics alone"};
    ZonalTransfer& zonal = baked.zonal.emplace();
    zonal.order = light->order, zonal.lobes = int(*lobes), zonal.receivers = *receivers;
    if (t->contains("outgoing")) {
      auto rows = read_rows(*t, where);
      if (!rows) return rows.error();
      zonal.rows = *rows;
      auto outgoing = read_outgoing(*chunks, (*t)["outgoing"], *rows, *receivers, where + ": outgoing");
      if (!outgoing) return outgoing.error();
      baked.outgoing = std::move(*outgoing);
    }
    if (auto ok = read_transfer_data(*chunks, file, *t, zonal, where); !ok) return ok.error();
    if (t->contains("fitErrors")) {
      auto errors = read_values<float>(*chunks, *t, "fitErrors", *receivers, where);
      if (!errors) return errors.error();
      for (float e : *errors)
        if (!std::isfinite(e)) return Error{where, "the error of a fit is not finite"};
      baked.fit_errors = std::move(*errors);
    }
  } else {
    int rows = directional_rows(baked.directional);
    if (baked.factors && (rows != 1 || t->contains("cpca") || light->count() != size_t(sh_count(light->order))))
      return Error{where, "visibility as a factor is of harmonics alone, with one row"};
    if (is_matrix && !baked.factors) {
      auto count = read_rows(*t, where);
      if (!count) return count.error();
      rows = *count;
    }
    if (t->contains("cpca")) {
      CpcaTransfer& cpca = baked.cpca.emplace();
      cpca.light = std::move(*light), cpca.receivers = *receivers, cpca.rows = rows;
      if (auto ok = read_cpca(*chunks, *t, cpca, where + ": cpca"); !ok) return ok.error();
    } else {
      baked.transfer.light = std::move(*light), baked.transfer.receivers = *receivers, baked.transfer.rows = rows;
      if (auto ok = read_transfer_data(*chunks, file, *t, baked.transfer, where); !ok) return ok.error();
    }
    if (is_matrix) {
      if (!t->contains("outgoing") || !(*t)["outgoing"].is_object()) return Error{where, "\"outgoing\" is missing"};
      if (baked.factors) {
        auto order = read_count((*t)["outgoing"], "order", size_t(max_incident_order), where + ": outgoing");
        if (!order) return order.error();
        rows = sh_count(int(*order));
      }
      auto outgoing = read_outgoing(*chunks, (*t)["outgoing"], rows, *receivers, where + ": outgoing");
      if (!outgoing) return outgoing.error();
      if (baked.factors && (outgoing->kind != OutgoingKind::map || baked.transfer.light.order < outgoing->order ||
                            baked.transfer.channels != 1))
        return Error{
            where,
            "visibility as a factor has too few bands, or a last reflection of another kind, or more than one channel"};
      baked.outgoing = std::move(*outgoing);
    }
  }
  if (const auto object = extension.find("lattice"); object != extension.end() && !is_blocks) {
    auto lattice = read_lattice(*chunks, file, *object, light_of(baked), where + ": lattice");
    if (!lattice) return lattice.error();
    baked.lattice = std::move(*lattice);
  }

  const std::string folder = std::filesystem::path(path).parent_path().string();
  auto scene = load_gltf(file, path, folder.empty() ? "." : folder);
  if (!scene) return scene.error();
  baked.scene = std::move(*scene);
  const auto provenance = extension.find("provenance");
  baked.provenance = provenance == extension.end() ? "{}"
                                                   : provenance->dump(-1, ' ', false, json::error_handler_t::replace);
  if (const auto object = extension.find("view"); object != extension.end()) {
    if (is_zonal || is_matrix || is_blocks || baked.directional != DirectionalKind::none)
      return Error{where, "a fixed view has one row a pixel"};
    auto view = read_view(*chunks, *object, *receivers, where + ": view");
    if (!view) return view.error();
    baked.view = std::move(*view);
    return baked;
  }
  SurfaceReader surface{*chunks, baked, *receivers, SurfaceKind::vertices, 0, 0, {}, {}, {}, {}, {}};
  if (auto ok = surface.begin(extension, where); !ok) return ok.error();
  const auto parts = extension.find("parts");
  if (parts == extension.end() || !parts->is_array()) return Error{where, "\"parts\" is missing"};
  std::map<std::pair<size_t, size_t>, const json*> by_place;
  for (const json& part : *parts) {
    auto node = read_count(part, "node", 0x7fffffff, where),
         primitive = read_count(part, "primitive", 0x7fffffff, where);
    if (!node) return node.error();
    if (!primitive) return primitive.error();
    by_place[{*node, *primitive}] = &part;
  }
  for (const Part& part : baked.scene.parts) {
    const auto entry = by_place.find({size_t(part.node), size_t(part.primitive)});
    const std::string place = where + ": node " + std::to_string(part.node) + ", primitive " +
                              std::to_string(part.primitive);
    if (entry == by_place.end()) return Error{place, "has no receivers"};
    if (auto ok = surface.read_part(*entry->second, part, place); !ok) return ok.error();
  }
  surface.finish();
  return baked;
}

LightBasis light_of(const Baked& baked) {
  if (baked.zonal) return {.order = baked.zonal->order};
  if (baked.factors) return {.order = baked.transfer.light.order - baked.outgoing->order + 1};
  return baked.cpca ? baked.cpca->light : baked.transfer.light;
}

size_t receivers_of(const Baked& baked) {
  return baked.zonal ? baked.zonal->receivers : baked.cpca ? baked.cpca->receivers : baked.transfer.receivers;
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
