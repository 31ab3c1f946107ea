#pragma once
// Rays against the scene: the only place of the baker and the renderer that knows Embree.
#include <lambent/core/progress.h>
#include <lambent/core/result.h>
#include <lambent/scene/scene.h>

#include <cstddef>
#include <memory>

namespace lambent {

// Directions in structure-of-arrays form; rays are traced fastest in batches that point alike, so keep them in the
// order of a space-filling curve.
struct Directions {
  const float *x, *y, *z;
  size_t count;
};

// Where a ray met the scene.
struct Hit {
  uint32_t triangle = none;  // index into Scene::triangles, or `none` for a miss
  float u = 0, v = 0;        // weights of corners 1 and 2
  bool front = true;         // the ray met the side that faces counter-clockwise
  float distance = 0;
};

// Rays against a scene; it does not change once it is built, and any number of threads may trace.
class Tracer {
 public:
  // Builds the acceleration structure; the result does not depend on the number of threads. The scene must outlive it
  // and keep its triangles. Errors: out of memory; cancelled.
  static Result<Tracer> build(const Scene& scene, Progress* progress = nullptr);

  // visible[i] = 1 where the ray from `origin` along direction i leaves the scene, else 0.
  void visible_fan(Vec3 origin, const Directions& directions, float* visible) const;
  // hits[i] = the closest hit from `origin` along direction i.
  void closest_fan(Vec3 origin, const Directions& directions, Hit* hits) const;
  // One ray, from `from` units along it to `to`.
  Hit closest(Vec3 origin, Vec3 direction, float from = 0, float to = INFINITY) const;

  size_t bytes() const;  // of the acceleration structure

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace lambent
