#include <lambent/bake/bake.h>
#include <lambent/bake/certify.h>
#include <lambent/core/random.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"
#include "true_error_test-inl.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lambent {
namespace {

TEST(Certificate, OfAParabolaBetweenReceiversIsTheClosedForm) {
  // x^2 over the unit square in cells of h: piecewise linear interpolation loses x (h - x) within each, RMS h^2 /
  // sqrt(30); the RMS of x^2 is 1 / sqrt(5).
  constexpr int cells = 4;
  const double h = 1.0 / cells;
  const Scene scene = make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), cells, cells, Vec3(0.5f));
  const Receivers receivers = make_vertex_receivers(scene);
  constexpr size_t width = 16;
  auto truth = [](Vec3 p) { return p.x * p.x; };
  std::vector<float> rows(receivers.count() * width, 0.0f);
  for (size_t v = 0; v < scene.positions.size(); ++v)
    rows[size_t(receivers.front[v]) * width] = truth(scene.positions[v]);
  // Each gather is right in the mean alone, with noise a hundred times the error looked for.
  const GatherAt noisy = [&](Vec3 origin, Vec3, uint64_t key, float* row) {
    std::fill_n(row, width, 0.0f);
    for (size_t k = 0; k < width; ++k) row[k] = 0.02f * (Random(key, k).next() - 0.5f);
    row[0] += truth(origin);
    return true;
  };
  auto certificate = certify(scene, receivers, rows.data(), width, noisy, 4000, 1);
  ASSERT_TRUE(certificate);
  const double expected = h * h / std::sqrt(30.0) * std::sqrt(5.0);
  EXPECT_NEAR(certificate->error, expected, 0.05 * expected);
  EXPECT_NEAR(certificate->error, expected, 4 * certificate->uncertain);
  EXPECT_LT(certificate->uncertain, 0.03 * expected);
  // Uniform noise of width 0.02 in 16 columns, against the RMS of x^2.
  const double noise = 0.02 / std::sqrt(12.0) * std::sqrt(16.0) * std::sqrt(5.0);
  EXPECT_NEAR(certificate->noise, noise, 0.02 * noise);
  ASSERT_EQ(certificate->parts.size(), 1u);
  EXPECT_EQ(certificate->parts[0], certificate->error);
}

TEST(Certificate, PlacesInsideSomethingDoNotCount) {
  const Scene scene = make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 1, 1, Vec3(0.5f));
  const Receivers receivers = make_vertex_receivers(scene);
  const std::vector<float> rows(receivers.count() * 16, 1.0f);
  const GatherAt half = [](Vec3 origin, Vec3, uint64_t, float* row) {
    std::fill_n(row, 16, 1.0f);
    return origin.x < 0.5f;
  };
  auto certificate = certify(scene, receivers, rows.data(), 16, half, 1000, 1);
  ASSERT_TRUE(certificate);
  EXPECT_NEAR(double(certificate->places), 500, 20);
  EXPECT_NEAR(certificate->error, 0, 1e-6);
  const GatherAt nowhere = [](Vec3, Vec3, uint64_t, float*) { return false; };
  auto none_left = certify(scene, receivers, rows.data(), 16, nowhere, 100, 1);
  ASSERT_TRUE(none_left);
  EXPECT_LT(none_left->error, 0);
}

TEST(Certificate, IsHonest) {
  SKIP_UNDER_SANITIZERS();
  const Scene scenes[] = {make_courtyard(0.12f)};
  for (const Scene& scene : scenes)
    for (const int samples : {32, 256}) {
      auto tracer = Tracer::build(scene);
      const Receivers receivers = make_vertex_receivers(scene);
      const BakeOptions options{.order = 4, .samples = samples, .bounces = 1, .seed = uint32_t(samples)};
      BakeReport report;
      auto stored = bake(scene, *tracer, receivers, options, &report);
      ASSERT_TRUE(stored);
      const double truth = test::true_error(scene, receivers, *stored, options);
      EXPECT_NEAR(report.certificate.error / truth, 1, 0.2) << samples << " rays, truth " << truth;
    }
}

// Boxes just above a floor, of a high albedo: errors that come back from close by.
TEST(Certificate, OfBoxesThatSendMuchBackIsHonest) {
  SKIP_UNDER_SANITIZERS();
  Scene scene = make_quad(Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 16, 16, Vec3(0.85f));
  add_box(scene, 0, "low", Vec3(-0.9f, 0.025f, -0.8f), Vec3(0.1f, 0.5f, 0.3f), 5);
  add_box(scene, 0, "high", Vec3(0.5f, 0.025f, 0.2f), Vec3(1.1f, 1.4f, 0.7f), 5);
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  for (const uint32_t seed : {1u, 2u}) {
    const BakeOptions options{.order = 3, .samples = 128, .bounces = 2, .seed = seed};
    BakeReport report;
    auto stored = bake(scene, *tracer, receivers, options, &report);
    ASSERT_TRUE(stored);
    const double truth = test::true_error(scene, receivers, *stored, options, 512);
    EXPECT_NEAR(report.certificate.error / truth, 1, 0.07) << "seed " << seed << ", truth " << truth;
  }
}

}  // namespace
}  // namespace lambent
