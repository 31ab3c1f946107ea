#pragma once
// What a PLY file holds, before anything is made of it.
#include <lambent/scene/scene.h>

#include <span>

namespace lambent {

struct PlyMesh {
  bool has_vertices = false, has_faces = false;
  std::vector<Vec3d> positions;         // in the file's space, broken_position included
  std::vector<Vec3> normals, colors;    // may be empty
  std::vector<Vec2> texcoords;          // may be empty
  std::vector<uint32_t> corners;        // of all polygons, one after the other
  std::vector<uint32_t> corner_counts;  // a polygon
  std::vector<Vec2> corner_texcoords;   // empty, or one a corner
  std::vector<uint32_t> face_textures;  // empty, or one a polygon
  std::vector<std::string> textures;    // files that `comment TextureFile` lines name
  size_t odd_texcoords = 0;             // polygons whose coordinates are not one pair a corner
};

// Errors: malformed, truncated, indices of no vertex, no positions or faces.
Result<PlyMesh> read_ply(std::span<const uint8_t> bytes, const std::string& path);

}  // namespace lambent
