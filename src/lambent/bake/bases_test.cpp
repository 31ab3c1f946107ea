// Fields over several bases, by light at points and by least squares (receivers/project.h, meshless.h).
#include <lambent/bake/bake.h>
#include <lambent/bake/lightmap.h>
#include <lambent/bake/meshless.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/receivers/atlas.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <cmath>
#include <map>

namespace lambent {
namespace {

enum class Over { vertices, texels, patches };

Receivers receivers_over(Scene& scene, Over over) {
  if (over == Over::vertices) return make_vertex_receivers(scene);
  if (over == Over::patches) return make_patch_receivers(scene);
  auto atlas = make_atlas(scene, {.texels_per_unit = 4});
  EXPECT_TRUE(atlas);
  return make_texel_receivers(scene, *atlas);
}

// Every wall glows: all light of a closed box is e / (1 - albedo), whatever the basis and the solver.
TEST(Bases, ClosedBoxGivesOneOverOneLessAlbedo) {
  for (Over over : {Over::vertices, Over::texels, Over::patches})
    for (Solver solver : {Solver::jacobi, Solver::gmres}) {
      Scene scene;
      const uint32_t wall = add_material(scene, "wall", Vec3(0.5f, 0.25f, 0));
      scene.materials[wall].emissive = Vec3(1);
      add_box(scene, wall, "box", Vec3(-1), Vec3(1), 4, true);
      const Receivers r = receivers_over(scene, over);
      const Tracer tracer = *Tracer::build(scene);
      LightmapOptions options{.samples = 256, .lamp_samples = 32, .converge = 1e-4, .solver = solver};
      options.projection = Projection::least_squares, options.precision = Precision::single;
      const auto map = bake_lightmap(scene, tracer, r, make_lamps(scene, nullptr, false), options, false);
      ASSERT_TRUE(map) << map.error().text();
      double mean[3] = {};
      for (size_t i = 0; i < r.count(); ++i) {
        const std::vector<float> row = load_receiver(map->all, i);
        for (size_t c = 0; c < 3; ++c) mean[c] += double(row[c]) / double(r.count());
      }
      // Lamps are sampled: the means have a little of their noise.
      EXPECT_NEAR(mean[0], 2, 0.03) << int(over);
      EXPECT_NEAR(mean[1], 4.0 / 3, 0.02) << int(over);
      EXPECT_NEAR(mean[2], 1, 0.015) << int(over);
    }
}

BakeOptions options_of(Projection projection, int samples) {
  BakeOptions o;
  o.order = 3, o.samples = samples, o.bounces = 1, o.denoise = false, o.precision = Precision::single;
  o.projection = projection;
  return o;
}

TEST(Bases, OpenPlaneIsAsWithoutShadows) {
  for (Over over : {Over::vertices, Over::texels, Over::patches}) {
    Scene scene = make_quad(Vec3(0), Vec3(0, 0, 1), Vec3(1, 0, 0), 3, 3, Vec3(0.5f));
    const Receivers r = receivers_over(scene, over);
    const Tracer tracer = *Tracer::build(scene);
    for (int bounces : {0, 1}) {
      BakeOptions o = options_of(Projection::least_squares, 1024);
      o.bounces = bounces, o.certify = false;
      const auto least = bake(scene, tracer, r, o);
      ASSERT_TRUE(least) << least.error().text();
      o.projection = Projection::collocation, o.shadows = false;
      const auto open = bake(scene, tracer, r, o);
      ASSERT_TRUE(open);
      for (size_t i = 0; i < r.count(); ++i) {
        const std::vector<float> a = load_receiver(*least, i), b = load_receiver(*open, i);
        for (size_t k = 0; k < b.size(); ++k) EXPECT_NEAR(a[k], b[k], 0.03f) << int(over) << " " << k;
      }
    }
  }
}

// A floor in coarse triangles, and a box over it whose shadow ends within them.
Scene shaded_floor() {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.5f));
  add_quad(scene, grey, "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 4, 4);
  add_box(scene, grey, "slab", Vec3(-0.7f, 0.4f, -0.7f), Vec3(0.8f, 0.6f, 0.8f), 2);
  return scene;
}

TEST(Bases, PatchesTakeTheMeanOfTheirAreas) {
  Scene scene = shaded_floor();
  const Receivers r = make_patch_receivers(scene);
  const Tracer tracer = *Tracer::build(scene);
  std::map<Projection, Transfer> by;
  for (Projection p : {Projection::collocation, Projection::least_squares}) {
    BakeOptions o = options_of(p, 4096);
    o.bounces = 0, o.certify = false;
    auto baked = bake(scene, tracer, r, o);
    ASSERT_TRUE(baked);
    by.emplace(p, std::move(*baked));
  }
  // What of an even sky gets through, by rays from random places of each triangle.
  double wrong[2] = {}, all = 0;
  const auto& patches = std::get<PatchReceivers>(r.basis);
  Random random(4);
  for (uint32_t t = 0; t < scene.parts[0].triangle_count; ++t) {
    double open = 0;
    constexpr int rays = 20000;
    for (int k = 0; k < rays; ++k) {
      const Vec2 s = random.next2();
      const float u = std::sqrt(s.x) * (1 - s.y), v = std::sqrt(s.x) * s.y;
      const Vec3 p = interpolate(scene.positions, scene.triangles[t], u, v) + Vec3(0, 1e-4f, 0);
      const Vec3 d = square_to_cosine_hemisphere(random.next2());
      open += double(tracer.closest(p, Vec3(d.x, d.z, d.y)).triangle == none) / rays;
    }
    const float constant = 2 * std::sqrt(pi);  // the even sky's first coefficient, of radiance 1
    int which = 0;
    for (Projection p : {Projection::collocation, Projection::least_squares}) {
      const double ours = double(load_receiver(by.at(p), patches.front[t].receiver)[0] * constant);
      wrong[which++] += (ours - open) * (ours - open);
    }
    all += open * open;
  }
  EXPECT_LT(std::sqrt(wrong[1] / all), 0.025);
  EXPECT_LT(wrong[1], 0.5 * wrong[0]);
}

TEST(Bases, LeastSquaresAreRefusedWhereTheyHaveNoMeaning) {
  Scene scene = shaded_floor();
  const Receivers r = make_vertex_receivers(scene);
  const Tracer tracer = *Tracer::build(scene);
  for (auto change : std::initializer_list<void (*)(BakeOptions&)>{
           [](BakeOptions& o) { o.denoise = true; }, [](BakeOptions& o) { o.error = 0.1; },
           [](BakeOptions& o) { o.meshless = 64; }, [](BakeOptions& o) { o.shadows = false; }}) {
    BakeOptions o = options_of(Projection::least_squares, 64);
    change(o);
    const auto refused = bake(scene, tracer, r, o);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().where, "projection");
  }
}

TEST(Bases, MeshlessKeepsAnOpenPlaneAndConvergesWithItsSurfels) {
  // On a fine mesh, whose hats lose nothing that kernels do not.
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.5f));
  add_quad(scene, grey, "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 40, 40);
  const Tracer open = *Tracer::build(scene);
  Receivers r = make_vertex_receivers(scene);
  BakeOptions o = options_of(Projection::collocation, 1024);
  o.meshless = 256, o.certify = false;
  const auto flat = bake(scene, open, r, o);
  ASSERT_TRUE(flat) << flat.error().text();
  EXPECT_EQ(flat->receivers, r.count());
  for (size_t i = 0; i < r.count(); ++i)
    EXPECT_NEAR(load_receiver(*flat, i)[0], 0.5f / std::sqrt(pi), 1e-4f);  // 1 over the first harmonic's 2 sqrt(pi)
  add_box(scene, grey, "slab", Vec3(-0.7f, 0.8f, -0.7f), Vec3(0.8f, 1.0f, 0.8f), 16);
  const Tracer tracer = *Tracer::build(scene);
  r = make_vertex_receivers(scene);
  double before = 1;
  for (size_t surfels : {128, 512, 2048}) {
    o.meshless = surfels, o.samples = 4096, o.certify = true;
    BakeReport report;
    ASSERT_TRUE(bake(scene, tracer, r, o, &report));
    EXPECT_NEAR(double(report.traced), double(surfels), 0.3 * double(surfels));
    EXPECT_LT(report.certificate.error, 0.75 * before) << surfels;
    before = report.certificate.error;
  }
  EXPECT_LT(before, 0.06);
}

// Kernels of a level keep constants, and of what bends they lose less and less, level by level.
TEST(Bases, HierarchyCutAtALevelConvergesAsLevelsGrow) {
  const Scene scene = make_sphere(1, 5, Vec3(0.5f));
  const Tracer tracer = *Tracer::build(scene);
  const auto surfels = make_surfels(scene, tracer, {8192, 3});
  ASSERT_TRUE(surfels);
  const auto bent = [](Vec3 p) { return std::sin(3 * p.x) * std::cos(2 * p.z) + p.y; };
  double before = 0;
  for (uint32_t level = 0; level < surfels->levels(); ++level) {
    const SurfelSearch search(*surfels, tracer, level);
    Random random(8);
    double lost = 0;
    for (int i = 0; i < 2000; ++i) {
      const Vec3 n = square_to_sphere(random.next2());
      const Hit hit = tracer.closest(2 * n, -n);
      ASSERT_NE(hit.triangle, none);
      const SurfacePlace at = surface_place(scene, hit);
      const Kernels k = search.kernels(at);
      float sum = 0, ones = 0;
      for (size_t j = 0; j < k.count; ++j)
        sum += k.weight[j] * bent(surfels->positions[k.surfel[j]]), ones += k.weight[j];
      EXPECT_NEAR(ones, 1, 1e-5f);
      lost += double((sum - bent(at.position)) * (sum - bent(at.position))) / 2000;
    }
    const double rms = std::sqrt(lost);
    if (level > 0) {
      EXPECT_LT(rms, 0.5 * before) << "level " << level;
    }
    before = rms;
  }
  EXPECT_LT(before, 5e-3);
}

}  // namespace
}  // namespace lambent
