// Lambert's law: f = albedo / pi, sampled with density cos(theta) / pi.
#include <lambent/brdf/brdf.h>
#include <lambent/core/sampling.h>

namespace lambent {
namespace {

Vec3 evaluate_above(const Lambert& lambert, Vec3, Vec3) { return lambert.albedo / pi; }

BrdfSample sample_above(const Lambert& lambert, Vec3, Vec2 u) {
  Vec3 wi = square_to_cosine_hemisphere(u);
  return {wi, lambert.albedo, wi.z / pi};
}

float pdf_above(const Lambert&, Vec3 wi, Vec3) { return wi.z / pi; }

}  // namespace

// The horizon is judged here, once for all alternatives.
Vec3 evaluate(const Brdf& brdf, Vec3 wi, Vec3 wo) {
  if (wi.z <= 0 || wo.z <= 0) return Vec3(0);
  return std::visit([&](const auto& b) { return evaluate_above(b, wi, wo); }, brdf);
}

BrdfSample sample(const Brdf& brdf, Vec3 wo, Vec2 u) {
  if (wo.z <= 0) return {Vec3(0, 0, 1), Vec3(0), 0};
  BrdfSample s = std::visit([&](const auto& b) { return sample_above(b, wo, u); }, brdf);
  if (s.wi.z <= 0 || !(s.pdf > 0)) return {Vec3(0, 0, 1), Vec3(0), 0};
  return s;
}

float pdf(const Brdf& brdf, Vec3 wi, Vec3 wo) {
  if (wi.z <= 0 || wo.z <= 0) return 0;
  return std::visit([&](const auto& b) { return pdf_above(b, wi, wo); }, brdf);
}

}  // namespace lambent
