// Follows: general-prt (custom light bases). The sharpness that gives a lobe the mean cosine R solves coth s - 1/s = R
// (the maximum likelihood estimate of a von Mises-Fisher distribution).
#include <lambent/core/check.h>
#include <lambent/light/lamps.h>

namespace lambent {
namespace {

constexpr double least_over_mean = 4, edge_of_peak = 0.2, most_overlap = 0.8;
// Less sharp, a region is a side of the sky and not a lamp: harmonics do better.
constexpr double least_sharpness = 2;

double sharpness_of(double mean_cosine) {
  const double R = std::min(mean_cosine, 1.0);
  if (R > 1 - 1.0 / double(max_sharpness)) return double(max_sharpness);
  // From a known approximation (Banerjee et al. 2005) by Newton's method; coth s is 1 in double precision beyond s
  // = 20.
  double s = R * (3 - R * R) / (1 - R * R);
  if (s > 20) s = 1 / (1 - R);
  for (int step = 0; step < 50 && s > 0 && s < 40; ++step) {
    const double coth = 1 / std::tanh(s), change = (coth - 1 / s - R) / (1 - coth * coth + 1 / (s * s));
    s -= change;
    if (std::abs(change) < 1e-12 * s) break;
  }
  return std::min(s, double(max_sharpness));
}

struct Lamp {
  double strength;
  Lobe lobe;
};

}  // namespace

std::vector<Lobe> find_lamps(const Environment& env, int count) {
  LAMBENT_CHECK(count >= 0);
  const int w = env.image.width, h = env.image.height;
  auto brightness = [&](size_t texel) {
    return double(env.image.rgb[texel].x + env.image.rgb[texel].y + env.image.rgb[texel].z) / 3;
  };
  double mean = 0;
  for (size_t i = 0; i < env.image.rgb.size(); ++i)
    mean += brightness(i) * texel_solid_angle(int(i / size_t(w)), w, h) / (4 * std::numbers::pi);
  std::vector<size_t> bright;
  for (size_t i = 0; i < env.image.rgb.size(); ++i)
    if (mean > 0 && brightness(i) >= least_over_mean * mean) bright.push_back(i);
  std::stable_sort(bright.begin(), bright.end(), [&](size_t a, size_t b) { return brightness(a) > brightness(b); });

  std::vector<Lamp> lamps;
  std::vector<uint8_t> taken(env.image.rgb.size(), 0);
  std::vector<size_t> region;
  for (size_t peak : bright) {
    if (taken[peak]) continue;
    const double edge = std::max(edge_of_peak * brightness(peak), least_over_mean * mean);
    region.assign(1, peak), taken[peak] = 1;
    auto grow = [&](size_t texel, double least) {
      const int x = int(texel % size_t(w)), y = int(texel / size_t(w));
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
          if (y + dy < 0 || y + dy >= h) continue;
          const size_t beside = size_t(y + dy) * size_t(w) + size_t((x + dx + w) % w);
          if (!taken[beside] && brightness(beside) >= least) region.push_back(beside), taken[beside] = 1;
        }
    };
    for (size_t k = 0; k < region.size(); ++k) grow(region[k], edge);
    for (size_t k = 0, inside = region.size(); k < inside; ++k) grow(region[k], 0);  // the rim
    double strength = 0;
    Vec3d moment(0);
    for (size_t texel : region) {
      strength += brightness(texel) * texel_solid_angle(int(texel / size_t(w)), w, h);
      moment += brightness(texel) * texel_moment(int(texel % size_t(w)), int(texel / size_t(w)), w, h);
    }
    const double length = lambent::length(moment), sharpness = sharpness_of(length / strength);
    if (sharpness >= least_sharpness) lamps.push_back({strength, {Vec3(moment / length), float(sharpness)}});
  }
  std::stable_sort(lamps.begin(), lamps.end(), [](const Lamp& a, const Lamp& b) { return a.strength > b.strength; });

  std::vector<Lobe> lobes;
  for (const Lamp& lamp : lamps) {
    if (lobes.size() == size_t(count)) break;
    const bool known = std::any_of(lobes.begin(), lobes.end(), [&](const Lobe& lobe) {
      return lobe_overlap(LobeKind::von_mises_fisher, lobe, lamp.lobe) > most_overlap;
    });
    if (!known) lobes.push_back(lamp.lobe);
  }
  return lobes;
}

}  // namespace lambent
