#include <lambent/scene/gltf_extensions.h>

#include <lambent/core/uri.h>
#include <lambent/scene/gltf_read.h>

#include <algorithm>
#include <map>
#include <set>

namespace lambent {

using Json = nlohmann::json;

namespace {

const std::set<std::string> read_extensions{
    "EXT_mesh_gpu_instancing",    "EXT_meshopt_compression", "EXT_texture_webp",
    "KHR_draco_mesh_compression", "KHR_lights_punctual",     "KHR_materials_emissive_strength",
    "KHR_materials_ior",          "KHR_materials_specular",  "KHR_materials_transmission",
    "KHR_materials_unlit",        "KHR_mesh_quantization",   "KHR_meshopt_compression",
    "KHR_node_visibility",        "KHR_texture_transform",   "LAMBENT_transfer"};

// Those that say where an image is, beside "source". Textures without another image are left out, and files may
// require them.
constexpr const char* unread_images[] = {"KHR_texture_basisu", "EXT_texture_avif", "MSFT_texture_dds"};

// What a picture lacks without them.
const std::map<std::string, const char*> unread_extensions{
    {"ADOBE_materials_thin_transparency", "no light passes through thin surfaces"},
    {"EXT_lights_image_based", "the environment in the file gives no light"},
    {"KHR_animation_pointer", "what it moves stands still"},
    {"KHR_gaussian_splatting", "splats are not shown"},
    {"KHR_materials_anisotropy", "highlights are round"},
    {"KHR_materials_clearcoat", "surfaces have no clear coat"},
    {"KHR_materials_diffuse_transmission", "no light passes through thin surfaces"},
    {"KHR_materials_dispersion", "nothing splits light into colours"},
    {"KHR_materials_iridescence", "thin films have no colours"},
    {"KHR_materials_pbrSpecularGlossiness", "surfaces have its diffuse colour and glossiness alone"},
    {"KHR_materials_sheen", "cloth has no sheen"},
    {"KHR_materials_subsurface", "no light passes below the surface"},
    {"KHR_materials_volume", "nothing absorbs light inside"},
    {"KHR_materials_volume_scatter", "nothing scatters light inside"},
    {"KHR_techniques_webgl", "materials made by shaders are plain"}};

// What leaves the picture as it is: of other uses, or with all that counts in the core's members too.
const std::set<std::string> silent_extensions{"AGI_articulations",
                                              "AGI_stk_metadata",
                                              "CESIUM_primitive_outline",
                                              "EXT_feature_metadata",
                                              "EXT_mesh_features",
                                              "EXT_structural_metadata",
                                              "EXT_texture_avif",
                                              "FB_geometry_metadata",
                                              "GODOT_single_root",
                                              "KHR_audio_emitter",
                                              "KHR_implicit_shapes",
                                              "KHR_interactivity",
                                              "KHR_materials_variants",
                                              "KHR_node_hoverability",
                                              "KHR_node_selectability",
                                              "KHR_physics_rigid_bodies",
                                              "KHR_texture_basisu",
                                              "KHR_xmp",
                                              "KHR_xmp_json_ld",
                                              "MSFT_lod",
                                              "MSFT_packing_normalRoughnessMetallic",
                                              "MSFT_packing_occlusionRoughnessMetallic",
                                              "MSFT_texture_dds"};

// Counts the objects that have each extension.
void count_extensions(const Json& value, std::map<std::string, size_t>& counts) {
  if (value.is_array())
    for (const Json& inner : value) count_extensions(inner, counts);
  if (!value.is_object()) return;
  for (const auto& [key, inner] : value.items()) {
    if (key == "extras") continue;
    if (key == "extensions" && inner.is_object())
      for (const auto& [name, extension] : inner.items()) ++counts[name];
    count_extensions(inner, counts);
  }
}

const Json* member(const Json& parent, const char* key) {
  if (!parent.is_object()) return nullptr;
  const auto found = parent.find(key);
  return found == parent.end() ? nullptr : &*found;
}

// The extension that holds a texture's only image, where it is not read; null for textures that are.
const char* unread_image(const Json& texture) {
  if (member(texture, "source") || find_extension(texture, "EXT_texture_webp")) return nullptr;
  for (const char* name : unread_images)
    if (find_extension(texture, name)) return name;
  return nullptr;
}

// Takes references to such textures out of an object, and of all in it. `names` has the extension of each texture.
void drop_references(Json& value, const std::vector<const char*>& names, std::set<size_t>& dropped) {
  if (!value.is_structured()) return;
  std::vector<std::string> gone;
  for (auto& [key, inner] : value.items()) {
    drop_references(inner, names, dropped);
    if (!value.is_object() || !key.ends_with("Texture") || !inner.is_object()) continue;
    GltfCheck check("");
    const auto index = check.index(inner, "index", names.size(), {});
    if (index && names[*index]) gone.push_back(key), dropped.insert(*index);
  }
  for (const std::string& key : gone) {
    value.erase(key);
    if (key == "emissiveTexture") value.erase("emissiveFactor");
    if (key == "transmissionTexture") value.erase("transmissionFactor");
  }
}

}  // namespace

bool is_supported_extension(const std::string& name) {
  return read_extensions.contains(name) || name.starts_with("KHR_materials_") ||
         std::find(std::begin(unread_images), std::end(unread_images), name) != std::end(unread_images);
}

void warn_of_unread_extensions(const Json& document, std::vector<std::string>& warnings) {
  std::map<std::string, size_t> counts;
  count_extensions(document, counts);
  std::string unknown;
  for (const auto& [name, count] : counts) {
    if (read_extensions.contains(name) || silent_extensions.contains(name)) continue;
    const auto effect = unread_extensions.find(name);
    if (effect != unread_extensions.end())
      warnings.push_back(name + " is not read: " + effect->second + " (" + std::to_string(count) +
                         (count == 1 ? " place)" : " places)"));
    else unknown += (unknown.empty() ? "" : ", ") + in_quotes(name);
  }
  if (!unknown.empty()) warnings.push_back("extensions that are not known, and may change the picture: " + unknown);
}

void drop_unread_textures(Json& document, std::vector<std::string>& warnings) {
  if (!document.contains("materials")) return;
  std::vector<const char*> names(gltf_count(document, "textures"));
  for (size_t i = 0; i < names.size(); ++i) names[i] = unread_image(document["textures"][i]);
  std::set<size_t> dropped;
  drop_references(document["materials"], names, dropped);
  for (const char* name : unread_images) {
    const auto count = std::count_if(dropped.begin(), dropped.end(), [&](size_t i) { return names[i] == name; });
    if (count)
      warnings.push_back(std::to_string(count) + (count == 1 ? " texture is" : " textures are") +
                         " left out, their colour factors stand alone: the image is a " + name + ", which is not read");
  }
  // Nothing needs these images any more, and readers without them may read what is written.
  if (const auto required = document.find("extensionsRequired"); required != document.end()) {
    Json kept = Json::array();
    for (Json& listed : *required)
      if (std::none_of(std::begin(unread_images), std::end(unread_images), [&](const char* n) { return listed == n; }))
        kept.push_back(std::move(listed));
    if (kept.empty()) document.erase(required);
    else *required = std::move(kept);
  }
}

const Json* find_extension(const Json& holder, const char* name) {
  const Json* extensions = member(holder, "extensions");
  return extensions ? member(*extensions, name) : nullptr;
}

Json take_extension(Json& holder, const char* name) {
  if (!holder.is_object()) return {};
  const auto all = holder.find("extensions");
  if (all == holder.end() || !all->is_object()) return {};
  const auto ours = all->find(name);
  if (ours == all->end()) return {};
  Json taken = std::move(*ours);
  all->erase(ours);
  if (all->empty()) holder.erase(all);
  return taken;
}

bool uses_extension(const Json& value, const char* name) {
  if (!value.is_structured()) return false;
  if (find_extension(value, name)) return true;
  return std::any_of(value.begin(), value.end(), [&](const Json& inner) { return uses_extension(inner, name); });
}

void drop_extension_name(Json& document, const char* name) {
  if (uses_extension(document, name)) return;
  for (const char* key : {"extensionsUsed", "extensionsRequired"}) {
    const auto list = document.find(key);
    if (list == document.end() || !list->is_array()) continue;
    Json kept = Json::array();
    for (Json& listed : *list)
      if (listed != name) kept.push_back(std::move(listed));
    if (kept.empty()) document.erase(key);
    else *list = std::move(kept);
  }
}

}  // namespace lambent
