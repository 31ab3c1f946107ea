#include "export_lightmap.h"

#include "lightmap_writer.h"

#include <lambent/pipeline/lightmap_pictures.h>
#include <lambent/transfer/directional_convert.h>

#include <fmt/format.h>

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

// The pictures of one light: values of all receivers, a picture after another.
std::vector<std::vector<Vec3>> pictures_of(const Relit& relit, size_t receivers, DirectionalKind kind,
                                           const LightmapExport& o) {
  const bool harmonics = kind != DirectionalKind::none, godot = o.target == LightmapTarget::godot;
  const size_t pictures = !harmonics ? 1 : godot ? 4 : size_t(directional_rows(kind));
  std::vector<std::vector<Vec3>> values(pictures, std::vector<Vec3>(receivers));
  for (size_t r = 0; r < receivers; ++r) {
    std::array<Vec3, 9> rows{};
    for (int row = 0; row < relit.rows; ++row) rows[size_t(row)] = relit.at(r, row);
    if (!harmonics) {
      values[0][r] = rows[0] * (godot ? 1.0f : pi);
    } else if (godot) {
      const std::array<Vec3, 4> layers = o.godot_version == "4.3" ? godot_unpacked_layers(kind, rows)
                                                                  : godot_lightmap_layers(kind, rows);
      for (size_t k = 0; k < 4; ++k) values[k][r] = layers[k];
    } else {
      const std::vector<Vec3> probe = three_light_probe(kind, rows);
      for (size_t k = 0; k < pictures; ++k) values[k][r] = probe[k];
    }
  }
  return values;
}

Result<LightmapWriter> load_lightmap(const LightmapExport& o) {
  LightmapWriter w;
  auto baked = load_baked(o.baked);
  if (!baked) return baked.error();
  const auto* texels = std::get_if<TexelReceivers>(&baked->basis);
  const Field& field = baked->surface;
  if (!texels || outgoing_of(field))
    return Error{o.baked, "is no lightmap over texels: bake it with --transfer lightmap"};
  w.light = light_of(field.store), w.kind = directional_of(field), w.prefix = o.prefix;
  if (w.light.groups.empty() && !o.sky_columns)
    return Error{o.baked, "holds no lamps, only distant light: --sky-columns writes a picture a harmonic"};
  if (o.sky_columns && w.light.order == 0)
    return Error{o.baked, "holds no harmonics of distant light for --sky-columns: bake it with --order"};
  if (w.kind != DirectionalKind::none && w.kind != DirectionalKind::sh2 && w.kind != DirectionalKind::sh3)
    return Error{o.baked, "is a directional lightmap of kind " + directional_name(w.kind) +
                              ", which the other system cannot hold: bake it with sh:2 or sh:3"};
  if (o.sky_columns && w.kind != DirectionalKind::none)
    return Error{o.baked, "is a directional lightmap, of which --sky-columns cannot be made"};
  if (o.target == LightmapTarget::moz && w.kind != DirectionalKind::none)
    return Error{o.baked, "is a directional lightmap, which MOZ_lightmap cannot hold: bake it without --directional"};
  w.atlas = *texels, w.baked = std::move(*baked);
  if (!o.per_object) return w;
  std::set<std::string> taken;
  for (ObjectAtlas& object : split_atlas(w.baked.scene, std::get<TexelReceivers>(w.baked.basis)))
    if (object.width > 0)
      w.object_files.push_back(file_name(object.name, taken)), w.objects.push_back(std::move(object));
  return w;
}

// The pictures of each light group, and what all of them give together.
Result<Relit> write_groups(Context& context, LightmapWriter& w, const LightmapExport& o) {
  const size_t groups = w.light.groups.size(), first = w.light.count() - groups;
  std::set<std::string> taken;
  Relit relit;
  std::vector<Vec3> lit(w.light.count(), Vec3(0));
  const bool each = o.target == LightmapTarget::three || o.target == LightmapTarget::godot || groups > 1;
  for (size_t g = 0; g < groups && each && o.target != LightmapTarget::moz; ++g) {
    if (context.progress.cancelled()) return Error{"", "cancelled"};
    lit[first + g] = Vec3(1);
    if (!relight_columns(w.baked.surface.store, lit, relit)) break;  // said below
    lit[first + g] = Vec3(0);
    const auto values = pictures_of(relit, w.receivers(), w.kind, o);
    const std::string name = o.prefix + (groups > 1 ? "." + file_name(w.light.groups[g], taken) : "");
    for (size_t k = 0; k < values.size(); ++k)
      if (auto ok = w.save(name + (values.size() > 1 ? "." + std::to_string(k) : ""), values[k]); !ok)
        return ok.error();
  }
  for (size_t g = 0; g < groups; ++g) lit[first + g] = Vec3(1);
  if (!relight_columns(w.baked.surface.store, lit, relit))
    return Error{o.baked, std::string("holds ") + name_of(w.baked.surface.store) + ", which no lightmap is made of"};
  return relit;
}

Result<void> write_moz(LightmapWriter& w, const std::string& path, const Relit& all) {
  std::vector<Vec3> irradiance;
  for (size_t r = 0; r < w.receivers(); ++r) irradiance.push_back(all.at(r) * pi);
  auto look = irradiance_look(w.atlas, irradiance);
  if (!look) return look.error();
  const std::vector<Image> images = w.objects.empty() ? std::vector<Image>() : w.images(irradiance);
  look->object_of_part.assign(w.baked.scene.parts.size(), 0);
  for (size_t i = 0; i < images.size(); ++i) {
    auto picture = irradiance_picture(images[i]);
    if (!picture) return picture.error();
    look->objects.push_back(std::move(*picture));
    for (uint32_t p : w.objects[i].parts) look->object_of_part[p] = uint32_t(i);
  }
  w.files.push_back(path);
  return save_look(path, w.baked, *look);
}

Result<void> write_all(Context& context, LightmapWriter& w, const LightmapExport& o) {
  if (o.sky_columns) {
    auto sky = write_sky(w, o);
    if (!sky) return sky.error();
  }
  if (!w.light.groups.empty()) {
    auto all = write_groups(context, w, o);
    if (!all) return all.error();
    if (o.target == LightmapTarget::godot) return write_godot(w, o, *all);
    if (o.target == LightmapTarget::unity) return write_unity(w, o, *all);
    if (o.target == LightmapTarget::moz) return write_moz(w, o.prefix, *all);
    if (w.kind == DirectionalKind::none)
      if (auto ok = write_moz(w, o.prefix + ".three.glb", *all); !ok) return ok;
  }
  if (o.target == LightmapTarget::three && !o.probes.empty()) {
    auto probes = load_probes(o);
    if (!probes) return probes.error();
    return w.save_text(o.prefix + ".probes.json", probes_json(*probes, "three", false).dump() + "\n");
  }
  return {};
}

}  // namespace

int export_lightmap(Context& context, const LightmapExport& o) {
  if (!o.probes.empty() && o.light.env.empty())
    return fail({"--probes", "need --env: a lattice holds the light of no sky before one is named", true});
  if (o.probes.empty() && !o.sky_columns && !o.light.env.empty())
    return fail({"--env", "says nothing here without --probes or --sky-columns", true});
  if (o.target == LightmapTarget::moz && (o.sky_columns || !o.probes.empty()))
    return fail({"--moz-lightmap", "takes neither --sky-columns nor --probes: one file holds it all", true});
  FileSet set;
  auto w = load_lightmap(o);
  if (!w) return fail(w.error());
  if (w->light.groups.empty() && !o.probes.empty() && o.target != LightmapTarget::three)
    return fail({o.baked, "holds no lamps: --probes go with a lightmap of lamps here"});
  if (auto ok = write_all(context, *w, o); !ok) return fail(ok.error());
  if (auto ok = set.commit(); !ok) return fail(ok.error());
  if (context.json) {
    nlohmann::json objects = nlohmann::json::array();
    for (size_t i = 0; i < w->objects.size(); ++i)
      objects.push_back(
          {{"name", w->objects[i].name}, {"width", w->objects[i].width}, {"height", w->objects[i].height}});
    std::string scene;
    for (const std::string& file : w->files)
      if (file.ends_with(".glb")) scene = file;
    print_json({{"pictures", w->pictures},
                {"groups", w->light.groups},
                {"scene", scene},
                {"files", w->files},
                {"objects", objects},
                {"width", w->atlas.width},
                {"height", w->atlas.height}});
  } else {
    for (const auto* list : {&w->pictures, &w->files})
      for (const std::string& name : *list) fmt::print("{}\n", name);
    fmt::print("  {} x {} texels{}\n", w->atlas.width, w->atlas.height,
               w->objects.empty() ? "" : fmt::format(" before they were parted among {} objects", w->objects.size()));
  }
  return success;
}

}  // namespace lambent::tool
