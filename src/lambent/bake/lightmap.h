#pragma once
// Scene and lamps -> Transfer: radiosity. The columns are groups of the scene's own lamps, and, where wanted, harmonics
// of a distant light (a PRT lightmap); the operator and the rays are those of bake.h. Relit with coefficient 1 a group,
// it is exit radiance of white receivers, irradiance / pi; other coefficients dim and tint the groups.
#include <lambent/bake/certify.h>
#include <lambent/bake/directional.h>
#include <lambent/bake/operator.h>
#include <lambent/bake/solve.h>
#include <lambent/transfer/transfer.h>

#include <optional>

namespace lambent {

// How hit rows are gathered: by cosine-distributed rays, or through the pixels of a hemicube.
enum class GatherKind { rays, hemicube };

struct LightmapOptions {
  int order = 0;      // bands of a distant light's harmonics, columns before the groups; 0: none, at most max_sh_order
  int samples = 512;  // rays a receiver, [1, 2^20]
  int lamp_samples = 32;          // towards each group's lamps, [1, 2^16]
  int bounces = 3;                // reflections between surfaces, [0, 64]; not read where `converge` is set
  double converge = 0;            // above 0: as many bounces as leave this residual (SolveOptions::tolerance)
  Solver solver = Solver::gmres;  // for `converge`
  DirectionalKind directional = DirectionalKind::none;  // rows of the transfer; others than none take order 0
  size_t memory = size_t{4} << 30;  // bytes of working memory beyond scene and result; less means rays traced again
  GatherKind gather = GatherKind::rays;  // hemicube: `samples` is rounded to 3 n^2
  uint32_t seed = 1;
  Precision precision = Precision::half;
  bool keep_terms = false;  // Lightmap::terms; of counted bounces of lightmaps that are not directional
  // Where > 0, bake to this relative RMS error (Certificate::error): direct light and bounces have receivers and rays
  // of their own, as many as that asks for (thin.h), `lamp_samples` to begin with and none of `samples`. Of lamps
  // alone, without `directional`, by rays. No more are asked for where they would end after so many seconds; negative:
  // no limit.
  double error = 0, seconds = -1;
  bool denoise = true;  // then: takes away noise that neighbours do not share (denoise.h)
  // As BakeOptions has it; without `error` and `directional`, by rays, with a solver that needs no rows one by one.
  Projection projection = Projection::collocation;
};

struct Lightmap {
  Transfer all;                    // direct and bounced
  std::optional<Transfer> direct;  // alone, where asked for, in one row: all - direct is the indirect part
  // Where keep_terms says so, direct light, that reflected once, twice, ...: E, B E, B^2 E; they add up to `all`.
  std::vector<Transfer> terms;
};

struct LightmapReport {
  size_t receivers = 0, buried = 0, rays = 0, operator_bytes = 0;
  double operator_kept = 1, trace_seconds = 0, bounce_seconds = 0;
  SolveReport solve;  // empty where bounces are counted
  // Where half floats were asked for and single ones taken: the brightest value of all, or of the darkest group, which
  // halves do not hold; else 0.
  float beyond_half = 0;
  size_t operator_file_bytes = 0;  // as BakeReport's
  // Of a bake to an error: what was reached; of its noise, direct light's and that of bounces, relative to all light;
  // receivers that were traced for each, and rays of each.
  Certificate certificate;
  double direct_noise = -1, bounced_noise = -1;
  size_t direct_traced = 0, bounced_traced = 0;
  int direct_samples = 0, samples = 0;
  double certify_seconds = 0;
};

// Least working memory with which such a bake can run: the solution vectors. What is more holds the operator.
size_t least_lightmap_memory(size_t receivers, size_t groups, const LightmapOptions& options);

// What can be known before there are receivers. Errors: options out of range, nothing that gives light (no groups and
// order 0), too many columns.
Result<void> check_lightmap(const Scene& scene, const Lamps& lamps, const LightmapOptions& options);

// Errors: those; memory too small (says what is needed); cancelled.
Result<Lightmap> bake_lightmap(const Scene& scene, const Tracer& tracer, const Receivers& receivers, const Lamps& lamps,
                               const LightmapOptions& options, bool direct_apart, LightmapReport* report = nullptr,
                               Progress* progress = nullptr);

}  // namespace lambent
