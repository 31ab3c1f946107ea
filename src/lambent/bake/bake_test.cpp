#include <lambent/bake/bake.h>
#include <lambent/basis/sh.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/light/project.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/relight/relight.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

#include <cstring>

namespace lambent {
namespace {

// Storage in half floats: 11 bits.
constexpr float half_rounding = 1e-3f;

struct Baking {
  Scene scene;
  Tracer tracer;
  Receivers receivers;
  Transfer transfer;
  BakeReport report;
};

Baking bake_scene(Scene scene, BakeOptions options) {
  auto tracer = Tracer::build(scene);
  EXPECT_TRUE(tracer);
  Baking b{std::move(scene), *tracer, {}, {}, {}};
  b.receivers = make_vertex_receivers(b.scene);
  auto transfer = bake(b.scene, b.tracer, b.receivers, options, &b.report);
  EXPECT_TRUE(transfer) << (transfer ? "" : transfer.error().text());
  if (transfer) b.transfer = *transfer;
  return b;
}

std::vector<Vec3> uniform_light(int order, Vec3 radiance = Vec3(1)) {
  std::vector<Vec3> light(size_t(sh_count(order)), Vec3(0));
  light[0] = radiance * std::sqrt(4 * pi);
  return light;
}

std::vector<Vec3> skew_light(int order) {
  Random random(5);
  std::vector<Vec3> light = uniform_light(order);
  for (size_t i = 1; i < light.size(); ++i) light[i] = Vec3(random.next(), random.next(), random.next()) * 2.0f - 1.0f;
  return light;
}

Relit relit_under(const Transfer& t, std::span<const Vec3> light) {
  Relit out;
  relight(t, light, out);
  return out;
}

TEST(Bake, ConvexBodyInUniformLightReflectsItsAlbedo) {
  for (int bounces : {0, 2}) {
    const Baking b = bake_scene(make_sphere(0.7f, 3, Vec3(0.5f)), {.order = 4, .samples = 256, .bounces = bounces});
    const Relit lit = relit_under(b.transfer, uniform_light(4, Vec3(0.25f, 0.5f, 1)));
    for (size_t r = 0; r < b.receivers.count(); ++r) {
      EXPECT_NEAR(lit.at(r).x, 0.25f, 0.25f * half_rounding);
      EXPECT_NEAR(lit.at(r).z, 1.0f, half_rounding);
    }
  }
}

TEST(Bake, OpenPlaneIsTheClampedCosine) {
  SKIP_UNDER_SANITIZERS();
  // 4,096 stratified cosine samples of functions with up to 6 bands: measured errors stay below 2e-3.
  constexpr float quadrature = 3e-3f;
  Vec3 a(1, 0.3f, 0), c(0.2f, -0.4f, 1);
  const Scene plane = make_quad(Vec3(0), a, c, 2, 2, Vec3(0.8f));
  const Vec3 n = normalize(cross(a, c));
  for (bool shadows : {true, false}) {
    const Baking b = bake_scene(
        plane, {.order = 6, .samples = 4096, .bounces = 0, .shadows = shadows, .precision = Precision::single});
    float y[36];
    evaluate_sh(6, n, y);
    for (size_t r = 0; r < b.receivers.count(); ++r) {
      const std::vector<float> t = load_receiver(b.transfer, r);
      for (int k = 0; k < 36; ++k)
        EXPECT_NEAR(t[size_t(k)], y[k] * float(clamped_cosine(sh_band(k))) / pi, shadows ? quadrature : 1e-5f) << k;
    }
  }
}

TEST(Bake, FootOfATallWallSeesHalfTheSky) {
  SKIP_UNDER_SANITIZERS();
  // The wall is 400 times as high and as wide as the receiver's distance from it: what shows past it is under 1%.
  constexpr float finite_wall = 0.01f;
  Scene scene;
  const uint32_t m = add_material(scene, "black", Vec3(0));
  add_quad(scene, m, "floor", Vec3(-1, 0, 0), Vec3(0, 0, 1), Vec3(2, 0, 0), 4, 4);
  add_quad(scene, m, "wall", Vec3(-200, 0, 0), Vec3(400, 0, 0), Vec3(0, 400, 0), 1, 1);
  const Baking b = bake_scene(std::move(scene), {.order = 3, .samples = 4096, .bounces = 2});
  const Relit lit = relit_under(b.transfer, uniform_light(3));
  int found = 0;
  for (size_t v = 0; v < b.scene.positions.size(); ++v)
    if (b.scene.normals[v].y > 0.9f && b.scene.positions[v].z < 1e-6f && std::abs(b.scene.positions[v].x) < 0.9f) {
      EXPECT_NEAR(lit.at(b.receivers.front[v]).y, 0.5f, finite_wall);
      ++found;
    }
  EXPECT_EQ(found, 3);
}

// A white-lined ball with a port: every point of the wall receives the same.
Scene ball_with_port(float rho, float cosine, float& fraction) {
  Scene scene = make_sphere(1, 4, Vec3(rho), true);
  double all = 0, kept = 0;
  std::vector<Triangle> wall;
  for (const Triangle& t : scene.triangles) {
    const Vec3 centre = normalize(scene.positions[t.v[0]] + scene.positions[t.v[1]] + scene.positions[t.v[2]]);
    const double area = length(area_normal(scene, t));
    all += area;
    if (dot(centre, normalize(Vec3(0.3f, 0.8f, -0.5f))) < cosine) kept += area, wall.push_back(t);
  }
  scene.triangles = wall;
  scene.parts[0].triangle_count = uint32_t(wall.size());
  fraction = float(1 - kept / all);
  return scene;
}

TEST(Bake, IntegratingSphereWithAPort) {
  SKIP_UNDER_SANITIZERS();
  // The ball has 5,120 flat faces: its chords fall short of the sphere's by about 0.3%, and every bounce repeats that.
  constexpr float faceted = 0.01f;
  for (float rho : {0.3f, 0.8f}) {
    float f = 0;
    const Scene scene = ball_with_port(rho, 0.8f, f);
    for (int bounces : {0, 1, 2, 40}) {
      const Baking b = bake_scene(scene, {.order = 2, .samples = 256, .bounces = bounces});
      const Relit lit = relit_under(b.transfer, uniform_light(2));
      double mean = 0;
      for (size_t r = 0; r < b.receivers.count(); ++r) mean += lit.at(r).x / double(b.receivers.count());
      double expected = 0, term = f;  // irradiance / pi of k bounces: the partial sums of f / (1 - rho (1 - f))
      for (int k = 0; k <= bounces; ++k) expected += term, term *= rho * (1 - f);
      EXPECT_NEAR(mean / expected, 1, faceted) << "rho " << rho << ", bounces " << bounces;
      if (bounces == 40) {
        EXPECT_NEAR(expected, f / (1 - rho * (1 - f)), 1e-3);
      }
    }
  }
}

TEST(Bake, AgreesWithThePathTracerUnderSkewLight) {
  SKIP_UNDER_SANITIZERS();
  // 16 receivers, 16,384 paths each: noise of the paths is about 0.5%, of the bake's 4,096 rays and half floats about
  // the same.
  constexpr float noise = 0.03f;
  Scene scene;
  const uint32_t red = add_material(scene, "red", Vec3(0.8f, 0.2f, 0.1f)),
                 grey = add_material(scene, "grey", Vec3(0.6f));
  add_quad(scene, grey, "floor", Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 24, 24);
  add_quad(scene, red, "wall", Vec3(-1, 0, -1), Vec3(2, 0, 0), Vec3(0, 1.5f, 0), 24, 18);
  add_sphere(scene, grey, "ball", Vec3(0.3f, 0.5f, -0.2f), 0.35f, 3);
  const auto light = skew_light(5);
  const Baking b = bake_scene(std::move(scene), {.order = 5, .samples = 4096, .bounces = 2});
  const Relit lit = relit_under(b.transfer, light);
  const Environment env = reconstruct_environment(light);
  for (size_t k = 0; k < 16; ++k) {
    const size_t r = k * b.receivers.count() / 16 + 7;
    const Vec3 truth =
        exit_radiance(b.scene, env, b.receivers.origins[r], b.receivers.normals[r], 2, 16384, uint32_t(k));
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(lit.at(r)[c], truth[c], noise) << "receiver " << r << " channel " << c;
  }
}

TEST(Bake, ThinTwoSidedSheetHasALitAndADarkSide) {
  Scene sheet = make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 3, 3, Vec3(0.5f));
  sheet.materials[0].double_sided = true;
  for (Triangle& t : sheet.triangles) t.two_sided = true;
  const Baking b = bake_scene(std::move(sheet), {.order = 2, .samples = 1024, .bounces = 1});
  EXPECT_EQ(b.receivers.count(), 32u);
  // Light from above alone: 1 + y-hat . d, which a plane facing up sees as 1 + 2/3 and one facing down as 1 - 2/3.
  std::vector<Vec3> light = uniform_light(2);
  light[1] = Vec3(-std::sqrt(4 * pi / 3));
  const Relit lit = relit_under(b.transfer, light);
  for (size_t v = 0; v < b.scene.positions.size(); ++v) {
    EXPECT_NEAR(lit.at(b.receivers.front[v]).x, 1 + 2.0f / 3, 0.01f);
    EXPECT_NEAR(lit.at(b.receivers.back[v]).x, 1 - 2.0f / 3, 0.01f);
  }
}

TEST(Bake, BuriedVerticesTakeTheirNeighboursLight) {
  // A floor with a box sunk into it: the floor's vertices under the box lie inside it.
  Scene scene;
  const uint32_t m = add_material(scene, "grey", Vec3(0.5f));
  add_quad(scene, m, "floor", Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 20, 20);
  add_box(scene, m, "box", Vec3(-0.33f, -0.2f, -0.33f), Vec3(0.33f, 0.3f, 0.33f), 6);
  for (int bounces : {0, 1}) {
    const Baking b = bake_scene(scene, {.order = 2, .samples = 256, .bounces = bounces});
    EXPECT_GE(b.report.buried, 49u);  // 7 x 7 floor vertices inside the box
    const Relit lit = relit_under(b.transfer, uniform_light(2));
    // The vertices about the box, a = 0.07 from its walls, which are h = 0.3 high. An endless wall would leave of even
    // light (1 + a / sqrt(a^2 + h^2)) / 2; these end, and reflect half of what they receive.
    float least = 1, most = 0;
    for (size_t v = 0; v < b.scene.positions.size(); ++v) {
      const Vec3 p = b.scene.positions[v];
      if (p.y != 0 || std::abs(std::max(std::abs(p.x), std::abs(p.z)) - 0.4f) > 0.01f) continue;
      const float around = lit.at(b.receivers.front[v]).x;
      least = std::min(least, around), most = std::max(most, around);
    }
    constexpr float noise = 0.02f;  // 256^-0.75, and half floats
    EXPECT_GT(least, 0.5f * (1 + 0.07f / std::hypot(0.07f, 0.3f)) - noise);
    EXPECT_LT(most, 1);
    // Means of means of those: none is darker or lighter than all of them.
    int inside = 0;
    for (size_t v = 0; v < b.scene.positions.size(); ++v) {
      const Vec3 p = b.scene.positions[v];
      if (p.y != 0 || std::abs(p.x) > 0.31f || std::abs(p.z) > 0.31f) continue;
      EXPECT_GE(lit.at(b.receivers.front[v]).x, least * (1 - half_rounding));
      EXPECT_LE(lit.at(b.receivers.front[v]).x, most * (1 + half_rounding));
      ++inside;
    }
    EXPECT_EQ(inside, 49);
  }
}

TEST(Bake, TheSameBytesWhateverTheThreadsAndTheMemory) {
  const Scene scene = make_courtyard(0.15f);
  auto bytes_with = [&](int threads, size_t memory, double* kept) {
    ThreadLimit limit(threads);
    const Baking b = bake_scene(scene, {.order = 4, .samples = 64, .bounces = 2, .memory = memory});
    if (kept) *kept = b.report.operator_kept;
    return std::vector<uint8_t>(b.transfer.data.begin(), b.transfer.data.end());
  };
  double kept_all = 0, kept_little = 1;
  const auto expected = bytes_with(1, size_t{4} << 30, &kept_all);
  EXPECT_EQ(kept_all, 1.0);
  EXPECT_EQ(bytes_with(2, size_t{4} << 30, nullptr), expected);
  auto tracer = Tracer::build(scene);
  const size_t receivers = make_vertex_receivers(scene).count();
  // The solution vectors and tables fit, and hardly any of the operator.
  const size_t least = least_memory(receivers, true, {.order = 4, .samples = 64, .bounces = 2});
  EXPECT_EQ(bytes_with(2, least + scene.triangles.size() * 32 + (size_t{1} << 20), &kept_little), expected);
  EXPECT_LT(kept_little, 0.9);
}

TEST(Bake, EstimatesItsErrorNotFarFromTheTruth) {
  SKIP_UNDER_SANITIZERS();
  const Scene scene = make_courtyard(0.15f);
  const BakeOptions coarse{.order = 6, .samples = 64, .bounces = 2};
  BakeOptions fine = coarse;
  fine.samples = 4096, fine.seed = 9;
  const Baking a = bake_scene(scene, coarse), b = bake_scene(scene, fine);
  double difference = 0, total = 0;
  for (size_t r = 0; r < a.receivers.count(); ++r) {
    const auto x = load_receiver(a.transfer, r), y = load_receiver(b.transfer, r);
    for (size_t k = 0; k < x.size(); ++k)
      difference += double(x[k] - y[k]) * (x[k] - y[k]), total += double(y[k]) * y[k];
  }
  const double actual = std::sqrt(difference / total);
  // Halves of a low-discrepancy set lean to opposite sides, so the estimate errs upwards, by up to about two.
  EXPECT_GT(a.report.error, 0.8 * actual);
  EXPECT_LT(a.report.error, 2.5 * actual);
}

TEST(Bake, RefusesAbsurdOptions) {
  const Scene scene = make_quad(Vec3(0), Vec3(1, 0, 0), Vec3(0, 1, 0), 1, 1, Vec3(0.5f));
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  for (BakeOptions o : {BakeOptions{.order = 0},
                        {.order = 1000},
                        {.samples = 0},
                        {.samples = -5},
                        {.bounces = -1},
                        {.bounces = 1000},
                        {.memory = 10}})
    EXPECT_FALSE(bake(scene, *tracer, receivers, o));
  Progress cancelled;
  cancelled.cancel();
  EXPECT_FALSE(bake(scene, *tracer, receivers, {.samples = 16}, nullptr, &cancelled));
}

TEST(Bake, ManySamplesAndFewSamplesWork) {
  SKIP_UNDER_SANITIZERS();
  const Scene scene = make_quad(Vec3(0), Vec3(1, 0, 0), Vec3(0, 1, 0), 1, 1, Vec3(0.5f));
  for (int samples : {1, 2, 3, 15, 17, 31, 32, 33, 1000, 70000}) {
    const Baking b = bake_scene(scene, {.order = 1, .samples = samples, .bounces = 1});
    const Relit lit = relit_under(b.transfer, uniform_light(1));
    for (size_t r = 0; r < b.receivers.count(); ++r) EXPECT_NEAR(lit.at(r).x, 1, half_rounding) << samples;
  }
}

}  // namespace
}  // namespace lambent
