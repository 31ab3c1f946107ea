#include <lambent/light/project.h>
#include <lambent/relight/light.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// A skew gradient with a lamp on it.
Environment lit() {
  return make_environment("lit", 256, 128, [](Vec3 d) {
    const float lamp = std::exp(60 * (dot(d, normalize(Vec3(0.4f, 0.8f, -0.3f))) - 1));
    return Vec3(1 + 0.3f * d.x, 1 - 0.5f * d.y * d.z, 0.7f) + Vec3(20, 15, 9) * lamp;
  });
}

const LightBasis columns{
    4, LobeKind::von_mises_fisher, {{normalize(Vec3(0.4f, 0.8f, -0.3f)), 60}, {Vec3(-1, 0, 0), 20}}, {"desk"}};

TEST(ProjectLight, HarmonicsAloneAreWhatTheyAlwaysWere) {
  const Mat3 R = rotation_from_yaw_pitch_roll({30, -20, 10});
  EXPECT_EQ(project_light(lit(), {.order = 5}, R).light,
            rotate_sh(make_sh_rotation(5, R), project_environment(lit(), 5)));
  EXPECT_EQ(project_light(lit(), {.order = 5}, Mat3(1.0f), 9).light.size(), 25u);  // no more bands than there are
}

TEST(ProjectLight, OfKnownHarmonicsIsThatOfTheEnvironment) {
  const Mat3 R = rotation_from_yaw_pitch_roll({30, -20, 10});
  const LightBasis basis{.order = 5, .groups = {"desk"}};
  for (const int order : {3, 5}) {
    const LightProjection known = project_light(project_environment(lit(), order), basis, R, ShWindow::lanczos),
                          whole = project_light(lit(), basis, R, order, ShWindow::lanczos);
    EXPECT_EQ(known.light, whole.light);
    EXPECT_EQ(known.window, whole.window);
    EXPECT_EQ(known.basis.count(), whole.basis.count());
  }
}

TEST(ProjectLight, SteerableLobesTakeKnownHarmonicsToo) {
  const Mat3 R = rotation_from_yaw_pitch_roll({30, -20, 10});
  const LightBasis basis{0, LobeKind::band_limited, steerable_lobes(4), {"desk"}};
  EXPECT_EQ(project_light(project_environment(lit(), 4), basis, R).light, project_light(lit(), basis, R).light);
  EXPECT_TRUE(is_within_bands(basis) && !is_within_bands(columns));
}

TEST(ProjectLight, FillsEveryColumn) {
  const LightProjection p = project_light(lit(), columns);
  ASSERT_EQ(p.light.size(), 19u);
  // The lamp lies in the span: its coefficient is its strength over the lobe's scale.
  const double scale = lobe_scale(LobeKind::von_mises_fisher, 60);
  constexpr double texels = 5e-3;  // the map holds the lamp by its values at texel centres
  EXPECT_NEAR(p.light[16].x * scale, 20, 20 * texels);
  EXPECT_NEAR(p.light[16].z * scale, 9, 9 * texels);
  EXPECT_NEAR(p.light[17].x * lobe_scale(LobeKind::von_mises_fisher, 20), 0, 20 * texels);
  EXPECT_NEAR(p.light[0].z, 0.7f * std::sqrt(4 * pi), 20 * texels);
  EXPECT_EQ(p.light[18], Vec3(0));
}

TEST(ProjectLight, WithFewerBandsFitsBestWithoutTheOthers) {
  const LightProjection p = project_light(lit(), columns, Mat3(1.0f), 2);
  const auto small = make_directional_basis(2, columns.lobe_kind, columns.lobes);
  const auto expected = project_environment(lit(), small);
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(p.light[i], expected[i]);
  for (size_t i = 4; i < 16; ++i) EXPECT_EQ(p.light[i], Vec3(0));
  for (size_t i = 0; i < 2; ++i) EXPECT_EQ(p.light[16 + i], expected[4 + i]);
  EXPECT_EQ(p.basis.count(), 18u);  // fits the light, so that it can be drawn
}

TEST(ProjectLight, WindowsTheHarmonicsAlone) {
  const LightProjection plain = project_light(lit(), columns),
                        windowed = project_light(lit(), columns, Mat3(1.0f), 0, ShWindow::hann);
  const auto factors = sh_window(ShWindow::hann, 4);
  for (size_t i = 0; i < 16; ++i)
    EXPECT_LT(distance(windowed.light[i], plain.light[i] * factors[size_t(sh_band(int(i)))]), 1e-6f);
  for (size_t i = 16; i < 19; ++i) EXPECT_EQ(windowed.light[i], plain.light[i]);
}

TEST(ProjectLight, TakesLobesOrGroupsAlone) {
  EXPECT_EQ(project_light(lit(), {0, LobeKind::von_mises_fisher, even_lobes(12), {}}).light.size(), 12u);
  EXPECT_EQ(project_light(lit(), {0, LobeKind::von_mises_fisher, {}, {"a", "b"}}).light, std::vector<Vec3>(2, Vec3(0)));
}

}  // namespace
}  // namespace lambent
