#pragma once
// One random walk through a medium behind the fronts of surfaces. Source: local-deformable-prt, section 6.
#include <lambent/bake/subsurface.h>
#include <lambent/core/random.h>

namespace lambent {

// The direction of light that goes on through a boundary of normal n, which d points along, into a relative index of 1
// / ratio.
Vec3 refract(Vec3 d, Vec3 n, float ratio);

struct WalkEnd {
  enum { left, absorbed, lost } how;
  Vec3 position, direction;  // of one that left: just outside
};

// Of one colour.
struct Walker {
  const Scene& scene;
  const Tracer& tracer;
  const SubsurfaceOptions& options;
  float sigma_t, albedo;
  Bounds box;

  // From p, inside, along d. `events` counts scatterings and reflections.
  WalkEnd walk(Vec3 p, Vec3 d, Random& random, size_t& events) const;
  // A point of the surface moved along its normal by more than its rounding: up > 0 is outside.
  Vec3 beside(const Hit& hit, Vec3 normal, float up) const;
  Vec3 normal(const Hit& hit) const;

 private:
  // Back into the middle of a scene that repeats; false for what wandered off, through a hole or where floats round.
  bool keep(Vec3& p) const;
};

// By colour: one where the medium is grey, else three.
std::vector<Walker> make_walkers(const Scene& scene, const Tracer& tracer, const SubsurfaceOptions& options);

}  // namespace lambent
