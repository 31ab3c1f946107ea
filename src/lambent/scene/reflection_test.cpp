#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/scene/procedural.h>
#include <lambent/scene/reflection.h>

#include <gtest/gtest.h>

#include <tuple>

namespace lambent {
namespace {

void expect_frame(const Mat3& f, Vec3 n) {
  constexpr float rounding = 2e-5f;  // a tangent at the least allowed angle magnifies rounding a hundred times
  EXPECT_EQ(f[2], n);
  EXPECT_NEAR(length(f[0]), 1, rounding);
  EXPECT_NEAR(dot(f[0], n), 0, rounding);
  EXPECT_LT(length(cross(n, f[0]) - f[1]), rounding);
}

// One triangle on a plane, with texture coordinates uv = M (position).
Scene mapped_triangle(Vec2 du, Vec2 dv) {
  Scene s;
  const uint32_t material = add_material(s, "m", Vec3(0.5f));
  const Vec3 p[] = {{0, 0, 0}, {2, 0, 0.3f}, {0.5f, 0, -1}}, n[] = {{0, 1, 0}, {0, 1, 0}, {0, 1, 0}};
  const uint32_t corners[] = {0, 1, 2};
  add_mesh(s, material, "t", p, n, corners);
  for (Vec3 x : p) s.texcoords[0].push_back({dot(du, Vec2(x.x, x.z)), dot(dv, Vec2(x.x, x.z))});
  return s;
}

TEST(SurfaceBrdf, DiffuseMaterialsAndOneForAll) {
  Scene s = make_quad({0, 0, 0}, {1, 0, 0}, {0, 0, -1}, 1, 1, Vec3(0.8f, 0.4f, 0.2f));
  s.materials[0].metallic = 0.25f, s.materials[0].roughness = 0.5f;
  Reflection r;
  const Brdf diffuse = surface_brdf(s, r, s.triangles[0], 0.2f, 0.3f);
  ASSERT_TRUE(std::holds_alternative<Lambert>(diffuse));
  EXPECT_EQ(std::get<Lambert>(diffuse).albedo, Vec3(0.8f, 0.4f, 0.2f));
  r.model = Reflection::Model::materials;
  const Brdf material = surface_brdf(s, r, s.triangles[0], 0.2f, 0.3f);
  ASSERT_TRUE(std::holds_alternative<MetallicRoughness>(material));
  EXPECT_EQ(std::get<MetallicRoughness>(material).base_color, Vec3(0.8f, 0.4f, 0.2f));
  EXPECT_EQ(std::get<MetallicRoughness>(material).metallic, 0.25f);
  EXPECT_EQ(std::get<MetallicRoughness>(material).roughness, 0.5f);
  r.everywhere = Phong{};
  EXPECT_TRUE(std::holds_alternative<Phong>(surface_brdf(s, r, s.triangles[0], 0.2f, 0.3f)));
}

TEST(ShadingFrame, FollowsTheFirstTextureCoordinate) {
  const Vec3 up(0, 1, 0);
  // u grows along -Z, then v is sheared and u mirrored: the tangent is where u grows with v held, as solved by hand.
  for (const auto& [du, dv, tangent] : {std::tuple{Vec2(0, -1), Vec2(1, 0), Vec3(0, 0, -1)},
                                        {Vec2(3, 0), Vec2(0, 5), Vec3(1, 0, 0)},
                                        {Vec2(-2, 0), Vec2(0, 1), Vec3(-1, 0, 0)},
                                        {Vec2(1, 0), Vec2(1, 1), Vec3(1, 0, -1)}}) {
    const Scene s = mapped_triangle(du, dv);
    const Mat3 f = shading_frame(s, s.triangles[0], up);
    expect_frame(f, up);
    EXPECT_LT(length(f[0] - normalize(tangent)), 1e-5f) << tangent.x << " " << tangent.z;
  }
  // A tilted normal: the tangent is made square to it and stays in the plane of both.
  const Vec3 n = normalize(Vec3(0.3f, 1, 0.2f));
  const Scene s = mapped_triangle({1, 0}, {0, 1});
  const Mat3 f = shading_frame(s, s.triangles[0], n);
  expect_frame(f, n);
  EXPECT_NEAR(dot(f[0], cross(n, Vec3(1, 0, 0))), 0, 1e-6f);
  EXPECT_GT(f[0].x, 0);
}

TEST(ShadingFrame, WithoutTextureCoordinatesIsLevel) {
  Scene bare = mapped_triangle({1, 0}, {0, 1}), flat = bare;
  bare.texcoords[0].clear();
  for (Vec2& uv : flat.texcoords[0]) uv = Vec2(0.3f, uv.y);  // u does not vary
  Scene broken = flat;
  for (Vec2& uv : broken.texcoords[0]) uv = Vec2(NAN, INFINITY);
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const Vec3 n = normalize(square_to_sphere(random.next2()));
    for (const Scene* s : {&bare, &flat, &broken}) {
      const Mat3 f = shading_frame(*s, s->triangles[0], n);
      expect_frame(f, n);
      EXPECT_NEAR(f[0].y, 0, 1e-6f);
      // Continuous: a small turn of n turns it little, but near the poles.
      const Vec3 near = normalize(n + 1e-3f * square_to_sphere(random.next2()));
      const float sine = std::hypot(n.x, n.z);
      if (sine > 0.05f) {
        EXPECT_LT(length(shading_frame(*s, s->triangles[0], near)[0] - f[0]), 2e-3f / sine);
      }
    }
  }
  for (Vec3 n : {Vec3(0, 1, 0), Vec3(0, -1, 0)}) {
    const Mat3 f = shading_frame(bare, bare.triangles[0], n);
    expect_frame(f, n);
    EXPECT_EQ(f[0], Vec3(1, 0, 0));
  }
}

}  // namespace
}  // namespace lambent
