// The terms of the Neumann series, one by one: radiosity, "Neumann series".
#include <lambent/bake/bake.h>
#include <lambent/bake/lightmap.h>
#include <lambent/bake/materials.h>
#include <lambent/bake/matrix.h>
#include <lambent/bake/subsurface.h>
#include <lambent/receivers/atlas.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include <cstring>

namespace lambent {
namespace {

// A floor, a wall and a box that reaches below the floor, so that some receivers are buried.
Scene corner_scene() {
  Scene scene;
  const uint32_t red = add_material(scene, "red", Vec3(0.8f, 0.3f, 0.2f)),
                 grey = add_material(scene, "grey", Vec3(0.6f));
  add_quad(scene, red, "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 12, 12);
  add_quad(scene, grey, "wall", Vec3(-2, 0, -2), Vec3(4, 0, 0), Vec3(0, 3, 0), 12, 12);
  add_box(scene, grey, "box", Vec3(-0.5f, -0.3f, -0.5f), Vec3(0.7f, 1.0f, 0.5f), 4);
  return scene;
}

// Greatest difference of the sum of terms [0, count) from `all`, over the greatest value of all. Terms may be of fewer
// channels' worth of colour, but not of fewer channels.
double furthest(const std::vector<Transfer>& terms, size_t count, const Transfer& all) {
  double worst = 0, greatest = 0;
  for (size_t r = 0; r < all.receivers; ++r) {
    const std::vector<float> expected = load_receiver(all, r);
    std::vector<double> sum(expected.size(), 0.0);
    for (size_t k = 0; k < count; ++k) {
      const std::vector<float> term = load_receiver(terms[k], r);
      EXPECT_EQ(term.size(), sum.size());
      for (size_t i = 0; i < sum.size(); ++i) sum[i] += double(term[i]);
    }
    for (size_t i = 0; i < sum.size(); ++i) {
      worst = std::max(worst, std::abs(sum[i] - double(expected[i])));
      greatest = std::max(greatest, double(std::abs(expected[i])));
    }
  }
  return worst / greatest;
}

bool same_bytes(const Transfer& a, const Transfer& b) {
  return a.data.size() == b.data.size() && std::memcmp(a.data.data(), b.data.data(), a.data.size()) == 0;
}

TEST(Terms, AddUpToTheBakeAndToEveryBakeOfFewerBounces) {
  const Scene scene = corner_scene();
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  // Little memory: some rows are traced again for every term.
  for (size_t memory : {size_t{1} << 30, size_t{0}}) {
    // Denoised, each bake would have weights of its own.
    BakeOptions options{.order = 3, .samples = 128, .bounces = 3, .precision = Precision::single, .denoise = false};
    options.memory = memory ? memory : least_memory(receivers.count(), true, options) + 30'000;
    auto plain = bake(scene, *tracer, receivers, options);
    options.keep_terms = true;
    BakeReport report;
    auto all = bake(scene, *tracer, receivers, options, &report);
    ASSERT_TRUE(all && plain);
    EXPECT_TRUE(same_bytes(*all, *plain));
    EXPECT_GT(report.buried, 0u);
    EXPECT_EQ(report.operator_kept == 1, memory != 0);
    ASSERT_EQ(report.terms.size(), 4u);
    for (int bounces = 0; bounces <= 3; ++bounces) {
      BakeOptions fewer = options;
      fewer.bounces = bounces, fewer.keep_terms = false;
      auto expected = bake(scene, *tracer, receivers, fewer);
      ASSERT_TRUE(expected);
      if (expected->channels == 3) {  // direct light alone is of one channel
        EXPECT_LT(furthest(report.terms, size_t(bounces) + 1, *expected), 1e-6);
      }
      for (size_t r = 0; bounces == 0 && r < receivers.count(); ++r) {
        const std::vector<float> one = load_receiver(*expected, r), three = load_receiver(report.terms[0], r);
        for (size_t i = 0; i < three.size(); ++i) EXPECT_NEAR(three[i], one[i % one.size()], 1e-6f);
      }
    }
  }
  BakeReport report;
  auto direct = bake(scene, *tracer, receivers, {.order = 3, .samples = 16, .bounces = 0, .keep_terms = true}, &report);
  ASSERT_TRUE(direct);
  ASSERT_EQ(report.terms.size(), 1u);
  EXPECT_TRUE(same_bytes(report.terms[0], *direct));
}

TEST(Terms, OfAClosedBoxThatGlowsArePowersOfItsAlbedo) {
  // Every wall emits e and reflects rho: the k-th term is e rho^k, everywhere.
  const Vec3 e(1, 2, 0.5f), rho(0.8f, 0.5f, 0.3f);
  Scene scene;
  const uint32_t wall = add_material(scene, "wall", rho);
  scene.materials[wall].emissive = e;
  add_box(scene, wall, "box", Vec3(-1), Vec3(1, 0.5f, 2), 3, true);
  for (const bool texels : {false, true}) {
    Receivers receivers = make_vertex_receivers(scene);
    if (texels) {
      auto atlas = make_atlas(scene, {.texels_per_unit = 3});
      ASSERT_TRUE(atlas);
      receivers = make_texel_receivers(scene, *atlas);
    }
    auto tracer = Tracer::build(scene);
    const LightmapOptions options{
        .samples = 256, .lamp_samples = 16, .bounces = 5, .precision = Precision::single, .keep_terms = true};
    auto map = bake_lightmap(scene, *tracer, receivers, make_lamps(scene, nullptr, false), options, true);
    ASSERT_TRUE(map);
    ASSERT_EQ(map->terms.size(), 6u);
    // Seams are smoothed term by term, each to a relative 1e-4.
    EXPECT_LT(furthest(map->terms, 6, map->all), texels ? 1e-3 : 1e-6);
    EXPECT_TRUE(same_bytes(map->terms[0], *map->direct));
    for (int k = 0; k < 6; ++k)
      for (int c = 0; c < 3; ++c) {
        double mean = 0;
        for (size_t r = 0; r < receivers.count(); ++r)
          mean += double(load_receiver(map->terms[size_t(k)], r)[size_t(c)]) / double(receivers.count());
        // Rays that slip through corners, and the lamps' noise, which every term inherits: as for the sum
        // (Lightmap.ClosedBoxOfUniformEmission) below half a percent.
        const double expected = double(e[c]) * std::pow(double(rho[c]), k);
        EXPECT_NEAR(mean, expected, 0.005 * expected) << "term " << k << " channel " << c << " texels " << texels;
      }
  }
}

TEST(Terms, OfMatricesAndMediaAddUp) {
  const Scene scene = corner_scene();
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  Reflection reflection;
  reflection.everywhere = Ggx{Vec3(0.9f, 0.8f, 0.7f), Vec2(0.3f)};
  const ReceiverMaterials materials = make_receiver_materials(scene, receivers, reflection);
  auto matrix_of = [&](OutgoingKind kind) {
    return [&, kind](const BakeOptions& o, BakeReport* report) -> Result<Transfer> {
      auto baked = bake_matrix(scene, *tracer, receivers, materials, o,
                               {.incident_order = 3, .outgoing = kind, .grid = 16, .response_samples = 256}, report);
      if (!baked) return baked.error();
      return std::move(baked->transfer);
    };
  };
  auto medium = [&](const BakeOptions& o, BakeReport* report) {
    return bake_subsurface(scene, *tracer, receivers, o, {{Vec3(20, 15, 10), Vec3(1)}}, report);
  };
  using Baker = std::function<Result<Transfer>(const BakeOptions&, BakeReport*)>;
  for (const Baker& baker : {Baker(matrix_of(OutgoingKind::map)), Baker(matrix_of(OutgoingKind::svd)),
                             Baker(matrix_of(OutgoingKind::sh)), Baker(medium)}) {
    BakeOptions options{.order = 3, .samples = 32, .bounces = 2, .precision = Precision::single};
    auto plain = baker(options, nullptr);
    options.keep_terms = true;
    BakeReport report;
    auto all = baker(options, &report);
    ASSERT_TRUE(all && plain);
    EXPECT_TRUE(same_bytes(*all, *plain));  // asking for terms changes nothing
    ASSERT_EQ(report.terms.size(), 3u);
    for (int bounces = 0; bounces <= 2; ++bounces) {
      BakeOptions fewer = options;
      fewer.bounces = bounces;
      BakeReport of_fewer;
      auto expected = baker(fewer, &of_fewer);
      ASSERT_TRUE(expected);
      EXPECT_EQ(of_fewer.terms.size(), size_t(bounces) + 1);
      if (expected->channels == report.terms[0].channels) {
        EXPECT_LT(furthest(report.terms, size_t(bounces) + 1, *expected), 1e-5);
      } else {
        EXPECT_EQ(bounces, 0);  // direct light alone is of one channel
      }
    }
  }
}

TEST(Terms, AreRefusedWhereThereAreNone) {
  Scene scene = corner_scene();
  scene.materials[0].emissive = Vec3(1);
  auto tracer = Tracer::build(scene);
  const Receivers receivers = make_vertex_receivers(scene);
  const Lamps lamps = make_lamps(scene, nullptr, false);
  LightmapOptions options{.samples = 16, .keep_terms = true};
  EXPECT_TRUE(bake_lightmap(scene, *tracer, receivers, lamps, options, false));
  options.converge = 1e-2;
  EXPECT_FALSE(bake_lightmap(scene, *tracer, receivers, lamps, options, false));
  options.converge = 0, options.directional = DirectionalKind::sh2;
  EXPECT_FALSE(bake_lightmap(scene, *tracer, receivers, lamps, options, false));
  const ReceiverMaterials materials = make_receiver_materials(scene, receivers, {});
  EXPECT_FALSE(bake_matrix(scene, *tracer, receivers, materials, {.order = 2, .samples = 1, .keep_terms = true},
                           {.simulate_paths = true}));
}

}  // namespace
}  // namespace lambent
