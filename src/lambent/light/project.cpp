// Follows: general-prt (coefficients by dual functions, where the basis is not orthonormal).
#include <lambent/basis/quadrature.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/light/project.h>

#include <bit>

namespace lambent {
namespace {

constexpr double pi_d = std::numbers::pi;

struct PlacedLobe {
  Vec3d axis;
  double sharpness, reach;
};

PlacedLobe place(LobeKind kind, const Lobe& lobe, const Mat3& rotation) {
  const double s = lobe.sharpness;
  // The environment turned by R meets the lobe about a as the environment itself meets the lobe about R^-1 a.
  return {normalize(transpose(Mat3d(rotation)) * Vec3d(lobe.axis)), s, lobe_reach(kind, s)};
}

// Gauss nodes across `width` radians about 0, so many that a lobe of this sharpness is integrated to one part in 10^5
// or better: pieces no wider than its standard deviation, 4 nodes each, or fewer nodes where the whole width is little
// of that.
std::vector<QuadratureNode> nodes_across(double width, double sharpness) {
  const double ratio = width * std::sqrt(sharpness);
  const int pieces = std::max(1, int(std::ceil(ratio))), count = ratio < 1.0 / 64 ? 1 : ratio < 0.25 ? 2 : 4;
  std::vector<QuadratureNode> nodes;
  for (int i = 0; i < pieces; ++i)
    for (const QuadratureNode& n :
         gauss_legendre(count, width * (double(i) / pieces - 0.5), width * (double(i + 1) / pieces - 0.5)))
      nodes.push_back(n);
  return nodes;
}

// Calls take(x, integral of the unscaled lobe over texel (x, y)) for the texels of row y that the lobe reaches.
template <class Take>
void integrate_lobe_over_row(LobeKind kind, const PlacedLobe& lobe, int y, int width, int height, Take&& take) {
  const double row = pi_d / height, theta = row * (y + 0.5), column = 2 * pi_d / width;
  if (std::abs(std::acos(std::clamp(lobe.axis.y, -1.0, 1.0)) - theta) > lobe.reach + 0.5 * row) return;
  const double widest = std::sin(std::clamp(pi_d / 2, theta - 0.5 * row, theta + 0.5 * row)),
               texel = 0.5 * std::hypot(row, column * widest);
  const double least_cosine = lobe.reach + texel < pi_d ? std::cos(lobe.reach + texel) : -1.0;
  struct Latitude {
    double cos, sin, weight;
  };
  std::vector<Latitude> latitudes;
  for (const QuadratureNode& n : nodes_across(row, lobe.sharpness))
    latitudes.push_back({std::cos(theta + n.x), std::sin(theta + n.x), n.weight * std::sin(theta + n.x)});
  const std::vector<QuadratureNode> across = nodes_across(column * widest, lobe.sharpness);
  const double azimuth = std::atan2(lobe.axis.z, lobe.axis.x), equatorial = std::hypot(lobe.axis.x, lobe.axis.z);
  for (int x = 0; x < width; ++x) {
    const double phi = column * (x + 0.5) - pi_d - azimuth;  // from the lobe's meridian
    if (lobe.axis.y * std::cos(theta) + equatorial * std::sin(theta) * std::cos(phi) < least_cosine) continue;
    double sum = 0;
    for (const QuadratureNode& n : across) {
      const double c = equatorial * std::cos(phi + n.x / widest);
      for (const Latitude& t : latitudes)
        sum += n.weight / widest * t.weight * lobe_value(kind, lobe.sharpness, lobe.axis.y * t.cos + c * t.sin);
    }
    take(x, sum);
  }
}

// The integrals of the turned environment against the lobes, by texels.
std::vector<Vec3d> over_texels(const Environment& env, const DirectionalBasis& basis, const Mat3& rotation) {
  const int w = env.image.width, h = env.image.height;
  const size_t lobes = basis.lobes.size();
  std::vector<PlacedLobe> placed;
  for (const Lobe& lobe : basis.lobes) placed.push_back(place(basis.kind, lobe, rotation));
  // One partial sum a row of texels, added in order afterwards.
  std::vector<Vec3d> rows(lobes * size_t(h), Vec3d(0));
  parallel_for(size_t(h), 4, [&](size_t begin, size_t end) {
    for (size_t y = begin; y < end; ++y)
      for (size_t k = 0; k < lobes; ++k)
        integrate_lobe_over_row(basis.kind, placed[k], int(y), w, h, [&](int x, double integral) {
          rows[y * lobes + k] += Vec3d(env.image.at(x, int(y))) * integral;
        });
  });
  std::vector<Vec3d> out(lobes, Vec3d(0));
  for (size_t k = 0; k < lobes; ++k) {
    for (size_t y = 0; y < size_t(h); ++y) out[k] += rows[y * lobes + k];
    out[k] *= lobe_scale(basis.kind, basis.lobes[k].sharpness);
  }
  return out;
}

// Those against band-limited lobes, from the harmonics of the turned environment: a lobe's integral over the sphere
// times the value at its axis of the bands that it has.
std::vector<Vec3d> over_bands(const DirectionalBasis& basis, std::span<const Vec3> sh) {
  std::vector<Vec3d> out;
  std::vector<double> y(sh.size());
  for (const Lobe& lobe : basis.lobes) {
    const int bands = int(lobe.sharpness);
    evaluate_sh(bands, normalize(Vec3d(lobe.axis)), y);
    Vec3d value(0);
    for (size_t i = 0; i < size_t(sh_count(bands)); ++i) value += Vec3d(sh[i]) * y[i];
    out.push_back(value * lobe_integral(basis.kind, lobe.sharpness));
  }
  return out;
}

// Bands of harmonics that the projection needs.
int bands_of(const DirectionalBasis& basis) {
  int bands = basis.sh_order;
  if (basis.kind == LobeKind::band_limited)
    for (const Lobe& lobe : basis.lobes) bands = std::max(bands, int(lobe.sharpness));
  return bands;
}

// From the integrals against the harmonics and the lobes.
std::vector<Vec3> coefficients_of(const DirectionalBasis& basis, std::span<const Vec3> sh,
                                  std::span<const Vec3d> of_lobes) {
  const size_t harmonics = size_t(sh_count(basis.sh_order));
  std::vector<Vec3> light(basis.count());
  for (int c = 0; c < 3; ++c) {
    std::vector<double> integrals(basis.count(), 0.0);
    for (size_t i = 0; i < harmonics; ++i) integrals[i] = double(sh[i][c]);
    for (size_t k = 0; k < of_lobes.size(); ++k) integrals[harmonics + k] = of_lobes[k][c];
    const std::vector<double> coefficients = apply_directional_dual(basis, integrals);
    for (size_t i = 0; i < light.size(); ++i) light[i][c] = float(coefficients[i]);
  }
  return light;
}

}  // namespace

std::vector<Vec3> project_environment(const Environment& env, int order) {
  const int w = env.image.width, h = env.image.height, split = std::max(1, (1024 + w - 1) / w);
  const size_t coefficients = size_t(sh_count(order));
  // One partial sum a row of texels, added in order afterwards.
  std::vector<Vec3d> rows(coefficients * size_t(h), Vec3d(0));
  parallel_for(size_t(h), 1, [&](size_t begin, size_t end) {
    std::vector<float> y(coefficients);
    for (size_t row = begin; row < end; ++row) {
      Vec3d* sum = rows.data() + row * coefficients;
      for (int s = 0; s < split; ++s) {
        const int fine_row = int(row) * split + s;
        const double solid_angle = texel_solid_angle(fine_row, w * split, h * split);
        for (int x = 0; x < w; ++x) {
          const Vec3d energy = Vec3d(env.image.at(x, int(row))) * solid_angle;
          for (int i = 0; i < split; ++i) {
            evaluate_sh(order, texel_direction(x * split + i, fine_row, w * split, h * split), y);
            // By components: with vectors' operators it is most of what a picture takes in a build with checks.
            for (size_t k = 0; k < coefficients; ++k) {
              const double value = double(y[k]);
              sum[k].x += energy.x * value, sum[k].y += energy.y * value, sum[k].z += energy.z * value;
            }
          }
        }
      }
    }
  });
  std::vector<Vec3> light(coefficients);
  for (size_t k = 0; k < coefficients; ++k) {
    Vec3d sum(0);
    for (size_t row = 0; row < size_t(h); ++row) sum += rows[row * coefficients + k];
    light[k] = Vec3(sum);
  }
  return light;
}

std::vector<Vec3> project_environment(const Environment& env, const DirectionalBasis& basis, const Mat3& rotation) {
  const int order = bands_of(basis);
  std::vector<Vec3> sh;
  if (order > 0) sh = rotate_sh(make_sh_rotation(order, rotation), project_environment(env, order));
  if (basis.lobes.empty() || basis.kind == LobeKind::band_limited) return project_harmonics(sh, basis);
  return coefficients_of(basis, sh, over_texels(env, basis, rotation));
}

std::vector<Vec3> project_harmonics(std::span<const Vec3> sh, const DirectionalBasis& basis) {
  LAMBENT_CHECK(sh.size() >= size_t(sh_count(bands_of(basis))));
  if (basis.lobes.empty()) return {sh.begin(), sh.begin() + sh_count(basis.sh_order)};
  LAMBENT_CHECK(basis.kind == LobeKind::band_limited);
  return coefficients_of(basis, sh, over_bands(basis, sh));
}

Environment reconstruct_environment(std::span<const Vec3> light, int width) {
  return make_environment("spherical harmonics of order " + std::to_string(sh_order(light.size())), width, width / 2,
                          [&](Vec3 d) { return reconstruct_sh(light, d); });
}

Environment reconstruct_environment(const DirectionalBasis& basis, std::span<const Vec3> light, int width) {
  LAMBENT_CHECK(light.size() >= basis.count());
  if (basis.kind == LobeKind::band_limited && !basis.lobes.empty()) {
    const int order = bands_of(basis);
    std::vector<Vec3> sh(size_t(sh_count(order)));
    std::vector<double> channel(basis.count());
    for (int c = 0; c < 3; ++c) {
      for (size_t i = 0; i < channel.size(); ++i) channel[i] = double(light[i][c]);
      const std::vector<double> bands = directional_to_sh(basis, channel, order);
      for (size_t i = 0; i < sh.size(); ++i) sh[i][c] = float(bands[i]);
    }
    return reconstruct_environment(sh, width ? width : 1024);
  }
  if (width == 0) {
    float sharpest = 0;
    for (const Lobe& lobe : basis.lobes) sharpest = std::max(sharpest, lobe.sharpness);
    width = std::clamp(int(std::bit_ceil(unsigned(4 * pi * std::sqrt(sharpest)))), 1024, 4096);
  }
  const int height = width / 2;
  const size_t harmonics = size_t(sh_count(basis.sh_order));
  Environment env;
  env.name = "harmonics of order " + std::to_string(basis.sh_order) + " and " + std::to_string(basis.lobes.size()) +
             " lobes";
  env.image = Image(width, height);
  std::vector<PlacedLobe> placed;
  for (const Lobe& lobe : basis.lobes) placed.push_back(place(basis.kind, lobe, Mat3(1.0f)));
  parallel_for(size_t(height), 4, [&](size_t begin, size_t end) {
    for (int y = int(begin); y < int(end); ++y) {
      if (harmonics > 0)
        for (int x = 0; x < width; ++x)
          env.image.at(x, y) = reconstruct_sh(light.first(harmonics), texel_direction(x, y, width, height));
      for (size_t k = 0; k < placed.size(); ++k) {
        const float scale =
            float(lobe_scale(basis.kind, basis.lobes[k].sharpness) / texel_solid_angle(y, width, height));
        integrate_lobe_over_row(basis.kind, placed[k], y, width, height, [&](int x, double integral) {
          env.image.at(x, y) += light[harmonics + k] * (scale * float(integral));
        });
      }
    }
  });
  return env;
}

double squared_radiance(const Environment& env) {
  double sum = 0;
  for (int y = 0; y < env.image.height; ++y)
    for (int x = 0; x < env.image.width; ++x) {
      const Vec3 c = env.image.at(x, y);
      sum += double(dot(c, c)) * texel_solid_angle(y, env.image.width, env.image.height);
    }
  return sum;
}

}  // namespace lambent
