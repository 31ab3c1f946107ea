#pragma once
// A lightmap baked to an error: direct light apart from bounces, each at as many receivers and by as many rays as it
// asks for. Source: radiosity, "Discussion 4" (direct light apart), "Adaptive Refinement".
#include <lambent/bake/lightmap.h>

namespace lambent {

struct SolvedLightmap {
  AlignedVector<float> all, direct;  // [receiver][width]; direct light alone, if asked for
  std::vector<AlignedVector<float>> terms;
};

// Columns are the lamps' groups times channels, `width` floats. Errors: cancelled.
Result<SolvedLightmap> solve_lightmap_to_error(const Scene& scene, const Tracer& tracer, const Receivers& receivers,
                                               const Lamps& lamps, const LightmapOptions& options,
                                               LightmapReport& report, Progress* progress = nullptr);

// Texels along a unit of length with which direct light is told to an error by bilinear look-ups: measured with two
// coarse atlases and extrapolated; at most so many that `most` texels result. `remark` says in one line what decided.
Result<float> lightmap_density(const Scene& scene, const Lamps& lamps, double error, size_t most, uint32_t seed,
                               std::string* remark, Progress* progress = nullptr);

}  // namespace lambent
