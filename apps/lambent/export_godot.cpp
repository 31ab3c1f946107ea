// What Godot 4.3 to 4.6 load: a LightmapGIData as text, the layered picture that it names with its import settings, the
// scene with UV2, and a script that puts a LightmapGI into an open scene. Facts from Godot's scene/3d/lightmap_gi.cpp:
// properties by version, user_data in fours, probe_data's members, pictures of many layers one below the other,
// imported by 2d_array_texture; and scene/resources/resource_format_text.cpp: paths that are relative to the file.
#include "lightmap_writer.h"

#include <lambent/basis/sh_convert.h>
#include <lambent/transfer/directional_convert.h>

#include <fmt/format.h>

namespace lambent::tool {
namespace {

constexpr int max_side = 16384;  // of a picture, in Godot

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

// As Node's names are after import: without characters that mean something in a path.
std::string node_name(const std::string& name) {
  std::string out;
  for (char c : name) out += std::string_view(".:@/\"%").find(c) == std::string_view::npos ? c : '_';
  return out;
}

std::string node_path(const EngineObject& object) {
  std::string out = "..";
  for (const std::string& name : object.path) out += "/" + node_name(name);
  return out;
}

std::string import_settings(int slices) {
  return fmt::format(
      "[remap]\n\nimporter=\"2d_array_texture\"\ntype=\"CompressedTexture2DArray\"\n\n[params]\n\ncompress/mode=3\n"
      "compress/channel_pack=1\nmipmaps/generate=false\nslices/horizontal=1\nslices/vertical={}\n",
      slices);
}

template <class T, class Number>
std::string packed(const char* type, const std::vector<T>& values, Number number) {
  std::string out = std::string(type) + "(";
  for (size_t i = 0; i < values.size(); ++i) out += (i ? ", " : "") + number(values[i]);
  return out + ")";
}

std::string probe_data(const Probes* probes, const std::string& version) {
  Lattice box;
  GodotProbes tree;
  std::vector<float> points, sh;
  if (probes) {
    box = probes->lattice, tree = godot_probes(box);
    for (const Vec3& p : probes->points) points.insert(points.end(), {p.x, p.y, p.z});
    for (const auto& light : probes->sh)
      for (const Vec3& c : convert_sh(light, ShConvention::godot)) sh.insert(sh.end(), {c.x, c.y, c.z, 1});
  }
  const auto real = [](float x) { return fmt::format("{:.9g}", x); };
  const auto whole = [](int32_t x) { return std::to_string(x); };
  const Vec3 size = box.max - box.min;
  return fmt::format(
      "{{\n\"baked_exposure\": 1.0,\n\"bounds\": AABB({:.9g}, {:.9g}, {:.9g}, {:.9g}, {:.9g}, {:.9g}),\n\"bsp\": {},\n"
      "\"interior\": false,\n{}\"points\": {},\n\"sh\": {},\n\"tetrahedra\": {}\n}}",
      box.min.x, box.min.y, box.min.z, size.x, size.y, size.z, packed("PackedInt32Array", tree.tree, whole),
      version == "4.6" ? "\"lightprobe_hash\": 0,\n" : "", packed("PackedVector3Array", points, real),
      packed("PackedColorArray", sh, real), packed("PackedInt32Array", tree.tetrahedra, whole));
}

// Layers of the whole atlas or of each object, in pictures of one size.
std::vector<Image> slices_of(const LightmapWriter& w, const LightmapExport& o, const Relit& all, int width,
                             int height) {
  const bool harmonics = w.kind != DirectionalKind::none;
  std::vector<std::vector<Vec3>> values(harmonics ? 4 : 1, std::vector<Vec3>(w.receivers()));
  for (size_t r = 0; r < w.receivers(); ++r) {
    std::array<Vec3, 9> rows{};
    for (int row = 0; row < all.rows; ++row) rows[size_t(row)] = all.at(r, row);
    if (!harmonics) {
      values[0][r] = rows[0];
      continue;
    }
    const auto layers = o.godot_version == "4.3" ? godot_unpacked_layers(w.kind, rows)
                                                 : godot_lightmap_layers(w.kind, rows);
    for (size_t k = 0; k < 4; ++k) values[k][r] = layers[k];
  }
  std::vector<std::vector<Image>> layers;
  for (const auto& layer : values) layers.push_back(w.images(layer));
  std::vector<Image> slices;
  for (size_t object = 0; object < layers[0].size(); ++object)
    for (const auto& layer : layers) {
      Image slice(width, height);
      const Image& from = layer[object];
      for (int y = 0; y < from.height; ++y)
        for (int x = 0; x < from.width; ++x) slice.at(x, y) = from.at(x, y);
      slices.push_back(std::move(slice));
    }
  return slices;
}

}  // namespace

Result<std::vector<std::string>> write_layers(LightmapWriter& w, const std::string& name,
                                              const std::vector<Image>& slices) {
  const int width = slices[0].width, height = slices[0].height;
  const size_t a_file = std::max<size_t>(1, size_t(max_side / height));
  std::vector<std::string> names;
  for (size_t first = 0; first < slices.size(); first += a_file) {
    const size_t count = std::min(a_file, slices.size() - first);
    Image picture(width, height * int(count));
    for (size_t k = 0; k < count; ++k)
      std::copy(slices[first + k].rgb.begin(), slices[first + k].rgb.end(),
                picture.rgb.begin() + ptrdiff_t(k * slices[first + k].rgb.size()));
    const std::string path = name + (slices.size() > a_file ? "_" + std::to_string(names.size()) : "") + ".exr";
    if (auto ok = w.save_picture(path, picture); !ok) return ok.error();
    if (auto ok = w.save_text(path + ".import", import_settings(int(count))); !ok) return ok.error();
    names.push_back(path);
  }
  return names;
}

Result<void> write_godot(LightmapWriter& w, const LightmapExport& o, const Relit& all) {
  int width = w.objects.empty() ? w.atlas.width : 1, height = w.objects.empty() ? w.atlas.height : 1;
  for (const ObjectAtlas& object : w.objects)
    width = std::max(width, object.width), height = std::max(height, object.height);
  auto names = write_layers(w, o.prefix + ".layers", slices_of(w, o, all, width, height));
  if (!names) return names.error();
  auto nodes = w.save_scene(o.prefix + ".godot.glb");
  if (!nodes) return nodes.error();
  const bool old = o.godot_version == "4.3";
  std::string resources, textures, users;
  for (size_t i = 0; i < names->size(); ++i) {
    resources += fmt::format("[ext_resource type=\"CompressedTexture2DArray\" path={} id=\"{}\"]\n",
                             quoted(LightmapWriter::base((*names)[i])), i + 1);
    textures += fmt::format("{}ExtResource(\"{}\")", i ? ", " : "", i + 1);
  }
  nlohmann::json listed = nlohmann::json::array();
  for (const EngineObject& object : engine_objects(w, *nodes)) {
    float u = 1, v = 1;
    if (!w.objects.empty()) {
      u = float(w.objects[object.lightmap].width) / float(width);
      v = float(w.objects[object.lightmap].height) / float(height);
    }
    users += fmt::format("{}NodePath({}), Rect2(0, 0, {:.9g}, {:.9g}), {}, -1", users.empty() ? "" : ", ",
                         quoted(node_path(object)), u, v, object.lightmap);
    listed.push_back(
        {{"name", node_name(object.name)}, {"slice", object.lightmap}, {"rect", nlohmann::json::array({0, 0, u, v})}});
  }
  std::optional<Probes> probes;
  if (!o.probes.empty()) {
    auto loaded = load_probes(o);
    if (!loaded) return loaded.error();
    probes = std::move(*loaded);
  }
  const std::string data = o.prefix + ".tres";
  const std::string text = fmt::format(
      "[gd_resource type=\"LightmapGIData\" load_steps={} format=3]\n\n{}\n[resource]\n{} = {}[{}]{}\n"
      "uses_spherical_harmonics = {}\nuser_data = [{}]\nprobe_data = {}\n{}",
      names->size() + 1, resources, old ? "light_textures" : "lightmap_textures", old ? "" : "Array[TextureLayered](",
      textures, old ? "" : ")", w.kind != DirectionalKind::none, users,
      probe_data(probes ? &*probes : nullptr, o.godot_version),
      old ? "" : fmt::format("_uses_packed_directional = {}\n", w.kind != DirectionalKind::none));
  if (auto ok = w.save_text(data, text); !ok) return ok;
  const nlohmann::json manifest = {{"godot", o.godot_version},
                                   {"data", LightmapWriter::base(data)},
                                   {"scene", LightmapWriter::base(o.prefix + ".godot.glb")},
                                   {"users", listed}};
  if (auto ok = w.save_text(o.prefix + ".godot.json", manifest.dump(1) + "\n"); !ok) return ok;
  return w.save_carried("godot/lambent_lightmap.gd");
}

}  // namespace lambent::tool
