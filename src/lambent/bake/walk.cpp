#include <lambent/bake/walk.h>
#include <lambent/core/sampling.h>

namespace lambent {
namespace {

bool is_grey(Vec3 c) { return c.x == c.y && c.y == c.z; }

Vec3 scatter(Vec3 d, float g, Random& random) {
  const Vec2 u = random.next2();
  const float q = (1 - g * g) / (1 - g + 2 * g * u.x);
  const float cosine = std::clamp(std::abs(g) < 1e-3f ? 1 - 2 * u.x : (1 + g * g - q * q) / (2 * g), -1.0f, 1.0f);
  const float sine = std::sqrt(1 - cosine * cosine);
  return normalize(frame_about(d) * Vec3(sine * std::cos(2 * pi * u.y), sine * std::sin(2 * pi * u.y), cosine));
}

}  // namespace

Vec3 refract(Vec3 d, Vec3 n, float ratio) {
  const float cosine = dot(d, n);
  const Vec3 along = ratio * (d - cosine * n);
  return normalize(along + std::sqrt(std::max(0.0f, 1 - dot(along, along))) * n);
}

Vec3 Walker::beside(const Hit& hit, Vec3 normal, float up) const {
  const Triangle& t = scene.triangles[hit.triangle];
  const Vec3 p = interpolate(scene.positions, t, hit.u, hit.v);
  const Vec3 size = abs(p) + abs(scene.positions[t.v[1]] - p) + abs(scene.positions[t.v[2]] - p);
  return p + normal * (up * 1e-5f * largest(size));
}

Vec3 Walker::normal(const Hit& hit) const { return unit_normal(scene, scene.triangles[hit.triangle]); }

bool Walker::keep(Vec3& p) const {
  if (options.period > 0) {
    p.x -= options.period * std::floor(p.x / options.period), p.y -= options.period * std::ceil(p.y / options.period);
    return p.z <= box.max.z;
  }
  return all_at_most(box.min, p) && all_at_most(p, box.max);
}

WalkEnd Walker::walk(Vec3 p, Vec3 d, Random& random, size_t& events) const {
  int depth = 1;  // how many bodies are around p
  const float eta = options.medium.eta;
  for (int event = 0; event < options.most_events;) {
    float flight = sigma_t > 0 ? -std::log1p(-random.next()) / sigma_t : INFINITY;
    for (bool on_flight = true; on_flight;) {
      if (++event > options.most_events) break;
      ++events;
      const float reach = options.period > 0 ? std::min(flight, options.period) : flight;
      const Hit hit = tracer.closest(p, d, 0, reach);
      if (hit.triangle == none) {
        if (!(reach < INFINITY)) return {WalkEnd::lost, {}, {}};
        p += reach * d, on_flight = reach < flight, flight -= reach;
        if (!keep(p)) return {WalkEnd::lost, {}, {}};
        continue;
      }
      flight -= hit.distance;
      const Vec3 n = normal(hit);
      if (hit.front) {
        ++depth, p = beside(hit, n, -1);
      } else if (--depth > 0) {
        p = beside(hit, n, 1);
      } else if (eta > 1 && random.next() < fresnel_reflectance(dot(d, n), 1 / eta)) {
        depth = 1, d = normalize(d - 2 * dot(d, n) * n), p = beside(hit, n, -1);
      } else {
        return {WalkEnd::left, beside(hit, n, 1), eta > 1 ? refract(d, n, eta) : d};
      }
      if (options.period > 0) keep(p);
      on_flight = flight > 0;
    }
    if (random.next() >= albedo) return {WalkEnd::absorbed, {}, {}};
    d = scatter(d, options.medium.g, random);
  }
  return {WalkEnd::lost, {}, {}};
}

std::vector<Walker> make_walkers(const Scene& scene, const Tracer& tracer, const SubsurfaceOptions& options) {
  const Medium& medium = options.medium;
  const Bounds box = bounds(scene);
  const Vec3 margin(1e-3f * box.diagonal());
  std::vector<Walker> walkers;
  for (int m = 0; m < (is_grey(medium.sigma_s) && is_grey(medium.sigma_a) ? 1 : 3); ++m) {
    const float s = medium.sigma_s[m], t = s + medium.sigma_a[m];
    walkers.push_back({scene, tracer, options, t, t > 0 ? s / t : 1.0f, {box.min - margin, box.max + margin}});
  }
  return walkers;
}

}  // namespace lambent
