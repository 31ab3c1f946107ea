#pragma once
// What the loaders share; all but the limits, OBJ's and PLY's.
#include <lambent/scene/scene.h>

#include <array>
#include <span>

namespace lambent {

// Coordinates beyond this (metres) are refused: cross products of edges and their squares stay finite in floats below
// it.
inline constexpr float max_coordinate = 1e9f;

// Face corners of one file; keeps every index that cleaning may create within 32 bits.
inline constexpr size_t max_corners = size_t{1} << 30;

// Albedo of surfaces that no file gives one.
inline constexpr float default_albedo = 0.8f;

inline bool is_position(Vec3d p) {
  return std::abs(p.x) <= max_coordinate && std::abs(p.y) <= max_coordinate &&
         std::abs(p.z) <= max_coordinate;  // not NaN either
}

// Stands for a position that is none; depth cameras and scanners write them, mostly for vertices that no face uses.
inline constexpr Vec3d broken_position{NAN};
inline bool is_broken(Vec3 p) { return std::isnan(p.x); }

// Zero; or, of a box so far from 0 that floats would lose its shape (surveyed coordinates), a point near its centre
// that few digits write and floats hold. Exact zero too for boxes that are empty.
Vec3d far_origin(Vec3d low, Vec3d high);

// A file's positions as a scene has them, about its origin, which is chosen by those that the corners use. `vertex`
// gives the position's number for each corner from 0.
template <class Vertex>
std::vector<Vec3> place_positions(Scene& scene, std::span<const Vec3d> file, size_t corners, Vertex vertex) {
  std::vector<uint8_t> used(file.size(), 0);
  for (size_t c = 0; c < corners; ++c) used[vertex(c)] = 1;
  Vec3d low(INFINITY), high(-INFINITY);
  for (size_t v = 0; v < file.size(); ++v)
    if (used[v]) low = min(low, file[v]), high = max(high, file[v]);  // NaN compares as not less
  scene.origin = far_origin(low, high);
  std::vector<Vec3> positions(file.size());
  for (size_t v = 0; v < file.size(); ++v) positions[v] = Vec3(file[v] - scene.origin);
  return positions;
}

// What of a file's faces is no geometry.
struct LeftOut {
  size_t repeated = 0;  // fewer than three corners that differ
  size_t broken = 0;    // a corner at a broken position
};
// Says so in the scene's warnings. Error: no face is left.
Result<void> tell_left_out(Scene& scene, LeftOut left_out);

// A mesh whose faces name positions, texture coordinates and normals apart.
struct MeshCorner {
  uint32_t v, vt = none, vn = none;
  auto operator<=>(const MeshCorner&) const = default;
};
struct MeshFace {
  size_t first, count;  // in CornerMesh::corners
  uint32_t group;
  size_t line;
};
struct CornerMesh {
  std::vector<Vec3d> v;          // in the file's space, broken_position included
  std::vector<Vec3> colors, vn;  // colors: empty, or as many as v
  std::vector<Vec2> vt;
  std::vector<MeshCorner> corners;
  std::vector<MeshFace> faces;
  std::vector<std::string> groups;  // the name of each, "" for the file's own
};

// Puts the faces into the scene, triangulated, a part a group (its material: the group's number, for the caller to
// replace); a part's vertices are its distinct corners, in the file's order of positions.
LeftOut assemble_mesh(const CornerMesh& mesh, Scene& scene);

// Cuts polygons into triangles, all of one file by one object: convex ones as fans, others by clipping ears in the
// plane of Newell's normal (Meisters 1975). Fans serve beyond 100,000 corners too, and once the file's ears have taken
// `budget` point tests, so that time stays bounded whatever the file.
class Triangulator {
 public:
  explicit Triangulator(uint64_t budget = 1'000'000'000) : budget_(budget) {}

  // Cuts the polygon positions[vertices[0]], positions[vertices[1]], ...; appends triples of indices into `vertices`,
  // turning as it does. Corners that repeat their neighbour count once; triangles with a repeated corner are left out.
  // False if nothing was appended.
  bool cut(std::span<const uint32_t> vertices, std::span<const Vec3> positions,
           std::vector<std::array<uint32_t, 3>>& triangles);

 private:
  void cut_polygon();
  bool is_ear(uint32_t i);
  std::vector<uint32_t> loop_;                 // indices into `vertices`, neighbours distinct
  std::vector<Vec3d> polygon_;                 // positions of loop_
  std::vector<Vec2d> points_;                  // polygon_, projected
  std::vector<std::array<uint32_t, 3>> cuts_;  // of indices into loop_
  std::vector<uint32_t> next_, previous_, reflex_;
  std::vector<uint8_t> is_reflex_;
  uint64_t budget_;
};

// Makes colours at vertices white where a picture colours the surface: tools that write both write the same colours
// twice. Says so in a warning.
void leave_colors_to_pictures(Scene& scene);

// The way from a file's triangles to a usable scene; normals that the file lacks are zero. Vertices that no triangle
// uses may be broken. Turns triangles whose three normals all oppose them, merges duplicates, drops unused vertices and
// empty parts, makes and repairs normals, infers sidedness, and calls a material single-sided where all its triangles
// are. Error: no triangle has an area.
Result<void> finish_mesh(Scene& scene);

}  // namespace lambent
