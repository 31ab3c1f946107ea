#include <lambent/bake/gather.h>
#include <lambent/bake/lightmap.h>
#include <lambent/bake/lightmap_error.h>
#include <lambent/bake/unbury.h>
#include <lambent/core/parallel.h>
#include <lambent/receivers/atlas.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

// A floor, on which a room without an opening stands beside a block and a lamp.
Scene make_yard() {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.6f)), lamp = add_material(scene, "lamp", Vec3(0));
  scene.materials[lamp].emissive = Vec3(8);
  add_quad(scene, grey, "floor", Vec3(-3, 0, -2), Vec3(0, 0, 4), Vec3(6, 0, 0), 1, 1);
  add_box(scene, grey, "room", Vec3(0.5f, -0.01f, -1.5f), Vec3(2.5f, 1.5f, 1.5f), 1);
  add_box(scene, grey, "inner", Vec3(0.6f, 0, -1.4f), Vec3(2.4f, 1.4f, 1.4f), 1, true);
  add_box(scene, grey, "block", Vec3(-1.5f, -0.01f, -0.5f), Vec3(-0.7f, 0.8f, 0.5f), 1);
  add_box(scene, lamp, "lamp", Vec3(-2.6f, 1.6f, -0.3f), Vec3(-2.2f, 1.8f, 0.3f), 1);
  return scene;
}

struct Yard {
  float density;
  Scene scene = make_yard();
  Environment sky = make_environment("sky", 16, 8, [](Vec3 d) { return Vec3(0.2f + 0.3f * std::max(0.0f, d.y)); });
  Atlas atlas = *make_atlas(scene, {.texels_per_unit = density});
  Receivers receivers = make_texel_receivers(scene, atlas);
  Tracer tracer = *Tracer::build(scene);
  Lamps lamps = make_lamps(scene, &sky, false);
  explicit Yard(float texels_per_unit) : density(texels_per_unit) {
    move_buried_texels(scene, tracer, atlas, receivers);
  }

  Lightmap bake(const LightmapOptions& options, LightmapReport* report = nullptr) const {
    auto map = bake_lightmap(scene, tracer, receivers, lamps, options, true, report);
    EXPECT_TRUE(map) << (map ? "" : map.error().text());
    return std::move(*map);
  }
};

// How much of the surface each texel stands for: from points all over the triangles.
std::vector<double> texel_areas(const Yard& yard) {
  std::vector<double> areas(yard.receivers.count(), 0.0);
  const auto& basis = std::get<TexelReceivers>(yard.receivers.basis);
  constexpr int steps = 200;
  for (uint32_t t = 0; t < yard.scene.triangles.size(); ++t) {
    const auto* side = basis.find(t, true);
    if (!side) continue;
    const double area = double(area_length(area_normal(yard.scene, yard.scene.triangles[t]))) / (2 * steps * steps);
    for (int i = 0; i < steps; ++i)
      for (int j = 0; j < steps; ++j) {
        float u = (float(i) + 0.5f) / steps, v = (float(j) + 0.5f) / steps;
        if (u + v > 1) u = 1 - u, v = 1 - v;
        basis.spread(*side, u, v, [&](uint32_t r, float weight) { areas[r] += area * double(weight); });
      }
  }
  return areas;
}

// Relative RMS by area of what is not inside something, against two truths with noise of their own, which then does not
// count.
double difference(const Transfer& of, const Transfer& a, const Transfer& b, const Yard& yard) {
  double error = 0, total = 0;
  const std::vector<double> areas = texel_areas(yard);
  for (size_t r = 0; r < yard.receivers.count(); ++r) {
    if (areas[r] == 0 || is_buried(yard.tracer, yard.receivers, r)) continue;
    const std::vector<float> s = load_receiver(of, r), x = load_receiver(a, r), y = load_receiver(b, r);
    for (size_t k = 0; k < x.size(); ++k) {
      error += areas[r] * double(s[k] - x[k]) * double(s[k] - y[k]);
      total += areas[r] * double(x[k]) * double(y[k]);
    }
  }
  return std::sqrt(std::max(0.0, error) / total);
}

TEST(LightmapError, IsWhatManyRaysFind) {
  SKIP_UNDER_SANITIZERS();
  const Yard yard(16);
  ASSERT_GT(yard.receivers.count(), 12'000u);
  LightmapReport report;
  LightmapOptions options{.bounces = 2, .precision = Precision::single};
  options.error = 0.03;
  const Lightmap map = yard.bake(options, &report);
  EXPECT_LT(report.direct_traced, yard.receivers.count());
  EXPECT_LT(report.bounced_traced, yard.receivers.count());
  auto truth = [&](uint32_t seed) {
    return yard.bake({.samples = 128, .lamp_samples = 64, .bounces = 2, .seed = seed, .precision = Precision::single});
  };
  const Lightmap a = truth(9), b = truth(10);
  const double error = difference(map.all, a.all, b.all, yard);
  EXPECT_LT(error, 0.03);
  EXPECT_LT(difference(*map.direct, *a.direct, *b.direct, yard), 0.03);
  EXPECT_GT(report.certificate.error, 0.8 * error);
  EXPECT_LT(report.certificate.error, 1.2 * error + report.certificate.uncertain);
  // No light to speak of leaks into the closed room, under its wall or from chart to chart: the floor outside has 0.3.
  const auto& basis = std::get<TexelReceivers>(yard.receivers.basis);
  for (uint32_t t = 0; t < yard.scene.triangles.size(); ++t) {
    if (yard.scene.parts[yard.scene.triangles[t].part].name != "inner") continue;
    for (const Vec2 at :
         {Vec2(0.01f, 0.01f), Vec2(0.98f, 0.01f), Vec2(0.01f, 0.98f), Vec2(0.3f, 0.3f), Vec2(0.5f, 0.49f)})
      basis.spread(*basis.find(t, true), at.x, at.y,
                   [&](uint32_t r, float) { EXPECT_NEAR(load_receiver(map.all, r)[0], 0, 1e-3f) << t; });
  }
}

TEST(LightmapError, TermsAddUp) {
  SKIP_UNDER_SANITIZERS();
  const Yard yard(8);
  LightmapOptions options{.bounces = 2, .precision = Precision::single, .keep_terms = true};
  options.error = 0.05;
  const Lightmap map = yard.bake(options);
  ASSERT_EQ(map.terms.size(), 3u);
  {
    const ThreadLimit one(1);
    const Lightmap serial = yard.bake(options);
    for (size_t r = 0; r < yard.receivers.count(); ++r)
      ASSERT_EQ(load_receiver(map.all, r), load_receiver(serial.all, r)) << r;
  }
  for (size_t r = 0; r < yard.receivers.count(); r += 7) {
    const std::vector<float> all = load_receiver(map.all, r);
    std::vector<float> sum(all.size(), 0.0f);
    for (const Transfer& term : map.terms) {
      const std::vector<float> row = load_receiver(term, r);
      for (size_t k = 0; k < sum.size(); ++k) sum[k] += row[k];
    }
    for (size_t k = 0; k < sum.size(); ++k) ASSERT_NEAR(sum[k], all[k], 1e-4f * (1 + std::abs(all[k]))) << r;
  }
}

TEST(LightmapError, DensityFollowsTheError) {
  const Scene scene = make_yard();
  const Environment sky = make_environment("sky", 16, 8, [](Vec3) { return Vec3(0.3f); });
  const Lamps lamps = make_lamps(scene, &sky, false);
  auto coarse = lightmap_density(scene, lamps, 0.02, 1'000'000, 1, nullptr),
       fine = lightmap_density(scene, lamps, 0.002, 1'000'000, 1, nullptr),
       limited = lightmap_density(scene, lamps, 0.001, 60'000, 1, nullptr);
  ASSERT_TRUE(coarse && fine && limited);
  EXPECT_GT(*fine, 1.3 * *coarse);
  double area = 0;
  for (const Triangle& t : scene.triangles) area += 0.5 * double(area_length(area_normal(scene, t)));
  EXPECT_NEAR(double(*limited) * double(*limited) * area, 60'000, 600);
}

TEST(LightmapError, DensityIsEnoughForTheError) {
  SKIP_UNDER_SANITIZERS();
  const Scene scene = make_yard();
  const Environment sky = make_environment(
      "sky", 64, 32, [](Vec3 d) { return Vec3(dot(d, normalize(Vec3(1, 1, 0.4f))) > 0.99f ? 40.0f : 0.2f); });
  const Lamps lamps = make_lamps(scene, &sky, false);
  LightmapOptions options{.bounces = 1};
  options.error = 0.04;
  auto density = lightmap_density(scene, lamps, options.error, 4'000'000, 1, nullptr);
  ASSERT_TRUE(density);
  Yard yard(*density);
  yard.lamps = lamps;
  LightmapReport report;
  yard.bake(options, &report);
  EXPECT_LT(report.certificate.error - report.certificate.uncertain, options.error);
  EXPECT_GT(report.certificate.error, 0.4 * options.error);  // nor much finer than it asks for
}

}  // namespace
}  // namespace lambent
