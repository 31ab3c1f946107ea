// glTF 2.0 specification (ISO/IEC 12113), sections 3.8 and 3.9; KHR_texture_transform, KHR_materials_emissive_strength,
// KHR_materials_unlit, KHR_materials_ior, KHR_materials_specular, KHR_materials_pbrSpecularGlossiness,
// EXT_texture_webp.
#include <lambent/scene/gltf_materials.h>

#include <lambent/core/uri.h>
#include <lambent/scene/textures.h>

#include <map>
#include <tuple>

namespace lambent {

using Json = nlohmann::json;

namespace {

const Json* read_extension(GltfCheck& check, const Json& parent, const char* name, const GltfWhere& where) {
  const Json* extensions = check.object(parent, "extensions", where);
  return extensions ? check.object(*extensions, name, where) : nullptr;
}

// `key` names a texture reference, a textureInfo of the specification.
void read_texture_reference(GltfCheck& check, const Json& parent, const char* key, size_t texture_count,
                            const GltfWhere& where, GltfTextureUse& out) {
  const Json* info = check.object(parent, key, where);
  if (!info) return;
  out.texture = check.index(*info, "index", texture_count, where);
  if (check.ok() && !out.texture) check.fail(where, std::string(key) + " names no texture");
  out.texcoord_set = check.integer(*info, "texCoord", 0, UINT32_MAX, where);
  const Json* transform = read_extension(check, *info, "KHR_texture_transform", where);
  if (!transform) return;
  out.texcoord_set = check.integer(*transform, "texCoord", out.texcoord_set, UINT32_MAX, where);
  double offset[2] = {0, 0}, scale[2] = {1, 1};
  check.numbers(*transform, "offset", offset, where);
  check.numbers(*transform, "scale", scale, where);
  double angle = check.number(*transform, "rotation", 0, where), c = std::cos(angle), s = std::sin(angle);
  // Counter-clockwise as seen with v pointing down.
  out.transform = {float(c * scale[0]),  float(s * scale[1]), float(offset[0]),
                   float(-s * scale[0]), float(c * scale[1]), float(offset[1])};
}

Vec3 read_color(GltfCheck& check, const Json& parent, const char* key, const GltfWhere& where, float& alpha) {
  double rgba[4] = {1, 1, 1, 1};
  check.numbers(parent, key, rgba, where);
  alpha = float(std::clamp(rgba[3], 0.0, 1.0));
  return {float(std::clamp(rgba[0], 0.0, 1.0)), float(std::clamp(rgba[1], 0.0, 1.0)),
          float(std::clamp(rgba[2], 0.0, 1.0))};
}

float read_share(GltfCheck& check, const Json& parent, const char* key, const GltfWhere& where, double fallback = 1) {
  return float(std::clamp(check.number(parent, key, fallback, where), 0.0, 1.0));
}

// Alpha mode, cutoff and transmission.
void read_see_through(GltfCheck& check, const Json& json, size_t texture_count, const GltfWhere& where,
                      GltfMaterial& out) {
  Material& m = out.material;
  const std::string mode = check.text(json, "alphaMode", where);
  if (mode == "MASK") m.alpha_mode = AlphaMode::mask;
  else if (mode == "BLEND") m.alpha_mode = AlphaMode::blend;
  else out.known_alpha_mode = mode.empty() || mode == "OPAQUE";
  constexpr double beyond_all = 2;  // above 1 nothing is left
  m.alpha_cutoff = float(std::clamp(check.number(json, "alphaCutoff", 0.5, where), 0.0, beyond_all));
  if (const Json* extension = read_extension(check, json, "KHR_materials_transmission", where)) {
    m.transmission = read_share(check, *extension, "transmissionFactor", where, 0);
    read_texture_reference(check, *extension, "transmissionTexture", texture_count, where, out.transmission);
  }
  if (!(m.transmission > 0)) return;
  const Json* volume = read_extension(check, json, "KHR_materials_volume", where);
  out.bends_light = m.roughness > 0.1f || (volume && check.number(*volume, "thicknessFactor", 0, where) > 0);
}

// Fresnel's reflectance of the part that is no metal. An index of 0 stands for a mirror.
void read_dielectric(GltfCheck& check, const Json& json, const GltfWhere& where, GltfMaterial& out) {
  double index = 1.5, weight = 1, color[3] = {1, 1, 1};
  if (const Json* ior = read_extension(check, json, "KHR_materials_ior", where))
    index = std::max(0.0, check.number(*ior, "ior", index, where));
  if (const Json* specular = read_extension(check, json, "KHR_materials_specular", where)) {
    weight = std::clamp(check.number(*specular, "specularFactor", weight, where), 0.0, 1.0);
    check.numbers(*specular, "specularColorFactor", color, where);
    out.specular_textures = specular->contains("specularTexture") || specular->contains("specularColorTexture");
  }
  const double root = (index - 1) / (index + 1);
  for (int c = 0; c < 3; ++c)
    out.material.dielectric_f0[c] = float(weight * std::clamp(root * root * color[c], 0.0, 1.0));
  out.material.dielectric_f90 = float(weight);
}

GltfMaterial read_material(GltfCheck& check, const Json& json, size_t texture_count, const GltfWhere& where) {
  GltfMaterial out;
  Material& m = out.material;
  m.name = check.text(json, "name", where);
  m.unlit = read_extension(check, json, "KHR_materials_unlit", where) != nullptr;
  m.double_sided = check.boolean(json, "doubleSided", false, where);
  const Json* gloss = read_extension(check, json, "KHR_materials_pbrSpecularGlossiness", where);
  if (gloss && !m.unlit) {
    m.base_color = read_color(check, *gloss, "diffuseFactor", where, m.alpha);
    m.metallic = 0.0f;
    m.roughness = 1.0f - read_share(check, *gloss, "glossinessFactor", where);
    read_texture_reference(check, *gloss, "diffuseTexture", texture_count, where, out.base_color);
  } else if (const Json* pbr = check.object(json, "pbrMetallicRoughness", where)) {
    m.base_color = read_color(check, *pbr, "baseColorFactor", where, m.alpha);
    m.metallic = read_share(check, *pbr, "metallicFactor", where);
    m.roughness = read_share(check, *pbr, "roughnessFactor", where);
    read_texture_reference(check, *pbr, "baseColorTexture", texture_count, where, out.base_color);
    read_texture_reference(check, *pbr, "metallicRoughnessTexture", texture_count, where, out.metallic_roughness);
  }
  read_see_through(check, json, texture_count, where, out);
  if (m.unlit) {  // of all else, only the colour counts
    m.metallic = 0, m.roughness = 1, out.metallic_roughness = {};
    m.transmission = 0, out.transmission = {}, out.bends_light = false;
    return out;
  }
  read_dielectric(check, json, where, out);
  double factor[3] = {0, 0, 0}, strength = 1;
  check.numbers(json, "emissiveFactor", factor, where);
  if (const Json* extension = read_extension(check, json, "KHR_materials_emissive_strength", where)) {
    strength = check.number(*extension, "emissiveStrength", 1, where);
  }
  constexpr double brightest = 1e30;  // keeps the float finite
  for (int c = 0; c < 3; ++c) m.emissive[c] = float(std::clamp(factor[c] * strength, 0.0, brightest));
  read_texture_reference(check, json, "emissiveTexture", texture_count, where, out.emissive);
  read_texture_reference(check, json, "normalTexture", texture_count, where, out.normal);
  constexpr double steepest = 1e6;
  if (const Json* info = check.object(json, "normalTexture", where))
    m.normal_scale = float(std::clamp(check.number(*info, "scale", 1, where), -steepest, steepest));
  return out;
}

Wrap read_wrap(GltfCheck& check, const Json& sampler, const char* key, const GltfWhere& where) {
  constexpr uint64_t repeat = 10497, clamp = 33071, mirror = 33648;
  uint64_t mode = check.integer(sampler, key, repeat, 1 << 16, where);
  if (mode != repeat && mode != clamp && mode != mirror) check.fail(where, std::string(key) + " does not exist");
  return mode == clamp ? Wrap::clamp : mode == mirror ? Wrap::mirror : Wrap::repeat;
}

std::span<const uint8_t> image_bytes(GltfCheck& check, const GltfDocument& document, size_t image,
                                     const GltfWhere& where) {
  const Json& json = gltf_item(document.json, "images", image);
  auto view = check.index(json, "bufferView", gltf_count(document.json, "bufferViews"), where);
  if (!check.ok()) return {};
  return view ? read_buffer_view(check, document, *view, nullptr) : document.images[image];
}

// Decoded images: those of the same bytes and wrap modes are one texture.
class TextureReader {
 public:
  TextureReader(GltfDocument& document, const std::vector<std::string>& image_problems, Scene& scene)
      : document_(document), problems_(image_problems), scene_(scene) {}

  // The number in scene.textures of a glTF texture, -1 on failure.
  int read(GltfCheck& check, size_t index) {
    GltfWhere where{"texture", index};
    const Json& texture = gltf_item(document_.json, "textures", index);
    Wrap wrap_s = Wrap::repeat, wrap_t = Wrap::repeat;
    if (auto sampler = check.index(texture, "sampler", gltf_count(document_.json, "samplers"), where)) {
      const Json& json = gltf_item(document_.json, "samplers", *sampler);
      wrap_s = read_wrap(check, json, "wrapS", {"sampler", *sampler});
      wrap_t = read_wrap(check, json, "wrapT", {"sampler", *sampler});
    }
    std::vector<size_t> images;  // the first that can be read counts
    const size_t count = gltf_count(document_.json, "images");
    if (const Json* webp = read_extension(check, texture, "EXT_texture_webp", where))
      if (auto image = check.index(*webp, "source", count, where)) images.push_back(*image);
    if (auto image = check.index(texture, "source", count, where)) images.push_back(*image);
    if (check.ok() && images.empty()) check.fail(where, "has no PNG, JPEG or WebP image");
    if (!check.ok()) return -1;
    for (size_t i = 0; i + 1 < images.size(); ++i) {
      GltfCheck trial = check;
      const int read = read_image(trial, index, images[i], wrap_s, wrap_t);
      if (trial.ok()) return read;
    }
    return read_image(check, index, images.back(), wrap_s, wrap_t);
  }

 private:
  int read_image(GltfCheck& check, size_t texture, size_t image, Wrap wrap_s, Wrap wrap_t) {
    GltfWhere image_where{"image", image};
    if (!problems_[image].empty()) check.fail(image_where, problems_[image]);
    std::span<const uint8_t> bytes = image_bytes(check, document_, image, image_where);
    const Json& json = gltf_item(document_.json, "images", image);
    std::string name = check.text(json, "name", image_where), uri = check.text(json, "uri", image_where);
    if (name.empty()) name = uri;
    if (!check.ok()) return -1;

    auto [place, is_new] =
        known_.try_emplace({bytes.data(), bytes.size(), wrap_s, wrap_t}, int(scene_.textures.size()));
    if (!is_new) return place->second;
    Texture decoded;
    auto twin = decoded_.find({bytes.data(), bytes.size()});
    if (twin != decoded_.end()) {
      decoded = scene_.textures[size_t(twin->second)];
    } else if (auto result = decode_texture(bytes, "", decoded); !result) {
      known_.erase(place);
      check.fail(image_where, (name.empty() ? "" : in_quotes(name) + " ") + result.error().message);
      return -1;
    } else {
      encoded_ += bytes.size();
    }
    pixels_ += uint64_t(decoded.width) * uint64_t(decoded.height);
    const uint64_t most = std::min(max_pixels, free_pixels + texture_pixels_a_byte * encoded_);
    if (pixels_ > most) {
      known_.erase(place);
      check.fail(image_where, "the scene's material images have more than " + std::to_string(most) +
                                  " pixels, which is what images of their bytes may have");
      return -1;
    }
    decoded_.try_emplace({bytes.data(), bytes.size()}, place->second);
    decoded.name = name, decoded.wrap_s = wrap_s, decoded.wrap_t = wrap_t;
    scene_.textures.push_back(std::move(decoded));
    document_.textures.push_back(int(texture));
    return place->second;
  }

  static constexpr uint64_t max_pixels = uint64_t{1} << 30, free_pixels = 4 * free_texture_pixels;
  using Bytes = std::pair<const uint8_t*, size_t>;
  GltfDocument& document_;
  const std::vector<std::string>& problems_;
  Scene& scene_;
  std::map<std::tuple<const uint8_t*, size_t, Wrap, Wrap>, int> known_;
  std::map<Bytes, int> decoded_;
  uint64_t pixels_ = 0, encoded_ = 0;
};

void warn_count(Scene& scene, size_t count, const char* one, const char* many) {
  if (count) scene.warnings.push_back(std::to_string(count) + (count == 1 ? one : many));
}

}  // namespace

std::vector<GltfMaterial> read_materials(GltfCheck& check, const GltfDocument& document) {
  std::vector<GltfMaterial> materials;
  const size_t count = gltf_count(document.json, "materials"), textures = gltf_count(document.json, "textures");
  for (size_t i = 0; i < count && check.ok(); ++i) {
    materials.push_back(read_material(check, gltf_item(document.json, "materials", i), textures, {"material", i}));
  }
  return materials;
}

size_t texcoord_sets(const std::vector<GltfMaterial>& materials) {
  size_t sets = 2;
  for (const GltfMaterial& m : materials)
    for (const GltfTextureUse* use : {&m.base_color, &m.metallic_roughness, &m.normal, &m.transmission, &m.emissive})
      if (use->texture && use->texcoord_set < max_texcoord_sets) sets = std::max(sets, size_t(use->texcoord_set) + 1);
  return sets;
}

void read_textures(const GltfCheck& check, GltfDocument& document, const std::vector<GltfMaterial>& materials,
                   const std::vector<bool>& used, const std::vector<std::string>& image_problems, Scene& scene) {
  TextureReader reader(document, image_problems, scene);
  size_t unknown = 0, bending = 0, specular = 0;
  GltfTold base_color, metallic_roughness, normal, transmission, emissive;
  // The scene is still good without a texture.
  auto read = [&](const GltfTextureUse& use, const char* what, GltfTold& told, int& texture, int& set,
                  std::array<float, 6>& transform) {
    if (!use.texture) return true;
    GltfCheck trial = check;
    if (use.texcoord_set >= max_texcoord_sets)
      trial.fail({}, "it reads TEXCOORD_" + std::to_string(use.texcoord_set) + "; the last that is read is " +
                         std::to_string(max_texcoord_sets - 1));
    const int read_texture = trial.ok() ? reader.read(trial, *use.texture) : -1;
    if (trial.ok()) texture = read_texture, set = int(use.texcoord_set), transform = use.transform;
    else told.add(std::string(what) + " texture not read: " + trial.error().message);
    return trial.ok();
  };
  for (size_t i = 0; i < materials.size(); ++i) {
    if (!used[i]) continue;
    const GltfMaterial& from = materials[i];
    Material& m = scene.materials[i];
    unknown += !from.known_alpha_mode, bending += from.bends_light;
    specular += from.specular_textures;
    read(from.base_color, "base colour", base_color, m.base_color_texture, m.texcoord_set, m.uv_transform);
    read(from.metallic_roughness, "metallic-roughness", metallic_roughness, m.metallic_roughness_texture,
         m.metallic_roughness_set, m.metallic_roughness_transform);
    read(from.normal, "normal", normal, m.normal_texture, m.normal_set, m.normal_transform);
    // Glass of unknown pattern passes nothing.
    if (m.transmission > 0 && !read(from.transmission, "transmission", transmission, m.transmission_texture,
                                    m.transmission_set, m.transmission_transform))
      m.transmission = 0;
    // A lamp of unknown pattern gives no light.
    const bool black = m.emissive == Vec3(0);
    if (!black && !read(from.emissive, "emissive", emissive, m.emissive_texture, m.emissive_set, m.emissive_transform))
      m.emissive = Vec3(0);
  }
  for (const GltfTold* told : {&base_color, &metallic_roughness, &normal, &transmission, &emissive})
    told->tell(scene.warnings, "materials");
  warn_count(scene, unknown, " material has an unknown alphaMode and is opaque",
             " materials have an unknown alphaMode and are opaque");
  warn_count(scene, bending, " material with rough or thick transmission passes light straight on",
             " materials with rough or thick transmission pass light straight on");
  warn_count(scene, specular, " material is without the textures of KHR_materials_specular, which are not read",
             " materials are without the textures of KHR_materials_specular, which are not read");
}

}  // namespace lambent
