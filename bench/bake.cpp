// The bake against Embree itself on the same rays: same origins, same sorted and spun directions, nothing done with the
// answer. The limit is the best of Embree's entry points in this run. Not measured here: loading, writing.
#include "embree.h"

#include <lambent/bake/bake.h>
#include <lambent/bake/materials.h>
#include <lambent/scene/procedural.h>

#include <cstdlib>

namespace lambent::bench {
namespace {

constexpr int samples = 1024, order = 6, runs = 3;

void bake_scene(const std::string& name, const Scene& scene) {
  auto tracer = Tracer::build(scene);
  if (!tracer) return;
  const RawScene raw(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  const DirectionSets sets = make_direction_sets(order, samples, 8, 1);
  const double rays = double(receivers.count()) * samples / 1e6;
  auto time = [&](auto f) {
    return raw_seconds(runs, receivers, sets, [&](Vec3 o, const float* x, const float* y, const float* z, size_t n) {
      return f(raw.scene, o, x, y, z, n);
    });
  };
  const double stream = time(occluded_stream), packet = time(packets<false>);
  const double closest_packet = time(packets<true>), closest_m = time(closest_stream);
  const double occluded = std::min(stream, packet), closest = std::min(closest_packet, closest_m);
  const nlohmann::json about{{"scene", name},
                             {"receivers", receivers.count()},
                             {"triangles", scene.triangles.size()},
                             {"samples", samples},
                             {"order", order}};
  auto with = [&](nlohmann::json more) {
    nlohmann::json j = about;
    j.update(more);
    return j;
  };
  auto bake_seconds = [&](int bounces, BakeReport& report) {
    BakeOptions options;  // the gather alone
    options.denoise = options.certify = false;
    options.bounces = bounces, options.order = order, options.samples = samples;
    return least_seconds(runs, [&] { (void)bake(scene, *tracer, receivers, options, &report); });
  };
  BakeReport r0, r1, r3;
  auto matrix_seconds = [&](int bounces) {
    const BakeOptions options{.order = 5, .samples = samples, .bounces = bounces, .denoise = false, .certify = false};
    const ReceiverMaterials materials =
        make_receiver_materials(scene, receivers, {.everywhere = Ggx{.alpha = Vec2(0.16f)}});
    return least_seconds(
        runs, [&] { (void)bake_matrix(scene, *tracer, receivers, materials, options, {.response_samples = 256}); });
  };
  const double b0 = bake_seconds(0, r0), b1 = bake_seconds(1, r1), b3 = bake_seconds(3, r3);
  report("bake_direct", rays / b0, rays / occluded, "Mrays/s", "best raw Embree occlusion, same rays",
         with({{"raw_stream", rays / stream}, {"raw_packets", rays / packet}, {"aim", ">= 0.8"}}));
  report("bake_1_bounce", b1, closest, "s", "raw Embree closest hits, same rays",
         with({{"raw_stream_s", closest_m},
               {"raw_packets_s", closest_packet},
               {"trace_s", r1.trace_seconds},
               {"bounce_s", r1.bounce_seconds},
               {"aim", "<= 1.35"}}));
  report("bake_3_bounces", b3, b1, "s", "the bake with 1 bounce",
         with({{"operator_bytes_per_receiver", double(r3.operator_bytes) / double(receivers.count())},
               {"bounce_s", r3.bounce_seconds},
               {"aim", "<= 1.15"}}));
  const double m0 = matrix_seconds(0), m1 = matrix_seconds(1);
  report("bake_matrix_direct", rays / m0, rays / occluded, "Mrays/s", "best raw Embree occlusion, same rays",
         with({{"order", 5}, {"incident_order", 5}, {"outgoing", "svd:6"}, {"aim", ">= 0.5"}}));
  report("bake_matrix_1_bounce", rays / m1, rays / closest, "Mrays/s", "raw Embree closest hits, same rays",
         with({{"order", 5}, {"incident_order", 5}, {"outgoing", "svd:6"}}));
}

}  // namespace

// ONLY=courtyard, say, in the environment leaves the other scenes out.
void bench_bake() {
  const char* only = std::getenv("ONLY");
  auto wanted = [&](const std::string& name) { return !only || name.starts_with(only); };
  for (const char* name : {"bunny.obj", "armadillo.obj"})
    if (wanted(name))
      if (auto scene = data_scene(name, true)) bake_scene(std::string(name) + " --ground", *scene);
  if (wanted("courtyard")) bake_scene("courtyard", make_courtyard());
}

}  // namespace lambent::bench
