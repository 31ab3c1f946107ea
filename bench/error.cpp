// Time to equal true error: the rule of before (1,024 rays a receiver, the mesh as it is, no denoising; but with
// today's control variate, which it had not) against a bake to the error that this reaches. Both errors are the
// certificate's.
#include "bench.h"

#include <lambent/bake/adapt.h>
#include <lambent/bake/bake.h>
#include <lambent/scene/procedural.h>

#include <fmt/format.h>

#include <string>

namespace lambent::bench {
namespace {

using Clock = std::chrono::steady_clock;
double since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

struct Timed {
  double seconds = 0;
  size_t receivers = 0, rays = 0;
  BakeReport report;
};

Timed timed(const Scene& scene, const BakeOptions& options, double before = 0) {
  Timed t;
  const auto start = Clock::now();
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  auto baked = bake(scene, *tracer, receivers, options, &t.report);
  t.seconds = since(start) + before, t.receivers = receivers.count(), t.rays = t.report.rays;
  return t;
}

void compare(const std::string& name, const Scene& scene) {
  BakeOptions plain;
  plain.denoise = false;
  const Timed old = timed(scene, plain);
  const double target = old.report.certificate.error;
  Scene adapted = scene;
  const auto start = Clock::now();
  AdaptOptions wish;
  wish.error = 0.8 * target;
  auto split = adapt(adapted, wish);
  BakeOptions options;
  options.error = target;
  const Timed now = timed(adapted, options, since(start));
  report("error " + name, now.seconds, old.seconds, "s", "1,024 rays a receiver, as before",
         {{"error", now.report.certificate.error},
          {"error_before", target},
          {"uncertain", now.report.certificate.uncertain},
          {"receivers", now.receivers},
          {"receivers_before", old.receivers},
          {"samples", now.report.samples},
          {"rays", now.rays},
          {"rays_before", old.rays},
          {"noise", now.report.certificate.noise},
          {"noise_before", old.report.noise},
          {"seconds_adapt", split ? split->seconds : -1},
          {"seconds_denoise", now.report.denoise_seconds}});
}

}  // namespace

void bench_error() {
  compare("courtyard", make_courtyard(1));
  compare("courtyard, finer", make_courtyard(2));
  for (const char* name : {"bunny.obj", "armadillo.obj"})
    if (auto scene = data_scene(name, true)) compare(name, *scene);
  for (const char* name : {"room.glb", "cornell_box_rounded.glb", "zdm2_level.glb"})
    if (auto scene = data_scene(name, false)) compare(name, *scene);
}

}  // namespace lambent::bench
