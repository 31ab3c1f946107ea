// Wavefront MTL: diffuse colour, diffuse map and emission; the rest of its Phong model has no use here.
#include <lambent/scene/load.h>
#include <lambent/scene/load_mtl.h>
#include <lambent/scene/mesh_file.h>
#include <lambent/scene/mesh_text.h>
#include <lambent/scene/textures.h>

#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <set>

namespace lambent {
namespace {

struct MtlMaterial {
  Vec3 diffuse{default_albedo}, emissive{0};
  std::string map;  // file name with forward slashes; empty for none
  bool clamp = false;
  std::array<float, 6> transform{1, 0, 0, 0, 1, 0};
  std::string where;  // of the map, for messages
};
using Library = std::map<std::string, MtlMaterial>;

// `Kd r [g b]`; one number stands for three. False if it is no number. The spectral and xyz forms leave `color` as it
// was.
bool parse_color(std::string_view text, Vec3& color, double highest) {
  double x[3];
  int count = 0;
  for (skip_blanks(text); !text.empty() && text[0] != '#' && count < 3; skip_blanks(text)) {
    if (count == 0 && (text.starts_with("spectral") || text.starts_with("xyz"))) return true;
    if (!take_number(text, x[count]) || std::isnan(x[count])) return false;
    x[count] = std::clamp(x[count], 0.0, highest), ++count;
  }
  if (count == 0) return false;
  color = count == 3 ? Vec3(x[0], x[1], x[2]) : Vec3(float(x[0]));
  return true;
}

// Up to three numbers of an option; those missing keep their defaults.
void parse_option(std::string_view& text, double (&x)[3]) {
  for (double& value : x) {
    std::string_view ahead = text;
    skip_blanks(ahead);
    double number;
    // A file name may start like a number: it does unless a blank follows.
    if (!take_number(ahead, number) || ahead.empty() || !is_blank(ahead[0])) return;
    if (std::isfinite(float(number))) value = number;
    text = ahead;
  }
}

// `map_Kd [options] file name`.
void parse_map(std::string_view text, MtlMaterial& material) {
  double scale[3] = {1, 1, 1}, offset[3] = {0, 0, 0}, unused[3];
  material.clamp = false;
  for (text = trimmed(text); text.size() > 1 && text[0] == '-'; text = trimmed(text)) {
    std::string_view rest = text, option = take_word(rest);
    if (option == "-s") {
      parse_option(rest, scale);
    } else if (option == "-o") {
      parse_option(rest, offset);
    } else if (option == "-t" || option == "-mm") {
      parse_option(rest, unused);
    } else if (option == "-clamp") {
      material.clamp = take_word(rest) == "on";
    } else if (option == "-blendu" || option == "-blendv" || option == "-cc" || option == "-bm" || option == "-boost" ||
               option == "-texres" || option == "-imfchan" || option == "-type") {
      take_word(rest);
    } else {
      break;  // a file name that starts with a dash
    }
    text = rest;
  }
  material.map = std::string(text);
  std::replace(material.map.begin(), material.map.end(), '\\', '/');
  // In the file's space (v upwards) uv' = s uv + o; Scene's v runs down, so v' = s_v v + (1 - s_v - o_v).
  material.transform = {float(scale[0]), 0, float(offset[0]), 0, float(scale[1]), float(1 - scale[1] - offset[1])};
}

Result<void> parse_mtl(std::span<const uint8_t> bytes, const std::string& path, Library& library) {
  LineReader lines(bytes);
  std::string_view text;
  MtlMaterial* material = nullptr;
  while (lines.next(text)) {
    std::string_view keyword = take_word(text);
    if (keyword == "newmtl") {
      material = &(library[short_name(text)] = MtlMaterial{});
    } else if (keyword == "Kd" || keyword == "Ke" || keyword == "map_Kd") {
      std::string where = fmt::format("{}:{}", path, lines.number());
      if (!material) return Error{where, fmt::format("{} before the first newmtl", keyword)};
      constexpr double brightest = 1e9;  // keeps sums of light finite
      bool ok = true;
      if (keyword == "Kd") ok = parse_color(text, material->diffuse, 1.0);
      if (keyword == "Ke") ok = parse_color(text, material->emissive, brightest);
      if (keyword == "map_Kd") parse_map(text, *material), material->where = where;
      if (!ok) return Error{where, "expected a colour of one or three numbers"};
    }
  }
  return {};
}

// Names in OBJ and MTL are plain; read_external_file takes URIs.
std::string uri_from_name(std::string_view name) {
  std::string uri;
  for (char c : name) uri += c == '%' ? "%25" : c == '\\' ? "/" : std::string(1, c);
  return uri;
}

// "a.png" and "./a.png" are one file, to be read once.
std::string normal_name(const std::string& name) {
  return std::filesystem::path(name).lexically_normal().generic_string();
}

// The files of one mtllib line: usually one, whose name may hold blanks, or several.
Result<void> load_library(std::string_view line, Scene& scene, const std::string& folder, Library& library,
                          bool& complete) {
  std::vector<std::string_view> names{line};
  auto whole = read_external_file(uri_from_name(line), folder, scene.path);
  if (!whole && line.find_first_of(" \t") != line.npos) {
    names.clear();
    while (!trimmed(line).empty()) names.push_back(take_word(line));
  }
  for (std::string_view name : names) {
    auto bytes = names.size() == 1 ? std::move(whole) : read_external_file(uri_from_name(name), folder, scene.path);
    if (!bytes) {
      complete = false;
      scene.warnings.push_back(bytes.error().text());
      continue;
    }
    std::string path = (std::filesystem::path(folder) / name).string();
    if (auto parsed = parse_mtl(*bytes, path, library); !parsed) return parsed.error();
  }
  return {};
}

using TextureNumbers = std::map<std::pair<std::string, bool>, int>;

Result<int> load_texture(Scene& scene, const MtlMaterial& source, const std::string& folder, TextureNumbers& known) {
  std::string name = normal_name(source.map);
  auto [place, is_new] = known.try_emplace({name, source.clamp}, int(scene.textures.size()));
  if (!is_new) return place->second;
  if (auto twin = known.find({name, !source.clamp}); twin != known.end()) {
    scene.textures.push_back(scene.textures[size_t(twin->second)]);
  } else {
    auto bytes = read_external_file(uri_from_name(source.map), folder, source.where);
    if (!bytes) return bytes.error();
    auto texture = decode_texture(std::move(*bytes), source.map);
    if (!texture) return Error{source.where, texture.error().text()};
    scene.textures.push_back(std::move(*texture));
  }
  Texture& texture = scene.textures.back();
  texture.name = short_name(source.map);
  texture.wrap_s = texture.wrap_t = source.clamp ? Wrap::clamp : Wrap::repeat;
  return place->second;
}

}  // namespace

Result<std::vector<uint32_t>> load_materials(Scene& scene, const std::vector<std::string>& libraries,
                                             const std::vector<std::string>& names, Vec3 fallback,
                                             const std::string& folder) {
  Library library;
  bool complete = true;
  std::set<std::string> tried;
  for (const std::string& line : libraries) {
    if (!tried.insert(normal_name(line)).second) continue;
    if (auto loaded = load_library(line, scene, folder, library, complete); !loaded) return loaded.error();
  }

  std::map<std::string, uint32_t> numbers;
  TextureNumbers textures;
  std::set<std::string> unknown;
  std::string first_unknown;
  std::vector<uint32_t> result;
  for (const std::string& name : names) {
    auto found = library.find(name);
    if (found == library.end() && !name.empty() && unknown.insert(name).second && unknown.size() == 1)
      first_unknown = name;
    // All names that no library defines share one material, under a key that no file can spell.
    std::string key = found == library.end() ? std::string("\n") : name;
    auto [place, is_new] = numbers.try_emplace(key, uint32_t(scene.materials.size()));
    result.push_back(place->second);
    if (!is_new) continue;
    Material material;
    material.metallic = 0, material.roughness = 1;
    material.name = "default", material.base_color = fallback;
    if (found != library.end()) {
      const MtlMaterial& source = found->second;
      material.name = name, material.base_color = source.diffuse, material.emissive = source.emissive;
      if (!source.map.empty()) {
        auto texture = load_texture(scene, source, folder, textures);
        if (!texture) return texture.error();
        material.base_color_texture = *texture, material.uv_transform = source.transform;
      }
    }
    scene.materials.push_back(std::move(material));
  }
  if (!unknown.empty() && complete) {
    std::string more = unknown.size() > 1 ? fmt::format(" and {} more", unknown.size() - 1) : "";
    scene.warnings.push_back(
        fmt::format("{}: material \"{}\"{} not defined, the default is used", scene.path, first_unknown, more));
  }
  return result;
}

}  // namespace lambent
