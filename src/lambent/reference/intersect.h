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

  // Whether light passes through some surfaces (scene/see_through.h); the rest is for scenes where it does.
  bool lets_pass() const;
  // Nearest surface that the ray is drawn not to pass, by numbers keyed by `key`; false: it leaves the scene. `camera`:
  // as nearest_visible(). The weight is what of light from there arrives, over the probability of having been drawn:
  // coloured by what was passed, and times what is covered of where it stopped. At most `most` is the probability of
  // passing a surface that reflects.
  bool met(Vec3 origin, Vec3 d, bool camera, float most, uint64_t key, Hit& hit, Vec3& weight) const;
  // Of light from `distance` away along d, what arrives: the product over the surfaces between.
  Vec3 transmitted(Vec3 origin, Vec3 d, float distance) const;

 private:
  struct Way;
  bool next(Vec3 origin, Vec3 d, bool camera, Way& way, Hit& hit) const;
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

// A point of a triangle with its geometric normal, in the precision that the inputs have.
struct SurfacePoint {
  Vec3 position;
  Vec3 ng;       // unit, on the front side
  float offset;  // how far along +-ng a ray must start so as not to meet the triangle it leaves
};

// The offset exceeds what rounding can do. The position is interpolated exactly and rounded once to float: half an ulp
// of its largest coordinate. Then the tracer computes the ray's distance to the plane of this triangle, or of a
// coplanar neighbour, from corners relative to the ray's origin: a few ulps of their distance from it. Neither exceeds
// a few ulps of the triangle's largest corner coordinate, wherever the scene lies and whatever its unit; the offset is
// 16 of them, 1e-6 of that coordinate.
SurfacePoint surface_point(const Scene& scene, const Hit& hit);

}  // namespace lambent::reference
