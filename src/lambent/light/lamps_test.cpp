#include <lambent/core/random.h>
#include <lambent/light/lamps.h>
#include <lambent/light/project.h>
#include <lambent/light/sky.h>
#include <lambent/relight/light.h>

#include "sanitizers.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <filesystem>
#include <fstream>

namespace lambent {
namespace {

struct Disc {
  Vec3 axis;
  float radius;  // radians
  Vec3 radiance;
};

// Discs on a dim uneven sky.
Environment discs(const std::vector<Disc>& list, int width = 1024) {
  return make_environment("discs", width, width / 2, [&](Vec3 d) {
    for (const Disc& disc : list)
      if (dot(d, disc.axis) > std::cos(disc.radius)) return disc.radiance;
    return Vec3(0.2f, 0.25f, 0.3f) * (1 + 0.5f * d.x - 0.3f * d.z);
  });
}

float strength(const Disc& d) { return (d.radiance.x + d.radiance.y + d.radiance.z) * (1 - std::cos(d.radius)); }

TEST(EnvironmentLamps, AreFoundWhereTheyStand) {
  // The second crosses the seam of the map, the third lies on the zenith.
  const std::vector<Disc> list{{normalize(Vec3(0.3f, 0.8f, -0.5f)), 0.06f, Vec3(90, 80, 70)},
                               {normalize(Vec3(-1, 0.2f, 0.01f)), 0.09f, Vec3(5, 20, 10)},
                               {normalize(Vec3(0.01f, 1, 0.02f)), 0.08f, Vec3(3, 3, 30)},
                               {normalize(Vec3(0.5f, -0.4f, 0.6f)), 0.03f, Vec3(60, 60, 0)}};
  for (size_t i = 1; i < list.size(); ++i) ASSERT_GT(strength(list[i - 1]), strength(list[i]));
  const auto lamps = find_lamps(discs(list), 10);
  ASSERT_EQ(lamps.size(), list.size());
  for (size_t i = 0; i < list.size(); ++i) {
    constexpr float texel = 2 * pi / 1024;
    EXPECT_LT(distance(lamps[i].axis, list[i].axis), texel / 2) << i;
    // A disc's mean cosine is (1 + cos radius) / 2; that of a sharp lobe 1 - 1/s.
    const float expected = 2 / (1 - std::cos(list[i].radius));
    EXPECT_NEAR(lamps[i].sharpness / expected, 1, 2 * texel / list[i].radius) << i;  // texels on the rim
  }
  const auto two = find_lamps(discs(list), 2);
  ASSERT_EQ(two.size(), 2u);
  EXPECT_EQ(two[1].axis, lamps[1].axis);
}

TEST(EnvironmentLamps, AreNoneWhereNothingStandsOut) {
  for (float value : {0.0f, 1.0f})
    EXPECT_TRUE(find_lamps(make_environment("flat", 64, 32, [&](Vec3) { return Vec3(value); }), 8).empty());
  EXPECT_TRUE(find_lamps(discs({}), 8).empty());
  EXPECT_TRUE(find_lamps(discs({{Vec3(0, 1, 0), 0.1f, Vec3(50)}}), 0).empty());
  EXPECT_TRUE(find_lamps(make_environment("texel", 1, 1, [](Vec3) { return Vec3(1); }), 3).empty());
}

TEST(EnvironmentLamps, HaveTheSharpnessOfALobe) {
  // An environment that is one lobe on black: what is brighter than a fifth of the peak is found, which is narrower.
  for (float s : {8.0f, 100.0f, 2000.0f}) {
    const Vec3 axis = normalize(Vec3(0.4f, 0.3f, -0.7f));
    const auto basis = make_directional_basis(0, LobeKind::von_mises_fisher, {{axis, s}});
    const std::vector<Vec3> one{Vec3(1)};
    const auto lamps = find_lamps(reconstruct_environment(basis, one, 4096), 3);
    ASSERT_GE(lamps.size(), 1u);
    EXPECT_LT(distance(lamps[0].axis, axis), 0.05f / std::sqrt(s));
    // Cut where it has fallen to c a sharp lobe's mean of 1 - cos is (1 - c + c ln c) / (1 - c) / s. That is a texel
    // beyond where it has fallen to 1/5; not so sharp ones are cut earlier, at four times the mean.
    const float radius = std::sqrt(2 * std::log(5.0f) / s) + 2 * pi / 4096, c = std::exp(-0.5f * s * radius * radius);
    const float expected = s * (1 - c) / (1 - c + c * std::log(c));
    EXPECT_NEAR(lamps[0].sharpness / expected, 1, s < 50 ? 0.3f : 0.03f) << s;
  }
}

TEST(EnvironmentLamps, TheSunIsOneWhereverItStands) {
  SKIP_UNDER_SANITIZERS();
  // Its disc covers a few texels, some of them in part.
  for (float azimuth : {30.0f, 30.1f, 30.2f, 77.3f})
    for (int width : {512, 1024, 2048}) {
      auto sky = make_sky({.elevation = 40, .azimuth = azimuth, .width = width});
      ASSERT_TRUE(sky);
      const auto lamps = find_lamps(*sky, 5);
      ASSERT_EQ(lamps.size(), 1u) << azimuth << " " << width;
      const float e = radians(40.0f), a = radians(azimuth);
      EXPECT_LT(distance(lamps[0].axis, Vec3(std::cos(e) * std::cos(a), std::sin(e), std::cos(e) * std::sin(a))),
                0.5f * 2 * pi / float(width));
    }
}

TEST(EnvironmentLamps, AreNotTwiceTheSame) {
  // A sun in a glow that is cut off at its edge: a disc and a ring with the same axis.
  const Vec3 axis = normalize(Vec3(0.2f, 0.5f, 0.6f));
  for (float glow : {0.066f, 0.2f}) {
    const auto lamps =
        find_lamps(make_environment("glow", 1024, 512,
                                    [&](Vec3 d) {
                                      const float angle = std::acos(std::min(1.0f, dot(d, axis)));
                                      return Vec3(angle < 0.06f ? 1000.0f : angle < glow ? 100.0f : 0.1f);
                                    }),
                   4);
    EXPECT_EQ(lamps.size(), glow < 0.1f ? 1u : 2u);
    for (size_t i = 0; i < lamps.size(); ++i)
      for (size_t j = 0; j < i; ++j) EXPECT_LE(lobe_overlap(LobeKind::von_mises_fisher, lamps[i], lamps[j]), 0.8);
  }
}

DirectionalBasis mixed_basis(float sharpest) {
  return make_directional_basis(
      4, LobeKind::von_mises_fisher,
      {{normalize(Vec3(0.3f, 0.8f, -0.5f)), sharpest}, {normalize(Vec3(-0.7f, -0.1f, 0.4f)), 30}, {Vec3(0, 1, 0), 60}});
}

std::vector<Vec3> uneven(size_t count) {
  Random random(4);
  std::vector<Vec3> c(count);
  for (Vec3& v : c) v = Vec3(random.next(), random.next(), random.next()) - 0.3f;
  return c;
}

TEST(ProjectLobes, ReturnsTheCoefficientsOfWhatLiesInTheSpan) {
  const auto basis = mixed_basis(150);
  const auto light = uneven(basis.count());
  const Environment env = reconstruct_environment(basis, light, 2048);
  const auto again = project_environment(env, basis);
  // Texels hold means: a lobe loses s h^2 / 12 of itself, h = 0.003, which is 1e-4.
  for (size_t i = 0; i < light.size(); ++i)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(again[i][c], light[i][c], 5e-4f) << i;
}

TEST(ProjectLobes, ReturnsTheCoefficientsOfCompactAndSteerableLobes) {
  for (const auto& basis : {make_directional_basis(0, LobeKind::compact, even_lobes(40, LobeKind::compact)),
                            make_directional_basis(0, LobeKind::band_limited, steerable_lobes(5))}) {
    const auto light = uneven(basis.count());
    const auto again = project_environment(reconstruct_environment(basis, light, 1024), basis);
    for (size_t i = 0; i < light.size(); ++i)
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(again[i][c], light[i][c], 2e-3f) << int(basis.kind) << " " << i;
  }
}

TEST(ProjectLobes, IntegratesLobesOfAnySharpnessOverTexels) {
  SKIP_UNDER_SANITIZERS();
  // One bright texel on black, beside the axis; the lobe's integral over it by brute force.
  const int w = 64, h = 32, x = 40, y = 7;
  for (LobeKind kind : {LobeKind::cosine_power, LobeKind::von_mises_fisher, LobeKind::compact})
    for (float s : {2.0f, 40.0f, 800.0f, 1e5f}) {
      if (!is_lobe(kind, {Vec3(0, 1, 0), s})) continue;
      // Within half a standard deviation of the texel's corner or edge if sharp.
      const Vec3 axis =
          normalize(latlong_direction(Vec2((float(x) + 0.02f / std::sqrt(s)) / w, (float(y) + 0.3f) / h)));
      Environment env = make_environment("texel", w, h, [](Vec3) { return Vec3(0); });
      env.image.at(x, y) = Vec3(2, 1, 0.5f);
      const auto basis = make_directional_basis(0, kind, {{axis, s}});
      const Vec3 light = project_environment(env, basis)[0];
      double sum = 0;
      const int fine = 3000;
      const Vec3d a = normalize(Vec3d(axis));
      for (int j = 0; j < fine; ++j) {
        const double theta = std::numbers::pi * (y + (j + 0.5) / fine) / h, sine = std::sin(theta);
        for (int i = 0; i < fine; ++i) {
          const double phi = 2 * std::numbers::pi * ((x + (i + 0.5) / fine) / w - 0.5);
          sum += sine * lobe_value(kind, s, a.y * std::cos(theta) + sine * (a.x * std::cos(phi) + a.z * std::sin(phi)));
        }
      }
      const double expected = 2 * sum * lobe_scale(kind, s) * std::numbers::pi / h / fine * 2 * std::numbers::pi / w /
                              fine;
      EXPECT_NEAR(light.x / expected, 1, 2e-5) << int(kind) << " " << s;
      EXPECT_FLOAT_EQ(light.y, light.x / 2);
    }
}

TEST(ProjectLobes, AreTurnedWithTheEnvironment) {
  SKIP_UNDER_SANITIZERS();
  const Mat3 R = rotation_from_yaw_pitch_roll({40, 25, -70});
  const auto basis = mixed_basis(400);
  const Environment env =
      discs({{normalize(Vec3(0.3f, 0.5f, -0.5f)), 0.2f, Vec3(9, 8, 7)}, {Vec3(0, 0, 1), 0.3f, Vec3(1, 5, 3)}});
  const auto turned = project_environment(env, basis, R), resampled = project_environment(rotated(env, R, 6), basis);
  // Resampling blurs the discs' rims by a texel.
  for (size_t i = 0; i < turned.size(); ++i)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(turned[i][c], resampled[i][c], 0.01f) << i;
  const auto still = project_environment(env, basis);
  double moved = 0;
  for (size_t i = 0; i < still.size(); ++i) moved += length(still[i] - turned[i]);
  EXPECT_GT(moved, 1);
}

TEST(ProjectLobes, ReconstructsEnergyAtAnyWidth) {
  SKIP_UNDER_SANITIZERS();
  // Sharper than texels are wide, at the pole and elsewhere.
  for (Vec3 axis : {Vec3(0, 1, 0), normalize(Vec3(0.3f, -0.2f, 0.8f))}) {
    const auto basis = make_directional_basis(0, LobeKind::von_mises_fisher, {{axis, max_sharpness}});
    const std::vector<Vec3> one{Vec3(1)};
    for (int width : {64, 1024, 0}) {
      const Environment env = reconstruct_environment(basis, one, width);
      double sum = 0;
      for (int y = 0; y < env.image.height; ++y)
        for (int x = 0; x < env.image.width; ++x)
          sum += env.image.at(x, y).x * texel_solid_angle(y, env.image.width, env.image.height);
      EXPECT_NEAR(sum / lobe_integral(LobeKind::von_mises_fisher, max_sharpness), 1, 1e-5) << width;
      EXPECT_EQ(env.image.width, width ? width : 4096);
    }
  }
}

// What the page is held against (web/test/lobes_of_light.test.ts): a map by a formula, turned, on bases of each kind.
TEST(ProjectLobes, AreThoseThatThePageIsHeldAgainst) {
  Environment env = make_environment("formula", 96, 48, [](Vec3) { return Vec3(0); });
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 96; ++x) {
      const float v = float((7 * x + 13 * y) % 17) / 17;
      env.image.at(x, y) = Vec3(0.2f + v, 0.3f + 0.5f * v, 0.1f + float((5 * x + 3 * y) % 11) / 11);
      if (x >= 70 && x < 73 && y >= 12 && y < 14) env.image.at(x, y) = Vec3(40, 30, 20);
    }
  const auto path = std::filesystem::path(__FILE__).parent_path() / "../../../tests/golden/lobes_of_light.json";
  nlohmann::json golden;
  if (std::ifstream in(path); in) golden = nlohmann::json::parse(in);
  ASSERT_EQ(golden["cases"].size(), 7u);
  for (auto& item : golden["cases"]) {
    const auto kind = LobeKind(std::find(std::begin(lobe_names), std::end(lobe_names), item["lobeKind"]) - lobe_names);
    LightBasis columns{.order = item["order"], .lobe_kind = kind};
    for (const auto& l : item["lobes"]) columns.lobes.push_back({Vec3(l[0], l[1], l[2]), l[3]});
    const auto light =
        project_light(env, columns, rotation_from_yaw_pitch_roll({40, -25, 70}), 0, ShWindow::none).light;
    nlohmann::json found = nlohmann::json::array();
    for (const Vec3& c : light) found.push_back({c.x, c.y, c.z});
    const auto& kept = item["coefficients"];
    EXPECT_EQ(kept.size(), light.size()) << found.dump();
    for (size_t i = 0; i < std::min(kept.size(), light.size()); ++i)
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(kept[i][size_t(c)].get<float>(), light[i][c], 1e-4f) << i;
  }
}

}  // namespace
}  // namespace lambent
