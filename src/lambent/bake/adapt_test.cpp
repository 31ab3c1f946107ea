#include <lambent/bake/adapt.h>
#include <lambent/bake/bake.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/scene/procedural.h>
#include <lambent/scene/refine.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace lambent {
namespace {

// One large quad of two triangles, and a plate above it whose shadow's edge crosses both.
Scene shadowed_floor() {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.5f));
  add_quad(scene, grey, "floor", Vec3(-8, 0, -8), Vec3(0, 0, 16), Vec3(16, 0, 0), 1, 1);
  add_quad(scene, grey, "plate", Vec3(-1, 0.3f, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 1, 1);
  return scene;
}

double certified(const Scene& scene) {
  auto tracer = Tracer::build(scene);
  BakeReport report;
  auto t = bake(scene, *tracer, make_vertex_receivers(scene), {.order = 4, .samples = 1024, .bounces = 0}, &report);
  EXPECT_TRUE(t);
  return report.certificate.error;
}

TEST(Adapt, AShadowOnOneLargeTriangle) {
  SKIP_UNDER_SANITIZERS();
  const Scene before = shadowed_floor();
  Scene after = before;
  auto report = adapt(after, {.error = 0.01, .longest = 0.1f, .shortest = 1e-3f});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->before, before.triangles.size());
  EXPECT_EQ(report->after, after.triangles.size());
  EXPECT_GT(certified(before), 0.04);
  EXPECT_LT(certified(after), 0.025);
  // As many triangles spread evenly are worse.
  Scene even = before;
  float edge = 8;
  for (; even.triangles.size() < after.triangles.size(); edge *= 0.9f) {
    even = before;
    ASSERT_TRUE(split_long_edges(even, edge));
  }
  EXPECT_LT(certified(after), 0.75 * certified(even));
}

TEST(Adapt, WhereNothingChangesNothingIsSplit) {
  Scene open = make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 1, 1, Vec3(0.5f)), first = open;
  auto report = adapt(open, {});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->levels, 0);
  const float diagonal = std::sqrt(2.0f);
  ASSERT_TRUE(split_long_edges(first, AdaptOptions{}.longest * diagonal));
  EXPECT_EQ(open.triangles.size(), first.triangles.size());
}

TEST(Adapt, LeavesNoCracks) {
  // A box on a floor, both closed or bordered as before: edges with one triangle lie on the floor's border alone.
  Scene scene = shadowed_floor();
  ASSERT_TRUE(adapt(scene, {.error = 0.02}));
  std::map<std::array<float, 6>, int> edges;
  for (const Triangle& t : scene.triangles)
    for (int k = 0; k < 3; ++k) {
      Vec3 a = scene.positions[t.v[k]], b = scene.positions[t.v[(k + 1) % 3]];
      if (std::tie(b.x, b.y, b.z) < std::tie(a.x, a.y, a.z)) std::swap(a, b);
      ++edges[{a.x, a.y, a.z, b.x, b.y, b.z}];
    }
  for (const auto& [e, count] : edges) {
    const bool border = (std::abs(e[0]) == 8 && e[0] == e[3]) || (std::abs(e[2]) == 8 && e[2] == e[5]) ||
                        (e[1] > 0 && ((std::abs(e[0]) == 1 && e[0] == e[3]) || (std::abs(e[2]) == 1 && e[2] == e[5])));
    EXPECT_EQ(count, border ? 1 : 2);
  }
}

// Slivers in a heap: light changes everywhere.
Scene heap_of_needles(int count) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.5f));
  Random random(1, 2);
  for (int i = 0; i < count; ++i) {
    const Vec3 along = 0.3f * square_to_sphere(random.next2()),
               across = 0.01f * normalize_or(cross(along, Vec3(0.1f, 1, 0.3f)), Vec3(1, 0, 0));
    const Vec3 at(random.next(), random.next(), random.next());
    add_quad(scene, grey, "needle", at, along, across, 1, 1);
  }
  return scene;
}

TEST(Adapt, EndsOnWhatCannotBeMet) {
  for (const double error : {1e-9, 1.0}) {
    Scene scene = shadowed_floor();
    auto report = adapt(scene, {.error = error, .shortest = 1e-6f, .triangles = 3000, .samples = 16});
    ASSERT_TRUE(report);
    EXPECT_LE(scene.triangles.size(), 3004u);
  }
  // A triangle a kilometre wide beside a tiny box; slivers.
  Scene wide = make_quad(Vec3(-500, 0, -500), Vec3(0, 0, 1000), Vec3(1000, 0, 0), 1, 1, Vec3(0.5f));
  add_quad(wide, 0, "mote", Vec3(0, 0.01f, 0), Vec3(0, 0, 0.01f), Vec3(0.01f, 0, 0), 1, 1);
  EXPECT_TRUE(adapt(wide, {.samples = 16}));
  Scene slivers = make_quad(Vec3(0), Vec3(0, 0, 1e-3f), Vec3(100, 0, 0), 1, 4000, Vec3(0.5f));
  EXPECT_TRUE(adapt(slivers, {.samples = 16}));
  EXPECT_LE(slivers.triangles.size(), 160'000u);
  // Where time is up, a look at a sixteenth of the edges is all.
  Scene heap = heap_of_needles(500), same = heap;
  auto late = adapt(heap, {.samples = 16, .seconds = 0}), whole = adapt(same, {.samples = 16});
  ASSERT_TRUE(late && whole);
  EXPECT_TRUE(late->late);
  EXPECT_EQ(late->levels, 0);
  EXPECT_GT(late->first, 0.05);
  EXPECT_LT(4 * late->rays, whole->rays);
  EXPECT_FALSE(whole->late);
  Progress progress;
  progress.cancel();
  Scene scene = shadowed_floor();
  EXPECT_FALSE(adapt(scene, {}, &progress));
}

TEST(Adapt, SliversInAHeapEndWithACertificateThatSaysWhatTheyLose) {
  Scene heap = heap_of_needles(1000);
  auto split = adapt(heap, {.error = 0.02, .longest = 1, .more = 0.5, .triangles = 500, .samples = 16});
  ASSERT_TRUE(split);
  EXPECT_TRUE(split->limited);
  EXPECT_GT(split->last, 0.05);
  EXPECT_LE(heap.triangles.size(), 3000u);
  auto tracer = Tracer::build(heap);
  BakeReport report;
  auto baked = bake(heap, *tracer, make_vertex_receivers(heap),
                    {.order = 3, .bounces = 1, .error = 0.025, .seconds = 0, .thin = 200}, &report);
  ASSERT_TRUE(baked) << baked.error().text();
  EXPECT_GT(report.certificate.error, 0.05);
  EXPECT_LT(report.certificate.uncertain, report.certificate.error);
}

}  // namespace
}  // namespace lambent
