#include <lambent/scene/procedural.h>
#include <lambent/scene/refine.h>

#include <gtest/gtest.h>

#include "test_meshes.h"

namespace lambent {
namespace {

constexpr double area_error = 1e-5;  // relative: rounding of middles in float

double longest_edge(const Scene& s) {
  double longest = 0;
  for (const Triangle& t : s.triangles) {
    for (int k = 0; k < 3; ++k) {
      Vec3d a = s.positions[t.v[k]], b = s.positions[t.v[(k + 1) % 3]];
      longest = std::max(longest, length(a - b));
    }
  }
  return longest;
}

// A closed box of six parts, all of different diagonals and with skew slivers: a long prism.
Scene prism_of_parts() {
  Scene s;
  uint32_t m = add_material(s, "m", Vec3(0.5f));
  Vec3 a(0.1f, 0.2f, 0.3f), x(3.1f, 0.4f, -0.2f), y(-0.3f, 0.9f, 0.1f), z(0.2f, 0.1f, 0.35f);
  add_quad(s, m, "0", a, x, z, 1, 1), add_quad(s, m, "1", a + y, z, x, 1, 1), add_quad(s, m, "2", a, z, y, 1, 1);
  add_quad(s, m, "3", a + x, y, z, 1, 1), add_quad(s, m, "4", a, y, x, 1, 1), add_quad(s, m, "5", a + z, x, y, 1, 1);
  // Far corners are reached by different sums: give equal corners equal bits.
  for (Vec3& p : s.positions) p = round(p * 1024.0f) / 1024.0f;
  return s;
}

TEST(SplitLongEdges, NoEdgeIsLeftLongAndNoCrackAppears) {
  for (float limit : {0.5f, 0.13f, 0.04f}) {
    Scene s = prism_of_parts();
    double area = test::total_area(s);
    ASSERT_EQ(test::unmatched_edges(s), 0u);
    size_t before = s.triangles.size();
    ASSERT_TRUE(split_long_edges(s, limit));
    EXPECT_EQ(test::broken_invariant(s), "");
    EXPECT_GT(s.triangles.size(), before);
    EXPECT_LE(longest_edge(s), double(limit));
    EXPECT_NEAR(test::total_area(s), area, area_error * area);
    EXPECT_EQ(test::unmatched_edges(s), 0u);
    for (const Part& part : s.parts) EXPECT_TRUE(part.changed && part.source.empty());
  }
}

TEST(SplitLongEdges, SplitsOnlyWhatIsLong) {
  Scene s = test::bare_cube();
  s.normals.assign(8, Vec3(0, 1, 0));
  for (Vec3& p : s.positions) p *= 0.1f;
  test::append(s, make_quad({5, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1, Vec3(0.5f)));
  s.parts[0].source = {0, 1, 2, 3, 4, 5, 6, 7};
  s.triangles[12].two_sided = true;
  ASSERT_TRUE(split_long_edges(s, 0.75f));
  EXPECT_EQ(test::broken_invariant(s), "");
  EXPECT_EQ(s.parts[0].triangle_count, 12u);
  EXPECT_FALSE(s.parts[0].changed);
  EXPECT_EQ(s.parts[0].source.size(), 8u);
  EXPECT_EQ(s.parts[1].triangle_count, 8u);  // each of the two into four, once: sides 0.5, diagonal 0.71
  for (uint32_t t = 0; t < 8; ++t) EXPECT_EQ(s.triangles[12 + t].two_sided, t < 4);
  EXPECT_TRUE(s.parts[1].changed);
}

TEST(SplitLongEdges, MiddlesInterpolateAttributes) {
  constexpr float rounding = 1e-6f;
  Scene s = make_quad({-1, 0, -1}, {0, 0, 2}, {2, 0, 0}, 1, 1, Vec3(0.5f));
  for (Vec3 p : s.positions)
    s.texcoords[0].push_back({3 * p.x + 1, p.z}), s.colors.push_back(Vec3(p.x, p.z, 1) * 0.5f + 0.5f);
  s.normals[0] = Vec3(1, 0, 0);
  ASSERT_TRUE(split_long_edges(s, 0.3f));
  EXPECT_EQ(test::broken_invariant(s), "");
  for (size_t v = 0; v < s.positions.size(); ++v) {
    Vec3 p = s.positions[v];
    EXPECT_LT(distance(s.texcoords[0][v], Vec2(3 * p.x + 1, p.z)), rounding);
    EXPECT_LT(distance(s.colors[v], Vec3(p.x, p.z, 1) * 0.5f + 0.5f), rounding);
  }
}

TEST(SplitLongEdges, RefusesAbsurdRequestsQuickly) {
  Scene s = prism_of_parts();
  for (float limit : {0.0f, -1.0f, NAN}) EXPECT_FALSE(split_long_edges(s, limit));
  for (float limit : {1e-9f, 1e-30f, 1e-45f}) EXPECT_FALSE(split_long_edges(s, limit));
  EXPECT_FALSE(split_long_edges(s, 0.1f, 100));
  EXPECT_EQ(s.triangles.size(), 12u);  // refused before anything was split
  EXPECT_TRUE(split_long_edges(s, INFINITY));

  // Few triangles, but finer than floats so far out: would never end.
  Scene far = make_quad({1e6f, 0, 0}, {1, 0, 0}, {0, 1, 0}, 1, 1, Vec3(0.5f));
  EXPECT_FALSE(split_long_edges(far, 0.1f));
}

TEST(AddGround, LiesUnderTheSceneAndReachesFar) {
  constexpr float rounding = 1e-4f;
  Scene s = make_sphere(2, 2, Vec3(0.5f));
  for (Vec3& p : s.positions) p += Vec3(10, 3, -7);
  s.texcoords[0].assign(s.positions.size(), Vec2(0.5f));
  Bounds box = bounds(s);
  double radius = 0.5 * double(box.diagonal());
  size_t vertices = s.positions.size();
  add_ground(s);
  EXPECT_EQ(test::broken_invariant(s), "");
  const Part& ground = s.parts.back();
  EXPECT_EQ(ground.name, "ground");
  EXPECT_EQ(ground.node, -1);
  EXPECT_EQ(s.materials[ground.material].base_color, Vec3(0.5f));
  EXPECT_FALSE(s.materials[ground.material].double_sided);
  EXPECT_EQ(ground.triangle_count, 2u * 128 * 128);
  Bounds floor;
  double finest = INFINITY, area = 0;
  for (uint32_t t = ground.first_triangle; t < s.triangles.size(); ++t) {
    EXPECT_FALSE(s.triangles[t].two_sided);
    EXPECT_GT(area_normal(s, s.triangles[t]).y, 0);
    area += 0.5 * double(area_normal(s, s.triangles[t]).y);
  }
  for (size_t v = vertices; v < s.positions.size(); ++v) {
    EXPECT_EQ(s.positions[v].y, box.min.y);
    floor.extend(s.positions[v]);
    float step = s.positions[v].x - s.positions[v - 1].x;
    if (v > vertices && step > 0) finest = std::min(finest, double(step));
  }
  for (int axis : {0, 2}) {
    EXPECT_NEAR(floor.min[axis], box.centre()[axis] - 3 * radius, rounding * radius);
    EXPECT_NEAR(floor.max[axis], box.centre()[axis] + 3 * radius, rounding * radius);
  }
  EXPECT_NEAR(area, 36 * radius * radius, rounding * 36 * radius * radius);
  EXPECT_NEAR(finest, 2.2 * radius / 90, rounding * radius);
}

TEST(AddGround, WorksForFlatScenes) {
  Scene s = make_quad({-50, 1, -50}, {0, 0, 100}, {100, 0, 0}, 1, 1, Vec3(0.5f));
  add_ground(s);
  EXPECT_EQ(test::broken_invariant(s), "");
  EXPECT_EQ(s.positions.back().y, 1.0f);
}

}  // namespace
}  // namespace lambent
