#include <lambent/bake/bake.h>
#include <lambent/pipeline/view_error.h>
#include <lambent/scene/procedural.h>

#include "../bake/true_error_test-inl.h"
#include "sanitizers.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

// An open floor, whose transfer is the clamped cosine's, with every row too bright by `factor`, but on the left half
// right.
Baked make_wrong(float factor, const char* request) {
  Scene scene = make_quad(Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 8, 8, Vec3(0.5f));
  const Receivers receivers = make_vertex_receivers(scene);
  const Tracer tracer = *Tracer::build(scene);
  const BakeOptions exact{.order = 3, .bounces = 0, .shadows = false, .precision = Precision::single};
  const Transfer right = *bake(scene, tracer, receivers, exact);
  WritableTransfer wrong = make_transfer(right.light, 1, 1, receivers.count(), Precision::single);
  for (size_t r = 0; r < receivers.count(); ++r) {
    std::vector<float> row = load_receiver(right, r);
    if (receivers.origins[r].x > 0.1f)
      for (float& v : row) v *= factor;
    store_receiver(wrong, r, row);
  }
  Baked baked = make_baked(std::move(scene), receivers, std::move(wrong.transfer), DiffuseRows{});
  baked.provenance = request;
  return baked;
}
constexpr const char* plain = R"({"request": {"scene": "s.obj", "output": "s.glb", "bounces": "0"}})";
constexpr const char* above = "0,3,0.01,0,0,0,30";

TEST(ViewError, IsWhatWasMadeWrong) {
  auto view = view_error(make_wrong(1.18f, plain), above, "96x122", {});
  ASSERT_TRUE(view) << view.error().text();
  // 0.18 from x = 0.25 on, linear over the cell before it: 0.18^2 (3/4 + 1/12) over two.
  const double expected = 0.18 * std::sqrt((0.75 + 0.25 / 3) / 2);
  EXPECT_NEAR(view->certificate.error, expected, 0.03 * expected);
  EXPECT_EQ(view->certificate.places, view->measured.size());
  EXPECT_NEAR(view->scale, 0.2, 1e-9);
  // The right half has a colour near the scale's end, the left one that of none; what is no surface is dark blue.
  const Vec3 left = view->image.at(35, 48), right = view->image.at(61, 48), beside = view->image.at(1, 1);
  EXPECT_LT(length(left - false_color(0)), 0.02f);
  EXPECT_GT(right.x + right.y + right.z, dot(false_color(0.7f), Vec3(1)));
  EXPECT_GT(beside.z, beside.x);
}

TEST(ViewError, OfWhatIsRightIsNone) {
  auto view = view_error(make_wrong(1, plain), above, "64x90", {});
  ASSERT_TRUE(view) << view.error().text();
  EXPECT_LT(view->certificate.error, 0.003);
}

// Surfaces that send each other much of what is wrong with them: what comes back counts, and counts once.
TEST(ViewError, InACornerIsTheTrueOne) {
  SKIP_UNDER_SANITIZERS();
  Scene scene;
  const uint32_t white = add_material(scene, "white", Vec3(0.85f));
  constexpr int cells = 8;
  add_quad(scene, white, "floor", Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), cells, cells);
  add_quad(scene, white, "left", Vec3(-1, 0, -1), Vec3(0, 2, 0), Vec3(0, 0, 2), cells, cells);
  add_quad(scene, white, "back", Vec3(-1, 0, -1), Vec3(2, 0, 0), Vec3(0, 2, 0), cells, cells);
  add_quad(scene, white, "shelf", Vec3(-0.9f, 0.6f, -0.9f), Vec3(0, 0, 0.8f), Vec3(0.9f, 0, 0), cells, cells);
  const Receivers receivers = make_vertex_receivers(scene);
  const Tracer tracer = *Tracer::build(scene);
  const BakeOptions options{.order = 3, .samples = 16, .bounces = 3, .precision = Precision::single};
  Transfer stored = *bake(scene, tracer, receivers, options);
  const double truth = test::true_error(scene, receivers, stored, options, 512);
  Baked baked = make_baked(std::move(scene), receivers, std::move(stored), DiffuseRows{});
  baked.provenance = R"({"request": {"scene": "s.obj", "output": "s.glb", "bounces": "3"}})";
  auto view = view_error(baked, "3,3,3,0,0.5,0,40", "64x90", {});
  ASSERT_TRUE(view) << view.error().text();
  EXPECT_NEAR(view->certificate.error / truth, 1, 0.15) << "truth " << truth;
}

TEST(ViewError, SaysWhatItDoesNotMeasure) {
  auto said = [](const Baked& baked, const char* size = "64x90") {
    auto view = view_error(baked, above, size, {});
    return view ? std::string() : view.error().text();
  };
  EXPECT_NE(said(make_wrong(1, "{}")).find("does not know by which request"), std::string::npos);
  EXPECT_NE(said(make_wrong(1, R"({"request": {"scene": "s.obj", "output": "s.glb", "shadows": "off"}})"))
                .find("without shadows"),
            std::string::npos);
  EXPECT_NE(said(make_wrong(1, plain), "64x20").find("no room for the legend"), std::string::npos);
  Baked other = make_wrong(1, plain);
  other.surface.rows = IncidentRows{2};
  EXPECT_NE(said(other).find("something else"), std::string::npos);
}

}  // namespace
}  // namespace lambent
