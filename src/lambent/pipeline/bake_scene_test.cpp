// What a bake makes of a file's lamps, and of parts that are around everything.
#include <lambent/light/sky.h>
#include <lambent/pipeline/bake.h>
#include <lambent/pipeline/bake_cube.h>
#include <lambent/pipeline/bake_parse.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/relight/relight.h>
#include <lambent/relight/relight_haar.h>
#include <lambent/scene/gltf_test-inl.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

using namespace test;

constexpr float root_half = 0.70710678f;

// A mesh of `positions` and `indices` in a material and a node of its own.
size_t add_mesh_node(Builder& b, const char* name, const std::vector<float>& positions,
                     const std::vector<uint16_t>& indices, Json material) {
  const size_t accessor = b.floats(positions, "VEC3"), order = b.indices(indices);
  b.json["materials"].push_back(std::move(material));
  b.json["meshes"].push_back({{"primitives",
                               {{{"attributes", {{"POSITION", accessor}}},
                                 {"indices", order},
                                 {"material", b.json["materials"].size() - 1}}}}});
  b.json["nodes"].push_back({{"mesh", b.json["meshes"].size() - 1}, {"name", name}});
  return b.json["nodes"].size() - 1;
}

// Three by three vertices over [-1, 1]^2 at y = 0, facing up.
void add_floor(Builder& b) {
  std::vector<float> positions;
  std::vector<uint16_t> indices;
  for (int j = -1; j <= 1; ++j)
    for (int i = -1; i <= 1; ++i)
      for (int x : {i, 0, j}) positions.push_back(float(x));
  for (uint16_t k : {0, 1, 3, 4})
    for (uint16_t v : {k + 0, k + 3, k + 1, k + 1, k + 3, k + 4}) indices.push_back(v);
  add_mesh_node(b, "floor", positions, indices, {{"name", "grey"}});
}

// Above the floor's middle: a bulb and a spot of 60 W, a sun of 3 W/m2, as files have them in `units`; beside it a
// panel that glows with 2 W/(m2 sr).
Builder blender_scene(const std::string& generator, double bulb, double sun) {
  Builder b;
  b.json["asset"]["generator"] = generator;
  add_floor(b);
  add_mesh_node(b, "panel", {3, 0, -1, 3, 0, 1, 3, 1, 1, 3, 1, -1}, {0, 1, 2, 0, 2, 3},
                {{"name", "panel"},
                 {"emissiveFactor", {1, 1, 1}},
                 {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 2}}}}}});
  b.json["extensions"]["KHR_lights_punctual"]["lights"] = {
      {{"name", "bulb"}, {"type", "point"}, {"intensity", bulb}},
      {{"name", "spot"}, {"type", "spot"}, {"intensity", bulb}, {"spot", Json::object()}},
      {{"name", "sun"}, {"type", "directional"}, {"intensity", sun}}};
  for (int light : {0, 1, 2})
    b.json["nodes"].push_back({{"translation", {0, 2, 0}},
                               {"rotation", {-root_half, 0, 0, root_half}},
                               {"extensions", {{"KHR_lights_punctual", {{"light", light}}}}}});
  return b;
}

struct Baking {
  std::vector<std::string> groups, warnings;
  std::vector<double> middle;  // of each group: exit radiance of white at the origin
  double of(const std::string& group) const {
    return middle.at(size_t(std::find(groups.begin(), groups.end(), group) - groups.begin()));
  }
};

Baking bake_groups(const Builder& file, const std::string& units, std::vector<std::string> lamp = {}) {
  TemporaryFolder folder;
  write_bytes(folder.file("s.glb"), file.glb());
  Baking out;
  const BakeRequest request{.scene = folder.file("s.glb"),
                            .transfer = "lightmap",
                            .precision = "single",
                            .receivers = "vertices",
                            .samples = 64,
                            .bounces = "0",
                            .light_units = units,
                            .lamp = std::move(lamp),
                            .light_groups = true};
  const auto baked = bake(request, {nullptr, [&](const std::string& line) { out.warnings.push_back(line); }});
  EXPECT_TRUE(baked) << baked.error().text();
  if (!baked) return out;
  const Transfer& transfer = std::get<Transfer>(baked->surface.store);
  out.groups = transfer.light.groups;
  const auto& vertices = std::get<VertexPlacement>(baked->surface.where);
  for (size_t g = 0; g < out.groups.size(); ++g) {
    std::vector<Vec3> light(out.groups.size(), Vec3(0));
    light[g] = Vec3(1);
    Relit relit;
    relight(transfer, light, relit);
    for (size_t v = 0; v < baked->scene.positions.size(); ++v)
      if (baked->scene.positions[v] == Vec3(0)) out.middle.push_back(double(relit.at(vertices.front[v]).x));
  }
  EXPECT_EQ(out.middle.size(), out.groups.size());
  return out;
}

TEST(LampsOfAFile, InBlendersModesAreTheLightThatTheyAreInBlender) {
  // Irradiance / pi two metres under 60 W, and under 3 W/m2. Receivers start 2e-4 above the floor.
  constexpr double around = 4 * std::numbers::pi, bulb = 60 / (around * 4) / std::numbers::pi,
                   sun = 3 / std::numbers::pi, lift = 1e-3;
  struct Case {
    const char *generator, *units;
    double bulb, sun;
    bool told;
  };
  const Case cases[] = {{"Khronos glTF Blender I/O v4.2.70", "auto", 60 / around * 683, 3 * 683, true},
                        {"Khronos glTF Blender I/O v3.3.35", "auto", 60, 3, true},
                        {"a tool", "auto", 60 / around, 3, false},
                        {"a tool", "watt", 60 / around * 683, 3 * 683, false},
                        {"Khronos glTF Blender I/O v4.2.70", "lumen", 60 / around, 3, false},
                        {"Khronos glTF Blender I/O v4.2.70", "raw", 60, 3, false}};
  double panel = 0;
  for (const Case& c : cases) {
    SCOPED_TRACE(std::string(c.generator) + ", " + c.units);
    const Baking b = bake_groups(blender_scene(c.generator, c.bulb, c.sun), c.units);
    ASSERT_EQ(b.groups.size(), 4u);
    EXPECT_NEAR(b.of("bulb"), bulb, lift * bulb);
    EXPECT_NEAR(b.of("spot"), bulb, lift * bulb);
    EXPECT_NEAR(b.of("sun"), sun, lift * sun);
    if (panel > 0) {
      EXPECT_EQ(b.of("panel"), panel);  // emission is what it was
    }
    panel = b.of("panel");
    EXPECT_EQ(b.warnings.size(), c.told ? 1u : 0u);
    if (c.told && !b.warnings.empty()) {
      EXPECT_NE(b.warnings[0].find(c.generator), std::string::npos) << b.warnings[0];
    }
  }
  EXPECT_GT(panel, 0);
}

TEST(LampsOfAFile, AreNotSpokenOfWhereThereAreNone) {
  Builder b = blender_scene("Khronos glTF Blender I/O v4.2.70", 1, 1);
  b.json.erase("extensions");
  for (size_t node : {4, 3, 2}) b.json["nodes"].erase(node);
  EXPECT_TRUE(bake_groups(b, "auto").warnings.empty());
  TemporaryFolder folder;
  write_bytes(folder.file("s.glb"), b.glb());
  BakeRequest request{.scene = folder.file("s.glb"), .transfer = "lightmap", .light_units = "watt"};
  auto refused = bake(request);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, "--light-units");
  request.light_units = "auto", request.lamp = {"bulb=2"};
  refused = bake(request);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, "--lamp");
}

TEST(LampsOfAFile, AreScaledOneByOneInTheBakeAndInTheReference) {
  const Builder file = blender_scene("a tool", 5, 1);
  const Baking plain = bake_groups(file, "auto"), scaled = bake_groups(file, "auto", {"bulb=0.25", "panel=3,2,1"});
  for (const auto& [name, scale] : {std::pair{"bulb", 0.25}, {"spot", 1.0}, {"sun", 1.0}, {"panel", 3.0}})
    EXPECT_NEAR(scaled.of(name), scale * plain.of(name), 1e-6 * plain.of(name)) << name;
  // The path tracer's scene, as `reference --lamps` loads it: all four lights at the origin.
  TemporaryFolder folder;
  write_bytes(folder.file("s.glb"), file.glb());
  auto scene =
      load_scene_of({.scene = folder.file("s.glb"), .transfer = "lightmap", .lamp = {"bulb=0.25", "panel=3,2,1"}}, {});
  ASSERT_TRUE(scene) << scene.error().text();
  const Environment black = make_environment("black", 4, 2, [](Vec3) { return Vec3(0); });
  const Vec3 truth = exit_radiance(*scene, black, Vec3(0, 1e-4f, 0), Vec3(0, 1, 0), 0, 4096, 1, true);
  double sum = 0;
  for (double value : scaled.middle) sum += value;
  EXPECT_NEAR(sum, truth.x, 0.01 * truth.x);
}

constexpr const char* unlit_line = "1 unlit material is lit: a matte surface of its colour";

// An inward box of 12 triangles around the floor, unlit.
void add_dome(Builder& b, const char* name, float side) {
  std::vector<float> positions;
  for (int k = 0; k < 8; ++k)
    for (int axis = 0; axis < 3; ++axis) positions.push_back(k >> axis & 1 ? side : -side);
  add_mesh_node(b, name, positions, {0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1,
                                     2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3},
                {{"name", "backdrop"}, {"extensions", {{"KHR_materials_unlit", Json::object()}}}});
}

std::vector<float> values_of(const Baked& baked) {
  Relit relit;
  const Transfer& transfer = std::get<Transfer>(baked.surface.store);
  std::vector<Vec3> light(transfer.light.count());
  for (size_t k = 0; k < light.size(); ++k) light[k] = Vec3(1.0f / float(k + 1));
  relight(transfer, light, relit);
  return {relit.values.begin(), relit.values.end()};
}

TEST(Domes, AreNamedAndLeftOutWithTheirSkyBehindThem) {
  SKIP_UNDER_SANITIZERS();
  TemporaryFolder folder;
  Builder open, wrapped;
  add_floor(open), add_floor(wrapped), add_dome(wrapped, "Sky dome", 40);
  write_bytes(folder.file("open.glb"), open.glb()), write_bytes(folder.file("wrapped.glb"), wrapped.glb());
  for (const char* transfer : {"diffuse", "lightmap"})
    for (const char* word : {"Sky dome", "backdrop", "unlit"}) {
      SCOPED_TRACE(std::string(transfer) + " " + word);
      BakeRequest request{.scene = folder.file("open.glb"), .transfer = transfer, .samples = 64};
      if (request.transfer == "lightmap") request.sky = "uniform:1", request.atlas = "32x32";
      std::vector<std::string> warnings;
      const Job job{nullptr, [&](const std::string& line) { warnings.push_back(line); }};
      const auto expected = bake(request, job);
      ASSERT_TRUE(expected) << expected.error().text();
      EXPECT_TRUE(warnings.empty()) << warnings[0];
      request.scene = folder.file("wrapped.glb");
      const auto dark = bake(request, job);
      ASSERT_TRUE(dark) << dark.error().text();
      ASSERT_EQ(warnings.size(), 2u);
      EXPECT_EQ(warnings[0], unlit_line);
      EXPECT_NE(warnings[1].find("no receiver sees the environment: Sky dome is around all of it"), std::string::npos)
          << warnings[1];
      for (float value : values_of(*dark)) EXPECT_EQ(value, 0);
      warnings.clear();
      request.exclude = {word};
      const auto baked = bake(request, job);
      ASSERT_TRUE(baked) << baked.error().text();
      EXPECT_TRUE(warnings.empty()) << warnings[0];
      EXPECT_EQ(values_of(*baked), values_of(*expected));
      // The file keeps the dome for viewers, and is drawn without it.
      ASSERT_TRUE(save_baked(folder.file("baked.glb"), *baked));
      const auto again = load_baked(folder.file("baked.glb"));
      ASSERT_TRUE(again) << again.error().text();
      EXPECT_EQ(again->scene.parts.size(), 1u);
      EXPECT_EQ(again->scene.document->json["meshes"].size(), 2u);
      EXPECT_EQ(values_of(*again), values_of(*expected));
    }
}

TEST(Domes, SeenFromOutsideTooAreNamed) {
  TemporaryFolder folder;
  Builder b;
  add_floor(b), add_dome(b, "Sky dome", 40);
  b.json["materials"][1]["doubleSided"] = true;
  write_bytes(folder.file("s.glb"), b.glb());
  for (const char* transfer : {"diffuse", "blocks"}) {
    std::vector<std::string> warnings;
    BakeRequest request{.scene = folder.file("s.glb"), .transfer = transfer};
    if (request.transfer == "diffuse") request.samples = 64;
    ASSERT_TRUE(bake(request, {nullptr, [&](const std::string& line) { warnings.push_back(line); }}));
    ASSERT_EQ(warnings.size(), 2u);
    EXPECT_NE(warnings[1].find("but its own: Sky dome is around all of it"), std::string::npos) << warnings[1];
  }
}

TEST(Domes, NoWordWhereAReceiverSeesOut) {
  TemporaryFolder folder;
  Builder b;
  add_floor(b), add_dome(b, "room", 40);
  Json& indices = b.json["accessors"].back();
  indices["count"] = indices["count"].get<int>() - 3;  // half a wall is open
  write_bytes(folder.file("s.glb"), b.glb());
  std::vector<std::string> warnings;
  ASSERT_TRUE(bake({.scene = folder.file("s.glb"), .samples = 64},
                   {nullptr, [&](const std::string& line) { warnings.push_back(line); }}));
  EXPECT_EQ(warnings, std::vector<std::string>{unlit_line});
  BakeRequest request{.scene = folder.file("s.glb"), .exclude = {"nobody"}, .samples = 64};
  auto refused = bake(request);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().where, "--exclude");
  request.exclude = {"floor", "unlit"};
  refused = bake(request);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().text(), "--exclude: leaves no triangle");
}

// Pixels' wavelets against the picture that every texel of the light makes at the receivers (the standard basis): to
// rounding with all terms and coefficients, whatever the memory; and to the error that is told with few.
TEST(BakeScene, PixelsOfWaveletsAreThePictureOfEveryTexel) {
  for (Vec3 colour : {Vec3(0.8f, 0.3f, 0.1f), Vec3(0.5f)}) {
    Scene scene;
    add_quad(scene, add_material(scene, "floor", colour), "floor", Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 9, 9);
    add_sphere(scene, add_material(scene, "ball", Vec3(0.5f)), "ball", Vec3(0.1f, 0.7f, 0), 0.4f, 1);
    auto tracer = Tracer::build(scene);
    const Receivers receivers = make_vertex_receivers(scene);
    const Visibility seen = *bake_visibility(*tracer, receivers, {.size = 16});
    const CubeLight light = cube_light(*make_sky(*parse_sky("elevation=40,azimuth=30,turbidity=3")), 16);
    const Cube cube = make_cube(16);
    std::vector<uint8_t> levels(cube.count());
    Relit exact;
    exact.rows = 1;
    exact.values.resize((receivers.count() + transfer_block - 1) / transfer_block * 3 * transfer_block);
    for (size_t r = 0; r < receivers.count(); ++r) {
      decode_visibility(seen, r, levels);
      Vec3 sum(0.0f);
      for (size_t t = 0; t < cube.count(); ++t)
        if (levels[t]) sum += light.energy[t] * (std::max(0.0f, dot(receivers.normals[r], cube.texels.at(t))) / pi);
      exact.set(r, 0, sum);
    }
    const Camera camera{Vec3(1.5f, 1.8f, 2.2f), Vec3(0, 0.2f, 0), Vec3(0, 1, 0), 50};
    const RenderOptions options{24, 18, 9};
    const Image truth = *render(scene, *tracer, receivers.basis, exact, camera, options);
    const PixelMix mix = *mix_of_view(scene, *tracer, receivers.basis, camera, options);
    const HaarTransfer of_receivers = *fit_haar(seen, receivers.normals, {.error = 0});
    const auto error_of = [&](const HaarFitOptions& fit, size_t memory, HaarFitReport& report) {
      auto pixels = haar_of_view(of_receivers, mix, fit, memory, report);
      EXPECT_TRUE(pixels) << pixels.error().text();
      EXPECT_EQ(pixels->channels, colour.x == colour.y ? 1 : 3);
      EXPECT_EQ(pixels->receivers, size_t(24 * 18));
      Relit relit;
      relight(*pixels, haar_terms(*pixels, haar_column_norms(*pixels), light, 0), relit);
      const Image image = pixels_image(relit, mix.coverage, camera, 24, 18, nullptr);
      EXPECT_EQ(image.alpha, truth.alpha);
      double error = 0, all = 0;
      for (size_t i = 0; i < image.rgb.size(); ++i) {
        const Vec3 d = image.rgb[i] - truth.rgb[i];
        error += double(dot(d, d)), all += double(dot(truth.rgb[i], truth.rgb[i]));
      }
      return std::sqrt(error / all);
    };
    HaarFitReport all, tight, few;
    EXPECT_LT(error_of({.error = 0}, size_t{1} << 30, all), 0.01);
    EXPECT_LT(error_of({.error = 0}, 1000, tight), 0.01);
    EXPECT_EQ(all.error, tight.error);
    EXPECT_LT(all.error, 0.015);
    EXPECT_LT(error_of({.error = 0.1}, size_t{1} << 30, few), 0.2);
    EXPECT_LT(few.entries, 0.5 * all.entries);
    EXPECT_GT(few.error, 0.05);
    EXPECT_LT(few.error, 0.115);
  }
}

}  // namespace
}  // namespace lambent
