// The horizon is judged here, once for all alternatives. Lambert's law: f = albedo / pi, sampled with density
// cos(theta) / pi.
#include <lambent/brdf/lobes.h>
#include <lambent/core/sampling.h>

namespace lambent {

BrdfValue value_above(const Lambert& b, Vec3 wi, Vec3) { return {b.albedo / pi, wi.z / pi}; }

Vec3 draw(const Lambert&, Vec3, Vec2 u) { return square_to_cosine_hemisphere(u); }

BrdfValue evaluate_with_pdf(const Brdf& brdf, Vec3 wi, Vec3 wo) {
  if (!(wi.z > least_cosine && wo.z > least_cosine)) return {Vec3(0), 0};
  return std::visit([&](const auto& b) { return value_above(b, wi, wo); }, brdf);
}

Vec3 evaluate(const Brdf& brdf, Vec3 wi, Vec3 wo) { return evaluate_with_pdf(brdf, wi, wo).f; }

float pdf(const Brdf& brdf, Vec3 wi, Vec3 wo) { return evaluate_with_pdf(brdf, wi, wo).pdf; }

BrdfSample sample(const Brdf& brdf, Vec3 wo, Vec2 u) {
  const BrdfSample nothing{Vec3(0, 0, 1), Vec3(0), 0};
  if (!(wo.z > least_cosine)) return nothing;
  return std::visit(
      [&](const auto& b) -> BrdfSample {
        const Vec3 wi = draw(b, wo, u);
        if (!(wi.z > least_cosine)) return nothing;
        const BrdfValue value = value_above(b, wi, wo);
        if (!(value.pdf > 0)) return nothing;
        return {wi, value.f * (wi.z / value.pdf), value.pdf};
      },
      brdf);
}

}  // namespace lambent
