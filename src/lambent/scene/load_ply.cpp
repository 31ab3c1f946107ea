// The PLY polygon file format (Turk 1994), with the property names that scanners and modellers have added since.
#include <lambent/scene/load.h>
#include <lambent/scene/mesh_file.h>
#include <lambent/scene/mesh_text.h>

#include <fmt/format.h>

#include <bit>
#include <charconv>
#include <cstring>

namespace lambent {
namespace {

enum class Type : uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };
constexpr size_t type_size[] = {1, 1, 2, 2, 4, 4, 4, 8};
bool is_float(Type t) { return t == Type::f32 || t == Type::f64; }

bool type_from_name(std::string_view name, Type& type) {
  constexpr std::string_view names[][2] = {{"char", "int8"},     {"uchar", "uint8"},   {"short", "int16"},
                                           {"ushort", "uint16"}, {"int", "int32"},     {"uint", "uint32"},
                                           {"float", "float32"}, {"double", "float64"}};
  for (size_t i = 0; i < std::size(names); ++i)
    if (name == names[i][0] || name == names[i][1]) return type = Type(i), true;
  return false;
}

struct Property {
  std::string name;
  Type type{};
  bool is_list = false;
  Type count_type{};
};

struct Element {
  std::string name;
  uint64_t count = 0;
  size_t line = 0;
  std::vector<Property> properties;
};

enum class Format { ascii, little_endian, big_endian };

struct Header {
  Format format{};
  std::vector<Element> elements;
  size_t size = 0;  // bytes
  size_t lines = 0;
};

Result<Header> parse_header(std::string_view text, const std::string& path) {
  Header header;
  auto wrong = [&](std::string message) { return Error{fmt::format("{}:{}", path, header.lines), std::move(message)}; };
  bool has_format = false;
  // Lines end in LF, CR LF or, if the first one does, in CR.
  char separator = '\n';
  if (text.starts_with("ply\r") && !text.starts_with("ply\r\n")) separator = '\r';
  while (true) {
    ++header.lines;
    size_t end = text.find(separator, header.size);
    std::string_view line = text.substr(header.size, end == text.npos ? end : end - header.size), rest = line;
    std::string_view keyword = take_word(rest);
    if (header.lines == 1) {
      if (trimmed(line) != "ply") return wrong("is not a PLY file");
    } else if (keyword == "format") {
      std::string_view name = take_word(rest), version = take_word(rest);
      if (name != "ascii" && name != "binary_little_endian" && name != "binary_big_endian")
        return wrong("unknown format");
      if (version != "1.0") return wrong("version is not 1.0");
      header.format = name == "ascii"                ? Format::ascii
                    : name == "binary_little_endian" ? Format::little_endian
                                                     : Format::big_endian;
      has_format = true;
    } else if (keyword == "element") {
      Element element;
      element.name = std::string(take_word(rest)), element.line = header.lines;
      std::string_view count = take_word(rest);
      auto [stop, code] = std::from_chars(count.data(), count.data() + count.size(), element.count);
      if (code != std::errc() || stop != count.data() + count.size())
        return wrong("element count is not a whole number");
      for (const Element& e : header.elements)
        if (e.name == element.name) return wrong(fmt::format("element {} comes twice", short_name(e.name)));
      header.elements.push_back(std::move(element));
    } else if (keyword == "property") {
      if (header.elements.empty()) return wrong("property before the first element");
      Property property;
      std::string_view word = take_word(rest);
      property.is_list = word == "list";
      if (property.is_list) {
        if (!type_from_name(take_word(rest), property.count_type)) return wrong("unknown type of a list's count");
        if (is_float(property.count_type)) return wrong("a list's count must be of a whole-number type");
        word = take_word(rest);
      }
      if (!type_from_name(word, property.type)) return wrong("unknown property type");
      property.name = std::string(take_word(rest));
      if (property.name.empty()) return wrong("property has no name");
      header.elements.back().properties.push_back(std::move(property));
    } else if (keyword != "comment" && keyword != "obj_info" && keyword != "end_header" && !trimmed(line).empty()) {
      return wrong("unknown header line");
    }
    if (end == text.npos && keyword != "end_header") return wrong("the header does not end");
    header.size = end == text.npos ? text.size() : end + 1;
    if (keyword == "end_header") break;
  }
  if (!has_format) return wrong("the header names no format");
  return header;
}

// The values after the header, in any of the three formats.
class ValueReader {
 public:
  ValueReader(std::string_view data, Format format, size_t line) : rest_(data), format_(format), line_(line) {}

  // False at the end of the file or, in text, at something that is not a number.
  bool read(Type type, double& value) {
    if (format_ == Format::ascii) return read_text(value);
    uint8_t bytes[8];
    size_t size = type_size[size_t(type)];
    if (rest_.size() < size) return false;
    std::memcpy(bytes, rest_.data(), size);
    rest_.remove_prefix(size);
    if ((format_ == Format::big_endian) != (std::endian::native == std::endian::big)) std::reverse(bytes, bytes + size);
    auto as = [&]<class T>(T typed) {
      std::memcpy(&typed, bytes, sizeof(T));
      value = double(typed);
    };
    switch (type) {
      case Type::i8: as(int8_t{}); break;
      case Type::u8: as(uint8_t{}); break;
      case Type::i16: as(int16_t{}); break;
      case Type::u16: as(uint16_t{}); break;
      case Type::i32: as(int32_t{}); break;
      case Type::u32: as(uint32_t{}); break;
      case Type::f32: as(float{}); break;
      case Type::f64: as(double{}); break;
    }
    return true;
  }

  // Whether `count` values of these sizes can be there at all; in text each takes a digit and a blank.
  bool can_hold(uint64_t count, size_t values, size_t bytes) const {
    if (format_ == Format::ascii) return values == 0 || count <= (rest_.size() + 1) / (2 * values);
    return bytes == 0 || count <= rest_.size() / bytes;
  }
  bool can_hold_list(uint64_t count, Type type) const { return can_hold(count, 1, type_size[size_t(type)]); }

  // "path:line" in text, else the path.
  std::string where(const std::string& path) const {
    return format_ == Format::ascii ? fmt::format("{}:{}", path, line_) : path;
  }

 private:
  bool read_text(double& value) {
    while (!rest_.empty() && (is_blank(rest_[0]) || rest_[0] == '\n')) {
      // A lone CR ends a line as well.
      line_ += rest_[0] == '\n' || (rest_[0] == '\r' && (rest_.size() < 2 || rest_[1] != '\n'));
      rest_.remove_prefix(1);
    }
    return take_number(rest_, value) && (rest_.empty() || is_blank(rest_[0]) || rest_[0] == '\n');
  }

  std::string_view rest_;
  Format format_;
  size_t line_;
};

// What a vertex property is for; `other` is read past.
enum Role : uint8_t { x, y, z, nx, ny, nz, red, green, blue, tex_u, tex_v, other, role_count };

Role role_from_name(std::string_view name) {
  constexpr std::pair<std::string_view, Role> names[] = {{"x", x},
                                                         {"y", y},
                                                         {"z", z},
                                                         {"nx", nx},
                                                         {"ny", ny},
                                                         {"nz", nz},
                                                         {"red", red},
                                                         {"green", green},
                                                         {"blue", blue},
                                                         {"diffuse_red", red},
                                                         {"s", tex_u},
                                                         {"t", tex_v},
                                                         {"u", tex_u},
                                                         {"v", tex_v},
                                                         {"diffuse_green", green},
                                                         {"texture_u", tex_u},
                                                         {"texture_v", tex_v},
                                                         {"texture_s", tex_u},
                                                         {"texture_t", tex_v},
                                                         {"diffuse_blue", blue}};
  for (auto [known, role] : names)
    if (name == known) return role;
  return other;
}

struct PlyMesh {
  bool has_vertices = false, has_faces = false;
  std::vector<Vec3> positions, normals, colors;  // the latter two may be empty
  std::vector<Vec2> texcoords;                   // may be empty
  std::vector<uint32_t> corners;                 // of all polygons, one after the other
  std::vector<uint32_t> corner_counts;           // a polygon
};

class PlyBody {
 public:
  PlyBody(const std::string& path, const Header& header, std::string_view data)
      : path_(path), header_(header), reader_(data, header.format, header.lines + 1) {}

  Result<PlyMesh> read() {
    for (const Element& e : header_.elements) {
      if (e.name == "tristrips") return Error{at(e), "triangle strips are not supported, faces are"};
      if (e.name == "vertex") vertex_count_ = e.count;
    }
    for (const Element& e : header_.elements) {
      size_t bytes = 0;
      for (const Property& p : e.properties) bytes += type_size[size_t(p.is_list ? p.count_type : p.type)];
      if (e.count >= none || !reader_.can_hold(e.count, e.properties.size(), bytes))
        return Error{at(e), fmt::format("the file is too short for {} {} elements", e.count, short_name(e.name))};
      Result<void> done = e.name == "vertex" ? read_vertices(e) : e.name == "face" ? read_faces(e) : skip(e);
      if (!done) return done.error();
    }
    if (!mesh_.has_vertices) return Error{path_, "no vertex positions"};
    if (!mesh_.has_faces) return Error{path_, "no triangles"};
    return std::move(mesh_);
  }

 private:
  std::string at(const Element& e) const { return fmt::format("{}:{}", path_, e.line); }
  Error ended(const Element& e, uint64_t index) const {
    const char* what = header_.format == Format::ascii ? "ends or holds something that is not a number" : "ends";
    return {reader_.where(path_), fmt::format("the file {} in {} {}", what, short_name(e.name), index)};
  }

  // Reads a list's count and checks it against the bytes that are left.
  bool read_count(const Property& list, uint64_t& count) {
    double value;
    if (!reader_.read(list.count_type, value)) return false;
    if (!(value >= 0 && value < double(none)) || value != std::floor(value)) return false;
    count = uint64_t(value);
    return reader_.can_hold_list(count, list.type);
  }

  bool skip_list(const Property& list) {
    uint64_t count;
    double value;
    if (!read_count(list, count)) return false;
    while (count-- > 0)
      if (!reader_.read(list.type, value)) return false;
    return true;
  }

  Result<void> skip(const Element& e) {
    if (e.properties.empty()) return {};
    double value;
    for (uint64_t i = 0; i < e.count; ++i)
      for (const Property& p : e.properties)
        if (!(p.is_list ? skip_list(p) : reader_.read(p.type, value))) return ended(e, i);
    return {};
  }

  Result<void> read_vertices(const Element& e) {
    std::vector<Role> roles;
    unsigned found = 0;
    double color_scale = 1;
    bool encoded = false;
    for (const Property& p : e.properties) {
      roles.push_back(p.is_list ? other : role_from_name(p.name));
      found |= 1u << roles.back();
      if (roles.back() != red) continue;
      encoded = !is_float(p.type);
      color_scale = p.type == Type::u16 ? 1.0 / 65535 : encoded ? 1.0 / 255 : 1;
    }
    auto has = [&](Role a, int count) { return ((found >> a) & ((1u << count) - 1)) == (1u << count) - 1; };
    if (!has(x, 3)) return Error{at(e), "vertices have no x, y and z"};
    mesh_.has_vertices = true;
    mesh_.positions.reserve(e.count);
    for (uint64_t i = 0; i < e.count; ++i) {
      double values[role_count];
      for (size_t p = 0; p < roles.size(); ++p) {
        const Property& property = e.properties[p];
        if (!(property.is_list ? skip_list(property) : reader_.read(property.type, values[roles[p]])))
          return ended(e, i);
      }
      Vec3 position(values[x], values[y], values[z]);
      if (!is_position(position)) {
        return Error{reader_.where(path_), fmt::format("coordinate of vertex {} is not finite or beyond 1e9", i)};
      }
      mesh_.positions.push_back(position);
      if (has(nx, 3)) mesh_.normals.push_back(Vec3(values[nx], values[ny], values[nz]));
      if (has(tex_u, 2)) mesh_.texcoords.push_back(texcoord_from_below(values[tex_u], values[tex_v]));
      if (has(red, 3)) {
        Vec3 c = clamp_color(values[red] * color_scale, values[green] * color_scale, values[blue] * color_scale);
        if (encoded) c = {srgb_to_linear(c.x), srgb_to_linear(c.y), srgb_to_linear(c.z)};
        mesh_.colors.push_back(c);
      }
    }
    return {};
  }

  Result<void> read_faces(const Element& e) {
    size_t list = e.properties.size();
    for (size_t p = 0; p < e.properties.size(); ++p)
      if (e.properties[p].name == "vertex_indices" || e.properties[p].name == "vertex_index") list = p;
    if (list == e.properties.size() || !e.properties[list].is_list || is_float(e.properties[list].type))
      return Error{at(e), "faces have no list vertex_indices of whole numbers"};
    mesh_.has_faces = true;
    mesh_.corner_counts.reserve(e.count);
    for (uint64_t i = 0; i < e.count; ++i) {
      double value;
      for (size_t p = 0; p < e.properties.size(); ++p) {
        const Property& property = e.properties[p];
        if (p != list) {
          if (!(property.is_list ? skip_list(property) : reader_.read(property.type, value))) return ended(e, i);
          continue;
        }
        uint64_t count;
        if (!read_count(property, count)) return ended(e, i);
        if (count > max_corners - mesh_.corners.size()) return Error{reader_.where(path_), "too many face corners"};
        mesh_.corner_counts.push_back(uint32_t(count));
        while (count-- > 0) {
          if (!reader_.read(property.type, value)) return ended(e, i);
          if (!(value >= 0 && value < double(vertex_count_)) || value != std::floor(value))
            return Error{reader_.where(path_), fmt::format("face {} names vertex {} of {}", i, value, vertex_count_)};
          mesh_.corners.push_back(uint32_t(value));
        }
      }
    }
    return {};
  }

  const std::string& path_;
  const Header& header_;
  ValueReader reader_;
  uint64_t vertex_count_ = 0;
  PlyMesh mesh_;
};

// Appends the polygons' triangles; returns how many polygons had fewer than three corners.
size_t add_triangles(const PlyMesh& mesh, Scene& scene) {
  Triangulator triangulator;
  std::vector<std::array<uint32_t, 3>> cuts;
  size_t first = 0, dropped = 0;
  for (uint32_t count : mesh.corner_counts) {
    const uint32_t* polygon = mesh.corners.data() + first;
    cuts.clear();
    dropped += !triangulator.cut({polygon, count}, mesh.positions, cuts);
    for (auto cut : cuts) scene.triangles.push_back({{polygon[cut[0]], polygon[cut[1]], polygon[cut[2]]}, 0, true});
    first += count;
  }
  return dropped;
}

}  // namespace

Result<Scene> load_ply(std::span<const uint8_t> bytes, const std::string& path) {
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  auto header = parse_header(text, path);
  if (!header) return header.error();
  auto mesh = PlyBody(path, *header, text.substr(header->size)).read();
  if (!mesh) return mesh.error();

  Scene scene;
  scene.path = path;
  size_t dropped = add_triangles(*mesh, scene);
  if (dropped > 0) scene.warnings.push_back(fmt::format("{}: {} faces with repeated corners dropped", path, dropped));
  scene.positions = std::move(mesh->positions);
  scene.normals = std::move(mesh->normals);
  scene.normals.resize(scene.positions.size(), Vec3(0));
  scene.texcoords[0] = std::move(mesh->texcoords);
  scene.colors = std::move(mesh->colors);
  Material material;
  material.name = "default", material.metallic = 0;
  material.base_color = scene.colors.empty() ? Vec3(default_albedo) : Vec3(1);
  scene.materials.push_back(material);
  Part part;
  part.name = file_stem(path);
  part.vertex_count = uint32_t(scene.positions.size()), part.triangle_count = uint32_t(scene.triangles.size());
  scene.parts.push_back(part);
  if (auto finished = finish_mesh(scene); !finished) return finished.error();
  return scene;
}

}  // namespace lambent
