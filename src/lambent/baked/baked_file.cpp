#include <lambent/baked/baked_file.h>

#include <lambent/baked/extension.h>
#include <lambent/scene/exclude.h>
#include <lambent/baked/viewer_look.h>
#include <lambent/core/check.h>
#include <lambent/core/uri.h>
#include <lambent/scene/gltf.h>
#include <lambent/scene/load.h>
#include <lambent/core/overloaded.h>

#include <algorithm>
#include <set>
#include <filesystem>
#include <map>

namespace lambent {

using nlohmann::json;

namespace {

std::vector<Vec2> places_of(const Scene& scene, const std::vector<TexelTriangle>& side) {
  if (side.empty()) return {};
  std::vector<Vec2> at(scene.positions.size(), Vec2(0));
  for (size_t i = 0; i < side.size(); ++i)
    if (side[i].part != none)
      for (size_t k = 0; k < 3; ++k) at[scene.triangles[i].v[k]] = side[i].at[k];
  return at;
}

std::vector<uint32_t> receivers_of_patches(const std::vector<Patch>& side) {
  std::vector<uint32_t> out;
  for (const Patch& patch : side) out.push_back(patch.receiver);
  return out;
}

std::vector<Patch> patches_of(const Scene& scene, const std::vector<uint32_t>& side) {
  std::vector<Patch> out;
  for (size_t i = 0; i < side.size(); ++i) out.push_back({side[i], scene.triangles[i].part});
  return out;
}

// The runs of the scene's parts in its placement.
std::vector<BakedPart> scene_parts(const Scene& scene, const Placement& where) {
  std::vector<BakedPart> parts;
  const bool triangles = std::holds_alternative<PatchPlacement>(where);
  for (const Part& p : scene.parts)
    parts.push_back({p.node, p.primitive, triangles ? p.first_triangle : p.first_vertex,
                     triangles ? p.triangle_count : p.vertex_count});
  return parts;
}

// Brings one side from the file's parts to the scene's.
template <class T>
void rearrange(std::vector<T>& side, std::span<const BakedPart> from, std::span<const BakedPart> to, T nothing) {
  if (side.empty()) return;
  const size_t count = to.empty() ? 0 : to.back().first + to.back().count;
  std::vector<T> out(count, nothing);
  for (size_t p = 0; p < to.size(); ++p)
    std::copy_n(side.begin() + ptrdiff_t(from[p].first), to[p].count, out.begin() + ptrdiff_t(to[p].first));
  side = std::move(out);
}

// Finds for each part of the scene its run in the file, and brings the placement into the scene's order.
Result<void> fit_to_scene(const Scene& scene, Placement& where, std::vector<BakedPart>& parts,
                          const std::string& path) {
  if (std::holds_alternative<FixedView>(where)) return {};
  std::map<std::pair<int, int>, BakedPart> by_place;
  for (const BakedPart& part : parts) by_place[{part.node, part.primitive}] = part;
  const std::vector<BakedPart> wanted = scene_parts(scene, where);
  std::vector<BakedPart> found;
  for (const BakedPart& part : wanted) {
    const auto entry = by_place.find({part.node, part.primitive});
    const std::string place = path + ": " + extension_name + ": node " + std::to_string(part.node) + ", primitive " +
                              std::to_string(part.primitive);
    if (entry == by_place.end()) return Error{place, "has no receivers"};
    if (entry->second.count != part.count)
      return Error{place, "has receivers for " + std::to_string(entry->second.count) + " of its " +
                              std::to_string(part.count) + " vertices or triangles"};
    found.push_back(entry->second);
  }
  std::visit(
      Overloaded{[&](TexelPlacement& p) {
                   rearrange(p.front, found, wanted, Vec2(0)), rearrange(p.back, found, wanted, Vec2(0));
                 },
                 [&](VertexPlacement& p) {
                   for (auto* side : {&p.front, &p.back, &p.input}) rearrange(*side, found, wanted, none);
                 },
                 [&](FixedView&) {}, [&](LatticePlacement&) {}, [&](ShellPlacement&) {},
                 [&](auto& p) { rearrange(p.front, found, wanted, none), rearrange(p.back, found, wanted, none); }},
      where);
  parts = wanted;
  return {};
}

}  // namespace

Placement placement_of(const Scene& scene, const Receivers& receivers) {
  return std::visit(
      Overloaded{
          [&](const CornerReceivers&) -> Placement {
            return VertexPlacement{receivers.front, receivers.back, scene.input, scene.input_count};
          },
          [&](const TexelReceivers& t) -> Placement {
            return TexelPlacement{t.width, t.height, t.texels, places_of(scene, t.front), places_of(scene, t.back)};
          },
          [&](const PatchReceivers& p) -> Placement {
            return PatchPlacement{receivers_of_patches(p.front), receivers_of_patches(p.back)};
          },
          // Points are baked with, and their values kept at vertices.
          [&](const PointReceivers&) -> Placement { return {}; }},
      receivers.basis);
}

SpatialBasis spatial_basis(const Scene& scene, const Placement& where) {
  return std::visit(
      Overloaded{[&](const VertexPlacement& p) -> SpatialBasis { return corner_receivers(scene, p.front, p.back); },
                 [&](const TexelPlacement& p) -> SpatialBasis {
                   return texel_receivers(scene, p.width, p.height, p.front, p.back, p.texels);
                 },
                 [&](const PatchPlacement& p) -> SpatialBasis {
                   return PatchReceivers{patches_of(scene, p.front), patches_of(scene, p.back)};
                 },
                 [&](const auto&) -> SpatialBasis { return CornerReceivers{}; }},
      where);
}

Baked make_baked(Scene scene, const Receivers& receivers, Store store, Rows rows) {
  Baked baked;
  baked.surface = {placement_of(scene, receivers), std::move(store), std::move(rows)};
  baked.parts = scene_parts(scene, baked.surface.where);
  baked.basis = receivers.basis;
  baked.excluded = scene.excluded;
  baked.scene = std::move(scene);
  LAMBENT_CHECK(is_consistent(baked.surface));
  return baked;
}

Baked make_baked(Scene scene, FixedView view, Store store) {
  Baked baked;
  baked.surface = {std::move(view), std::move(store), PixelRows{}};
  baked.excluded = scene.excluded;
  baked.scene = std::move(scene);
  LAMBENT_CHECK(is_consistent(baked.surface));
  return baked;
}

const Field* lattice_of(const Baked& baked) {
  for (const Field& field : baked.more)
    if (std::holds_alternative<LatticePlacement>(field.where)) return &field;
  return nullptr;
}

const Field* hiding_of(const Baked& baked) {
  for (const Field& field : baked.more)
    if (std::holds_alternative<HiddenRows>(field.rows)) return &field;
  return nullptr;
}

namespace {

// Light that arrives around an object, by harmonics or by its own lamps.
const Field* arriving_around(const Baked& baked, bool by_harmonics) {
  for (const Field& field : baked.more)
    if (std::holds_alternative<ShellPlacement>(field.where) && std::holds_alternative<IncidentRows>(field.rows) &&
        (light_of(field.store).order > 0) == by_harmonics)
      return &field;
  return nullptr;
}

}  // namespace

const Field* shining_of(const Baked& baked) { return arriving_around(baked, false); }
const Field* reflecting_of(const Baked& baked) { return arriving_around(baked, true); }

Result<void> save_baked(const std::string& path, const Baked& baked, const ViewerLook* look, size_t bin_limit) {
  BlobWriter bulk;
  json extension = encode_fields(baked, bulk);
  std::vector<GltfBlob> blobs;
  for (const BlobWriter::Blob& blob : bulk.blobs) blobs.push_back({blob.bytes, blob.alignment, true});
  LookWriter look_writer(baked.scene, baked.basis, look);
  look_writer.add_blobs(blobs);
  const auto extend = [&](json& document, const GltfPlaces& places) {
    resolve_views(extension, places.views);
    json parts = json::array();
    for (size_t i = 0; i < extension["parts"].size(); ++i) {
      if (places.part_nodes[i] < 0) continue;  // a part without vertices, which the file does not have
      parts.push_back(std::move(extension["parts"][i]));
      parts.back()["node"] = places.part_nodes[i], parts.back()["primitive"] = places.part_primitives[i];
    }
    extension["parts"] = std::move(parts);
    look_writer.write(document, places);
    extension["written"] = written_state(document);
    document["extensions"][extension_name] = std::move(extension);
    json& used = document["extensionsUsed"];
    if (!used.is_array()) used = json::array();
    if (std::find(used.begin(), used.end(), extension_name) == used.end()) used.push_back(extension_name);
  };
  return save_gltf(path, baked.scene, blobs, extend, bin_limit);
}

namespace {

// Nodes with meshes get names that no other has; then the names of each part's node and of those above it.
std::vector<std::vector<std::string>> name_nodes(json& document, const GltfPlaces& places) {
  std::set<std::string> taken;
  std::vector<size_t> parents(document["nodes"].size(), SIZE_MAX);
  for (size_t n = 0; n < document["nodes"].size(); ++n) {
    json& node = document["nodes"][n];
    if (node.contains("children"))
      for (const json& child : node["children"]) parents[child.get<size_t>()] = n;
    const bool named = node.contains("name") && node["name"].is_string() && node["name"] != "";
    const std::string given = named ? node["name"].get<std::string>() : "node";
    std::string name = given;
    for (int i = 2; !taken.insert(name).second; ++i) name = given + "_" + std::to_string(i);
    node["name"] = name;
  }
  std::vector<std::vector<std::string>> out;
  for (int node : places.part_nodes) {
    std::vector<std::string> names;
    for (size_t n = node < 0 ? SIZE_MAX : size_t(node); n != SIZE_MAX; n = parents[n])
      names.insert(names.begin(), document["nodes"][n]["name"].get<std::string>());
    out.push_back(std::move(names));
  }
  return out;
}

// Whether some texture is looked up in this set.
bool uses_set(const Scene& scene, int set) {
  return std::any_of(scene.materials.begin(), scene.materials.end(), [&](const Material& m) {
    return (m.base_color_texture >= 0 && m.texcoord_set == set) ||
           (m.transmission_texture >= 0 && m.transmission_set == set) ||
           (m.metallic_roughness_texture >= 0 && m.metallic_roughness_set == set) ||
           (m.normal_texture >= 0 && m.normal_set == set) || (m.emissive_texture >= 0 && m.emissive_set == set);
  });
}

}  // namespace

Result<void> save_look(const std::string& path, const Baked& baked, const ViewerLook& look,
                       std::vector<std::vector<std::string>>* nodes) {
  if (look.kind == LookKind::coordinates && uses_set(baked.scene, 1))
    return Error{path, "would lose texture coordinates: materials use the second set, which is the lightmap's there"};
  std::vector<GltfBlob> blobs;
  LookWriter look_writer(baked.scene, baked.basis, &look);
  look_writer.add_blobs(blobs);
  return save_gltf(path, baked.scene, blobs, [&](json& document, const GltfPlaces& places) {
    look_writer.write(document, places);
    if (look.kind != LookKind::coordinates) return;
    auto named = name_nodes(document, places);
    if (nodes) *nodes = std::move(named);
  });
}

Result<Baked> load_baked(const std::string& path) {
  auto file = MappedFile::open(path);
  if (!file) return file.error();
  return load_baked(*file, path);
}

Result<Baked> load_baked(const MappedFile& file, const std::string& path) {
  auto fields = read_fields(file, path);
  if (!fields) return fields.error();
  auto scene = load_gltf(file, path, folder_of(path));
  if (!scene) return scene.error();
  exclude_parts(*scene, fields->excluded);  // of inputs without a document they are not there
  if (auto ok = fit_to_scene(*scene, fields->surface.where, fields->parts, path); !ok) return ok.error();
  Baked baked{std::move(*fields), std::move(*scene), {}};
  baked.basis = spatial_basis(baked.scene, baked.surface.where);
  return baked;
}

std::vector<std::string> files_of(const std::string& path) {
  std::vector<std::string> out{path};
  auto file = MappedFile::open(path);
  if (!file || file->bytes().empty()) return out;
  auto chunks = split_gltf(file->bytes(), path);
  if (!chunks || !chunks->json.contains("buffers")) return out;
  for (const json& buffer : chunks->json["buffers"]) {
    const json uri = buffer.is_object() ? buffer.value("uri", json()) : json();
    if (!uri.is_string() || is_data_uri(uri.get<std::string>())) continue;
    if (auto found = find_external_file(uri.get<std::string>(), folder_of(path), path); found) out.push_back(*found);
  }
  return out;
}

size_t bytes_on_disk(const std::string& path) {
  size_t bytes = 0;
  for (const std::string& file : files_of(path)) {
    std::error_code status;
    const uintmax_t size = std::filesystem::file_size(file, status);
    bytes += status ? 0 : size_t(size);
  }
  return bytes;
}

bool is_baked(const std::string& path) {
  auto file = MappedFile::open(path);
  if (!file || file->bytes().empty()) return false;
  auto chunks = split_gltf(file->bytes(), path);
  return chunks && has_extension(chunks->json);
}

}  // namespace lambent
