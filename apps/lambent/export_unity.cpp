// What Unity's script beside it reads (integrations/unity): colour and direction of each lightmap, whose it is, probes.
// Unity's space is left-handed: glTF importers there mirror x, and so do directions here.
#include "lightmap_writer.h"

#include <lambent/receivers/atlas.h>
#include <lambent/transfer/directional_convert.h>

namespace lambent::tool {
namespace {

using Json = nlohmann::json;

// Normals where the texels of a baked file stand, which it does not keep: those of receivers made anew, texel by texel.
std::vector<Vec3> texel_normals(const LightmapWriter& w) {
  const auto& at = std::get<TexelPlacement>(w.baked.surface.where);
  Atlas atlas;
  atlas.width = at.width, atlas.height = at.height, atlas.front = at.front, atlas.back = at.back;
  const Receivers fresh = make_texel_receivers(w.baked.scene, atlas);
  const auto& texels = std::get<TexelReceivers>(fresh.basis).texels;
  std::vector<Vec3> normals(w.receivers(), Vec3(0, 1, 0));
  for (size_t i = 0; i < texels.size(); ++i)
    if (texels[i] != none && w.atlas.texels[i] != none) normals[w.atlas.texels[i]] = fresh.normals[texels[i]];
  return normals;
}

std::string file_of(const LightmapWriter& w, const std::string& name, size_t object) {
  return LightmapWriter::base(name) + (w.objects.empty() ? "" : "." + w.object_files[object]) + ".exr";
}

}  // namespace

Result<void> write_unity(LightmapWriter& w, const LightmapExport& o, const Relit& all) {
  const bool directional = w.kind != DirectionalKind::none;
  std::vector<Vec3> color(w.receivers()), direction(w.receivers());
  std::vector<float> balance(w.receivers());
  const std::vector<Vec3> normals = directional ? texel_normals(w) : std::vector<Vec3>();
  for (size_t r = 0; r < w.receivers(); ++r) {
    std::array<Vec3, 9> rows{};
    for (int row = 0; row < all.rows; ++row) rows[size_t(row)] = all.at(r, row);
    color[r] = max(rows[0], Vec3(0));
    if (!directional) continue;
    const Vec3 n = normals[r];
    color[r] = max(evaluate_directional_light(w.kind, rows, receiver_frame(n), n), Vec3(0));
    const UnityDirection d = unity_direction(w.kind, rows, n);
    direction[r] = Vec3(1 - d.direction.x, d.direction.y, d.direction.z), balance[r] = d.balance;
  }
  if (auto ok = w.save(o.prefix + ".color", color); !ok) return ok;
  if (directional)
    if (auto ok = w.save(o.prefix + ".direction", direction, &balance); !ok) return ok;
  auto nodes = w.save_scene(o.prefix + ".unity.glb");
  if (!nodes) return nodes.error();
  Json lightmaps = Json::array(), objects = Json::array();
  for (size_t i = 0; i < std::max<size_t>(1, w.objects.size()); ++i)
    lightmaps.push_back({{"color", file_of(w, o.prefix + ".color", i)},
                         {"direction", directional ? file_of(w, o.prefix + ".direction", i) : ""}});
  for (const EngineObject& object : engine_objects(w, *nodes))
    objects.push_back(
        {{"name", object.name}, {"lightmap", object.lightmap}, {"scaleOffset", Json::array({1, 1, 0, 0})}});
  Json manifest = {{"version", 1},
                   {"scene", LightmapWriter::base(o.prefix + ".unity.glb")},
                   {"directional", directional},
                   {"lightmaps", lightmaps},
                   {"objects", objects}};
  if (!o.probes.empty()) {
    auto probes = load_probes(o);
    if (!probes) return probes.error();
    manifest["probes"] = probes_json(*probes, "unity", true);
  }
  if (auto ok = w.save_text(o.prefix + ".unity.json", manifest.dump(1) + "\n"); !ok) return ok;
  for (const char* name : {"unity/LambentLightmap.cs", "unity/LambentProbes.hlsl"})
    if (auto ok = w.save_carried(name); !ok) return ok;
  return w.save_carried("unity/LambentImporter.cs", "Editor");
}

}  // namespace lambent::tool
