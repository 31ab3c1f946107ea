// Follows: radiosity ("Jacobi, Gauss-Seidel, Southwell", "Krylov subspace methods"); Saad and Schultz, "GMRES", 1986;
// Cohen, Chen, Wallace and Greenberg, "A progressive refinement approach", 1988 (Southwell's relaxation as shooting).
#include <lambent/bake/solve.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/bake/kernels.h>

#include <array>
#include <bit>

namespace lambent {
namespace {

constexpr size_t rows_a_piece = 1024;
constexpr size_t phases = 16;
constexpr int restart = 8;

// Sums of a b over all rows, lane by lane, in a fixed order.
std::vector<double> dots(const float* a, const float* b, size_t n, size_t width) {
  const size_t pieces = (n + rows_a_piece - 1) / rows_a_piece;
  std::vector<double> partial(pieces * width, 0.0), sum(width, 0.0);
  parallel_for(n, rows_a_piece, [&](size_t begin, size_t end) {
    double* s = partial.data() + begin / rows_a_piece * width;
    for (size_t r = begin; r < end; ++r)
      for (size_t k = 0; k < width; ++k) s[k] += double(a[r * width + k]) * double(b[r * width + k]);
  });
  for (size_t p = 0; p < pieces; ++p)
    for (size_t k = 0; k < width; ++k) sum[k] += partial[p * width + k];
  return sum;
}

template <class F>
void each_row(size_t n, F f) {
  parallel_for(n, rows_a_piece, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r) f(r);
  });
}

// Greatest sqrt(squares / norms) over the lanes that are not zero.
double greatest_ratio(const std::vector<double>& squares, const std::vector<double>& norms) {
  double worst = 0;
  for (size_t k = 0; k < norms.size(); ++k)
    if (norms[k] > 0) worst = std::max(worst, std::sqrt(squares[k] / norms[k]));
  return worst;
}

struct Problem {
  const GatherOperator& op;
  const float* e;
  size_t width;
  const SolveOptions& options;
  SolveReport& report;
  ProgressStage& stage;
  std::vector<double> norms = dots(e, e, op.rows(), width);

  size_t n() const { return op.rows(); }
  AlignedVector<float> copy_of_e() const { return AlignedVector<float>(e, e + n() * width); }
  bool done(double applications, double residual) {
    report.steps.push_back({applications, residual});
    stage.advance();
    return report.converged = residual <= options.tolerance;
  }
  // next = e + A x
  void step(const float* x, float* next) const {
    op.apply(x, width, next);
    each_row(n(), [&](size_t r) {
      for (size_t k = 0; k < width; ++k) next[r * width + k] += e[r * width + k];
    });
  }
  // |next - x| / |e|
  double change(const float* x, float* next) const {
    AlignedVector<float> d(n() * width);
    each_row(n(), [&](size_t r) {
      for (size_t k = r * width; k < (r + 1) * width; ++k) d[k] = next[k] - x[k];
    });
    return greatest_ratio(dots(d.data(), d.data(), n(), width), norms);
  }

  AlignedVector<float> jacobi() {
    AlignedVector<float> x = copy_of_e(), next(x.size());
    for (int k = 1; k <= options.most && !stage.cancelled(); ++k) {
      step(x.data(), next.data());
      const double residual = change(x.data(), next.data());  // of x; next is better still
      std::swap(x, next);
      if (done(k, residual)) break;
    }
    return x;
  }

  AlignedVector<float> gauss_seidel() {
    AlignedVector<float> x = copy_of_e();
    const size_t blocks = op.blocks();
    std::vector<double> squares(blocks * width);
    for (int k = 1; k <= options.most && !stage.cancelled(); ++k) {
      for (size_t phase = 0; phase < phases; ++phase) {
        const size_t count = blocks > phase ? (blocks - phase - 1) / phases + 1 : 0;
        // All blocks of a phase read x before any of them writes it.
        AlignedVector<float> fresh(count * gather_block * width);
        parallel_for(count, 1, [&](size_t begin, size_t end) {
          for (size_t i = begin; i < end; ++i)
            op.apply_block(phase + i * phases, x.data(), width, fresh.data() + i * gather_block * width);
        });
        parallel_for(count, 1, [&](size_t begin, size_t end) {
          for (size_t i = begin; i < end; ++i) {
            const size_t b = phase + i * phases, first = b * gather_block;
            double* s = squares.data() + b * width;
            std::fill(s, s + width, 0.0);
            for (size_t r = first; r < std::min(first + gather_block, n()); ++r) {
              if (op.buried()[r]) continue;
              float* row = x.data() + r * width;
              const float* y = fresh.data() + (i * gather_block + r - first) * width;
              for (size_t c = 0; c < width; ++c) {
                const float value = e[r * width + c] + y[c];
                s[c] += double(value - row[c]) * double(value - row[c]);
                row[c] = value;
              }
            }
          }
        });
      }
      op.fill(x.data(), width);
      std::vector<double> sum(width, 0.0);
      for (size_t b = 0; b < blocks; ++b)
        for (size_t c = 0; c < width; ++c) sum[c] += squares[b * width + c];
      if (done(k, greatest_ratio(sum, norms))) break;
    }
    return x;
  }

  AlignedVector<float> southwell();
  AlignedVector<float> gmres();
};

// Buckets of receivers by the binary exponent of their residual, so that one of the greatest is found at once; entries
// whose residual has changed since are told by their bucket.
class ResidualQueue {
 public:
  explicit ResidualQueue(size_t n) : bucket_(n, 0) {}
  void update(uint32_t i, float magnitude) {
    const uint8_t b = uint8_t(std::bit_cast<uint32_t>(magnitude) >> 23);
    if (b > bucket_[i]) bucket_[i] = b, buckets_[b].push_back(i), top_ = std::max(top_, b);
  }
  // A receiver whose residual is within a factor of two of the greatest; none when all are zero.
  uint32_t pop() {
    while (true) {
      while (top_ > 0 && buckets_[top_].empty()) --top_;
      if (top_ == 0) return none;
      const uint32_t i = buckets_[top_].back();
      buckets_[top_].pop_back();
      if (bucket_[i] != top_) continue;
      bucket_[i] = 0;
      return i;
    }
  }

 private:
  std::array<std::vector<uint32_t>, 256> buckets_;
  std::vector<uint8_t> bucket_;
  uint8_t top_ = 0;
};

AlignedVector<float> Problem::southwell() {
  const GatherOperator::Push push = op.transposed();
  const size_t channels = size_t(push.channels), entries = std::max<size_t>(push.row.size(), 1);
  AlignedVector<float> x(n() * width, 0.0f), r = copy_of_e();
  for (size_t i = 0; i < n(); ++i)  // their equations are x_i = mean of neighbours
    if (op.buried()[i]) std::fill(r.begin() + ptrdiff_t(i * width), r.begin() + ptrdiff_t((i + 1) * width), 0.0f);
  auto magnitude = [&](size_t i) {
    float sum = 0;
    for (size_t k = 0; k < width; ++k) sum += std::abs(r[i * width + k]);
    return sum;
  };
  ResidualQueue queue(n());
  for (uint32_t i = 0; i < n(); ++i) queue.update(i, magnitude(i));
  std::vector<float> delta(width);
  size_t touched = 0, next_look = 0;
  while (touched <= size_t(options.most) * entries) {
    const uint32_t j = queue.pop();
    if (j == none) break;
    float* own = r.data() + size_t(j) * width;
    for (size_t k = 0; k < width; ++k) delta[k] = own[k], x[size_t(j) * width + k] += own[k], own[k] = 0;
    for (size_t at = push.first[j]; at < push.first[j + 1]; ++at) {
      const uint32_t i = push.row[at];
      float* row = r.data() + size_t(i) * width;
      const float* w = push.weight.data() + at * channels;
      if (channels == 1)
        for (size_t k = 0; k < width; ++k) row[k] += w[0] * delta[k];
      else
        for (size_t k = 0; k < width; ++k) row[k] += w[k % 3] * delta[k];
      queue.update(i, magnitude(i));
    }
    touched += push.first[j + 1] - push.first[j] + 1;
    if (touched >= next_look) {  // a quarter of an application between looks
      next_look = touched + entries / 4;
      if (stage.cancelled() ||
          done(double(touched) / double(entries), greatest_ratio(dots(r.data(), r.data(), n(), width), norms)))
        break;
    }
  }
  if (!report.converged)
    done(double(touched) / double(entries), greatest_ratio(dots(r.data(), r.data(), n(), width), norms));
  op.fill(x.data(), width);
  return x;
}

// Each lane is a system of its own over the same A; they share its applications. (I - A) x = e from x = 0.
AlignedVector<float> Problem::gmres() {
  AlignedVector<float> x(n() * width, 0.0f), r = copy_of_e(), w(x.size());
  int applications = 0;
  while (applications < options.most && !stage.cancelled()) {
    std::vector<AlignedVector<float>> V;
    std::vector<double> beta = dots(r.data(), r.data(), n(), width);
    for (double& b : beta) b = std::sqrt(b);
    auto append_scaled = [&](const AlignedVector<float>& v, const std::vector<double>& length) {
      V.emplace_back(v.size());
      std::vector<float> inverse(width);
      for (size_t k = 0; k < width; ++k) inverse[k] = length[k] > 0 ? float(1 / length[k]) : 0.0f;
      each_row(n(), [&](size_t i) {
        for (size_t k = 0; k < width; ++k) V.back()[i * width + k] = v[i * width + k] * inverse[k];
      });
    };
    append_scaled(r, beta);
    // R of the rotated Hessenberg matrices, right-hand sides g, rotations; all lane by lane.
    std::vector<std::array<std::vector<double>, restart + 1>> R;
    std::array<std::vector<double>, restart + 1> g;
    g.fill(std::vector<double>(width, 0.0)), g[0] = beta;
    std::vector<std::vector<double>> cosine, sine;
    int m = 0;
    bool finished = false;
    while (m < restart && applications < options.most && !finished && !stage.cancelled()) {
      const AlignedVector<float>& v = V.back();
      op.apply(v.data(), width, w.data());
      ++applications;
      each_row(n(), [&](size_t i) {
        for (size_t k = i * width; k < (i + 1) * width; ++k) w[k] = v[k] - w[k];
      });
      R.emplace_back();
      auto& h = R.back();
      for (int j = 0; j <= m; ++j) {  // modified Gram-Schmidt
        h[size_t(j)] = dots(w.data(), V[size_t(j)].data(), n(), width);
        std::vector<float> share(h[size_t(j)].begin(), h[size_t(j)].end());
        each_row(n(), [&](size_t i) {
          for (size_t k = 0; k < width; ++k) w[i * width + k] -= share[k] * V[size_t(j)][i * width + k];
        });
      }
      std::vector<double> length = dots(w.data(), w.data(), n(), width);
      for (double& l : length) l = std::sqrt(l);
      append_scaled(w, length);
      cosine.emplace_back(width, 1.0), sine.emplace_back(width, 0.0);
      std::vector<double> squares(width, 0.0);
      for (size_t k = 0; k < width; ++k) {
        for (int j = 0; j < m; ++j) {
          const double a = h[size_t(j)][k], b = h[size_t(j) + 1][k], c = cosine[size_t(j)][k], s = sine[size_t(j)][k];
          h[size_t(j)][k] = c * a + s * b, h[size_t(j) + 1][k] = -s * a + c * b;
        }
        const double a = h[size_t(m)][k], b = length[k], d = std::hypot(a, b);
        if (d > 0) cosine[size_t(m)][k] = a / d, sine[size_t(m)][k] = b / d;
        h[size_t(m)][k] = d;
        const double top = g[size_t(m)][k];
        g[size_t(m)][k] = cosine[size_t(m)][k] * top, g[size_t(m) + 1][k] = -sine[size_t(m)][k] * top;
        squares[k] = g[size_t(m) + 1][k] * g[size_t(m) + 1][k];
      }
      ++m;
      finished = done(applications, greatest_ratio(squares, norms));
    }
    // y = R^-1 g, x += V y
    std::vector<std::vector<float>> y(R.size(), std::vector<float>(width));
    for (size_t k = 0; k < width; ++k)
      for (int i = m - 1; i >= 0; --i) {
        double sum = g[size_t(i)][k];
        for (int j = i + 1; j < m; ++j) sum -= R[size_t(j)][size_t(i)][k] * double(y[size_t(j)][k]);
        const double d = R[size_t(i)][size_t(i)][k];
        y[size_t(i)][k] = d > 0 ? float(sum / d) : 0.0f;
      }
    for (int j = 0; j < m; ++j)
      each_row(n(), [&](size_t i) {
        for (size_t k = 0; k < width; ++k) x[i * width + k] += y[size_t(j)][k] * V[size_t(j)][i * width + k];
      });
    if (finished || applications >= options.most) break;
    step(x.data(), w.data());  // a fresh residual for the next cycle
    ++applications;
    each_row(n(), [&](size_t i) {
      for (size_t k = i * width; k < (i + 1) * width; ++k) r[k] = w[k] - x[k];
    });
  }
  return x;
}

}  // namespace

Result<AlignedVector<float>> solve(const GatherOperator& op, const float* e, size_t width, const SolveOptions& options,
                                   SolveReport* report, Progress* progress) {
  LAMBENT_CHECK(width % lane_multiple == 0 && options.most >= 1);
  if (!(options.tolerance > 0)) return Error{"tolerance", "must be positive"};
  SolveReport unwanted;
  SolveReport& r = report ? *report : unwanted;
  r = {};
  ProgressStage stage(progress, "solving", size_t(options.most));
  Problem problem{op, e, width, options, r, stage};
  AlignedVector<float> x = options.solver == Solver::jacobi       ? problem.jacobi()
                         : options.solver == Solver::gauss_seidel ? problem.gauss_seidel()
                         : options.solver == Solver::southwell    ? problem.southwell()
                                                                  : problem.gmres();
  if (stage.cancelled()) return Error{"", "cancelled"};
  return x;
}

Result<AlignedVector<float>> bounce(const GatherOperator& op, const float* e, size_t width, int bounces,
                                    Progress* progress) {
  AlignedVector<float> x(e, e + op.rows() * width), next(x.size());
  ProgressStage stage(progress, "bounces", size_t(bounces));
  for (int k = 0; k < bounces; ++k) {
    if (stage.cancelled()) return Error{"", "cancelled"};
    op.apply(x.data(), width, next.data());
    each_row(op.rows(), [&](size_t r) {
      for (size_t i = r * width; i < (r + 1) * width; ++i) next[i] += e[i];
    });
    std::swap(x, next);
    stage.advance();
  }
  return x;
}

}  // namespace lambent
