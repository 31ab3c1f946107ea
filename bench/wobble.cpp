// What light bases make of a light that turns: the projection of the turned light against the turned projection, which
// are the same for harmonics and for steerable lobes, and beside each other for all that stands still.
#include "bench.h"

#include <lambent/light/lamps.h>
#include <lambent/light/project.h>
#include <lambent/light/sky.h>
#include <lambent/relight/light.h>

#include <cmath>

namespace lambent::bench {
namespace {

struct Named {
  std::string name;
  LightBasis basis;
};

// The light about a direction, as luminance: what is seen of the basis, and what a white surface takes of it (bands to
// 16, beyond which a cosine has nothing to speak of).
struct Projected {
  DirectionalBasis basis;
  std::vector<double> light, irradiance;  // coefficients; of 16 bands
  double radiance(Vec3d d) const { return reconstruct_directional(basis, light, d); }
};

Projected project(const Environment& env, const LightBasis& columns, const Mat3& R) {
  LightProjection p = project_light(env, columns, R);
  Projected out{std::move(p.basis), {}, {}};
  for (const Vec3& c : p.light) out.light.push_back(double(luminance(c)));
  out.irradiance = directional_to_sh(out.basis, out.light, max_sh_order);
  for (size_t i = 0; i < out.irradiance.size(); ++i) out.irradiance[i] *= clamped_cosine(sh_band(int(i)));
  return out;
}

double irradiance(const Projected& p, Vec3d n) {
  std::vector<double> y(p.irradiance.size());
  evaluate_sh(max_sh_order, n, y);
  double sum = 0;
  for (size_t i = 0; i < y.size(); ++i) sum += y[i] * p.irradiance[i];
  return sum;
}

// Where it is brightest: uphill from the best of many directions, by ever smaller steps.
Vec3d brightest(const Projected& p, std::span<const Vec3> directions) {
  Vec3d best(0, 1, 0);
  double most = -1e300;
  for (Vec3 v : directions)
    if (const double value = p.radiance(normalize(Vec3d(v))); value > most) most = value, best = normalize(Vec3d(v));
  for (double step = 0.05; step > 1e-4; step *= 0.6) {
    const Vec3d about = best;
    for (Vec3 v : even_directions(24)) {
      const Vec3d d = normalize(about + step * Vec3d(v));
      if (const double value = p.radiance(d); value > most) most = value, best = d;
    }
  }
  return best;
}

double degrees_between(Vec3d a, Vec3d b) { return degrees(2 * std::asin(std::min(1.0, 0.5 * length(a - b)))); }

void report_wobble(const std::string& light, const Environment& env, const Named& named) {
  const std::vector<Vec3> many = even_directions(1500), normals = even_directions(400);
  const Projected still = project(env, named.basis, Mat3(1.0f));
  const Vec3d top = brightest(still, many);
  double worst = 0, sum = 0, peak = still.radiance(top), least = peak, most = peak, square = 0, white = 0;
  std::vector<double> before;
  for (Vec3 n : normals)
    before.push_back(irradiance(still, normalize(Vec3d(n)))), white = std::max(white, before.back());
  int turns = 0;
  for (int yaw = 5; yaw <= 90; yaw += 17)
    for (int pitch = -30; pitch <= 30; pitch += 15, ++turns) {
      const Mat3 R = rotation_from_yaw_pitch_roll({float(yaw), float(pitch), 0});
      const Projected turned = project(env, named.basis, R);
      const Vec3d there = brightest(turned, many);
      const double off = degrees_between(there, Mat3d(R) * top);
      worst = std::max(worst, off), sum += off;
      least = std::min(least, turned.radiance(there)), most = std::max(most, turned.radiance(there));
      for (size_t i = 0; i < normals.size(); ++i) {
        const double d = irradiance(turned, Mat3d(R) * normalize(Vec3d(normals[i]))) - before[i];
        square += d * d / double(normals.size());
      }
    }
  report("wobble, " + light + ", " + named.name, sum / turns, worst, "degrees", "the worst turn",
         {{"columns", named.basis.count()},
          {"peak_db", 10 * std::log10(most / least)},
          {"irradiance_psnr", std::min(200.0, 10 * std::log10(white * white * turns / std::max(square, 1e-300)))}});
}

}  // namespace

void bench_wobble() {
  const auto run = [](const std::string& name, const Environment& env) {
    const Named all[] = {
        {"sh:6", {.order = 6}},
        {"steerable:6", {0, LobeKind::band_limited, steerable_lobes(6), {}}},
        {"directional:36", {0, LobeKind::von_mises_fisher, even_lobes(36), {}}},
        {"compact:36", {0, LobeKind::compact, even_lobes(36, LobeKind::compact), {}}},
        {"directional:144", {0, LobeKind::von_mises_fisher, even_lobes(144), {}}},
        {"compact:144", {0, LobeKind::compact, even_lobes(144, LobeKind::compact), {}}},
        {"sh:5+lamps:11", {5, LobeKind::von_mises_fisher, find_lamps(env, 11), {}}},
    };
    for (const Named& named : all) report_wobble(name, env, named);
  };
  if (const auto sky = make_sky(*parse_sky("elevation=40,azimuth=30,width=256"))) run("a sun", *sky);
  if (const auto env = data_environment("chinese_garden_512")) run("chinese_garden_512", *env);
}

}  // namespace lambent::bench
