#include <lambent/scene/scene.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// Rounding of a few float operations on values of order one.
constexpr float rounding = 2e-6f;

Texture checker() {  // rows from v = 0: red green / blue white
  Texture t;
  t.width = t.height = 2;
  t.rgb = {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255};
  return t;
}

void expect_color(Vec3 a, Vec3 b) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(a[c], b[c], rounding) << "channel " << c;
}

TEST(Srgb, KnownValues) {
  // Evaluated from the standard's formula in double precision.
  EXPECT_NEAR(srgb_to_linear(0.5f), 0.214041140482f, rounding);
  EXPECT_NEAR(srgb_to_linear(0.02f), 0.02f / 12.92f, rounding);
  EXPECT_NEAR(linear_to_srgb(0.18f), 0.461356129500f, rounding);
  EXPECT_EQ(srgb_to_linear(0.0f), 0.0f);
  EXPECT_NEAR(srgb_to_linear(1.0f), 1.0f, rounding);
}

TEST(Srgb, DecodesAndEncodesEveryByte) {
  float before = -1;
  for (int i = 0; i < 256; ++i) {
    float linear = srgb_to_linear(float(i) / 255.0f);
    EXPECT_GT(linear, before);
    EXPECT_EQ(int(std::lround(linear_to_srgb(linear) * 255.0f)), i);
    before = linear;
  }
}

TEST(SampleTexture, TexelCentresAreExact) {
  Texture t = checker();
  expect_color(sample_texture(t, {0.25f, 0.25f}), {1, 0, 0});
  expect_color(sample_texture(t, {0.75f, 0.25f}), {0, 1, 0});
  expect_color(sample_texture(t, {0.25f, 0.75f}), {0, 0, 1});
  expect_color(sample_texture(t, {0.75f, 0.75f}), {1, 1, 1});
}

TEST(SampleTexture, InterpolatesLinearValues) {
  Texture t = checker();
  t.rgb = {188, 188, 188, 0, 0, 0, 188, 188, 188, 0, 0, 0};
  float grey = srgb_to_linear(188.0f / 255.0f);
  expect_color(sample_texture(t, {0.5f, 0.25f}), Vec3(0.5f * grey));
  expect_color(sample_texture(t, {0.375f, 0.5f}), Vec3(0.75f * grey));
}

TEST(SampleTexture, WrapModes) {
  Texture t = checker();
  t.wrap_s = t.wrap_t = Wrap::repeat;
  expect_color(sample_texture(t, {0.0f, 0.25f}), {0.5f, 0.5f, 0});  // between the last and the first column
  expect_color(sample_texture(t, {-1.75f, 3.75f}), {0, 0, 1});
  t.wrap_s = Wrap::clamp;
  expect_color(sample_texture(t, {0.0f, 0.25f}), {1, 0, 0});
  expect_color(sample_texture(t, {-7.0f, 0.25f}), {1, 0, 0});
  expect_color(sample_texture(t, {9.0f, 0.25f}), {0, 1, 0});
  t.wrap_s = Wrap::mirror;
  expect_color(sample_texture(t, {0.0f, 0.25f}), {1, 0, 0});
  expect_color(sample_texture(t, {-0.75f, 0.25f}), {0, 1, 0});
  expect_color(sample_texture(t, {1.25f, 0.25f}), {0, 1, 0});
  expect_color(sample_texture(t, {2.25f, 0.25f}), {1, 0, 0});
}

TEST(SampleTexture, SurvivesAnyCoordinate) {
  Texture t = checker();
  for (Wrap wrap : {Wrap::repeat, Wrap::clamp, Wrap::mirror}) {
    t.wrap_s = t.wrap_t = wrap;
    for (float u : {NAN, INFINITY, -INFINITY, 1e38f, -1e38f, -1e-30f, 0.99999994f}) {
      Vec3 c = sample_texture(t, {u, -u});
      EXPECT_TRUE(is_finite(c));
      EXPECT_GE(c.x, 0.0f);
      EXPECT_LE(c.x, 1.0f);
    }
  }
}

Scene one_triangle() {
  Scene s;
  s.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {50, 50, 50}};
  s.normals.assign(4, Vec3(0, 0, 1));
  s.triangles = {{{0, 1, 2}, 0, false}};
  s.materials.resize(1);
  s.parts.resize(1);
  s.parts[0].vertex_count = 4, s.parts[0].triangle_count = 1;
  return s;
}

TEST(SceneBounds, CoversOnlyVerticesThatTrianglesUse) {
  Bounds box = bounds(one_triangle());
  EXPECT_EQ(box.min, Vec3(0, 0, 0));
  EXPECT_EQ(box.max, Vec3(1, 1, 0));
  EXPECT_TRUE(bounds(Scene{}).empty());
}

TEST(Albedo, MultipliesFactorTextureAndVertexColour) {
  Scene s = one_triangle();
  s.materials[0].base_color = {0.5f, 0.25f, 1.0f};
  expect_color(albedo(s, s.triangles[0], 0.2f, 0.3f), {0.5f, 0.25f, 1.0f});
  s.colors = {{1, 1, 1}, {0, 1, 0.5f}, {1, 1, 1}, {1, 1, 1}};
  expect_color(albedo(s, s.triangles[0], 1.0f, 0.0f), {0, 0.25f, 0.5f});
  s.textures.push_back(checker());
  s.materials[0].base_color_texture = 0;
  s.materials[0].texcoord_set = 1;
  s.texcoords[1] = {{0.25f, 0.25f}, {0.75f, 0.25f}, {0.25f, 0.75f}, {0, 0}};
  expect_color(albedo(s, s.triangles[0], 0.0f, 0.0f), {0.5f, 0, 0});
  expect_color(albedo(s, s.triangles[0], 0.0f, 1.0f), {0, 0, 1.0f});
  s.materials[0].uv_transform = {0, 1, 0, 1, 0, 0};  // u and v change places
  expect_color(albedo(s, s.triangles[0], 0.0f, 1.0f), {0, 0.25f, 0});
  s.materials[0].base_color = Vec3(5.0f);
  s.colors.clear();
  expect_color(albedo(s, s.triangles[0], 0.0f, 1.0f), {0, 1, 0});
}

TEST(MetallicRoughnessTexture, GreenIsRoughnessBlueIsMetallicLinear) {
  Scene s = one_triangle();
  s.materials[0].metallic = 0.5f, s.materials[0].roughness = 0.8f;
  auto expect_pair = [&](float u, float v, float metallic, float roughness) {
    const Vec2 m = metallic_roughness(s, s.triangles[0], u, v);
    EXPECT_NEAR(m.x, metallic, rounding);
    EXPECT_NEAR(m.y, roughness, rounding);
  };
  expect_pair(0.2f, 0.3f, 0.5f, 0.8f);
  s.textures.push_back(checker());
  s.textures[0].rgb = {7, 128, 51, 7, 255, 0, 7, 0, 255, 7, 0, 0};
  s.materials[0].metallic_roughness_texture = 0, s.materials[0].metallic_roughness_set = 1;
  s.texcoords[1] = {{0.25f, 0.25f}, {0.75f, 0.25f}, {0.25f, 0.75f}, {0, 0}};
  expect_pair(0, 0, 0.5f * 51 / 255, 0.8f * 128 / 255);  // not decoded from sRGB
  expect_pair(1, 0, 0, 0.8f);
  expect_pair(0, 1, 0.5f, 0);
  s.materials[0].metallic_roughness_transform = {0, 1, 0, 1, 0, 0};  // u and v change places
  expect_pair(0, 1, 0, 0.8f);
  s.materials[0].uv_transform = {0, 1, 0, 1, 0, 0};  // of the base colour: does not matter
  expect_pair(0, 1, 0, 0.8f);
}

}  // namespace
}  // namespace lambent
