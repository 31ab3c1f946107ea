// The PLY polygon file format (Turk 1994), with the property names that scanners and modellers have added since.
#include <lambent/scene/mesh_file.h>
#include <lambent/scene/mesh_text.h>
#include <lambent/scene/ply_file.h>
#include <lambent/scene/ply_header.h>

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>

namespace lambent {
namespace {

using namespace ply;

// The values after the header, in any of the three formats.
class ValueReader {
 public:
  ValueReader(std::string_view data, Format format, size_t line)
      : rest_(data),
        format_(format),
        swaps_((format == Format::big_endian) != (std::endian::native == std::endian::big)),
        line_(line) {}

  // False at the end of the file or, in text, at something that is not a number.
  bool read(Type type, double& value) {
    if (format_ == Format::ascii) return read_text(value);
    size_t size = type_size[size_t(type)];
    if (rest_.size() < size) return false;
    value = number_at(type, rest_.data());
    rest_.remove_prefix(size);
    return true;
  }

  // Bytes of a run of binary values, taken; null if they are not there.
  const char* take(size_t bytes) {
    if (rest_.size() < bytes) return nullptr;
    const char* at = rest_.data();
    rest_.remove_prefix(bytes);
    return at;
  }
  bool is_text() const { return format_ == Format::ascii; }
  size_t left() const { return rest_.size(); }

  // A binary value as a number, which is exact.
  double number_at(Type type, const char* at) const {
    double value = 0;
    with_type(type, [&]<class T>(T) { value = double(typed_at<T>(at)); });
    return value;
  }
  template <class T>
  T typed_at(const char* at) const {
    char bytes[sizeof(T)];
    std::memcpy(bytes, at, sizeof(T));
    if (swaps_) std::reverse(bytes, bytes + sizeof(T));
    return std::bit_cast<T>(bytes);
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
  bool swaps_;
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
                                                         {"r", red},
                                                         {"g", green},
                                                         {"b", blue},
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

  // How a vertex's numbers become colours: integers are sRGB-encoded shares of the type's range, floats are linear.
  struct ColorRule {
    double scale = 1;
    bool encoded = false;
    std::vector<float> bytes;  // linear values of the 256 bytes

    // Texts may say anything of a byte.
    static uint8_t byte_of(double v) { return uint8_t(std::fmin(std::fmax(v, 0.0), 255.0)); }
    float linear(float share) const { return encoded ? srgb_to_linear(share) : share; }
    Vec3 operator()(double r, double g, double b) const {
      if (!bytes.empty()) return {bytes[byte_of(r)], bytes[byte_of(g)], bytes[byte_of(b)]};
      Vec3 c = clamp_color(r * scale, g * scale, b * scale);
      return {linear(c.x), linear(c.y), linear(c.z)};
    }
  };

  // `found`: bits of the roles that the element has.
  std::vector<Role> vertex_roles(const Element& e, unsigned& found, ColorRule& color) const {
    std::vector<Role> roles;
    bool all_bytes = true;
    found = 0;
    for (const Property& p : e.properties) {
      Role role = p.is_list ? other : role_from_name(p.name);
      roles.push_back(role), found |= 1u << role;
      if (role == red || role == green || role == blue) all_bytes = all_bytes && p.type == Type::u8;
      if (role != red) continue;
      color.encoded = !is_float(p.type);
      color.scale = p.type == Type::u16 ? 1.0 / 65535 : color.encoded ? 1.0 / 255 : 1;
    }
    if (color.encoded && all_bytes)
      for (int i = 0; i < 256; ++i) color.bytes.push_back(color.linear(clamp_color(i * color.scale, 0, 0).x));
    return roles;
  }

  // One vertex's values by their roles.
  bool read_row(const Element& e, const std::vector<Role>& roles, double (&values)[role_count]) {
    for (size_t p = 0; p < roles.size(); ++p) {
      const Property& property = e.properties[p];
      if (!(property.is_list ? skip_list(property) : reader_.read(property.type, values[roles[p]]))) return false;
    }
    return true;
  }

  Result<void> read_vertices(const Element& e) {
    unsigned found;
    ColorRule color;
    const std::vector<Role> roles = vertex_roles(e, found, color);
    auto has = [&](Role a, int count) { return ((found >> a) & ((1u << count) - 1)) == (1u << count) - 1; };
    if (!has(x, 3)) return Error{at(e), "vertices have no x, y and z"};
    const bool has_normals = has(nx, 3), has_texcoords = has(tex_u, 2), has_colors = has(red, 3);
    mesh_.has_vertices = true;
    if (!reader_.is_text() && e.row_size > 0)
      return read_columns(e, roles, color, has_normals, has_texcoords, has_colors);
    mesh_.positions.reserve(e.count);
    if (has_normals) mesh_.normals.reserve(e.count);
    if (has_texcoords) mesh_.texcoords.reserve(e.count);
    if (has_colors) mesh_.colors.reserve(e.count);
    for (uint64_t i = 0; i < e.count; ++i) {
      double values[role_count];
      if (!read_row(e, roles, values)) return ended(e, i);
      Vec3d position(values[x], values[y], values[z]);
      mesh_.positions.push_back(is_position(position) ? position : broken_position);
      if (has_normals) mesh_.normals.push_back(Vec3(values[nx], values[ny], values[nz]));
      if (has_texcoords) mesh_.texcoords.push_back(texcoord_from_below(values[tex_u], values[tex_v]));
      if (has_colors) mesh_.colors.push_back(color(values[red], values[green], values[blue]));
    }
    return {};
  }

  // The same of binary rows without lists, value by value of one property after the other, so that nothing is asked a
  // value. That they are there is known.
  Result<void> read_columns(const Element& e, const std::vector<Role>& roles, const ColorRule& color, bool has_normals,
                            bool has_texcoords, bool has_colors) {
    const char* first = reader_.take(e.count * e.row_size);
    if (!first) return ended(e, 0);
    std::vector<Vec2d> texcoords(has_texcoords ? e.count : 0);
    mesh_.positions.resize(e.count);
    if (has_normals) mesh_.normals.resize(e.count);
    if (has_colors) mesh_.colors.resize(e.count);
    for (size_t p = 0; p < roles.size(); first += type_size[size_t(e.properties[p].type)], ++p) {
      const Role role = roles[p];
      auto into = [&](auto& values, Role from) {
        with_type(e.properties[p].type, [&]<class T>(T) {
          const char* at = first;
          for (auto& value : values) {
            value[size_t(role - from)] = std::remove_reference_t<decltype(value[0])>(reader_.template typed_at<T>(at));
            at += e.row_size;
          }
        });
      };
      if (role <= z) into(mesh_.positions, x);
      else if (role <= nz) into(mesh_.normals, nx);
      else if (role <= blue) into(mesh_.colors, red);
      else if (role <= tex_v) into(texcoords, tex_u);
    }
    for (Vec3d& position : mesh_.positions)
      if (!is_position(position)) position = broken_position;
    for (Vec3& c : mesh_.colors) c = color(double(c.x), double(c.y), double(c.z));
    mesh_.texcoords.reserve(texcoords.size());
    for (Vec2d uv : texcoords) mesh_.texcoords.push_back(texcoord_from_below(uv.x, uv.y));
    return {};
  }

  // What a face property is for.
  enum class FaceRole : uint8_t { other, corners, texcoords, texture };

  Result<std::vector<FaceRole>> face_roles(const Element& e) const {
    std::vector<FaceRole> roles;
    bool has_corners = false;
    for (const Property& p : e.properties) {
      FaceRole role = FaceRole::other;
      if ((p.name == "vertex_indices" || p.name == "vertex_index") && p.is_list && !is_float(p.type) && !has_corners)
        role = FaceRole::corners, has_corners = true;
      if (p.name == "texcoord" && p.is_list) role = FaceRole::texcoords;
      if (p.name == "texnumber" && !p.is_list) role = FaceRole::texture;
      roles.push_back(role);
    }
    if (!has_corners) return Error{at(e), "faces have no list vertex_indices of whole numbers"};
    return roles;
  }

  Result<void> read_faces(const Element& e) {
    auto roles = face_roles(e);
    if (!roles) return roles.error();
    mesh_.has_faces = true;
    mesh_.corner_counts.reserve(e.count);
    mesh_.corners.reserve(std::min<uint64_t>(3 * e.count, max_corners));
    if (!reader_.is_text() && e.properties.size() == 1) return read_plain_faces(e);
    auto has = [&](FaceRole role) { return std::find(roles->begin(), roles->end(), role) != roles->end(); };
    const bool has_texcoords = has(FaceRole::texcoords), has_texture = has(FaceRole::texture);
    std::vector<double> uv;
    for (uint64_t i = 0; i < e.count; ++i) {
      double texture = 0;
      uv.clear();
      for (size_t p = 0; p < roles->size(); ++p) {
        const Property& property = e.properties[p];
        bool ok = true;
        switch ((*roles)[p]) {
          case FaceRole::corners:
            if (auto done = read_corners(e, property, i); !done) return done;
            break;
          case FaceRole::texcoords: ok = read_list(property, uv); break;
          case FaceRole::texture: ok = reader_.read(property.type, texture); break;
          case FaceRole::other: ok = property.is_list ? skip_list(property) : reader_.read(property.type, texture);
        }
        if (!ok) return ended(e, i);
      }
      if (has_texture) mesh_.face_textures.push_back(texture >= 0 && texture < double(none) ? uint32_t(texture) : none);
      if (has_texcoords) add_corner_texcoords(uv);
    }
    return {};
  }

  Result<void> read_corners(const Element& e, const Property& list, uint64_t face) {
    uint64_t count;
    if (!read_count(list, count)) return ended(e, face);
    if (count > max_corners - mesh_.corners.size()) return Error{reader_.where(path_), "too many face corners"};
    mesh_.corner_counts.push_back(uint32_t(count));
    if (reader_.is_text()) {
      double value;
      while (count-- > 0) {
        if (!reader_.read(list.type, value)) return ended(e, face);
        if (!(value >= 0 && value < double(vertex_count_)) || value != std::floor(value))
          return wrong_corner(face, value);
        mesh_.corners.push_back(uint32_t(value));
      }
      return {};
    }
    const char* values = reader_.take(count * type_size[size_t(list.type)]);
    double value = 0;
    bool ok = true;
    with_type(list.type, [&]<class T>(T) { ok = add_corners<T>(values, count, value); });
    return ok ? Result<void>() : wrong_corner(face, value);
  }

  Error wrong_corner(uint64_t face, double value) const {
    return {reader_.where(path_), fmt::format("face {} names vertex {} of {}", face, value, vertex_count_)};
  }

  // Appends binary corners; false, and the first number that is no vertex, where there is one.
  template <class T>
  bool add_corners(const char* values, uint64_t count, double& bad) {
    for (uint64_t k = 0; k < count; ++k) {
      const T value = reader_.template typed_at<T>(values + k * sizeof(T));
      if (!(value >= 0 && double(value) < double(vertex_count_))) return bad = double(value), false;
      mesh_.corners.push_back(uint32_t(value));
    }
    return true;
  }

  // Binary faces that are lists of corners and nothing else, which most are.
  Result<void> read_plain_faces(const Element& e) {
    const Property& list = e.properties[0];
    Result<void> done;
    with_type(list.type, [&]<class T>(T) {
      for (uint64_t face = read_plain_triangles<T>(e, list); face < e.count; ++face) {
        uint64_t count;
        if (!read_count(list, count)) {
          done = ended(e, face);
          return;
        }
        if (count > max_corners - mesh_.corners.size()) {
          done = Error{path_, "too many face corners"};
          return;
        }
        mesh_.corner_counts.push_back(uint32_t(count));
        double bad;
        if (add_corners<T>(reader_.take(count * sizeof(T)), count, bad)) continue;
        done = wrong_corner(face, bad);
        return;
      }
    });
    return done;
  }

  // The triangles that such faces begin with, where their counts are bytes; the first face that is none, or is broken,
  // is left to be read. Returns how many there were.
  template <class T>
  uint64_t read_plain_triangles(const Element& e, const Property& list) {
    constexpr size_t size = 1 + 3 * sizeof(T);
    if (type_size[size_t(list.count_type)] != 1) return 0;
    const uint64_t most = std::min<uint64_t>({e.count, reader_.left() / size, max_corners / 3});
    const char* at = reader_.take(0);
    mesh_.corners.resize(3 * most);
    uint32_t* out = mesh_.corners.data();
    uint64_t face = 0;
    for (; face < most && *at == 3; ++face, at += size, out += 3) {
      bool known = true;
      for (size_t k = 0; k < 3; ++k) {
        const T value = reader_.template typed_at<T>(at + 1 + k * sizeof(T));
        known &= value >= 0 && uint64_t(value) < vertex_count_;
        out[k] = uint32_t(value);
      }
      if (!known) break;
    }
    reader_.take(face * size);
    mesh_.corners.resize(3 * face);
    mesh_.corner_counts.assign(face, 3);
    return face;
  }

  bool read_list(const Property& list, std::vector<double>& values) {
    uint64_t count;
    double value;
    if (!read_count(list, count)) return false;
    while (count-- > 0) {
      if (!reader_.read(list.type, value)) return false;
      values.push_back(value);
    }
    return true;
  }

  void add_corner_texcoords(const std::vector<double>& uv) {
    const size_t corners = mesh_.corner_counts.back();
    const bool fits = uv.size() == 2 * corners;
    mesh_.odd_texcoords += !fits;
    for (size_t k = 0; k < corners; ++k)
      mesh_.corner_texcoords.push_back(fits ? texcoord_from_below(uv[2 * k], uv[2 * k + 1]) : Vec2(0));
  }

  const std::string& path_;
  const Header& header_;
  ValueReader reader_;
  uint64_t vertex_count_ = 0;
  PlyMesh mesh_;
};

}  // namespace

Result<PlyMesh> read_ply(std::span<const uint8_t> bytes, const std::string& path) {
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  auto header = ply::parse_header(text, path);
  if (!header) return header.error();
  auto mesh = PlyBody(path, *header, text.substr(header->size)).read();
  if (mesh) mesh->textures = std::move(header->textures);
  return mesh;
}

}  // namespace lambent
