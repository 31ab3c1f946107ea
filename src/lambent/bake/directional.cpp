// Follows: radiosity, "Discussion 3" ("Spherical Harmonics" and "vector irradiance" are keywords), "Radiosity Normal
// Mapping".
#include <lambent/bake/directional.h>
#include <lambent/bake/fan.h>
#include <lambent/bake/kernels.h>
#include <lambent/core/random.h>

namespace lambent {
namespace {

// A cosine-distributed ray stands for light spread by 1 / cos; grazing ones would weigh without bound.
constexpr float grazing_cosine = 0.02f;
constexpr int most_rows = 9;

template <class Basis>
void gather_on(const GatherSetup& setup, const Basis& basis, const Lamps& lamps, int lamp_samples, DirectionalKind kind,
               const float* x, size_t width, size_t first, size_t count, float* out) {
  const DirectionSets& sets = setup.sets;
  const size_t rays = size_t(sets.samples), rows = size_t(directional_rows(kind));
  AlignedVector<float> dx(sets.stride), dy(sets.stride), dz(sets.stride);
  std::vector<Hit> hits(rays);
  std::vector<Passage> passages(rays);
  const bool passes = setup.tracer.lets_pass();
  std::vector<LampLight> lights;
  std::vector<float> value(width);
  float weights[most_rows];
  for (size_t i = 0; i < count; ++i) {
    const size_t r = first + i;
    const Vec3 normal = setup.receivers.normals[r], origin = setup.receivers.origins[r];
    const Mat3 frame = receiver_frame(normal);
    float* own = out + i * rows * width;
    const DirectionChoice choice = choose_directions(sets, normal, setup.seed, r);
    const size_t base = size_t(choice.set) * sets.stride;
    rotate_directions(choice.rotation, sets.x.data() + base, sets.y.data() + base, sets.z.data() + base, sets.stride,
                      dx.data(), dy.data(), dz.data());
    const Directions directions{dx.data(), dy.data(), dz.data(), rays};
    trace_hits(setup.tracer, origin, directions, hits.data(), passes ? std::span(passages) : std::span<Passage>(),
               setup.progress);
    if (is_cancelled(setup.progress)) return;
    lights.clear();
    sample_lamps(setup.scene, setup.tracer, lamps, origin, normal, lamp_samples, rays, setup.seed, r, lights,
                 setup.progress);
    for (size_t j = 0; j < rays; ++j) {
      if (ends_fan(j, setup.progress)) return;
      const Hit& h = hits[j];
      const Vec3 d(dx[j], dy[j], dz[j]);
      const float cosine = dot(normal, d), share = sets.weights.empty() ? 1.0f : sets.weights[j];
      auto add_light = [&](LampLight light, Vec3 weight) {
        light.value *= share;
        if (passes) light.value *= weight;
        lights.push_back(light);
      };
      const bool open = passes ? passages[j].sky != Vec3(0) : h.triangle == none;
      if (open && lamps.sky) add_light(met_sky(lamps, d, cosine, lamp_samples, rays), passages[j].sky);
      if (h.triangle == none) continue;
      const Triangle& triangle = setup.scene.triangles[h.triangle];
      const uint32_t lamp = lamps.of_triangle.empty() ? none : lamps.of_triangle[h.triangle];
      if (lamp != none && emits(setup.scene, triangle, h.front))
        add_light(met_lamp(setup.scene, lamps, lamp, h, d, cosine, lamp_samples, rays), passages[j].hit);
      const auto* at = basis.find(h.triangle, h.front);
      if (!at || !x) continue;
      std::fill(value.begin(), value.end(), 0.0f);
      basis.spread(*at, h.u, h.v, [&](uint32_t receiver, float w) {
        for (size_t k = 0; k < width; ++k) value[k] += w * x[size_t(receiver) * width + k];
      });
      Vec3 rho = albedo(setup.scene, triangle, h.u, h.v) * (share / float(rays));
      if (passes) rho *= passages[j].hit;
      directional_weights(kind, d, frame, grazing_cosine, weights);
      for (size_t row = 0; row < rows; ++row)
        for (size_t k = 0; k < width; ++k) own[row * width + k] += weights[row] * rho[int(k % 3)] * value[k];
    }
    for (const LampLight& light : lights) {
      directional_weights(kind, light.direction, frame, grazing_cosine, weights);
      for (size_t row = 0; row < rows; ++row)
        for (int c = 0; c < 3; ++c)
          own[row * width + size_t(light.group) * 3 + size_t(c)] += weights[row] * light.value[c];
    }
  }
}

}  // namespace

void gather_directional(const GatherSetup& setup, const Lamps& lamps, int lamp_samples, DirectionalKind kind,
                        const float* x, size_t width, size_t first, size_t count, float* out) {
  std::visit(
      [&](const auto& basis) { gather_on(setup, basis, lamps, lamp_samples, kind, x, width, first, count, out); },
      setup.receivers.basis);
}

}  // namespace lambent
