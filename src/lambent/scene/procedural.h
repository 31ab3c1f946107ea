#pragma once
// Scenes made by our own code, for the demo, the tests and the benchmarks. Normals are set, no file is read.
#include <lambent/core/camera.h>
#include <lambent/scene/scene.h>

#include <span>

namespace lambent {

// The demo: a small courtyard with coloured walls, a colonnade and a knot on a plinth, open to the sky; strong soft
// shadows and colour bleeding. `detail` scales the tessellation: 1 gives 50,000 to 100,000 vertices; cells shrink with
// 1 / detail.
Scene make_courtyard(float detail = 1.0f);
Camera courtyard_camera();

// A building of rooms on both sides of a hall, doors to it and a window each, for rooms that are joined; walls, floor
// and ceiling in cells of at most `cell`.
Scene make_building(int rooms_a_side, float cell);

// Pieces that scenes are made of; each is appended to `scene` as one part of the given material, one-sided.
uint32_t add_material(Scene& scene, std::string name, Vec3 albedo);
// Triangles given by triples of indices into the positions, counter-clockwise seen from the front; one unit normal a
// position.
void add_mesh(Scene& scene, uint32_t material, std::string name, std::span<const Vec3> positions,
              std::span<const Vec3> normals, std::span<const uint32_t> indices);
// Parallelogram origin + s*a + t*b, s,t in [0,1], front side along cross(a, b), in na x nb cells.
void add_quad(Scene& scene, uint32_t material, std::string name, Vec3 origin, Vec3 a, Vec3 b, int na, int nb);
// Box between corners, faces outward (or inward: a room), each face in n x n cells.
void add_box(Scene& scene, uint32_t material, std::string name, Vec3 min, Vec3 max, int n, bool inward = false);
// Sphere of 20 * 4^levels triangles with exact normals, facing outward or inward.
void add_sphere(Scene& scene, uint32_t material, std::string name, Vec3 centre, float radius, int levels,
                bool inward = false);

// Single-primitive scenes for tests.
Scene make_sphere(float radius, int levels, Vec3 albedo, bool inward = false);
Scene make_quad(Vec3 origin, Vec3 a, Vec3 b, int na, int nb, Vec3 albedo);

}  // namespace lambent
