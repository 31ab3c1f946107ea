// Relief of a transfer texture in the light that arrives at its mesh, against displaced geometry in the same scene.
#include <lambent/bake/materials.h>
#include <lambent/bake/patch.h>
#include <lambent/basis/cosine_basis.h>
#include <lambent/basis/quadrature.h>
#include <lambent/compress/zonal_fit.h>
#include <lambent/light/project.h>
#include <lambent/light/sky.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/relight/arriving.h>
#include <lambent/render/transfer_texture.h>
#include <lambent/scene/displace.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lambent {
namespace {

TEST(BiScale, LightAboveTheHorizonIsKeptAndTheRestIsSmall) {
  constexpr int order = 5, n = order * order;
  const CosineBasis basis = make_cosine_basis(order);
  const std::vector<double> extend = extend_below(basis, 1e-3);
  // X of a sky that is bright above and nothing below: it must come back above, and not explode below.
  std::vector<double> X(n, 0.0), y(n), l(n, 0.0);
  const auto sky = [](const Vec3d& d) { return 1 + 0.5 * d.z + 0.3 * d.x; };
  for (const DirectionNode& node : direction_quadrature(2 * order + 4, 0, 1)) {
    evaluate_sh(order, node.direction, y);
    for (size_t j = 0; j < n; ++j)
      for (size_t k = 0; k <= j; ++k)
        X[j] += node.weight * node.direction.z / std::numbers::pi * basis.from_sh[j * n + k] * y[k] *
                sky(node.direction);
  }
  for (size_t k = 0; k < n; ++k)
    for (size_t j = 0; j < n; ++j) l[k] += extend[k * n + j] * X[j];
  double above = 0, below = 0;
  for (const DirectionNode& node : direction_quadrature(2 * order + 4, -1, 1)) {
    evaluate_sh(order, node.direction, y);
    double value = 0;
    for (size_t k = 0; k < n; ++k) value += l[k] * y[k];
    if (node.direction.z < 0) below += node.weight * value * value;
    else above += node.weight * node.direction.z * std::pow(value - sky(node.direction), 2);
  }
  EXPECT_LT(std::sqrt(above / std::numbers::pi), 0.03);
  EXPECT_LT(std::sqrt(below / (2 * std::numbers::pi)), 0.6);
}

double decibels(const Image& ours, const Image& truth) {
  double squares = 0, peak = 0;
  for (size_t i = 0; i < truth.rgb.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      squares += std::pow(double(ours.rgb[i][c] - truth.rgb[i][c]), 2);
      peak = std::max(peak, double(truth.rgb[i][c]));
    }
  return 10 * std::log10(peak * peak * 3 * double(truth.rgb.size()) / squares);
}

float wave(Vec2 uv) {
  uv = uv - Vec2(std::floor(uv.x), std::floor(uv.y));
  return 0.08f * std::sin(2 * pi * uv.x + std::sin(2 * pi * uv.y));
}

// A sheet of 5 x 5 repetitions about the origin, and a red wall beside its middle, which the camera does not see and
// which puts a part of what it does see into its shadow.
Scene walled_sheet(int cells, bool wall) {
  Scene scene = make_quad(Vec3(-2.5f, 0, 2.5f), Vec3(5, 0, 0), Vec3(0, 0, -5), cells, cells, Vec3(0.5f));
  for (Vec3 p : scene.positions) scene.texcoords[0].push_back({(p.x + 2.5f) / 5, (p.z + 2.5f) / 5});
  if (wall) {
    const uint32_t red = add_material(scene, "wall", Vec3(0.7f, 0.1f, 0.1f));
    add_box(scene, red, "wall", Vec3(1.6f, -0.3f, -2.5f), Vec3(1.8f, 1, 2.5f), 10);
    scene.texcoords[0].resize(scene.positions.size());
  }
  return scene;
}

struct BiScaleError {
  double arriving, alone;  // dB: lit by what arrives, and by the sky as if there were nothing else
};

BiScaleError shade_walled_sheet(bool wall, int order) {
  constexpr int n = 48;
  HeightField field{n, {}};
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) field.heights.push_back(wave(Vec2(float(i) / n, float(j) / n)));
  const PatchScene patch = make_patch(field, Vec3(0.5f));
  auto patch_tracer = Tracer::build(patch.scene);
  auto relief = bake(patch.scene, *patch_tracer, patch.receivers, {.samples = 512, .bounces = 2});
  const ZonalTexture texture{n, n, *fit_zonal(*relief, {.lobes = 4})};
  const std::vector<Vec3> light = project_environment(*make_sky(*parse_sky("elevation=35,azimuth=20,turbidity=3")), 6);
  const Scene scene = walled_sheet(40, wall);
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  MatrixOptions matrix;
  matrix.incident_order = order, matrix.outgoing = OutgoingKind::map, matrix.grid = 8, matrix.response_samples = 64;
  auto baked = bake_matrix(scene, *tracer, receivers, make_receiver_materials(scene, receivers, {}),
                           {.order = 6, .samples = 512, .bounces = 2}, matrix);
  Relit rows;
  relight(baked->transfer, light, rows);
  const ArrivingLight arriving = arriving_light(rows, baked->outgoing);
  const CornerReceivers corners = corner_receivers(scene, receivers.front, receivers.back);
  const ArrivingAt at{arriving, corners};
  Camera camera;
  camera.up = Vec3(0, 0, -1), camera.target = Vec3(0.0f), camera.eye = Vec3(0, 300, 0);
  camera.fov = 2 * degrees(std::atan(1.5f / 300));
  RenderOptions options;
  options.width = options.height = 32, options.samples = 64;
  auto ours = render_transfer_texture(scene, *tracer, texture, {.tile = Vec2(5)}, {light, {}, {}}, camera, options,
                                      nullptr, &at);
  auto alone = render_transfer_texture(scene, *tracer, texture, {.tile = Vec2(5)}, {light, {}, {}}, camera, options);
  Scene traced = walled_sheet(48 * 5, false);
  EXPECT_TRUE(displace(traced, wave, Vec2(5)));
  if (wall) {
    const uint32_t red = add_material(traced, "wall", Vec3(0.7f, 0.1f, 0.1f));
    add_box(traced, red, "wall", Vec3(1.6f, -0.3f, -2.5f), Vec3(1.8f, 1, 2.5f), 2);
    traced.texcoords[0].resize(traced.positions.size());
  }
  ReferenceOptions reference;
  reference.width = reference.height = 32, reference.spp = 256, reference.bounces = 3;
  auto truth = path_trace(traced, reconstruct_environment(light, 128), camera, reference);
  return {decibels(*ours, truth->image), decibels(*alone, truth->image)};
}

TEST(BiScale, ReliefByAWallIsLitAsTheTracedGeometry) {
  SKIP_UNDER_SANITIZERS();
  const BiScaleError beside = shade_walled_sheet(true, 6);
  RecordProperty("decibels", std::to_string(beside.arriving));
  RecordProperty("decibels_alone", std::to_string(beside.alone));
  EXPECT_GT(beside.arriving, 30);
  EXPECT_GT(beside.arriving, beside.alone + 8);
}

TEST(BiScale, InTheOpenItIsAsGoodAsTheTextureAlone) {
  SKIP_UNDER_SANITIZERS();
  const BiScaleError open = shade_walled_sheet(false, 6);
  RecordProperty("decibels", std::to_string(open.arriving));
  RecordProperty("decibels_alone", std::to_string(open.alone));
  EXPECT_GT(open.alone, 30);
  EXPECT_GT(open.arriving, 30);
}

}  // namespace
}  // namespace lambent
