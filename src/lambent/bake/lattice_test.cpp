#include <lambent/bake/lattice.h>
#include <lambent/bake/matrix.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/relight/lattice.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

// A floor, a wall and a box, all one-sided, in three colours; the box begins at `bottom`.
Scene corner_scene(Vec3 floor, Vec3 wall, Vec3 box, float bottom) {
  Scene scene;
  add_quad(scene, add_material(scene, "floor", floor), "floor", Vec3(-2, 0, -2), Vec3(0, 0, 4), Vec3(4, 0, 0), 12, 12);
  add_quad(scene, add_material(scene, "wall", wall), "wall", Vec3(-2, 0, -2), Vec3(4, 0, 0), Vec3(0, 3, 0), 12, 12);
  add_box(scene, add_material(scene, "box", box), "box", Vec3(-0.5f, bottom, -0.5f), Vec3(0.5f, bottom + 1, 0.5f), 4);
  return scene;
}
Scene coloured_corner() { return corner_scene(Vec3(0.8f, 0.3f, 0.2f), Vec3(0.2f, 0.6f, 0.7f), Vec3(0.5f), 0.01f); }

struct Surfaces {
  Scene scene;
  Tracer tracer;
  Receivers receivers;
  Transfer transfer;
};

Surfaces bake_surfaces(Scene scene, const BakeOptions& options) {
  auto tracer = Tracer::build(scene);
  EXPECT_TRUE(tracer);
  Surfaces s{std::move(scene), *tracer, {}, {}};
  s.receivers = make_vertex_receivers(s.scene);
  auto transfer = bake(s.scene, s.tracer, s.receivers, options);
  EXPECT_TRUE(transfer);
  if (transfer) s.transfer = *transfer;
  return s;
}

LatticeTransfer must_bake(const Surfaces& s, const Lattice& lattice, const LatticeOptions& options,
                          LatticeReport* report = nullptr) {
  auto baked = bake_lattice(s.scene, s.tracer, s.receivers, s.transfer, nullptr, lattice, options, report);
  EXPECT_TRUE(baked) << (baked ? "" : baked.error().text());
  return baked ? *baked : LatticeTransfer{};
}

TEST(Lattice, OfEmptySpaceIsTheIdentity) {
  // A speck far below, which no ray finds.
  Surfaces s = bake_surfaces(make_quad(Vec3(0, -1e4f, 0), Vec3(0, 0, 1e-3f), Vec3(1e-3f, 0, 0), 1, 1, Vec3(0.5f)),
                             {.order = 4, .samples = 16, .bounces = 0});
  for (int order : {2, 4, 6}) {
    const LatticeTransfer l = must_bake(s, {Vec3(-1), Vec3(1, 2, 3), 2, 3, 2},
                                        {.order = order, .samples = 64, .precision = Precision::single});
    ASSERT_EQ(l.transfer.channels, 1);
    for (size_t p = 0; p < l.lattice.count(); ++p) {
      EXPECT_TRUE(l.valid[p]);
      const std::vector<float> T = load_receiver(l.transfer, p);
      for (size_t j = 0; j < size_t(sh_count(order)); ++j)
        for (size_t i = 0; i < 16; ++i)
          EXPECT_NEAR(T[j * 16 + i], i == j ? 1 : 0, 2e-5) << j << " " << i;  // float sums of 64 rays, no noise
    }
  }
}

// The definition, as it stands, over directions of its own.
std::vector<double> plain_sum(const Surfaces& s, const Transfer& transfer, const Outgoing* outgoing, Vec3 p, int order,
                              int rays) {
  const CornerReceivers corners = corner_receivers(s.scene, s.receivers.front, s.receivers.back);
  const size_t C = transfer.columns(), J = size_t(sh_count(order));
  std::vector<std::vector<float>> T;
  for (size_t r = 0; r < s.receivers.count(); ++r) T.push_back(load_receiver(transfer, r));
  std::vector<double> sum(J * 3 * C, 0.0);
  const DirectionalBasis light =
      make_directional_basis(transfer.light.order, transfer.light.lobe_kind, transfer.light.lobes);
  std::vector<double> b_of(C);
  std::vector<float> y(J);
  std::vector<ViewWeights> weights(size_t(transfer.rows), ViewWeights(0, 0, 0, 1));
  for (int ray = 0; ray < rays; ++ray) {
    const Vec3 w = square_to_sphere(sobol_owen(uint32_t(ray), 991));
    evaluate_sh(order, w, y), evaluate_directional(light, Vec3d(w), b_of);
    const Hit h = s.tracer.closest(p, w);
    const Corners* corner = h.triangle == none ? nullptr : corners.find(h.triangle, h.front);
    for (size_t i = 0; i < C; ++i) {
      Vec3 radiance(0.0f);
      if (h.triangle == none) radiance = Vec3(float(b_of[i]));
      else if (corner)
        for (int k = 0; k < 3; ++k) {
          const uint32_t r = corner->receiver[size_t(k)];
          if (outgoing) evaluate_outgoing(*outgoing, r, -w, weights);
          const float b = k == 0 ? 1 - h.u - h.v : k == 1 ? h.u : h.v;
          radiance +=
              b * reflect_rows(weights, albedo(s.scene, s.scene.triangles[h.triangle], h.u, h.v), [&](size_t row) {
                Vec3 x;
                for (int c = 0; c < 3; ++c)
                  x[c] = T[r][(row * size_t(transfer.channels) + size_t(std::min(c, transfer.channels - 1))) * C + i];
                return x;
              });
        }
      for (size_t j = 0; j < J; ++j)
        for (size_t c = 0; c < 3; ++c)
          sum[(j * 3 + c) * C + i] += 4 * std::numbers::pi * double(radiance[int(c)]) * y[j] / rays;
    }
  }
  return sum;
}

void expect_integrals(const Surfaces& s, const Transfer& transfer, const Outgoing* outgoing, int rays = 1 << 15) {
  const Lattice lattice{Vec3(-1.2f, 0.2f, -1.4f), Vec3(1.1f, 1.6f, 1), 2, 2, 2};
  auto l = bake_lattice(s.scene, s.tracer, s.receivers, transfer, outgoing, lattice,
                        {.order = 4, .samples = 8192, .precision = Precision::single});
  ASSERT_TRUE(l) << l.error().text();
  ASSERT_EQ(l->transfer.channels, 3);
  for (size_t p = 0; p < lattice.count(); ++p) {
    const std::vector<double> truth = plain_sum(s, transfer, outgoing, lattice.position(p), 4, rays);
    const std::vector<float> T = load_receiver(l->transfer, p);
    ASSERT_EQ(T.size(), truth.size());
    // Entries are 4 pi times means of products that reach 2: the noise of 8,192 low-discrepancy rays, M^-0.75, against
    // discontinuities.
    for (size_t k = 0; k < T.size(); ++k) EXPECT_NEAR(T[k], truth[k], 0.03) << "point " << p << " entry " << k;
  }
}

TEST(Lattice, HoldsTheIntegralsItStandsFor) {
  // Light of direct transfer has no channels, that which its coloured surfaces send has; bounced transfer has them
  // already.
  for (int bounces : {0, 2}) {
    const Surfaces s = bake_surfaces(coloured_corner(), {.order = 3, .samples = 256, .bounces = bounces});
    ASSERT_EQ(s.transfer.channels, bounces ? 3 : 1);
    expect_integrals(s, s.transfer, nullptr);
  }
}

// Lobes of light beside the harmonics: one that rays of a point would hardly meet, one that they do.
TEST(Lattice, HoldsLightOfLamps) {
  SKIP_UNDER_SANITIZERS();
  const std::vector<Lobe> lamps{{normalize(Vec3(0.5f, 0.8f, 0.4f)), 300}, {normalize(Vec3(-0.3f, 0.2f, 0.9f)), 6}};
  for (int bounces : {0, 2}) {
    const Surfaces s =
        bake_surfaces(coloured_corner(), {.order = 3, .lobes = lamps, .samples = 1024, .bounces = bounces});
    expect_integrals(s, s.transfer, nullptr, 1 << 17);
  }
}

// In closed form: y_j against a lobe, of an open sky, and nothing behind a roof; by the rays of a point.
TEST(Lattice, LampsOfAnOpenSkyAreExact) {
  const std::vector<Lobe> lamps{
      {normalize(Vec3(0.1f, 0.8f, 0.2f)), 1e5f}, {normalize(Vec3(0.3f, -0.2f, 0.9f)), 2}, {Vec3(0, 1, 0), 0.5f}};
  Surfaces s = bake_surfaces(make_quad(Vec3(0, -1e4f, 0), Vec3(0, 0, 1e-3f), Vec3(1e-3f, 0, 0), 1, 1, Vec3(0.5f)),
                             {.order = 2, .lobes = lamps, .samples = 16, .bounces = 0});
  const DirectionalBasis basis = make_directional_basis(4, LobeKind::von_mises_fisher, lamps);
  const LatticeTransfer open =
      must_bake(s, {Vec3(-1), Vec3(1, 2, 3), 2, 3, 2}, {.order = 4, .samples = 1024, .precision = Precision::single});
  ASSERT_EQ(open.transfer.columns(), 7u);
  for (size_t p = 0; p < open.lattice.count(); ++p) {
    const std::vector<float> T = load_receiver(open.transfer, p);
    for (size_t j = 0; j < 16; ++j)
      for (size_t k = 0; k < 3; ++k)
        EXPECT_NEAR(T[j * 7 + 4 + k], basis.gram[j * 19 + 16 + k], k == 0 ? 2e-4 : 2e-5) << p << " " << j << " " << k;
  }
  Scene roofed = make_quad(Vec3(-9, 5, -9), Vec3(0, 0, 18), Vec3(18, 0, 0), 1, 1, Vec3(0.5f));
  roofed.triangles[0].two_sided = roofed.triangles[1].two_sided = true;
  const Surfaces below =
      bake_surfaces(std::move(roofed), {.order = 2, .lobes = {lamps[0]}, .samples = 16, .bounces = 0});
  const LatticeTransfer dark = must_bake(below, {Vec3(0), Vec3(0), 1, 1, 1}, {.order = 4, .samples = 64});
  const std::vector<float> T = load_receiver(dark.transfer, 0);
  for (size_t j = 0; j < 16; ++j) EXPECT_LT(std::abs(T[j * 5 * size_t(dark.transfer.channels) + 4]), 1e-3f) << j;
}

TEST(Lattice, SeesGlossySurfacesFromWhereItIs) {
  SKIP_UNDER_SANITIZERS();
  const Surfaces s = bake_surfaces(coloured_corner(), {.order = 3, .samples = 16, .bounces = 0});
  ReceiverMaterials materials;
  materials.materials = {{MetallicRoughness{Vec3(0), 0.5f, 0.3f}, MetallicRoughness{Vec3(1), 0.5f, 0.3f}}};
  materials.of_receiver.assign(s.receivers.count(), 0);
  for (const Vec3& n : s.receivers.normals) materials.frames.push_back(frame_about(n));
  for (OutgoingKind kind : {OutgoingKind::map, OutgoingKind::svd, OutgoingKind::hemisphere}) {
    const MatrixOptions matrix{.incident_order = 3, .outgoing = kind, .outgoing_order = 3, .svd_rows = 3, .grid = 16};
    auto baked =
        bake_matrix(s.scene, s.tracer, s.receivers, materials, {.order = 3, .samples = 256, .bounces = 1}, matrix);
    ASSERT_TRUE(baked);
    expect_integrals(s, baked->transfer, &baked->outgoing);
  }
}

TEST(Lattice, SeesAUniformWorldAmongWhiteSurfaces) {
  // A furnace: where nothing absorbs, uniform light is uniform everywhere that no black back is seen from.
  const Surfaces s = bake_surfaces(corner_scene(Vec3(1), Vec3(1), Vec3(1), 0.6f),
                                   {.order = 2, .samples = 256, .bounces = 40, .precision = Precision::single});
  const LatticeTransfer l = must_bake(s, {Vec3(-1.5f, 0.1f, -1.5f), Vec3(1.6f, 1.4f, 1.6f), 4, 3, 4},
                                      {.order = 3, .samples = 1024, .precision = Precision::single});
  std::vector<Vec3> light(4, Vec3(0));
  light[0] = Vec3(3, 2, 1) * std::sqrt(4 * pi);
  Relit relit;
  relight(l.transfer, light, relit);
  for (size_t p = 0; p < l.lattice.count(); ++p)
    for (int j = 0; j < 9; ++j)
      // Nothing but the sum of a harmonic over 1,024 low-discrepancy directions, which errs by about 1e-3 of 4 pi.
      EXPECT_LT(length(relit.at(p, j) - (j ? Vec3(0) : light[0])), 0.02f) << p << " " << j;
}

TEST(Lattice, FillsPointsInsideSolids) {
  const Surfaces s = bake_surfaces(coloured_corner(), {.order = 2, .samples = 64, .bounces = 1});
  // The middle point of 3 x 1 x 1 lies in the box.
  LatticeReport report;
  const Lattice line{Vec3(-1.5f, 0.5f, 0), Vec3(1.5f, 0.5f, 0), 3, 1, 1};
  const LatticeTransfer l = must_bake(s, line, {.order = 2, .samples = 64, .precision = Precision::single}, &report);
  EXPECT_EQ(l.valid, (std::vector<uint8_t>{1, 0, 1}));
  EXPECT_EQ(report.points, 3u);
  EXPECT_EQ(report.invalid, 1u);
  const std::vector<float> a = load_receiver(l.transfer, 0), b = load_receiver(l.transfer, 1),
                           c = load_receiver(l.transfer, 2);
  for (size_t k = 0; k < b.size(); ++k) EXPECT_NEAR(b[k], 0.5f * (a[k] + c[k]), 1e-6f);
  // Seven points inside, in a row from one that is clear, take its values one after another.
  const LatticeTransfer row = must_bake(s, {Vec3(-1.5f, 0.5f, 0), Vec3(0.45f, 0.5f, 0), 14, 1, 1},
                                        {.order = 2, .samples = 64, .precision = Precision::single});
  const std::vector<float> last_valid = load_receiver(row.transfer, 6), end = load_receiver(row.transfer, 13);
  EXPECT_EQ(row.valid, (std::vector<uint8_t>{1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(last_valid, end);
  // Nothing but the inside.
  auto none_left = bake_lattice(s.scene, s.tracer, s.receivers, s.transfer, nullptr,
                                {Vec3(-0.2f, 0.3f, -0.2f), Vec3(0.2f, 0.6f, 0.2f), 2, 2, 2}, {.samples = 64});
  ASSERT_FALSE(none_left);
  EXPECT_NE(none_left.error().message.find("inside something"), std::string::npos);
}

TEST(Lattice, StandsHalfACellInsideAndCountsWhatStandsBetweenPoints) {
  Scene scene = coloured_corner();
  const Bounds box = bounds(scene), points = default_lattice_box(scene, 4, 1, 2);
  const Vec3 size = box.max - box.min, first = box.min + size / Vec3(8, 2, 4), last = box.max - size / Vec3(8, 2, 4);
  EXPECT_LT(length(points.min - first) + length(points.max - last), 1e-5f);
  // Two rows of points along x: through the box's side at x = -0.5 and 0.5 where they are low, over it where high.
  const Surfaces s = bake_surfaces(std::move(scene), {.order = 2, .samples = 16, .bounces = 0});
  LatticeReport report;
  must_bake(s, {Vec3(-1, 0.5f, 1), Vec3(1, 0.5f, 1), 2, 1, 1}, {.order = 2, .samples = 64}, &report);
  EXPECT_EQ(report.neighbours, 1u);
  EXPECT_EQ(report.walled, 0u);
  must_bake(s, {Vec3(-1, 0.5f, 0), Vec3(1, 1.5f, 0), 2, 2, 1}, {.order = 2, .samples = 64}, &report);
  EXPECT_EQ(report.neighbours, 4u);
  EXPECT_EQ(report.walled, 1u);  // the low pair
  must_bake(s, {Vec3(-1.5f, 0.5f, 0), Vec3(1.5f, 0.5f, 0), 3, 1, 1}, {.order = 2, .samples = 64}, &report);
  EXPECT_EQ(report.neighbours, 0u);  // the middle point is none
}

TEST(Lattice, IsTheSameOnOneThreadAndSaysWhatMemoryItNeeds) {
  const Surfaces s = bake_surfaces(coloured_corner(), {.order = 3, .samples = 64, .bounces = 1});
  const Lattice lattice{Vec3(-1.5f, 0.1f, -1.5f), Vec3(1.5f, 2, 1.5f), 5, 4, 3};
  const LatticeOptions options{.order = 3, .samples = 100};
  const LatticeTransfer a = must_bake(s, lattice, options);
  ThreadLimit one(1);
  const LatticeTransfer b = must_bake(s, lattice, options);
  EXPECT_TRUE(
      std::equal(a.transfer.data.begin(), a.transfer.data.end(), b.transfer.data.begin(), b.transfer.data.end()));
  EXPECT_EQ(a.valid, b.valid);
  LatticeOptions poor = options;
  for (size_t memory : {size_t(1000), lattice_bytes(lattice, {.order = 3}, 3, 3, Precision::half) + 40000}) {
    poor.memory = memory;
    auto refused = bake_lattice(s.scene, s.tracer, s.receivers, s.transfer, nullptr, lattice, poor);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message.find("bytes"), std::string::npos);
  }
  EXPECT_FALSE(check_lattice({Vec3(0), Vec3(1), 0, 1, 1}, {.order = 3}, options));
  EXPECT_FALSE(check_lattice({Vec3(0), Vec3(1), 1, 65, 1}, {.order = 3}, options));
  EXPECT_FALSE(check_lattice({Vec3(0), Vec3(1, 1, -1), 1, 1, 1}, {.order = 3}, options));
  EXPECT_FALSE(check_lattice({Vec3(0), Vec3(1, INFINITY, 1), 1, 1, 1}, {.order = 3}, options));
  EXPECT_FALSE(check_lattice(lattice, {.order = 15}, options));
}

TEST(Lattice, InterpolatesLinearlyAndHoldsTheBorder) {
  // Trilinear interpolation reproduces what is linear in each coordinate: a + b x + c y z.
  for (const Lattice& lattice :
       {Lattice{Vec3(-1, 0, 2), Vec3(1, 3, 5), 4, 3, 2}, Lattice{Vec3(-1, 1, 2), Vec3(1, 1, 5), 5, 1, 3}}) {
    auto f = [](Vec3 p, int row) {
      return Vec3(1, 2, 3) + float(row + 1) * p.x * Vec3(0.5f, -1, 2) + p.y * p.z * Vec3(1, 0.2f, -0.3f);
    };
    Relit relit;
    relit.rows = 4;
    relit.values.resize((lattice.count() + transfer_block - 1) / transfer_block * 4 * 3 * transfer_block);
    for (size_t p = 0; p < lattice.count(); ++p)
      for (int row = 0; row < 4; ++row) relit.set(p, row, f(lattice.position(p), row));
    Random random(4);
    std::vector<Vec3> out(4);
    for (int i = 0; i < 200; ++i) {
      const Vec3 p = lattice.min - 1.0f +
                     Vec3(random.next(), random.next(), random.next()) * (lattice.max - lattice.min + 2.0f);
      interpolate_lattice(lattice, relit, p, out);
      const Vec3 held = clamp(p, lattice.min, lattice.max);
      for (int row = 0; row < 4; ++row)
        EXPECT_LT(length(out[size_t(row)] - f(held, row)), 1e-4f);  // float roundings of values up to 30
    }
  }
}

}  // namespace
}  // namespace lambent
