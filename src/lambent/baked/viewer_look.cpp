// glTF 2.0 specification (ISO/IEC 12113); KHR_materials_emissive_strength, KHR_materials_specular. A lightmap is shown
// as the emission of a black material without reflections: emission is core glTF, its strength goes beyond 1, and no
// viewer multiplies it by lights of its own. (KHR_materials_unlit would end at 1 and escape tone mapping.) For programs
// that know it, MOZ_lightmap: "index" and "texCoord" of a texture and the "intensity" that makes its linear values
// irradiance, as three.js's GLTFLightMapLoaderExtension and Hubs read it.
#include <lambent/baked/viewer_look.h>

#include <lambent/baked/extension.h>

#include <algorithm>
#include <map>
#include <optional>
#include <tuple>

namespace lambent {
namespace {

using nlohmann::json;

json& list(json& document, const char* key) {
  if (!document[key].is_array()) document[key] = json::array();
  return document[key];
}
size_t push(json& document, const char* key, json item) {
  list(document, key).push_back(std::move(item));
  return document[key].size() - 1;
}
void use_extension(json& document, const char* name) {
  json& used = list(document, "extensionsUsed");
  if (std::find(used.begin(), used.end(), name) == used.end()) used.push_back(name);
}

std::string texcoord(size_t set) { return "TEXCOORD_" + std::to_string(set); }

// Takes our notes out of all primitives.
void forget(json& document) {
  for (json& mesh : list(document, "meshes"))
    for (json& primitive : mesh["primitives"]) {
      const auto extensions = primitive.find("extensions");
      if (extensions == primitive.end()) continue;
      extensions->erase(extension_name);
      if (extensions->empty()) primitive.erase("extensions");
    }
}

}  // namespace

LookWriter::LookWriter(const Scene& scene, const SpatialBasis& basis, const ViewerLook* look)
    : scene_(scene), look_(look) {
  const auto* texels = std::get_if<TexelReceivers>(&basis);
  if (!texels) look_ = nullptr;
  if (!look_) return;
  const Vec2 size(float(texels->width), float(texels->height));
  for (const Part& part : scene.parts) {
    Side front, back;
    front.at.assign(part.vertex_count, Vec2(0)), back.at = front.at;
    for (uint32_t i = part.first_triangle; i < part.first_triangle + part.triangle_count; ++i) {
      const uint32_t* v = scene.triangles[i].v;
      for (size_t k = 0; k < 3; ++k) {
        if (const auto* at = texels->find(i, true)) front.at[v[k] - part.first_vertex] = at->at[k] / size;
        if (const auto* at = texels->find(i, false)) back.at[v[k] - part.first_vertex] = at->at[k] / size;
      }
      if (texels->find(i, false))
        for (int k : {0, 2, 1}) back.indices.push_back(v[k] - part.first_vertex);
    }
    fronts_.push_back(std::move(front)), backs_.push_back(std::move(back));
  }
}

const ViewerPicture& LookWriter::picture(size_t object) const {
  return look_->objects.empty() ? *look_ : look_->objects[object];
}

void LookWriter::add_blobs(std::vector<GltfBlob>& blobs) {
  first_blob_ = blobs.size();
  if (!look_) return;
  pictures_ = look_->kind == LookKind::coordinates ? 0 : std::max<size_t>(1, look_->objects.size());
  for (size_t i = 0; i < pictures_; ++i) blobs.push_back({picture(i).png, 4});
  for (const Side& side : fronts_) blobs.push_back({bytes_of(side.at), 4});
  for (const Side& side : backs_)
    if (!side.indices.empty()) blobs.push_back({bytes_of(side.at), 4}), blobs.push_back({bytes_of(side.indices), 4});
}

// What lets light pass looks so in any viewer: alpha, of black, and transmission, which the base colour tints.
void keep_see_through(json& document, const json& original, json& lit) {
  const json nothing = json::object();
  auto member = [&](const json& parent, const char* key) -> const json& {
    return parent.is_object() && parent.contains(key) ? parent[key] : nothing;
  };
  const json &pbr = member(original, "pbrMetallicRoughness"), &factor = member(pbr, "baseColorFactor");
  if (original.contains("alphaMode") && original["alphaMode"] != "OPAQUE") {
    lit["alphaMode"] = original["alphaMode"];
    if (original.contains("alphaCutoff")) lit["alphaCutoff"] = original["alphaCutoff"];
    if (factor.is_array() && factor.size() == 4) lit["pbrMetallicRoughness"]["baseColorFactor"][3] = factor[3];
    if (pbr.contains("baseColorTexture")) lit["pbrMetallicRoughness"]["baseColorTexture"] = pbr["baseColorTexture"];
  }
  const json& glass = member(member(original, "extensions"), "KHR_materials_transmission");
  if (glass.empty()) return;
  lit["pbrMetallicRoughness"] = pbr, lit["extensions"]["KHR_materials_transmission"] = glass;
  use_extension(document, "KHR_materials_transmission");
}

// A copy of the material that glows with the texture; lamps with their own emission, which, of those with a texture, is
// in ours.
size_t LookWriter::glowing_material(json& document, const json& original, size_t texture, size_t set) const {
  json lit = {
      {"pbrMetallicRoughness", {{"baseColorFactor", {0, 0, 0, 1}}, {"metallicFactor", 0}, {"roughnessFactor", 1}}},
      {"doubleSided", false}};
  json& extensions = lit["extensions"];
  extensions["KHR_materials_specular"] = {{"specularFactor", 0}};
  use_extension(document, "KHR_materials_specular"), use_extension(document, "KHR_materials_emissive_strength");
  const auto name = original.find("name");
  lit["name"] = (name != original.end() && name->is_string() ? name->get<std::string>() : "surface") + " with lightmap";
  keep_see_through(document, original, lit);
  double own[3] = {0, 0, 0};
  if (original.contains("emissiveFactor") && original["emissiveFactor"].is_array() &&
      original["emissiveFactor"].size() == 3)
    for (size_t c = 0; c < 3; ++c)
      own[c] = original["emissiveFactor"][c].is_number() ? original["emissiveFactor"][c].get<double>() : 0;
  if ((own[0] > 0 || own[1] > 0 || own[2] > 0) && !original.contains("emissiveTexture")) {
    lit["emissiveFactor"] = original["emissiveFactor"];
    const json none = json::object();
    const json& given = original.contains("extensions") ? original["extensions"] : none;
    if (given.is_object() && given.contains("KHR_materials_emissive_strength"))
      extensions["KHR_materials_emissive_strength"] = given["KHR_materials_emissive_strength"];
  } else {
    lit["emissiveFactor"] = {1, 1, 1};
    lit["emissiveTexture"] = {{"index", texture}, {"texCoord", set}};
    extensions["KHR_materials_emissive_strength"] = {{"emissiveStrength", look_->strength}};
  }
  return push(document, "materials", std::move(lit));
}

// A copy of the material that wears the lightmap. Backs are primitives of their own, with texels of their own.
size_t LookWriter::lit_material(json& document, const json& original, size_t texture, size_t set, size_t object) const {
  if (look_->kind == LookKind::emission) return glowing_material(document, original, texture, set);
  json lit = original;
  lit.erase("doubleSided");
  if (look_->kind == LookKind::coordinates) return push(document, "materials", std::move(lit));
  lit["extensions"]["MOZ_lightmap"] = {
      {"index", texture + object}, {"texCoord", set}, {"intensity", picture(object).strength}};
  use_extension(document, "MOZ_lightmap");
  return push(document, "materials", std::move(lit));
}

void LookWriter::write(json& document, const GltfPlaces& places) const {
  if (!look_) return;
  const int first_view = places.views[first_blob_].front();
  const size_t texture = document.contains("textures") ? document["textures"].size() : 0;  // the first of ours
  for (size_t i = 0; i < pictures_; ++i) {
    const size_t image = push(document, "images",
                              {{"bufferView", first_view + int(i)}, {"mimeType", "image/png"}, {"name", "lightmap"}});
    const size_t sampler =
        push(document, "samplers", {{"magFilter", 9729}, {"minFilter", 9729}, {"wrapS", 33071}, {"wrapT", 33071}});
    push(document, "textures", {{"source", image}, {"sampler", sampler}});
  }
  const int first_front = first_view + int(pictures_);
  std::optional<size_t> plain;                               // what primitives without a material have, spelt out
  std::map<std::tuple<size_t, size_t, size_t>, size_t> lit;  // by own material, set of texture coordinates, object
  int view = first_front + int(fronts_.size());              // of the backs
  auto places_accessor = [&](int buffer_view, size_t count) {
    return push(document, "accessors",
                {{"bufferView", buffer_view}, {"componentType", 5126}, {"count", count}, {"type", "VEC2"}});
  };
  for (size_t p = 0; p < scene_.parts.size(); ++p) {
    const Part& part = scene_.parts[p];
    if (part.vertex_count == 0) continue;
    json& mesh = document["meshes"][document["nodes"][size_t(places.part_nodes[p])]["mesh"].get<size_t>()];
    json& primitive = mesh["primitives"][size_t(places.part_primitives[p])];
    json& attributes = primitive["attributes"];
    json& ours = primitive["extensions"][extension_name];
    if (ours.is_null()) {  // fresh, and not shared with an earlier part
      ours = json::object();
      size_t set = 1;
      while (look_->kind != LookKind::coordinates && attributes.contains(texcoord(set))) ++set;
      if (set != 1) ours["texCoord"] = set;
      if (!primitive.contains("material")) {
        if (!plain) plain = push(document, "materials", {{"name", "default"}});
        primitive["material"] = *plain, ours["ownIsDefault"] = true;
      }
      const size_t own = primitive["material"].get<size_t>();
      ours["ownMaterial"] = own;
      auto [material, is_new] = lit.try_emplace({own, set, object_of(p)}, 0);
      if (is_new)
        material->second = lit_material(document, json(document["materials"][own]), texture, set, object_of(p));
      primitive["material"] = material->second;
    }
    const size_t front = places_accessor(first_front + int(p), part.vertex_count);
    attributes[texcoord(ours.value("texCoord", size_t{1}))] = front;
    if (!attributes.contains("TEXCOORD_0")) attributes["TEXCOORD_0"] = front;
    if (backs_[p].indices.empty()) continue;
    const size_t at = places_accessor(view, part.vertex_count);
    const size_t indices = push(
        document, "accessors",
        {{"bufferView", view + 1}, {"componentType", 5125}, {"count", backs_[p].indices.size()}, {"type", "SCALAR"}});
    view += 2;
    const size_t set = ours.value("texCoord", size_t{1});
    json back = {{"attributes", {{"POSITION", attributes["POSITION"]}}},
                 {"indices", indices},
                 {"material", lit.at({ours["ownMaterial"].get<size_t>(), set, object_of(p)})}};
    if (look_->kind == LookKind::emission) {
      for (size_t k = 0; k <= set; ++k) back["attributes"][texcoord(k)] = at;
    } else {  // the material's own textures too; normals would be those of the front
      back["attributes"] = attributes;
      back["attributes"].erase("NORMAL"), back["attributes"].erase("TANGENT");
      back["attributes"][texcoord(set)] = at;
    }
    back["extensions"][extension_name] = {{"viewerOnly", true}};
    mesh["primitives"].push_back(std::move(back));
  }
  if (look_->kind != LookKind::emission) forget(document);
}

std::optional<ViewerLook> load_look(const MappedFile& file, const std::string& path) {
  auto buffers = GltfBuffers::open(file, path, folder_of(path));
  if (!buffers) return std::nullopt;
  const json nothing;
  const auto member = [&](const json& parent, const char* key) -> const json& {
    return parent.is_object() && parent.contains(key) ? parent[key] : nothing;
  };
  const auto item = [&](const char* key, const json& index) -> const json& {
    const json& all = member(buffers->json(), key);
    return all.is_array() && index.is_number_unsigned() && index.get<size_t>() < all.size() ? all[index.get<size_t>()]
                                                                                            : nothing;
  };
  for (const json& mesh : member(buffers->json(), "meshes"))
    for (const json& primitive : member(mesh, "primitives")) {
      if (!member(member(member(primitive, "extensions"), extension_name), "ownMaterial").is_number()) continue;
      const json& material = item("materials", member(primitive, "material"));
      const json& strength =
          member(member(member(material, "extensions"), "KHR_materials_emissive_strength"), "emissiveStrength");
      const json& texture = item("textures", member(member(material, "emissiveTexture"), "index"));
      const json& image = item("images", member(texture, "source"));
      if (!strength.is_number() || !member(image, "bufferView").is_number_unsigned()) continue;  // a lamp's
      auto png = read_view({*buffers}, image, "bufferView", path);
      if (png) return ViewerLook{{{png->bytes.begin(), png->bytes.end()}, strength.get<float>()}};
    }
  return std::nullopt;
}

}  // namespace lambent
