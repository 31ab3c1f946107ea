#pragma once
// Ground truth: an independent path tracer. It shares scenes, BRDFs and environments with the rest, and no transport
// code, no basis and no ray tracing: an error there must not cancel against itself here.
//
// What it computes. Light is distant: the environment, constant over each texel; and, where asked for, the scene's own
// lamps: emissive materials (factor times texture, on the sides that are not black) and punctual lights. At a hit point
// with interpolated normal n, bent by the normal texture and turned to the side that is seen, exit radiance is the
// integral of f L max(0, n . wi) over the directions wi above the true (geometric) surface; what lies along wi is
// decided by true geometry. With k bounces, light reaches the first hit directly or after reflection at 1, 2, ... k
// other points. No path is cut short or dropped at random.
// Surfaces that let light pass (scene/see_through.h) are met or passed at random, and exactly on the way to lights.
#include <lambent/core/camera.h>
#include <lambent/core/progress.h>
#include <lambent/light/environment.h>
#include <lambent/scene/reflection.h>
#include <lambent/scene/scene.h>

#include <span>

namespace lambent {

struct ReferenceOptions {
  int width = 512, height = 512;  // pixels
  int spp = 256;                  // paths a pixel, [1, 2^20]; powers of two converge best
  int bounces = 3;                // reflections between surfaces after the first hit, [0, 64]; 0 is direct light only
  bool background = true;  // the environment behind the scene, interpolated; false: black, and the image has alpha
  uint32_t seed = 1;
  Reflection reflection;  // of the surfaces
  bool lamps = false;     // the scene's own give light too, and are seen
  bool direct = true;     // false: light that has met two surfaces or more alone; lamps and direct light are left out
};

struct ReferenceImage {
  // A pixel is the mean over its area. Without background, alpha is the share of the area that is covered and rgb is
  // already multiplied by it.
  Image image;
  // Of each pixel's mean, linear RGB, estimated from the paths as if they were independent. They are stratified, so the
  // true variance is lower, several times so where the picture is smooth. Infinite for one path a pixel.
  std::vector<Vec3> variance;
};

// Sidedness as everywhere: a one-sided triangle is black to light from behind and absent to camera rays from behind; a
// two-sided one reflects on either side. Radiance may be negative where the environment is. Errors: no triangles; an
// empty environment; options out of range; out of memory; cancelled.
Result<ReferenceImage> path_trace(const Scene& scene, const Environment& env, const Camera& camera,
                                  const ReferenceOptions& options, Progress* progress = nullptr);

// Exit radiance of a white (albedo 1) Lambert receiver at a point with unit normal n, lit by the scene and environment:
// what a diffuse bake stores times the light. For tests. `origin` must be clear of the surface. `bounces` and `seed` as
// above; the noise at different points is independent.
Vec3 exit_radiance(const Scene& scene, const Environment& env, Vec3 origin, Vec3 n, int bounces, int paths,
                   uint32_t seed, bool lamps = false);

// The same at many points, and the variance of each mean (as ReferenceImage::variance). One preparation serves all
// points. `reflection` is of the scene's surfaces, not of the receivers.
struct ExitRadiance {
  Vec3 mean, variance;
};
std::vector<ExitRadiance> exit_radiances(const Scene& scene, const Environment& env, std::span<const Vec3> origins,
                                         std::span<const Vec3> normals, int bounces, int paths, uint32_t seed,
                                         const Reflection& reflection = {}, bool lamps = false);

}  // namespace lambent
