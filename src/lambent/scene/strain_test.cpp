#include <lambent/scene/strain.h>

#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

namespace lambent {
namespace {

double outline(double depth) {
  constexpr int n = 20000;
  const auto height = [&](int i) { return -depth * std::pow(std::sin(std::numbers::pi * i / n), 2); };
  double sum = 0;
  for (int i = 0; i < n; ++i) sum += std::hypot(1.0 / n, height(i + 1) - height(i));
  return sum;
}

TEST(Strain, GroovesAreAsLongAsTheirOutlines) {
  for (const double depth : {0.0, 0.01, 0.1, 0.5, 1.0, 5.0}) EXPECT_NEAR(groove_length(depth), outline(depth), 1e-6);
}

// In the plane z = 0, texture coordinates by a skewed map of it; two parts.
Scene card() {
  Scene s;
  const uint32_t m = add_material(s, "card", Vec3(0.5f));
  for (int part = 0; part < 2; ++part) {
    constexpr uint32_t n = 6;
    const uint32_t first = uint32_t(s.positions.size());
    for (uint32_t j = 0; j <= n; ++j)
      for (uint32_t i = 0; i <= n; ++i) {
        const Vec2 p(float(i) / n, float(j) / n);
        s.positions.push_back({p.x + float(3 * part), p.y, 0}), s.normals.push_back({0, 0, 1});
        s.texcoords[0].push_back({3 * p.x + p.y, 2 * p.y - 0.5f * p.x});
      }
    const uint32_t from = uint32_t(s.triangles.size());
    for (uint32_t j = 0; j < n; ++j)
      for (uint32_t i = 0; i < n; ++i) {
        const uint32_t v = first + j * (n + 1) + i;
        s.triangles.push_back({{v, v + 1, v + n + 2}, uint32_t(part), false});
        s.triangles.push_back({{v, v + n + 2, v + n + 1}, uint32_t(part), false});
      }
    Part p;
    p.material = m, p.first_vertex = first, p.vertex_count = uint32_t(s.positions.size()) - first;
    p.first_triangle = from, p.triangle_count = uint32_t(s.triangles.size()) - from;
    s.parts.push_back(p);
  }
  return s;
}

using Move = std::function<Vec3(Vec3)>;
std::vector<Vec3> moved(const Scene& s, const Move& move) {
  std::vector<Vec3> out;
  for (const Vec3& p : s.positions) out.push_back(move(p));
  return out;
}

// Where in the plane the phase tile . uv rises: of the card's map of texture coordinates.
Vec2 across(Vec2 tile) {
  const Vec2 g(3 * tile.x - 0.5f * tile.y, tile.x + 2 * tile.y);
  return g / std::hypot(g.x, g.y);
}

TEST(Strain, LiesAcrossWhereItIsPressedAndKeepsLengths) {
  const Scene s = card();
  for (const float angle : {0.0f, 0.5f, 1.7f, 3.0f}) {
    const Vec3 a(std::cos(angle), std::sin(angle), 0);
    // Pressed along a by a fifth, stretched beside it, and carried away.
    const auto pose = moved(s, [&](Vec3 p) {
      const Vec3 flat = p - 0.2f * dot(p, a) * a, b(-a.y, a.x, 0);
      const Vec3 q = flat + 0.1f * dot(p, b) * b;
      return Vec3(q.x + 5, 0.6f * q.y, -0.8f * q.y);
    });
    const std::vector<std::vector<Vec3>> poses{pose};
    const auto tile = pressed_directions(s, poses, 12, {1, 1});
    ASSERT_EQ(tile.size(), s.triangles.size());
    for (const Vec2& t : tile) {
      EXPECT_NEAR(std::hypot(t.x, t.y), 12, 1e-4);
      EXPECT_NEAR(std::abs(dot(across(t), Vec2(a.x, a.y))), 1, 1e-5);
    }
    for (const float width : {1.0f, 0.4f})
      for (const float depth : pressed_depths(s, pose, tile, width, 3))
        EXPECT_NEAR(width * outline(depth) + 1 - width, 1 / 0.8, 1e-3);
    for (const float depth : pressed_depths(s, pose, tile, 1, 0.3f)) EXPECT_EQ(depth, 0.3f);
  }
}

TEST(Strain, OfAShearIsWhereItPressesMost) {
  const Scene s = card();
  const auto shear = [](Vec3 p) { return Vec3(p.x + 0.7f * p.y, p.y, 0); };
  const std::vector<std::vector<Vec3>> poses{moved(s, shear)};
  const auto tile = pressed_directions(s, poses, 1, {1, 1});
  const auto depth_across = [&](Vec2 t) {
    return pressed_depths(s, poses[0], std::vector<Vec2>(s.triangles.size(), t), 1, 5)[10];
  };
  const float found = depth_across(tile[0]);
  EXPECT_GT(found, 0.3f);
  for (int k = 0; k < 360; ++k) {
    const float angle = float(k) * float(std::numbers::pi) / 360;
    EXPECT_LE(depth_across({std::cos(angle), std::sin(angle)}), found + 1e-4f);
  }
}

TEST(Strain, IsByPartAndNoneWhereNothingIsPressed) {
  const Scene s = card();
  const auto turned = [](Vec3 p) { return Vec3(0.6f * p.x, 0.8f * p.x, p.y); };
  const auto grown = [](Vec3 p) { return 1.5f * p; };
  const auto half = [](Vec3 p) { return p.x < 2 ? p : Vec3(p.x, 0.7f * p.y, 0); };
  for (const Move& move : {Move(turned), Move(grown)}) {
    const std::vector<std::vector<Vec3>> poses{moved(s, move)};
    const auto tile = pressed_directions(s, poses, 3, {7, 0});
    for (const float depth : pressed_depths(s, poses[0], tile, 1, 1)) EXPECT_LT(depth, 2e-3f);  // rounding's root
  }
  const std::vector<std::vector<Vec3>> poses{moved(s, half)};
  const auto tile = pressed_directions(s, poses, 3, {7, 0});
  EXPECT_EQ(tile.front(), Vec2(7, 0));
  EXPECT_NEAR(std::abs(across(tile.back()).y), 1, 1e-5);
  const auto depths = pressed_depths(s, poses[0], tile, 1, 5);
  EXPECT_LT(depths.front(), 2e-3f);
  EXPECT_NEAR(outline(depths.back()), 1 / 0.7, 1e-3);
}

TEST(Strain, FlatTrianglesAndWrongNumbersAreLeftOut) {
  Scene s = card();
  s.texcoords[0][3] = s.texcoords[0][4], s.texcoords[0][20].x = NAN, s.positions[30] = s.positions[31];
  const auto flat = moved(s, [](Vec3) { return Vec3(0.0f); });
  const auto broken = moved(s, [](Vec3 p) { return p * std::numeric_limits<float>::infinity(); });
  for (const auto& pose : {flat, broken, s.positions}) {
    const std::vector<std::vector<Vec3>> poses{pose};
    for (const Vec2& t : pressed_directions(s, poses, 3, {7, 0})) EXPECT_TRUE(std::isfinite(t.x + t.y));
    for (const float d : pressed_depths(s, pose, std::vector<Vec2>(s.triangles.size(), Vec2(7, 0)), 1, 1))
      EXPECT_TRUE(d >= 0 && d <= 1);
  }
  s.texcoords[0].clear();
  EXPECT_EQ(pressed_directions(s, {}, 3, {7, 0}).front(), Vec2(7, 0));
  EXPECT_EQ(pressed_depths(s, s.positions, std::vector<Vec2>(s.triangles.size(), Vec2(7, 0)), 1, 1).front(), 0);
}

}  // namespace
}  // namespace lambent
