#include "export_lightmap.h"

#include <lambent/baked/baked_file.h>
#include <lambent/pipeline/lightmap_pictures.h>
#include <lambent/relight/relight.h>
#include <lambent/render/lightmap_picture.h>
#include <lambent/transfer/directional_convert.h>

#include <fmt/format.h>

#include <set>

namespace lambent::tool {
namespace {

// False of stores whose rows are not sums over columns of light.
bool relight_columns(const Store& store, std::span<const Vec3> light, Relit& out) {
  const auto* dense = std::get_if<Transfer>(&store);
  const auto* clusters = std::get_if<CpcaTransfer>(&store);
  if (dense) relight(*dense, light, out);
  if (clusters) relight(*clusters, light, out);
  return dense || clusters;
}

// "lamp 1" -> "lamp_1"; a second one of that name "lamp_1_2".
std::string file_name(const std::string& group, std::set<std::string>& taken) {
  std::string safe;
  for (char c : group) safe += std::isalnum(static_cast<unsigned char>(c)) || c == '-' ? c : '_';
  std::string name = safe;
  for (int i = 2; !taken.insert(name).second; ++i) name = safe + "_" + std::to_string(i);
  return name;
}

// The pictures of one light: values of all receivers, a picture after another.
std::vector<std::vector<Vec3>> pictures_of(const Relit& relit, size_t receivers, DirectionalKind kind,
                                           LightmapTarget target) {
  const bool harmonics = kind != DirectionalKind::none;
  const size_t pictures = !harmonics ? 1 : target == LightmapTarget::godot ? 4 : size_t(directional_rows(kind));
  std::vector<std::vector<Vec3>> values(pictures, std::vector<Vec3>(receivers));
  for (size_t r = 0; r < receivers; ++r) {
    std::array<Vec3, 9> rows{};
    for (int row = 0; row < relit.rows; ++row) rows[size_t(row)] = relit.at(r, row);
    if (!harmonics) {
      values[0][r] = rows[0] * (target == LightmapTarget::three ? pi : 1.0f);
    } else if (target == LightmapTarget::godot) {
      const std::array<Vec3, 4> layers = godot_lightmap_layers(kind, rows);
      for (size_t k = 0; k < 4; ++k) values[k][r] = layers[k];
    } else {
      const std::vector<Vec3> probe = three_light_probe(kind, rows);
      for (size_t k = 0; k < pictures; ++k) values[k][r] = probe[k];
    }
  }
  return values;
}

}  // namespace

int export_lightmap(Context& context, const std::string& path, LightmapTarget target, const std::string& prefix) {
  auto baked = load_baked(path);
  if (!baked) return fail(baked.error());
  const auto* texels = std::get_if<TexelReceivers>(&baked->basis);
  const Field& field = baked->surface;
  if (!texels || outgoing_of(field))
    return fail({path, "is no lightmap over texels: bake it with --transfer lightmap"});
  const LightBasis light = light_of(field.store);
  if (light.groups.empty()) return fail({path, "holds no lamps, only distant light"});
  const DirectionalKind kind = directional_of(field);
  if (kind != DirectionalKind::none && kind != DirectionalKind::sh2 && kind != DirectionalKind::sh3)
    return fail({path, "is a directional lightmap of kind " + directional_name(kind) +
                           ", which the other system cannot hold: bake it with sh:2 or sh:3"});
  const size_t groups = light.groups.size();
  std::vector<std::string> written;
  std::vector<Vec3> irradiance(receivers_of(field.store), Vec3(0));
  std::set<std::string> taken;
  FileSet set;
  for (size_t g = 0; g < groups; ++g) {
    if (context.progress.cancelled()) return fail({"", "cancelled"});
    std::vector<Vec3> lit(light.count(), Vec3(0));
    lit[light.count() - groups + g] = Vec3(1);
    Relit relit;
    if (!relight_columns(field.store, lit, relit))
      return fail({path, std::string("holds ") + name_of(field.store) + ", which no lightmap is made of"});
    const auto values = pictures_of(relit, receivers_of(field.store), kind, target);
    for (size_t r = 0; r < irradiance.size(); ++r) irradiance[r] += values[0][r];
    const std::string name = prefix + (groups > 1 ? "." + file_name(light.groups[g], taken) : "");
    for (size_t k = 0; k < values.size(); ++k) {
      written.push_back(name + (values.size() > 1 ? "." + std::to_string(k) : "") + ".exr");
      if (auto ok = save_image(written.back(), lightmap_picture(*texels, values[k])); !ok) return fail(ok.error());
    }
  }
  std::string scene;
  if (target == LightmapTarget::three && kind == DirectionalKind::none) {
    scene = prefix + ".three.glb";
    auto look = irradiance_look(*texels, std::move(irradiance));
    if (!look) return fail(look.error());
    if (auto ok = save_look(scene, *baked, *look); !ok) return fail(ok.error());
  }
  if (auto ok = set.commit(); !ok) return fail(ok.error());
  if (context.json)
    print_json({{"pictures", written},
                {"groups", light.groups},
                {"scene", scene},
                {"width", texels->width},
                {"height", texels->height}});
  else
    fmt::print("{}\n{}  {} x {} texels\n", fmt::join(written, "\n"), scene.empty() ? "" : scene + "\n", texels->width,
               texels->height);
  return success;
}

}  // namespace lambent::tool
