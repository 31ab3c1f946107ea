#pragma once
// Small meshes and checks that several tests and the fuzz targets use.
#include <lambent/core/file.h>
#include <lambent/scene/scene.h>

#include <cstdlib>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <tuple>

namespace lambent::test {

// Folder of the large test data, or empty where it is absent.
inline std::string data_folder() {
  const char* set = std::getenv("LAMBENT_DATA");
  auto root = std::filesystem::path(__FILE__).parent_path().parent_path();
  auto folder = set ? std::filesystem::path(set) : root / ".." / "shared" / "data";
  std::error_code ignored;
  return std::filesystem::is_directory(folder, ignored) ? folder.string() : std::string();
}

inline std::span<const uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

// What is wrong with the scene's arrays and runs; empty if nothing is.
inline std::string broken_invariant(const Scene& s) {
  size_t n = s.positions.size(), vertex = 0, triangle = 0;
  if (s.normals.size() != n) return "normals";
  for (const auto& uv : s.texcoords)
    if (!uv.empty() && uv.size() != n) return "texcoords";
  if (!s.colors.empty() && s.colors.size() != n) return "colors";
  if (s.materials.empty()) return "no material";
  for (size_t p = 0; p < s.parts.size(); ++p) {
    const Part& part = s.parts[p];
    if (part.first_vertex != vertex || part.first_triangle != triangle) return "runs have gaps";
    vertex += part.vertex_count, triangle += part.triangle_count;
    if (vertex > n || triangle > s.triangles.size()) return "runs are too long";
    if (part.material >= s.materials.size()) return "material number";
    if (!part.source.empty() && part.source.size() != part.vertex_count) return "source map";
    for (size_t t = part.first_triangle; t < triangle; ++t) {
      if (s.triangles[t].part != p) return "triangle's part";
      for (uint32_t v : s.triangles[t].v)
        if (v < part.first_vertex || v >= vertex) return "vertex of another part";
    }
  }
  if (vertex != n || triangle != s.triangles.size()) return "runs do not cover the scene";
  constexpr float unit_error = 1e-5f;  // a few float roundings
  for (size_t v = 0; v < n; ++v) {
    if (!is_finite(s.positions[v])) return "position not finite";
    if (!(std::abs(length(s.normals[v]) - 1) < unit_error)) return "normal not unit";
  }
  return {};
}

inline double total_area(const Scene& s) {
  double area = 0;
  for (const Triangle& t : s.triangles) {
    Vec3d a = s.positions[t.v[0]], b = s.positions[t.v[1]], c = s.positions[t.v[2]];
    area += 0.5 * length(cross(b - a, c - a));
  }
  return area;
}

// Directed edges, by exact position, that have no partner in the other direction.
inline size_t unmatched_edges(const Scene& s) {
  using Place = std::tuple<float, float, float>;
  auto place = [&](uint32_t v) { return Place(s.positions[v].x, s.positions[v].y, s.positions[v].z); };
  std::map<std::pair<Place, Place>, int> balance;
  for (const Triangle& t : s.triangles) {
    for (int k = 0; k < 3; ++k) {
      Place a = place(t.v[k]), b = place(t.v[(k + 1) % 3]);
      balance[std::minmax(a, b)] += a < b ? 1 : -1;
    }
  }
  size_t unmatched = 0;
  for (const auto& [edge, sum] : balance) unmatched += sum != 0;
  return unmatched;
}

inline size_t two_sided_count(const Scene& s) {
  size_t count = 0;
  for (const Triangle& t : s.triangles) count += t.two_sided;
  return count;
}

// A cube of side 2 about the origin as eight shared vertices and outward triangles, without normals.
inline Scene bare_cube() {
  Scene s;
  for (int i = 0; i < 8; ++i) s.positions.push_back(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
  const uint32_t quads[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& q : quads) {
    s.triangles.push_back({{q[0], q[1], q[2]}, 0, false});
    s.triangles.push_back({{q[0], q[2], q[3]}, 0, false});
  }
  s.normals.assign(8, Vec3(0));
  s.materials.resize(1);
  Part part;
  part.vertex_count = 8, part.triangle_count = 12;
  s.parts.push_back(part);
  return s;
}

// Appends the parts of `b` to `a` (positions, normals and triangles alone).
inline void append(Scene& a, const Scene& b) {
  uint32_t v = uint32_t(a.positions.size()), t = uint32_t(a.triangles.size()), p = uint32_t(a.parts.size());
  a.positions.insert(a.positions.end(), b.positions.begin(), b.positions.end());
  a.normals.insert(a.normals.end(), b.normals.begin(), b.normals.end());
  for (Triangle triangle : b.triangles) {
    for (uint32_t& corner : triangle.v) corner += v;
    triangle.part += p;
    a.triangles.push_back(triangle);
  }
  for (Part part : b.parts) {
    part.first_vertex += v, part.first_triangle += t;
    a.parts.push_back(part);
  }
}

}  // namespace lambent::test
