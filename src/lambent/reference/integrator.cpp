// Path tracing with next-event estimation: J. Kajiya, "The rendering equation", 1986; multiple importance sampling by
// the power heuristic: E. Veach and L. Guibas, "Optimally combining sampling techniques", 1995. Padded Sobol' pairs in
// shuffled order: B. Burley, "Practical hash-based Owen scrambling", 2020, section 5; the hash: N. Vegdahl, "Building a
// better LK hash", 2021.
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/reference/integrator.h>
#include <lambent/scene/lights.h>

#include <bit>

namespace lambent::reference {
namespace {

// Power heuristic, exponent 2, from the ratio so that large densities do not overflow.
float mis_weight(float pdf, float other) {
  float ratio = other / pdf;
  return 1 / (1 + ratio * ratio);
}

uint32_t reverse_bits(uint32_t x) {
  x = (x << 16) | (x >> 16);
  x = ((x & 0x00ff00ffu) << 8) | ((x & 0xff00ff00u) >> 8);
  x = ((x & 0x0f0f0f0fu) << 4) | ((x & 0xf0f0f0f0u) >> 4);
  x = ((x & 0x33333333u) << 2) | ((x & 0xccccccccu) >> 2);
  return ((x & 0x55555555u) << 1) | ((x & 0xaaaaaaaau) >> 1);
}

// Flips every bit by a hash of the bits above it: the lowest k bits of the result permute those of x within each
// aligned run of 2^k numbers, so runs of a power of two stay together.
uint32_t shuffled(uint32_t x, uint32_t seed) {
  x = reverse_bits(x);
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16) | 1;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return reverse_bits(x);
}

// Pairs of random numbers for lamps lie beyond those of the paths.
constexpr uint32_t lamp_pairs = 1000;

bool black(Vec3 c) { return c.x == 0 && c.y == 0 && c.z == 0; }

// Light that reaches the vertex straight from the scene's lamps and leaves towards wo.
Vec3 light_from_lamps(const Integrator& integrator, const PathVertex& vertex, const PathSamples& samples,
                      uint32_t depth) {
  Vec3 sum(0);
  // Shadow rays end at the lamp: a nearer hit hides it. Lamps are met from afar, so a relative margin will do.
  constexpr float margin = 1e-4f;
  auto reaching = [&](Vec3 d, float distance) {  // share
    if (integrator.intersector.lets_pass())
      return integrator.intersector.transmitted(vertex.position, d, distance * (1 - margin));
    Hit hit;
    if (!integrator.intersector.nearest(vertex.position, d, hit)) return Vec3(1);
    const float to_hit = length(surface_point(*integrator.scene, hit).position - vertex.position);
    return Vec3(to_hit >= distance * (1 - margin) ? 1.0f : 0.0f);
  };
  const EmitterSample e = sample_emitter(integrator.emitters, vertex.position, samples.pair(lamp_pairs + 2 * depth).x,
                                         samples.pair(lamp_pairs + 2 * depth + 1));
  if (e.pdf > 0 && dot(vertex.ng, e.direction) > 0) {
    const Vec3 wi = e.direction * vertex.frame, f = evaluate(vertex.brdf, wi, vertex.wo);
    const Vec3 share = black(f) ? Vec3(0) : reaching(e.direction, e.distance);
    if (!black(share)) {
      const float weight =
          integrator.strategy == Strategy::combined ? mis_weight(e.pdf, pdf(vertex.brdf, wi, vertex.wo)) : 1.0f;
      sum += share * f * e.radiance * (wi.z * weight / e.pdf);
    }
  }
  for (const PunctualLight& light : integrator.scene->lights) {
    const LampArrival a = arriving(light, vertex.position);
    if (black(a.irradiance) || dot(vertex.ng, a.direction) <= 0) continue;
    const Vec3 wi = a.direction * vertex.frame, f = evaluate(vertex.brdf, wi, vertex.wo);
    if (!black(f)) sum += reaching(a.direction, a.distance) * f * a.irradiance * wi.z;
  }
  return sum;
}

// Of the sky's light along d, what arrives.
Vec3 from_sky(const Integrator& integrator, Vec3 position, Vec3 d) {
  if (integrator.intersector.lets_pass()) return integrator.intersector.transmitted(position, d, INFINITY);
  return Vec3(integrator.intersector.occluded(position, d) ? 0.0f : 1.0f);
}

}  // namespace

PathSamples::PathSamples(uint64_t key, uint32_t index, uint32_t count)
    : key(key), index(index), mask(std::bit_ceil(std::max(count, 1u)) - 1) {}

Vec2 PathSamples::pair(uint32_t dimension) const {
  uint64_t seed = hash64(key, dimension);
  return sobol_owen(shuffled(index, uint32_t(seed)) & mask, uint32_t(seed >> 32));
}

Result<Integrator> make_integrator(const Scene& scene, const Environment& env, int bounces, Strategy strategy,
                                   const Reflection& reflection, bool lamps) {
  if (env.image.width < 1 || env.image.height < 1) return Error{env.name, "the environment is empty"};
  Result<Intersector> intersector = Intersector::make(scene);
  if (!intersector) return intersector.error();
  return Integrator{&scene,
                    &env,
                    *intersector,
                    make_environment_sampler(env),
                    bounces,
                    strategy,
                    reflection,
                    lamps,
                    lamps ? make_emitter_sampler(scene) : EmitterSampler{}};
}

bool make_vertex(const Integrator& integrator, const Hit& hit, Vec3 d, PathVertex& vertex) {
  const Scene& scene = *integrator.scene;
  const Triangle& triangle = scene.triangles[hit.triangle];
  SurfacePoint s = surface_point(scene, hit);
  bool front = dot(s.ng, d) < 0;
  if (!front && !triangle.two_sided) return false;
  vertex.ng = front ? s.ng : -s.ng;
  vertex.position = s.position + vertex.ng * s.offset;
  Vec3 n = normalize_or(interpolate(scene.normals, triangle, hit.u, hit.v), s.ng);
  if (dot(n, s.ng) < 0) n = -n;
  if (integrator.reflection.normal_maps) n = mapped_normal(scene, triangle, hit.u, hit.v, n);
  if (!front) n = -n;
  vertex.frame = shading_frame(scene, triangle, n);
  // Near silhouettes the shading normal can turn away from the eye while the surface does not: lift wo to its horizon,
  // so that such places are not black.
  vertex.wo = -d * vertex.frame;
  constexpr float lowest = 1e-4f;
  if (vertex.wo.z < lowest) vertex.wo = normalize(Vec3(vertex.wo.x, vertex.wo.y, lowest));
  vertex.brdf = surface_brdf(scene, integrator.reflection, triangle, hit.u, hit.v);
  return true;
}

bool meets(const Integrator& integrator, Vec3 origin, Vec3 d, bool camera, const PathSamples& samples, uint32_t depth,
           Hit& hit, Vec3& weight) {
  weight = Vec3(1);
  if (!integrator.intersector.lets_pass())
    return camera ? integrator.intersector.nearest_visible(origin, d, hit)
                  : integrator.intersector.nearest(origin, d, hit);
  // Diffuse glass that passes everything reflects nothing; other models have a glint of their own.
  const Reflection& r = integrator.reflection;
  const bool plain = r.model == Reflection::Model::diffuse && !r.everywhere && r.named.empty();
  const uint64_t key = hash64(hash64(samples.key, samples.index), 0x91a55u + uint64_t(depth));
  return integrator.intersector.met(origin, d, camera, plain ? 1.0f : 0.75f, key, hit, weight);
}

PathVertex white_vertex(Vec3 origin, Vec3 n) { return {origin, n, frame_about(n), Vec3(0, 0, 1), Lambert{Vec3(1)}}; }

Vec3 exit_radiance_estimate(const Integrator& integrator, PathVertex vertex, const PathSamples& samples) {
  const Strategy strategy = integrator.strategy;
  Vec3 sum(0), throughput(1);
  for (int depth = 0;; ++depth) {
    const Vec3 wo = vertex.wo;
    const bool counts = integrator.direct || depth > 0;
    if (counts && strategy != Strategy::brdf_only) {
      EnvironmentSample light = sample_environment(integrator.sampler, samples.pair(uint32_t(2 * depth + 1)));
      if (light.pdf > 0 && dot(vertex.ng, light.direction) > 0) {
        Vec3 wi = light.direction * vertex.frame;
        const auto [f, density] = evaluate_with_pdf(vertex.brdf, wi, wo);
        const Vec3 share = black(f) ? Vec3(0) : from_sky(integrator, vertex.position, light.direction);
        if (!black(share)) {
          float weight = strategy == Strategy::combined ? mis_weight(light.pdf, density) : 1.0f;
          sum += throughput * share * f * light.radiance * (wi.z * weight / light.pdf);
        }
      }
    }
    if (counts && integrator.lamps && strategy != Strategy::brdf_only)
      sum += throughput * light_from_lamps(integrator, vertex, samples, uint32_t(depth));
    const bool last = depth == integrator.bounces;
    if (last && strategy == Strategy::light_only) break;
    BrdfSample next = sample(vertex.brdf, wo, samples.pair(uint32_t(2 * depth + 2)));
    if (!(next.pdf > 0)) break;
    Vec3 d = vertex.frame * next.wi;
    if (dot(vertex.ng, d) <= 0) break;
    throughput *= next.weight;
    if (black(throughput)) break;
    Hit hit;
    Vec3 weight_met;
    bool leaves;
    if (integrator.intersector.lets_pass()) {
      leaves = !meets(integrator, vertex.position, d, false, samples, uint32_t(depth + 1), hit, weight_met);
      throughput *= weight_met;
    } else {
      leaves = last && !integrator.lamps ? !integrator.intersector.occluded(vertex.position, d)
                                         : !integrator.intersector.nearest(vertex.position, d, hit);
    }
    if (counts && leaves && strategy != Strategy::light_only) {
      float weight = strategy == Strategy::combined ? mis_weight(next.pdf, environment_pdf(integrator.sampler, d))
                                                    : 1.0f;
      sum += throughput * radiance(*integrator.environment, d) * weight;
    }
    if (counts && integrator.lamps && !leaves && strategy != Strategy::light_only) {
      const Vec3 radiance = emitted(*integrator.scene, hit, d);
      if (!black(radiance)) {
        const float weight = strategy == Strategy::combined
                               ? mis_weight(next.pdf, emitter_pdf(integrator.emitters, hit, vertex.position, d))
                               : 1.0f;
        sum += throughput * radiance * weight;
      }
    }
    if (leaves || last || !make_vertex(integrator, hit, d, vertex)) break;
  }
  return sum;
}

}  // namespace lambent::reference
