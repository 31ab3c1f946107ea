// What lamps light within a few spacings of surfels is brighter and smaller than those can tell, and so is what it
// sends on to what is near: pixels there gather that part of the first bounce themselves. Two ways of finding it, from
// the pixel and from the lamp, are weighed by the balance heuristic (E. Veach and L. Guibas, "Optimally combining
// sampling techniques for Monte Carlo rendering", 1995).
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/pipeline/draw_indirect.h>
#include <lambent/receivers/receivers.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace lambent {
namespace {

// Spacings of leaves: of what a lamp lights, what pixels gather all of, and beyond which none.
constexpr float lit_full = 6, lit_none = 12;
constexpr size_t rays_of_a_lamp = 1024, candidates = 64, most_near_lamps = 64;
constexpr uint32_t lamp_seed = 0x4ea8;

float fade(float x, float full, float none) {
  const float t = std::clamp((none - x) / (none - full), 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}

Vec3 place_of(const MovingLamp& lamp) {
  return lamp.kind == MovingLamp::Kind::sphere ? lamp.centre : lamp.light.position;
}

// Of the lamp's rays, the part of all directions that they go to.
float spread(const MovingLamp& lamp) {
  return lamp.kind == MovingLamp::Kind::spot ? 0.5f * (1 - std::cos(lamp.light.outer_cone)) : 1.0f;
}

// Places an area's unit that a ray of the lamp's meets, were its way clear.
float density(const MovingLamp& lamp, Vec3 from_lamp, Vec3 face) {
  const float far2 = dot(from_lamp, from_lamp), far = std::sqrt(far2);
  if (!(far > 0)) return 0;
  if (lamp.kind == MovingLamp::Kind::spot &&
      dot(from_lamp, lamp.light.direction) < far * std::cos(lamp.light.outer_cone))
    return 0;
  return std::max(-dot(from_lamp, face) / far, 0.0f) / (4 * pi * spread(lamp) * far2);
}

// What a place that was met sends on of the lamp's light, as far as that is near it: exit radiance.
Vec3 sent_by(const IndirectDrawing& d, const MovingLamp& lamp, const Hit& hit, const SurfacePlace& at, int samples,
             uint64_t key) {
  const Triangle& triangle = d.scene.triangles[hit.triangle];
  if (!hit.front && !triangle.two_sided) return Vec3(0.0f);
  const float share =
      fade(length(at.position - place_of(lamp)) / d.transfer.surfels.spacings.back(), lit_full, lit_none);
  if (!(share > 0)) return Vec3(0.0f);
  const Vec3 origin = at.position + at.normal * receiver_lift(at.position, 0, d.diagonal);
  return share * albedo(d.scene, triangle, hit.u, hit.v) *
         direct_light(d.tracer, lamp, origin, at.normal, samples, key);
}

// Of the side that was met.
Vec3 face_of(const Scene& scene, const Hit& hit, Vec3 normal) {
  const Vec3 face = unit_normal(scene, scene.triangles[hit.triangle], normal);
  return hit.front ? face : -face;
}

void send_rays(const IndirectDrawing& d, NearLamp& near) {
  const MovingLamp& lamp = near.lamp;
  const Vec3 place = place_of(lamp);
  const Mat3 frame = frame_about(lamp.kind == MovingLamp::Kind::spot ? lamp.light.direction : Vec3(0, 0, 1));
  const float depth = 2 * spread(lamp);  // 1 - cosine
  std::vector<NearLamp::Sent> met(rays_of_a_lamp);
  parallel_for(rays_of_a_lamp, 64, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const Vec2 u = sobol_owen(uint32_t(i), lamp_seed);
      const float down = u.x * depth, out = std::sqrt(std::max(down * (2 - down), 0.0f)), turn = 2 * pi * u.y;
      const Vec3 direction = frame * Vec3(out * std::cos(turn), out * std::sin(turn), 1 - down);
      const Hit hit = d.tracer.closest(place, direction, 0, lit_none * d.transfer.surfels.spacings.back());
      if (hit.triangle == none) continue;
      const SurfacePlace at = surface_place(d.scene, hit);
      const Vec3 face = face_of(d.scene, hit, at.normal);
      met[i] = {at.position, face, sent_by(d, lamp, hit, at, IndirectQuality().lamp_samples, hash64(i, lamp_seed)),
                density(lamp, at.position - place, face)};
    }
  });
  for (const NearLamp::Sent& s : met)
    if (largest(s.light) > 0 && s.density > 0) near.sent.push_back(s);
  if (!near.sent.empty()) near.scale = float(rays_of_a_lamp) / float(near.sent.size());
}

// What `candidates` of the places that a lamp's rays met give a pixel, were their ways clear; rays go to few of them,
// drawn by that.
struct Drawn {
  std::array<Vec3, candidates> ways, values;
  std::array<float, candidates> upto;  // sums of magnitudes
  float sum = 0;
};

void draw(const IndirectDrawing& d, const NearLamp& near, Vec3 origin, Vec3 normal, Vec3 above, float rays,
          uint64_t key, Drawn& out) {
  const size_t count = near.sent.size(), start = hash64(key, lamp_seed) % count;
  for (size_t i = 0; i < candidates; ++i) {
    const NearLamp::Sent& s = near.sent[(start + i * count / candidates) % count];
    const Vec3 way = s.position + s.face * receiver_lift(s.position, 0, d.diagonal) - origin;
    const float far = length(way), seen = dot(way, normal) / far, turned = -dot(way, s.face) / far;
    out.values[i] = Vec3(0.0f);
    if (far > 0 && dot(way, above) > 0 && seen > 0 && turned > 0) {
      const float of_pixel = seen * turned / (pi * far * far);
      out.values[i] = s.light * (of_pixel / (float(candidates) * near.scale * s.density + rays * of_pixel));
    }
    out.ways[i] = way, out.upto[i] = out.sum += out.values[i].x + out.values[i].y + out.values[i].z;
  }
}

// Exit radiance of a white surface by what the lamp lights near it: `samples` rays towards places that its rays met,
// and as many by the cosine.
Vec3 gather(const IndirectDrawing& d, const NearLamp& near, Vec3 origin, Vec3 normal, Vec3 above, int samples,
            uint64_t key) {
  const Vec3 place = place_of(near.lamp);
  const float rays = float(samples);
  Vec3 sum(0.0f);
  Drawn drawn;
  draw(d, near, origin, normal, above, rays, key, drawn);
  Random random(key, lamp_seed);
  for (int i = 0; i < samples && drawn.sum > 0; ++i) {
    const float at = (float(i) + random.next()) / rays * drawn.sum;
    const auto k = std::min(size_t(std::upper_bound(drawn.upto.begin(), drawn.upto.end(), at) - drawn.upto.begin()),
                            candidates - 1);
    const Vec3 value = drawn.values[k];
    const float magnitude = value.x + value.y + value.z, far = length(drawn.ways[k]);
    if (magnitude > 0 && d.tracer.closest(origin, drawn.ways[k] / far, 0, far).triangle == none)
      sum += value * (drawn.sum / (magnitude * rays));
  }
  const Mat3 frame = frame_about(normal);
  for (int i = 0; i < samples; ++i) {
    const Vec3 local = square_to_cosine_hemisphere(sobol_owen(uint32_t(i), uint32_t(hash64(key, lamp_seed + 1))));
    const Vec3 direction = frame * local;
    if (dot(direction, above) <= 0) continue;
    const Hit hit = d.tracer.closest(origin, direction);
    if (hit.triangle == none) continue;
    const SurfacePlace at = surface_place(d.scene, hit);
    const Vec3 light = sent_by(d, near.lamp, hit, at, 1, hash64(key, size_t(i) + 1));
    if (!(largest(light) > 0)) continue;
    const Vec3 face = face_of(d.scene, hit, at.normal), way = at.position - place;
    float of_lamp = near.scale * density(near.lamp, way, face);
    // Rays from a sphere's middle do not come to all that it lights.
    if (of_lamp > 0 && near.lamp.kind == MovingLamp::Kind::sphere) {
      const float far = length(way);
      if (d.tracer.closest(place, way / far, 0, far - receiver_lift(at.position, 0, d.diagonal)).triangle != none)
        of_lamp = 0;
    }
    const float of_pixel = local.z * std::max(-dot(direction, face), 0.0f) / (pi * hit.distance * hit.distance);
    if (of_pixel > 0) sum += light * (of_pixel / (float(candidates) * of_lamp + rays * of_pixel));
  }
  return sum;
}

// The scene's own lights that stand somewhere, as they are scaled.
std::vector<MovingLamp> own_lamps(const IndirectDrawing& d) {
  std::vector<MovingLamp> out;
  for (const PunctualLight& light : d.scene.lights) {
    if (light.kind == PunctualLight::Kind::directional) continue;
    MovingLamp lamp;
    lamp.kind = light.kind == PunctualLight::Kind::spot ? MovingLamp::Kind::spot : MovingLamp::Kind::point;
    lamp.light = light, lamp.light.intensity = d.still.scale_of(light.name) * light.intensity;
    if (largest(lamp.light.intensity) > 0) out.push_back(lamp);
  }
  return out;
}

void part(IndirectDrawing& d, const MovingLamp& lamp, const LitLamp* lit, std::vector<NearLamp>& known) {
  const size_t behind = lit ? lit->behind : 0;
  const auto same = std::find_if(known.begin(), known.end(),
                                 [&](const NearLamp& n) { return n.behind == 0 && is_same(n.lamp, lamp); });
  if (same != known.end() && behind == 0) return d.near.push_back(std::move(*same));
  const std::vector<Vec3>& positions = d.transfer.surfels.positions;
  std::vector<float> shares(positions.size());
  std::vector<uint32_t> leaves;
  for (size_t i = 0; i < positions.size(); ++i) {
    const float distance = length(positions[i] - place_of(lamp)) / d.transfer.surfels.spacings.back();
    if ((shares[i] = fade(distance, lit_full, lit_none)) > 0) leaves.push_back(uint32_t(i));
  }
  NearLamp near{lamp, {}, 1, std::vector<Vec3>(d.transfer.gathering()), behind};
  if (!leaves.empty()) send_rays(d, near);
  if (!near.sent.empty()) {
    std::vector<Vec3> light(positions.size(), Vec3(0.0f));
    if (lit) {
      for (const uint32_t i : leaves) light[i] = lit->at_leaves[i];
    } else {
      light_some_leaves(d, lamp, leaves, light);
    }
    for (const uint32_t i : leaves) light[i] = shares[i] * light[i];
    gather_indirect(d.transfer, d.solve, light, near.smooth);
  }
  d.near.push_back(std::move(near));
}

}  // namespace

size_t part_near_light(IndirectDrawing& d) {
  std::vector<NearLamp> known = std::exchange(d.near, {});
  if (d.tracer.lets_pass() || d.request.at == "receivers" || d.request.near_rays == 0) return 0;
  size_t left = 0;
  const auto take = [&](const MovingLamp& lamp, const LitLamp* lit) {
    d.near.size() < most_near_lamps ? part(d, lamp, lit, known) : void(++left);
  };
  for (const LitLamp& lit : d.lit)
    if (lit.lamp.kind != MovingLamp::Kind::sun) take(lit.lamp, &lit);
  for (const MovingLamp& lamp : own_lamps(d)) take(lamp, nullptr);
  return left;
}

Vec3 near_bounce(const IndirectDrawing& d, Vec3 origin, Vec3 normal, Vec3 above, const Kernels& kernels, int samples,
                 uint64_t key) {
  Vec3 sum(0.0f);
  if (samples <= 0) return sum;
  for (size_t k = 0; k < d.near.size(); ++k) {
    const NearLamp& near = d.near[k];
    if (near.sent.empty()) continue;
    Vec3 smooth(0.0f);
    for (size_t i = 0; i < kernels.count; ++i) smooth += kernels.weight[i] * near.smooth[kernels.surfel[i]];
    sum += gather(d, near, origin, normal, above, samples, hash64(key, k)) - smooth;
  }
  return sum;
}

}  // namespace lambent
