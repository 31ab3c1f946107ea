#include "lightmap_writer.h"

#include <lambent/core/check.h>
#include <lambent/render/lightmap_picture.h>

#include <filesystem>

namespace lambent::tool {

namespace fs = std::filesystem;

std::string file_name(const std::string& text, std::set<std::string>& taken) {
  std::string safe;
  for (char c : text) safe += std::isalnum(static_cast<unsigned char>(c)) || c == '-' ? c : '_';
  if (safe.empty()) safe = "_";
  std::string name = safe;
  for (int i = 2; !taken.insert(name).second; ++i) name = safe + "_" + std::to_string(i);
  return name;
}

std::string LightmapWriter::base(const std::string& path) { return fs::path(path).filename().string(); }

std::vector<Image> LightmapWriter::images(const std::vector<Vec3>& values) const {
  Image whole = lightmap_picture(atlas, values);
  std::vector<Image> out;
  for (const ObjectAtlas& object : objects) {
    Image own(object.width, object.height);
    own.rgb = values_of(object, whole.rgb);
    out.push_back(std::move(own));
  }
  if (objects.empty()) out.push_back(std::move(whole));
  return out;
}

Result<void> LightmapWriter::save_picture(const std::string& path, const Image& image) {
  pictures.push_back(path);
  return save_image(path, image);
}

Result<void> LightmapWriter::save(const std::string& name, const std::vector<Vec3>& values,
                                  const std::vector<float>* alpha) {
  std::vector<Image> all = images(values);
  if (alpha) {
    std::vector<Vec3> spread;
    for (float a : *alpha) spread.emplace_back(a);
    const std::vector<Image> alphas = images(spread);
    for (size_t i = 0; i < all.size(); ++i)
      for (const Vec3& a : alphas[i].rgb) all[i].alpha.push_back(a.x);
  }
  for (size_t i = 0; i < all.size(); ++i) {
    const std::string path = name + (objects.empty() ? "" : "." + object_files[i]) + ".exr";
    if (auto ok = save_picture(path, all[i]); !ok) return ok;
  }
  return {};
}

Result<void> LightmapWriter::save_text(const std::string& path, const std::string& text) {
  files.push_back(path);
  const std::span<const uint8_t> bytes{reinterpret_cast<const uint8_t*>(text.data()), text.size()};
  return write_file_atomically(path, std::span(&bytes, 1));
}

Result<void> LightmapWriter::save_carried(const std::string& name, const std::string& below, int pictures) {
  const fs::path folder = fs::path(prefix).parent_path() / below;
  std::error_code status;
  if (!folder.empty()) fs::create_directories(folder, status);
  if (status) return Error{folder.string(), "cannot be written: " + status.message()};
  const char* carried = carried_file(name);
  LAMBENT_CHECK(carried);
  std::string text = carried;
  for (const std::string counted : {"[9]", "k < 9"}) {
    std::string other = counted;
    other.replace(other.find('9'), 1, std::to_string(pictures));
    for (size_t at = text.find(counted); at != std::string::npos; at = text.find(counted, at + other.size()))
      text.replace(at, counted.size(), other);
  }
  return save_text((folder / fs::path(name).filename()).string(), text);
}

Result<std::vector<std::vector<std::string>>> LightmapWriter::save_scene(const std::string& path) {
  ViewerLook look;
  look.kind = LookKind::coordinates;
  std::vector<std::vector<std::string>> nodes;
  files.push_back(path);
  if (auto ok = save_look(path, baked, look, &nodes); !ok) return ok.error();
  return nodes;
}

std::vector<EngineObject> engine_objects(const LightmapWriter& w, const std::vector<std::vector<std::string>>& nodes) {
  std::vector<EngineObject> out;
  std::set<std::string> taken;
  std::vector<size_t> lightmap(w.baked.scene.parts.size(), 0);
  for (size_t i = 0; i < w.objects.size(); ++i)
    for (uint32_t p : w.objects[i].parts) lightmap[p] = i;
  for (size_t p = 0; p < nodes.size(); ++p)
    if (!nodes[p].empty() && taken.insert(nodes[p].back()).second)
      out.push_back({nodes[p].back(), nodes[p], lightmap[p]});
  return out;
}

}  // namespace lambent::tool
