#include <lambent/scene/gltf_unbake.h>

#include <lambent/scene/gltf_extensions.h>
#include <lambent/scene/gltf_read.h>

#include <algorithm>
#include <set>

namespace lambent {

using Json = nlohmann::json;

namespace {

constexpr const char* name = "LAMBENT_transfer";

const Json* member(const Json& parent, const char* key) {
  if (!parent.is_object()) return nullptr;
  const auto found = parent.find(key);
  return found == parent.end() ? nullptr : &*found;
}
std::optional<size_t> number(const Json& parent, const char* key) {
  GltfCheck check("");
  return parent.is_object() ? check.index(parent, key, INT32_MAX, {}) : std::nullopt;
}

// Whether any object that is a member of that name, of extensions too, names the item.
bool is_used(const Json& value, size_t item, bool (*names)(const std::string& key), const char* key) {
  if (!value.is_structured()) return false;
  for (const auto& [member_name, inner] : value.items()) {
    if (value.is_object() && names(member_name) && number(inner, key) == item) return true;
    if (is_used(inner, item, names, key)) return true;
  }
  return false;
}
bool uses_texture(const Json& document, size_t texture) {
  const auto names = [](const std::string& key) { return key.ends_with("Texture"); };
  const Json* materials = member(document, "materials");
  return materials && is_used(*materials, texture, names, "index");
}
bool uses_in_textures(const Json& document, const char* key, size_t item) {
  const Json* textures = member(document, "textures");
  return textures &&
         std::any_of(textures->begin(), textures->end(), [&](const Json& t) { return number(t, key) == item; });
}

// The bake appends: what it put in is at the end, in documents that nobody has touched since.
void drop_last(Json& document, const char* list) {
  document[list].erase(document[list].size() - 1);
  if (document[list].empty()) document.erase(list);
}
bool is_last(const Json& document, const char* list, std::optional<size_t> item) {
  return item && *item + 1 == gltf_count(document, list);
}

// What one bake's primitives wore.
struct Worn {
  std::set<size_t> lit, plain;  // materials for viewers; those that stand for no material
  std::set<size_t> kept;        // what primitives wear without us
};

void restore_primitive(Json& primitive, Worn& worn) {
  const Json ours = take_extension(primitive, name);
  if (!ours.is_object()) return;
  const auto own = number(ours, "ownMaterial");
  if (!own) return;
  if (const auto lit = number(primitive, "material")) worn.lit.insert(*lit);
  if (ours.value("ownIsDefault", Json()) == true) worn.plain.insert(*own), primitive.erase("material");
  else primitive["material"] = ours["ownMaterial"];
  const auto attributes = primitive.find("attributes");
  if (attributes == primitive.end() || !attributes->is_object()) return;
  const std::string set = "TEXCOORD_" + std::to_string(number(ours, "texCoord").value_or(1));
  const auto places = attributes->find(set);
  if (places == attributes->end()) return;
  // Sets have no gaps: where there was none, ours stands for the first as well.
  const Json accessor = *places;
  attributes->erase(places);
  if (const auto filler = attributes->find("TEXCOORD_0"); filler != attributes->end() && *filler == accessor)
    attributes->erase(filler);
}

void drop_materials(Json& document, const Worn& worn) {
  std::set<size_t> textures;
  const auto ours = [&](size_t m) {
    return (worn.lit.contains(m) || worn.plain.contains(m)) && !worn.kept.contains(m);
  };
  for (size_t count = gltf_count(document, "materials"); count > 0 && ours(count - 1); --count) {
    if (const Json* map = member(document["materials"][count - 1], "emissiveTexture"))
      if (const auto texture = number(*map, "index")) textures.insert(*texture);
    drop_last(document, "materials");
  }
  for (auto texture = textures.rbegin(); texture != textures.rend(); ++texture) {
    if (!is_last(document, "textures", *texture) || uses_texture(document, *texture)) continue;
    const auto image = number(document["textures"][*texture], "source"),
               sampler = number(document["textures"][*texture], "sampler");
    drop_last(document, "textures");
    if (is_last(document, "images", image) && !uses_in_textures(document, "source", *image))
      drop_last(document, "images");
    if (is_last(document, "samplers", sampler) && !uses_in_textures(document, "sampler", *sampler))
      drop_last(document, "samplers");
  }
}

}  // namespace

bool unbake(Json& document) {
  const bool was_baked = !take_extension(document, name).is_null();
  Worn worn;
  for (size_t m = 0; m < gltf_count(document, "meshes"); ++m) {
    const auto primitives = document["meshes"][m].find("primitives");
    if (primitives == document["meshes"][m].end() || !primitives->is_array()) continue;
    Json kept = Json::array();
    for (Json& primitive : *primitives) {
      const Json* extensions = member(primitive, "extensions");
      const Json* ours = extensions ? member(*extensions, name) : nullptr;
      if (ours && ours->is_object() && ours->value("viewerOnly", Json()) == true) continue;
      restore_primitive(primitive, worn);
      if (const auto material = number(primitive, "material")) worn.kept.insert(*material);
      kept.push_back(std::move(primitive));
    }
    *primitives = std::move(kept);
  }
  if (!worn.lit.empty()) drop_materials(document, worn);

  const auto used = document.find("extensionsUsed");
  if (used == document.end() || !used->is_array()) return was_baked;
  Json kept = Json::array();
  for (Json& listed : *used) {
    const bool ours = listed == name,
               looks = listed == "KHR_materials_specular" || listed == "KHR_materials_emissive_strength";
    const bool gone = looks && !worn.lit.empty() && !uses_extension(document, listed.get<std::string>().c_str());
    if (!ours && !gone) kept.push_back(std::move(listed));
  }
  if (kept.empty()) document.erase(used);
  else *used = std::move(kept);
  return was_baked;
}

}  // namespace lambent
