#include <lambent/bake/indirect.h>
#include <lambent/bake/solve.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>
#include <lambent/reference/path_tracer.h>
#include <lambent/relight/indirect.h>
#include <lambent/scene/lights.h>
#include <lambent/scene/procedural.h>

#include <gtest/gtest.h>

#include "sanitizers.h"

namespace lambent {
namespace {

struct Made {
  Scene scene;
  Tracer tracer;
  Receivers receivers;
  IndirectTransfer transfer;
};

std::unique_ptr<Made> make(Scene scene, size_t surfels, int samples, float angle = 0.2f) {
  auto m = std::make_unique<Made>();
  m->scene = std::move(scene);
  m->tracer = *Tracer::build(m->scene), m->receivers = make_vertex_receivers(m->scene);
  IndirectOptions options;
  options.surfels = surfels, options.samples = samples, options.angle = angle;
  auto t = bake_indirect(m->scene, m->tracer, m->receivers, options);
  EXPECT_TRUE(t);
  m->transfer = std::move(*t);
  const auto ok = check_indirect(m->transfer, "made");
  EXPECT_TRUE(ok) << (ok ? "" : ok.error().text());
  return m;
}

Scene closed_box(float albedo) {
  Scene scene;
  add_box(scene, add_material(scene, "wall", Vec3(albedo, albedo / 2, 0)), "box", Vec3(-1), Vec3(1), 6, true);
  return scene;
}

// A room with a block in it and a red wall of its own.
Scene room(Vec3 wall) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.7f)), painted = add_material(scene, "painted", wall);
  add_box(scene, grey, "shell", Vec3(-2, 0, -2), Vec3(2, 3, 2), 4, true);
  add_quad(scene, painted, "painted", Vec3(-1.99f, 0, 2), Vec3(0, 0, -4), Vec3(0, 3, 0), 3, 3);
  add_box(scene, grey, "block", Vec3(-0.6f, 0, -0.8f), Vec3(0.4f, 1.2f, 0.5f), 2);
  return scene;
}

std::vector<Vec3> lit_by(const Made& m, Vec3 lamp, Vec3 intensity) {
  const Surfels& s = m.transfer.surfels;
  std::vector<Vec3> direct(s.count());
  PunctualLight light{.position = lamp, .intensity = intensity};
  const float diagonal = bounds(m.scene).diagonal();
  for (size_t i = 0; i < s.count(); ++i) {
    const Vec3 p = s.positions[i] + s.normals[i] * receiver_lift(s.positions[i], 0, diagonal);
    const LampArrival a = arriving(light, p);
    const float facing = dot(s.normals[i], a.direction);
    if (facing > 0 && m.tracer.closest(p, a.direction, 0, a.distance).triangle == none)
      direct[i] = facing / pi * a.irradiance;
  }
  return direct;
}

TEST(Indirect, ClosedBoxGivesOneOverOneLessAlbedo) {
  const auto m = make(closed_box(0.5f), 1024, 256);
  IndirectSolve s = make_indirect_solve(m->transfer);
  const std::vector<Vec3> direct(m->transfer.surfels.count(), Vec3(1.0f));
  solve_indirect(m->transfer, s, direct, 1e-6);
  for (Vec3 x : s.x) {
    EXPECT_NEAR(1 + x.x, 1 / (1 - 0.5f), 2e-3f);
    EXPECT_NEAR(1 + x.y, 1 / (1 - 0.25f), 2e-3f);
    EXPECT_EQ(x.z, 0);
  }
  Relit out;
  read_indirect(m->transfer, s, out);
  for (size_t r = 0; r < m->receivers.count(); ++r) EXPECT_NEAR(out.at(r).x, 1, 4e-3f) << r;
}

// Against the solvers of every other kind, over the same operator as a matrix.
TEST(Indirect, BouncesAreTheSolutionOfTheLinearSystem) {
  const auto m = make(room(Vec3(0.9f, 0.1f, 0.1f)), 256, 64);
  const IndirectTransfer& t = m->transfer;
  struct Matrix final : LinearOperator {
    size_t n = 0;
    std::vector<float> a;
    size_t rows() const override { return n; }
    void add_rows(size_t first, size_t count, const float* x, size_t width, float* y, float*) const override {
      for (size_t r = 0; r < count; ++r)
        for (size_t j = 0; j < n; ++j) y[r * width] += a[(first + r) * n + j] * x[j * width];
    }
  } matrix;
  IndirectSolve s = make_indirect_solve(t);
  matrix.n = t.gathering(), matrix.a.resize(matrix.n * matrix.n);
  std::vector<Vec3> leaves(t.surfels.count()), y(matrix.n);
  for (size_t j = 0; j < matrix.n; ++j) {
    for (size_t i = 0; i < leaves.size(); ++i) leaves[i] = Vec3(s.ancestor[i] == j ? 1.0f : 0.0f);
    gather_indirect(t, s, leaves, y);
    for (size_t r = 0; r < matrix.n; ++r) matrix.a[r * matrix.n + j] = y[r].x;
  }
  const std::vector<Vec3> direct = lit_by(*m, Vec3(1, 2, 1), Vec3(10));
  gather_indirect(t, s, direct, y);
  constexpr size_t width = 16;
  AlignedVector<float> e(matrix.n * width, 0.0f);
  for (size_t r = 0; r < matrix.n; ++r) e[r * width] = y[r].x;
  const auto x = solve(matrix, e.data(), width, {Solver::gmres, 1e-6, 200});
  ASSERT_TRUE(x);
  solve_indirect(t, s, direct, 1e-6);
  double all = 0;
  for (size_t r = 0; r < matrix.n; ++r) all += double(s.x[r].x) / double(matrix.n);
  EXPECT_GT(all, 0.1);
  for (size_t r = 0; r < matrix.n; ++r) EXPECT_NEAR(s.x[r].x, (*x)[r * width], 1e-4 * all);
}

TEST(Indirect, LampsAddUpAndAWallIsRepainted) {
  const auto red = make(room(Vec3(0.9f, 0.1f, 0.1f)), 1024, 128), blue = make(room(Vec3(0.1f, 0.2f, 0.8f)), 1024, 128);
  const auto a = lit_by(*red, Vec3(1, 2, 1), Vec3(9, 7, 5)), b = lit_by(*red, Vec3(-1.4f, 0.6f, 1.4f), Vec3(1, 2, 3));
  std::vector<Vec3> both(a.size());
  for (size_t i = 0; i < a.size(); ++i) both[i] = a[i] + b[i];
  IndirectSolve s = make_indirect_solve(red->transfer);
  auto solved = [&](const std::vector<Vec3>& direct) {
    solve_indirect(red->transfer, s, direct, 0, 12);
    return s.x;
  };
  const auto xa = solved(a), xb = solved(b), xab = solved(both);
  for (size_t r = 0; r < xa.size(); ++r) EXPECT_NEAR(xab[r].x, xa[r].x + xb[r].x, 1e-5f * xab[r].x + 1e-7f);
  // A new bake has the same surfels, and differs by rounding alone.
  std::vector<Vec3> albedos = red->transfer.surfels.albedos;
  for (size_t i = 0; i < albedos.size(); ++i)
    if (red->transfer.surfels.names[red->transfer.surfels.materials[i]] == "painted")
      albedos[i] = Vec3(0.1f, 0.2f, 0.8f);
  IndirectSolve repainted = make_indirect_solve(red->transfer, albedos), anew = make_indirect_solve(blue->transfer);
  solve_indirect(red->transfer, repainted, a), solve_indirect(blue->transfer, anew, a);
  float changed = 0;
  for (size_t r = 0; r < xa.size(); ++r) {
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(repainted.x[r][c], anew.x[r][c], 2e-3f * anew.x[r][c] + 1e-6f);
    changed = std::max(changed, repainted.x[r].z / std::max(xa[r].z, 1e-6f));
  }
  EXPECT_GT(changed, 1.5f);
}

TEST(Indirect, ClosedNeighbouringRoomStaysDark) {
  Scene scene;
  const uint32_t grey = add_material(scene, "grey", Vec3(0.8f));
  add_box(scene, grey, "shell", Vec3(-2, 0, -1), Vec3(2, 2, 1), 1, true);
  add_box(scene, grey, "wall", Vec3(-0.01f, -0.1f, -1.1f), Vec3(0.01f, 2.1f, 1.1f), 1);
  const auto m = make(std::move(scene), 2048, 256);
  IndirectSolve s = make_indirect_solve(m->transfer);
  solve_indirect(m->transfer, s, lit_by(*m, Vec3(-1, 1.2f, 0.2f), Vec3(5)));
  double lit = 0, dark = 0;
  for (size_t r = 0; r < s.x.size(); ++r) (m->transfer.surfels.positions[r].x < 0 ? lit : dark) += double(s.x[r].x);
  EXPECT_GT(lit, 1);
  EXPECT_LT(dark, 1e-3 * lit);
}

// Lamps at several places, against paths that know no surfels.
TEST(Indirect, IsWhatPathsGather) {
  SKIP_UNDER_SANITIZERS();
  const auto m = make(room(Vec3(0.9f, 0.1f, 0.1f)), 8192, 512);
  const SurfelSearch search(m->transfer.surfels, m->tracer, m->transfer.gather_level);
  IndirectSolve s = make_indirect_solve(m->transfer);
  Random random(11);
  for (const Vec3 lamp : {Vec3(1.2f, 2.2f, 0.9f), Vec3(-1.3f, 0.7f, -1.4f), Vec3(0.8f, 0.4f, 1.2f)}) {
    solve_indirect(m->transfer, s, lit_by(*m, lamp, Vec3(10)), 1e-4);
    Scene lit = m->scene;
    lit.lights = {{.position = lamp, .intensity = Vec3(10)}};
    const Environment dark = *load_environment("uniform:0");
    std::vector<Vec3> origins, normals, ours;
    while (origins.size() < 60) {
      const Hit hit = m->tracer.closest(Vec3(1, 1.5f, 1), square_to_sphere(random.next2()));
      if (hit.triangle == none) continue;
      const SurfacePlace at = surface_place(m->scene, hit);
      const Kernels k = search.kernels(at);
      Vec3 sum(0);
      for (size_t j = 0; j < k.count; ++j) sum += k.weight[j] * s.x[k.surfel[j]];
      ours.push_back(sum), origins.push_back(at.position + at.normal * 1e-4f), normals.push_back(at.normal);
    }
    const auto all = exit_radiances(lit, dark, origins, normals, 24, 2048, 5, {}, true),
               direct = exit_radiances(lit, dark, origins, normals, 0, 4, 5, {}, true);
    double wrong = 0, peak = 0, noise = 0;
    for (size_t i = 0; i < ours.size(); ++i) {
      const Vec3 truth = all[i].mean - direct[i].mean, e = ours[i] - truth;
      wrong += double(dot(e, e)) / 3, noise += double(all[i].variance.x), peak = std::max(peak, double(truth.x));
    }
    const double rms = std::sqrt(std::max(wrong - noise, 0.0) / double(ours.size()));
    EXPECT_GT(20 * std::log10(peak / std::max(rms, 1e-9)), 35) << "lamp at x " << lamp.x;
  }
}

TEST(Indirect, RowsArePackedAndBrokenOnesRefused) {
  const auto m = make(room(Vec3(0.5f)), 256, 64);
  const IndirectTransfer& good = m->transfer;
  const std::vector<uint8_t> bytes = pack_rows(good);
  IndirectTransfer read;
  ASSERT_TRUE(unpack_rows(bytes, good.gathering(), good.nodes.size(), read, "x"));
  EXPECT_EQ(read.first, good.first);
  EXPECT_EQ(read.nodes, good.nodes);
  for (size_t length : {size_t(0), bytes.size() / 2, bytes.size() - 1})
    EXPECT_FALSE(unpack_rows({bytes.data(), length}, good.gathering(), good.nodes.size(), read, "x"));
  EXPECT_FALSE(unpack_rows(bytes, good.gathering(), good.nodes.size() - 1, read, "x"));
  auto broken = [&](auto change) {
    IndirectTransfer t = good;
    change(t);
    return !check_indirect(t, "x");
  };
  EXPECT_FALSE(broken([](IndirectTransfer&) {}));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.parents[3] = t.surfels.counts[0]; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.parents.pop_back(); }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.counts[0] = t.surfels.counts[1] + 1; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.positions[0].x = NAN; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.normals[0] = Vec3(0); }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.albedos[0] = Vec3(1.5f); }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.areas[0] = 0; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.materials[0] = 99; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.spacings[1] = INFINITY; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.gather_level = 99; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.nodes.back() = uint32_t(t.surfels.nodes()); }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { std::swap(t.nodes[0], t.nodes[1]); }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.scales[0] *= 2; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.scales[0] = NAN; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.reader_surfels[0] = uint32_t(t.gathering()); }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.reader_weights[0] = 0x7c00; }));
}

}  // namespace
}  // namespace lambent
