#pragma once
// Solvers of the discrete radiosity equation x = e + A x, A the gather operator (F B, operator.h), for many columns at
// once. Source: radiosity, "Discrete Radiosity Equation", "Iterative Linear Solver".
#include <lambent/bake/operator.h>

#include <string>

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

// e and the result are [receiver][width], width a multiple of lane_multiple; e must be filled (F e = e). Not converging
// within `most` is no error: the report says so, and the last iterate is returned. Errors: cancelled.
Result<AlignedVector<float>> solve(const GatherOperator& op, const float* e, size_t width, const SolveOptions& options,
                                   SolveReport* report = nullptr, Progress* progress = nullptr);

// The sum of the first terms: x_0 = e, x_{k+1} = e + A x_k, `bounces` times.
Result<AlignedVector<float>> bounce(const GatherOperator& op, const float* e, size_t width, int bounces,
                                    Progress* progress = nullptr);

}  // namespace lambent
