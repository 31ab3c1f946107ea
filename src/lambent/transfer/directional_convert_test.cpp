// The targets' shader formulas, written out, on converted coefficients, against our own evaluation.
#include <lambent/basis/sh.h>
#include <lambent/transfer/directional_convert.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// Rows of a lamp of irradiance I (over pi) from direction s, and some uniform light: no axis like another.
std::vector<Vec3> rows_of(int order, Vec3 s, Vec3 I, Vec3 uniform) {
  std::vector<float> y(size_t(sh_count(order)));
  evaluate_sh(order, s, y);
  std::vector<Vec3> rows;
  for (int k = 0; k < sh_count(order); ++k) rows.push_back(float(clamped_cosine(sh_band(k))) * y[size_t(k)] / pi * I);
  rows[0] += uniform * std::sqrt(4 * pi);
  return rows;
}

const Vec3 sun = normalize(Vec3(0.3f, 0.8f, -0.5f)),
           directions[] = {{1, 0, 0}, {0, -1, 0}, {0, 0, 1}, {0.6f, 0.64f, -0.48f}, {-0.48f, 0.6f, 0.64f}};

TEST(DirectionalConvert, ThreeMakesOurIrradiance) {
  for (DirectionalKind kind : {DirectionalKind::sh2, DirectionalKind::sh3}) {
    const std::vector<Vec3> rows = rows_of(kind == DirectionalKind::sh2 ? 2 : 3, sun, {3, 2, 1}, {1, 2, 3});
    std::vector<Vec3> c = three_light_probe(kind, rows);
    ASSERT_EQ(c.size(), size_t(directional_rows(kind)));
    c.resize(9, Vec3(0));
    for (Vec3 n : directions) {
      const float x = n.x, y = n.y, z = n.z;
      const Vec3 e = c[0] * 0.886227f + c[1] * 2.0f * 0.511664f * y + c[2] * 2.0f * 0.511664f * z +
                     c[3] * 2.0f * 0.511664f * x + c[4] * 2.0f * 0.429043f * x * y + c[5] * 2.0f * 0.429043f * y * z +
                     c[6] * (0.743125f * z * z - 0.247708f) + c[7] * 2.0f * 0.429043f * x * z +
                     c[8] * 0.429043f * (x * x - y * y);
      const Vec3 ours = pi * evaluate_directional_light(kind, rows, Mat3(1.0f), n);
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(e[k], ours[k], 1e-4f * (1 + ours[k]));
    }
  }
}

TEST(DirectionalConvert, GodotMakesOurIrradianceOverPi) {
  for (Vec3 uniform : {Vec3(1, 2, 3), Vec3(0)}) {
    const std::vector<Vec3> rows = rows_of(2, sun, {3, 2, 1}, uniform);
    const std::array<Vec3, 4> layer = godot_lightmap_layers(DirectionalKind::sh2, rows);
    for (int k = 1; k < 4; ++k)
      for (int c = 0; c < 3; ++c) EXPECT_TRUE(layer[size_t(k)][c] >= 0.25f && layer[size_t(k)][c] <= 0.75f);
    for (Vec3 n : directions) {
      const Vec3 l0 = layer[0], m1 = (layer[1] - 0.5f) * 2.0f, m2 = (layer[2] - 0.5f) * 2.0f,
                 m3 = (layer[3] - 0.5f) * 2.0f;
      const Vec3 e = max(l0 + m1 * n.y * (l0 * 4.0f) + m2 * n.z * (l0 * 4.0f) + m3 * n.x * (l0 * 4.0f), Vec3(0));
      const Vec3 ours = evaluate_directional_light(DirectionalKind::sh2, rows, Mat3(1.0f), n);
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(e[k], ours[k], 1e-5f * (1 + ours[k]));
    }
  }
  // Where no light is, layers are neutral.
  const std::vector<Vec3> dark(4, Vec3(0));
  EXPECT_EQ(godot_lightmap_layers(DirectionalKind::sh2, dark)[2], Vec3(0.5f));
}

TEST(DirectionalConvert, GodotsUnpackedLayersDo) {
  const std::vector<Vec3> rows = rows_of(2, sun, {3, 2, 1}, {0.1f, 0.2f, 0.3f});
  const std::array<Vec3, 4> l = godot_unpacked_layers(DirectionalKind::sh2, rows);
  for (Vec3 n : directions) {
    const Vec3 e = l[0] * 0.282095f + (l[1] * n.y + l[2] * n.z + l[3] * n.x) * 0.32573f;
    const Vec3 ours = evaluate_directional_light(DirectionalKind::sh2, rows, Mat3(1.0f), n);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(std::max(0.0f, e[k]), ours[k], 1e-4f * (1 + ours[k]));
  }
}

TEST(DirectionalConvert, UnityBendsItsColourAsOurLuminanceBends) {
  const Vec3 luminance(0.2126f, 0.7152f, 0.0722f), normal = normalize(Vec3(0.1f, 0.9f, -0.3f));
  // Enough light from all around that the direction is not cut off at a length of 1; and a lamp alone, where it is.
  for (float around : {3.0f, 0.0f}) {
    const std::vector<Vec3> rows = rows_of(2, sun, {1, 1, 1}, Vec3(around));
    const UnityDirection d = unity_direction(DirectionalKind::sh2, rows, normal);
    const auto light = [&](Vec3 n) {
      return dot(evaluate_directional_light(DirectionalKind::sh2, rows, Mat3(1.0f), n), luminance);
    };
    EXPECT_LE(length(d.direction - 0.5f), 0.5001f);
    EXPECT_GT(dot(d.direction - 0.5f, sun), 0);
    EXPECT_NEAR(d.balance, dot(normal, d.direction - 0.5f) + 0.5f, 1e-6f);
    for (Vec3 n : directions)
      if (around > 0)
        EXPECT_NEAR(light(normal) * (dot(n, d.direction - 0.5f) + 0.5f) / d.balance, light(n), 1e-4f * light(n));
  }
  EXPECT_EQ(unity_direction(DirectionalKind::sh2, std::vector<Vec3>(4, Vec3(0)), normal).balance, 0.5f);
}

}  // namespace
}  // namespace lambent
