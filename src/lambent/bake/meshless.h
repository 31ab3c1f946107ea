#pragma once
// Kernels about surfels as a basis of fields on surfaces: as dense as light wants them, whatever the mesh, looked up at
// its vertices. Source: radiosity, "meshless basis functions".
#include <lambent/bake/surfels.h>
#include <lambent/receivers/receivers.h>

namespace lambent {

// Of every receiver; those that see no surfel, inside something, have a neighbour's along the mesh, layer by layer.
struct ReadKernels {
  std::vector<Kernels> kernels;
  size_t buried = 0, unread = 0;  // that saw none; and those without such a neighbour, which read nothing
};
ReadKernels read_kernels(const Scene& scene, const SurfelSearch& search, const Receivers& receivers);

// The leaves of a hierarchy of about `count` surfels (SurfelOptions) as receivers, looked up by `vertices`. Errors:
// those of make_surfels().
Result<Receivers> make_point_receivers(const Scene& scene, const Tracer& tracer, const Receivers& vertices,
                                       size_t count, uint32_t seed, Progress* progress = nullptr);

}  // namespace lambent
