#pragma once
// Geometry that the user asked to be added or made finer.
#include <lambent/scene/scene.h>

#include <functional>

namespace lambent {

// Name of the part that add_ground adds.
inline constexpr const char* ground_name = "ground";

// Adds a square floor, named ground_name, one-sided and of albedo 0.5, at the scene's lowest point. It reaches three
// radii of the bounding sphere out from the centre; its 128 x 128 cells are finest under the scene and grow outward.
// The scene must have a triangle.
void add_ground(Scene& scene);

// Splits edges longer than max_edge (world units) at their middle until none is left. Both triangles of an edge split
// it alike, across parts too, so no cracks appear; new vertices interpolate all attributes. Errors: max_edge not
// positive, or too fine for the coordinates' precision; more than `max_triangles` triangles would result (mostly found
// before anything is split; the scene may be left partly split).
Result<void> split_long_edges(Scene& scene, float max_edge, size_t max_triangles = size_t{1} << 27);

// Splits every edge whose ends `wants` at its middle, once, as above. `wants` is asked by the positions of the ends
// alone, in one order for all triangles on an edge, from one thread. The number of edges split, one a triangle's side.
// The mesh must stay below 2^32 vertices and triangles.
size_t split_edges(Scene& scene, const std::function<bool(Vec3 a, Vec3 b)>& wants);

}  // namespace lambent
