#include <lambent/bake/lobes.h>
#include <lambent/bake/matrix.h>
#include <lambent/basis/quadrature.h>
#include <lambent/core/parallel.h>
#include <lambent/light/lamps.h>
#include <lambent/light/project.h>
#include <lambent/light/sky.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/relight/light.h>
#include <lambent/relight/relight.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include "sanitizers.h"

namespace lambent {
namespace {

struct Baking {
  Scene scene;
  Receivers receivers;
  Transfer transfer;
};

Baking bake_scene(Scene scene, const BakeOptions& options) {
  auto tracer = Tracer::build(scene);
  EXPECT_TRUE(tracer);
  Baking b{std::move(scene), {}, {}};
  b.receivers = make_vertex_receivers(b.scene);
  auto transfer = bake(b.scene, *tracer, b.receivers, options);
  EXPECT_TRUE(transfer) << (transfer ? "" : transfer.error().text());
  if (transfer) b.transfer = *transfer;
  return b;
}

const std::vector<Lobe> skew_lobes{{normalize(Vec3(0.3f, 0.8f, -0.5f)), 5000},
                                   {normalize(Vec3(0.2f, 0.3f, 0.7f)), 3},  // reaches well below the plane
                                   {normalize(Vec3(-0.9f, 0.2f, 0.1f)), 40},
                                   {Vec3(0, -1, 0), 100000}};

const std::vector<Lobe> compact_lobes{{normalize(Vec3(0.3f, 0.8f, -0.5f)), 1000},
                                      {normalize(Vec3(0.2f, 0.3f, 0.7f)), 3},
                                      {normalize(Vec3(-0.9f, 0.2f, 0.1f)), 40},
                                      {Vec3(0, -1, 0), 300}};
const std::vector<Lobe> band_limited_lobes{{normalize(Vec3(0.3f, 0.8f, -0.5f)), 9},
                                           {normalize(Vec3(0.2f, 0.3f, 0.7f)), 3},
                                           {normalize(Vec3(-0.9f, 0.2f, 0.1f)), 1},
                                           {Vec3(0, -1, 0), 16}};

TEST(BakeLobes, OpenPlaneIsTheIntegral) {
  SKIP_UNDER_SANITIZERS();
  const Vec3 a(0.1f, 0.2f, 1), b(1, -0.2f, 0), n = normalize(cross(a, b));
  const Mat3 frame = frame_about(n);
  for (LobeKind kind : {LobeKind::von_mises_fisher, LobeKind::cosine_power, LobeKind::compact, LobeKind::band_limited})
    for (bool shadows : {true, false}) {
      const std::vector<Lobe>& lobes = kind == LobeKind::compact      ? compact_lobes
                                     : kind == LobeKind::band_limited ? band_limited_lobes
                                                                      : skew_lobes;
      // Without shadows a closed form; with them the two sharp lobes have 2,048 stratified rays each, and the broad
      // ones what of the fan's 4,096 meets them: few of the grazing one, which sets the absolute tolerance.
      const double relative = shadows ? 2e-3 : 1e-4, absolute = shadows ? 5e-4 : 1e-5;
      const Baking baked = bake_scene(make_quad(Vec3(0), a, b, 2, 2, Vec3(0.8f)), {.order = 2,
                                                                                   .lobe_kind = kind,
                                                                                   .lobes = lobes,
                                                                                   .samples = 4096,
                                                                                   .bounces = 0,
                                                                                   .shadows = shadows,
                                                                                   .precision = Precision::single});
      ASSERT_EQ(baked.transfer.columns(), 8u);
      for (size_t k = 0; k < lobes.size(); ++k) {
        const double s = lobes[k].sharpness, scale = lobe_scale(kind, s);
        double expected = 0;
        if (s >= 1000) {
          expected = std::max(0.0f, dot(lobes[k].axis, n)) * lobe_integral(kind, s) / std::numbers::pi;
          if (kind == LobeKind::compact) expected *= 1 - 0.6 / s;  // its mean cosine; the others' are sharper
        } else {
          for (const DirectionNode& node : direction_quadrature(160, 0, 1)) {
            const double cosine = dot(normalize(Vec3d(lobes[k].axis)), Mat3d(frame) * node.direction);
            expected += node.weight * node.direction.z * scale * lobe_value(kind, s, cosine) / std::numbers::pi;
          }
        }
        for (size_t r = 0; r < baked.receivers.count(); ++r)
          EXPECT_NEAR(load_receiver(baked.transfer, r)[4 + k], expected, std::max(absolute, relative * expected))
              << int(kind) << shadows << " lobe " << k;
      }
    }
}

TEST(BakeLobes, BoundsItsRays) {
  EXPECT_TRUE(is_sharp(LobeKind::von_mises_fisher, {Vec3(0, 1, 0), 100}, 1024));
  EXPECT_FALSE(is_sharp(LobeKind::compact, {Vec3(0, 1, 0), 50}, 1024));
  EXPECT_FALSE(is_sharp(LobeKind::band_limited, {Vec3(0, 1, 0), 9}, 16));
  EXPECT_EQ(rays_per_lobe(1024, 1), 1024);
  EXPECT_EQ(rays_per_lobe(1024, 8), 128);
  EXPECT_EQ(rays_per_lobe(16, 8), 64);
  EXPECT_EQ(rays_per_lobe(1024, 0), 0);
}

// A floor under a black awning: a lamp at 45 degrees shines under it from one side.
TEST(BakeLobes, ASharpLampCastsASharpShadow) {
  Scene scene;
  add_quad(scene, add_material(scene, "grey", Vec3(0.5f)), "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 40,
           40);
  add_quad(scene, add_material(scene, "black", Vec3(0)), "awning", Vec3(-1, 1, -20), Vec3(2, 0, 0), Vec3(0, 0, 40), 1,
           1);
  for (Triangle& t : scene.triangles) t.two_sided = true;
  const Lobe lamp{normalize(Vec3(1, 1, 0)), 1e5f};
  const Baking b = bake_scene(
      std::move(scene), {.order = 2, .lobes = {lamp}, .samples = 64, .bounces = 1, .precision = Precision::single});
  const float lit = float(lobe_integral(LobeKind::von_mises_fisher, lamp.sharpness)) * lamp.axis.y / pi;
  int in_light = 0, in_shadow = 0;
  for (size_t v = 0; v < 41 * 41; ++v) {
    const float x = b.scene.positions[v].x;  // the awning's shadow lies on [-2, 0]
    const float value = load_receiver(b.transfer, b.receivers.front[v])[4];
    if (x > 0.05f) {
      EXPECT_NEAR(value / lit, 1, 0.01f) << x;
      ++in_light;
    } else if (x < -0.05f && x > -1.95f) {
      EXPECT_EQ(value, 0) << x;
      ++in_shadow;
    }
  }
  EXPECT_GT(in_light, 700);
  EXPECT_GT(in_shadow, 700);
}

Scene court() {
  Scene scene;
  const uint32_t red = add_material(scene, "red", Vec3(0.8f, 0.2f, 0.1f)),
                 grey = add_material(scene, "grey", Vec3(0.6f));
  add_quad(scene, grey, "floor", Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 24, 24);
  add_quad(scene, red, "wall", Vec3(-1, 0, -1), Vec3(2, 0, 0), Vec3(0, 1.5f, 0), 24, 18);
  add_sphere(scene, grey, "ball", Vec3(0.3f, 0.5f, -0.2f), 0.35f, 3);
  return scene;
}

// The same rays, so the same transfer in other coordinates: under any light, turned anyhow, to rounding.
TEST(BakeLobes, SteerableLobesAreTheHarmonicsInOtherWords) {
  auto sky = make_sky({.elevation = 50, .azimuth = 70, .width = 256});
  ASSERT_TRUE(sky);
  BakeOptions options{.order = 4, .samples = 256, .bounces = 2, .precision = Precision::single, .denoise = false};
  const Baking harmonics = bake_scene(court(), options);
  options.order = 0, options.lobe_kind = LobeKind::band_limited, options.lobes = steerable_lobes(4);
  const Baking steerable = bake_scene(court(), options);
  ASSERT_EQ(steerable.transfer.columns(), harmonics.transfer.columns());
  for (const Vec3 turn : {Vec3(0), Vec3(40, 25, -70), Vec3(-160, 5, 33)}) {
    const Mat3 R = rotation_from_yaw_pitch_roll(turn);
    Relit of_harmonics, of_lobes;
    relight(harmonics.transfer, project_light(*sky, harmonics.transfer.light, R).light, of_harmonics);
    relight(steerable.transfer, project_light(*sky, steerable.transfer.light, R).light, of_lobes);
    float most = 0, off = 0;
    for (size_t r = 0; r < harmonics.receivers.count(); ++r) {
      most = std::max(most, of_harmonics.at(r).x);
      off = std::max(off, length(of_harmonics.at(r) - of_lobes.at(r)));
    }
    EXPECT_GT(most, 0.1f);
    EXPECT_LT(off, 2e-5f * most);
  }
}

TEST(BakeLobes, AgreesWithThePathTracerUnderSunAndSky) {
  SKIP_UNDER_SANITIZERS();
  auto sky = make_sky({.elevation = 50, .azimuth = 70, .width = 512});
  ASSERT_TRUE(sky);
  const Mat3 R = rotation_from_yaw_pitch_roll({15, 10, -5});
  for (bool directional : {false, true}) {
    const std::vector<Lobe> lobes = directional ? even_lobes(24) : find_lamps(*sky, 2);
    ASSERT_GE(lobes.size(), 1u);
    const Baking b = bake_scene(court(), {.order = directional ? 0 : 5, .lobes = lobes, .samples = 2048, .bounces = 2});
    const LightProjection projection = project_light(*sky, b.transfer.light, directional ? R : Mat3(1.0f));
    ASSERT_EQ(projection.light.size(), b.transfer.columns());
    Relit lit;
    relight(b.transfer, projection.light, lit);
    const Environment env = reconstruct_environment(projection.basis, projection.light, directional ? 0 : 2048);
    std::vector<Vec3> origins, normals;
    std::vector<size_t> chosen;
    for (size_t k = 0; k < 16; ++k) {
      chosen.push_back(k * b.receivers.count() / 16 + 7);
      origins.push_back(b.receivers.origins[chosen.back()]), normals.push_back(b.receivers.normals[chosen.back()]);
    }
    const auto truth = exit_radiances(b.scene, env, origins, normals, 2, 8192, 3);
    // Rays, paths, half floats, and bounces between vertices: 2 % of the brightest, which the sun makes 3.
    float brightest = 0;
    for (const auto& t : truth) brightest = std::max(brightest, t.mean.y);
    EXPECT_GT(brightest, 1.0f);
    for (size_t k = 0; k < 16; ++k)
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(lit.at(chosen[k])[c], truth[k].mean[c], 0.02f * brightest)
            << directional << " receiver " << k << " channel " << c;
  }
}

// A lamp that has moved, fitted to the columns of where it was, against a bake of where it is. What is lost of the
// light bounds what is lost at every receiver (Cauchy-Schwarz, with V cos / pi, whose norm is sqrt(2 pi / 3) / pi at
// most).
TEST(BakeLobes, ALampThatMovedLosesNoMoreThanItsLightDoes) {
  const Lobe was{normalize(Vec3(0.6f, 0.7f, 0.3f)), 60}, other{normalize(Vec3(-0.5f, 0.6f, 0.5f)), 40};
  const BakeOptions options{.order = 4,
                            .lobes = {was, other},
                            .samples = 2048,
                            .bounces = 0,
                            .precision = Precision::single,
                            .denoise = false};
  const Baking before = bake_scene(court(), options);
  std::vector<Vec3> light(18, Vec3(0.0f));
  light[0] = Vec3(1, 1.2f, 1.5f), light[2] = Vec3(0.3f), light[16] = Vec3(3, 2, 1), light[17] = Vec3(0.5f);
  double last = -1;
  for (float angle : {0.0f, 3.0f, 10.0f, 40.0f}) {
    const float t = radians(angle);
    const Vec3 across = normalize(Vec3(-0.7f, 0.6f, 0));
    const Vec3 there = normalize(std::cos(t) * was.axis + std::sin(t) * across);
    BakeOptions at_place = options;
    at_place.lobes[0].axis = there;
    const Baking after = bake_scene(court(), at_place);
    const Vec3 axes[2] = {there, other.axis};
    const MovedLight moved = move_light({.light = light}, before.transfer.light, Mat3(1.0f), axes);
    Relit fitted, truth;
    relight(before.transfer, moved.projection.light, fitted), relight(after.transfer, light, truth);
    double worst = 0;
    for (size_t r = 0; r < before.receivers.count(); ++r)
      worst = std::max(worst, double(length(fitted.at(r) - truth.at(r))));
    const double bound = std::sqrt(moved.lost) * std::sqrt(2 * std::numbers::pi / 3) / std::numbers::pi;
    std::printf("%2.0f degrees: %.1f %% of the light is lost, the worst receiver is off by %.3f of at most %.3f\n",
                angle, 100 * std::sqrt(moved.lost / moved.whole), worst, bound);
    EXPECT_LE(worst, bound + 0.01) << angle;  // both are traced
    EXPECT_GT(worst, last) << angle;
    if (angle == 0) EXPECT_LT(worst, 1e-4);
    else EXPECT_GT(worst, 0.05 * bound) << angle;  // and what the bound speaks of is there
    last = worst;
  }
}

// By texels: a map of the moved light, projected as any environment is.
TEST(BakeLobes, MovedLightIsTheProjectionOfItsMap) {
  SKIP_UNDER_SANITIZERS();
  LightBasis columns{.order = 4, .lobes = {{normalize(Vec3(0.6f, 0.7f, 0.3f)), 150}, {Vec3(0, 0, 1), 40}}};
  std::vector<Vec3> light(18);
  for (size_t i = 0; i < 18; ++i) light[i] = Vec3(0.3f + 0.1f * float(i % 5), 0.5f, float(i % 3) - 0.7f);
  const Mat3 R = rotation_from_yaw_pitch_roll({40, 25, -70});
  const Vec3 axes[2] = {normalize(Vec3(0.7f, 0.6f, 0.35f)), normalize(Vec3(0.1f, 0.1f, 1))};
  const auto sky = rotate_sh(make_sh_rotation(4, R), std::span<const Vec3>(light).first(16));
  std::vector<Vec3> there(sky.begin(), sky.end());
  there.push_back(light[16]), there.push_back(light[17]);
  const auto elsewhere = make_directional_basis(4, LobeKind::von_mises_fisher, {{axes[0], 150}, {axes[1], 40}});
  const Environment map = reconstruct_environment(elsewhere, there, 2048);
  for (int order : {0, 3}) {  // all bands, three of them
    std::vector<Vec3> of_bands = light;
    if (order)
      for (size_t i = 9; i < 16; ++i) of_bands[i] = Vec3(0.0f);
    std::vector<Vec3> in_place = there;
    if (order)
      for (size_t i = 9; i < 16; ++i) in_place[i] = Vec3(0.0f);
    const LightProjection expected =
        project_light(order ? reconstruct_environment(elsewhere, in_place, 2048) : map, columns, Mat3(1.0f), order);
    const MovedLight moved = move_light({.light = of_bands}, columns, R, axes, order);
    for (size_t i = 0; i < 18; ++i) EXPECT_LT(length(moved.projection.light[i] - expected.light[i]), 2e-3f) << i;
    EXPECT_NEAR(squared_radiance(moved.projection), moved.whole - moved.lost, 1e-4 * moved.whole);
    EXPECT_NEAR(squared_radiance(expected), moved.whole - moved.lost, 2e-3 * moved.whole);
    EXPECT_NEAR(squared_radiance(order ? reconstruct_environment(elsewhere, in_place, 2048) : map), moved.whole,
                2e-3 * moved.whole);
    EXPECT_GT(moved.lost, 0.02 * moved.whole);
  }
}

TEST(BakeLobes, TheSameBytesWhateverTheThreadsAndTheMemory) {
  const Scene scene = court();
  auto bytes_with = [&](int threads, int bounces, size_t memory) {
    ThreadLimit limit(threads);
    const Baking b =
        bake_scene(scene, {.order = 3, .lobes = skew_lobes, .samples = 64, .bounces = bounces, .memory = memory});
    return std::vector<uint8_t>(b.transfer.data.begin(), b.transfer.data.end());
  };
  const BakeOptions options{.order = 3, .lobes = skew_lobes, .samples = 64, .bounces = 2};
  const size_t least = least_memory(make_vertex_receivers(scene).count(), true, options);
  for (int bounces : {0, 2}) {
    const auto expected = bytes_with(1, bounces, size_t{4} << 30);
    EXPECT_EQ(bytes_with(2, bounces, size_t{4} << 30), expected);
    EXPECT_EQ(bytes_with(2, bounces, least + (size_t{1} << 18)), expected);
  }
}

TEST(BakeLobes, RefusesLobesThatAreNone) {
  const Scene scene = make_quad(Vec3(0), Vec3(1, 0, 0), Vec3(0, 1, 0), 1, 1, Vec3(0.5f));
  auto tracer = Tracer::build(scene);
  ASSERT_TRUE(tracer);
  const Receivers receivers = make_vertex_receivers(scene);
  for (Lobe bad : {Lobe{Vec3(0), 5},
                   {Vec3(0, 2, 0), 5},
                   {Vec3(0, 1, 0), 0},
                   {Vec3(0, 1, 0), -1},
                   {Vec3(0, 1, 0), 1e9f},
                   {Vec3(0, NAN, 0), 5},
                   {Vec3(0, 1, 0), NAN}})
    EXPECT_FALSE(bake(scene, *tracer, receivers, {.lobes = {bad}}));
  EXPECT_FALSE(bake(scene, *tracer, receivers, {.order = 1, .lobes = std::vector<Lobe>(1024, {Vec3(0, 1, 0), 5})}));
  EXPECT_TRUE(bake(scene, *tracer, receivers, {.order = 0, .lobes = {{Vec3(0, 1, 0), 5}}, .samples = 1}));
}

TEST(BakeLobes, MatrixRowsAreTheIntegralsTheyStandFor) {
  const Vec3 a(0.1f, 0.2f, 1), b(1, -0.2f, 0);
  const Scene scene = make_quad(Vec3(0), a, b, 1, 1, Vec3(0.8f));
  auto tracer = Tracer::build(scene);
  ASSERT_TRUE(tracer);
  const Receivers receivers = make_vertex_receivers(scene);
  ReceiverMaterials materials{{LinearMaterial{Lambert{Vec3(0)}, Lambert{Vec3(1)}}}, {}, {}};
  materials.of_receiver.assign(receivers.count(), 0);
  for (const Vec3& n : receivers.normals) materials.frames.push_back(frame_about(n));
  const Lobe beam{normalize(Vec3(0.5f, 0.9f, -0.3f)), 1e5f}, broad{normalize(Vec3(-0.7f, 0.4f, 0.2f)), 6};
  auto baked =
      bake_matrix(scene, *tracer, receivers, materials,
                  {.order = 2, .lobes = {beam, broad}, .samples = 4096, .bounces = 0, .precision = Precision::single},
                  {.incident_order = 4, .outgoing = OutgoingKind::map, .grid = 8});
  ASSERT_TRUE(baked) << baked.error().text();
  const CosineBasis basis = make_cosine_basis(4);
  std::vector<float> z(16);
  for (size_t r = 0; r < receivers.count(); ++r) {
    const auto values = load_receiver(baked->transfer, r);  // [row][column]
    evaluate_cosine_basis(basis, beam.axis * materials.frames[r], z);
    const float strength = float(lobe_integral(LobeKind::von_mises_fisher, beam.sharpness)) *
                           dot(beam.axis, receivers.normals[r]) / pi;
    for (size_t j = 0; j < 16; ++j) EXPECT_NEAR(values[j * 6 + 4] / strength, z[j], 2e-3f) << j;  // the beam's width
    std::vector<double> expected(16);
    const Vec3 axis = broad.axis * materials.frames[r];
    for (const DirectionNode& node : direction_quadrature(64, 0, 1)) {
      evaluate_cosine_basis(basis, Vec3(node.direction), z);
      const double value = lobe_scale(LobeKind::von_mises_fisher, 6) *
                           lobe_value(LobeKind::von_mises_fisher, 6, dot(Vec3d(axis), node.direction));
      for (size_t j = 0; j < 16; ++j) expected[j] += node.weight * value * node.direction.z * z[j] / std::numbers::pi;
    }
    for (size_t j = 0; j < 16; ++j)
      EXPECT_NEAR(values[j * 6 + 5], expected[j], 3e-3) << j;  // 4,096 stratified rays, rows of norm 1
  }
}

TEST(BakeLobes, MatrixWithLambertIsTheDiffuseBake) {
  const Scene scene = court();
  auto tracer = Tracer::build(scene);
  ASSERT_TRUE(tracer);
  const Receivers receivers = make_vertex_receivers(scene);
  ReceiverMaterials materials{{LinearMaterial{Lambert{Vec3(0)}, Lambert{Vec3(1)}}}, {}, {}};
  materials.of_receiver.assign(receivers.count(), 0);
  for (const Vec3& n : receivers.normals) materials.frames.push_back(frame_about(n));
  for (int bounces : {0, 2}) {
    const BakeOptions options{.order = 3,
                              .lobes = skew_lobes,
                              .samples = 128,
                              .bounces = bounces,
                              .precision = Precision::single,
                              .denoise = false};
    auto vector = bake(scene, *tracer, receivers, options);
    auto matrix = bake_matrix(scene, *tracer, receivers, materials, options,
                              {.incident_order = 3, .outgoing = OutgoingKind::svd, .svd_rows = 2, .grid = 8});
    ASSERT_TRUE(vector);
    ASSERT_TRUE(matrix) << matrix.error().text();
    std::vector<Vec3> light(vector->columns(), Vec3(0.5f, 1, 0.2f));
    Relit a, b;
    relight(*vector, light, a), relight(matrix->transfer, light, b);
    std::vector<ViewWeights> weights(size_t(matrix->transfer.rows));
    // As for harmonics: the same rays, hits rounded.
    for (size_t r = 0; r < receivers.count(); ++r) {
      evaluate_outgoing(matrix->outgoing, r, receivers.normals[r], weights);
      const Vec3 radiance = reflect_rows(weights, Vec3(1), [&](size_t row) { return b.at(r, int(row)); });
      EXPECT_LT(length(radiance - a.at(r)), bounces ? 2e-3f : 2e-5f) << r;
    }
  }
}

}  // namespace
}  // namespace lambent
