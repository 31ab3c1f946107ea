// Follows: radiosity ("Jacobi, Gauss-Seidel, Southwell", "Krylov subspace methods"); Saad and Schultz, "GMRES", 1986;
// Cohen, Chen, Wallace and Greenberg, "A progressive refinement approach", 1988 (Southwell's relaxation as shooting).
#include <lambent/bake/asked_rows.h>
#include <lambent/bake/kept_operator.h>
#include <lambent/bake/kernels.h>
#include <lambent/bake/solve.h>
#include <lambent/core/check.h>
#include <lambent/core/parallel.h>
#include <lambent/core/pool.h>

#include <array>
#include <bit>

namespace lambent {
namespace {

constexpr size_t phases = 16;
constexpr int restart = 8;
constexpr uint32_t no_row = UINT32_MAX;
constexpr size_t solve_units = 1000;  // of progress

// Sums of a b over all rows, lane by lane, in a fixed order.
std::vector<double> dots(const LinearOperator& op, const float* a, const float* b, size_t width) {
  const size_t pieces = (op.rows() + gather_block - 1) / gather_block;
  const Shares shares = op.shares();
  std::vector<double> partial(pieces * width, 0.0), sum(width, 0.0);
  shares.for_own([&](size_t begin, size_t end) {
    double* s = partial.data() + begin / gather_block * width;
    for (size_t r = begin; r < end; ++r)
      for (size_t k = 0; k < width; ++k) s[k] += double(a[r * width + k]) * double(b[r * width + k]);
  });
  shares.gather_pieces(partial.data(), width);
  for (size_t p = 0; p < pieces; ++p)
    for (size_t k = 0; k < width; ++k) sum[k] += partial[p * width + k];
  return sum;
}

// Of this rank's rows.
template <class F>
void each_row(const LinearOperator& op, F f) {
  op.shares().for_own([&](size_t begin, size_t end) {
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

// One step, all rows of e + A x: `next` keeps them, `last` takes them, or both. Without e, A x alone.
struct Step {
  const LinearOperator& op;
  const Source* e;
  size_t width;
  const Progress* progress;
  ProgressStage* stage = nullptr;  // advanced by rows
  ErrorSums* errors = nullptr;
  const TakeRows* last = nullptr;

  // y = rows [first, first + count) of e + A x, a piece of the operator's.
  void set_rows(size_t first, size_t count, const float* x, float* y, float* half = nullptr) const {
    for (size_t r = first; r < first + count; ++r)
      if (e) e->set(r, y + (r - first) * width);
      else std::fill_n(y + (r - first) * width, width, 0.0f);
    op.add_rows(first, count, x, width, y, half);
  }

  void rows(size_t first, size_t count, const float* x, float* y, float* half, float* next) const {
    const size_t checked = (first + check_every - 1) / check_every * check_every;
    const bool halves = errors && checked < first + count;
    for (size_t r = checked; halves && r < first + count; r += check_every)
      e->set_half(r, half + (r - checked) / check_every * width);
    set_rows(first, count, x, y, halves ? half : nullptr);
    for (size_t r = checked; halves && r < first + count; r += check_every)
      if (!op.is_filled(r)) errors->add(r, half + (r - checked) / check_every * width, y + (r - first) * width, width);
    if (last && *last) (*last)(first, count, y);
    if (next) op.keep(first, count, y, width, next);
  }

  void run(const float* x, float* next) const {
    run_own(x, next);
    if (next) op.fill(next, width), op.fetch(next, width);
  }
  void run_own(const float* x, float* next) const {
    Pool<AlignedVector<float>> buffers([] { return std::make_unique<AlignedVector<float>>(); });
    op.shares().for_own([&](size_t begin, size_t end) {
      const size_t most = std::min(op.piece(), end - begin);
      const auto y = buffers.borrow(), half = buffers.borrow();
      y->resize(most * width), half->resize(errors ? checked_count(most) * width : 0);
      for (size_t first = begin; first < end; first += most) {
        if (is_cancelled(progress)) return;
        rows(first, std::min(most, end - first), x, y->data(), half->data(), next);
      }
      if (stage) stage->advance(end - begin);
    });
  }
};

// x = F e
void set_first(const LinearOperator& op, const Source& e, size_t width, float* x) {
  op.shares().for_own([&](size_t begin, size_t end) {
    AlignedVector<float> y(width);
    for (size_t r = begin; r < end; ++r) e.set(r, y.data()), op.keep(r, 1, y.data(), width, x);
  });
  op.fill(x, width), op.fetch(x, width);
}
AlignedVector<float> first_iterate(const LinearOperator& op, const Source& e, size_t width) {
  AlignedVector<float> x(op.size(width), 0.0f);
  set_first(op, e, width, x.data());
  return x;
}

struct Problem {
  const LinearOperator& op;
  const float* e;
  size_t width;
  const SolveOptions& options;
  SolveReport& report;
  Progress* progress;
  ProgressStage& stage;
  Source source = source_of(e, width);
  size_t shown = 0;  // of the stage's solve_units
  std::vector<double> norms = dots(op, e, e, width);

  size_t n() const { return op.rows(); }
  AlignedVector<float> copy_of_e() const { return AlignedVector<float>(e, e + n() * width); }
  AlignedVector<float> fetched_e() const {
    AlignedVector<float> x = copy_of_e();
    op.fetch(x.data(), width);
    return x;
  }
  static bool is_own(const Shares& shares, size_t row) { return shares.owner(row) == shares.ranks().rank(); }
  bool goes_on() const { return none_cancelled(progress); }
  // Each step of most solvers takes about the same factor off the residual.
  bool done(double applications, double residual) {
    report.steps.push_back({applications, residual});
    const double share = std::max(residual > 0 ? std::log(residual) / std::log(std::min(options.tolerance, 0.5)) : 1.0,
                                  applications / options.most);
    const size_t reached = size_t(double(solve_units) * std::clamp(share, 0.0, 1.0));
    if (reached > shown) stage.advance(reached - shown), shown = reached;
    return report.converged = residual <= options.tolerance;
  }
  void step(const float* x, float* next) const { Step{op, &source, width, progress}.run(x, next); }
  // |next - x| / |e|
  double change(const float* x, float* next) const {
    AlignedVector<float> d(n() * width);
    each_row(op, [&](size_t r) {
      for (size_t k = r * width; k < (r + 1) * width; ++k) d[k] = next[k] - x[k];
    });
    return greatest_ratio(dots(op, d.data(), d.data(), width), norms);
  }

  AlignedVector<float> jacobi() {
    AlignedVector<float> x = fetched_e(), next(x.size());
    for (int k = 1; k <= options.most && goes_on(); ++k) {
      step(x.data(), next.data());
      const double residual = change(x.data(), next.data());  // of x; next is better still
      std::swap(x, next);
      if (done(k, residual)) break;
    }
    return x;
  }

  AlignedVector<float> gauss_seidel() {
    AlignedVector<float> x = fetched_e();
    const Shares shares = op.shares();
    const size_t blocks = (n() + gather_block - 1) / gather_block;
    std::vector<double> squares(blocks * width);
    for (int k = 1; k <= options.most && goes_on(); ++k) {
      for (size_t phase = 0; phase < phases; ++phase) {
        const size_t count = blocks > phase ? (blocks - phase - 1) / phases + 1 : 0;
        // All blocks of a phase read x before any of them writes it.
        AlignedVector<float> fresh(count * gather_block * width);
        const Step next{op, &source, width, progress};
        parallel_for(count * gather_block, op.piece(), [&](size_t begin, size_t) {
          const size_t first = (phase + begin / gather_block * phases) * gather_block + begin % gather_block;
          if (first >= n() || stage.cancelled() || !is_own(shares, first)) return;
          next.set_rows(first, std::min(op.piece(), n() - first), x.data(), fresh.data() + begin * width);
        });
        if (!goes_on()) return x;
        parallel_for(count, 1, [&](size_t begin, size_t end) {
          for (size_t i = begin; i < end; ++i) {
            const size_t b = phase + i * phases, first = b * gather_block;
            if (!is_own(shares, first)) continue;
            double* s = squares.data() + b * width;
            std::fill(s, s + width, 0.0);
            for (size_t r = first; r < std::min(first + gather_block, n()); ++r) {
              if (op.is_filled(r)) continue;
              float* row = x.data() + r * width;
              const float* y = fresh.data() + (i * gather_block + r - first) * width;
              for (size_t c = 0; c < width; ++c) {
                s[c] += double(y[c] - row[c]) * double(y[c] - row[c]);
                row[c] = y[c];
              }
            }
          }
        });
        if (phase + 1 < phases) op.fetch(x.data(), width);
      }
      op.fill(x.data(), width), op.fetch(x.data(), width);
      shares.gather_pieces(squares.data(), width);
      std::vector<double> sum(width, 0.0);
      for (size_t b = 0; b < blocks; ++b)
        for (size_t c = 0; c < width; ++c) sum[c] += squares[b * width + c];
      if (done(k, greatest_ratio(sum, norms))) break;
    }
    return x;
  }

  AlignedVector<float> southwell(const TransposedRows& push);
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
  // A row whose residual is within a factor of two of the greatest; no_row when all are zero.
  uint32_t pop() {
    while (true) {
      while (top_ > 0 && buckets_[top_].empty()) --top_;
      if (top_ == 0) return no_row;
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

AlignedVector<float> Problem::southwell(const TransposedRows& push) {
  const size_t channels = size_t(push.channels), entries = std::max<size_t>(push.row.size(), 1);
  AlignedVector<float> x(n() * width, 0.0f), r = copy_of_e();
  for (size_t i = 0; i < n(); ++i)  // their equations are x_i = mean of neighbours
    if (op.is_filled(i)) std::fill(r.begin() + ptrdiff_t(i * width), r.begin() + ptrdiff_t((i + 1) * width), 0.0f);
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
    if (j == no_row) break;
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
          done(double(touched) / double(entries), greatest_ratio(dots(op, r.data(), r.data(), width), norms)))
        break;
    }
  }
  if (!report.converged)
    done(double(touched) / double(entries), greatest_ratio(dots(op, r.data(), r.data(), width), norms));
  op.fill(x.data(), width);
  return x;
}

// A Krylov space of each lane, of its own but over shared applications of A: an orthonormal basis V, the rotated
// Hessenberg matrices R and right-hand sides g, lane by lane.
struct Krylov {
  using Lanes = std::vector<double>;
  const LinearOperator& op;
  size_t width;
  std::vector<AlignedVector<float>> V{};
  std::vector<std::array<Lanes, restart + 1>> R{};
  std::array<Lanes, restart + 1> g{};
  std::vector<Lanes> cosine{}, sine{};

  // V's next vector: v over its length.
  Lanes append(const AlignedVector<float>& v) {
    Lanes length = dots(op, v.data(), v.data(), width);
    for (double& l : length) l = std::sqrt(l);
    std::vector<float> inverse(width);
    for (size_t k = 0; k < width; ++k) inverse[k] = length[k] > 0 ? float(1 / length[k]) : 0.0f;
    V.emplace_back(v.size());
    each_row(op, [&](size_t i) {
      for (size_t k = 0; k < width; ++k) V.back()[i * width + k] = v[i * width + k] * inverse[k];
    });
    return length;
  }
  void begin(const AlignedVector<float>& residual) { g.fill(Lanes(width, 0.0)), g[0] = append(residual); }

  // One dimension more, by w, which is overwritten; squares of the least residuals.
  Lanes extend(AlignedVector<float>& w) {
    const size_t m = R.size();
    auto& h = R.emplace_back();
    for (size_t j = 0; j <= m; ++j) {  // modified Gram-Schmidt
      h[j] = dots(op, w.data(), V[j].data(), width);
      const std::vector<float> share(h[j].begin(), h[j].end());
      each_row(op, [&](size_t i) {
        for (size_t k = 0; k < width; ++k) w[i * width + k] -= share[k] * V[j][i * width + k];
      });
    }
    const Lanes length = append(w);
    cosine.emplace_back(width, 1.0), sine.emplace_back(width, 0.0);
    Lanes squares(width, 0.0);
    for (size_t k = 0; k < width; ++k) {
      for (size_t j = 0; j < m; ++j) {
        const double a = h[j][k], b = h[j + 1][k], c = cosine[j][k], s = sine[j][k];
        h[j][k] = c * a + s * b, h[j + 1][k] = -s * a + c * b;
      }
      const double a = h[m][k], b = length[k], d = std::hypot(a, b);
      if (d > 0) cosine[m][k] = a / d, sine[m][k] = b / d;
      h[m][k] = d;
      const double top = g[m][k];
      g[m][k] = cosine[m][k] * top, g[m + 1][k] = -sine[m][k] * top;
      squares[k] = g[m + 1][k] * g[m + 1][k];
    }
    return squares;
  }

  // x += V y, y = R^-1 g
  void add_to(AlignedVector<float>& x) const {
    const size_t m = R.size();
    std::vector<std::vector<float>> y(m, std::vector<float>(width));
    for (size_t k = 0; k < width; ++k)
      for (size_t i = m; i-- > 0;) {
        double sum = g[i][k];
        for (size_t j = i + 1; j < m; ++j) sum -= R[j][i][k] * double(y[j][k]);
        const double d = R[i][i][k];
        y[i][k] = d > 0 ? float(sum / d) : 0.0f;
      }
    for (size_t j = 0; j < m; ++j)
      each_row(op, [&](size_t i) {
        for (size_t k = 0; k < width; ++k) x[i * width + k] += y[j][k] * V[j][i * width + k];
      });
  }
};

// (I - A) x = e from x = 0.
AlignedVector<float> Problem::gmres() {
  AlignedVector<float> x(n() * width, 0.0f), r = copy_of_e(), w(x.size());
  int applications = 0;
  while (applications < options.most && goes_on()) {
    Krylov space{op, width};
    space.begin(r);
    bool finished = false;
    for (int m = 0; m < restart && applications < options.most && !finished && goes_on(); ++m) {
      AlignedVector<float>& v = space.V.back();
      op.fetch(v.data(), width);
      op.apply(v.data(), width, w.data(), progress);
      ++applications;
      each_row(op, [&](size_t i) {
        for (size_t k = i * width; k < (i + 1) * width; ++k) w[k] = v[k] - w[k];
      });
      finished = done(applications, greatest_ratio(space.extend(w), norms));
    }
    space.add_to(x);
    if (finished || applications >= options.most) break;
    op.fetch(x.data(), width);
    step(x.data(), w.data());  // a fresh residual for the next cycle
    ++applications;
    each_row(op, [&](size_t i) {
      for (size_t k = i * width; k < (i + 1) * width; ++k) r[k] = w[k] - x[k];
    });
  }
  return x;
}

}  // namespace

Source source_of(const float* e, size_t width) {
  return {[=](size_t row, float* y) { std::copy_n(e + row * width, width, y); }};
}

void ErrorSums::add(size_t row, const float* half, const float* full, size_t count) {
  Sum& sum = sums_[row / gather_block];
  for (size_t i = 0; i < count; ++i) {
    sum.difference += double(half[i] - full[i]) * (half[i] - full[i]);
    sum.total += double(full[i]) * full[i];
  }
}

double ErrorSums::relative() const {
  Sum all;
  for (const Sum& s : sums_) all.difference += s.difference, all.total += s.total;
  return all.total > 0 ? std::sqrt(all.difference / all.total) : 0.0;
}

Result<AlignedVector<float>> solve(const LinearOperator& op, const float* e, size_t width, const SolveOptions& options,
                                   SolveReport* report, Progress* progress) {
  LAMBENT_CHECK(width % lane_multiple == 0 && options.most >= 1 && op.size(width) == op.rows() * width);
  if (!(options.tolerance > 0)) return Error{"tolerance", "must be positive"};
  SolveReport unwanted;
  SolveReport& r = report ? *report : unwanted;
  r = {};
  ProgressStage stage(progress, "solving", solve_units);
  const KeptOperator kept(op, progress, "solving", 0);
  Problem problem{kept, e, width, options, r, progress, stage};
  AlignedVector<float> x;
  switch (options.solver) {
    case Solver::jacobi: x = problem.jacobi(); break;
    case Solver::gauss_seidel: x = problem.gauss_seidel(); break;
    case Solver::gmres: x = problem.gmres(); break;
    case Solver::southwell:
      auto transposed = kept.transposed();
      if (!transposed) return Error{"solver", "southwell wants rows that are known by their entries"};
      x = problem.southwell(*transposed);
  }
  if (!none_cancelled(progress)) return Error{"", "cancelled"};
  return x;
}

Result<Bounced> bounce(const LinearOperator& op, const Source& e, size_t width, int bounces, Progress* progress,
                       const TakeRows& last) {
  Bounced out{first_iterate(op, e, width)};
  const KeptOperator kept(op, progress, "bounces", bounces);
  AlignedVector<float> next;
  ErrorSums errors(op.rows());
  for (int k = 1; k <= bounces; ++k) {
    ProgressStage stage(progress, "bounce " + std::to_string(k), op.shares().own());
    Step step{kept, &e, width, progress, &stage};
    if (k == bounces) step.errors = e.set_half ? &errors : nullptr, step.last = &last;
    const bool kept = k < bounces || !last;
    if (kept) next.resize(out.x.size());
    step.run(out.x.data(), kept ? next.data() : nullptr);
    if (!none_cancelled(progress)) return Error{"", "cancelled"};
    if (kept) std::swap(out.x, next);
  }
  errors.gather(op.shares());
  if (e.set_half && bounces > 0) out.error = errors.relative();
  return out;
}

Result<ZeroPages*> bounce_in(ZeroPages& x, ZeroPages& next, const LinearOperator& op, const Source& e, size_t width,
                             int bounces, Progress* progress, const TakeRows& last) {
  ZeroPages *now = &x, *then = &next;
  set_first(op, e, width, now->data());
  const KeptOperator kept(op, progress, "bounces", bounces);
  for (int k = 1; k <= bounces; ++k) {
    ProgressStage stage(progress, "bounce " + std::to_string(k), op.shares().own());
    Step step{kept, &e, width, progress, &stage};
    if (k == bounces) step.last = &last;
    const bool goes_on = k < bounces || !last;
    step.run_own(now->data(), goes_on ? then->data() : nullptr);
    if (!none_cancelled(progress)) return Error{"", "cancelled"};
    if (!goes_on) break;
    if (op.size(width) == op.rows() * width) forget_others(op.shares(), *now, width);
    op.fill(then->data(), width), op.fetch(then->data(), width);
    std::swap(now, then);
  }
  return now;
}

Result<void> bounce_terms(const LinearOperator& op, const Source& e, size_t width, int bounces, Progress* progress,
                          const std::function<Result<void>(int k, AlignedVector<float>& x)>& take,
                          const std::function<TakeRows(int k)>& taker_of) {
  AlignedVector<float> x = first_iterate(op, e, width), next(x.size());
  if (taker_of)
    op.shares().for_own([&, take_row = taker_of(0)](size_t begin, size_t end) {
      AlignedVector<float> y(width);
      for (size_t r = begin; r < end; ++r) e.set(r, y.data()), take_row(r, 1, y.data());
    });
  const KeptOperator kept(op, progress, "terms", bounces);
  for (int k = 0;; ++k) {
    if (auto ok = take(k, x); !ok || k == bounces) return ok;
    ProgressStage stage(progress, "term " + std::to_string(k + 1), op.shares().own());
    const TakeRows take_rows = taker_of ? taker_of(k + 1) : TakeRows();
    Step step{kept, nullptr, width, progress, &stage};
    step.last = &take_rows;
    step.run(x.data(), next.data());
    if (!none_cancelled(progress)) return Error{"", "cancelled"};
    std::swap(x, next);
  }
}

}  // namespace lambent
