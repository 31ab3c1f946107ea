#include <lambent/bake/surfels.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

struct Placed {
  Scene scene;
  Tracer tracer;
  Surfels surfels;
};

std::unique_ptr<Placed> place(Scene scene, size_t count) {
  auto p = std::make_unique<Placed>();
  p->scene = std::move(scene);
  p->tracer = *Tracer::build(p->scene);
  auto surfels = make_surfels(p->scene, p->tracer, {count, 3});
  EXPECT_TRUE(surfels);
  p->surfels = std::move(*surfels);
  return p;
}

Scene plane() { return make_quad(Vec3(-2, 0, 1), Vec3(4, 0, 0), Vec3(0, 0, -2), 3, 5, Vec3(0.5f)); }

// A floor of one piece under two rooms, which a wall of two thin sides parts up to the ceiling.
Scene two_rooms() {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.6f));
  add_box(scene, grey, "shell", Vec3(-2, 0, -1), Vec3(2, 2, 1), 1, true);
  add_box(scene, grey, "wall", Vec3(-0.01f, -0.1f, -1.1f), Vec3(0.01f, 2.1f, 1.1f), 1);
  return scene;
}

TEST(Surfels, LevelsArePoissonDisksOfHalfTheSpacing) {
  const auto p = place(plane(), 2048);
  const Surfels& s = p->surfels;
  ASSERT_EQ(s.levels(), 3u);
  EXPECT_NEAR(double(s.count()), 2048, 0.2 * 2048);
  for (size_t l = 0; l < s.levels(); ++l) {
    EXPECT_FLOAT_EQ(s.spacings[l], std::ldexp(s.spacings[0], -int(l)));
    for (size_t i = 0; i < s.counts[l]; ++i)
      for (size_t j = 0; j < i; ++j)
        ASSERT_GE(length(s.positions[i] - s.positions[j]), 0.999f * s.spacings[l]) << "level " << l;
    if (l == 0) continue;
    for (size_t i = 0; i < s.counts[l]; ++i) {
      const uint32_t parent = s.parents[s.first_parent(l) + i];
      ASSERT_LT(parent, s.counts[l - 1]);
      EXPECT_TRUE(i >= s.counts[l - 1] || parent == i);
      EXPECT_LT(length(s.positions[i] - s.positions[parent]), s.spacings[l - 1]);
      EXPECT_GT(dot(s.normals[i], s.normals[parent]), 0.9f);
    }
  }
  double area = 0;
  for (float a : s.areas) area += double(a);
  EXPECT_NEAR(area, 8, 0.01);
}

TEST(Surfels, KernelsKeepConstantsExactlyAndLinearFunctionsOnPlanes) {
  const auto p = place(plane(), 1024);
  const Surfels& s = p->surfels;
  const uint32_t level = 1;
  const SurfelSearch search(s, p->tracer, level);
  Random random(5);
  float worst_inside = 0, worst_border = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3 at(4 * random.next() - 2, 0, 2 * random.next() - 1);
    const Kernels k = search.kernels({at, Vec3(0, 1, 0)});
    ASSERT_GE(k.count, 3u);
    float sum = 0, linear = 0;
    for (size_t j = 0; j < k.count; ++j) {
      EXPECT_GE(k.weight[j], -0.26f);
      EXPECT_GT(s.normals[k.surfel[j]].y, 0.9f);  // none of the other side
      sum += k.weight[j], linear += k.weight[j] * (3 * s.positions[k.surfel[j]].x - 2 * s.positions[k.surfel[j]].z);
    }
    EXPECT_NEAR(sum, 1, 1e-5f);
    const float wrong = std::abs(linear - (3 * at.x - 2 * at.z)) / s.spacings[level];
    const bool inside = std::min(2 - std::abs(at.x), 1 - std::abs(at.z)) > s.spacings[level];
    float& worst = inside ? worst_inside : worst_border;
    worst = std::max(worst, wrong);
  }
  EXPECT_LT(worst_inside, 1e-3f);
  EXPECT_LT(worst_border, 1.5f);  // of a slope of 3.6: less than half a spacing beside
}

TEST(Surfels, NothingReachesThroughAThinWall) {
  const auto p = place(two_rooms(), 2048);
  const Surfels& s = p->surfels;
  const SurfelSearch search(s, p->tracer, uint32_t(s.levels() - 2));
  auto room = [](Vec3 at) { return at.x > 0; };
  // Where the wall does not stick out.
  auto inside = [](Vec3 at) { return at.y > -1e-4f && at.y < 2.0001f && std::abs(at.z) < 1.0001f; };
  for (size_t l = 1; l < s.levels(); ++l)
    for (size_t i = 0; i < s.counts[l]; ++i)
      if (inside(s.positions[i])) {
        const Vec3 parent = s.positions[s.parents[s.first_parent(l) + i]];
        ASSERT_TRUE(inside(parent) && room(s.positions[i]) == room(parent)) << "level " << l;
      }
  Random random(9);
  size_t near = 0;
  for (int i = 0; i < 4000; ++i) {
    const float side = i % 2 ? 1.0f : -1.0f;
    const SurfacePlace at{Vec3(side * (0.011f + 0.2f * random.next() * random.next()), 0, 1.9f * random.next() - 0.95f),
                          Vec3(0, 1, 0)};
    const uint32_t leaf = search.leaf(at);
    ASSERT_NE(leaf, none);
    ASSERT_EQ(room(s.positions[leaf]), side > 0);
    const Kernels k = search.kernels(at);
    ASSERT_GE(k.count, 1u);
    near += k.count > 1;
    for (size_t j = 0; j < k.count; ++j) ASSERT_EQ(room(s.positions[k.surfel[j]]), side > 0);
  }
  EXPECT_GT(near, 3900u);
}

TEST(Surfels, DoNotDependOnThreads) {
  const auto many = place(two_rooms(), 512);
  ThreadLimit one(1);
  const auto single = place(two_rooms(), 512);
  EXPECT_EQ(many->surfels.positions, single->surfels.positions);
  EXPECT_EQ(many->surfels.parents, single->surfels.parents);
  EXPECT_EQ(many->surfels.areas, single->surfels.areas);
}

TEST(Surfels, SceneWithoutASurfaceIsRefused) {
  Scene scene = make_quad(Vec3(0), Vec3(1, 0, 0), Vec3(2, 0, 0), 1, 1, Vec3(0.5f));
  const Tracer tracer = *Tracer::build(scene);
  EXPECT_FALSE(make_surfels(scene, tracer, {}));
}

}  // namespace
}  // namespace lambent
