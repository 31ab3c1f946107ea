#pragma once
// Rays against the scene: the only place of the baker and the renderer that knows Embree.
#include <lambent/core/progress.h>
#include <lambent/core/result.h>
#include <lambent/scene/scene.h>

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

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

// What see-through surfaces (scene/see_through.h) make of a ray.
struct Passage {
  Vec3 sky{0};  // of the light of beyond the scene, what arrives along the ray; 0 where something solid is in its way
  Vec3 hit{1};  // what the ray's hit counts for
};

// Whether parts that are affine images of one another share their triangles. Memory then grows with shapes and not with
// copies; hits agree to the rounding of coordinates, and rays take longer. Automatic: where it saves tens of megabytes.
enum class Sharing : uint8_t { automatic, never, always };

// Rays against a scene; it does not change once it is built, and any number of threads may trace.
class Tracer {
 public:
  // Builds the acceleration structure; the result does not depend on the number of threads. The scene must outlive it
  // and keep its triangles; where lets_pass(), it is read for every ray. Errors: out of memory; cancelled.
  static Result<Tracer> build(const Scene& scene, Progress* progress = nullptr, Sharing sharing = Sharing::automatic);

  // Whether light passes through some of the scene's surfaces; through this one; and through some of them coloured.
  bool lets_pass() const;
  bool lets_pass(uint32_t triangle) const;
  bool colours() const;

  // visible[i] = what of light from beyond the scene arrives at `origin` along direction i: 1 where nothing is in its
  // way, 0 behind something solid, between them through surfaces that let it pass: their product, the mean of its three
  // channels. The second form: each channel.
  void visible_fan(Vec3 origin, const Directions& directions, float* visible) const;
  void visible_fan(Vec3 origin, const Directions& directions, const std::array<float*, 3>& visible) const;
  // hits[i] = the closest hit from `origin` along direction i.
  void closest_fan(Vec3 origin, const Directions& directions, Hit* hits) const;
  // For scenes that let light pass. Of the surfaces that a ray goes through and the solid one at its end, or none
  // there, one is its hit: drawn by a hash of the ray, with the probability of about what is reflected there, so that
  // the mean over rays of passages[i].hit times what the covered part of hits[i] sends back is what comes along the
  // ray.
  void closest_fan(Vec3 origin, const Directions& directions, Hit* hits, Passage* passages) const;
  Hit closest(Vec3 origin, Vec3 direction, Passage& passage) const;
  // All of those surfaces between `from` and the solid one, nearest first, and it, if there is one, at the end.
  void layers(Vec3 origin, Vec3 direction, float from, std::vector<Hit>& out) const;
  // Of light from `distance` away, what arrives at `origin`; 0 behind something solid.
  Vec3 transmittance(Vec3 origin, Vec3 direction, float distance) const;

  // One ray, from `from` units along it to `to`.
  Hit closest(Vec3 origin, Vec3 direction, float from = 0, float to = INFINITY) const;

  size_t bytes() const;   // of the acceleration structure
  size_t copies() const;  // parts that share their triangles with others

 private:
  struct Impl;
  std::shared_ptr<const Impl> impl_;
};

}  // namespace lambent
