#include "export_lightmap.h"

#include <lambent/baked/baked_file.h>
#include <lambent/relight/relight.h>
#include <lambent/render/lightmap_picture.h>
#include <lambent/transfer/directional_convert.h>

#include <fmt/format.h>

namespace lambent::tool {

int export_lightmap(Context& context, const std::string& path, LightmapTarget target, const std::string& prefix) {
  auto baked = load_baked(path);
  if (!baked) return fail(baked.error());
  const auto* texels = std::get_if<TexelReceivers>(&baked->basis);
  const LightBasis& light = baked->transfer.light;
  if (!texels || baked->zonal || baked->outgoing)
    return fail({path, "is no lightmap over texels: bake it with --transfer lightmap"});
  if (light.groups.empty()) return fail({path, "holds no lamps, only distant light"});
  const DirectionalKind kind = baked->directional;
  const bool harmonics = kind == DirectionalKind::sh2 || kind == DirectionalKind::sh3;
  if (!harmonics && kind != DirectionalKind::none)
    return fail({path, "is a directional lightmap of kind " + directional_name(kind) +
                           ", which the other system cannot hold: bake it with sh:2 or sh:3"});
  std::vector<Vec3> lit(light.count(), Vec3(0));
  std::fill(lit.end() - ptrdiff_t(light.groups.size()), lit.end(), Vec3(1));
  Relit relit;
  relight(baked->transfer, lit, relit);

  const size_t receivers = baked->transfer.receivers;
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
  std::vector<std::string> written;
  for (size_t k = 0; k < pictures; ++k) {
    written.push_back(prefix + (pictures > 1 ? "." + std::to_string(k) : "") + ".exr");
    if (auto ok = save_image(written.back(), lightmap_picture(*texels, values[k])); !ok) return fail(ok.error());
  }
  if (context.json) print_json({{"pictures", written}, {"width", texels->width}, {"height", texels->height}});
  else fmt::print("{}\n  {} x {} texels\n", fmt::join(written, "\n"), texels->width, texels->height);
  return success;
}

}  // namespace lambent::tool
