// Textured patches against the displaced geometry itself.
#include <lambent/bake/materials.h>
#include <lambent/bake/patch.h>
#include <lambent/brdf/parse_brdf.h>
#include <lambent/compress/wrinkle.h>
#include <lambent/compress/zonal_fit.h>
#include <lambent/light/project.h>
#include <lambent/light/sky.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/render/transfer_texture.h>
#include <lambent/scene/displace.h>
#include <lambent/scene/pose.h>
#include <lambent/scene/procedural.h>
#include <lambent/scene/strain.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

TEST(TransferTexture, FramesFollowTheTexture) {
  Scene s;
  s.positions = {{0, 0, 0}, {2, 0, 0}, {0, 0, -3}};  // +u along +x, -v along -z, seen from above
  s.normals.assign(3, Vec3(0, 1, 0));
  s.texcoords[0] = {{0, 1}, {1, 1}, {0, 0}};
  s.triangles.push_back({{0, 1, 2}, 0, false});
  const Mat3 f = texture_frame(s, s.triangles[0], Vec3(0, 1, 0));
  EXPECT_LT(length(f[0] - Vec3(1, 0, 0)) + length(f[1] - Vec3(0, 0, -1)), 1e-6f);
  for (Vec2& uv : s.texcoords[0]) uv.x = -uv.x;  // mirrored
  const Mat3 m = texture_frame(s, s.triangles[0], Vec3(0, 1, 0));
  EXPECT_LT(length(m[0] - Vec3(-1, 0, 0)) + length(m[1] - Vec3(0, 0, -1)), 1e-6f);
  for (Vec2& uv : s.texcoords[0]) uv = Vec2(0.5f);
  EXPECT_LT(length(texture_frame(s, s.triangles[0], Vec3(0, 1, 0))[2] - Vec3(0, 1, 0)), 1e-6f);
}

TEST(TransferTexture, GroovesLieAlikeAtAnyScale) {
  for (float scale : {1e-8f, 1e-3f, 1.0f, 1e6f, 1e9f}) {
    Scene s;
    for (Vec3 p : {Vec3(0, 0, 0), Vec3(2, 0, 0), Vec3(0, 0, -3)}) s.positions.push_back(p * scale);
    s.normals.assign(3, Vec3(0, 1, 0));
    s.texcoords[0] = {{0, 1}, {1e-3f, 1}, {0, 1 - 1e-3f}};
    s.triangles.push_back({{0, 1, 2}, 0, false});
    // v falls along -z.
    EXPECT_LT(length(groove_frame(s, s.triangles[0], Vec2(0, 12), Vec3(0, 1, 0))[0] - Vec3(0, 0, 1)), 1e-4f) << scale;
    EXPECT_LT(length(groove_frame(s, s.triangles[0], Vec2(-5, 0), Vec3(0, 1, 0))[0] - Vec3(-1, 0, 0)), 1e-4f) << scale;
  }
}

// A wall in the xy plane that carries the texture, looked at from far in front, is shaded as the relief: the same
// receivers, relit.
TEST(TransferTexture, ShadesAFlatWallAsTheReliefItself) {
  const int n = 16;
  HeightField field{n, {}};
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i)
      field.heights.push_back(0.1f * std::sin(2 * pi * float(i) / n + 0.5f * std::sin(2 * pi * float(j) / n)));
  const PatchScene patch = make_patch(field, Vec3(0.6f));
  auto tracer = Tracer::build(patch.scene);
  BakeOptions bake_options;
  bake_options.samples = 512, bake_options.bounces = 1, bake_options.precision = Precision::single;
  auto transfer = bake(patch.scene, *tracer, patch.receivers, bake_options);
  ASSERT_TRUE(transfer);
  auto lobes = fit_zonal(*transfer, {.lobes = 6, .ridge = 1e-9f, .precision = Precision::single});
  ASSERT_TRUE(lobes);
  const ZonalTexture texture{n, n, *lobes};

  std::vector<Vec3> light(36);
  for (size_t k = 0; k < 36; ++k)
    light[k] = Vec3(std::sin(float(k) * 1.7f) / float(1 + k / 6), 0.1f * float(k % 5), std::cos(float(k)));
  Relit relit;
  relight(*transfer, light, relit);

  // The wall, turned: R takes the patch's frame to it.
  const Mat3 R = rotation_from_yaw_pitch_roll({25, -40, 70});
  Scene wall;
  for (Vec2 uv : {Vec2(0, 1), Vec2(1, 1), Vec2(1, 0), Vec2(0, 0)}) {
    wall.positions.push_back(R * Vec3(uv.x, -uv.y, 0));
    wall.normals.push_back(R * Vec3(0, 0, 1));
    wall.texcoords[0].push_back(uv);
  }
  wall.triangles = {{{0, 1, 2}, 0, false}, {{0, 2, 3}, 0, false}};
  wall.materials.resize(1);
  Part part;
  part.vertex_count = 4, part.triangle_count = 2;
  wall.parts.push_back(part);
  auto wall_tracer = Tracer::build(wall);
  Camera camera;
  camera.target = R * Vec3(0.5f, -0.5f, 0), camera.eye = R * Vec3(0.5f, -0.5f, 1000), camera.up = R * Vec3(0, 1, 0);
  camera.fov = 2 * degrees(std::atan(0.5f / 1000));  // the wall fills the picture, pixel by texel
  RenderOptions options;
  options.width = options.height = n, options.samples = 64;
  const std::vector<Vec3> turned = rotate_sh(make_sh_rotation(6, R), light);
  auto image = render_transfer_texture(wall, *wall_tracer, texture, {}, {turned, {}, {}}, camera, options);
  ASSERT_TRUE(image);
  double error = 0, total = 0;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const Vec3 truth = relit.at(size_t(j * n + i)), seen = image->at(i, j);
      error += dot(seen - truth, seen - truth), total += dot(truth, truth);
    }
  // Exact bands are blended over a pixel's area; the lobes are exact.
  EXPECT_LT(std::sqrt(error / total), 0.08);
}

// How far two pictures are apart, relative to the second.
double relative_rms(const Image& ours, const Image& truth) {
  double error = 0, total = 0;
  for (size_t i = 0; i < ours.rgb.size(); ++i) {
    const Vec3 d = ours.rgb[i] - truth.rgb[i];
    error += dot(d, d), total += dot(truth.rgb[i], truth.rgb[i]);
  }
  return std::sqrt(error / total);
}

// A sheet of 5 x 5 repetitions about the origin, facing +y, with u along x and v against z.
Scene tiled_sheet(int cells) {
  Scene sheet = make_quad(Vec3(-2.5f, 0, 2.5f), Vec3(5, 0, 0), Vec3(0, 0, -5), cells, cells, Vec3(0.5f));
  for (Vec3 p : sheet.positions) sheet.texcoords[0].push_back({(p.x + 2.5f) / 5, (p.z + 2.5f) / 5});
  return sheet;
}

Camera from_above(float y) {
  Camera camera;
  camera.up = Vec3(0, 0, -1), camera.target = Vec3(0, y, 0), camera.eye = Vec3(0, y + 300, 0);
  camera.fov = 2 * degrees(std::atan(0.5f / 300));
  return camera;
}

// A wavy relief of n x n texels as a texture of lobes, and its heights.
struct WavyRelief {
  HeightField field;
  ZonalTexture texture;
  float at(Vec2 uv) const { return float(sample_heights(field.heights, field.size, field.size, uv)); }
};
WavyRelief wavy_relief(int n) {
  HeightField field{n, {}};
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i)
      field.heights.push_back(0.08f * std::sin(2 * pi * float(i) / n + std::sin(2 * pi * float(j) / n)));
  const PatchScene patch = make_patch(field, Vec3(0.5f));
  auto tracer = Tracer::build(patch.scene);
  auto transfer =
      bake(patch.scene, *tracer, patch.receivers, {.samples = 1024, .bounces = 2, .precision = Precision::single});
  return {field, {n, n, *fit_zonal(*transfer, {.lobes = 4})}};
}

double decibels(const Image& ours, const Image& truth) {
  double peak = 0, squares = 0;
  for (size_t i = 0; i < truth.rgb.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      peak = std::max(peak, double(truth.rgb[i][c]));
      squares += std::pow(double(ours.rgb[i][c] - truth.rgb[i][c]), 2);
    }
  return 10 * std::log10(peak * peak * 3 * double(truth.rgb.size()) / squares);
}

// A relief seen at a slant, diffuse and glossy, by its views: with the parallax and the highlights of its displaced
// geometry, which a texture without views has not.
TEST(TransferTexture, ViewsShowAReliefAtASlantAsItsDisplacedGeometry) {
  SKIP_UNDER_SANITIZERS();
  constexpr int n = 24, views = 8;
  const WavyRelief wavy = wavy_relief(n);
  const PatchScene patch = make_patch(wavy.field, Vec3(0.5f));
  auto patch_tracer = Tracer::build(patch.scene);
  Scene sheet = tiled_sheet(n * 5);
  auto tracer = Tracer::build(sheet);
  Scene relief = sheet;
  ASSERT_TRUE(displace(
      relief, [&](Vec2 uv) { return wavy.at(uv); }, Vec2(5)));
  Camera camera;
  camera.target = Vec3(0.1f, 0, 0.05f), camera.eye = camera.target + 200.0f * normalize(Vec3(0.3f, 1, 0.9f));
  camera.fov = 2 * degrees(std::atan(0.5f / 200));
  RenderOptions options;
  options.width = options.height = 48, options.samples = 64;
  const std::vector<Vec3> light = project_environment(*make_sky(*parse_sky("elevation=35,azimuth=60,turbidity=3")), 6);
  const Environment env = reconstruct_environment(light, 256);
  const BakeOptions bake_options{.samples = 1024, .bounces = 2, .precision = Precision::single};
  for (const bool glossy : {false, true}) {
    Transfer seen;
    Reflection reflection;
    if (glossy) {
      reflection.everywhere = *parse_brdf("ggx:roughness=0.7");
      auto baked = bake_matrix(patch.scene, *patch_tracer, patch.receivers,
                               make_receiver_materials(patch.scene, patch.receivers, reflection), bake_options,
                               {.incident_order = 6, .outgoing = OutgoingKind::map});
      ASSERT_TRUE(baked) << baked.error().text();
      seen = view_patch(patch, *patch_tracer, baked->transfer, &baked->outgoing, n, views);
    } else {
      auto baked = bake(patch.scene, *patch_tracer, patch.receivers, bake_options);
      ASSERT_TRUE(baked);
      seen = view_patch(patch, *patch_tracer, *baked, nullptr, n, views);
    }
    const ZonalTexture texture{n, n, *fit_zonal(seen, {.lobes = 4}), 0, views};
    auto ours = render_transfer_texture(sheet, *tracer, texture, {.tile = Vec2(5)}, {light, {}, {}}, camera, options);
    auto flat =
        render_transfer_texture(sheet, *tracer, wavy.texture, {.tile = Vec2(5)}, {light, {}, {}}, camera, options);
    ASSERT_TRUE(ours && flat);
    // The model is all of a glossy relief's colour; of a diffuse one it is the sheet's.
    if (glossy)
      for (Image* image : {&*ours, &*flat})
        for (Vec3& v : image->rgb) v = 2.0f * v;
    ReferenceOptions traced;
    traced.width = traced.height = 48, traced.spp = 512, traced.bounces = 2, traced.reflection = reflection;
    auto truth = path_trace(relief, env, camera, traced);
    ASSERT_TRUE(truth);
    const double with = decibels(*ours, truth->image), without = decibels(*flat, truth->image);
    const std::string name = glossy ? "glossy" : "diffuse";
    RecordProperty(name, std::to_string(with)), RecordProperty(name + "_without", std::to_string(without));
    // 37.9 and 36.1; of the four nearest views alone 36.7 and 32.9.
    EXPECT_GT(with, glossy ? 34 : 37) << name;
    EXPECT_GT(with, without + 2) << name;
  }
}

// Sheets of relief for real, flat and bent, path-traced: other geometry, other rays, other reconstruction of the same
// light. A texture has no parallax, so each is looked at along its normals.
TEST(TransferTexture, ShadesSheetsAsTheirDisplacedGeometry) {
  SKIP_UNDER_SANITIZERS();
  const WavyRelief wavy = wavy_relief(24);
  const Scene sheet = tiled_sheet(24 * 5);
  const std::vector<Vec3> light = project_environment(*make_sky(*parse_sky("elevation=35,azimuth=60,turbidity=3")), 6);
  const Environment env = reconstruct_environment(light, 256);
  for (const char* text : {"bend:0.01,x,y", "bend:-100,x,y", "twist:60,x"}) {
    const Scene bent = posed(sheet, deform_scene(sheet, *parse_deformation(text)));
    auto tracer = Tracer::build(bent);
    // The middle of the sheet has moved up by bending.
    const Hit middle = tracer->closest({0.01f, 100, 0.02f}, {0, -1, 0});
    ASSERT_NE(middle.triangle, none);
    const Camera camera = from_above(100 - middle.distance);
    RenderOptions options;
    options.width = options.height = 48, options.samples = 64;
    auto ours =
        render_transfer_texture(bent, *tracer, wavy.texture, {.tile = Vec2(5)}, {light, {}, {}}, camera, options);
    ASSERT_TRUE(ours);
    Scene relief = bent;
    ASSERT_TRUE(displace(
        relief, [&](Vec2 uv) { return wavy.at(uv); }, Vec2(5)));
    ReferenceOptions traced;
    traced.width = traced.height = 48, traced.spp = 256, traced.bounces = 3;
    auto truth = path_trace(relief, env, camera, traced);
    ASSERT_TRUE(truth);
    std::printf("%s: %.4f\n", text, relative_rms(*ours, truth->image));
    // 2.4 to 2.7% here: the reference's noise, and lobes of the nearest texel.
    EXPECT_LT(relative_rms(*ours, truth->image), 0.04) << text;
  }
}

// Grooves from the table against grooves of triangles, path-traced: across u and across v, of two depths, wide and
// narrow, flat and bent.
TEST(TransferTexture, GroovesAreThoseOfDisplacedGeometry) {
  SKIP_UNDER_SANITIZERS();
  auto table = make_wrinkle_table({});
  ASSERT_TRUE(table);
  const std::vector<Vec3> light = project_environment(*make_sky(*parse_sky("elevation=35,azimuth=60,turbidity=3")), 6);
  const Environment env = reconstruct_environment(light, 256);
  struct Case {
    Vec2 tile;
    float width, depth;
    const char* deform;
  };
  for (const Case& c : {Case{{5, 0}, 1, 0.5f, "bend:0.01,x,y"},
                        {{5, 0}, 1, 0.9f, "bend:0.01,x,y"},
                        {{0, 5}, 0.6f, 0.5f, "bend:0.01,x,y"},
                        {{5, 0}, 1, 0.5f, "bend:-100,x,y"}}) {
    const Scene sheet = tiled_sheet(240);
    const Scene bent = posed(sheet, deform_scene(sheet, *parse_deformation(c.deform)));
    auto tracer = Tracer::build(bent);
    const Hit middle = tracer->closest({0.01f, 100, 0.02f}, {0, -1, 0});
    const Camera camera = from_above(100 - middle.distance);
    RenderOptions options;
    options.width = options.height = 48, options.samples = 64;
    auto ours = render_transfer_texture(bent, *tracer, table->texture, {c.tile, c.width, c.depth, {}}, {light, {}, {}},
                                        camera, options);
    ASSERT_TRUE(ours);
    Scene relief = bent;
    ASSERT_TRUE(displace(
        relief,
        [&](Vec2 uv) {
          const float phase = c.tile.x > 0 ? uv.x : uv.y, x = (phase - std::floor(phase) - 0.5f) / c.width;
          return std::abs(x) < 0.5f ? -c.depth * c.width * std::pow(std::cos(pi * x), 2.0f) : 0.0f;
        },
        Vec2(5)));
    ReferenceOptions traced;
    traced.width = traced.height = 48, traced.spp = 256, traced.bounces = 6;
    auto truth = path_trace(relief, env, camera, traced);
    ASSERT_TRUE(truth);
    std::printf("tile %g,%g width %g depth %g %s: %.4f\n", c.tile.x, c.tile.y, c.width, c.depth, c.deform,
                relative_rms(*ours, truth->image));
    EXPECT_LT(relative_rms(*ours, truth->image), 0.08);  // the table itself is off by 5.6%
  }
}

// A sheet that is pressed together by a fifth and bent, and folds as a skin of its length does, against the same folds
// of triangles, path-traced.
TEST(TransferTexture, APressedSheetFoldsAsItsDisplacedGeometry) {
  SKIP_UNDER_SANITIZERS();
  auto table = make_wrinkle_table({});
  ASSERT_TRUE(table);
  const std::vector<Vec3> light = project_environment(*make_sky(*parse_sky("elevation=35,azimuth=60,turbidity=3")), 6);
  const Environment env = reconstruct_environment(light, 256);
  constexpr float pressed = 0.8f;
  // How deep folds are whose outline is as long as they were wide, by halving.
  double low = 0, high = 2;
  for (int k = 0; k < 40; ++k) {
    const double depth = (low + high) / 2;
    double length = 0;
    constexpr int n = 2000;
    for (int i = 0; i < n; ++i) {
      const auto at = [&](int j) { return depth * std::pow(std::sin(double(pi) * j / n), 2); };
      length += std::hypot(1.0 / n, at(i + 1) - at(i));
    }
    (length < 1 / double(pressed) ? low : high) = depth;
  }
  const float depth = float(low);
  const Scene sheet = tiled_sheet(240);
  Scene narrow = sheet;
  for (Vec3& p : narrow.positions) p.x *= pressed;
  const Scene bent = posed(narrow, deform_scene(narrow, *parse_deformation("bend:-100,x,y")));
  TextureUse use{{3, 4}, 1, 1, {}};  // whose direction is not that of what is pressed
  const std::vector<std::vector<Vec3>> poses{bent.positions};
  use.pressed_tile = pressed_directions(sheet, poses, 5, use.tile);
  use.pressed_depth = pressed_depths(sheet, bent.positions, use.pressed_tile, 1, 1);
  EXPECT_NEAR(use.pressed_depth[use.pressed_depth.size() / 2], depth, 0.01);
  auto tracer = Tracer::build(bent);
  const Hit middle = tracer->closest({0.01f, 100, 0.02f}, {0, -1, 0});
  const Camera camera = from_above(100 - middle.distance);
  RenderOptions options;
  options.width = options.height = 48, options.samples = 64;
  auto ours = render_transfer_texture(bent, *tracer, table->texture, use, {light, {}, {}}, camera, options);
  ASSERT_TRUE(ours);
  auto smooth =
      render_transfer_texture(bent, *tracer, table->texture, {{5, 0}, 1, 1e-4f, {}}, {light, {}, {}}, camera, options);
  ASSERT_TRUE(smooth);
  Scene relief = bent;
  // displace() measures heights by the root of the area that a repetition has, which is pressed one way.
  ASSERT_TRUE(displace(
      relief,
      [&](Vec2 uv) {
        const float x = uv.x - std::floor(uv.x) - 0.5f;
        return -depth * std::sqrt(pressed) * std::pow(std::cos(pi * x), 2.0f);
      },
      Vec2(5)));
  ReferenceOptions traced;
  traced.width = traced.height = 48, traced.spp = 256, traced.bounces = 6;
  auto truth = path_trace(relief, env, camera, traced);
  ASSERT_TRUE(truth);
  const double folded = relative_rms(*ours, truth->image), plain = relative_rms(*smooth, truth->image);
  RecordProperty("folded", std::to_string(folded)), RecordProperty("smooth", std::to_string(plain));
  std::printf("depth %.4f folded %.4f, smooth %.4f\n", depth, folded, plain);
  EXPECT_LT(folded, 0.08);  // as above
  EXPECT_GT(plain, 2 * folded);
}

// A glowing ball near the relief, against the path tracer's: a mesh of triangles that it samples.
TEST(TransferTexture, NearLampsLightItAsTheyDoTheDisplacedGeometry) {
  SKIP_UNDER_SANITIZERS();
  const WavyRelief wavy = wavy_relief(24);
  const Scene sheet = tiled_sheet(24 * 5);
  auto tracer = Tracer::build(sheet);
  // From below the lamp, which would stand before the sheet.
  Camera camera = from_above(0);
  camera.eye.y = 0.8f, camera.fov = 2 * degrees(std::atan(0.5f / 0.8f));
  RenderOptions options;
  options.width = options.height = 48, options.samples = 64;
  const SphereLamp lamp{{0.8f, 1.6f, 0.3f}, 0.7f, {5, 4, 3}};
  Scene relief = sheet;
  ASSERT_TRUE(displace(
      relief, [&](Vec2 uv) { return wavy.at(uv); }, Vec2(5)));
  const uint32_t glow = add_material(relief, "lamp", Vec3(0.0f));
  add_sphere(relief, glow, "lamp", lamp.centre, lamp.radius, 4);
  relief.materials[glow].emissive = lamp.radiance;
  relief.texcoords[0].resize(relief.positions.size());
  ReferenceOptions traced;
  traced.width = traced.height = 48, traced.spp = 256, traced.bounces = 3, traced.lamps = true;
  auto ours = render_transfer_texture(sheet, *tracer, wavy.texture, {.tile = Vec2(5)},
                                      {std::vector<Vec3>(36, Vec3(0.0f)), {lamp}, {}}, camera, options);
  ASSERT_TRUE(ours);
  auto truth = path_trace(relief, *load_environment("uniform:0"), camera, traced);
  ASSERT_TRUE(truth);
  std::printf("near lamp: %.4f\n", relative_rms(*ours, truth->image));
  EXPECT_LT(relative_rms(*ours, truth->image), 0.1);  // six bands of a lamp 0.9 away blur its shadows
}

}  // namespace
}  // namespace lambent
