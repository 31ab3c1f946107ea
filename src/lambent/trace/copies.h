#pragma once
// Parts of a scene that are affine images of one another, of which a ray tracer need hold one.
#include <lambent/scene/scene.h>

#include <vector>

namespace lambent {

// A part as an image of a shape: world = turn * x + at, for x in the shape's own space.
struct Copy {
  uint32_t part;
  Mat3 turn;  // of any kind: scaled, sheared, mirrored
  Vec3 at;
  bool flipped;  // its triangles name the shape's corners in the order 0, 2, 1
};

// A part that others are images of. Its own space has its box's middle as the origin, where floats are finest.
struct Shape {
  uint32_t part;
  Vec3d middle;
  std::vector<Copy> copies;  // the part itself first
};

// Shapes of at least two copies, each of at least `least_triangles`; triangle k of a copy is the image of triangle k of
// its shape. Found from positions alone, so that it does not matter what file or which step made them: a map is fitted
// to all corners (least squares), and every corner must lie where it puts it, but for what floats of that size round.
// Exact as that is, the order of vertices and what else they hold may differ.
std::vector<Shape> find_shapes(const Scene& scene, uint32_t least_triangles);

}  // namespace lambent
