#pragma once
// Rays against the scene's triangles, for the reference alone: it shares no ray tracing with the rest (path_tracer.h).
#include <lambent/scene/scene.h>

#include <memory>

namespace lambent::reference {

// A place on a triangle: weights (1-u-v, u, v) of its corners, as interpolate() takes them.
struct Hit {
  uint32_t triangle = none;
  float u = 0, v = 0;
};

// The scene must outlive it.
class Intersector {
 public:
  // Errors: no triangles; out of memory.
  static Result<Intersector> make(const Scene& scene);

  // Nearest triangle along origin + t d, t > 0, whichever side faces the ray. False: the ray leaves the scene.
  bool nearest(Vec3 origin, Vec3 d, Hit& hit) const;
  // As above, but one-sided triangles are absent from behind.
  bool nearest_visible(Vec3 origin, Vec3 d, Hit& hit) const;
  // Whether any triangle, of either side, lies along origin + t d, t > 0.
  bool occluded(Vec3 origin, Vec3 d) const;

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

// A point of a triangle with its geometric normal, in the precision that the inputs have.
struct SurfacePoint {
  Vec3 position;
  Vec3 ng;       // unit, on the front side
  float offset;  // how far along +-ng a ray must start so as not to meet the triangle it leaves
};

// The offset exceeds what rounding can do: the position is rounded to float after exact interpolation (half an ulp of its
// largest coordinate), and the ray's distance to the plane of this triangle or a coplanar neighbour is computed from the
// corners' coordinates relative to the origin, with an error of a few ulps of the larger of the two. Both are bounded by ulps
// of the triangle's largest corner coordinate; and it is the size of the triangle itself where it lies around the origin.
SurfacePoint surface_point(const Scene& scene, const Hit& hit);

}  // namespace lambent::reference
