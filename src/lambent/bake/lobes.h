#pragma once
// Direct transfer of light that comes from lobes (basis/directional.h): 1/pi * integral of V b max(0, n . d).
// SHARP lobes, lamps, would be met now and then by the fan, the cosine-distributed rays that serve the harmonics: they
// get rays of their own, drawn from the lobe. What is left of the integrand, V cos, lies in [0, 1], so nothing is
// gained by mixing the two. BROAD lobes are summed over the fan. That is not only cheaper: where lobes overlap, light
// has coefficients of either sign, and errors cancel as the lobes do only if all lobes are summed over the same rays.
#include <lambent/basis/directional.h>
#include <lambent/core/aligned.h>
#include <lambent/trace/tracer.h>

namespace lambent {

// Directions shared by all receivers, made once: a few sets for each sharp lobe, which a receiver turns about the
// lobe's axis.
struct LobeSets {
  LobeKind kind = LobeKind::von_mises_fisher;
  std::vector<Lobe> lobes;
  std::vector<float> scales, integrals;  // of each lobe (lobe_scale, lobe_integral)
  std::vector<Mat3> frames;              // of each lobe: any two directions across, the axis
  std::vector<uint32_t> sharp, broad;    // which are which
  int rays = 0;                          // a sharp lobe
  size_t stride = 0, half = 0;           // as in DirectionSets (directions.h)
  uint32_t seed = 0;
  std::vector<float> x, y, z;  // [sharp lobe][set][stride], about +z
  size_t count() const { return lobes.size(); }
};

// Is a lobe so sharp that fewer than some 32 rays of a fan of `samples` would be found in it?
bool is_sharp(LobeKind kind, const Lobe& lobe, int samples);
// As many rays as the fan's are shared out among the sharp lobes, but each gets 64 at least.
int rays_per_lobe(int samples, size_t sharp_lobes);
LobeSets make_lobe_sets(LobeKind kind, const std::vector<Lobe>& lobes, int samples, uint32_t seed);
size_t lobe_set_bytes(int samples, size_t lobes);

// What one thread needs: the rays of one receiver to one lobe that leave above its surface, and what became of them.
struct LobeRays {
  AlignedVector<float> x, y, z, cosine;
  std::vector<AlignedVector<float>> visible;  // of each sky channel (gather.h)
  size_t count = 0, half = 0;                 // of all rays, and of the first half
};
LobeRays make_lobe_rays(const LobeSets& sets, int sky_channels);

// The values of lobe k, scaled, at the directions of a fan; count a multiple of lane_multiple (kernels.h).
void evaluate_on_fan(const LobeSets& sets, size_t k, const float* x, const float* y, const float* z, size_t count,
                     float* out);

// Traces the sharp lobe number i from a receiver. The mean of V cos f over the lobe's directions is the sum over `rays`
// of visible * cosine * f divided by sets.rays (by sets.half for the first half alone).
void trace_lobe(const LobeSets& sets, const Tracer& tracer, Vec3 origin, Vec3 normal, size_t receiver, size_t i,
                LobeRays& rays);

// out[channel * stride + k] = 1/pi * integral of V b_k cos, for every sharp lobe k; half_out, if not null, by the first
// half of the rays alone.
void trace_lobes(const LobeSets& sets, const Tracer& tracer, Vec3 origin, Vec3 normal, size_t receiver, LobeRays& rays,
                 float* out, float* half_out, size_t stride);

}  // namespace lambent
