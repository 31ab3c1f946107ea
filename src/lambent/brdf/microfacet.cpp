// R. Cook and K. Torrance, "A reflectance model for computer graphics", 1982; B. Walter et al., "Microfacet models for
// refraction through rough surfaces", 2007 (GGX); E. Heitz, "Understanding the masking-shadowing function in
// microfacet-based BRDFs", 2014 (anisotropic Smith, eq. 72 and 86; height correlation, eq. 99); C. Schlick, "An
// inexpensive BRDF model for physically-based rendering", 1994; J. Dupuy and A. Benyoub, "Sampling visible GGX normals
// with spherical caps", 2023; glTF 2.0, appendix B;
// KHR_materials_specular.
#include <lambent/brdf/lobes.h>
#include <lambent/core/sampling.h>

namespace lambent {
namespace {

Vec2 widths(Vec2 alpha) { return max(alpha, Vec2(min_alpha)); }

float fifth_power(float x) {
  const float x2 = x * x;
  return x2 * x2 * x;
}
Vec3 schlick(Vec3 f0, float cosine, float f90 = 1) {
  return f0 + (Vec3(f90) - f0) * fifth_power(std::max(0.0f, 1 - cosine));
}

// Fresnel's equations for unpolarised light and an index n that reflects f0 at normal incidence (Cook and Torrance,
// section 3.2).
float fresnel(float f0, float cosine) {
  const float root = std::sqrt(f0);
  if (root > 0.9999f) return 1;
  const float n = (1 + root) / (1 - root), c = cosine, g = std::sqrt(n * n + c * c - 1);
  const float a = (g - c) / (g + c), q = (c * (g + c) - 1) / (c * (g - c) + 1);
  return 0.5f * a * a * (1 + q * q);
}

// Smith's Lambda of GGX times cos(theta), plus cos(theta)/2: cos(theta) (1 + Lambda) = half_cosine + half_root.
float half_root(Vec2 alpha, Vec3 w) {
  return 0.5f * std::sqrt(alpha.x * alpha.x * w.x * w.x + alpha.y * alpha.y * w.y * w.y + w.z * w.z);
}

struct GgxLobe {
  float value;   // D G / (4 cos cos)
  float pdf;     // of the reflection of wo at visible normals
  float cosine;  // wi . h
};

// With Lambda = (2 root / z - 1) / 2, G2 / (z_i z_o) = 1 / (z_o root_i + z_i root_o), and G1(wo) / z_o = 1 / (z_o / 2 +
// root_o).
GgxLobe ggx_lobe(Vec2 alpha, Vec3 wi, Vec3 wo) {
  const Vec3 sum = wi + wo;
  const float length = lambent::length(sum);
  const Vec3 h = sum / length;
  const float x = h.x / alpha.x, y = h.y / alpha.y, s = x * x + y * y + h.z * h.z;
  const float d = 1 / (pi * alpha.x * alpha.y * s * s), root_i = half_root(alpha, wi), root_o = half_root(alpha, wo);
  return {d / (4 * (wo.z * root_i + wi.z * root_o)), d / (4 * (0.5f * wo.z + root_o)), length / 2};
}

// Normals visible from wo: the surface is stretched so that it is a hemisphere, on which they are the bisectors of wo
// with a direction uniform over a spherical cap.
Vec3 draw_visible_normal(Vec2 alpha, Vec3 wo, Vec2 u) {
  const Vec3 w = normalize(Vec3(alpha.x * wo.x, alpha.y * wo.y, wo.z));
  const float phi = 2 * pi * u.x, z = (1 - u.y) * (1 + w.z) - w.z, r = std::sqrt(std::clamp(1 - z * z, 0.0f, 1.0f));
  const Vec3 h = Vec3(r * std::cos(phi), r * std::sin(phi), z) + w;
  return normalize_or(Vec3(alpha.x * h.x, alpha.y * h.y, h.z), Vec3(0, 0, 1));
}

// What MetallicRoughness is made of.
struct Layers {
  Vec2 alpha;
  Vec3 diffuse, f0;
  float f90;
};
Layers layers(const MetallicRoughness& b) {
  return {widths(Vec2(b.roughness * b.roughness)), b.base_color * (1 - b.metallic),
          mix(b.dielectric_f0, b.base_color, b.metallic), std::lerp(b.dielectric_f90, 1.0f, b.metallic)};
}
float diffuse_share(const Layers& l, Vec3 wo) {
  const Vec3 f = schlick(l.f0, wo.z, l.f90);
  return first_share(l.diffuse * (Vec3(1) - f), f);
}

}  // namespace

float gaussian_slope_density(Vec2 alpha, Vec3 h) {
  const float x = h.x / (alpha.x * h.z), y = h.y / (alpha.y * h.z);
  return std::exp(-(x * x + y * y)) / (pi * alpha.x * alpha.y * h.z * h.z * h.z);
}

Vec3 draw_gaussian_slopes(Vec2 alpha, Vec2 u) {
  const float r = std::sqrt(-std::log(1 - u.y)), phi = 2 * pi * u.x;
  return normalize(Vec3(alpha.x * r * std::cos(phi), alpha.y * r * std::sin(phi), 1));
}

BrdfValue value_above(const Ggx& b, Vec3 wi, Vec3 wo) {
  const GgxLobe lobe = ggx_lobe(widths(b.alpha), wi, wo);
  return {schlick(b.f0, lobe.cosine) * lobe.value, lobe.pdf};
}

Vec3 draw(const Ggx& b, Vec3 wo, Vec2 u) { return reflect_about(draw_visible_normal(widths(b.alpha), wo, u), wo); }

BrdfValue value_above(const MetallicRoughness& b, Vec3 wi, Vec3 wo) {
  const Layers l = layers(b);
  const GgxLobe lobe = ggx_lobe(l.alpha, wi, wo);
  const Vec3 f = schlick(l.f0, lobe.cosine, l.f90);
  const float diffuse = diffuse_share(l, wo);
  return {(Vec3(1) - f) * l.diffuse / pi + f * lobe.value, diffuse * wi.z / pi + (1 - diffuse) * lobe.pdf};
}

Vec3 draw(const MetallicRoughness& b, Vec3 wo, Vec2 u) {
  const Layers l = layers(b);
  if (take_first(diffuse_share(l, wo), u)) return square_to_cosine_hemisphere(u);
  return reflect_about(draw_visible_normal(l.alpha, wo, u), wo);
}

BrdfValue value_above(const CookTorrance& b, Vec3 wi, Vec3 wo) {
  const Vec3 sum = wi + wo;
  const float length = lambent::length(sum), cosine = length / 2;
  const Vec3 h = sum / length;
  const float slopes = gaussian_slope_density(widths(Vec2(b.m)), h);  // D h_z
  const float g = std::min(1.0f, 2 * h.z * std::min(wi.z, wo.z) / cosine);
  const Vec3 f(fresnel(b.f0.x, cosine), fresnel(b.f0.y, cosine), fresnel(b.f0.z, cosine));
  const float diffuse = first_share(b.diffuse, b.specular);
  return {b.diffuse / pi + b.specular * f * (slopes * g / (4 * h.z * wi.z * wo.z)),
          diffuse * wi.z / pi + (1 - diffuse) * slopes / (4 * cosine)};
}

Vec3 draw(const CookTorrance& b, Vec3 wo, Vec2 u) {
  if (take_first(first_share(b.diffuse, b.specular), u)) return square_to_cosine_hemisphere(u);
  return reflect_about(draw_gaussian_slopes(widths(Vec2(b.m)), u), wo);
}

}  // namespace lambent
