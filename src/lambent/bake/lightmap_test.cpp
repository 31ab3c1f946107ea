#include <lambent/bake/bake.h>
#include <lambent/bake/kernels.h>
#include <lambent/bake/lightmap.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/receivers/atlas.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/relight/relight.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include "sanitizers.h"

namespace lambent {
namespace {

struct Baking {
  Scene scene;
  Receivers receivers;
  Lightmap map;
  LightmapReport report;
  Relit lit(std::vector<Vec3> light) const {
    Relit out;
    relight(map.all, light, out);
    return out;
  }
};

enum class Where { vertices, texels, patches };

Receivers place(Scene& scene, Where where, float density) {
  if (where == Where::vertices) return make_vertex_receivers(scene);
  if (where == Where::patches) return make_patch_receivers(scene);
  auto atlas = make_atlas(scene, {.texels_per_unit = density});
  EXPECT_TRUE(atlas) << (atlas ? "" : atlas.error().text());
  return make_texel_receivers(scene, *atlas);
}

Baking bake_lamps(Scene scene, Where where, LightmapOptions options, bool groups = false,
                  const Environment* sky = nullptr, float density = 8) {
  Baking b{std::move(scene), {}, {}, {}};
  b.receivers = place(b.scene, where, density);
  options.precision = Precision::single;
  auto tracer = Tracer::build(b.scene);
  const Lamps lamps = make_lamps(b.scene, sky, groups);
  auto map = bake_lightmap(b.scene, *tracer, b.receivers, lamps, options, true, &b.report);
  EXPECT_TRUE(map) << (map ? "" : map.error().text());
  if (map) b.map = std::move(*map);
  return b;
}

uint32_t add_lamp(Scene& scene, const std::string& name, Vec3 albedo, Vec3 radiance) {
  const uint32_t m = add_material(scene, name, albedo);
  scene.materials[m].emissive = radiance;
  return m;
}

// Mean over the receivers of a part, one-sided: of all channels.
Vec3 mean_over(const Baking& b, const Relit& lit, size_t part) {
  Vec3d sum(0);
  size_t count = 0;
  const auto& patches = std::get<PatchReceivers>(b.receivers.basis);
  for (uint32_t i = b.scene.parts[part].first_triangle;
       i < b.scene.parts[part].first_triangle + b.scene.parts[part].triangle_count; ++i)
    sum += Vec3d(lit.at(patches.front[i].receiver)), ++count;
  return Vec3(sum / double(count));
}

TEST(Lightmap, FormFactorsOfSquares) {
  // Patches of equal area: their mean is L times the form factor, by the formulas for unit squares one apart, and for
  // two that share an edge. 128 patches are gathered at their centroids: what that misses of the area mean is below
  // half a percent.
  constexpr float collocation = 0.005f;
  const double s = std::sqrt(2.0), a = std::numbers::pi;
  const double parallel = 2 / a * (std::log(std::sqrt(4.0 / 3)) + 2 * s * std::atan(1 / s) - 2 * std::atan(1.0));
  EXPECT_NEAR(parallel, 0.19982, 1e-5);
  // Perpendicular: the formula is long, so quadrature stands for it: the mean over both squares of cos cos / (pi r^2).
  double quadrature = 0;
  const int n = 40;
  for (int i = 0; i < n * n; ++i)
    for (int j = 0; j < n * n; ++j) {
      const Vec3d p((i % n + 0.5) / n, 0, (i / n + 0.5) / n), q((j % n + 0.5) / n, (j / n + 0.5) / n, 0), d = q - p;
      const double r2 = dot(d, d);
      quadrature += d.y * -d.z / (a * r2 * r2) / (double(n) * n * n * n);
    }
  EXPECT_NEAR(quadrature, 0.20004,
              4e-3);  // the known value; the cells at the edge, where the integrand is singular, weigh 1/40 of it
  for (bool facing : {true, false}) {
    Scene scene;
    const Vec3 L(3, 2, 1);
    const uint32_t grey = add_material(scene, "grey", Vec3(0.5f)), lamp = add_lamp(scene, "lamp", Vec3(0), L);
    add_quad(scene, grey, "receiver", Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 8, 8);
    if (facing) add_quad(scene, lamp, "lamp", Vec3(0, 1, 0), Vec3(1, 0, 0), Vec3(0, 0, 1), 1, 1);
    else add_quad(scene, lamp, "lamp", Vec3(0), Vec3(1, 0, 0), Vec3(0, 1, 0), 1, 1);
    const Baking b = bake_lamps(scene, Where::patches, {.samples = 1024, .lamp_samples = 64, .bounces = 0});
    const Vec3 mean = mean_over(b, b.lit({Vec3(1)}), 0);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(mean[c] / L[c], facing ? parallel : 0.20004, facing ? collocation * parallel : 0.02 * 0.2) << facing;
  }
}

TEST(Hemicube, FormFactorsOfSquares) {
  // Pixels: their delta form factors sum to 1, and are cos / pi times the solid angle where pixels are small.
  for (int samples : {12, 1000, 12288}) {
    const DirectionSets cube = make_hemicube_set(3, samples);
    double sum = 0, lit = 0;
    for (size_t i = 0; i < cube.weights.size(); ++i)
      sum += double(cube.weights[i]) / cube.samples, lit += double(cube.weights[i]) / cube.samples * double(cube.z[i]);
    EXPECT_NEAR(sum, 1, 1e-6);
    EXPECT_NEAR(lit, 2.0 / 3, 2.0 / samples);  // the integral of cos^2 / pi
  }
  // Rows of the operator: one square's patches glow, the other gathers. Both kinds of rows give the form factors by
  // formula (Lightmap.FormFactorsOfSquares); 3,072 pixels alias by under a percent.
  for (bool facing : {true, false}) {
    Scene scene;
    const uint32_t white = add_material(scene, "white", Vec3(1));
    add_quad(scene, white, "receiver", Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 8, 8);
    if (facing) add_quad(scene, white, "lamp", Vec3(0, 1, 0), Vec3(1, 0, 0), Vec3(0, 0, 1), 2, 2);
    else add_quad(scene, white, "lamp", Vec3(0), Vec3(1, 0, 0), Vec3(0, 1, 0), 2, 2);
    const Receivers receivers = make_patch_receivers(scene);
    const auto& patches = std::get<PatchReceivers>(receivers.basis);
    auto tracer = Tracer::build(scene);
    for (bool hemicube : {false, true}) {
      GatherSetup setup = make_gather_setup(scene, *tracer, receivers, 1, 3072, 1);
      if (hemicube) setup.sets = make_hemicube_set(1, 3072);
      auto op = GatherOperator::trace(setup, nullptr, nullptr, true, size_t{1} << 30);
      ASSERT_TRUE(op);
      const size_t width = pad_lanes(1);
      AlignedVector<float> x(receivers.count() * width, 0.0f), y(x.size());
      const Part &from = scene.parts[1], &to = scene.parts[0];
      for (uint32_t t = from.first_triangle; t < from.first_triangle + from.triangle_count; ++t)
        x[patches.front[t].receiver * width] = 1;
      op->apply(x.data(), width, y.data());
      double mean = 0;
      for (uint32_t t = to.first_triangle; t < to.first_triangle + to.triangle_count; ++t)
        mean += double(y[patches.front[t].receiver * width]) / to.triangle_count;
      const double formula = facing ? 0.19982 : 0.20004;
      EXPECT_NEAR(mean, formula, (facing ? 0.01 : 0.025) * formula) << facing << hemicube;
    }
  }
}

TEST(Hemicube, ClosedBoxAndDirectionalRows) {
  // The same closed forms as by rays: radiosity e / (1 - rho); and E along the receiver's own normal is E by the
  // vector.
  const Vec3 e(1, 2, 0.5f), rho(0.8f, 0.5f, 0.3f);
  Scene scene;
  add_box(scene, add_lamp(scene, "wall", rho, e), "box", Vec3(-1), Vec3(1, 0.5f, 2), 3, true);
  for (DirectionalKind kind : {DirectionalKind::none, DirectionalKind::vector}) {
    const Receivers receivers = make_vertex_receivers(scene);
    auto tracer = Tracer::build(scene);
    auto map = bake_lightmap(scene, *tracer, receivers, make_lamps(scene, nullptr, false),
                             {.samples = 768,
                              .lamp_samples = 16,
                              .converge = 1e-4,
                              .directional = kind,
                              .gather = GatherKind::hemicube,
                              .precision = Precision::single},
                             false);
    ASSERT_TRUE(map);
    Relit lit;
    relight(map->all, std::vector<Vec3>{Vec3(1)}, lit);
    Vec3 mean(0);
    for (size_t r = 0; r < receivers.count(); ++r) {
      std::array<Vec3, 3> rows{};
      for (int row = 0; row < lit.rows; ++row) rows[size_t(row)] = lit.at(r, row);
      mean += evaluate_directional_light(kind, rows, receiver_frame(receivers.normals[r]), receivers.normals[r]) /
              float(receivers.count());
    }
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(mean[c], e[c] / (1 - rho[c]), 0.02f * e[c] / (1 - rho[c])) << int(kind);
  }
}

TEST(Lightmap, ClosedBoxOfUniformEmission) {
  // Radiosity e / (1 - rho) everywhere, so that a white surface sends out as much; with k bounces e (1 - rho^{k+1}) /
  // (1 - rho).
  const Vec3 e(1, 2, 0.5f), rho(0.8f, 0.5f, 0.3f);
  Scene scene;
  add_box(scene, add_lamp(scene, "wall", rho, e), "box", Vec3(-1), Vec3(1, 0.5f, 2), 3, true);
  for (Where where : {Where::vertices, Where::texels, Where::patches})
    for (int bounces : {0, 2, -1}) {
      LightmapOptions options{
          .samples = 256, .lamp_samples = 16, .bounces = std::max(bounces, 0), .converge = bounces < 0 ? 1e-4 : 0.0};
      const Baking b = bake_lamps(scene, where, options, false, nullptr, 3);
      const Relit lit = b.lit({Vec3(1)});
      for (int c = 0; c < 3; ++c) {
        const double expected = double(e[c]) * (bounces < 0 ? 1 : 1 - std::pow(double(rho[c]), bounces + 1)) /
                                (1 - double(rho[c]));
        double mean = 0, square = 0;
        for (size_t r = 0; r < b.receivers.count(); ++r) {
          const double x = double(lit.at(r)[c]) / expected;
          mean += x / double(b.receivers.count()), square += x * x / double(b.receivers.count());
        }
        // Rays that slip through corners and sampling noise: below half a percent in the mean, a few percent each.
        EXPECT_NEAR(mean, 1, 0.005) << int(where) << " bounces " << bounces << " channel " << c;
        EXPECT_LT(std::sqrt(std::max(square - mean * mean, 0.0)), 0.03) << int(where) << " bounces " << bounces;
      }
    }
}

TEST(Lightmap, IntegratingSphereWithAnEmissivePatch) {
  // Every point of a sphere sees every other with the same form factor: a patch that is the fraction f of it adds L f
  // to all, and each bounce multiplies by rho. The ball's 5,120 faces fall 0.3% short of it, bounce by bounce.
  constexpr float rho = 0.7f, L = 4, faceted = 0.01f;
  Scene scene = make_sphere(1, 4, Vec3(rho), true);
  add_lamp(scene, "lamp", Vec3(rho), Vec3(L));
  double all = 0, lamp = 0;
  std::vector<Triangle> wall, patch;
  for (Triangle t : scene.triangles) {
    const Vec3 centre = normalize(scene.positions[t.v[0]] + scene.positions[t.v[1]] + scene.positions[t.v[2]]);
    const double area = double(length(area_normal(scene, t)));
    all += area;
    if (dot(centre, normalize(Vec3(0.3f, 0.8f, -0.5f))) > 0.8f) lamp += area, patch.push_back(t);
    else wall.push_back(t);
  }
  // Two parts over the same vertices: the second with copies of them.
  const size_t vertices = scene.positions.size();
  for (size_t v = 0; v < vertices; ++v)
    scene.positions.push_back(scene.positions[v]), scene.normals.push_back(scene.normals[v]);
  scene.parts[0].triangle_count = uint32_t(wall.size());
  scene.parts.push_back(
      {"patch", 1, uint32_t(vertices), uint32_t(vertices), uint32_t(wall.size()), uint32_t(patch.size())});
  scene.triangles = wall;
  for (Triangle t : patch) {
    for (uint32_t& v : t.v) v += uint32_t(vertices);
    t.part = 1;
    scene.triangles.push_back(t);
  }
  const double f = lamp / all;
  for (int bounces : {0, 1, -1}) {
    LightmapOptions options{
        .samples = 512, .lamp_samples = 32, .bounces = std::max(bounces, 0), .converge = bounces < 0 ? 1e-4 : 0.0};
    const Baking b = bake_lamps(scene, Where::vertices, options);
    const Relit lit = b.lit({Vec3(1)});
    double mean = 0;
    for (size_t r = 0; r < b.receivers.count(); ++r) mean += double(lit.at(r).x) / double(b.receivers.count());
    const double expected = double(L) * f * (bounces < 0 ? 1 / (1 - double(rho)) : bounces == 0 ? 1 : 1 + double(rho));
    EXPECT_NEAR(mean / expected, 1, faceted) << bounces;
  }
}

TEST(Lightmap, PunctualLightsOverAPlane) {
  // Closed forms: E = I cos / d^2, with a spot's falloff; a directional light's E cos. Exact but for the receiver's
  // hair's breadth.
  Scene scene = make_quad(Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 6, 6, Vec3(0.5f));
  const Vec3 at(0.3f, 0.8f, -0.2f), axis = normalize(Vec3(-0.4f, -1, 0.3f));
  scene.lights.push_back(
      {.name = "bulb", .kind = PunctualLight::Kind::point, .position = at, .intensity = Vec3(3, 2, 1)});
  scene.lights.push_back({.name = "spot",
                          .kind = PunctualLight::Kind::spot,
                          .position = at,
                          .direction = axis,
                          .intensity = Vec3(5, 6, 7),
                          .inner_cone = 0.3f,
                          .outer_cone = 0.7f});
  scene.lights.push_back(
      {.name = "sun", .kind = PunctualLight::Kind::directional, .direction = axis, .intensity = Vec3(1, 2, 3)});
  const Baking b = bake_lamps(scene, Where::vertices, {.samples = 32, .bounces = 1}, true);
  ASSERT_EQ(b.map.all.light.groups, (std::vector<std::string>{"bulb", "spot", "sun"}));
  const Relit bulb = b.lit({Vec3(1), Vec3(0), Vec3(0)}), spot = b.lit({Vec3(0), Vec3(1), Vec3(0)}),
              sun = b.lit({Vec3(0), Vec3(0), Vec3(1)});
  int lit_by_spot = 0;
  for (size_t r = 0; r < b.receivers.count(); ++r) {
    const Vec3 d = at - b.receivers.origins[r];
    const float distance = length(d), cosine = d.y / distance, point = cosine / (pi * distance * distance);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(bulb.at(r)[c], scene.lights[0].intensity[c] * point, 1e-4f * scene.lights[0].intensity[c]);
      const float off_axis = dot(-d / distance, axis);
      const float t = std::clamp((off_axis - std::cos(0.7f)) / (std::cos(0.3f) - std::cos(0.7f)), 0.0f, 1.0f);
      EXPECT_NEAR(spot.at(r)[c], scene.lights[1].intensity[c] * point * t * t, 1e-4f * scene.lights[1].intensity[c]);
      EXPECT_NEAR(sun.at(r)[c], scene.lights[2].intensity[c] * -axis.y / pi, 1e-5f);
      lit_by_spot += t > 0 && t < 1;
    }
  }
  EXPECT_GT(lit_by_spot, 3);
}

// A coloured corner with a lamp above, a bulb, and a sky: no symmetry.
Scene corner(bool bulb) {
  Scene scene;
  const uint32_t red = add_material(scene, "red", Vec3(0.8f, 0.2f, 0.1f)),
                 grey = add_material(scene, "grey", Vec3(0.6f));
  add_quad(scene, grey, "floor", Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 24, 24);
  add_quad(scene, red, "wall", Vec3(-1, 0, -1), Vec3(2, 0, 0), Vec3(0, 1.5f, 0), 24, 18);
  add_sphere(scene, grey, "ball", Vec3(0.3f, 0.5f, -0.2f), 0.35f, 3);
  add_quad(scene, add_lamp(scene, "lamp", Vec3(0.3f), Vec3(6, 5, 3)), "lamp", Vec3(-0.6f, 1.4f, 0.1f),
           Vec3(0.4f, 0.1f, 0), Vec3(0, 0.05f, 0.3f), 1, 1);
  if (bulb)
    scene.lights.push_back({.name = "bulb",
                            .kind = PunctualLight::Kind::point,
                            .position = Vec3(0.8f, 0.6f, 0.7f),
                            .intensity = Vec3(0.5f, 0.6f, 0.9f)});
  return scene;
}

Environment skew_sky() {
  return make_environment("skew", 32, 16, [](Vec3 d) {
    return Vec3(0.1f) + std::exp(6 * (dot(d, normalize(Vec3(1, 2, 0.5f))) - 1)) * Vec3(1, 0.8f, 0.5f);
  });
}

TEST(Lightmap, AgreesWithThePathTracer) {
  SKIP_UNDER_SANITIZERS();
  // 12 receivers of each kind; paths and rays leave noise below 1%, interpolation between receivers a little more.
  // Seams of the ball's charts move single texels by a few percent, since it is look-ups that they make agree.
  constexpr float noise = 0.02f, seams = 0.03f;
  const Environment sky = skew_sky();
  for (Where where : {Where::vertices, Where::texels, Where::patches}) {
    const Baking b =
        bake_lamps(corner(true), where, {.samples = 1024, .lamp_samples = 64, .bounces = 2}, true, &sky, 24);
    ASSERT_EQ(b.map.all.light.groups, (std::vector<std::string>{"lamp", "bulb", "sky"}));
    const Relit lit = b.lit({Vec3(1), Vec3(1), Vec3(1)});
    for (size_t k = 0; k < 12; ++k) {
      const size_t r = k * b.receivers.count() / 12 + 5;
      const Vec3 truth =
          exit_radiance(b.scene, sky, b.receivers.origins[r], b.receivers.normals[r], 2, 8192, uint32_t(k), true);
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(lit.at(r)[c], truth[c], (where == Where::texels ? noise + seams : noise) * std::max(truth[c], 0.5f))
            << "kind " << int(where) << " receiver " << r << " channel " << c;
    }
  }
}

TEST(Lightmap, GroupsAddUpToAll) {
  const Environment sky = skew_sky();
  const Baking apart =
      bake_lamps(corner(true), Where::vertices, {.samples = 1024, .lamp_samples = 64, .bounces = 2}, true, &sky);
  const Baking together =
      bake_lamps(corner(true), Where::vertices, {.samples = 1024, .lamp_samples = 64, .bounces = 2}, false, &sky);
  ASSERT_EQ(together.map.all.light.groups, std::vector<std::string>{all_lamps});
  const Relit sum = apart.lit({Vec3(1), Vec3(1), Vec3(1)}), all = together.lit({Vec3(1)});
  // The same rays and the same samples, group by group: only the order of additions differs.
  for (size_t r = 0; r < apart.receivers.count(); ++r)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(sum.at(r)[c], all.at(r)[c], 2e-5f * (1 + all.at(r)[c]));
}

TEST(Lightmap, DirectApartIsTheBakeWithoutBounces) {
  const Baking bounced = bake_lamps(corner(true), Where::vertices, {.samples = 256, .bounces = 2});
  const Baking direct = bake_lamps(corner(true), Where::vertices, {.samples = 256, .bounces = 0});
  ASSERT_TRUE(bounced.map.direct);
  ASSERT_EQ(bounced.map.direct->data.size(), direct.map.all.data.size());
  EXPECT_TRUE(std::equal(direct.map.all.data.begin(), direct.map.all.data.end(), bounced.map.direct->data.begin()));
}

TEST(Lightmap, HarmonicsOverTexelsAreTheVertexBakeBetweenVertices) {
  // A PRT lightmap against the vertex bake, both relit by one skew light, at random points of the floor away from its
  // shadows' sharpest parts: interpolation over cells of 1/12, and rays of their own, leave 2% of the brightest.
  Scene scene = corner(false);
  const Environment sky = skew_sky();
  std::vector<Vec3> light(16);
  Random random(3);
  for (Vec3& l : light) l = Vec3(random.next(), random.next(), random.next()) - 0.3f;
  light[0] += Vec3(4);
  auto tracer = Tracer::build(scene);
  const Receivers vertices = make_vertex_receivers(scene);
  auto by_vertices =
      bake(scene, *tracer, vertices, {.order = 4, .samples = 2048, .bounces = 2, .precision = Precision::single});
  ASSERT_TRUE(by_vertices);
  Relit a, b;
  relight(*by_vertices, light, a);
  Scene split = scene;
  const Receivers texels = place(split, Where::texels, 16);
  auto tracer_again = Tracer::build(split);
  auto map = bake_lightmap(split, *tracer_again, texels, Lamps{},
                           {.order = 4, .samples = 2048, .bounces = 2, .precision = Precision::single}, false);
  ASSERT_TRUE(map) << map.error().text();
  auto by_texels =
      bake(split, *tracer_again, texels, {.order = 4, .samples = 2048, .bounces = 2, .precision = Precision::single});
  ASSERT_TRUE(by_texels);
  relight(map->all, light, b);
  Relit c;
  relight(*by_texels, light, c);
  double squares = 0, total = 0;
  auto look_up = [](const SpatialBasis& basis, const Relit& lit, uint32_t t, float u, float v) {
    Vec3 sum(0);
    std::visit(
        [&](const auto& s) { s.spread(*s.find(t, true), u, v, [&](uint32_t r, float w) { sum += w * lit.at(r); }); },
        basis);
    return sum;
  };
  for (uint32_t t = 0; t < split.triangles.size(); ++t) {
    const float u = 0.7f * random.next(), v = (1 - u) * random.next();
    const Vec3 x = look_up(vertices.basis, a, t, u, v), y = look_up(texels.basis, b, t, u, v),
               z = look_up(texels.basis, c, t, u, v);
    squares += double(dot(x - y, x - y)), total += double(dot(x, x));
    EXPECT_LT(length(y - z),
              0.04f * (1 + length(y)));  // the two paths through the code differ by seam smoothing
  }
  EXPECT_LT(std::sqrt(squares / total), 0.03);
}

TEST(Lightmap, TheSameBytesWhateverTheThreadsAndTheMemory) {
  const Environment sky = skew_sky();
  auto bytes_with = [&](int threads, size_t memory, double* kept) {
    ThreadLimit limit(threads);
    const Baking b =
        bake_lamps(corner(true), Where::texels, {.samples = 64, .bounces = 2, .memory = memory}, true, &sky, 10);
    *kept = b.report.operator_kept;
    return std::vector<uint8_t>(b.map.all.data.begin(), b.map.all.data.end());
  };
  double kept = 0;
  const auto expected = bytes_with(1, size_t{4} << 30, &kept);
  EXPECT_EQ(kept, 1);
  EXPECT_EQ(bytes_with(2, size_t{4} << 30, &kept), expected);
  Scene scene = corner(true);
  const size_t least = least_lightmap_memory(place(scene, Where::texels, 10).count(), 3, {});
  EXPECT_EQ(bytes_with(2, least + 30000, &kept), expected);
  EXPECT_LT(kept, 0.9);
  auto tracer = Tracer::build(scene);
  const Lamps lamps = make_lamps(scene, nullptr, false);
  EXPECT_FALSE(bake_lightmap(scene, *tracer, make_vertex_receivers(scene), lamps, {.memory = 1000}, false));
}

TEST(Lightmap, RefusesWhatCannotBeBaked) {
  Scene dark = make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 1, 1, Vec3(0.5f));
  auto tracer = Tracer::build(dark);
  const Receivers r = make_vertex_receivers(dark);
  auto nothing = bake_lightmap(dark, *tracer, r, make_lamps(dark, nullptr, false), {}, false);
  ASSERT_FALSE(nothing);
  EXPECT_NE(nothing.error().text().find("nothing gives light"), std::string::npos);
  // A lamp whose triangles have no area is none.
  Scene flat = dark;
  const uint32_t m = add_lamp(flat, "flat", Vec3(0.5f), Vec3(1));
  add_quad(flat, m, "flat", Vec3(0), Vec3(1, 0, 0), Vec3(2, 0, 0), 1, 1);
  EXPECT_EQ(make_lamps(flat, nullptr, true).groups(), 0u);
  // One of no finite brightness is named.
  for (auto [radiance, words] : {std::pair{3e38f, "\"sun\" shines with"}, {INFINITY, "\"sun\" shines with"}}) {
    Scene glaring = dark;
    const uint32_t sun = add_lamp(glaring, "sun", Vec3(0.5f), Vec3(radiance));
    add_quad(glaring, sun, "sun", Vec3(0, 1, 0), Vec3(1, 0, 0), Vec3(0, 0, 1), 1, 1);
    auto glaring_tracer = Tracer::build(glaring);
    auto refused = bake_lightmap(glaring, *glaring_tracer, make_vertex_receivers(glaring),
                                 make_lamps(glaring, nullptr, true), {.samples = 16}, false);
    ASSERT_FALSE(refused) << radiance;
    EXPECT_NE(refused.error().text().find(words), std::string::npos) << refused.error().text();
  }
  const Environment black = make_environment("black", 4, 2, [](Vec3) { return Vec3(0); });
  EXPECT_EQ(make_lamps(dark, &black, true).groups(), 0u);
  Scene lit = corner(false);
  auto lit_tracer = Tracer::build(lit);
  const Receivers lit_receivers = make_vertex_receivers(lit);
  const Lamps lamps = make_lamps(lit, nullptr, false);
  for (LightmapOptions o : {LightmapOptions{.order = 17},
                            {.order = -1},
                            {.samples = 0},
                            {.lamp_samples = 0},
                            {.bounces = 65},
                            {.converge = 2},
                            {.converge = NAN}})
    EXPECT_FALSE(bake_lightmap(lit, *lit_tracer, lit_receivers, lamps, o, false));
  Progress cancelled;
  cancelled.cancel();
  EXPECT_FALSE(bake_lightmap(lit, *lit_tracer, lit_receivers, lamps, {.samples = 16}, false, nullptr, &cancelled));
}

TEST(Lightmap, AnEmissiveTextureIsItsPatternOfLamps) {
  // A lamp of 2 x 1 whose texture is white on its first half, as against a lamp of that half alone; lamp samples, rays
  // or both find it, and so does the path tracer, within the texture's slope between its halves and noise.
  Texture halves;
  halves.width = 64, halves.height = 1, halves.wrap_s = halves.wrap_t = Wrap::clamp, halves.rgb.assign(3 * 64, 0);
  std::fill_n(halves.rgb.begin(), 3 * 32, uint8_t(255));
  auto scene_with = [&](bool textured) {
    Scene scene;
    const uint32_t grey = add_material(scene, "grey", Vec3(0.5f)),
                   lamp = add_lamp(scene, "lamp", Vec3(0), Vec3(4, 3, 2));
    add_quad(scene, grey, "floor", Vec3(-1, 0, -1), Vec3(0, 0, 2), Vec3(2, 0, 0), 4, 4);
    add_quad(scene, lamp, "lamp", Vec3(-1, 0.7f, -0.5f), Vec3(textured ? 2 : 1, 0, 0), Vec3(0, 0, 1), 1, 1);
    if (!textured) return scene;
    scene.textures.push_back(halves), scene.materials[lamp].emissive_texture = 0;
    for (Vec3 p : scene.positions) scene.texcoords[0].push_back({(p.x + 1) / 2, 0});
    return scene;
  };
  const Environment black = make_environment("black", 4, 2, [](Vec3) { return Vec3(0); });
  for (auto [samples, lamp_samples] : {std::pair(4096, 1), std::pair(1, 4096), std::pair(1024, 256)}) {
    const LightmapOptions options{.samples = samples, .lamp_samples = lamp_samples, .bounces = 0};
    const Baking with = bake_lamps(scene_with(true), Where::patches, options),
                 without = bake_lamps(scene_with(false), Where::patches, options);
    const Relit a = with.lit({Vec3(1)}), b = without.lit({Vec3(1)});
    for (size_t r = 0; r < with.receivers.count(); ++r) {
      if (with.receivers.origins[r].y > 0.5f) continue;
      const Vec3 at = with.receivers.origins[r];
      const std::vector<Vec3>& others = without.receivers.origins;
      const auto nearest = std::ranges::min_element(others, {}, [&](Vec3 p) { return length(p - at); });
      const Vec3 truth = b.at(size_t(nearest - others.begin()));
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(a.at(r)[c], truth[c], 0.02f) << samples << " " << lamp_samples << " at " << r;
    }
    if (samples != 1024) continue;
    for (size_t r = 0; r < with.receivers.count(); r += 7) {
      const Vec3 at = with.receivers.origins[r];
      if (at.y > 0.5f) continue;
      const Vec3 truth = exit_radiance(with.scene, black, at, with.receivers.normals[r], 0, 4096, 1, true);
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(a.at(r)[c], truth[c], 0.02f) << r;
    }
  }
}

}  // namespace
}  // namespace lambent
