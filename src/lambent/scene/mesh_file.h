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

inline bool is_position(Vec3 p) {
  return std::abs(p.x) <= max_coordinate && std::abs(p.y) <= max_coordinate &&
         std::abs(p.z) <= max_coordinate;  // not NaN either
}

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

// The way from a file's triangles to a usable scene; normals that the file lacks are zero. Turns triangles whose three
// normals all oppose them, merges duplicates, drops unused vertices and empty parts, makes and repairs normals, infers
// sidedness, and calls a material single-sided where all its triangles are. Error: no triangle has an area.
Result<void> finish_mesh(Scene& scene);

}  // namespace lambent
