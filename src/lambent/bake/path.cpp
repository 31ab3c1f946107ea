#include <lambent/bake/path.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

namespace lambent {

PathEnd follow_path(const Scene& scene, const Tracer& tracer, const Reflection& reflection, Vec3 direction,
                    const Hit& first, int reflections, uint64_t key, uint32_t index) {
  PathEnd end{false, Vec3(1), direction};
  Hit hit = first;
  for (int bounce = 0; bounce < reflections; ++bounce) {
    const Triangle& triangle = scene.triangles[hit.triangle];
    if (!hit.front && !triangle.two_sided) break;
    const Vec3 ng = unit_normal(scene, triangle) * (hit.front ? 1.0f : -1.0f);
    Vec3 n = normalize_or(interpolate(scene.normals, triangle, hit.u, hit.v), ng);
    if (dot(n, ng) < 0) n = -n;
    const Mat3 frame = shading_frame(scene, triangle, n);
    // Where the shading normal turns away from the ray while the surface does not, wo is lifted to its horizon.
    constexpr float lowest = 1e-4f;
    Vec3 wo = -end.direction * frame;
    if (wo.z < lowest) wo = normalize(Vec3(wo.x, wo.y, lowest));

    const BrdfSample next = sample(surface_brdf(scene, reflection, triangle, hit.u, hit.v), wo,
                                   sobol_owen(index, uint32_t(hash64(key, uint64_t(bounce)))));
    if (!(next.pdf > 0)) break;
    end.direction = frame * next.wi, end.throughput *= next.weight;
    if (dot(ng, end.direction) <= 0 || end.throughput == Vec3(0)) break;
    const Vec3 p = interpolate(scene.positions, triangle, hit.u, hit.v);
    // Clear of the surface by more than the rounding of p, which grows with coordinates and edges.
    const Vec3 size = abs(p) + abs(scene.positions[triangle.v[1]] - p) + abs(scene.positions[triangle.v[2]] - p);
    Passage passage;
    hit = tracer.closest(p + ng * (1e-5f * std::max({size.x, size.y, size.z})), end.direction, passage);
    end.throughput *= passage.hit;
    if (hit.triangle == none) {
      end.leaves = true;
      break;
    }
  }
  return end;
}

}  // namespace lambent
