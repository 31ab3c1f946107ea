// A PRT lightmap for an engine: a picture a harmonic, summed by the sky's coefficients in a shader.
#include "lightmap_writer.h"

#include <lambent/light/project.h>
#include <lambent/relight/light.h>

#include <fmt/format.h>

namespace lambent::tool {

using Json = nlohmann::json;

Result<Json> write_sky(LightmapWriter& w, const LightmapExport& o) {
  const auto* transfer = std::get_if<Transfer>(&w.baked.surface.store);
  if (!transfer)
    return Error{o.baked, std::string("holds ") + name_of(w.baked.surface.store) + ", not the columns of a sky"};
  const size_t count = size_t(w.light.order) * size_t(w.light.order), columns = transfer->columns();
  std::vector<std::vector<Vec3>> values(count, std::vector<Vec3>(w.receivers()));
  for (size_t r = 0; r < w.receivers(); ++r) {
    const std::vector<float> row = load_receiver(*transfer, r);
    const size_t green = transfer->channels == 3 ? columns : 0;
    for (size_t k = 0; k < count; ++k) values[k][r] = Vec3(row[k], row[k + green], row[k + 2 * green]);
  }
  const bool godot = o.target == LightmapTarget::godot;
  Json names = Json::array();
  for (size_t k = 0; k < count; ++k) {
    const std::string name = o.prefix + ".sky." + std::to_string(k);
    if (auto ok = w.save(name, values[k]); !ok) return ok.error();
    names.push_back(LightmapWriter::base(name));
  }
  for (size_t i = 0; godot && i < std::max<size_t>(1, w.objects.size()); ++i) {
    std::vector<Image> slices;
    for (const auto& column : values) slices.push_back(std::move(w.images(column)[i]));
    const std::string name = o.prefix + ".sky.layers" + (w.objects.empty() ? "" : "." + w.object_files[i]);
    if (auto ok = write_layers(w, name, slices); !ok) return ok.error();
  }
  Json sky = {{"order", w.light.order}, {"pictures", names}, {"objects", w.object_files}};
  if (!o.light.env.empty()) {
    auto env = load_light(o.light);
    if (!env) return env.error();
    auto rotation = light_rotation(o.light);
    if (!rotation) return rotation.error();
    LightBasis harmonics;
    harmonics.order = w.light.order;
    Json coefficients = Json::array();
    for (const Vec3& c : project_light(*env, harmonics, *rotation).light)
      for (float x : {c.x, c.y, c.z}) coefficients.push_back(x);
    sky["coefficients"] = std::move(coefficients);
  }
  if (auto ok = w.save_text(o.prefix + ".sky.json", sky.dump(1) + "\n"); !ok) return ok.error();
  const char* snippet = godot                             ? "shaders/lambent_sky.gdshaderinc"
                      : o.target == LightmapTarget::unity ? "shaders/LambentSky.hlsl"
                                                          : "shaders/lambent_sky.glsl";
  if (auto ok = w.save_carried(snippet, "", int(count)); !ok) return ok.error();
  if (o.target == LightmapTarget::unity && w.light.groups.empty())  // else with the lightmap
    for (const auto& [name, below] :
         {std::pair("unity/LambentImporter.cs", "Editor"), {"unity/LambentLightmap.cs", ""}})
      if (auto ok = w.save_carried(name, below); !ok) return ok.error();
  return sky;
}

}  // namespace lambent::tool
