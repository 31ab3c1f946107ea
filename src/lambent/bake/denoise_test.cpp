#include <lambent/bake/bake.h>
#include <lambent/bake/denoise.h>
#include <lambent/core/random.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lambent {
namespace {

constexpr size_t side = 40, width = 16, n = side * side;

// A plane of places, rows by a function of them, and noise of a known variance on top.
struct Plane {
  std::vector<Vec3> places, normals;
  std::vector<float> truth, noisy;
  std::vector<uint32_t> measured;
  std::vector<float> variance;
  std::vector<uint8_t> left_out = std::vector<uint8_t>(n, 0);

  template <class F>
  Plane(F f, float sigma) {
    Random random(7);
    for (size_t i = 0; i < n; ++i) {
      places.push_back(Vec3(float(i % side), 0, float(i / side)) / float(side)), normals.push_back(Vec3(0, 1, 0));
      for (size_t k = 0; k < width; ++k) {
        truth.push_back(f(places.back(), k));
        noisy.push_back(truth.back() + sigma * std::sqrt(12.0f) * (random.next() - 0.5f));
      }
      if (i % 16 == 0) measured.push_back(uint32_t(i)), variance.push_back(float(width) * sigma * sigma);
    }
  }
  NoisyPlaces noise() const { return {places, normals, left_out, measured, variance}; }
  std::vector<float> denoised() const {
    std::vector<float> out(n * width);
    EXPECT_TRUE(denoise(noise(), noisy.data(), width, out.data()));
    return out;
  }
  template <class Where>
  double rms(const std::vector<float>& rows, Where where) const {
    double sum = 0;
    size_t count = 0;
    for (size_t i = 0; i < n; ++i)
      for (size_t k = 0; where(places[i]) && k < width; ++k, ++count)
        sum += double(rows[i * width + k] - truth[i * width + k]) * double(rows[i * width + k] - truth[i * width + k]);
    return std::sqrt(sum / double(count));
  }
};
bool everywhere(Vec3) { return true; }

TEST(Denoise, LinearRowsLoseMostOfTheirNoise) {
  const Plane plane([](Vec3 p, size_t k) { return 0.1f * float(k) + p.x - 0.5f * p.z; }, 0.1f);
  const double before = plane.rms(plane.noisy, everywhere), after = plane.rms(plane.denoised(), everywhere);
  EXPECT_NEAR(before, 0.1, 0.005);
  // A plane fitted to 24 values of equal weight would leave 1/sqrt(24) = 0.2 inside; weights by distance a third more.
  EXPECT_LT(after, 0.4 * before);
  EXPECT_GT(after, 0.15 * before);
}

TEST(Denoise, ConstantRowsStayWhatTheyAre) {
  const Plane plane([](Vec3, size_t k) { return 1 + float(k); }, 0.0f);
  const std::vector<float> out = plane.denoised();
  for (size_t i = 0; i < out.size(); ++i) EXPECT_NEAR(out[i], plane.truth[i], 1e-5f * plane.truth[i]);
}

TEST(Denoise, AStepKeepsItsPlaceAndHeight) {
  const Plane plane([](Vec3 p, size_t) { return p.x < 0.5f ? 0.0f : 1.0f; }, 0.1f);
  const std::vector<float> out = plane.denoised();
  auto beside = [](Vec3 p) { return std::abs(p.x - 0.5f) < 1.5f / float(side); };
  EXPECT_LT(plane.rms(out, beside), plane.rms(plane.noisy, beside));
  // The mean of each side's first column: what is blurred across shows as a bias, noise does not.
  for (const bool right : {false, true}) {
    double sum = 0;
    for (size_t j = 0; j < side; ++j)
      for (size_t k = 0; k < width; ++k) sum += double(out[(j * side + side / 2 - (right ? 0 : 1)) * width + k]);
    EXPECT_NEAR(sum / double(side * width), right ? 1 : 0, 0.02);
  }
}

TEST(Denoise, WhereTheNoiseIsSmallDetailStays) {
  // Rows that differ from place to place for good, far above the noise: nothing may change much.
  const Plane plane(
      [](Vec3 p, size_t k) { return float(hash64(uint64_t(1e4f * p.x), uint64_t(1e4f * p.z) + k) % 97) / 97; }, 0.01f);
  EXPECT_LT(plane.rms(plane.denoised(), everywhere), 1.05 * plane.rms(plane.noisy, everywhere));
}

TEST(Denoise, TermsKeepTheirSumAndBuriedRowsStay) {
  Plane plane([](Vec3 p, size_t k) { return p.x * float(k); }, 0.05f);
  for (size_t i = 3; i < n; i += 50) plane.left_out[i] = 1;
  std::vector<float> out(n * width), a(n * width), b(n * width);
  Random random(3);
  for (size_t i = 0; i < a.size(); ++i) a[i] = random.next(), b[i] = plane.noisy[i] - a[i];
  float* more[] = {a.data(), b.data()};
  ASSERT_TRUE(denoise(plane.noise(), plane.noisy.data(), width, out.data(), more));
  for (size_t i = 0; i < out.size(); ++i) {
    EXPECT_NEAR(a[i] + b[i], out[i], 2e-5f);
    if (plane.left_out[i / width]) {
      EXPECT_EQ(out[i], plane.noisy[i]);
    }
  }
}

TEST(Denoise, OtherSurfacesNearbyTellNothing) {
  // Two planes a hair apart that face away from one another.
  Plane plane([](Vec3, size_t) { return 0.0f; }, 0.05f);
  for (size_t i = 0; i < n; i += 2) {
    plane.normals[i] = Vec3(0, -1, 0), plane.places[i].y = -1e-3f;
    for (size_t k = 0; k < width; ++k) plane.truth[i * width + k] += 1, plane.noisy[i * width + k] += 1;
  }
  EXPECT_LT(plane.rms(plane.denoised(), everywhere), 0.6 * plane.rms(plane.noisy, everywhere));
}

TEST(Denoise, ABakeIsNearerToTheTruth) {
  SKIP_UNDER_SANITIZERS();
  const Scene scene = make_courtyard(0.25f);
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  BakeOptions options{
      .order = 4, .samples = 4096, .bounces = 1, .precision = Precision::single, .denoise = false, .certify = false};
  auto truth = bake(scene, *tracer, receivers, options);
  options.samples = 64, options.seed = 2;
  auto noisy = bake(scene, *tracer, receivers, options);
  options.denoise = true;
  BakeReport report;
  auto denoised = bake(scene, *tracer, receivers, options, &report);
  auto error = [&](const Transfer& t) {
    double sum = 0, all = 0;
    for (size_t r = 0; r < receivers.count(); ++r) {
      const auto a = load_receiver(t, r), b = load_receiver(*truth, r);
      for (size_t k = 0; k < a.size(); ++k)
        sum += double(a[k] - b[k]) * double(a[k] - b[k]), all += double(b[k]) * double(b[k]);
    }
    return std::sqrt(sum / all);
  };
  const double before = error(*noisy), after = error(*denoised);
  EXPECT_LT(after, 0.75 * before);
  // What the bake says of itself, from one receiver in 16.
  EXPECT_NEAR(report.noise_of_rays / before, 1, 0.2);
  EXPECT_NEAR(report.denoised / after, 1, 0.25);
}

}  // namespace
}  // namespace lambent
