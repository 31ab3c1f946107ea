// Lightmaps: the gather operator over texels against raw Embree, a further bounce, many light groups, and growth.
#include "bench.h"

#include <lambent/bake/kernels.h>
#include <lambent/bake/lightmap.h>
#include <lambent/core/parallel.h>
#include <lambent/receivers/atlas.h>
#include <lambent/scene/procedural.h>

#include <atomic>

namespace lambent::bench {
namespace {

constexpr int runs = 3;

struct Mapped {
  Scene scene;
  Atlas atlas;
  Receivers receivers;
};
std::optional<Mapped> map_scene(Scene scene, double texels) {
  double area = 0;
  for (const Triangle& t : scene.triangles) area += 0.5 * double(length(area_normal(scene, t))) * (1 + t.two_sided);
  Mapped m{std::move(scene), {}, {}};
  auto atlas = make_atlas(m.scene, {.texels_per_unit = float(std::sqrt(texels / area))});
  if (!atlas) {
    std::fprintf(stderr, "skipped: %s\n", atlas.error().text().c_str());
    return std::nullopt;
  }
  m.atlas = std::move(*atlas);
  m.receivers = make_texel_receivers(m.scene, m.atlas);
  return m;
}

// Seconds of tracing the closest hits of all receivers' fans and nothing else: packets of 16, Embree's best for them.
double raw_seconds(const Tracer& tracer, const Receivers& receivers, const DirectionSets& sets) {
  std::atomic<size_t> hits{0};
  const double seconds = least_seconds(runs, [&] {
    parallel_for(receivers.count(), gather_block, [&](size_t begin, size_t end) {
      AlignedVector<float> x(sets.stride), y(sets.stride), z(sets.stride);
      std::vector<Hit> found(size_t(sets.samples));
      for (size_t r = begin; r < end; ++r) {
        const DirectionChoice c = choose_directions(sets, receivers.normals[r], 1, r);
        const size_t base = size_t(c.set) * sets.stride;
        rotate_directions(c.rotation, sets.x.data() + base, sets.y.data() + base, sets.z.data() + base, sets.stride,
                          x.data(), y.data(), z.data());
        tracer.closest_fan(receivers.origins[r], {x.data(), y.data(), z.data(), found.size()}, found.data());
        hits += found[0].triangle != none;
      }
    });
  });
  if (hits == 0) std::fprintf(stderr, "no ray hit anything\n");
  return seconds;
}

void bench_operator(const std::string& name, Scene scene) {
  constexpr int samples = 1024;
  auto m = map_scene(std::move(scene), 25000);
  if (!m) return;
  auto tracer = Tracer::build(m->scene);
  const GatherSetup setup = make_gather_setup(m->scene, *tracer, m->receivers, 1, samples, 1);
  const double raw = raw_seconds(*tracer, m->receivers, setup.sets),
               rays = double(m->receivers.count()) * samples / 1e6;
  std::optional<GatherOperator> op;
  const double traced =
      least_seconds(runs, [&] { op = *GatherOperator::trace(setup, nullptr, nullptr, true, size_t{8} << 30); });
  const nlohmann::json about{
      {"scene", name}, {"texels", m->receivers.count()}, {"samples", samples}, {"channels", setup.channels}};
  auto with = [&](nlohmann::json more) {
    nlohmann::json j = about;
    j.update(more);
    return j;
  };
  report("radiosity_trace", rays / traced, rays / raw, "Mrays/s", "raw Embree closest hits, same rays",
         with({{"operator_bytes_per_texel", double(op->report().bytes) / double(m->receivers.count())},
               {"aim", ">= 0.8"}}));
  auto apply_seconds = [&](size_t columns) {
    const size_t width = pad_lanes(columns);
    AlignedVector<float> x(m->receivers.count() * width, 0.5f), y(x.size());
    return least_seconds(runs, [&] { op->apply(x.data(), width, y.data()); });
  };
  const double one = apply_seconds(3), many = apply_seconds(64 * 3);
  report("radiosity_bounce", one, traced, "s", "tracing at 1,024 rays", with({{"aim", "<= 0.03"}}));
  report("radiosity_64_groups", many, one, "s", "one group's bounce", with({{"aim", "<= 2"}}));
}

// A whole bake of a building, at two sizes: the cost of a texel should not grow.
void bench_growth() {
  double first = 0;
  for (double texels : {250e3, 1e6}) {
    auto scene = data_scene("zdm2_level.glb", false);
    if (!scene) return;
    auto start = std::chrono::steady_clock::now();
    auto seconds = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); };
    auto m = map_scene(std::move(*scene), texels);
    if (!m) return;
    const double atlas_seconds = seconds();
    auto tracer = Tracer::build(m->scene);
    const Environment sky =
        make_environment("sky", 64, 32, [](Vec3 d) { return Vec3(0.5f, 0.7f, 1) * std::max(0.0f, d.y) + Vec3(0.1f); });
    const Lamps lamps = make_lamps(m->scene, &sky, false);
    LightmapReport r;
    start = std::chrono::steady_clock::now();
    auto map = bake_lightmap(m->scene, *tracer, m->receivers, lamps, {.samples = 256, .lamp_samples = 16, .bounces = 4},
                             false, &r);
    if (!map) return;
    const double each = seconds() / double(m->receivers.count()) * 1e6;
    if (first == 0) first = each;
    report("radiosity_texel", each, first, "us", "a texel of the smaller bake",
           {{"scene", "zdm2_level.glb"},
            {"texels", m->receivers.count()},
            {"samples", 256},
            {"bounces", 4},
            {"texels_per_second", 1e6 / each},
            {"atlas", std::to_string(m->atlas.width) + "x" + std::to_string(m->atlas.height)},
            {"charts", m->atlas.charts},
            {"atlas_s", atlas_seconds},
            {"trace_s", r.trace_seconds},
            {"bounce_s", r.bounce_seconds},
            {"operator_bytes", r.operator_bytes},
            {"operator_kept", r.operator_kept}});
  }
}

}  // namespace

void bench_radiosity() {
  bench_operator("courtyard", make_courtyard());
  if (auto scene = data_scene("zdm2_level.glb", false)) bench_operator("zdm2_level.glb", std::move(*scene));
}

void bench_lightmaps() { bench_growth(); }

}  // namespace lambent::bench
