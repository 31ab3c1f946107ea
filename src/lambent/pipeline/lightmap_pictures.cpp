#include <lambent/pipeline/lightmap_pictures.h>

#include <lambent/relight/relight.h>
#include <lambent/render/lightmap_picture.h>

#include <algorithm>
#include <cctype>

namespace lambent {
namespace {

constexpr size_t all_groups = SIZE_MAX;

// "lamp 1", "2" -> ".lamp_1.2.exr".
std::string picture_name(const std::string& name, const std::string& row) {
  std::string safe;
  for (char c : name) safe += std::isalnum(static_cast<unsigned char>(c)) || c == '-' ? c : '_';
  return (safe.empty() ? "" : "." + safe) + (row.empty() ? "" : "." + row) + ".exr";
}

// Light with one group on, or all of them; harmonics dark.
std::vector<Vec3> only_group(const LightBasis& light, size_t group) {
  std::vector<Vec3> out(light.count(), Vec3(0));
  const size_t first = light.count() - light.groups.size();
  for (size_t g = 0; g < light.groups.size(); ++g)
    if (group == all_groups || g == group) out[first + g] = Vec3(1);
  return out;
}

const TexelReceivers* lit_texels(const Lightmap& map, const Receivers& receivers) {
  return map.all.light.groups.empty() ? nullptr : std::get_if<TexelReceivers>(&receivers.basis);
}

// Divides by the brightest value but a thousandth of them, which it returns.
float normalize_brightness(std::vector<Vec3>& values) {
  std::vector<float> brightness;
  for (const Vec3& c : values) brightness.push_back(largest(c));
  const size_t most = brightness.size() - 1 - brightness.size() / 1000;
  std::nth_element(brightness.begin(), brightness.begin() + ptrdiff_t(most), brightness.end());
  const float strength = std::max(brightness[most], 1e-6f);
  for (Vec3& c : values) c /= strength;
  return strength;
}

}  // namespace

std::vector<std::string> lightmap_picture_names(const std::vector<std::string>& groups, DirectionalKind kind, bool each,
                                                bool direct_apart) {
  std::vector<std::string> out;
  const int rows = directional_rows(kind);
  for (const std::string& group : each ? groups : std::vector<std::string>{""}) {
    const std::string prefix = group.empty() ? "" : group + ".";
    if (direct_apart) out.push_back(picture_name(prefix + "direct", ""));
    for (int row = 0; row < rows; ++row)
      out.push_back(picture_name(direct_apart ? prefix + "indirect" : group, rows > 1 ? std::to_string(row) : ""));
  }
  return out;
}

std::vector<std::pair<std::string, Image>> lightmap_pictures(const Lightmap& map, const Receivers& receivers,
                                                             bool each) {
  std::vector<std::pair<std::string, Image>> out;
  const TexelReceivers* texels = lit_texels(map, receivers);
  if (!texels) return out;
  auto add = [&](const std::string& name, const Relit& values) {
    for (int row = 0; row < values.rows; ++row)
      out.emplace_back(picture_name(name, values.rows > 1 ? std::to_string(row) : ""),
                       lightmap_picture(*texels, values, 4, row));
  };
  const LightBasis& light = map.all.light;
  Relit relit, direct;
  for (size_t g = each ? 0 : all_groups;; ++g) {
    const std::string name = each ? light.groups[g] : "";
    auto named = [&](const char* what) { return name.empty() ? std::string(what) : name + "." + what; };
    relight(map.all, only_group(light, g), relit);
    if (map.direct) {
      relight(*map.direct, only_group(light, g), direct);
      add(named("direct"), direct);
      for (size_t i = 0; i < relit.values.size(); ++i)
        relit.values[i] = std::max(0.0f, relit.values[i] - direct.values[i]);
    }
    add(map.direct ? named("indirect") : name, relit);
    if (!each || g + 1 == light.groups.size()) return out;
  }
}

Result<std::optional<ViewerLook>> lightmap_look(const Lightmap& map, const Scene& scene, const Receivers& receivers,
                                                DirectionalKind kind) {
  const TexelReceivers* texels = lit_texels(map, receivers);
  if (!texels) return std::optional<ViewerLook>();
  Relit relit;
  relight(map.all, only_group(map.all.light, all_groups), relit);
  std::vector<Vec3> radiance = texel_albedo(scene, receivers);
  const std::vector<Vec3> glow = texel_emission(scene, receivers);
  for (size_t r = 0; r < radiance.size(); ++r) {
    std::array<Vec3, 9> rows{};
    for (int row = 0; row < relit.rows; ++row) rows[size_t(row)] = relit.at(r, row);
    const Vec3 n = receivers.normals[r], white = evaluate_directional_light(kind, rows, receiver_frame(n), n);
    radiance[r] = max(radiance[r] * white, Vec3(0)) + glow[r];
  }
  ViewerLook look;
  look.strength = normalize_brightness(radiance);
  auto png = encode_png(lightmap_picture(*texels, radiance), {}, scene.path);
  if (!png) return png.error();
  look.png = std::move(*png);
  return std::optional<ViewerLook>(std::move(look));
}

namespace {

// Bytes are to be linear: what a PNG encodes as sRGB is decoded before.
Result<std::vector<uint8_t>> linear_png(Image picture) {
  for (Vec3& c : picture.rgb)
    c = {srgb_decode(std::min(c.x, 1.0f)), srgb_decode(std::min(c.y, 1.0f)), srgb_decode(std::min(c.z, 1.0f))};
  return encode_png(picture, {}, "lightmap");
}

}  // namespace

Result<ViewerLook> irradiance_look(const TexelReceivers& texels, std::vector<Vec3> irradiance) {
  ViewerLook look;
  look.kind = LookKind::moz_lightmap;
  for (Vec3& c : irradiance) c = max(c, Vec3(0));
  look.strength = normalize_brightness(irradiance);
  auto png = linear_png(lightmap_picture(texels, irradiance));
  if (!png) return png.error();
  look.png = std::move(*png);
  return look;
}

Result<ViewerPicture> irradiance_picture(Image irradiance) {
  ViewerPicture picture;
  for (Vec3& c : irradiance.rgb) c = max(c, Vec3(0));
  picture.strength = normalize_brightness(irradiance.rgb);
  auto png = linear_png(std::move(irradiance));
  if (!png) return png.error();
  picture.png = std::move(*png);
  return picture;
}

}  // namespace lambent
