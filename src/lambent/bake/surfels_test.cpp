#include <lambent/bake/surfels.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
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

TEST(Surfels, EveryPlaceOfABallHasSeveralKernels) {
  // Surfels that gather are 0.36 radii apart: their kernels reach 50 degrees.
  const auto p = place(make_sphere(1, 5, Vec3(0.5f)), 272);
  const Surfels& s = p->surfels;
  const uint32_t level = uint32_t(s.levels() - 2);
  ASSERT_NEAR(double(s.spacings[level]), 0.36, 0.02);
  const SurfelSearch search(s, p->tracer, level);
  Random random(11);
  for (int i = 0; i < 1000; ++i) {
    const Vec3 n = square_to_sphere(random.next2());
    ASSERT_GE(search.kernels({n, n}).count, 4u) << "at " << n.x << " " << n.y << " " << n.z;
  }
}

TEST(Surfels, WhatRaysMeetHasALeafAndKernelsHoweverSmall) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.6f));
  add_box(scene, grey, "shell", Vec3(-4, 0, -4), Vec3(4, 4, 4), 1, true);
  for (int i = 0; i < 400; ++i) {  // posts as thick as a twelfth of a spacing
    const Vec3 foot(0.37f * float(i % 20) - 3.5f, 0, 0.37f * float(i / 20) - 3.5f);
    add_box(scene, grey, "post", foot, foot + Vec3(0.03f, 0.2f, 0.03f), 1);
  }
  const auto p = place(std::move(scene), 1024);
  const Surfels& s = p->surfels;
  ASSERT_GT(s.spacings.back(), 0.36f);
  const uint32_t level = uint32_t(s.levels() - 2);
  const SurfelSearch search(s, p->tracer, level);
  Random random(11);
  size_t met = 0, without = 0, far = 0;
  for (size_t i = 0; i < s.count(); ++i)
    for (int k = 0; k < 64; ++k) {
      const Mat3 frame = frame_about(s.normals[i]);
      const Hit hit =
          p->tracer.closest(s.positions[i] + s.normals[i] * 1e-4f, frame * square_to_cosine_hemisphere(random.next2()));
      if (hit.triangle == none || !hit.front) continue;
      const SurfacePlace at = surface_place(p->scene, hit);
      const uint32_t leaf = search.leaf(at);
      ++met, without += leaf == none || search.kernels(at).count == 0;
      far += leaf != none &&
             (length(s.positions[leaf] - at.position) > s.spacings.back() || dot(s.normals[leaf], at.normal) < 0.5f);
    }
  EXPECT_GT(met, 50000u);
  EXPECT_LT(double(without), 1e-4 * double(met));
  EXPECT_LT(double(far), 0.01 * double(met));
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
