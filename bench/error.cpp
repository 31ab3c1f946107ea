// Time to equal error, by processor time, since other work may run beside: 1,024 rays a receiver on the mesh as it is
// and not denoised, as bakes were before (but for the control variate, which they had not), against a bake to the error
// that this reaches. And what denoising leaves of the noise, against many rays.
#include "bench.h"

#include <lambent/bake/adapt.h>
#include <lambent/bake/bake.h>
#include <lambent/scene/procedural.h>

#include <fmt/format.h>

#include <cmath>
#include <ctime>
#include <string>

namespace lambent::bench {
namespace {

constexpr size_t fewest_traced = 6'000;  // as the pipeline has it

double processor_seconds() { return double(std::clock()) / CLOCKS_PER_SEC; }

struct Timed {
  double seconds = 0;
  BakeReport report;
};
Timed timed(const Scene& scene, const BakeOptions& options) {
  Timed t;
  const double start = processor_seconds();
  auto tracer = Tracer::build(scene);
  auto baked = bake(scene, *tracer, make_vertex_receivers(scene), options, &t.report);
  t.seconds = processor_seconds() - start;
  return t;
}

void compare(const std::string& name, const Scene& scene) {
  BakeOptions plain;
  plain.denoise = false;
  const Timed old = timed(scene, plain);
  const double target = old.report.error, start = processor_seconds();
  Scene adapted = scene;
  auto split = adapt(adapted, {.error = 0.8 * target});
  const double splitting = processor_seconds() - start;
  BakeOptions options;
  options.error = target, options.thin = fewest_traced;
  const Timed now = timed(adapted, options);
  report("error " + name, now.seconds + splitting, old.seconds, "processor seconds", "1,024 rays a receiver, as before",
         {{"error", now.report.error},
          {"error_before", target},
          {"uncertain", now.report.certificate.uncertain},
          {"receivers", now.report.receivers},
          {"traced", now.report.traced},
          {"receivers_before", old.report.receivers},
          {"samples", now.report.samples},
          {"rays", now.report.rays + (split ? split->rays : 0)},
          {"rays_before", old.report.rays},
          {"noise", now.report.noise},
          {"noise_before", old.report.noise},
          {"splitting", splitting}});
}

void denoised(const std::string& name, const Scene& scene) {
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  auto rows = [&](int samples, uint32_t seed, bool denoise) {
    return *bake(
        scene, *tracer, receivers,
        {.samples = samples, .seed = seed, .precision = Precision::single, .denoise = denoise, .certify = false});
  };
  const Transfer truth = rows(16384, 777, false);
  auto error = [&](const Transfer& t) {
    double sum = 0, all = 0;
    for (size_t r = 0; r < receivers.count(); ++r) {
      const std::vector<float> a = load_receiver(t, r), b = load_receiver(truth, r);
      for (size_t k = 0; k < a.size(); ++k)
        sum += double(a[k] - b[k]) * double(a[k] - b[k]), all += double(b[k]) * double(b[k]);
    }
    return std::sqrt(sum / all);
  };
  for (const int samples : {64, 256, 1024})
    report(fmt::format("denoised {}, {} rays", name, samples), error(rows(samples, 5, true)),
           error(rows(samples, 5, false)), "relative RMS at receivers", "not denoised", {{"truth", "16,384 rays"}});
}

// The same surface with ever more vertices, to one error: what they cost beyond what light asks for.
void growth() {
  double first = 0;
  for (const int levels : {6, 8, 9}) {
    Scene scene;
    const uint32_t grey = add_material(scene, "grey", Vec3(0.6f));
    add_quad(scene, grey, "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 128, 128);
    add_sphere(scene, grey, "ball", Vec3(0, 0.8f, 0), 0.7f, levels);
    BakeOptions options;
    options.error = 0.01, options.thin = fewest_traced;
    const Timed now = timed(scene, options);
    if (first == 0) first = now.seconds;
    report(fmt::format("growth, {} vertices", scene.positions.size()), now.seconds, first, "processor seconds",
           "of the first",
           {{"error", now.report.error},
            {"uncertain", now.report.certificate.uncertain},
            {"traced", now.report.traced},
            {"rays", now.report.rays}});
  }
}

}  // namespace

void bench_error() {
  growth();
  for (const char* name : {"room.glb", "cornell_box_rounded.glb", "zdm2_level.glb"})
    if (auto scene = data_scene(name, false)) compare(name, *scene);
  for (const char* name : {"bunny.obj", "armadillo.obj"})
    if (auto scene = data_scene(name, true)) compare(name, *scene);
  compare("courtyard", make_courtyard(1));
  denoised("courtyard at half detail", make_courtyard(0.5f));
  compare("courtyard, finer", make_courtyard(2));
}

}  // namespace lambent::bench
