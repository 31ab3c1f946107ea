#pragma once
// The error that a bake at vertices has, by a mesh refined twice and many rays: for tests of what bakes say of theirs.
#include <lambent/bake/bake.h>
#include <lambent/scene/refine.h>

#include <cmath>

namespace lambent::test {

// The field against one of a mesh refined twice and many rays, at its vertices, weighed by area, of front sides alone.
inline double true_error(const Scene& coarse, const Receivers& receivers, const Transfer& stored,
                         const BakeOptions& options, int samples = 2048) {
  Scene fine = coarse;
  for (int k = 0; k < 2; ++k) split_edges(fine, [](Vec3, Vec3) { return true; });
  auto tracer = Tracer::build(fine);
  const Receivers at = make_vertex_receivers(fine);
  BakeOptions many = options;
  many.samples = samples, many.seed = 77, many.denoise = many.certify = false;
  auto truth = bake(fine, *tracer, at, many);
  // Where the fine vertices lie on the coarse mesh, by a ray from just above them.
  auto coarse_tracer = Tracer::build(coarse);
  std::vector<double> area(at.count(), 0);
  const auto& corners = std::get<CornerReceivers>(at.basis);
  for (uint32_t t = 0; t < fine.triangles.size(); ++t) {
    const uint32_t* v = fine.triangles[t].v;
    const double share =
        length(cross(fine.positions[v[1]] - fine.positions[v[0]], fine.positions[v[2]] - fine.positions[v[0]])) / 6;
    if (const Corners* c = corners.find(t, true))
      for (uint32_t r : c->receiver) area[r] += share;
  }
  double error2 = 0, truth2 = 0;
  for (size_t r = 0; r < at.count(); ++r) {
    if (!(area[r] > 0)) continue;
    const Hit hit = coarse_tracer->closest(at.origins[r] + 0.01f * at.normals[r], -at.normals[r]);
    const auto& basis = std::get<CornerReceivers>(receivers.basis);
    const Corners* c = hit.triangle == none ? nullptr : basis.find(hit.triangle, hit.front);
    if (!c || hit.distance > 0.02f) continue;
    const std::vector<float> exact = load_receiver(*truth, r);
    std::vector<float> value(exact.size(), 0.0f);
    basis.spread(*c, hit.u, hit.v, [&](uint32_t receiver, float w) {
      const std::vector<float> row = load_receiver(stored, receiver);
      for (size_t k = 0; k < row.size(); ++k) value[k] += w * row[k];
    });
    for (size_t k = 0; k < exact.size(); ++k)
      error2 += area[r] * double(value[k] - exact[k]) * double(value[k] - exact[k]),
          truth2 += area[r] * double(exact[k]) * double(exact[k]);
  }
  return std::sqrt(error2 / truth2);
}

}  // namespace lambent::test
