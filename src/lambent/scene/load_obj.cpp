// Wavefront OBJ and MTL: "Advanced Visualizer Manual", appendix B (Wavefront 1993); vertex colours after the
// coordinates as MeshLab and others write them.
#include <lambent/scene/index_table.h>
#include <lambent/scene/load.h>
#include <lambent/scene/load_mtl.h>
#include <lambent/scene/mesh_file.h>
#include <lambent/scene/mesh_text.h>

#include <fmt/format.h>

#include <charconv>
#include <map>
#include <numeric>

namespace lambent {
namespace {

struct Corner {
  uint32_t v, vt = none, vn = none;
  auto operator<=>(const Corner&) const = default;
};

struct Face {
  size_t first, count;  // in ObjFile::corners
  uint32_t group;
  size_t line;
};

struct ObjFile {
  std::string path;
  std::vector<Vec3> v, colors, vn;  // colors: empty, or as many as v
  std::vector<Vec2> vt;
  std::vector<Corner> corners;
  std::vector<Face> faces;
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
bool take_corner(std::string_view& text, const ObjFile& obj, Corner& corner) {
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
  explicit ObjParser(ObjFile& obj) : obj_(obj) {}

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
    Vec3 p = Vec3(x[0], x[1], x[2]);
    if (!is_position(p)) return "vertex coordinate is not finite or beyond 1e9";
    if (obj_.v.size() >= max_corners) return "too many vertices";
    obj_.v.push_back(p);
    if (count >= 6) {
      obj_.colors.resize(obj_.v.size() - 1, Vec3(1));
      obj_.colors.push_back(clamp_color(x[3], x[4], x[5]));
    }
    return {};
  }

  std::string parse_normal(std::string_view text) {
    double x[3];
    size_t count;
    if (!read_numbers(text, x, 3, count)) return "expected a number";
    if (count < 3) return "a normal needs three numbers";
    if (obj_.vn.size() >= max_corners) return "too many normals";
    obj_.vn.push_back(Vec3(x[0], x[1], x[2]));
    return {};
  }

  std::string parse_texcoord(std::string_view text) {
    double x[2] = {0, 0};
    size_t count;
    if (!read_numbers(text, x, 2, count)) return "expected a number";
    if (count < 1) return "a texture coordinate needs a number";
    if (obj_.vt.size() >= max_corners) return "too many texture coordinates";
    obj_.vt.push_back(texcoord_from_below(x[0], x[1]));
    return {};
  }

  std::string parse_face(std::string_view text, size_t line) {
    Face face{obj_.corners.size(), 0, current_group(), line};
    for (skip_blanks(text); !text.empty() && text[0] != '#'; skip_blanks(text)) {
      Corner corner;
      if (!take_corner(text, obj_, corner)) return "malformed or out-of-range face corner";
      if (obj_.corners.size() >= max_corners) return "too many face corners";
      obj_.corners.push_back(corner);
    }
    face.count = obj_.corners.size() - face.first;
    obj_.faces.push_back(face);
    return {};
  }

  uint32_t current_group() {
    if (!group_changed_) return group_number_;
    std::string label = object_.empty() || group_.empty() ? object_ + group_ : object_ + "/" + group_;
    auto [place, is_new] = numbers_.try_emplace({label, material_}, uint32_t(obj_.groups.size()));
    if (is_new) obj_.groups.push_back(place->first);
    group_changed_ = false;
    return group_number_ = place->second;
  }

  ObjFile& obj_;
  std::string object_, group_, material_;
  bool group_changed_ = true;
  uint32_t group_number_ = 0;
  std::map<std::pair<std::string, std::string>, uint32_t> numbers_;
};

Result<void> check_references(const ObjFile& obj) {
  for (const Face& face : obj.faces) {
    for (size_t c = face.first; c < face.first + face.count; ++c) {
      Corner corner = obj.corners[c];
      auto wrong = [&](const char* what, uint32_t index, size_t count) {
        return Error{fmt::format("{}:{}", obj.path, face.line),
                     fmt::format("{} {} of {} does not exist", what, uint64_t(index) + 1, count)};
      };
      if (corner.v >= obj.v.size()) return wrong("vertex", corner.v, obj.v.size());
      if (corner.vt != none && corner.vt >= obj.vt.size()) return wrong("texture coordinate", corner.vt, obj.vt.size());
      if (corner.vn != none && corner.vn >= obj.vn.size()) return wrong("normal", corner.vn, obj.vn.size());
    }
  }
  return {};
}

// Puts the groups' faces into the scene, triangulated, a part a group; a part's vertices are its distinct corners, in
// the file's order of positions. Returns how many faces had fewer than three corners.
class ObjAssembler {
 public:
  ObjAssembler(const ObjFile& obj, Scene& scene) : obj_(obj), scene_(scene) {
    has_texcoords_ = std::any_of(obj.corners.begin(), obj.corners.end(), [](Corner c) { return c.vt != none; });
  }

  size_t assemble() {
    std::vector<std::vector<uint32_t>> faces_of(obj_.groups.size());
    for (uint32_t f = 0; f < obj_.faces.size(); ++f) faces_of[obj_.faces[f].group].push_back(f);
    for (uint32_t g = 0; g < obj_.groups.size(); ++g) add_part(g, faces_of[g]);
    return dropped_;
  }

 private:
  void add_part(uint32_t group, const std::vector<uint32_t>& faces) {
    triangles_.clear();
    for (uint32_t f : faces) cut_face(obj_.faces[f]);

    // Number the distinct corners, then order them.
    IndexTable table(3 * triangles_.size());
    corners_.clear();
    std::vector<uint32_t> number(3 * triangles_.size());
    for (size_t i = 0; i < number.size(); ++i) {
      Corner corner = obj_.corners[triangles_[i / 3][i % 3]];
      uint64_t hash = hash64(uint64_t(corner.v) << 32 | corner.vt, corner.vn);
      number[i] =
          table.find_or_insert(hash, uint32_t(corners_.size()), [&](uint32_t k) { return corners_[k] == corner; });
      if (number[i] == corners_.size()) corners_.push_back(corner);
    }
    std::vector<uint32_t> order(corners_.size()), place(corners_.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return corners_[a] < corners_[b]; });
    for (uint32_t i = 0; i < order.size(); ++i) place[order[i]] = i;

    Part part;
    part.name = obj_.groups[group].first.empty() ? file_stem(obj_.path) : obj_.groups[group].first;
    part.material = group;  // the caller puts the material's number
    part.first_vertex = uint32_t(scene_.positions.size()), part.vertex_count = uint32_t(order.size());
    part.first_triangle = uint32_t(scene_.triangles.size()), part.triangle_count = uint32_t(triangles_.size());
    for (uint32_t i : order) add_vertex(corners_[i]);
    for (size_t t = 0; t < triangles_.size(); ++t) {
      Triangle triangle{{}, uint32_t(scene_.parts.size()), true};
      for (int k = 0; k < 3; ++k) triangle.v[k] = part.first_vertex + place[number[3 * t + size_t(k)]];
      scene_.triangles.push_back(triangle);
    }
    scene_.parts.push_back(std::move(part));
  }

  void add_vertex(Corner c) {
    scene_.positions.push_back(obj_.v[c.v]);
    scene_.normals.push_back(c.vn == none ? Vec3(0) : obj_.vn[c.vn]);
    if (has_texcoords_) scene_.texcoords[0].push_back(c.vt == none ? Vec2(0) : obj_.vt[c.vt]);
    if (!obj_.colors.empty()) scene_.colors.push_back(c.v < obj_.colors.size() ? obj_.colors[c.v] : Vec3(1));
  }

  // Appends the face's triangles as indices of corners.
  void cut_face(const Face& face) {
    polygon_.clear(), cuts_.clear();
    for (size_t c = face.first; c < face.first + face.count; ++c) polygon_.push_back(obj_.corners[c].v);
    dropped_ += !triangulator_.cut(polygon_, obj_.v, cuts_);
    auto corner = [&](uint32_t i) { return uint32_t(face.first) + i; };
    for (auto cut : cuts_) triangles_.push_back({corner(cut[0]), corner(cut[1]), corner(cut[2])});
  }

  const ObjFile& obj_;
  Scene& scene_;
  bool has_texcoords_;
  size_t dropped_ = 0;
  Triangulator triangulator_;
  std::vector<std::array<uint32_t, 3>> triangles_, cuts_;  // of indices into ObjFile::corners; into polygon_
  std::vector<uint32_t> polygon_;                          // positions of a face
  std::vector<Corner> corners_;
};

}  // namespace

Result<Scene> load_obj(std::span<const uint8_t> bytes, const std::string& path, const std::string& folder) {
  ObjFile obj;
  obj.path = path;
  ObjParser parser(obj);
  LineReader lines(bytes);
  std::string_view text;
  while (lines.next(text)) {
    std::string reason = parser.parse_line(text, lines.number());
    if (!reason.empty()) return Error{fmt::format("{}:{}", path, lines.number()), reason};
  }
  if (auto checked = check_references(obj); !checked) return checked.error();
  if (!obj.colors.empty()) obj.colors.resize(obj.v.size(), Vec3(1));

  Scene scene;
  scene.path = path;
  size_t dropped = ObjAssembler(obj, scene).assemble();
  if (dropped > 0) scene.warnings.push_back(fmt::format("{}: {} faces with repeated corners dropped", path, dropped));
  std::vector<std::string> names;
  for (const auto& group : obj.groups) names.push_back(group.second);
  Vec3 fallback = obj.colors.empty() ? Vec3(default_albedo) : Vec3(1);
  auto numbers = load_materials(scene, obj.libraries, names, fallback, folder);
  if (!numbers) return numbers.error();
  for (Part& part : scene.parts) part.material = (*numbers)[part.material];
  if (auto finished = finish_mesh(scene); !finished) return finished.error();
  return scene;
}

}  // namespace lambent
