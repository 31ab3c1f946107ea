// Follows: local-deformable-prt, section 5; the cap's bands by Funk and Hecke's formula and Legendre's recurrence.
#include <lambent/basis/sh.h>
#include <lambent/basis/zonal.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/relight/local_light.h>
#include <lambent/transfer/transfer.h>

namespace lambent {

void light_at(const LocalLight& light, Vec3 place, std::span<Vec3> out) {
  LAMBENT_CHECK(out.size() == light.distant.size());
  std::copy(light.distant.begin(), light.distant.end(), out.begin());
  const int order = sh_order(out.size());
  float y[sh_count(max_sh_order)];
  double P[max_sh_order + 1];
  for (const SphereLamp& lamp : light.lamps) {
    const Vec3 to = lamp.centre - place;
    const double d2 = std::max(double(dot(to, to)), 1e-30),
                 sine2 = std::min(1.0, double(lamp.radius) * lamp.radius / d2);
    const double cosine = sine2 < 1 ? std::sqrt(1 - sine2) : -1;
    evaluate_legendre(cosine, {P, size_t(order) + 1});
    evaluate_sh(order, normalize_or(to, {0, 0, 1}), y);
    for (int l = 0; l < order; ++l) {
      // 2 pi times the integral of P_l from the cap's edge to 1; 1 - cos a without cancelling.
      const double band = l == 0 ? 2 * std::numbers::pi * (cosine < 0 ? 2 : sine2 / (1 + cosine))
                                 : 2 * std::numbers::pi * (P[l - 1] - P[l + 1]) / (2 * l + 1);
      const double factor = light.window.empty() ? 1 : size_t(l) < light.window.size() ? light.window[size_t(l)] : 0;
      for (size_t k = size_t(l * l); k < size_t((l + 1) * (l + 1)); ++k)
        out[k] += lamp.radiance * float(factor * band * y[k]);
    }
  }
}

LightField make_light_field(const LocalLight& light, std::span<const Vec3> places) {
  constexpr size_t block = transfer_block;
  const size_t C = light.distant.size();
  LightField f{places.size(), sh_order(C), AlignedVector<float>((places.size() + block - 1) / block * C * 3 * block)};
  parallel_for(places.size(), 1024, [&](size_t begin, size_t end) {
    std::vector<Vec3> at(C);
    for (size_t r = begin; r < end; ++r) {
      light_at(light, places[r], at);
      for (size_t k = 0; k < C; ++k)
        for (size_t c = 0; c < 3; ++c) f.values[((r / block * C + k) * 3 + c) * block + r % block] = at[k][int(c)];
    }
  });
  return f;
}

}  // namespace lambent
