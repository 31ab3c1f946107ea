#include <lambent/receivers/receivers.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <set>

namespace lambent {
namespace {

TEST(Receivers, ShareWhatHasOnePositionAndNormal) {
  // Two coplanar quads in two parts share the three vertices of their common edge.
  Scene scene;
  const uint32_t m = add_material(scene, "grey", Vec3(0.5f));
  add_quad(scene, m, "left", Vec3(-1, 0, 0), Vec3(0, 0, 1), Vec3(1, 0, 0), 2, 2);
  add_quad(scene, m, "right", Vec3(0, 0, 0), Vec3(0, 0, 1), Vec3(1, 0, 0), 2, 2);
  EXPECT_EQ(scene.positions.size(), 18u);
  const Receivers r = make_vertex_receivers(scene);
  EXPECT_EQ(r.count(), 15u);
  EXPECT_TRUE(r.back.empty());
  for (size_t v = 0; v < scene.positions.size(); ++v) {
    ASSERT_LT(r.front[v], r.count());
    EXPECT_LT(length(r.origins[r.front[v]] - scene.positions[v]), 0.01f);
    EXPECT_EQ(r.normals[r.front[v]], scene.normals[v]);
  }
}

TEST(Receivers, LieOffTheirSurfaceAndInsideItsBorder) {
  const Scene scene = make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 4, 4, Vec3(0.5f));
  const Receivers r = make_vertex_receivers(scene);
  for (size_t v = 0; v < scene.positions.size(); ++v) {
    const Vec3 p = scene.positions[v], o = r.origins[r.front[v]];
    EXPECT_GT(o.y, 0);
    EXPECT_GT(std::min(o.x, o.z), 0);
    EXPECT_LT(std::max(o.x, o.z), 1);
    const bool inner = p.x > 0.1f && p.x < 0.9f && p.z > 0.1f && p.z < 0.9f;
    if (inner) {
      EXPECT_LT(length(Vec2(o.x - p.x, o.z - p.z)), 1e-5f);  // surrounded: only lifted
    }
  }
}

TEST(Receivers, KeepCreasesApartAndSkipWhatIsNotUsed) {
  Scene scene;
  add_box(scene, add_material(scene, "grey", Vec3(0.5f)), "box", Vec3(-1), Vec3(1), 1);
  EXPECT_EQ(make_vertex_receivers(scene).count(), 24u);
  scene.positions.push_back(Vec3(5)), scene.normals.push_back(Vec3(0, 1, 0));  // a stray vertex
  scene.parts[0].vertex_count += 1;
  const uint32_t stray = uint32_t(scene.positions.size() - 1);
  scene.triangles.push_back({{stray, stray, 0}, 0, false});  // degenerate
  scene.parts[0].triangle_count += 1;
  const Receivers r = make_vertex_receivers(scene);
  EXPECT_EQ(r.count(), 24u);
  EXPECT_EQ(r.front[stray], none);
}

TEST(Receivers, HaveABackWhereTheSurfaceHas) {
  Scene scene = make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 1, 1, Vec3(0.5f));
  for (Triangle& t : scene.triangles) t.two_sided = true;
  const Receivers r = make_vertex_receivers(scene);
  EXPECT_EQ(r.count(), 8u);
  std::set<uint32_t> all(r.front.begin(), r.front.end());
  all.insert(r.back.begin(), r.back.end());
  EXPECT_EQ(all.size(), 8u);
  for (size_t v = 0; v < 4; ++v) {
    EXPECT_GT(r.origins[r.front[v]].y, 0);
    EXPECT_LT(r.origins[r.back[v]].y, 0);
    EXPECT_EQ(r.normals[r.back[v]].y, -1);
  }
  const CornerReceivers corners = corner_receivers(scene, r.front, r.back);
  EXPECT_EQ(corners.find(0, false)->receiver[0], r.back[scene.triangles[0].v[0]]);
}

}  // namespace
}  // namespace lambent
