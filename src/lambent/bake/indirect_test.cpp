#include <lambent/bake/indirect.h>
#include <lambent/bake/solve.h>
#include <lambent/basis/sh.h>
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

std::unique_ptr<Made> make(Scene scene, size_t surfels, int samples, IndirectOptions options = {}) {
  auto m = std::make_unique<Made>();
  m->scene = std::move(scene);
  m->tracer = *Tracer::build(m->scene), m->receivers = make_vertex_receivers(m->scene);
  options.surfels = surfels, options.samples = samples;
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

TEST(Indirect, AConvexBodyAloneGathersNothing) {
  // Faces of a coarse ball, with normals interpolated: by up to 20 degrees others than theirs.
  const auto m = make(make_sphere(1, 1, Vec3(0.9f)), 512, 256);
  EXPECT_GT(m->transfer.gathering(), 50u);
  EXPECT_EQ(m->transfer.gather.nodes.size(), 0u);
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

// Of a lamp that is carried along: the light that surfels gather has no more kinks than what rays of their own find,
// each lit sharply where it ends. Direct light is taken at points of leaves, as `render` does.
TEST(Indirect, LightDoesNotPopAsALampMoves) {
  const auto m = make(room(Vec3(0.9f, 0.1f, 0.1f)), 2048, 256);
  const Surfels& f = m->transfer.surfels;
  const SurfelSearch search(f, m->tracer, m->transfer.gather_level);
  std::vector<std::vector<SurfacePlace>> places;
  for (uint32_t i = 0; i < f.count(); ++i) places.push_back(places_of_leaf(m->scene, m->tracer, f, search, i, 4));
  constexpr size_t frames = 12, apart = 7;
  const float lift = receiver_lift(Vec3(2), 0, bounds(m->scene).diagonal());
  const auto lit = [&](Vec3 lamp, const SurfacePlace& at) {
    const Vec3 p = at.position + at.normal * lift;
    const LampArrival a = arriving({.position = lamp, .intensity = Vec3(10)}, p);
    const float facing = dot(at.normal, a.direction);
    return facing > 0 && m->tracer.closest(p, a.direction, 0, a.distance).triangle == none ? facing / pi * a.irradiance
                                                                                           : Vec3(0.0f);
  };
  IndirectSolve s = make_indirect_solve(m->transfer);
  std::vector<Vec3> direct(f.count()), gathered(m->transfer.gathering());
  std::vector<std::vector<double>> ours, truth;
  for (size_t k = 0; k < frames; ++k) {
    const Vec3 lamp(-0.8f + 1.6f * float(k) / float(frames - 1), 2.2f, 1.2f);
    for (size_t i = 0; i < f.count(); ++i) {
      direct[i] = Vec3(0.0f);
      for (const SurfacePlace& at : places[i]) direct[i] += lit(lamp, at) / float(places[i].size());
    }
    gather_indirect(m->transfer, s, direct, gathered);
    ours.emplace_back(), truth.emplace_back();
    for (size_t r = 0; r < gathered.size(); r += apart) {
      ours.back().push_back(double(gathered[r].y));
      constexpr uint32_t rays = 512;
      double sum = 0;
      for (uint32_t j = 0; j < rays; ++j) {
        const Vec3 d = frame_about(f.normals[r]) * square_to_cosine_hemisphere(sobol_owen(j, uint32_t(r)));
        const Hit hit = m->tracer.closest(f.positions[r] + f.normals[r] * lift, d);
        if (hit.triangle != none && hit.front)
          sum += double(albedo(m->scene, m->scene.triangles[hit.triangle], hit.u, hit.v).y *
                        lit(lamp, surface_place(m->scene, hit)).y) /
                 rays;
      }
      truth.back().push_back(sum);
    }
  }
  double mean = 0, kinks = 0, kinks_of_truth = 0;
  for (size_t k = 1; k + 1 < frames; ++k)
    for (size_t r = 0; r < ours[k].size(); ++r) {
      mean += truth[k][r] / double(ours[k].size() * (frames - 2));
      for (auto [x, sum] : {std::pair(&ours, &kinks), std::pair(&truth, &kinks_of_truth)})
        *sum += std::pow((*x)[k + 1][r] - 2 * (*x)[k][r] + (*x)[k - 1][r], 2) / double(ours[k].size() * (frames - 2));
    }
  EXPECT_GT(mean, 0.05);
  EXPECT_LT(std::sqrt(kinks), 1.2 * std::sqrt(kinks_of_truth) + 0.001 * mean);
  EXPECT_LT(std::sqrt(kinks), 0.02 * mean);
}

TEST(Indirect, GoesOnFromTheLightBefore) {
  const auto m = make(room(Vec3(0.9f, 0.1f, 0.1f)), 512, 64);
  const auto a = lit_by(*m, Vec3(1, 2, 1), Vec3(10)), b = lit_by(*m, Vec3(1.05f, 2, 1), Vec3(10));
  IndirectSolve s = make_indirect_solve(m->transfer), other = make_indirect_solve(m->transfer);
  solve_indirect(m->transfer, other, b, 1e-5);
  const int anew = other.bounces;
  solve_indirect(m->transfer, s, a, 1e-5);
  solve_indirect(m->transfer, s, b, 1e-5, 64, true);
  EXPECT_LT(s.bounces, anew);
  double mean = 0;
  for (Vec3 x : other.x) mean += double(x.x) / double(other.x.size());
  for (size_t r = 0; r < s.x.size(); ++r) EXPECT_NEAR(s.x[r].x, other.x[r].x, 2e-4 * mean);
  // A bounce a frame comes to the same.
  for (Vec3& x : s.x) x = Vec3(0);
  double left = 1;
  for (int k = 0; k < 40; ++k) {
    step_indirect(m->transfer, s, b);
    EXPECT_LE(s.residual, left * 1.001 + 1e-6);
    left = s.residual;
  }
  for (size_t r = 0; r < s.x.size(); ++r) EXPECT_NEAR(s.x[r].x, other.x[r].x, 1e-3 * mean);
}

// Of all that leaves surfaces, by rays of its own: E / pi of a normal at a place.
Vec3 gathered(const Made& m, const SurfelSearch& search, const std::vector<Vec3>& direct, const IndirectSolve& s,
              Vec3 origin, Vec3 normal, std::optional<Vec3> above) {
  const Surfels& f = m.transfer.surfels;
  Vec3 sum(0.0f);
  constexpr uint32_t rays = 2048;
  for (uint32_t k = 0; k < rays; ++k) {
    const Vec3 d = frame_about(normal) * square_to_cosine_hemisphere(sobol_owen(k, 77));
    if (above && dot(d, *above) <= 0) continue;
    const Hit hit = m.tracer.closest(origin, d);
    if (hit.triangle == none) continue;
    const uint32_t leaf = search.leaf(surface_place(m.scene, hit));
    if (leaf != none) sum += f.albedos[leaf] * (direct[leaf] + s.x[s.ancestor[leaf]]);
  }
  return sum / float(rays);
}

// Whether something rises within the spacing of surfels that gather.
bool in_a_corner(const Made& m, Vec3 origin, Vec3 n) {
  const float spacing = m.transfer.surfels.spacings[m.transfer.gather_level];
  const Mat3 frame = frame_about(n);
  for (int k = 0; k < 8; ++k) {
    const float turn = pi * float(k) / 4;
    const Vec3 aside = std::cos(turn) * frame[0] + std::sin(turn) * frame[1];
    if (m.tracer.closest(origin, aside, 0, spacing).triangle != none) return true;
  }
  return m.tracer.closest(origin, n, 0, spacing).triangle != none;
}

TEST(Indirect, DirectionsAtReceiversAreThoseOfWhatIsSeen) {
  const auto m = make(room(Vec3(0.9f, 0.1f, 0.1f)), 2048, 256);
  const auto direct = lit_by(*m, Vec3(1, 2, 1), Vec3(9, 7, 5));
  IndirectSolve s = make_indirect_solve(m->transfer);
  solve_indirect(m->transfer, s, direct);
  send_indirect(m->transfer, s, direct);
  Relit plain, vector, harmonics;
  read_indirect(m->transfer, s, plain);
  read_directional_indirect(m->transfer, s, DirectionalKind::vector, vector);
  read_directional_indirect(m->transfer, s, DirectionalKind::sh3, harmonics);
  EXPECT_EQ(vector.rows, 3);
  EXPECT_EQ(harmonics.rows, 9);
  const SurfelSearch search(m->transfer.surfels, m->tracer, m->transfer.gather_level);
  double wrong = 0, right = 0;
  for (size_t r = 0; r < m->receivers.count(); ++r) {
    const Vec3 n = m->receivers.normals[r], origin = m->receivers.origins[r];
    const Mat3 frame = receiver_frame(n);
    const Vec3 own = plain.at(r), v[3] = {vector.at(r, 0), vector.at(r, 1), vector.at(r, 2)};
    std::array<Vec3, 9> rows;
    for (int k = 0; k < 9; ++k) rows[size_t(k)] = harmonics.at(r, k);
    // Kernels over one plane have one normal, and solved light is a bounce behind what is sent.
    EXPECT_NEAR(evaluate_directional_light(DirectionalKind::vector, v, frame, n).y, own.y, 0.02f * own.y + 0.005f);
    // Not in corners, where a receiver sees what surfels around it do not.
    if (r % 2 || in_a_corner(*m, origin, n)) continue;
    const Vec3 bent = normalize_or(n + 0.5f * frame[0], n);
    const Vec3 ours = evaluate_directional_light(DirectionalKind::sh3, rows, frame, bent),
               truth = gathered(*m, search, direct, s, origin, bent, n), e = ours - truth;
    wrong += double(dot(e, e)), right += double(dot(truth, truth));
  }
  EXPECT_GT(right, 0);
  EXPECT_LT(std::sqrt(wrong / right), 0.05);
}

TEST(Indirect, LatticeHasWhatArrivesInFreeSpace) {
  IndirectOptions options;
  options.lattice = Lattice{Vec3(-1.5f, 0.5f, -1.5f), Vec3(1.5f, 2.5f, 1.5f), 3, 2, 3};
  const auto m = make(room(Vec3(0.9f, 0.1f, 0.1f)), 2048, 256, options);
  ASSERT_TRUE(m->transfer.lattice);
  const IndirectLattice& f = *m->transfer.lattice;
  EXPECT_EQ(std::count(f.valid.begin(), f.valid.end(), 0), 1);  // in the block
  const auto direct = lit_by(*m, Vec3(1, 2, 1), Vec3(9, 7, 5));
  IndirectSolve s = make_indirect_solve(m->transfer);
  solve_indirect(m->transfer, s, direct);
  send_indirect(m->transfer, s, direct);
  Relit arriving;
  read_lattice_indirect(m->transfer, s, arriving);
  ASSERT_EQ(arriving.rows, 16);
  const SurfelSearch search(m->transfer.surfels, m->tracer, m->transfer.gather_level);
  std::vector<Vec3> rows(16);
  for (size_t p = 0; p < f.lattice.count(); ++p) {
    for (int k = 0; k < 16; ++k) rows[size_t(k)] = arriving.at(p, k);
    EXPECT_GT(rows[0].y, 0);  // that in the block has its neighbours'
    if (!f.valid[p]) continue;
    for (int k = 0; k < 16; ++k) rows[size_t(k)] *= float(clamped_cosine(sh_band(k)) / double(pi));
    double scale = 0;
    std::vector<std::pair<Vec3, Vec3>> pairs;
    for (Vec3 n : {Vec3(1, 0, 0), Vec3(-1, 0, 0), Vec3(0, 1, 0), Vec3(0, -1, 0), Vec3(0, 0, 1)})
      pairs.emplace_back(reconstruct_sh(rows, n), gathered(*m, search, direct, s, f.lattice.position(p), n, {})),
          scale = std::max(scale, double(pairs.back().second.y));
    for (const auto& [ours, truth] : pairs)
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(ours[c], truth[c], 0.08 * scale) << "point " << p;
  }
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
  const std::vector<uint8_t> bytes = pack_rows(good.gather);
  NodeRows read;
  ASSERT_TRUE(unpack_rows(bytes, good.gathering(), good.gather.nodes.size(), read, "x"));
  EXPECT_EQ(read.first, good.gather.first);
  EXPECT_EQ(read.nodes, good.gather.nodes);
  for (size_t length : {size_t(0), bytes.size() / 2, bytes.size() - 1})
    EXPECT_FALSE(unpack_rows({bytes.data(), length}, good.gathering(), good.gather.nodes.size(), read, "x"));
  EXPECT_FALSE(unpack_rows(bytes, good.gathering(), good.gather.nodes.size() - 1, read, "x"));
  // Kernels have come back once, at the end of the bake.
  const std::vector<uint8_t> kernels = pack_kernels(good);
  IndirectTransfer same = good;
  same.reader_surfels.clear(), same.reader_weights.clear();
  ASSERT_TRUE(unpack_kernels(kernels, same, "x"));
  EXPECT_EQ(same.reader_surfels, good.reader_surfels);
  EXPECT_EQ(same.reader_weights, good.reader_weights);
  for (size_t length : {size_t(0), size_t(1), kernels.size() / 2, kernels.size() - 1})
    EXPECT_FALSE(unpack_kernels({kernels.data(), length}, same, "x"));
  for (const auto& [at, value] : {std::pair(size_t(0), 1), std::pair(size_t(1), 9), std::pair(size_t(1), 255)}) {
    std::vector<uint8_t> wrong = kernels;
    wrong[at] = uint8_t(value);
    EXPECT_FALSE(unpack_kernels(wrong, same, "x"));
  }
  // Surfels are as they are kept.
  Surfels rounded = good.surfels;
  round_surfels(rounded);
  EXPECT_EQ(rounded.positions, good.surfels.positions);
  EXPECT_EQ(rounded.normals, good.surfels.normals);
  EXPECT_EQ(rounded.areas, good.surfels.areas);
  EXPECT_EQ(rounded.albedos, good.surfels.albedos);
  auto broken = [&](auto change) {
    IndirectTransfer t = good;
    change(t);
    return !check_indirect(t, "x");
  };
  EXPECT_FALSE(broken([](IndirectTransfer&) {}));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.parents[3] = t.surfels.counts[0]; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.parents.pop_back(); }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.parents[3] = 2; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.counts[0] = t.surfels.counts[1] + 1; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.positions[0].x = NAN; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.normals[0] = Vec3(0); }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.albedos[0] = Vec3(1.5f); }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.areas[0] = 0; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.materials[0] = 99; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.surfels.spacings[1] = INFINITY; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.gather_level = 99; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.gather.nodes.back() = uint32_t(t.surfels.nodes()); }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { std::swap(t.gather.nodes[0], t.gather.nodes[1]); }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.gather.scales[0] *= 2; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.gather.scales[0] = NAN; }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.reader_surfels[0] = uint32_t(t.gathering()); }));
  EXPECT_TRUE(broken([](IndirectTransfer& t) { t.reader_weights[0] = 0x7c00; }));
}

}  // namespace
}  // namespace lambent
