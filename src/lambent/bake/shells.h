#pragma once
// What an object does to the light around it, at points on shells: what it hides, as a function of direction, what it
// shines with, and what it makes of the light that arrives at it, in harmonics. Source: Zhou, Hu, Lin, Guo, Shum,
// "Precomputed Shadow Fields" (2005).
#include <lambent/core/progress.h>
#include <lambent/receivers/receivers.h>
#include <lambent/trace/tracer.h>
#include <lambent/transfer/field.h>

namespace lambent {

// What a bake of shells is asked for.
struct ShellOptions {
  int order = 4;                   // bands
  int shells = 24;                 // [2, max_shells]
  int side = 16;                   // points of a shell along each side of its square, [2, max_shell_side]
  float inner = 0.3f, outer = 12;  // radii of the first and of the last shell, in radii of the object
  int samples = 1024;              // rays a point, [1, 2^20]: towards the object's sphere, or, within it, everywhere
  uint32_t seed = 1;
};

struct ShellReport {
  size_t points = 0, rays = 0, bytes = 0;
  double seconds = 0;
};

// Shells about the middle of the scene's box: a third of them within its sphere, evenly in the logarithm of the radius;
// the others beyond it, evenly in the logarithm of the distance from the sphere. Errors: options out of range; a scene
// without size.
Result<Shells> make_shells(const Scene& scene, const ShellOptions& options);

// Of HiddenRows. Whatever a ray meets hides, its back too; what lets light pass hides what it holds back. Errors:
// cancelled.
Result<Field> bake_hidden(const Tracer& tracer, const Shells& shells, const ShellOptions& options,
                          ShellReport* report = nullptr, Progress* progress = nullptr);

// Of IncidentRows, for one group of lamps, "all": the light of the scene's emissive materials. Errors: none emits;
// cancelled.
Result<Field> bake_shining(const Scene& scene, const Tracer& tracer, const Shells& shells, const ShellOptions& options,
                           Progress* progress = nullptr);

// Bands of the light that an object reflects, at most, and of what of it arrives at a point.
inline constexpr int reflected_incident_order = 3, reflected_order = 4;

// Of IncidentRows under harmonics, up to those bands: light that arrives at the object, the same all over it, and
// leaves it towards the point, by `own`, its diffuse transfer at `receivers`, bounces within it included, and its base
// colours. Errors: cancelled.
Result<Field> bake_reflecting(const Scene& scene, const Tracer& tracer, const CornerReceivers& receivers,
                              const Transfer& own, const Shells& shells, const ShellOptions& options,
                              Progress* progress = nullptr);

}  // namespace lambent
