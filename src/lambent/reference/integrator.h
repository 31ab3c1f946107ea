#pragma once
// Paths of the reference path tracer: one estimate of the radiance that leaves a surface point.
#include <lambent/brdf/brdf.h>
#include <lambent/light/environment.h>
#include <lambent/reference/intersect.h>
#include <lambent/reference/lamps.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/scene/reflection.h>
#include <lambent/scene/scene.h>

namespace lambent::reference {

// Which of the two ways to find the light is used. `combined` is the one for pictures; the other two exist so that
// tests can hold one against the other. `light_only` misses texels whose luminance is zero.
enum class Strategy { combined, light_only, brdf_only };

// Points for path number `index` of a run of `count`, in pairs of dimensions that are each a scrambled Sobol' sequence
// in an order of its own. `key` names the run (a pixel).
struct PathSamples {
  uint64_t key;
  uint32_t index, mask;  // mask: the power of two at or above `count`, less 1
  PathSamples(uint64_t key, uint32_t index, uint32_t count);
  Vec2 pair(uint32_t dimension) const;
};

// A place from which light is gathered.
struct PathVertex {
  Vec3 position;  // rays start here: clear of the surface
  Vec3 ng;        // geometric normal of the side that is seen
  Mat3 frame;     // shading frame, columns (t, b, n)
  Vec3 wo;        // towards the eye, in the shading frame
  Brdf brdf;
};

// The scene and environment must outlive it.
struct Integrator {
  const Scene* scene;
  const Environment* environment;
  Intersector intersector;
  EnvironmentSampler sampler;
  int bounces;
  Strategy strategy;
  Reflection reflection;
  bool lamps;  // the scene's own; light_only and combined alone know punctual ones
  EmitterSampler emitters;
  bool direct = true;  // false: what reaches the first vertex straight from a light is left out
};
Result<Integrator> make_integrator(const Scene& scene, const Environment& env, int bounces,
                                   Strategy strategy = Strategy::combined, const Reflection& reflection = {},
                                   bool lamps = false);

// False where nothing reflects towards -d: the back of a one-sided triangle.
bool make_vertex(const Integrator& integrator, const Hit& hit, Vec3 d, PathVertex& vertex);

// The surface that a ray meets, past those that it is drawn to pass (Intersector::met), `camera` as there; false: none.
bool meets(const Integrator& integrator, Vec3 origin, Vec3 d, bool camera, const PathSamples& samples, uint32_t depth,
           Hit& hit, Vec3& weight);

// A white Lambert receiver.
PathVertex white_vertex(Vec3 origin, Vec3 n);

// An estimate of the radiance that leaves `vertex` towards wo, without what it emits itself. Uses pairs 1 and up.
Vec3 exit_radiance_estimate(const Integrator& integrator, PathVertex vertex, const PathSamples& samples);

// The picture, as path_trace() returns it; `options` must be in range.
Result<ReferenceImage> render(const Integrator& integrator, const Camera& camera, const ReferenceOptions& options,
                              Progress* progress);

}  // namespace lambent::reference
