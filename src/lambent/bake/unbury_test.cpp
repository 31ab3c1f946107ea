#include <lambent/bake/gather.h>
#include <lambent/bake/lightmap.h>
#include <lambent/bake/unbury.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/relight/relight.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include "sanitizers.h"

namespace lambent {
namespace {

struct Lit {
  Scene scene;
  Receivers receivers;
  Relit relit;
  size_t moved = 0, buried = 0;
  // The lightmap on the floor, y = 0, of the first part.
  Vec3 at(float x, float z) const {
    const auto& basis = std::get<TexelReceivers>(receivers.basis);
    for (uint32_t i = 0; i < scene.parts[0].triangle_count; ++i) {
      const Triangle& t = scene.triangles[i];
      const Vec3 a = scene.positions[t.v[0]], ab = scene.positions[t.v[1]] - a, ac = scene.positions[t.v[2]] - a,
                 ap = Vec3(x, 0, z) - a;
      if (std::max({std::abs(a.y), std::abs(ab.y), std::abs(ac.y)}) > 1e-6f) continue;
      const float area = ab.x * ac.z - ab.z * ac.x, u = (ap.x * ac.z - ap.z * ac.x) / area,
                  v = (ab.x * ap.z - ab.z * ap.x) / area;
      if (u < -1e-5f || v < -1e-5f || u + v > 1 + 1e-5f) continue;
      Vec3 sum(0);
      basis.spread(*basis.find(i, true), u, v, [&](uint32_t r, float w) { sum += w * relit.at(r); });
      return sum;
    }
    ADD_FAILURE() << "no floor at " << x << ", " << z;
    return Vec3(0);
  }
};

Lit bake_texels(Scene scene, const Environment* sky, float density, bool move, int bounces) {
  Lit l{std::move(scene), {}, {}};
  auto atlas = make_atlas(l.scene, {.texels_per_unit = density});
  EXPECT_TRUE(atlas);
  l.receivers = make_texel_receivers(l.scene, *atlas);
  auto tracer = Tracer::build(l.scene);
  if (move) l.moved = move_buried_texels(l.scene, *tracer, *atlas, l.receivers);
  LightmapReport report;
  auto map = bake_lightmap(l.scene, *tracer, l.receivers, make_lamps(l.scene, sky, false),
                           {.samples = 1024, .lamp_samples = 128, .bounces = bounces, .precision = Precision::single},
                           false, &report);
  EXPECT_TRUE(map) << (map ? "" : map.error().text());
  relight(map->all, std::vector<Vec3>{Vec3(1)}, l.relit);
  l.buried = report.buried;
  return l;
}

TEST(MoveBuriedTexels, NoRimWhereABoxStands) {
  // A box on a floor under a sky, its walls anywhere between texel centres. Along its foot the floor is as the path
  // tracer has it.
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.5f)), dark = add_material(scene, "dark", Vec3(0));
  add_quad(scene, grey, "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 1, 1);
  add_box(scene, dark, "box", Vec3(-0.63f, -0.3f, -0.57f), Vec3(0.71f, 1, 0.6f), 1);
  const Environment sky = make_environment("uniform", 8, 4, [](Vec3) { return Vec3(1); });
  std::vector<Vec3> points;
  for (int k = 0; k < 24; ++k) {
    const float s = -0.5f + float(k) / 23;
    for (float gap : {0.02f, 0.08f}) {
      points.push_back({s, 0, 0.6f + gap}), points.push_back({s, 0, -0.57f - gap});
      points.push_back({0.71f + gap, 0, s}), points.push_back({-0.63f - gap, 0, s});
    }
  }
  std::vector<Vec3> origins, normals(points.size(), Vec3(0, 1, 0));
  for (Vec3 p : points) origins.push_back(p + Vec3(0, 1e-4f, 0));
  const auto truth = exit_radiances(scene, sky, origins, normals, 0, 4096, 1);
  double rms[2] = {}, worst[2] = {};
  for (bool move : {false, true}) {
    const Lit lit = bake_texels(scene, &sky, 4, move, 0);
    EXPECT_EQ(lit.moved > 0, move);
    EXPECT_GT(lit.buried, 0u);  // the middle of the box, which nothing looks at
    for (size_t i = 0; i < points.size(); ++i) {
      const double e = double(lit.at(points[i].x, points[i].z).x) - double(truth[i].mean.x);
      rms[move] += e * e / double(points.size()), worst[move] = std::max(worst[move], std::abs(e));
    }
    rms[move] = std::sqrt(rms[move]);
    RecordProperty(move ? "moved" : "filled", std::to_string(rms[move]) + ", worst " + std::to_string(worst[move]));
  }
  // Half of the sky is seen from there: 0.5. Texels a quarter wide bridge what changes within a few hundredths of a
  // unit.
  EXPECT_LT(rms[1], 0.035) << "filled: " << rms[0];
  EXPECT_LT(worst[1], 0.12) << "filled: " << worst[0];
  EXPECT_LT(rms[1], 0.4 * rms[0]);
}

// A wall, y = 0, with a lamp on it, and a ceiling that sends its light back. The lamp hangs just off the wall and
// shines away from it, or is a box that is sunk into it.
Scene wall_with_lamp(bool sunk) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.5f)), lamp = add_material(scene, "lamp", Vec3(0));
  scene.materials[lamp].emissive = Vec3(5);
  add_quad(scene, grey, "wall", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 1, 1);
  const Vec3 corner(-0.63f, sunk ? -0.01f : 0.01f, -0.57f);
  if (sunk) add_box(scene, lamp, "lamp", corner, Vec3(0.71f, 0.1f, 0.6f), 1);
  else add_quad(scene, lamp, "lamp", corner, Vec3(0, 0, 1.17f), Vec3(1.34f, 0, 0), 1, 1);
  add_quad(scene, grey, "ceiling", Vec3(-2, 2, -2), Vec3(4, 0, 0), Vec3(0, 0, 4), 1, 1);
  return scene;
}

// Texels that the lamp covers move to its rim, where half of what they see is its back or its inside.
TEST(MoveBuriedTexels, NoSeedDecidesAtTheRimOfALampOnAWall) {
  SKIP_UNDER_SANITIZERS();
  for (bool sunk : {false, true}) {
    SCOPED_TRACE(sunk ? "sunk" : "hung");
    Scene scene = wall_with_lamp(sunk);
    auto atlas = make_atlas(scene, {.texels_per_unit = 8});
    ASSERT_TRUE(atlas);
    Receivers receivers = make_texel_receivers(scene, *atlas);
    auto tracer = Tracer::build(scene);
    const size_t moved = move_buried_texels(scene, *tracer, *atlas, receivers);
    EXPECT_GT(moved, 20u);
    const Lamps lamps = make_lamps(scene, nullptr, false);
    std::vector<float> low(receivers.count(), INFINITY), high(low.size(), 0);
    size_t buried = 0;
    for (uint32_t seed = 1; seed <= 6; ++seed) {
      LightmapReport report;
      auto map = bake_lightmap(scene, *tracer, receivers, lamps,
                               {.samples = 1024, .bounces = 1, .seed = seed, .precision = Precision::single}, false,
                               &report);
      ASSERT_TRUE(map);
      Relit relit;
      relight(map->all, std::vector<Vec3>{Vec3(1)}, relit);
      if (seed == 1) buried = report.buried;
      EXPECT_EQ(report.buried, buried) << seed;
      for (size_t r = 0; r < low.size(); ++r)
        low[r] = std::min(low[r], relit.at(r).x), high[r] = std::max(high[r], relit.at(r).x);
    }
    // What is not filled from neighbours is what the path tracer has there, seed or no seed.
    std::vector<Vec3> origins, normals;
    std::vector<size_t> numbers;
    for (size_t r = 0; r < low.size(); ++r) {
      const Vec3 p = receivers.origins[r];
      const bool at_rim = p.y < 0.01f && p.x > -0.8f && p.x < 0.9f && p.z > -0.75f && p.z < 0.8f;
      if (!at_rim || is_buried(*tracer, receivers, r)) continue;
      EXPECT_LT(high[r] - low[r], 0.1f + 0.05f * high[r]) << p.x << ", " << p.z;
      origins.push_back(p), normals.push_back(receivers.normals[r]), numbers.push_back(r);
    }
    ASSERT_GT(numbers.size(), moved / 2);
    const Environment black = make_environment("black", 4, 2, [](Vec3) { return Vec3(0); });
    const auto truth = exit_radiances(scene, black, origins, normals, 1, 4096, 1, {}, true);
    for (size_t i = 0; i < numbers.size(); ++i) {
      const float value = 0.5f * (low[numbers[i]] + high[numbers[i]]);
      EXPECT_NEAR(value, truth[i].mean.x, 0.05f + 0.03f * value) << origins[i].x << ", " << origins[i].z;
    }
  }
}

TEST(MoveBuriedTexels, NothingLeaksAcrossAWall) {
  // A closed room, parted by a wall two texels thick: a lamp on one side, darkness on the other.
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.5f)), lamp = add_material(scene, "lamp", Vec3(0));
  scene.materials[lamp].emissive = Vec3(5);
  add_box(scene, grey, "room", Vec3(-2, 0, -1), Vec3(2, 1, 1), 1, true);
  add_box(scene, grey, "wall", Vec3(-0.21f, -0.2f, -1.2f), Vec3(0.31f, 1.2f, 1.2f), 1);
  add_quad(scene, lamp, "lamp", Vec3(0.8f, 0.98f, -0.3f), Vec3(0.6f, 0, 0), Vec3(0, 0, 0.6f), 1, 1);
  const Lit lit = bake_texels(scene, nullptr, 4, true, 2);
  EXPECT_GT(lit.moved, 0u);
  float darkest = INFINITY, brightest = 0;
  for (float z = -0.9f; z <= 0.9f; z += 0.05f) {
    for (float x : {-0.22f, -0.3f, -0.5f, -1.0f}) brightest = std::max(brightest, lit.at(x, z).x);
    darkest = std::min(darkest, lit.at(0.32f, z).x);
  }
  // In the wall's far corners most rays meet fronts, of the room's own faces there: such texels do not pass for buried,
  // and gather what their neighbours were filled with.
  EXPECT_LT(brightest, 0.03f * darkest);
  EXPECT_GT(darkest, 0.1f);  // and no dark rim on the other
}

}  // namespace
}  // namespace lambent
