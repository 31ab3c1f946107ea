#pragma once
// Writes materials and textures that a document does not have; of save_gltf.cpp. KHR_texture_transform,
// KHR_materials_emissive_strength, EXT_texture_webp.
#include <lambent/scene/gltf.h>
#include <lambent/scene/gltf_materials.h>
#include <lambent/scene/gltf_write.h>
#include <lambent/scene/textures.h>

#include <map>

namespace lambent {

inline float finite_or(float x, float fallback) { return std::isfinite(x) ? x : fallback; }

// Materials and textures that the document does not have.
class MaterialWriter {
 public:
  MaterialWriter(GltfWriter& out, const Scene& scene, const std::string& path)
      : out_(out), scene_(scene), path_(path) {}

  // The glTF number of a scene's material, in a one-sided and a two-sided edition.
  Result<size_t> add(uint32_t index, bool two_sided) {
    auto known = materials_.find({index, two_sided});
    if (known != materials_.end()) return known->second;
    const Material& m = scene_.materials[index];
    Vec3 base = clamp(Vec3(finite_or(m.base_color.x, 0), finite_or(m.base_color.y, 0), finite_or(m.base_color.z, 0)),
                      Vec3(0.0f), Vec3(1.0f));
    const float alpha = std::clamp(finite_or(m.alpha, 1), 0.0f, 1.0f);
    nlohmann::json pbr = {{"baseColorFactor", nlohmann::json::array({base.x, base.y, base.z, alpha})},
                          {"metallicFactor", std::clamp(finite_or(m.metallic, 1), 0.0f, 1.0f)},
                          {"roughnessFactor", std::clamp(finite_or(m.roughness, 1), 0.0f, 1.0f)}};
    if (m.base_color_texture >= 0) {
      auto texture = add_texture(size_t(m.base_color_texture));
      if (!texture) return texture.error();
      pbr["baseColorTexture"] = texture_reference(*texture, m.texcoord_set, m.uv_transform);
    }
    if (m.metallic_roughness_texture >= 0) {
      auto texture = add_texture(size_t(m.metallic_roughness_texture));
      if (!texture) return texture.error();
      pbr["metallicRoughnessTexture"] =
          texture_reference(*texture, m.metallic_roughness_set, m.metallic_roughness_transform);
    }
    nlohmann::json json = {{"pbrMetallicRoughness", std::move(pbr)}, {"doubleSided", two_sided}};
    if (!m.name.empty()) json["name"] = m.name;
    if (m.normal_texture >= 0) {
      auto texture = add_texture(size_t(m.normal_texture));
      if (!texture) return texture.error();
      json["normalTexture"] = texture_reference(*texture, m.normal_set, m.normal_transform);
      if (m.normal_scale != 1) json["normalTexture"]["scale"] = finite_or(m.normal_scale, 1);
    }
    if (m.dielectric_f0 != Material{}.dielectric_f0 || m.dielectric_f90 != Material{}.dielectric_f90) {
      const float f90 = std::clamp(finite_or(m.dielectric_f90, 1), 1e-6f, 1.0f);  // the weight of both
      const Vec3 color = m.dielectric_f0 / (f90 * Material{}.dielectric_f0);
      json["extensions"]["KHR_materials_specular"] = {{"specularFactor", f90},
                                                      {"specularColorFactor", {color.x, color.y, color.z}}};
      out_.use_extension("KHR_materials_specular");
    }
    if (m.alpha_mode == AlphaMode::blend) json["alphaMode"] = "BLEND";
    if (m.alpha_mode == AlphaMode::mask)
      json["alphaMode"] = "MASK", json["alphaCutoff"] = std::max(finite_or(m.alpha_cutoff, 0.5f), 0.0f);
    if (m.transmission > 0) {
      nlohmann::json& glass = json["extensions"]["KHR_materials_transmission"];
      glass["transmissionFactor"] = std::clamp(finite_or(m.transmission, 0), 0.0f, 1.0f);
      if (m.transmission_texture >= 0) {
        auto texture = add_texture(size_t(m.transmission_texture));
        if (!texture) return texture.error();
        glass["transmissionTexture"] = texture_reference(*texture, m.transmission_set, m.transmission_transform);
      }
      out_.use_extension("KHR_materials_transmission");
    }
    add_emission(json, m.emissive);
    if (m.emissive_texture >= 0) {
      auto texture = add_texture(size_t(m.emissive_texture));
      if (!texture) return texture.error();
      json["emissiveTexture"] = texture_reference(*texture, m.emissive_set, m.emissive_transform);
    }
    return materials_[{index, two_sided}] = out_.push("materials", std::move(json));
  }

  // Base colour and emission of the document's materials as the scene has them now, where somebody changed them.
  void update_document() {
    GltfCheck check("");
    const std::vector<GltfMaterial> before = read_materials(check, *scene_.document);
    for (size_t i = 0; i < before.size(); ++i) {
      const Material& m = scene_.materials[i];
      nlohmann::json& json = out_.list("materials")[i];
      if (m.base_color != before[i].material.base_color) {
        nlohmann::json* extensions = json.contains("extensions") ? &json["extensions"] : nullptr;
        const bool gloss = extensions && extensions->contains("KHR_materials_pbrSpecularGlossiness");
        nlohmann::json& holder = gloss ? (*extensions)["KHR_materials_pbrSpecularGlossiness"]
                                       : json["pbrMetallicRoughness"];
        nlohmann::json& factor = holder[gloss ? "diffuseFactor" : "baseColorFactor"];
        const nlohmann::json alpha = factor.is_array() && factor.size() == 4 ? factor[3] : nlohmann::json(1.0f);
        factor = nlohmann::json::array({m.base_color.x, m.base_color.y, m.base_color.z, alpha});
      }
      const bool textured = before[i].emissive.texture.has_value(), lost = textured && m.emissive_texture < 0;
      const bool unread = lost && m.emissive == Vec3(0);  // the loader could not, or it is black anyhow
      if ((m.emissive != before[i].material.emissive || lost) && !unread) {
        if (lost) json.erase("emissiveTexture");
        json.erase("emissiveFactor");
        if (json.contains("extensions")) json["extensions"].erase("KHR_materials_emissive_strength");
        add_emission(json, m.emissive);
      }
    }
  }

 private:
  void add_emission(nlohmann::json& json, Vec3 emissive) {
    float brightest = std::max({emissive.x, emissive.y, emissive.z});
    if (!is_finite(emissive) || !(brightest > 0)) return;
    emissive = max(emissive, Vec3(0.0f));
    if (brightest > 1) {
      float strength =
          std::min(0x1p127f, std::exp2(std::ceil(std::log2(brightest))));  // a power of two divides without rounding
      emissive = min(Vec3(1), emissive / strength);
      json["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] = strength;
      out_.use_extension("KHR_materials_emissive_strength");
    }
    json["emissiveFactor"] = nlohmann::json::array({emissive.x, emissive.y, emissive.z});
  }

  nlohmann::json texture_reference(size_t texture, int texcoord_set, const std::array<float, 6>& t) {
    nlohmann::json info = {{"index", texture}, {"texCoord", texcoord_set}};
    if (t != Material{}.uv_transform) {
      // uv' = rotation(angle) diag(scale) uv + offset; there is no shear to express.
      double scale_u = std::hypot(t[0], t[3]), angle = std::atan2(-double(t[3]), t[0]);
      double scale_v = t[1] * std::sin(angle) + t[4] * std::cos(angle);
      info["extensions"]["KHR_texture_transform"] = {
          {"offset", {t[2], t[5]}}, {"rotation", angle}, {"scale", {scale_u, scale_v}}};
      out_.use_extension("KHR_texture_transform");
    }
    return info;
  }

  Result<size_t> add_texture(size_t index) {
    if (scene_.document && index < scene_.document->textures.size()) return size_t(scene_.document->textures[index]);
    auto known = textures_.find(index);
    if (known != textures_.end()) return known->second;
    const Texture& texture = scene_.textures[index];
    if (texture.encoded.empty()) return Error{path_, "texture \"" + texture.name + "\" has no encoded image to write"};
    auto [image, is_new] = images_.try_emplace(content_hash(texture.encoded), 0);
    if (is_new) {
      nlohmann::json json = {{"bufferView", out_.add_view(texture.encoded, 4)}, {"mimeType", texture.mime_type}};
      if (!texture.name.empty()) json["name"] = texture.name;
      image->second = out_.push("images", std::move(json));
    }
    nlohmann::json sampler = {{"wrapS", wrap_number(texture.wrap_s)}, {"wrapT", wrap_number(texture.wrap_t)}};
    nlohmann::json& samplers = out_.list("samplers");
    size_t s = size_t(std::find(samplers.begin(), samplers.end(), sampler) - samplers.begin());
    if (s == samplers.size()) samplers.push_back(sampler);
    nlohmann::json json = {{"sampler", s}};
    if (texture.mime_type == "image/webp") {
      json["extensions"]["EXT_texture_webp"]["source"] = image->second;
      out_.use_extension("EXT_texture_webp", true);
    } else {
      json["source"] = image->second;
    }
    return textures_[index] = out_.push("textures", std::move(json));
  }

  static int wrap_number(Wrap wrap) { return wrap == Wrap::clamp ? 33071 : wrap == Wrap::mirror ? 33648 : 10497; }

  GltfWriter& out_;
  const Scene& scene_;
  const std::string& path_;
  std::map<std::pair<uint32_t, bool>, size_t> materials_;
  std::map<size_t, size_t> textures_;
  std::map<std::string, size_t> images_;
};

}  // namespace lambent
