#pragma once
// A scene from arrays that a program holds, made as load_scene() makes one of a file.
#include <lambent/scene/scene.h>

#include <span>

namespace lambent {

// A triangle mesh; what is empty is not given, and all else has a value a vertex.
struct MeshArrays {
  std::span<const Vec3d> vertices;
  std::span<const uint32_t> faces;  // three vertices each, counter-clockwise seen from the front
  std::span<const Vec3> normals;    // of any length; zero: to be made
  std::span<const Vec3> colors;     // linear albedo, [0, 1]
  std::span<const Vec2> texcoords;  // v down, as glTF's
};

// One part of one diffuse material, of albedo 0.8 where there are no colours. Scene::input counts the array's rows,
// Scene::hash is of all of them. Errors, by array and row: counts that do not fit, a face's vertex that is not there,
// what is not finite, vertices beyond 1e9; no triangle with an area.
Result<Scene> scene_from_arrays(const MeshArrays& arrays);

}  // namespace lambent
