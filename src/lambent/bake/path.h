#pragma once
// One random path through the scene, for transfer by direct simulation (matrix.h). Source: general-prt ("direct
// simulation").
#include <lambent/scene/reflection.h>
#include <lambent/trace/tracer.h>

namespace lambent {

// A path that a ray along `direction`, which met the scene at `hit`, takes from there by sampling the BRDFs.
struct PathEnd {
  bool leaves = false;    // it left the scene after at most so many reflections; else it brings no light
  Vec3 throughput{0.0f};  // product of f cos / density, and of what passes on the way
  Vec3 direction{0.0f};   // in which it left
};

// Random numbers are points `index` of low-discrepancy sequences of their own for each reflection, keyed by `key`.
PathEnd follow_path(const Scene& scene, const Tracer& tracer, const Reflection& reflection, Vec3 direction,
                    const Hit& hit, int reflections, uint64_t key, uint32_t index);

}  // namespace lambent
