// Time a receiver as the scene grows: the same courtyard at finer and finer tessellation.
#include "bench.h"

#include <lambent/bake/bake.h>
#include <lambent/scene/procedural.h>

namespace lambent::bench {

void bench_scaling() {
  double first = 0;
  for (float detail : {0.6f, 1.0f, 2.0f, 3.9f}) {
    const Scene scene = make_courtyard(detail);
    auto tracer = Tracer::build(scene);
    if (!tracer) return;
    const Receivers receivers = make_vertex_receivers(scene);
    BakeOptions options;
    options.samples = 256, options.bounces = 2;
    BakeReport r;
    const double seconds = least_seconds(2, [&] { (void)bake(scene, *tracer, receivers, options, &r); });
    const double each = 1e6 * seconds / double(receivers.count());
    if (first == 0) first = each;
    report("bake_scaling", each, first, "us a receiver", "the smallest of these scenes",
           {{"receivers", receivers.count()}, {"triangles", scene.triangles.size()}, {"samples", options.samples}, {"bounces", options.bounces},
            {"operator_kept", r.operator_kept}, {"aim", "<= 1.3"}});
  }
}

}  // namespace lambent::bench
