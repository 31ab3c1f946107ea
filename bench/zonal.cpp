// Zonal lobes (local-deformable-prt): how close they come, how long the fit takes, and how fast they shade. Figures of the paper and
// of an earlier prototype stand beside ours as "limit". Not measured here: baking, posing.
#include "bench.h"

#include <lambent/bake/bake.h>
#include <lambent/compress/zonal_fit.h>
#include <lambent/core/random.h>

#include <algorithm>

namespace lambent::bench {
namespace {

constexpr int order = 6;

// Normally distributed coefficients, scaled to length 1: directions in coefficient space are uniform.
Transfer random_signals(size_t count) {
  const WritableTransfer w = make_transfer({.order = order}, 1, 1, count, Precision::single);
  for (size_t r = 0; r < count; ++r) {
    Random random(7, r);
    std::vector<float> v(size_t(sh_count(order)));
    double sum = 0;
    for (float& x : v) {
      const Vec2 u = random.next2();
      x = std::sqrt(-2 * std::log(1 - u.x)) * std::cos(2 * pi * u.y);
      sum += double(x) * x;
    }
    for (float& x : v) x /= float(std::sqrt(sum));
    store_receiver(w, r, v);
  }
  return w.transfer;
}

Transfer first_receivers(const Transfer& t, size_t count) {
  const WritableTransfer w = make_transfer(t.light, t.rows, t.channels, count, t.precision);
  for (size_t r = 0; r < count; ++r) store_receiver(w, r, load_receiver(t, r % t.receivers));
  return w.transfer;
}

void random_case() {
  const Transfer signals = random_signals(1000);
  const double prototype[] = {0.73, 0.58, 0.38, 0.21, 0.032, 1e-6};
  for (int lobes = 1; lobes <= 6; ++lobes) {
    ZonalFitReport r;
    auto fit = fit_zonal(signals, {.lobes = lobes, .retry = 0, .ridge = 1e-11f, .precision = Precision::single}, &r);
    if (!fit) return;
    std::sort(r.errors.begin(), r.errors.end());
    nlohmann::json more{{"lobes", lobes}, {"signals", 1000}, {"p90", r.errors[900]}, {"worst", r.errors.back()}, {"seconds", r.seconds}};
    if (lobes == 6) more["paper"] = 0.00908;
    report("zonal_random", r.errors[500], prototype[lobes - 1], "relative RMS, median", "a prototype's median (six starts)", more);
  }
}

void mesh_case(const std::string& name) {
  auto scene = data_scene(name, false);
  if (!scene) return;
  auto tracer = Tracer::build(*scene);
  if (!tracer) return;
  const Receivers receivers = make_vertex_receivers(*scene);
  BakeOptions options;
  options.order = order, options.precision = Precision::single, options.samples = 512;
  auto t = bake(*scene, *tracer, receivers, options);
  if (!t) return;
  for (int lobes = 1; lobes <= 6; ++lobes) {
    ZonalFitReport r;
    auto fit = fit_zonal(*t, {.lobes = lobes}, &r);
    if (!fit) return;
    std::sort(r.errors.begin(), r.errors.end());
    report("zonal_mesh", r.rms, lobes == 3 ? 0.045 : r.rms, "relative RMS", lobes == 3 ? "the paper, its Fig. 3" : "itself (the paper prints no number)",
           {{"scene", name}, {"lobes", lobes}, {"receivers", t->receivers}, {"channels", t->channels}, {"median", r.errors[r.errors.size() / 2]},
            {"worst", r.errors.back()}, {"seconds", r.seconds}, {"retried", r.retried}, {"bytes_per_receiver", double(fit->bytes()) / double(t->receivers)}});
  }
  double each = 0;
  for (size_t count : {size_t{17575}, 2 * size_t{17575}, 4 * size_t{17575}}) {
    const Transfer part = first_receivers(*t, count);
    ZonalFitReport r;
    (void)fit_zonal(part, {}, &r);
    if (each == 0) {
      each = r.seconds / double(count);
      report("zonal_fit_17575", r.seconds, 10, "s", "the aim, for 4 lobes (the paper: up to 30 minutes)", {{"scene", name}, {"rms", r.rms}, {"aim", "<= 1"}});
    } else {
      report("zonal_fit_growth", r.seconds / double(count), each, "s a receiver", "17,575 receivers", {{"scene", name}, {"receivers", count}, {"aim", "<= 1.1"}});
    }
  }
}

}  // namespace

void bench_zonal() {
  random_case();
  for (const char* name : {"bunny.obj", "armadillo.obj", "scorpion.obj"}) mesh_case(name);
}

}  // namespace lambent::bench
