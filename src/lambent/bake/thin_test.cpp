#include <lambent/bake/thin.h>
#include <lambent/core/random.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <cmath>

namespace lambent {
namespace {

Scene grid(int cells) { return make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), cells, cells, Vec3(0.5f)); }

// Rows of a function of the place, with noise.
PilotRows pilot_of(const Receivers& receivers, std::function<float(Vec3)> truth, float noise) {
  return [&receivers, truth, noise](std::span<const uint32_t> which, uint32_t pass, float* rows, uint8_t* inside) {
    for (size_t i = 0; i < which.size(); ++i) {
      Random random(hash64(pass, which[i]), 7);
      for (size_t k = 0; k < 4; ++k) rows[4 * i + k] = noise * (random.next() - 0.5f);
      rows[4 * i] += truth(receivers.origins[which[i]]);
      inside[i] = 0;
    }
    return Result<void>();
  };
}

double lost(const Receivers& receivers, const Thinned& thinned, std::function<float(Vec3)> truth) {
  std::vector<float> rows;
  for (uint32_t c : thinned.chosen) rows.push_back(truth(receivers.origins[c]));
  const Spread spread(receivers, thinned, {});
  double error = 0, all = 0;
  for (size_t r = 0; r < receivers.count(); ++r) {
    float value = 0;
    const float exact = truth(receivers.origins[r]);
    spread.row(r, rows.data(), 1, &value);
    error += double(value - exact) * double(value - exact), all += double(exact) * double(exact);
  }
  return std::sqrt(error / all);
}

TEST(Thin, SpreadingKeepsQuadraticsOverAPlane) {
  const Scene scene = grid(150);
  const Receivers receivers = make_vertex_receivers(scene);
  auto truth = [](Vec3 p) { return 1 + p.x - 2 * p.z + p.x * p.x - 3 * p.x * p.z; };
  auto thinned = thin(scene, receivers, 4, pilot_of(receivers, truth, 0), {.error = 0.01, .fewest = 1000});
  ASSERT_TRUE(thinned);
  EXPECT_LT(thinned->chosen.size(), 3000u);
  EXPECT_LT(lost(receivers, *thinned, truth), 1e-3);
  // Those chosen have their own rows, and all stand for themselves.
  for (uint32_t c = 0; c < thinned->chosen.size(); ++c) EXPECT_EQ(thinned->of[thinned->chosen[c]], c);
}

TEST(Thin, FindsAShadowsEdgeUnderNoise) {
  const Scene scene = grid(200);
  const Receivers receivers = make_vertex_receivers(scene);
  auto truth = [](Vec3 p) { return std::hypot(p.x - 0.5f, p.z - 0.4f) < 0.3f ? 0.2f : 1.0f; };
  const ThinOptions options{.error = 0.02, .fewest = 1500};
  auto thinned = thin(scene, receivers, 4, pilot_of(receivers, truth, 0.1f), options);
  ASSERT_TRUE(thinned);
  EXPECT_LT(double(thinned->chosen.size()), 0.5 * double(receivers.count()));
  EXPECT_LT(lost(receivers, *thinned, truth), 2 * options.error);
  // As many, spread evenly, lose far more.
  auto flat = thin(scene, receivers, 4,
                   pilot_of(
                       receivers, [](Vec3) { return 1.0f; }, 0),
                   {.error = 0.02, .fewest = thinned->chosen.size()});
  ASSERT_TRUE(flat);
  EXPECT_GT(lost(receivers, *flat, truth), 2 * lost(receivers, *thinned, truth));
}

TEST(Thin, SidesOfAThinSheetShareNothing) {
  Scene scene = make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 80, 80, Vec3(0.5f));
  for (Triangle& t : scene.triangles) t.two_sided = true;
  const Receivers receivers = make_vertex_receivers(scene);
  ASSERT_EQ(receivers.count(), 2 * scene.positions.size());
  std::vector<float> side(receivers.count());
  for (size_t r = 0; r < side.size(); ++r) side[r] = receivers.normals[r].y > 0 ? 1.0f : 0.0f;
  const PilotRows pilot = [&](std::span<const uint32_t> which, uint32_t, float* rows, uint8_t* inside) {
    for (size_t i = 0; i < which.size(); ++i) rows[i] = side[which[i]], inside[i] = 0;
    return Result<void>();
  };
  auto thinned = thin(scene, receivers, 1, pilot, {.error = 0.01, .fewest = 500});
  ASSERT_TRUE(thinned);
  ASSERT_LT(thinned->chosen.size(), 2000u);
  std::vector<float> rows;
  for (uint32_t c : thinned->chosen) rows.push_back(side[c]);
  const Spread spread(receivers, *thinned, {});
  for (size_t r = 0; r < receivers.count(); ++r) {
    float value;
    spread.row(r, rows.data(), 1, &value);
    ASSERT_NEAR(value, side[r], 1e-4) << r;
  }
}

}  // namespace
}  // namespace lambent
