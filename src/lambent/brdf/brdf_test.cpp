#include <lambent/brdf/brdf.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

#include <gtest/gtest.h>

#include <vector>

namespace lambent {
namespace {

// Every alternative of Brdf, with the eye overhead, aslant and near the horizon.
const std::vector<Brdf> brdfs{Lambert{Vec3(1)}, Lambert{Vec3(0.8f, 0.5f, 0.1f)}};
const std::vector<Vec3> eyes{Vec3(0, 0, 1), Vec3(0.6f, 0, 0.8f), glm::normalize(Vec3(-3, 2, 0.1f))};

// Midpoint rule over the hemisphere, equal steps of cos(theta) and phi.
template <class F>
auto integrate_hemisphere(int nz, int nphi, F f) {
  decltype(f(Vec3())) sum{};
  for (int i = 0; i < nz; ++i)
    for (int j = 0; j < nphi; ++j) {
      float z = (float(i) + 0.5f) / float(nz), phi = 2 * pi * (float(j) + 0.5f) / float(nphi), r = std::sqrt(1 - z * z);
      sum += f(Vec3(r * std::cos(phi), r * std::sin(phi), z));
    }
  return sum * (2 * pi / float(nz * nphi));
}

TEST(Brdf, WhiteLambertReflectsEverything) {
  // The integrand is linear in cos(theta), for which the midpoint rule is exact; 20,000 float additions round to 1e-5.
  constexpr float tolerance = 1e-4f;
  for (Vec3 wo : eyes) {
    Vec3 white = integrate_hemisphere(100, 200, [&](Vec3 wi) { return evaluate(Lambert{Vec3(1)}, wi, wo) * wi.z; });
    const Vec3 albedo(0.8f, 0.5f, 0.1f);
    Vec3 coloured = integrate_hemisphere(100, 200, [&](Vec3 wi) { return evaluate(Lambert{albedo}, wi, wo) * wi.z; });
    EXPECT_LT(glm::length(white - Vec3(1)), tolerance);
    EXPECT_LT(glm::length(coloured - albedo), tolerance);
  }
}

TEST(Brdf, DensityIntegratesToOne) {
  constexpr float tolerance = 1e-4f;  // as above
  for (const Brdf& brdf : brdfs)
    for (Vec3 wo : eyes) EXPECT_NEAR(integrate_hemisphere(100, 200, [&](Vec3 wi) { return pdf(brdf, wi, wo); }), 1.0f, tolerance);
}

TEST(Brdf, Reciprocal) {
  Random random(1);
  for (const Brdf& brdf : brdfs)
    for (int i = 0; i < 1000; ++i) {
      Vec3 a = square_to_cosine_hemisphere(random.next2()), b = square_to_cosine_hemisphere(random.next2());
      Vec3 ab = evaluate(brdf, a, b), ba = evaluate(brdf, b, a);
      EXPECT_LE(glm::length(ab - ba), 1e-6f * glm::length(ab));  // a few roundings
    }
}

TEST(Brdf, SampleAgreesWithEvaluateAndPdf) {
  Random random(2);
  constexpr float tolerance = 1e-5f;  // relative: a few roundings
  for (const Brdf& brdf : brdfs)
    for (Vec3 wo : eyes)
      for (int i = 0; i < 1000; ++i) {
        BrdfSample s = sample(brdf, wo, random.next2());
        if (s.pdf == 0) continue;
        EXPECT_NEAR(glm::length(s.wi), 1.0f, tolerance);
        EXPECT_NEAR(s.pdf, pdf(brdf, s.wi, wo), tolerance * s.pdf);
        Vec3 weight = evaluate(brdf, s.wi, wo) * (s.wi.z / s.pdf);
        EXPECT_LT(glm::length(s.weight - weight), tolerance * glm::length(weight));
      }
}

TEST(Brdf, SamplesFollowDensity) {
  // Pearson's chi-square over nz x nphi cells of equal solid angle. For d = nz * nphi - 1 degrees of freedom it has mean d and
  // variance 2 d; six standard deviations are passed by chance less than once in a million runs, and the key is fixed anyway.
  constexpr int nz = 10, nphi = 16, draws = 100000, fine = 20;
  const double degrees = nz * nphi - 1, limit = degrees + 6 * std::sqrt(2 * degrees);
  Random random(3);
  for (const Brdf& brdf : brdfs)
    for (Vec3 wo : eyes) {
      std::vector<double> count(nz * nphi), expected(nz * nphi);
      for (int i = 0; i < draws; ++i) {
        BrdfSample s = sample(brdf, wo, random.next2());
        ASSERT_GT(s.pdf, 0);
        int z = std::min(int(s.wi.z * nz), nz - 1);
        int phi = std::min(int((std::atan2(s.wi.y, s.wi.x) / (2 * pi) + 0.5f) * nphi), nphi - 1);
        ++count[size_t(z * nphi + phi)];
      }
      for (int i = 0; i < nz * fine; ++i)
        for (int j = 0; j < nphi * fine; ++j) {
          float z = (float(i) + 0.5f) / (nz * fine), r = std::sqrt(1 - z * z);
          float phi = ((float(j) + 0.5f) / (nphi * fine) - 0.5f) * 2 * pi;
          expected[size_t(i / fine * nphi + j / fine)] +=
              pdf(brdf, Vec3(r * std::cos(phi), r * std::sin(phi), z), wo) * 2 * pi / (nz * nphi * fine * fine) * draws;
        }
      double chi2 = 0;
      for (size_t i = 0; i < count.size(); ++i) chi2 += (count[i] - expected[i]) * (count[i] - expected[i]) / expected[i];
      EXPECT_LT(chi2, limit);
    }
}

TEST(Brdf, NothingBelowTheHorizon) {
  const Vec3 above(0.6f, 0, 0.8f), below(0.6f, 0, -0.8f), level(1, 0, 0);
  for (const Brdf& brdf : brdfs)
    for (Vec3 down : {below, level}) {
      EXPECT_EQ(evaluate(brdf, down, above), Vec3(0));
      EXPECT_EQ(evaluate(brdf, above, down), Vec3(0));
      EXPECT_EQ(pdf(brdf, down, above), 0);
      EXPECT_EQ(pdf(brdf, above, down), 0);
      EXPECT_EQ(sample(brdf, down, Vec2(0.3f)).pdf, 0);
    }
}

}  // namespace
}  // namespace lambent
