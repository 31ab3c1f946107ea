// Sampling of a piecewise constant map by inverting its marginal (rows) and conditional (texels of a row)
// distributions, as in Pharr, Jakob and Humphreys, "Physically Based Rendering".
#include <lambent/light/environment.h>

namespace lambent {
namespace {

constexpr double pi_d = std::numbers::pi;

double weight(Vec3 c) { return double(std::max({std::abs(c.x), std::abs(c.y), std::abs(c.z)})); }

// Finds the piece of a cumulative sum that u in [0, 1) of its total falls in, never an empty one, and turns u into the
// place within the piece.
size_t invert(const double* cdf, size_t pieces, double& u) {
  double target = u * cdf[pieces];
  size_t i = size_t(std::upper_bound(cdf, cdf + pieces + 1, target) - cdf);
  i = std::clamp<size_t>(i, 1, pieces) - 1;
  while (i > 0 && cdf[i + 1] <= cdf[i]) --i;  // rounding at the end of the sum
  double size = cdf[i + 1] - cdf[i];
  u = size > 0 ? std::clamp((target - cdf[i]) / size, 0.0, 1.0) : 0.5;
  return i;
}

}  // namespace

EnvironmentSampler make_environment_sampler(const Environment& env) {
  EnvironmentSampler sampler;
  sampler.environment = &env;
  size_t width = size_t(env.image.width), height = size_t(env.image.height);
  sampler.row_cdf.assign(height + 1, 0), sampler.texel_cdf.assign(height * (width + 1), 0);
  for (size_t y = 0; y < height; ++y) {
    double* row = &sampler.texel_cdf[y * (width + 1)];
    for (size_t x = 0; x < width; ++x) row[x + 1] = row[x] + weight(env.image.rgb[y * width + x]);
    sampler.row_cdf[y + 1] = sampler.row_cdf[y] +
                             row[width] * texel_solid_angle(int(y), env.image.width, env.image.height);
  }
  sampler.total = sampler.row_cdf[height];
  return sampler;
}

EnvironmentSample sample_environment(const EnvironmentSampler& sampler, Vec2 u) {
  const Image& image = sampler.environment->image;
  if (!(sampler.total > 0)) return {Vec3(0, 1, 0), Vec3(0), 0};
  size_t width = size_t(image.width), height = size_t(image.height);
  double s = double(u.x), t = double(u.y);
  size_t y = invert(sampler.row_cdf.data(), height, t);
  size_t x = invert(&sampler.texel_cdf[y * (width + 1)], width, s);
  // Uniform over the texel's solid angle: in azimuth and in the cosine of the polar angle.
  double top = std::cos(pi_d * double(y) / double(height)), bottom = std::cos(pi_d * double(y + 1) / double(height));
  double c = top + (bottom - top) * t, r = std::sqrt(std::max(0.0, 1 - c * c));
  double phi = 2 * pi_d * ((double(x) + s) / double(width) - 0.5);
  Vec3 value = image.rgb[y * width + x];
  return {Vec3(r * std::cos(phi), c, r * std::sin(phi)), value, float(weight(value) / sampler.total)};
}

float environment_pdf(const EnvironmentSampler& sampler, Vec3 direction) {
  if (!(sampler.total > 0)) return 0;
  return float(weight(radiance(*sampler.environment, direction)) / sampler.total);
}

}  // namespace lambent
