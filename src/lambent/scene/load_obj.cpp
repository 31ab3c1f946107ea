// Wavefront OBJ and MTL: "Advanced Visualizer Manual", appendix B (Wavefront 1993); vertex colours after the
// coordinates, sRGB-encoded, as MeshLab, Blender and others write them.
#include <lambent/scene/load.h>
#include <lambent/scene/load_mtl.h>
#include <lambent/scene/mesh_file.h>
#include <lambent/scene/mesh_text.h>

#include <fmt/format.h>

#include <charconv>
#include <map>

namespace lambent {
namespace {

struct ObjFile {
  std::string path;
  CornerMesh mesh;
  std::vector<std::pair<std::string, std::string>> groups;  // (object, material), in order of their first faces
  std::vector<std::string> libraries;                       // what the mtllib lines say
};

// Reads up to `capacity` numbers; false if something that is not a number comes among them.
bool read_numbers(std::string_view text, double* values, size_t capacity, size_t& count) {
  for (count = 0; count < capacity; ++count) {
    skip_blanks(text);
    if (text.empty() || text[0] == '#') break;
    if (!take_number(text, values[count]) || (!text.empty() && !is_blank(text[0]))) return false;
  }
  return true;
}

// Corner references as written: 1-based, or counted back from the last; unchecked upwards, since faces may come first.
bool take_reference(std::string_view& text, size_t so_far, uint32_t& index) {
  int64_t value = 0;
  auto [stop, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || value == 0 || value < -int64_t(so_far) || value >= int64_t(none)) return false;
  index = value > 0 ? uint32_t(value - 1) : uint32_t(int64_t(so_far) + value);
  text.remove_prefix(size_t(stop - text.data()));
  return true;
}

// v, v/vt, v//vn or v/vt/vn.
bool take_corner(std::string_view& text, const CornerMesh& obj, MeshCorner& corner) {
  auto take_slash = [&] {
    bool is_slash = !text.empty() && text[0] == '/';
    if (is_slash) text.remove_prefix(1);
    return is_slash;
  };
  auto ended = [&] { return text.empty() || is_blank(text[0]); };
  if (!take_reference(text, obj.v.size(), corner.v)) return false;
  if (take_slash() && !ended()) {
    if (text[0] != '/' && !take_reference(text, obj.vt.size(), corner.vt)) return false;
    if (take_slash() && !ended() && !take_reference(text, obj.vn.size(), corner.vn)) return false;
  }
  return ended();
}

class ObjParser {
 public:
  explicit ObjParser(ObjFile& obj) : obj_(obj), mesh_(obj.mesh) {}

  // The reason why the line is wrong, or nothing.
  std::string parse_line(std::string_view text, size_t line) {
    std::string_view keyword = take_word(text);
    if (keyword == "v") return parse_position(text);
    if (keyword == "f") return parse_face(text, line);
    if (keyword == "vn") return parse_normal(text);
    if (keyword == "vt") return parse_texcoord(text);
    if (keyword == "o") object_ = short_name(text), group_.clear(), group_changed_ = true;
    if (keyword == "g") group_ = short_name(text), group_changed_ = true;
    if (keyword == "usemtl") material_ = short_name(text), group_changed_ = true;
    if (keyword == "mtllib") obj_.libraries.emplace_back(trimmed(text));
    return {};
  }

 private:
  std::string parse_position(std::string_view text) {
    double x[7];
    size_t count;
    if (!read_numbers(text, x, 7, count)) return "expected a number";
    if (count < 3) return "a vertex needs three coordinates";
    Vec3d p(x[0], x[1], x[2]);
    if (mesh_.v.size() >= max_corners) return "too many vertices";
    mesh_.v.push_back(is_position(p) ? p : broken_position);
    if (count >= 6) {
      mesh_.colors.resize(mesh_.v.size() - 1, Vec3(1));
      Vec3 encoded = clamp_color(x[3], x[4], x[5]);
      mesh_.colors.push_back({srgb_to_linear(encoded.x), srgb_to_linear(encoded.y), srgb_to_linear(encoded.z)});
    }
    return {};
  }

  std::string parse_normal(std::string_view text) {
    double x[3];
    size_t count;
    if (!read_numbers(text, x, 3, count)) return "expected a number";
    if (count < 3) return "a normal needs three numbers";
    if (mesh_.vn.size() >= max_corners) return "too many normals";
    mesh_.vn.push_back(Vec3(x[0], x[1], x[2]));
    return {};
  }

  std::string parse_texcoord(std::string_view text) {
    double x[2] = {0, 0};
    size_t count;
    if (!read_numbers(text, x, 2, count)) return "expected a number";
    if (count < 1) return "a texture coordinate needs a number";
    if (mesh_.vt.size() >= max_corners) return "too many texture coordinates";
    mesh_.vt.push_back(texcoord_from_below(x[0], x[1]));
    return {};
  }

  std::string parse_face(std::string_view text, size_t line) {
    MeshFace face{mesh_.corners.size(), 0, current_group(), line};
    for (skip_blanks(text); !text.empty() && text[0] != '#'; skip_blanks(text)) {
      MeshCorner corner;
      if (!take_corner(text, mesh_, corner)) return "malformed or out-of-range face corner";
      if (mesh_.corners.size() >= max_corners) return "too many face corners";
      mesh_.corners.push_back(corner);
    }
    face.count = mesh_.corners.size() - face.first;
    mesh_.faces.push_back(face);
    return {};
  }

  uint32_t current_group() {
    if (!group_changed_) return group_number_;
    std::string label = object_.empty() || group_.empty() ? object_ + group_ : object_ + "/" + group_;
    auto [place, is_new] = numbers_.try_emplace({label, material_}, uint32_t(obj_.groups.size()));
    if (is_new) obj_.groups.push_back(place->first), mesh_.groups.push_back(label);
    group_changed_ = false;
    return group_number_ = place->second;
  }

  ObjFile& obj_;
  CornerMesh& mesh_;
  std::string object_, group_, material_;
  bool group_changed_ = true;
  uint32_t group_number_ = 0;
  std::map<std::pair<std::string, std::string>, uint32_t> numbers_;
};

// Faces whose vertices do not exist are an error; whose normals or texture coordinates do not, go without, as
// everywhere.
Result<void> check_references(ObjFile& obj, size_t& lost) {
  CornerMesh& mesh = obj.mesh;
  for (const MeshFace& face : mesh.faces) {
    bool whole = true;
    for (size_t c = face.first; c < face.first + face.count; ++c) {
      MeshCorner& corner = mesh.corners[c];
      if (corner.v >= mesh.v.size())
        return Error{fmt::format("{}:{}", obj.path, face.line),
                     fmt::format("vertex {} of {} does not exist", uint64_t(corner.v) + 1, mesh.v.size())};
      if (corner.vt != none && corner.vt >= mesh.vt.size()) corner.vt = none, whole = false;
      if (corner.vn != none && corner.vn >= mesh.vn.size()) corner.vn = none, whole = false;
    }
    lost += !whole;
  }
  return {};
}

}  // namespace

Result<Scene> load_obj(std::span<const uint8_t> bytes, const std::string& path, const std::string& folder) {
  if (auto text = check_not_utf16(bytes, path); !text) return text.error();
  ObjFile obj;
  obj.path = path;
  ObjParser parser(obj);
  LineReader lines(bytes);
  std::string_view text;
  while (lines.next(text)) {
    std::string reason = parser.parse_line(text, lines.number());
    if (!reason.empty()) return Error{fmt::format("{}:{}", path, lines.number()), reason};
  }
  size_t lost = 0;
  if (auto checked = check_references(obj, lost); !checked) return checked.error();
  CornerMesh& mesh = obj.mesh;
  if (!mesh.colors.empty()) mesh.colors.resize(mesh.v.size(), Vec3(1));

  Scene scene;
  scene.path = path;
  if (auto told = tell_left_out(scene, assemble_mesh(mesh, scene)); !told) return told.error();
  if (lost > 0)
    scene.warnings.push_back(
        fmt::format("{}: {} faces name normals or texture coordinates that do not exist, and go without", path, lost));
  std::vector<std::string> names;
  for (const auto& group : obj.groups) names.push_back(group.second);
  Vec3 fallback = mesh.colors.empty() ? Vec3(default_albedo) : Vec3(1);
  auto numbers = load_materials(scene, obj.libraries, names, fallback, folder);
  if (!numbers) return numbers.error();
  for (Part& part : scene.parts) part.material = (*numbers)[part.material];
  leave_colors_to_pictures(scene);
  if (auto finished = finish_mesh(scene); !finished) return finished.error();
  return scene;
}

}  // namespace lambent
