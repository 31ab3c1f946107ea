#include <lambent/core/random.h>
#include <lambent/reference/integrator.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

using reference::Strategy;

constexpr float sigmas = 6.0f;  // as in path_tracer_test.cpp

Environment black() {
  return make_environment("black", 4, 2, [](Vec3) { return Vec3(0); });
}

TEST(PathTracerLamps, ClosedBoxOfUniformEmission) {
  // With k bounces a white surface sends out e sum_{j <= k} rho^j. The camera sees e on top, times albedo.
  const Vec3 e(1, 2, 0.5f), rho(0.7f, 0.4f, 0.2f);
  Scene scene;
  const uint32_t m = add_material(scene, "wall", rho);
  scene.materials[m].emissive = e;
  add_box(scene, m, "box", Vec3(-1), Vec3(1, 0.5f, 2), 2, true);
  const Vec3 at(0.2f, -0.999f, 0.3f), up(0, 1, 0);
  for (int k : {0, 1, 4}) {
    const auto r = exit_radiances(scene, black(), {&at, 1}, {&up, 1}, k, 16384, 5, {}, true)[0];
    Vec3 expected(0), power(1);
    for (int j = 0; j <= k; ++j) expected += e * power, power *= rho;
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(r.mean[c], expected[c], sigmas * std::sqrt(r.variance[c]) + 1e-5f) << k;
    ReferenceOptions options{.width = 8, .height = 8, .spp = 64, .bounces = k, .background = false, .lamps = true};
    Camera camera;
    camera.eye = Vec3(0), camera.target = Vec3(0.3f, -0.4f, 1);
    auto picture = path_trace(scene, black(), camera, options);
    ASSERT_TRUE(picture);
    for (size_t i = 0; i < picture->image.rgb.size(); ++i)
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(picture->image.rgb[i][c], e[c] + rho[c] * expected[c],
                    sigmas * std::sqrt(picture->variance[i][c]) + 1e-4f)
            << k;
  }
}

TEST(PathTracerLamps, EachWayToFindALampAgrees) {
  // A skew lamp of two triangles, half behind a block: sampling the lamp, sampling the cosine, and both.
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.6f, 0.5f, 0.4f)),
                 lamp = add_material(scene, "lamp", Vec3(0.2f));
  scene.materials[lamp].emissive = Vec3(4, 3, 2);
  add_quad(scene, grey, "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 2, 2);
  add_quad(scene, lamp, "lamp", Vec3(-0.5f, 1, -0.4f), Vec3(0.9f, 0.2f, 0.1f), Vec3(0, 0.1f, 0.8f), 1, 1);
  add_box(scene, grey, "block", Vec3(-0.3f, 0.4f, -0.2f), Vec3(0.1f, 0.6f, 0.3f), 1);
  const Environment env = black();
  const Vec3 at(-0.2f, 1e-4f, 0.1f), n = normalize(Vec3(0.1f, 1, -0.05f));
  Vec3d means[3], variances[3];
  const Strategy strategies[] = {Strategy::combined, Strategy::light_only, Strategy::brdf_only};
  for (int s = 0; s < 3; ++s) {
    auto integrator = reference::make_integrator(scene, env, 2, strategies[s], {}, true);
    ASSERT_TRUE(integrator);
    Vec3d sum(0), squares(0);
    const uint32_t paths = 1 << 16;
    for (uint32_t i = 0; i < paths; ++i) {
      const Vec3d x(reference::exit_radiance_estimate(*integrator, reference::white_vertex(at, n),
                                                      reference::PathSamples(9, i, paths)));
      sum += x, squares += x * x;
    }
    means[s] = sum / double(paths), variances[s] = (squares / double(paths) - means[s] * means[s]) / double(paths);
    EXPECT_GT(means[s].x, 0.03);
  }
  for (int s = 1; s < 3; ++s)
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(means[s][c], means[0][c], double(sigmas) * std::sqrt(variances[s][c] + variances[0][c])) << s;
  EXPECT_LT(variances[0].x, variances[2].x);
}

TEST(PathTracerLamps, DensitiesOfDrawnPointsAreWhatTheHitsSay) {
  Scene scene;
  const uint32_t a = add_material(scene, "a", Vec3(0)), b = add_material(scene, "b", Vec3(0));
  scene.materials[a].emissive = Vec3(1, 5, 0), scene.materials[b].emissive = Vec3(0.5f);
  add_quad(scene, a, "a", Vec3(0, 1, 0), Vec3(1, 0.3f, 0), Vec3(0, 0.2f, 1), 1, 1);
  add_sphere(scene, b, "b", Vec3(1, -1, 0.5f), 0.4f, 1);
  const auto sampler = reference::make_emitter_sampler(scene);
  auto intersector = reference::Intersector::make(scene);
  Random random(4);
  int compared = 0;
  for (int i = 0; i < 500; ++i) {
    const Vec3 p(random.next() - 2, random.next() - 1, random.next());
    const auto s = reference::sample_emitter(sampler, p, random.next(), random.next2());
    if (!(s.pdf > 0)) continue;
    reference::Hit hit;
    ASSERT_TRUE(intersector->nearest(p, s.direction, hit));
    if (std::abs(length(reference::surface_point(scene, hit).position - p) - s.distance) > 1e-4f) continue;  // hidden
    EXPECT_EQ(reference::emitted(scene, hit, s.direction), s.radiance);
    EXPECT_NEAR(reference::emitter_pdf(sampler, hit, p, s.direction) / s.pdf, 1, 1e-3f);
    ++compared;
  }
  EXPECT_GT(compared, 100);
}

TEST(PathTracerLamps, PunctualLightsByTheInverseSquare) {
  Scene scene = make_quad(Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 1, 1, Vec3(0.5f));
  const Vec3 lamp(0.3f, 0.8f, -0.2f), at(-0.4f, 1e-5f, 0.5f), up(0, 1, 0);
  scene.lights.push_back({.name = "bulb", .position = lamp, .intensity = Vec3(3, 2, 1)});
  const Vec3 d = lamp - at;
  const float d2 = dot(d, d), expected = d.y / std::sqrt(d2) / d2 / pi;
  EXPECT_NEAR(exit_radiance(scene, black(), at, up, 0, 16, 1, true).x, 3 * expected, 1e-5f);
  EXPECT_EQ(exit_radiance(scene, black(), at, up, 0, 16, 1, false).x, 0);
  // A wall in between.
  add_quad(scene, 0, "wall", 0.5f * (lamp + at) - Vec3(0.1f), Vec3(0.2f, 0, 0), Vec3(0, 0.2f, 0.2f), 1, 1);
  EXPECT_EQ(exit_radiance(scene, black(), at, up, 0, 16, 1, true).x, 0);
}

}  // namespace
}  // namespace lambent
