#include <lambent/bake/kernels.h>
#include <lambent/bake/operator.h>
#include <lambent/bake/solve.h>
#include <lambent/core/parallel.h>
#include <lambent/core/random.h>
#include <lambent/scene/procedural.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

constexpr Solver all_solvers[] = {Solver::jacobi, Solver::gauss_seidel, Solver::southwell, Solver::gmres};

// A closed room of albedo about 0.8 with a box sunk into its floor, so that some receivers are buried.
Scene room(Vec3 albedo, int n = 4) {
  Scene scene;
  const uint32_t m = add_material(scene, "wall", albedo);
  add_box(scene, m, "room", Vec3(-1), Vec3(1, 1, 1.5f), n, true);
  add_box(scene, m, "block", Vec3(-0.6f, -1.2f, -0.6f), Vec3(0.5f, 0.2f, 0.4f), n / 2);
  return scene;
}

struct System {
  Scene scene;
  std::shared_ptr<Tracer> tracer;
  Receivers receivers;
  std::unique_ptr<GatherSetup> setup;
  std::unique_ptr<GatherOperator> op;
  size_t width;
  AlignedVector<float> e;

  System(Scene s, size_t columns, int samples = 64) : scene(std::move(s)), width(pad_lanes(columns)) {
    tracer = std::make_shared<Tracer>(*Tracer::build(scene));
    receivers = make_vertex_receivers(scene);
    setup = std::make_unique<GatherSetup>(make_gather_setup(scene, *tracer, receivers, 1, samples, 3));
    op = std::make_unique<GatherOperator>(*GatherOperator::trace(*setup, nullptr, nullptr, true, size_t{1} << 30));
    e.assign(receivers.count() * width, 0.0f);
    Random random(8);
    for (size_t r = 0; r < receivers.count(); ++r)
      for (size_t c = 0; c < columns; ++c)
        if (random.next() < 0.1f) e[r * width + c] = random.next() * float(1 + c);
    op->fill(e.data(), width);
  }
};

// Gaussian elimination with pivots, in double: the system itself, formed densely from the operator's images of unit
// vectors.
std::vector<double> dense_solution(const System& s, size_t column) {
  const size_t n = s.receivers.count();
  std::vector<double> A(n * (n + 1), 0.0);
  AlignedVector<float> x(n * s.width), y(n * s.width);
  // A lane at a time would do; all lanes carry unit vectors of their own.
  for (size_t first = 0; first < n; first += s.width) {
    std::fill(x.begin(), x.end(), 0.0f);
    for (size_t k = 0; k < s.width && first + k < n; ++k) x[(first + k) * s.width + k] = 1;
    s.op->apply(x.data(), s.width, y.data());
    for (size_t i = 0; i < n; ++i)
      for (size_t k = 0; k < s.width && first + k < n; ++k) A[i * (n + 1) + first + k] = -double(y[i * s.width + k]);
  }
  for (size_t i = 0; i < n; ++i) A[i * (n + 1) + i] += 1, A[i * (n + 1) + n] = double(s.e[i * s.width + column]);
  for (size_t p = 0; p < n; ++p) {
    size_t best = p;
    for (size_t i = p + 1; i < n; ++i)
      if (std::abs(A[i * (n + 1) + p]) > std::abs(A[best * (n + 1) + p])) best = i;
    for (size_t k = 0; k <= n; ++k) std::swap(A[p * (n + 1) + k], A[best * (n + 1) + k]);
    for (size_t i = p + 1; i < n; ++i) {
      const double f = A[i * (n + 1) + p] / A[p * (n + 1) + p];
      if (f == 0) continue;
      for (size_t k = p; k <= n; ++k) A[i * (n + 1) + k] -= f * A[p * (n + 1) + k];
    }
  }
  std::vector<double> out(n);
  for (size_t i = n; i-- > 0;) {
    double sum = A[i * (n + 1) + n];
    for (size_t k = i + 1; k < n; ++k) sum -= A[i * (n + 1) + k] * out[k];
    out[i] = sum / A[i * (n + 1) + i];
  }
  return out;
}

TEST(Solve, AllSolversFindTheSolutionOfTheDenseSystem) {
  // Grey walls: one weight an entry, and every lane is a column of the same matrix.
  const System s(room(Vec3(0.8f)), 5);
  size_t buried = 0;
  for (uint8_t b : s.op->buried()) buried += b;
  EXPECT_GT(buried, 0u);
  for (size_t column : {size_t{0}, size_t{3}}) {
    const std::vector<double> truth = dense_solution(s, column);
    double norm = 0;
    for (double x : truth) norm = std::max(norm, std::abs(x));
    for (Solver solver : all_solvers) {
      SolveReport report;
      auto x = solve(*s.op, s.e.data(), s.width, {solver, 1e-6, 200}, &report);
      ASSERT_TRUE(x);
      EXPECT_TRUE(report.converged) << int(solver);
      // The residual 1e-6 is magnified by at most 1 / (1 - 0.8); floats add their own 1e-6.
      for (size_t r = 0; r < s.receivers.count(); ++r)
        EXPECT_NEAR((*x)[r * s.width + column], truth[r], 3e-5 * norm) << int(solver) << " " << r;
    }
  }
}

TEST(Solve, ColouredColumnsAgreeAndTheResidualIsWhatTheySay) {
  const System s(room(Vec3(0.85f, 0.6f, 0.3f)), 9);
  AlignedVector<float> first;
  for (Solver solver : all_solvers) {
    SolveReport report;
    auto x = solve(*s.op, s.e.data(), s.width, {solver, 1e-5, 200}, &report);
    ASSERT_TRUE(x);
    ASSERT_TRUE(report.converged) << int(solver);
    AlignedVector<float> y(x->size());
    s.op->apply(x->data(), s.width, y.data());
    for (size_t c = 0; c < 9; ++c) {
      double residual = 0, norm = 0;
      for (size_t r = 0; r < s.receivers.count(); ++r) {
        const double d = double(s.e[r * s.width + c]) + double(y[r * s.width + c]) - double((*x)[r * s.width + c]);
        residual += d * d, norm += double(s.e[r * s.width + c]) * double(s.e[r * s.width + c]);
      }
      EXPECT_LT(std::sqrt(residual / norm), 2e-5) << int(solver) << " column " << c;
    }
    if (first.empty()) first = *x;
    for (size_t i = 0; i < x->size(); ++i)
      EXPECT_NEAR((*x)[i], first[i], 1e-4f * (1 + std::abs(first[i]))) << int(solver);
    for (size_t k = 1; k < report.steps.size(); ++k)
      EXPECT_GT(report.steps[k].applications, report.steps[k - 1].applications);
  }
}

TEST(Solve, BetterSolversTakeFewerApplications) {
  SKIP_UNDER_SANITIZERS();
  const System s(room(Vec3(0.8f), 16), 3, 256);  // blocks enough for all phases of Gauss-Seidel
  auto applications = [&](Solver solver) {
    SolveReport report;
    EXPECT_TRUE(solve(*s.op, s.e.data(), s.width, {solver, 1e-3, 200}, &report));
    EXPECT_TRUE(report.converged);
    return report.steps.back().applications;
  };
  const double jacobi = applications(Solver::jacobi);
  EXPECT_LT(applications(Solver::gauss_seidel), 0.75 * jacobi);
  EXPECT_LT(applications(Solver::southwell), 0.75 * jacobi);
  EXPECT_LT(applications(Solver::gmres), 0.5 * jacobi);
}

TEST(Solve, CountedBouncesAreJacobiSteps) {
  const System s(room(Vec3(0.7f, 0.5f, 0.4f)), 3);
  auto x = bounce(*s.op, source_of(s.e.data(), s.width), s.width, 2);
  ASSERT_TRUE(x);
  AlignedVector<float> a(s.e.size()), b(s.e.size());
  s.op->apply(s.e.data(), s.width, a.data());
  s.op->apply(a.data(), s.width, b.data());
  for (size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(x->x[i], s.e[i] + a[i] + b[i], 1e-5f * (1 + x->x[i]));
}

TEST(Solve, DoesNotDependOnThreadsAndStopsWhereTold) {
  for (Solver solver : all_solvers) {
    auto bytes = [&](int threads) {
      ThreadLimit limit(threads);
      const System s(room(Vec3(0.8f, 0.5f, 0.2f)), 6);
      auto x = solve(*s.op, s.e.data(), s.width, {solver, 1e-4, 200});
      EXPECT_TRUE(x);
      return std::vector<float>(x->begin(), x->end());
    };
    EXPECT_EQ(bytes(1), bytes(2)) << int(solver);
  }
  const System s(room(Vec3(0.8f)), 3);
  for (Solver solver : all_solvers) {
    SolveReport report;
    EXPECT_TRUE(solve(*s.op, s.e.data(), s.width, {solver, 1e-12, 2}, &report));
    EXPECT_FALSE(report.converged);
    EXPECT_LE(report.steps.back().applications, 2.5) << int(solver);
    EXPECT_FALSE(solve(*s.op, s.e.data(), s.width, {solver, 0, 2}));
    Progress cancelled;
    cancelled.cancel();
    EXPECT_FALSE(solve(*s.op, s.e.data(), s.width, {solver, 1e-3, 20}, nullptr, &cancelled));
  }
}

}  // namespace
}  // namespace lambent
