#include <lambent/bake/stand_in.h>
#include <lambent/core/parallel.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lambent {
namespace {

// A floor and a box on it, far finer than its light.
Scene floor_and_box() {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.5f)),
                 red = add_material(scene, "red", Vec3(0.7f, 0.2f, 0.1f));
  add_quad(scene, grey, "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 60, 60);
  add_box(scene, red, "box", Vec3(-0.5f, 0.3f, -0.5f), Vec3(0.5f, 0.9f, 0.5f), 20);
  return scene;
}

TEST(StandIns, GiveAllReceiversRowsWithinTheErrorThatIsSaid) {
  SKIP_UNDER_SANITIZERS();
  const Scene scene = floor_and_box();
  const Receivers receivers = make_vertex_receivers(scene);
  auto tracer = Tracer::build(scene);
  const BakeOptions options{.order = 4, .bounces = 1, .error = 0.04, .thin = 400};
  BakeReport report;
  auto baked = bake(scene, *tracer, receivers, options, &report);
  ASSERT_TRUE(baked);
  EXPECT_EQ(report.receivers, receivers.count());
  EXPECT_EQ(baked->receivers, receivers.count());
  EXPECT_LT(double(report.traced), 0.5 * double(receivers.count()));
  BakeOptions many = options;
  many.error = 0, many.samples = 1024, many.seed = 9, many.certify = false;
  auto truth = bake(scene, *tracer, receivers, many);
  ASSERT_TRUE(truth);
  const std::vector<float> areas = receiver_areas(scene, receivers);
  double error2 = 0, truth2 = 0;
  for (size_t r = 0; r < receivers.count(); ++r) {
    const std::vector<float> a = load_receiver(*baked, r), b = load_receiver(*truth, r);
    for (size_t k = 0; k < a.size(); ++k)
      error2 += double(areas[r]) * double(a[k] - b[k]) * double(a[k] - b[k]),
          truth2 += double(areas[r]) * double(b[k]) * double(b[k]);
  }
  const double error = std::sqrt(error2 / truth2);
  EXPECT_LT(error, 0.045);
  EXPECT_NEAR(report.error, error, 0.25 * error);
}

TEST(StandIns, TheSameBytesWhateverTheThreads) {
  const Scene scene = floor_and_box();
  const Receivers receivers = make_vertex_receivers(scene);
  auto tracer = Tracer::build(scene);
  BakeOptions options{.order = 2, .bounces = 1, .error = 0.2, .thin = 300};
  options.keep_terms = true;
  auto once = [&](int threads, BakeReport& report) {
    const ThreadLimit limit(threads);
    return bake(scene, *tracer, receivers, options, &report);
  };
  BakeReport reports[2];
  auto one = once(1, reports[0]), four = once(4, reports[1]);
  ASSERT_TRUE(one && four);
  EXPECT_LT(reports[0].traced, receivers.count());
  EXPECT_TRUE(std::equal(one->data.begin(), one->data.end(), four->data.begin(), four->data.end()));
  // Terms are spread by the same shares: they add up to the whole.
  ASSERT_EQ(reports[0].terms.size(), 2u);
  for (size_t r = 0; r < receivers.count(); r += 37) {
    const std::vector<float> all = load_receiver(*one, r), direct = load_receiver(reports[0].terms[0], r),
                             bounced = load_receiver(reports[0].terms[1], r);
    for (size_t k = 0; k < all.size(); ++k) EXPECT_NEAR(direct[k % direct.size()] + bounced[k], all[k], 2e-3f);
  }
}

TEST(StandIns, EndWhereNothingVariesAndWhereAllDoes) {
  // An open floor; slivers a thousand times as long as wide; black surfaces; a triangle a kilometre wide over a mote.
  Scene open = make_quad(Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 40, 40, Vec3(0.5f));
  Scene slivers = make_quad(Vec3(0), Vec3(0, 0, 1e-3f), Vec3(1000, 0, 0), 1, 2000, Vec3(0.5f));
  Scene black = make_quad(Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 30, 30, Vec3(0));
  add_box(black, 0, "box", Vec3(-0.3f, 0.1f, -0.3f), Vec3(0.3f, 0.5f, 0.3f), 4);
  Scene wide = make_quad(Vec3(-500, 0, -500), Vec3(0, 0, 1000), Vec3(1000, 0, 0), 1, 1, Vec3(0.5f));
  add_quad(wide, 0, "mote", Vec3(0, 0.01f, 0), Vec3(0, 0, 0.01f), Vec3(0.01f, 0, 0), 40, 40);
  for (const Scene* scene : {&open, &slivers, &black, &wide}) {
    const Receivers receivers = make_vertex_receivers(*scene);
    auto tracer = Tracer::build(*scene);
    BakeReport report;
    auto baked =
        bake(*scene, *tracer, receivers, {.order = 2, .bounces = 1, .error = 0.05, .seconds = 0, .thin = 200}, &report);
    ASSERT_TRUE(baked) << baked.error().text();
    EXPECT_EQ(baked->receivers, receivers.count());
    EXPECT_GE(report.certificate.error, 0);
    EXPECT_LT(report.certificate.error, 0.2);
  }
}

TEST(StandIns, FewReceiversAndLobesAreAllTraced) {
  const Scene scene = floor_and_box();
  const Receivers receivers = make_vertex_receivers(scene);
  auto tracer = Tracer::build(scene);
  BakeOptions options{.error = 0.1, .thin = receivers.count()};
  auto few = choose_stand_ins(scene, *tracer, receivers, options);
  ASSERT_TRUE(few);
  EXPECT_TRUE(few->thinned.all());
  EXPECT_EQ(few->rays, 0u);
  options.thin = 100, options.lobes = {{Vec3(0, 1, 0), 50}};
  auto lobes = choose_stand_ins(scene, *tracer, receivers, options);
  ASSERT_TRUE(lobes);
  EXPECT_TRUE(lobes->thinned.all());
}

}  // namespace
}  // namespace lambent
