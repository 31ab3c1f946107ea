#include <lambent/bake/materials.h>
#include <lambent/bake/matrix.h>
#include <lambent/bake/response.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/relight/factors.h>
#include <lambent/relight/relight.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lambent {
namespace {

// A floor, a wall and a box, in two colours.
Scene corner_scene() {
  Scene scene;
  const uint32_t red = add_material(scene, "red", Vec3(0.8f, 0.3f, 0.2f)),
                 grey = add_material(scene, "grey", Vec3(0.6f));
  add_quad(scene, red, "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 12, 12);
  add_quad(scene, grey, "wall", Vec3(-2, 0, -2), Vec3(4, 0, 0), Vec3(0, 3, 0), 12, 12);
  add_box(scene, grey, "box", Vec3(-0.5f, 0.01f, -0.5f), Vec3(0.5f, 1.0f, 0.5f), 4);
  return scene;
}

ReceiverMaterials all_of(const LinearMaterial& material, const Receivers& receivers) {
  ReceiverMaterials m;
  m.materials = {material};
  m.of_receiver.assign(receivers.count(), 0);
  for (const Vec3& n : receivers.normals) m.frames.push_back(frame_about(n));
  return m;
}

const LinearMaterial diffuse{Lambert{Vec3(0)}, Lambert{Vec3(1)}};

std::vector<Vec3> uneven_light(int order, uint64_t seed) {
  Random random(seed);
  std::vector<Vec3> light(size_t(sh_count(order)));
  for (size_t k = 0; k < light.size(); ++k)
    light[k] = (Vec3(random.next(), random.next(), random.next()) - 0.5f) / float(1 + sh_band(int(k)));
  light[0] = Vec3(3, 2.5f, 2);
  return light;
}

// The eigenvalues of convolution, by the midpoint rule.
TEST(Matrix, PhongConvolutionHasTheEigenvaluesOfItsLobe) {
  for (float n : {1.0f, 2.0f, 3.5f, 20.0f, 200.0f}) {
    const std::vector<double> bands = phong_convolution(n, 9);
    for (int l = 0; l < 9; ++l) {
      double sum = 0;
      const int steps = 200000;
      for (int i = 0; i < steps; ++i) {
        const double t = (i + 0.5) / steps;
        sum += (n + 2.0) * std::pow(t, double(n)) * std::legendre(unsigned(l), t) / steps;
      }
      EXPECT_NEAR(bands[size_t(l)], sum, 1e-6) << "n " << n << " band " << l;
    }
  }
}

// An open plane under uneven light, seen from several sides. By definition the rows give the lobe's integral of L cos
// cut off at the incident order; the true integral is neared as the order grows.
TEST(Matrix, PhongByConvolutionIsTheLobesIntegralOfBandLimitedLight) {
  SKIP_UNDER_SANITIZERS();
  const Scene scene = make_quad(Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 1, 1, Vec3(0.5f));
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  const Phong phong{Vec3(0.3f, 0.2f, 0.1f), Vec3(0.2f, 0.4f, 0.6f), 6};
  const std::vector<Vec3> light = uneven_light(3, 17);
  auto radiance_of = [&](Vec3 d) {
    std::vector<float> y(9);
    evaluate_sh(3, d, y);
    Vec3 sum(0.0f);
    for (size_t k = 0; k < 9; ++k) sum += y[k] * light[k];
    return sum;
  };
  // Even directions of the sphere.
  const int count = 40000;
  auto direction = [&](int i) {
    const float z = 1 - 2 * (float(i) + 0.5f) / float(count), phi = 2.39996323f * float(i), r = std::sqrt(1 - z * z);
    return Vec3(r * std::cos(phi), z, r * std::sin(phi));
  };
  const float each = 4 * pi / float(count);
  double last_error = 1e9;
  for (int m : {3, 5, 8}) {
    auto baked = bake_matrix(scene, *tracer, receivers, all_of({phong, phong}, receivers),
                             {.order = 3, .samples = 16384, .bounces = 0, .precision = Precision::single},
                             {.incident_order = m, .outgoing = OutgoingKind::phong, .grid = 8, .response_samples = 16});
    ASSERT_TRUE(baked) << baked.error().text();
    ASSERT_EQ(baked->transfer.rows, m * m + 1);
    Relit relit;
    relight(baked->transfer, light, relit);
    std::vector<Vec3> band_limited(size_t(m * m), Vec3(0.0f));
    std::vector<float> y(band_limited.size());
    Vec3 irradiance(0.0f);
    for (int i = 0; i < count; ++i) {
      const Vec3 d = direction(i);
      if (d.y <= 0) continue;
      irradiance += each * d.y * radiance_of(d);
      evaluate_sh(m, d, y);
      for (size_t k = 0; k < y.size(); ++k) band_limited[k] += each * y[k] * d.y * radiance_of(d);
    }
    double error = 0;
    for (const Vec3& view :
         {normalize(Vec3(0.1f, 1, 0.2f)), normalize(Vec3(-0.8f, 0.7f, 0.1f)), normalize(Vec3(0.3f, 0.4f, -0.9f))}) {
      const Vec3 mirrored(-view.x, view.y, -view.z);
      Vec3 expected = phong.diffuse * irradiance / pi, truth = expected;
      for (int i = 0; i < count; ++i) {
        const Vec3 d = direction(i);
        const float lobe = each * (phong.exponent + 2) / (2 * pi) *
                           std::pow(std::max(0.0f, dot(d, mirrored)), phong.exponent);
        if (lobe == 0) continue;
        evaluate_sh(m, d, y);
        Vec3 g(0.0f);
        for (size_t k = 0; k < y.size(); ++k) g += y[k] * band_limited[k];
        expected += phong.specular * lobe * g;
        if (d.y > 0) truth += phong.specular * lobe * d.y * radiance_of(d);
      }
      std::vector<ViewWeights> weights(size_t(relit.rows));
      evaluate_outgoing(baked->outgoing, 0, view, weights);
      const Vec3 got = reflect_rows(weights, Vec3(1), [&](size_t row) { return relit.at(0, int(row)); });
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(got[c], expected[c], 0.01f * std::abs(expected[c]) + 0.002f) << "m " << m;
        error += std::abs(got[c] - truth[c]) / std::abs(truth[c]) / 9;
      }
    }
    EXPECT_LT(error, last_error + 0.002);
    last_error = error;
  }
  EXPECT_LT(last_error, 0.02);
  EXPECT_FALSE(bake_matrix(scene, *tracer, receivers, all_of({Ggx{}, Ggx{}}, receivers),
                           {.order = 3, .samples = 16, .bounces = 0}, {.outgoing = OutgoingKind::phong}));
}

// Light times kept visibility, or the same product baked into matrices: the same numbers.
TEST(Matrix, VisibilityAsAFactorGivesTheRowsOfADirectMatrix) {
  const Scene scene = corner_scene();
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  const ReceiverMaterials materials = all_of({Ggx{.alpha = Vec2(0.3f)}, Ggx{.alpha = Vec2(0.3f)}}, receivers);
  const int n = 4, m = 3;
  const MatrixOptions options{.incident_order = m, .outgoing = OutgoingKind::map, .grid = 8, .response_samples = 64};
  auto matrix = bake_matrix(scene, *tracer, receivers, materials,
                            {.order = n, .samples = 256, .bounces = 0, .precision = Precision::single}, options);
  auto visibility =
      bake(scene, *tracer, receivers,
           {.order = n + m - 1, .samples = 256, .bounces = 0, .precision = Precision::single, .denoise = false});
  ASSERT_TRUE(matrix && visibility);
  const Outgoing outgoing = make_map_outgoing(materials, m, options);
  const std::vector<Vec3> light = uneven_light(n, 5);
  Relit a, b;
  relight(matrix->transfer, light, a);
  relight_factors(*visibility, outgoing, light, b);
  ASSERT_EQ(a.rows, b.rows);
  double difference = 0, total = 0;
  for (size_t r = 0; r < receivers.count(); ++r)
    for (int j = 0; j < m * m; ++j)
      for (int c = 0; c < 3; ++c)
        difference += std::pow(a.at(r, j)[c] - b.at(r, j)[c], 2), total += std::pow(a.at(r, j)[c], 2);
  EXPECT_GT(total, 100);
  EXPECT_LT(std::sqrt(difference / total), 1e-4);
  std::vector<ViewWeights> wa(size_t(a.rows)), wb(wa.size());
  evaluate_outgoing(matrix->outgoing, 7, normalize(receivers.normals[7] + Vec3(0.2f, 0.1f, 0.3f)), wa);
  evaluate_outgoing(outgoing, 7, normalize(receivers.normals[7] + Vec3(0.2f, 0.1f, 0.3f)), wb);
  for (size_t j = 0; j < wa.size(); ++j) EXPECT_EQ(wa[j], wb[j]);
}

TEST(Matrix, WithLambertIsTheDiffuseBake) {
  const Scene scene = corner_scene();
  auto tracer = Tracer::build(scene);
  ASSERT_TRUE(tracer);
  const Receivers receivers = make_vertex_receivers(scene);
  for (int bounces : {0, 2}) {
    const BakeOptions options{
        .order = 4, .samples = 512, .bounces = bounces, .precision = Precision::single, .denoise = false};
    auto vector = bake(scene, *tracer, receivers, options);
    ASSERT_TRUE(vector);
    for (OutgoingKind kind : {OutgoingKind::map, OutgoingKind::svd}) {
      MatrixOptions matrix{.incident_order = 3, .outgoing = kind, .svd_rows = 2, .grid = 8};
      auto baked = bake_matrix(scene, *tracer, receivers, all_of(diffuse, receivers), options, matrix);
      ASSERT_TRUE(baked) << baked.error().text();
      ASSERT_EQ(baked->transfer.rows, kind == OutgoingKind::map ? 9 : 1);
      // The same rays; the bounces' hits are rounded (u, v to 16 bits; weights of the diffuse operator to halves).
      double worst = 0;
      std::vector<ViewWeights> weights(size_t(baked->transfer.rows));
      const std::vector<Vec3> light = uneven_light(4, 3);
      Relit a, b;
      relight(*vector, light, a);
      relight(baked->transfer, light, b);
      for (size_t r = 0; r < receivers.count(); ++r) {
        evaluate_outgoing(baked->outgoing, r,
                          normalize_or(receivers.normals[r] + Vec3(0.3f, 0.1f, -0.2f), Vec3(0, 1, 0)), weights);
        const Vec3 radiance = reflect_rows(weights, Vec3(1), [&](size_t row) { return b.at(r, int(row)); });
        worst = std::max(worst, double(length(radiance - a.at(r))));
      }
      EXPECT_LT(worst, bounces ? 2e-3 : 2e-5) << outgoing_names[int(kind)] << " " << bounces;
    }
  }
}

TEST(Matrix, IsTheSameOnOneThreadAndInLittleMemory) {
  const Scene scene = corner_scene();
  auto tracer = Tracer::build(scene);
  ASSERT_TRUE(tracer);
  const Receivers receivers = make_vertex_receivers(scene);
  BakeOptions options{.order = 3, .samples = 128, .bounces = 2};
  const MatrixOptions matrix{.incident_order = 3, .outgoing = OutgoingKind::map, .grid = 8};
  auto a = bake_matrix(scene, *tracer, receivers, all_of(diffuse, receivers), options, matrix);
  options.memory = matrix_memory(receivers.count(), 3, options, matrix) + 1000;
  ThreadLimit one(1);
  BakeReport report;
  auto b = bake_matrix(scene, *tracer, receivers, all_of(diffuse, receivers), options, matrix, &report);
  ASSERT_TRUE(a && b);
  EXPECT_LT(report.operator_kept, 0.5);
  EXPECT_TRUE(
      std::equal(a->transfer.data.begin(), a->transfer.data.end(), b->transfer.data.begin(), b->transfer.data.end()));
  options.memory = 1000;
  auto none = bake_matrix(scene, *tracer, receivers, all_of(diffuse, receivers), options, matrix);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message.find("bytes"), std::string::npos);
}

TEST(Matrix, ColouredReflectionTintsBouncesInGreyScenes) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.6f));
  add_quad(scene, grey, "floor", Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 6, 6);
  add_quad(scene, grey, "wall", Vec3(-1, 0, -1), Vec3(2, 0, 0), Vec3(0, 2, 0), 6, 6);
  auto tracer = Tracer::build(scene);
  ASSERT_TRUE(tracer);
  const Receivers receivers = make_vertex_receivers(scene);
  const Brdf gold = Ggx{Vec3(0.9f, 0.6f, 0.2f), Vec2(0.3f)};
  // Scattered once, light is tinted once: channels of the bounce alone stand as f0 do, but for Schlick's whitening at
  // grazing.
  std::vector<Vec3> total;
  for (int bounces : {0, 1}) {
    auto baked = bake_matrix(scene, *tracer, receivers, all_of({gold, gold}, receivers),
                             {.order = 2, .samples = 512, .bounces = bounces, .precision = Precision::single},
                             {.incident_order = 3, .outgoing = OutgoingKind::map, .grid = 8, .response_samples = 256});
    ASSERT_TRUE(baked);
    EXPECT_EQ(baked->transfer.channels, bounces ? 3 : 1);
    Relit relit;
    const std::vector<Vec3> light(4, Vec3(1));
    relight(baked->transfer, light, relit);
    Vec3 sum(0.0f);
    for (size_t r = 0; r < receivers.count(); ++r) sum += relit.at(r);
    total.push_back(sum);
  }
  const Vec3 bounce = total[1] - total[0];
  EXPECT_GT(bounce.x, 0);
  EXPECT_LT(bounce.z / bounce.x, 0.6f);
  EXPECT_GT(bounce.z / bounce.x, 0.2f / 0.9f);
}

TEST(Matrix, RowsAreTheIntegralsTheyStandFor) {
  // Rows of direct transfer on the floor beside the wall, against a plain sum over an independent set of directions.
  const Scene scene = corner_scene();
  auto tracer = Tracer::build(scene);
  ASSERT_TRUE(tracer);
  const Receivers receivers = make_vertex_receivers(scene);
  const BakeOptions options{.order = 4, .samples = 4096, .bounces = 0, .precision = Precision::single};
  const MatrixOptions matrix{.incident_order = 4, .outgoing = OutgoingKind::map, .grid = 8};
  const ReceiverMaterials materials = all_of(diffuse, receivers);
  auto baked = bake_matrix(scene, *tracer, receivers, materials, options, matrix);
  ASSERT_TRUE(baked);
  const CosineBasis basis = make_cosine_basis(4);
  std::vector<float> z(16), y(16);
  for (size_t r = 5; r < receivers.count(); r += 97) {
    std::vector<double> sum(16 * 16, 0.0);
    const int count = 1 << 15;
    for (int s = 0; s < count; ++s) {
      const Vec3 local = square_to_cosine_hemisphere(sobol_owen(uint32_t(s), 77)), world = materials.frames[r] * local;
      if (tracer->closest(receivers.origins[r], world).triangle != none) continue;
      evaluate_cosine_basis(basis, local, z);
      evaluate_sh(4, world, y);
      for (size_t j = 0; j < 16; ++j)
        for (size_t i = 0; i < 16; ++i) sum[j * 16 + i] += double(z[j]) * y[i] / count;
    }
    const std::vector<float> t = load_receiver(baked->transfer, r);
    // 4,096 scrambled Sobol' points against a discontinuous visibility: about 4096^-0.75 of functions up to 3.
    for (size_t k = 0; k < 256; ++k)
      EXPECT_NEAR(t[k], sum[k], 0.02) << "receiver " << r << " row " << k / 16 << " column " << k % 16;
  }
}

}  // namespace
}  // namespace lambent
