// Light that a lightmap must hold, and places that must not take it from others.
#include <lambent/bake/lightmap.h>
#include <lambent/core/random.h>
#include <lambent/receivers/atlas.h>
#include <lambent/relight/relight.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include "sanitizers.h"

namespace lambent {
namespace {

struct Bright {
  Lightmap map;
  LightmapReport report;
};

// A square under one that glows, and another beside that.
Bright bake_glowing(float radiance, float dim, Precision precision) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.5f)), lamp = add_material(scene, "lamp", Vec3(0)),
                 other = add_material(scene, "other", Vec3(0));
  scene.materials[lamp].emissive = Vec3(radiance), scene.materials[other].emissive = Vec3(dim);
  add_quad(scene, grey, "floor", Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 8, 8);
  add_quad(scene, lamp, "lamp", Vec3(0, 1, 0), Vec3(1, 0, 0), Vec3(0, 0, 1), 1, 1);
  add_quad(scene, other, "other", Vec3(1.5f, 1, 0), Vec3(1, 0, 0), Vec3(0, 0, 1), 1, 1);
  Bright out;
  auto tracer = Tracer::build(scene);
  auto map = bake_lightmap(scene, *tracer, make_patch_receivers(scene), make_lamps(scene, nullptr, true),
                           {.samples = 1024, .lamp_samples = 64, .bounces = 1, .precision = precision}, true,
                           &out.report);
  EXPECT_TRUE(map) << (map ? "" : map.error().text());
  if (map) out.map = std::move(*map);
  return out;
}

// Mean over the floor's patches, which are the first.
double mean_light(const Transfer& map, size_t group) {
  std::vector<Vec3> light(map.light.count(), Vec3(0));
  light[group] = Vec3(1);
  Relit relit;
  relight(map, light, relit);
  double sum = 0;
  for (size_t r = 0; r < map.receivers; ++r) sum += double(relit.at(r).x);
  return sum;
}

TEST(LightmapLight, BeyondHalfFloatsIsKeptInSinglePrecision) {
  const Bright plain = bake_glowing(1, 1, Precision::half);
  EXPECT_EQ(plain.map.all.precision, Precision::half);
  EXPECT_EQ(plain.report.beyond_half, 0);
  const Bright exact = bake_glowing(1, 1, Precision::single);
  for (const auto& [radiance, dim] : {std::pair{1e9f, 1.0f}, {1.0f, 1e-7f}, {3e6f, 1e-9f}}) {
    const Bright b = bake_glowing(radiance, dim, Precision::half);
    EXPECT_EQ(b.map.all.precision, Precision::single);
    EXPECT_EQ(b.map.direct->precision, Precision::single);
    EXPECT_GT(b.report.beyond_half, 0);
    // Light is linear in its lamps: the same samples, times so much.
    for (size_t group : {0, 1}) {
      const double scale = double(group == 0 ? radiance : dim), one = mean_light(exact.map.all, group);
      EXPECT_NEAR(mean_light(b.map.all, group), scale * one, 1e-5 * scale * one) << radiance << " " << dim;
    }
  }
  // And it is what the form factor of unit squares one apart makes of it: half of the receivers are the lamps' own.
  const double factor = mean_light(bake_glowing(1e9f, 0, Precision::half).map.direct.value(), 0) / 1e9 / 128;
  EXPECT_NEAR(factor, 0.19982, 0.005 * 0.19982);
}

// A floor under a lamp whose picture is dark but for one texel of 32 x 32: what a sum over its points gives, from as
// few samples as a lamp of one colour takes.
TEST(LightmapLight, ThePictureOfALampIsSampledWhereItIsBright) {
  SKIP_UNDER_SANITIZERS();
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.5f)), lamp = add_material(scene, "lamp", Vec3(0));
  Texture picture;
  picture.width = picture.height = 32;
  picture.rgb.assign(3 * 32 * 32, 0);
  for (size_t c = 0; c < 3; ++c) picture.rgb[3 * (32 * 21 + 6) + c] = 255;
  scene.textures.push_back(picture);
  scene.materials[lamp].emissive = Vec3(1000), scene.materials[lamp].emissive_texture = 0;
  add_quad(scene, grey, "floor", Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 6, 6);
  add_quad(scene, lamp, "lamp", Vec3(0, 0.5f, 0), Vec3(1, 0, 0), Vec3(0, 0, 1), 2, 2);
  for (Vec3 p : scene.positions) scene.texcoords[0].push_back(Vec2(p.x, p.z));
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_patch_receivers(scene);
  auto map = bake_lightmap(scene, *tracer, receivers, make_lamps(scene, nullptr, false),
                           {.samples = 64, .lamp_samples = 64, .bounces = 0, .precision = Precision::single}, false);
  ASSERT_TRUE(map);
  Relit relit;
  relight(map->all, std::vector<Vec3>{Vec3(1)}, relit);
  constexpr int steps = 512;
  double squares = 0, all = 0;
  for (size_t r = 0; r < receivers.count(); ++r) {
    const Vec3d at = receivers.origins[r];
    if (at.y > 0.25) continue;
    double truth = 0;
    for (int i = 0; i < steps; ++i)
      for (int j = 0; j < steps; ++j) {
        const Vec3d on((i + 0.5) / steps, 0.5, (j + 0.5) / steps), to = on - at;
        const double d2 = dot(to, to);
        truth += double(sample_texture(picture, Vec2(on.x, on.z)).x) * 1000 * to.y * to.y / (d2 * d2 * pi);
      }
    truth /= double(steps) * steps;
    const double error = double(relit.at(r).x) - truth;
    squares += error * error, all += truth * truth;
  }
  ASSERT_GT(all, 0);
  EXPECT_LT(std::sqrt(squares / all), 0.08);  // 1.5 with one cell a triangle
}

// Every point of a triangle has one cell, and cells beside one another differ.
TEST(LampCell, CutsATriangle) {
  for (uint32_t n : {1u, 2u, 8u}) {
    std::vector<size_t> counts(2 * n * n);
    constexpr uint32_t steps = 64;
    for (uint32_t i = 0; i < steps; ++i)
      for (uint32_t j = 0; i + j < steps; ++j) {
        const float u = (float(i) + 0.25f) / steps, v = (float(j) + 0.3f) / steps;
        ++counts.at(lamp_cell(n, u, v));
      }
    size_t used = 0;
    for (size_t count : counts) used += count > 0;
    EXPECT_EQ(used, n * n);
  }
  EXPECT_EQ(lamp_cell(4, 1, 0), 2u * 3);
  EXPECT_EQ(lamp_cell(4, 0, 1), 2u * 12);
  EXPECT_LT(lamp_cell(4, 0.5f, 0.50001f), 32u);
}

// The cell of k in four by two, without a gap or with one.
Vec2 cell(size_t k, size_t corner, float gap) {
  const Vec2 at(float(corner % 2), float(corner / 2));
  return (Vec2(float(k % 4), float(k / 4)) + gap + (1 - 2 * gap) * at) / Vec2(4, 2);
}

TEST(LightmapLight, IslandsThatTouchDoNotLightOneAnother) {
  // A yard under a white sky, and a closed room whose floor and ceiling lie beside it in the layout.
  const Environment sky = make_environment("uniform", 8, 4, [](Vec3) { return Vec3(1); });
  for (const float gap : {0.0f, 0.01f, 0.1f})
    for (const float density : {4.0f, 16.0f}) {
      SCOPED_TRACE(std::to_string(gap) + ", " + std::to_string(density));
      Scene scene;
      const uint32_t grey = add_material(scene, "grey", Vec3(0.8f));
      add_quad(scene, grey, "yard", Vec3(4, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 1, 1);
      add_box(scene, grey, "room", Vec3(-2, 0, -2), Vec3(2, 4, 2), 1, true);
      constexpr size_t cells[] = {1, 4, 5, 0, 2, 6, 7};  // yard; -x, +x, floor, ceiling, -z, +z
      for (size_t v = 0; v < scene.positions.size(); ++v) scene.texcoords[1].push_back(cell(cells[v / 4], v % 4, gap));
      auto atlas = make_atlas(scene, {.texels_per_unit = density});
      ASSERT_TRUE(atlas);
      EXPECT_EQ(atlas->charts == 0, gap > 0.05f);
      EXPECT_EQ(atlas->remark.find("islands touch") != std::string::npos, gap < 0.05f) << atlas->remark;
      const Receivers receivers = make_texel_receivers(scene, *atlas);
      auto tracer = Tracer::build(scene);
      auto map = bake_lightmap(scene, *tracer, receivers, make_lamps(scene, &sky, false), {.samples = 64, .bounces = 2},
                               false);
      ASSERT_TRUE(map);
      Relit relit;
      relight(map->all, std::vector<Vec3>{Vec3(1)}, relit);
      const auto& basis = std::get<TexelReceivers>(receivers.basis);
      Random random(3);
      for (uint32_t t = 0; t < scene.triangles.size(); ++t)
        for (int k = 0; k < 200; ++k) {
          float u = random.next(), v = random.next();
          if (k < 60) (k % 3 == 0 ? u : v) = 0;  // borders
          if (u + v > 1) u = 1 - u, v = 1 - v;
          double sum = 0;
          basis.spread(*basis.find(t, true), u, v,
                       [&](uint32_t r, float w) { sum += double(w) * double(relit.at(r).x); });
          if (scene.parts[scene.triangles[t].part].name == "room") EXPECT_EQ(sum, 0);
          else EXPECT_GT(sum, 0.4);
        }
    }
}

}  // namespace
}  // namespace lambent
