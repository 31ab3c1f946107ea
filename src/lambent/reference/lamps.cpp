// Light sampling over areas: P. Shirley, C. Wang and K. Zimmerman, "Monte Carlo techniques for direct lighting
// calculations", 1996.
#include <lambent/reference/lamps.h>
#include <lambent/scene/see_through.h>

#include <algorithm>

namespace lambent::reference {
namespace {

// Without its texture: what densities follow.
Vec3 material_emission(const Scene& scene, const Triangle& t) {
  return scene.materials[scene.parts[t.part].material].emissive;
}

double weight(Vec3 radiance) { return double(std::max({radiance.x, radiance.y, radiance.z})); }

// Area density of a triangle's points in all draws.
double area_density(const EmitterSampler& s, Vec3 radiance) { return weight(radiance) / s.cdf.back(); }

}  // namespace

EmitterSampler make_emitter_sampler(const Scene& scene) {
  EmitterSampler s;
  s.scene = &scene;
  s.cdf.push_back(0);
  for (uint32_t i = 0; i < scene.triangles.size(); ++i) {
    const double area = 0.5 * double(length(area_normal(scene, scene.triangles[i]))),
                 w = weight(material_emission(scene, scene.triangles[i]));
    if (!(area * w > 0)) continue;
    s.triangles.push_back(i), s.cdf.push_back(s.cdf.back() + area * w);
  }
  return s;
}

EmitterSample sample_emitter(const EmitterSampler& s, Vec3 point, float pick, Vec2 u) {
  if (s.triangles.empty()) return {};
  const double target = double(pick) * s.cdf.back();
  const size_t i = std::min(size_t(std::upper_bound(s.cdf.begin() + 1, s.cdf.end(), target) - s.cdf.begin()) - 1,
                            s.triangles.size() - 1);
  const Triangle& t = s.scene->triangles[s.triangles[i]];
  const float root = std::sqrt(1 - u.x);
  const Hit hit{s.triangles[i], 1 - root, u.y * root};
  const SurfacePoint at = surface_point(*s.scene, hit);
  const Vec3 to = at.position - point;
  EmitterSample sample;
  sample.distance = length(to);
  if (!(sample.distance > 0)) return {};
  sample.direction = to / sample.distance;
  sample.radiance = emitted(*s.scene, hit, sample.direction) * coverage(*s.scene, t, hit.u, hit.v);
  const float facing = std::abs(dot(at.ng, sample.direction));
  if (sample.radiance == Vec3(0) || !(facing > 0)) return {};
  sample.pdf = float(area_density(s, material_emission(*s.scene, t)) * double(sample.distance) *
                     double(sample.distance) / double(facing));
  return sample;
}

Vec3 emitted(const Scene& scene, const Hit& hit, Vec3 d) {
  const Triangle& t = scene.triangles[hit.triangle];
  const bool front = dot(area_normal(scene, t), d) < 0;
  return front || t.two_sided ? emission(scene, t, hit.u, hit.v) : Vec3(0);
}

float emitter_pdf(const EmitterSampler& s, const Hit& hit, Vec3 point, Vec3 d) {
  const Triangle& t = s.scene->triangles[hit.triangle];
  const SurfacePoint at = surface_point(*s.scene, hit);
  const Vec3 to = at.position - point;
  const double facing = double(std::abs(dot(at.ng, d)));
  return facing > 0 ? float(area_density(s, material_emission(*s.scene, t)) * double(dot(to, to)) / facing) : 0.0f;
}

}  // namespace lambent::reference
