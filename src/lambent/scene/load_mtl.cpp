// Wavefront MTL: diffuse colour, emission and dissolve with their maps, and the PBR extension's roughness and metalness
// (Clara.io 2014, Blender); the rest of its Phong model has no use here.
#include <lambent/scene/load.h>
#include <lambent/scene/load_mtl.h>
#include <lambent/scene/mesh_file.h>
#include <lambent/scene/mesh_text.h>
#include <lambent/scene/named_file.h>
#include <lambent/scene/textures.h>

#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <tuple>

namespace lambent {
namespace {

struct MtlMap {
  std::string name;  // as written; empty for none
  bool clamp = false;
  std::array<float, 6> transform{1, 0, 0, 0, 1, 0};
  std::string where;  // for messages; empty where there is no line for it
};

struct MtlMaterial {
  Vec3 diffuse{default_albedo}, emissive{0};
  MtlMap color_map, glow_map, alpha_map;
  double roughness = 1, metallic = 0;
  std::optional<double> dissolve, transparency;  // d, Tr
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
MtlMap parse_map(std::string_view text, std::string where) {
  MtlMap map;
  map.where = std::move(where);
  double scale[3] = {1, 1, 1}, offset[3] = {0, 0, 0}, unused[3];
  for (text = trimmed(text); text.size() > 1 && text[0] == '-'; text = trimmed(text)) {
    std::string_view rest = text, option = take_word(rest);
    if (option == "-s") {
      parse_option(rest, scale);
    } else if (option == "-o") {
      parse_option(rest, offset);
    } else if (option == "-t" || option == "-mm") {
      parse_option(rest, unused);
    } else if (option == "-clamp") {
      map.clamp = take_word(rest) == "on";
    } else if (option == "-blendu" || option == "-blendv" || option == "-cc" || option == "-bm" || option == "-boost" ||
               option == "-texres" || option == "-imfchan" || option == "-type" || option == "-colorspace") {
      take_word(rest);
    } else {
      break;  // a file name that starts with a dash
    }
    text = rest;
  }
  map.name = std::string(text);
  // In the file's space (v upwards) uv' = s uv + o; Scene's v runs down, so v' = s_v v + (1 - s_v - o_v).
  map.transform = {float(scale[0]), 0, float(offset[0]), 0, float(scale[1]), float(1 - scale[1] - offset[1])};
  return map;
}

// `Pr x`, `d [-halo] x`: a number in [0, 1].
template <class T>
bool parse_share(std::string_view text, T& share) {
  text = trimmed(text);
  if (text.starts_with("-halo")) text.remove_prefix(5);
  skip_blanks(text);
  double x;
  if (!take_number(text, x) || std::isnan(x)) return false;
  return share = std::clamp(x, 0.0, 1.0), true;
}

std::string lower_case(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  return lower;
}

// Keywords in any case, as other readers take them. `unread`: what would change the picture and is not read.
Result<void> parse_mtl(std::span<const uint8_t> bytes, const std::string& path, Library& library,
                       std::set<std::string>& unread) {
  constexpr double brightest = 1e9;  // keeps sums of light finite
  static const std::set<std::string> known{"kd", "ke", "map_kd", "map_ke", "pr", "pm", "d", "tr", "map_d"},
      other{"map_bump", "bump", "norm", "disp", "map_pr", "map_pm", "decal"};
  LineReader lines(bytes);
  std::string_view text;
  MtlMaterial* material = nullptr;
  while (lines.next(text)) {
    const std::string_view word = take_word(text);
    if (word.size() > 8) continue;
    const std::string keyword = lower_case(word);
    if (keyword == "newmtl") material = &(library[short_name(text)] = MtlMaterial{});
    if (other.contains(keyword)) unread.insert(std::string(word));
    if (!known.contains(keyword)) continue;
    std::string where = fmt::format("{}:{}", path, lines.number());
    if (!material) return Error{where, fmt::format("{} before the first newmtl", word)};
    bool is_color = keyword[0] == 'k', ok = true;
    if (keyword == "kd") ok = parse_color(text, material->diffuse, 1.0);
    if (keyword == "ke") ok = parse_color(text, material->emissive, brightest);
    if (keyword == "pr") ok = parse_share(text, material->roughness);
    if (keyword == "pm") ok = parse_share(text, material->metallic);
    if (keyword == "d") ok = parse_share(text, material->dissolve);
    if (keyword == "tr") ok = parse_share(text, material->transparency);
    if (keyword == "map_d") material->alpha_map = parse_map(text, where);
    if (keyword == "map_kd") material->color_map = parse_map(text, where);
    if (keyword == "map_ke") material->glow_map = parse_map(text, where);
    if (!ok) return Error{where, is_color ? "expected a colour of one or three numbers" : "expected a number"};
  }
  return {};
}

// "a.png" and "./a.png" are one file, to be read once.
std::string normal_name(std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  return std::filesystem::path(name).lexically_normal().generic_string();
}

// The files of one mtllib line: usually one, whose name may hold blanks, or several.
Result<void> load_library(std::string_view line, Scene& scene, const std::string& folder, Library& library,
                          bool& complete, std::set<std::string>& unread) {
  std::vector<std::string_view> names{line};
  auto whole = read_named_file(line, folder, scene.path);
  if (!whole && line.find_first_of(" \t") != line.npos) {
    names.clear();
    while (!trimmed(line).empty()) names.push_back(take_word(line));
  }
  for (std::string_view name : names) {
    auto bytes = names.size() == 1 ? std::move(whole) : read_named_file(name, folder, scene.path);
    if (!bytes) {
      complete = false;
      scene.warnings.push_back(bytes.error().text());
      continue;
    }
    std::string path = (std::filesystem::path(folder) / name).string();
    if (auto text = check_not_utf16(*bytes, path); !text) return text.error();
    if (auto parsed = parse_mtl(*bytes, path, library, unread); !parsed) return parsed.error();
  }
  return {};
}

// Puts the pictures of materials into the scene, each once.
class PictureLoader {
 public:
  PictureLoader(Scene& scene, const std::string& folder) : scene_(scene), folder_(folder) {}

  // The texture's number; -1 where there is none to be had.
  int load(const MtlMap& map) {
    if (map.where.empty()) return -1;
    const Texture* picture = read(map);
    if (!picture) return -1;
    auto [place, is_new] = known_.try_emplace({normal_name(map.name), "", map.clamp}, int(scene_.textures.size()));
    if (is_new) add(*picture, map.clamp);
    return place->second;
  }

  // The same of a colour map, or of white, with a mask as its alpha; -1 where the mask is not to be had.
  int load_masked(const MtlMap& color, const MtlMap& mask) {
    const Texture* alpha = read(mask);
    const Texture* colors = color.where.empty() ? nullptr : read(color);
    const bool is_same = normal_name(color.name) == normal_name(mask.name);
    if (!alpha || (is_same && alpha->alpha.empty())) return -1;
    const bool clamp = colors ? color.clamp : mask.clamp;
    auto [place, is_new] = known_.try_emplace({colors ? normal_name(color.name) : "", normal_name(mask.name), clamp},
                                              int(scene_.textures.size()));
    if (!is_new) return place->second;
    auto both = with_alpha(colors ? *colors : Texture{}, *alpha, colors ? colors->name : alpha->name);
    if (!both) return lost_.add(both.error()), known_.erase(place), -1;
    add(*both, clamp);
    return place->second;
  }
  void tell() const { lost_.tell(scene_); }

 private:
  // Null where it cannot be had.
  const Texture* read(const MtlMap& map) {
    auto [place, is_new] = pictures_.try_emplace(normal_name(map.name));
    if (is_new) {
      auto texture = read_named_picture(map.name, folder_, map.where);
      if (!texture) return lost_.add(texture.error()), nullptr;
      place->second = std::move(*texture);
    }
    return place->second.rgb.empty() ? nullptr : &place->second;
  }
  void add(const Texture& texture, bool clamp) {
    scene_.textures.push_back(texture);
    scene_.textures.back().wrap_s = scene_.textures.back().wrap_t = clamp ? Wrap::clamp : Wrap::repeat;
  }

  Scene& scene_;
  const std::string& folder_;
  std::map<std::string, Texture> pictures_;                          // by name; without pixels: lost
  std::map<std::tuple<std::string, std::string, bool>, int> known_;  // by name, mask and clamp
  LostPictures lost_;
};

// What is there of a surface. `d` is read before `Tr`, of which files disagree whether 1 is clear or solid: alone it is
// transparency, but never of all.
float alpha_of(const MtlMaterial& source) {
  if (source.dissolve) return float(*source.dissolve);
  return source.transparency && *source.transparency < 1 ? float(1 - *source.transparency) : 1.0f;
}

Material material_from(const MtlMaterial& source, PictureLoader& pictures) {
  Material material;
  material.base_color = source.diffuse, material.emissive = source.emissive;
  material.metallic = float(source.metallic), material.roughness = float(source.roughness);
  const bool has_color = !source.color_map.where.empty(), has_mask = !source.alpha_map.where.empty();
  if (has_mask) material.base_color_texture = pictures.load_masked(source.color_map, source.alpha_map);
  const bool is_masked = material.base_color_texture >= 0;
  if (!is_masked) material.base_color_texture = pictures.load(source.color_map);
  material.uv_transform = has_color ? source.color_map.transform : source.alpha_map.transform;
  material.alpha = alpha_of(source);
  if (is_masked || material.alpha < 1) material.alpha_mode = AlphaMode::blend;
  // Exporters write Kd 0, or Ke 0, beside the map that takes its place.
  if (has_color && source.diffuse == Vec3(0))
    material.base_color = Vec3(material.base_color_texture < 0 ? default_albedo : 1.0f);
  material.emissive_texture = pictures.load(source.glow_map);
  material.emissive_transform = source.glow_map.transform;
  if (!source.glow_map.where.empty()) {
    if (material.emissive_texture < 0) material.emissive = Vec3(0);
    else if (source.emissive == Vec3(0)) material.emissive = Vec3(1);
  }
  return material;
}

}  // namespace

Result<std::vector<uint32_t>> load_materials(Scene& scene, const std::vector<std::string>& libraries,
                                             const std::vector<std::string>& names, Vec3 fallback,
                                             const std::string& folder) {
  Library library;
  bool complete = true;
  std::set<std::string> tried, unread;
  for (const std::string& line : libraries) {
    if (!tried.insert(normal_name(line)).second) continue;
    if (auto loaded = load_library(line, scene, folder, library, complete, unread); !loaded) return loaded.error();
  }

  std::map<std::string, uint32_t> numbers;
  PictureLoader pictures(scene, folder);
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
    Material material =
        material_from(found == library.end() ? MtlMaterial{.diffuse = fallback} : found->second, pictures);
    material.name = found == library.end() ? "default" : name;
    scene.materials.push_back(std::move(material));
  }
  pictures.tell();
  if (!unread.empty())
    scene.warnings.push_back(fmt::format("{}: not read of its materials: {}", scene.path, fmt::join(unread, ", ")));
  if (!unknown.empty() && complete) {
    std::string more = unknown.size() > 1 ? fmt::format(" and {} more", unknown.size() - 1) : "";
    scene.warnings.push_back(
        fmt::format("{}: material \"{}\"{} not defined, the default is used", scene.path, first_unknown, more));
  }
  return result;
}

}  // namespace lambent
