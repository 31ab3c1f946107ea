#pragma once
// Receivers where light changes: a mesh is split where its corners do not tell what its edges receive. Source:
// radiosity, "Adaptive Refinement".
#include <lambent/core/progress.h>
#include <lambent/core/result.h>
#include <lambent/scene/scene.h>

namespace lambent {

// What splitting is asked for.
struct AdaptOptions {
  double error = 0.05;         // relative RMS of direct transfer, by area, that interpolation may lose; > 0
  float longest = 0.05f;       // edges longer than this part of the scene's diagonal are split first; of those above
  float shortest = 2e-3f;      // twice this part, some are
  double more = 1;             // triangles at most, beyond those that there are: so many times those,
  size_t triangles = 150'000;  // or so many, if that is more
  int order = 4;               // of the harmonics that are looked at: bands above have more noise and less light
  int samples = 128;           // rays a place
  uint32_t seed = 1;
  double seconds = -1;  // no look is begun that would end later; negative: no limit
};
// What it says of itself.
struct AdaptReport {
  size_t before = 0, after = 0;  // triangles
  size_t rays = 0;
  int levels = 0;
  bool limited = false;          // more triangles were wanted than the options allow
  bool late = false;             // or more time
  double first = -1, last = -1;  // relative RMS error of interpolation at the edges' middles, before and after
  double seconds = 0;
};

// Splits edges at their middle, in both triangles alike, level by level: those whose middle differs most from the mean
// of its ends, in direct transfer, weighed by area, until what is left is below the error, no edge is long enough or
// time is up. Normals, colours and coordinates are interpolated. Errors: cancelled; out of memory.
Result<AdaptReport> adapt(Scene& scene, const AdaptOptions& options, Progress* progress = nullptr);

}  // namespace lambent
