#include <lambent/scene/displace.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

TEST(Displace, MovesAlongNormalsByTheTexturesOwnScale) {
  Scene s = make_quad(Vec3(0), Vec3(4, 0, 0), Vec3(0, 0, -4), 8, 8, Vec3(0.5f));
  ASSERT_FALSE(displace(
      s, [](Vec2) { return 1.0f; }, Vec2(1)));
  for (Vec3 p : s.positions) s.texcoords[0].push_back({p.x / 4, p.z / 4});
  // Two repetitions over 4 units: a side is 2 long. The slope along x is that of 2 * 0.1 * (x / 2): the normal leans by
  // atan 0.1.
  ASSERT_TRUE(displace(
      s, [](Vec2 uv) { return 0.1f * uv.x; }, Vec2(2)));
  for (size_t v = 0; v < s.positions.size(); ++v) {
    EXPECT_NEAR(s.positions[v].y, 0.1f * s.positions[v].x, 1e-5f);
    EXPECT_LT(length(s.normals[v] - normalize(Vec3(-0.1f, 1, 0))), 1e-4f);
  }
}

// A sphere with a seam in its texture stays closed: both sides of the seam move alike.
TEST(Displace, KeepsSeamsClosed) {
  Scene s = make_quad(Vec3(0), Vec3(1, 0, 0), Vec3(0, 0, -1), 2, 1, Vec3(0.5f));
  const size_t n = s.positions.size();
  Scene mirrored = s;
  for (size_t v = 0; v < n; ++v) s.texcoords[0].push_back({s.positions[v].x, 0});
  // Once more beyond x = 1, the border there doubled, with coordinates that begin anew.
  for (size_t v = 0; v < n; ++v) {
    s.positions.push_back(mirrored.positions[v] + Vec3(1, 0, 0)), s.normals.push_back(mirrored.normals[v]);
    s.texcoords[0].push_back({mirrored.positions[v].x, 0});
  }
  for (Triangle t : mirrored.triangles) {
    for (uint32_t& v : t.v) v += uint32_t(n);
    s.triangles.push_back(t);
  }
  ASSERT_TRUE(displace(
      s, [](Vec2 uv) { return 0.1f * std::sin(2 * pi * uv.x + 0.4f); }, Vec2(1)));
  int at_seam = 0;
  for (size_t v = 0; v < n; ++v)
    for (size_t w = n; w < 2 * n; ++w)
      if (std::abs(s.positions[v].x - 1) < 0.01f && length(s.positions[v] - s.positions[w]) < 0.2f &&
          std::abs(s.positions[v].z - s.positions[w].z) < 0.01f) {
        EXPECT_EQ(s.positions[v], s.positions[w]);
        EXPECT_EQ(s.normals[v], s.normals[w]);
        ++at_seam;
      }
  EXPECT_EQ(at_seam, 2);
}

}  // namespace
}  // namespace lambent
