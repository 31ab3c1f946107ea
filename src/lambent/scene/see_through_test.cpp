#include <lambent/scene/procedural.h>
#include <lambent/scene/see_through.h>
#include <lambent/scene/textures.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

Scene pane(Vec3 color = Vec3(0.5f)) { return make_quad(Vec3(0), Vec3(1, 0, 0), Vec3(0, 1, 0), 1, 1, color); }

// A texture of one row, white, of the given alphas.
Texture alphas(std::vector<uint8_t> a) {
  Texture t;
  t.width = int(a.size()), t.height = 1, t.rgb.assign(3 * a.size(), 255), t.alpha = std::move(a);
  t.wrap_s = t.wrap_t = Wrap::clamp;
  return t;
}

TEST(SeeThrough, SplitsLightBetweenPassingAndReflecting) {
  Scene s = pane(Vec3(0.8f, 0.4f, 0.2f));
  Material& m = s.materials[0];
  const Triangle& t = s.triangles[0];
  m.metallic = 0;
  EXPECT_TRUE(see_through_materials(s).empty());
  EXPECT_EQ(transmittance(s, t, 0.3f, 0.3f), Vec3(0));

  m.alpha_mode = AlphaMode::blend, m.alpha = 0.25f;  // a quarter is there
  EXPECT_EQ(transmittance(s, t, 0.3f, 0.3f), Vec3(0.75f));
  EXPECT_EQ(albedo(s, t, 0.3f, 0.3f), m.base_color);
  m.transmission = 0.5f;  // of which half passes, coloured: 3/4 + 1/4 1/2 C
  const Vec3 passes = transmittance(s, t, 0.3f, 0.3f), expected(0.85f, 0.8f, 0.775f);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(passes[c], expected[c], 1e-6f);
  EXPECT_EQ(albedo(s, t, 0.3f, 0.3f), 0.5f * m.base_color);
  // What passes and what is reflected never add up to more than all.
  for (int c = 0; c < 3; ++c)
    EXPECT_LE(passes[c] + coverage(s, t, 0.3f, 0.3f) * albedo(s, t, 0.3f, 0.3f)[c], 1.0f + 1e-6f);
  m.metallic = 1;  // metal is opaque where it covers
  EXPECT_EQ(transmittance(s, t, 0.3f, 0.3f), Vec3(0.75f));
  EXPECT_EQ(see_through_materials(s), std::vector<uint8_t>{1});
}

TEST(SeeThrough, MasksCutWhereAlphaIsBelowTheCutoff) {
  Scene s = pane();
  s.texcoords[0] = {Vec2(0, 0), Vec2(1, 0), Vec2(0, 1), Vec2(1, 1)};
  for (size_t i = 0; i < s.positions.size(); ++i) s.texcoords[0][i] = {s.positions[i].x, s.positions[i].y};
  s.textures = {alphas({0, 255})};
  Material& m = s.materials[0];
  m.base_color_texture = 0;
  const Triangle& t = s.triangles[0];
  auto at = [&](float x) {  // the weights of a point of the plane
    const Vec3 a = s.positions[t.v[0]], ab = s.positions[t.v[1]] - a, ac = s.positions[t.v[2]] - a, p(x, 0.1f, 0);
    const float area = cross(ab, ac).z;
    return Vec2(cross(p - a, ac).z / area, cross(ab, p - a).z / area);
  };
  // Alpha runs from 0 at x = 1/4 to 1 at 3/4.
  for (float cutoff : {0.25f, 0.5f, 0.75f}) {
    m.alpha_mode = AlphaMode::mask, m.alpha_cutoff = cutoff;
    EXPECT_TRUE(is_see_through(s, m));
    for (float x : {0.1f, 0.3f, 0.45f, 0.55f, 0.7f, 0.9f}) {
      const bool hole = std::clamp(2 * x - 0.5f, 0.0f, 1.0f) < cutoff;
      EXPECT_EQ(transmittance(s, t, at(x).x, at(x).y), Vec3(hole ? 1.0f : 0.0f)) << cutoff << " " << x;
    }
  }
  m.alpha_cutoff = 2;  // above 1 nothing is left
  EXPECT_EQ(transmittance(s, t, at(0.9f).x, at(0.9f).y), Vec3(1));
  m.alpha_mode = AlphaMode::opaque;  // alpha means nothing
  EXPECT_FALSE(is_see_through(s, m));
  EXPECT_EQ(coverage(s, t, at(0.1f).x, at(0.1f).y), 1);
  m.alpha_mode = AlphaMode::blend, s.textures = {alphas({255, 255})};  // marked, and yet solid
  EXPECT_FALSE(is_see_through(s, m));
}

TEST(SeeThrough, NumbersThatAreNoneLeaveSurfacesSolid) {
  Scene s = pane();
  Material& m = s.materials[0];
  m.metallic = 0, m.alpha_mode = AlphaMode::blend, m.alpha = NAN, m.transmission = NAN;
  EXPECT_EQ(transmittance(s, s.triangles[0], 0.2f, 0.2f), Vec3(0));
  m.alpha_mode = AlphaMode::mask, m.alpha_cutoff = NAN;
  EXPECT_EQ(transmittance(s, s.triangles[0], 0.2f, 0.2f), Vec3(0));
  m.alpha_mode = AlphaMode::blend, m.alpha = -3, m.transmission = 7;
  EXPECT_EQ(transmittance(s, s.triangles[0], 0.2f, 0.2f), Vec3(1));
}

TEST(SeeThrough, TexturesWithAnAlphaMapOfTheirOwn) {
  Texture color;  // two texels: red, blue
  color.width = 2, color.height = 1, color.rgb = {255, 0, 0, 0, 0, 255}, color.wrap_s = color.wrap_t = Wrap::clamp;
  Texture grey;
  grey.width = 2, grey.height = 1, grey.rgb = {10, 10, 10, 200, 200, 200}, grey.wrap_s = grey.wrap_t = Wrap::clamp;
  auto both = with_alpha(color, grey, "both");
  ASSERT_TRUE(both);
  EXPECT_EQ(both->rgb, color.rgb);
  EXPECT_EQ(both->alpha, (std::vector<uint8_t>{10, 200}));
  auto again = decode_texture(both->encoded, "again");  // the picture that a file would hold says the same
  ASSERT_TRUE(again);
  EXPECT_EQ(again->rgb, color.rgb);
  EXPECT_EQ(again->alpha, both->alpha);
  auto alone = with_alpha(Texture{}, alphas({0, 128, 255}), "alone");
  ASSERT_TRUE(alone);
  EXPECT_EQ(alone->width, 3);
  EXPECT_EQ(alone->rgb, std::vector<uint8_t>(9, 255));
  EXPECT_EQ(alone->alpha, (std::vector<uint8_t>{0, 128, 255}));
  EXPECT_FALSE(with_alpha(Texture{}, Texture{}, "nothing"));
}

}  // namespace
}  // namespace lambent
