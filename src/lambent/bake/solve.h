#pragma once
// Solvers of x = e + A x (linear.h), for many columns at once: counted bounces, their terms one by one, and solutions
// of the discrete radiosity equation. Source: radiosity, "Discrete Radiosity Equation", "Iterative Linear Solver".
#include <lambent/bake/linear.h>
#include <lambent/core/own_part.h>
#include <lambent/core/result.h>

#include <functional>

namespace lambent {

// jacobi        x <- e + A x: the Neumann series, a bounce a step.
// gauss_seidel  the same, block by block with the newest values, in 16 interleaved phases whose blocks work side by
// side: the
//               result depends on their order, which is fixed, and not on threads.
// southwell     relaxes the receiver with the greatest residual, and pushes what that changes (the "shooting" of
// progressive
//               radiosity); needs the operator transposed, so memory for a second copy.
// gmres         least residual over the Krylov space, restarted. Not conjugate gradients: an operator gathered by rays
// is not
//               symmetric, not even after scaling by areas and albedos, since A_i F_ij = A_j F_ji holds for the mean
//               over rays only. Of the Krylov methods for any matrix, BiCGStab takes two applications a step and may
//               stagnate; GMRES takes one, never rises, and is done long before its basis grows large, since the
//               spectrum lies within a disc of the scene's albedo.
enum class Solver { jacobi, gauss_seidel, southwell, gmres };

struct SolveOptions {
  Solver solver = Solver::jacobi;
  double tolerance = 1e-3;  // of the residual |e + A x - x| / |e|, the greatest of all columns; > 0
  int most = 200;           // applications of A, at most, >= 1
};

struct SolveStep {
  double applications;  // of the whole operator so far; Southwell: entries touched / entries of A
  double residual;      // as in SolveOptions; after a sweep of Gauss-Seidel, of the rows as they were met
};
struct SolveReport {
  std::vector<SolveStep> steps;
  bool converged = false;
};

// e and the result are [row][width], width a multiple of lane_multiple; e must be filled (F e = e). Of other ranks'
// rows (LinearOperator::shares) the result has those that were fetched; so below. Not converging within `most` is no
// error: the report says so, and the last iterate is returned. Errors: cancelled; southwell of an operator that is not
// known by its entries.
Result<AlignedVector<float>> solve(const LinearOperator& op, const float* e, size_t width, const SolveOptions& options,
                                   SolveReport* report = nullptr, Progress* progress = nullptr);

// e, row by row.
struct Source {
  std::function<void(size_t row, float* y)> set;  // all of y
  // By the first half of the rays, of rows divisible by check_every; null: no error is estimated.
  std::function<void(size_t row, float* y)> set_half{};
};
Source source_of(const float* e, size_t width);

// Relative RMS error, from half-sample rows: sqrt(sum |half - full|^2 / sum |full|^2). Sums are kept by block of rows
// and added up in order.
class ErrorSums {
 public:
  explicit ErrorSums(size_t rows) : sums_((rows + gather_block - 1) / gather_block) {}
  void add(size_t row, const float* half, const float* full, size_t count);
  double relative() const;
  void gather(const Shares& shares) { shares.gather_pieces(sums_.data()); }
  struct Sum {
    double difference = 0, total = 0;
  };
  Sum& of_block(size_t row) { return sums_[row / gather_block]; }

 private:
  std::vector<Sum> sums_;
};

struct Bounced {
  AlignedVector<float> x;
  double error = -1;  // of the rows of the last step; negative: not estimated
};
// Takes rows [first, first + count) of a step, from any thread; those of bounce() in place of x.
using TakeRows = std::function<void(size_t first, size_t count, const float* y)>;

// The sum of the first terms: x_0 = F e, x_{k+1} = F (e + A x_k), `bounces` times. Errors: cancelled.
Result<Bounced> bounce(const LinearOperator& op, const Source& e, size_t width, int bounces,
                       Progress* progress = nullptr, const TakeRows& last = {});

// The same in memory that is given, which other ranks' rows take as they are fetched: x and next hold op.size(width)
// zeros each; the one with the sum is returned, the other is of no use.
Result<ZeroPages*> bounce_in(ZeroPages& x, ZeroPages& next, const LinearOperator& op, const Source& e, size_t width,
                             int bounces, Progress* progress, const TakeRows& last);

// The terms themselves: take(k, (F A)^k F e) for k = 0 ... bounces, in order; it may complete other ranks' rows, and
// change nothing else. Where x are other than the rows that it is made of (LinearOperator::keep), taker_of(k) takes
// those of term k before, of own receivers. Errors: cancelled; those of take.
Result<void> bounce_terms(const LinearOperator& op, const Source& e, size_t width, int bounces, Progress* progress,
                          const std::function<Result<void>(int k, AlignedVector<float>& x)>& take,
                          const std::function<TakeRows(int k)>& taker_of = {});

}  // namespace lambent
