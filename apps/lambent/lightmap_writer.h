#pragma once
// What the exports of lightmaps share: the baked file, its light groups relit one by one, and pictures over the whole
// atlas or over one of each object.
#include "export_lightmap.h"

#include <lambent/baked/baked_file.h>
#include <lambent/image/image.h>
#include <lambent/receivers/object_atlas.h>
#include <lambent/relight/relight.h>

#include <nlohmann/json.hpp>

#include <set>

namespace lambent::tool {

struct LightmapWriter {
  Baked baked;           // with the objects' texture coordinates, where there are objects
  TexelReceivers atlas;  // the whole one
  DirectionalKind kind = DirectionalKind::none;
  LightBasis light;
  std::vector<ObjectAtlas> objects;       // with texels; empty: one atlas for all
  std::vector<std::string> object_files;  // names fit for files
  std::string prefix;
  std::vector<std::string> pictures, files;  // that were written

  size_t receivers() const { return receivers_of(baked.surface.store); }
  // Values of all receivers, over the whole atlas or of each object.
  std::vector<Image> images(const std::vector<Vec3>& values) const;
  // NAME.exr, or NAME.OBJECT.exr of each object.
  Result<void> save(const std::string& name, const std::vector<Vec3>& values,
                    const std::vector<float>* alpha = nullptr);
  Result<void> save_picture(const std::string& path, const Image& image);
  Result<void> save_text(const std::string& path, const std::string& text);
  // One of the files that the tool carries, into the folder of `prefix` or one below; those that sum 9 pictures sum
  // `pictures`.
  Result<void> save_carried(const std::string& name, const std::string& below = "", int pictures = 9);
  // PREFIX.KIND.glb: the scene with the atlas as TEXCOORD_1; node names of each part.
  Result<std::vector<std::vector<std::string>>> save_scene(const std::string& path);
  // Names without folders, as files beside one another name each other.
  static std::string base(const std::string& path);
};

// "lamp 1" -> "lamp_1"; a second one of that name "lamp_1_2".
std::string file_name(const std::string& text, std::set<std::string>& taken);

// Objects by the node that Godot and Unity know: name, path of names from the top, lightmap.
struct EngineObject {
  std::string name;
  std::vector<std::string> path;
  size_t lightmap = 0;
};
std::vector<EngineObject> engine_objects(const LightmapWriter& w, const std::vector<std::vector<std::string>>& nodes);

// Light in free space under one light, of order 3 at least: points, in the order of Lattice::index, of three or more
// layers an axis has one of, two with the same light are made.
struct Probes {
  Lattice lattice;
  std::vector<Vec3> points;
  std::vector<std::vector<Vec3>> sh;  // 9 coefficients of incident radiance each (basis/sh.h)
};
Result<Probes> load_probes(const LightmapExport& o);
nlohmann::json probes_json(const Probes& probes, const std::string& convention, bool mirror_x);

// Godot's own structures: tetrahedra that fill the lattice, and the tree by which it finds them, six whole numbers a
// node: a plane's four floats as bits, and where to go over and under it.
struct GodotProbes {
  std::vector<int32_t> tetrahedra, tree;
};
GodotProbes godot_probes(const Lattice& lattice);

// Slices of one size below one another, as Godot's 2d_array_texture takes them apart, in as few pictures as it can
// have, with its import settings; their names.
Result<std::vector<std::string>> write_layers(LightmapWriter& w, const std::string& name,
                                              const std::vector<Image>& slices);

Result<void> write_godot(LightmapWriter& w, const LightmapExport& o, const Relit& all);
Result<void> write_unity(LightmapWriter& w, const LightmapExport& o, const Relit& all);
// PREFIX.sky.K.exr, and for Godot all of them in one, with the shader's snippet and the sky's coefficients.
Result<nlohmann::json> write_sky(LightmapWriter& w, const LightmapExport& o);

// The files that the tool carries, from integrations/.
const char* carried_file(const std::string& name);

}  // namespace lambent::tool
