#pragma once
// The scene's own lamps, for the reference alone: emissive triangles as one distribution, punctual lights one by one.
#include <lambent/reference/intersect.h>

#include <vector>

namespace lambent::reference {

// Emissive triangles, drawn with density proportional to area times the largest channel of their radiance, uniformly
// over each. The scene must outlive it.
struct EmitterSampler {
  const Scene* scene = nullptr;
  std::vector<uint32_t> triangles;
  std::vector<double> cdf;  // one more than triangles
};
struct EmitterSample {
  Vec3 direction;  // unit, from the point
  float distance = 0;
  Vec3 radiance{0};
  float pdf = 0;  // per solid angle at the point; 0 where nothing can come from there
};
EmitterSampler make_emitter_sampler(const Scene& scene);
EmitterSample sample_emitter(const EmitterSampler& sampler, Vec3 point, float pick, Vec2 u);

// Radiance that the surface at `hit` sends back along a ray of direction d that met it.
Vec3 emitted(const Scene& scene, const Hit& hit, Vec3 d);
// Density, as above, of drawing the emissive `hit`, seen from `point` along d.
float emitter_pdf(const EmitterSampler& sampler, const Hit& hit, Vec3 point, Vec3 d);

}  // namespace lambent::reference
