// Time a receiver as the scene grows: the same courtyard at finer and finer tessellation. Beside it the growth of
// raw closest hits over the same rays, which no bake can escape.
#include "embree.h"

#include <lambent/bake/bake.h>
#include <lambent/scene/procedural.h>

namespace lambent::bench {

void bench_scaling() {
  double first = 0, first_raw = 0;
  for (float detail : {0.6f, 1.0f, 2.0f, 4.0f}) {
    const Scene scene = make_courtyard(detail);
    auto tracer = Tracer::build(scene);
    if (!tracer) return;
    const Receivers receivers = make_vertex_receivers(scene);
    BakeOptions options;  // the gather alone
    options.denoise = options.certify = false;
    options.samples = 256, options.bounces = 2;
    BakeReport r;
    const double seconds = least_seconds(2, [&] { (void)bake(scene, *tracer, receivers, options, &r); });
    const double each = 1e6 * seconds / double(receivers.count());
    const RawScene raw(scene);
    const DirectionSets sets = make_direction_sets(options.order, options.samples, 8, 1);
    const double raw_each =
        1e6 / double(receivers.count()) *
        raw_seconds(2, receivers, sets, [&](Vec3 o, const float* x, const float* y, const float* z, size_t n) {
          return packets<true>(raw.scene, o, x, y, z, n);
        });
    if (first == 0) first = each, first_raw = raw_each;
    report("bake_scaling", each, first, "us a receiver", "the smallest of these scenes",
           {{"receivers", receivers.count()},
            {"triangles", scene.triangles.size()},
            {"samples", options.samples},
            {"bounces", options.bounces},
            {"operator_kept", r.operator_kept},
            {"raw_us", raw_each},
            {"raw_growth", raw_each / first_raw},
            {"trace_us", 1e6 * r.trace_seconds / double(receivers.count())},
            {"bounce_us", 1e6 * r.bounce_seconds / double(receivers.count())},
            {"operator_bytes_per_receiver", double(r.operator_bytes) / double(receivers.count())},
            {"aim", "<= 1.3"}});
  }
}

}  // namespace lambent::bench
