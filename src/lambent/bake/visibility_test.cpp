#include <lambent/bake/visibility.h>
#include <lambent/core/random.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

struct Baked {
  Scene scene;
  Receivers receivers;
  Visibility visibility;
};

Baked bake_box_on_floor(VisibilityOptions options) {
  Baked b;
  const uint32_t m = add_material(b.scene, "grey", Vec3(0.5f));
  add_quad(b.scene, m, "floor", Vec3(-2, 0, 2), Vec3(4, 0, 0), Vec3(0, 0, -4), 5, 5);
  add_box(b.scene, m, "box", Vec3(-0.3f, 0, -0.3f), Vec3(0.3f, 1, 0.3f), 1);
  b.receivers = make_vertex_receivers(b.scene);
  b.visibility = *bake_visibility(*Tracer::build(b.scene), b.receivers, options);
  return b;
}

// Where a ray enters an axis-aligned box, by slabs.
bool meets_box(Vec3 o, Vec3 d, Vec3 lo, Vec3 hi) {
  float near = 0, far = INFINITY;
  for (int k = 0; k < 3; ++k) {
    float a = (lo[k] - o[k]) / d[k], b = (hi[k] - o[k]) / d[k];
    near = std::max(near, std::min(a, b)), far = std::min(far, std::max(a, b));
  }
  return near < far;
}

TEST(BakeVisibility, IsThatOfABoxByItsSlabs) {
  const Baked b = bake_box_on_floor({.size = 32});
  const Cube cube = make_cube(32);
  std::vector<uint8_t> levels(cube.count());
  size_t wrong = 0, blocked = 0, all = 0;
  for (size_t r = 0; r < b.receivers.count(); ++r) {
    if (b.receivers.normals[r].y < 0.9f || b.receivers.origins[r].y > 0.1f) continue;  // the floor alone
    const Vec3 o = b.receivers.origins[r];
    decode_visibility(b.visibility, r, levels);
    for (size_t t = 0; t < cube.count(); ++t) {
      const Vec3 d = cube.texels.at(t);
      const bool truth = d.y > 0 && !meets_box(o, d, Vec3(-0.3f, 0, -0.3f), Vec3(0.3f, 1, 0.3f));
      wrong += truth != (levels[t] == 1), blocked += d.y > 0 && !truth, ++all;
    }
  }
  EXPECT_GT(blocked, 1000u);
  EXPECT_LT(double(wrong), 2e-5 * double(all));  // rays along an edge
}

// A share is the mean of a binary map with eight times the texels a side.
TEST(BakeVisibility, SharesAreMeansOfAFinerMap) {
  const Baked coarse = bake_box_on_floor({.size = 16, .bits = 6}), finer = bake_box_on_floor({.size = 128});
  std::vector<uint8_t> shares(cube_texels(16)), levels(cube_texels(128));
  double difference = 0;
  size_t parts = 0, count = 0;
  for (size_t r = 0; r < coarse.receivers.count(); ++r) {
    const Vec3 n = coarse.receivers.normals[r];
    decode_visibility(coarse.visibility, r, shares);
    decode_visibility(finer.visibility, r, levels);
    for (int face = 0; face < 6; ++face)
      for (int row = 0; row < 16; ++row)
        for (int column = 0; column < 16; ++column) {
          const float u = 2 * (float(column) + 0.5f) / 16 - 1, v = 2 * (float(row) + 0.5f) / 16 - 1;
          if (dot(n, normalize(cube_point(face, u, v))) < 0.15f)
            continue;  // across the horizon they differ by definition
          int sum = 0;
          for (int k = 0; k < 64; ++k) sum += levels[cube_texel(128, face, column * 8 + k % 8, row * 8 + k / 8)];
          const double share = shares[cube_texel(16, face, column, row)] / 63.0;
          parts += share > 0 && share < 1, ++count;
          difference += std::abs(share - sum / 64.0);
        }
  }
  EXPECT_GT(parts, 500u);
  EXPECT_LT(difference / double(count), 1e-3);
}

// Rays that are certain are not traced, and nothing is lost: on a floor, under a table, within a bowl, among small
// things.
TEST(BakeVisibility, IsTheSameWhereCertainRaysAreNotTraced) {
  Scene clutter;
  const uint32_t m = add_material(clutter, "grey", Vec3(0.5f));
  add_quad(clutter, m, "floor", Vec3(-2, 0, 2), Vec3(4, 0, 0), Vec3(0, 0, -4), 9, 9);
  add_quad(clutter, m, "roof", Vec3(-1, 1.1f, 1), Vec3(1.3f, 0.2f, 0), Vec3(0, 0.1f, -2), 2, 2);
  Random random(5);
  for (int i = 0; i < 30; ++i) {
    const Vec3 at(random.next() * 3 - 1.5f, random.next() * 0.8f, random.next() * 3 - 1.5f);
    const float size = 0.01f + 0.3f * random.next() * random.next();
    add_box(clutter, m, "box", at, at + Vec3(size, 0.7f * size, 2 * size), 1 + i % 2);
  }
  Scene bowl = make_sphere(1, 3, Vec3(1));
  std::erase_if(bowl.triangles, [&](const Triangle& t) { return bowl.positions[t.v[0]].y > 0.2f; });
  for (Scene* scene : {&clutter, &bowl}) {
    const Receivers receivers = make_vertex_receivers(*scene);
    const Tracer tracer = *Tracer::build(*scene);
    for (const auto& [size, bits] : {std::pair{64, 1}, {48, 1}, {32, 4}}) {
      VisibilityReport all, some;
      const Visibility truth = *bake_visibility(tracer, receivers, {.size = size, .bits = bits}, &all);
      const Visibility v = *bake_visibility(tracer, receivers, {.size = size, .bits = bits, .scene = scene}, &some);
      EXPECT_TRUE(std::ranges::equal(v.data, truth.data)) << size << " " << bits;
      EXPECT_EQ(v.begin, truth.begin);
      EXPECT_EQ(some.rays, all.rays);
      EXPECT_EQ(all.certain, 0u);
      EXPECT_GT(double(some.certain), 0.2 * double(some.rays));
    }
  }
}

TEST(BakeVisibility, SaysThatItIsTooLarge) {
  Scene scene = make_sphere(1, 3, Vec3(1));
  const Receivers receivers = make_vertex_receivers(scene);
  auto v = bake_visibility(*Tracer::build(scene), receivers, {.size = 64, .memory = 1000});
  ASSERT_FALSE(v);
  EXPECT_NE(v.error().text().find("more than --memory"), std::string::npos);
}

// No shadows of its own on a convex body: all that is above the horizon is seen.
TEST(BakeVisibility, AConvexBodyDoesNotShadowItself) {
  Scene scene = make_sphere(1, 3, Vec3(1));
  const Receivers receivers = make_vertex_receivers(scene);
  const Visibility v = *bake_visibility(*Tracer::build(scene), receivers, {.size = 32});
  const Cube cube = make_cube(32);
  std::vector<uint8_t> levels(cube.count());
  for (size_t r = 0; r < receivers.count(); ++r) {
    decode_visibility(v, r, levels);
    for (size_t t = 0; t < cube.count(); ++t) {
      // The true faces lie up to half a face's bend above the horizon of the smooth normal.
      const float cosine = dot(receivers.normals[r], cube.texels.at(t));
      if (cosine > 0.12f || cosine <= 0) {
        EXPECT_EQ(levels[t], cosine > 0 ? 1 : 0);
      }
    }
  }
}

}  // namespace
}  // namespace lambent
