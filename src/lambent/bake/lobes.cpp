// Follows: general-prt (custom light bases); importance sampling of the lobe by inversion.
#include <lambent/bake/directions.h>
#include <lambent/bake/fan.h>
#include <lambent/bake/kernels.h>
#include <lambent/bake/lobes.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

namespace lambent {
namespace {

constexpr int set_count = 8, least_rays = 64;

}  // namespace

// The integral of an unscaled lobe is 2 pi / s, and around its normal a fan has samples / pi rays a steradian.
// Band-limited ones are all over the sphere.
bool is_sharp(LobeKind kind, const Lobe& lobe, int samples) {
  return kind != LobeKind::band_limited && lobe.sharpness > float(samples) / 16;
}

int rays_per_lobe(int samples, size_t lobes) { return lobes == 0 ? 0 : std::max(least_rays, samples / int(lobes)); }

size_t lobe_set_bytes(int samples, size_t lobes) {
  return lobes * set_count * 12 * pad_lanes(size_t(rays_per_lobe(samples, lobes)));
}

LobeSets make_lobe_sets(LobeKind kind, const std::vector<Lobe>& lobes, int samples, uint32_t seed) {
  LobeSets s;
  s.kind = kind, s.lobes = lobes, s.seed = uint32_t(hash64(seed, 0x10be));
  for (size_t k = 0; k < lobes.size(); ++k) {
    s.scales.push_back(float(lobe_scale(kind, lobes[k].sharpness))),
        s.integrals.push_back(float(lobe_integral(kind, lobes[k].sharpness)));
    s.frames.push_back(frame_about(normalize_or(lobes[k].axis, Vec3(0, 0, 1))));
    (is_sharp(kind, lobes[k], samples) ? s.sharp : s.broad).push_back(uint32_t(k));
  }
  s.rays = rays_per_lobe(samples, s.sharp.size());
  s.stride = pad_lanes(size_t(s.rays)), s.half = pad_lanes(size_t(s.rays) / 2);
  s.x.assign(s.sharp.size() * set_count * s.stride, 0), s.y = s.x, s.z.assign(s.x.size(), 1);
  for (size_t i = 0; i < s.sharp.size(); ++i)
    for (size_t set = 0; set < set_count; ++set) {
      const size_t base = (i * set_count + set) * s.stride;
      const std::vector<Vec2> points =
          sorted_points(size_t(s.rays), s.half, uint32_t(hash64(s.seed, s.sharp[i] * set_count + set)));
      for (size_t j = 0; j < points.size(); ++j) {
        const Vec3 d = sample_lobe(kind, lobes[s.sharp[i]].sharpness, points[j]);
        s.x[base + j] = d.x, s.y[base + j] = d.y, s.z[base + j] = d.z;
      }
    }
  return s;
}

LobeRays make_lobe_rays(const LobeSets& sets, int sky_channels) {
  LobeRays rays;
  for (auto* values : {&rays.x, &rays.y, &rays.z, &rays.cosine}) values->resize(sets.stride);
  rays.visible.assign(size_t(sky_channels), AlignedVector<float>(sets.stride));
  return rays;
}

void evaluate_on_fan(const LobeSets& sets, size_t k, const float* x, const float* y, const float* z, size_t count,
                     float* out) {
  lobe_values(sets.kind, sets.frames[k][2], sets.lobes[k].sharpness, sets.scales[k], x, y, z, count, out);
}

void trace_lobe(const LobeSets& sets, const Tracer& tracer, Vec3 origin, Vec3 normal, size_t receiver, size_t lobe,
                LobeRays& rays) {
  const uint32_t k = sets.sharp[lobe];
  const uint64_t bits = hash64(hash64(sets.seed, k), receiver);
  const size_t base = (lobe * set_count + size_t(bits % set_count)) * sets.stride;
  const float spin = 2 * pi * to_unit_float(uint32_t(bits >> 32)), c = std::cos(spin), s = std::sin(spin);
  const Mat3 turn = sets.frames[k] * Mat3(Vec3(c, s, 0), Vec3(-s, c, 0), Vec3(0, 0, 1));
  rotate_directions(turn, sets.x.data() + base, sets.y.data() + base, sets.z.data() + base, sets.stride, rays.x.data(),
                    rays.y.data(), rays.z.data());
  rays.count = rays.half = 0;
  for (size_t i = 0; i < size_t(sets.rays); ++i) {
    const Vec3 d(rays.x[i], rays.y[i], rays.z[i]);
    const float cosine = dot(normal, d);
    if (cosine <= 0) continue;
    const size_t to = rays.count++;
    rays.x[to] = d.x, rays.y[to] = d.y, rays.z[to] = d.z, rays.cosine[to] = cosine;
    if (i < sets.half) rays.half = rays.count;
  }
  const Directions directions{rays.x.data(), rays.y.data(), rays.z.data(), rays.count};
  std::vector<AlignedVector<float>>& v = rays.visible;
  trace_visible(tracer, origin, directions, std::span(v), nullptr);
}

void trace_lobes(const LobeSets& sets, const Tracer& tracer, Vec3 origin, Vec3 normal, size_t receiver, LobeRays& rays,
                 float* out, float* half_out, size_t stride) {
  for (size_t lobe = 0; lobe < sets.sharp.size(); ++lobe) {
    const uint32_t k = sets.sharp[lobe];
    trace_lobe(sets, tracer, origin, normal, receiver, lobe, rays);
    const float scale = sets.integrals[k] / pi;
    for (size_t c = 0; c < rays.visible.size(); ++c) {
      const AlignedVector<float>& visible = rays.visible[c];
      float half = 0, rest = 0;
      for (size_t i = 0; i < rays.half; ++i) half += visible[i] * rays.cosine[i];
      for (size_t i = rays.half; i < rays.count; ++i) rest += visible[i] * rays.cosine[i];
      out[c * stride + k] = scale * (half + rest) / float(sets.rays);
      if (half_out) half_out[c * stride + k] = scale * half / float(sets.half);
    }
  }
}

}  // namespace lambent
