#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include "test_meshes.h"

namespace lambent {
namespace {

size_t corners_against_winding(const Scene& s) {
  size_t count = 0;
  for (const Triangle& t : s.triangles)
    for (uint32_t v : t.v) count += !(dot(area_normal(s, t), s.normals[v]) > 0);
  return count;
}

double volume(const Scene& s) {
  double sum = 0;
  for (const Triangle& t : s.triangles) sum += double(dot(s.positions[t.v[0]], area_normal(s, t))) / 6;
  return sum;
}

TEST(Procedural, QuadHasItsAreaAndSide) {
  constexpr double rounding = 1e-6;
  Vec3 a(2, 0, 1), b(0, 3, 0.5f);
  Scene s = make_quad({1, 2, 3}, a, b, 4, 7, Vec3(0.3f));
  EXPECT_EQ(test::broken_invariant(s), "");
  EXPECT_EQ(s.triangles.size(), 2u * 4 * 7);
  double area = double(length(cross(a, b)));
  EXPECT_NEAR(test::total_area(s), area, rounding * area);
  EXPECT_EQ(corners_against_winding(s), 0u);
  EXPECT_GT(dot(s.normals[0], cross(a, b)), 0);
}

TEST(Procedural, BoxIsClosedAndTurned) {
  constexpr double rounding = 1e-5;
  for (bool inward : {false, true}) {
    Scene s;
    add_box(s, add_material(s, "m", Vec3(0.5f)), "box", {-1, -2, -3}, {1, 1, 2}, 3, inward);
    EXPECT_EQ(test::broken_invariant(s), "");
    EXPECT_EQ(s.triangles.size(), 6u * 3 * 3 * 2);
    EXPECT_EQ(test::unmatched_edges(s), 0u);
    EXPECT_EQ(corners_against_winding(s), 0u);
    EXPECT_NEAR(volume(s), inward ? -30 : 30, 30 * rounding);
    EXPECT_EQ(test::two_sided_count(s), 0u);
  }
}

TEST(Procedural, SphereIsExactAndNearlyFull) {
  constexpr float rounding = 1e-6f;
  for (bool inward : {false, true}) {
    Scene s = make_sphere(2, 4, Vec3(0.5f), inward);
    EXPECT_EQ(test::broken_invariant(s), "");
    EXPECT_EQ(s.triangles.size(), 20u * 256);
    EXPECT_EQ(s.positions.size(), 10u * 256 + 2);
    EXPECT_EQ(test::unmatched_edges(s), 0u);
    EXPECT_EQ(corners_against_winding(s), 0u);
    for (size_t v = 0; v < s.positions.size(); ++v)
      EXPECT_LT(distance(s.positions[v], (inward ? -2.0f : 2.0f) * s.normals[v]), rounding);
    // Flat triangles cut off a share of the order of (edge / radius)^2 / 4, edges being 0.07 radii here.
    double full = 4.0 / 3 * double(pi) * 8;
    EXPECT_NEAR(volume(s), inward ? -full : full, 0.003 * full);
  }
}

TEST(Courtyard, IsSoundAndOfTheStatedSize) {
  Scene s = make_courtyard();
  EXPECT_EQ(test::broken_invariant(s), "");
  EXPECT_GE(s.positions.size(), 50'000u);
  EXPECT_LE(s.positions.size(), 100'000u);
  EXPECT_EQ(corners_against_winding(s), 0u);
  EXPECT_EQ(test::two_sided_count(s), 0u);
  Bounds box = bounds(s);
  EXPECT_LT(box.diagonal(), 12);
  for (const Triangle& t : s.triangles) EXPECT_GT(length(area_normal(s, t)), 1e-9f);  // no slivers without an area
  for (const Material& m : s.materials) {
    EXPECT_LT(std::max({m.base_color.x, m.base_color.y, m.base_color.z}), 0.9f);
    EXPECT_FALSE(m.double_sided);
  }
}

TEST(Courtyard, DetailScalesTheTessellation) {
  size_t coarse = make_courtyard(0.5f).positions.size(), whole = make_courtyard().positions.size();
  // Cells half as long: four times the vertices, less what edges and coarse faces keep.
  EXPECT_GT(whole, 2 * coarse);
  EXPECT_LT(whole, 5 * coarse);
  EXPECT_EQ(test::broken_invariant(make_courtyard(0.05f)), "");
}

TEST(Courtyard, IsTheSameEachTime) {
  Scene a = make_courtyard(0.3f), b = make_courtyard(0.3f);
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.normals, b.normals);
}

TEST(Courtyard, CameraSeesItFromTheOpenFront) {
  Camera camera = courtyard_camera();
  Bounds box = bounds(make_courtyard(0.2f));
  EXPECT_GT(camera.eye.z, box.max.z);
  EXPECT_LT(camera.target.z, camera.eye.z);
  EXPECT_LT(std::abs(camera.target.x), 1.0f);
}

}  // namespace
}  // namespace lambent
