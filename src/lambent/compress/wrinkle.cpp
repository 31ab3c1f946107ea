// Follows: local-deformable-prt, section 4.2.
#include <lambent/basis/quadrature.h>
#include <lambent/basis/zonal.h>
#include <lambent/compress/wrinkle.h>
#include <lambent/compress/zonal_kernel.h>
#include <lambent/core/parallel.h>

#include <optional>

namespace lambent {
namespace {

constexpr double pi_d = std::numbers::pi;
constexpr int angles = 256;   // rays in the cross-section for bounces
constexpr int profile = 512;  // pieces of the groove's outline
constexpr double ridge =
    1e-4;  // shallow grooves need one lobe: keeps the others from growing against each other, and entries alike

double groove_height(double x, double depth) {
  return std::abs(x) < 0.5 ? -depth * std::cos(pi_d * x) * std::cos(pi_d * x) : 0;
}

// Angle of the direction (cos, sin) to the right of which, or left, the groove hides the sky, from (x, h(x)): in
// (-pi/2, pi/2).
double horizon(double x, double depth, double side) {
  double best = 0;  // the plane beyond
  const double h = groove_height(x, depth), reach = 0.5 - side * x;
  for (int i = 1; i <= profile; ++i) {
    const double step = reach * i / profile;
    best = std::max(best, std::atan2(groove_height(x + side * step, depth) - h, step));
  }
  return best;
}

// Where a ray at angle psi from (x, h(x)) meets the groove, by marching and bisection; NaN: nowhere.
double meet(double x, double depth, double psi) {
  const double h = groove_height(x, depth), side = std::cos(psi) < 0 ? -1 : 1, slope = std::tan(psi),
               reach = 0.5 - side * x;
  auto above = [&](double step) { return h + side * slope * step - groove_height(x + side * step, depth); };
  double last = 1e-6 * reach;
  for (int i = 1; i <= profile; ++i) {
    const double step = reach * i / profile;
    if (above(step) < -1e-12) {
      double low = last, high = step;
      for (int k = 0; k < 40; ++k) {
        const double middle = 0.5 * (low + high);
        (above(middle) < 0 ? high : low) = middle;
      }
      return x + side * 0.5 * (low + high);
    }
    last = step;
  }
  return NAN;
}

// All entries of the table at once, so that what lies between them is right too (section 4.2): the squared error at
// places and depths twice as fine, of lobes interpolated bilinearly, as a function of all axes and coefficients of the
// table, [entry][lobe][3 + bands].
class TableFit {
 public:
  // targets: [depth][place][order^2] on the finer grid.
  TableFit(int order, int first_band, size_t lobes, size_t n, std::vector<float> targets)
      : order_(order),
        first_(first_band),
        bands_(order - first_band),
        lobes_(lobes),
        n_(n),
        fine_(2 * n - 1),
        targets_(std::move(targets)) {}
  size_t lobe_values() const { return size_t(3 + bands_); }
  size_t entry_values() const { return lobes_ * lobe_values(); }
  size_t count() const { return n_ * n_ * entry_values(); }

  // psi, and its gradient by eq. 19-21.
  double operator()(const std::vector<double>& p, std::vector<double>& gradient) const {
    gradient.assign(count(), 0.0);
    std::vector<double> errors(fine_), own(fine_ * fine_ * entry_values());
    parallel_for(fine_, 1, [&](size_t begin, size_t end) {
      for (size_t d = begin; d < end; ++d)
        for (size_t x = 0; x < fine_; ++x) errors[d] += sample(p, d, x, &own[(d * fine_ + x) * entry_values()]);
    });
    double psi = 0;
    for (double e : errors) psi += e;
    for (size_t d = 0; d < fine_; ++d)
      for (size_t x = 0; x < fine_; ++x)
        corners(d, x, [&](size_t entry, double weight) {
          for (size_t k = 0; k < entry_values(); ++k)
            gradient[entry * entry_values() + k] += weight * own[(d * fine_ + x) * entry_values() + k];
        });
    for (size_t i = 0; i < count(); ++i)
      if (i % lobe_values() >= 3) psi += ridge_between * p[i] * p[i], gradient[i] += 2 * ridge_between * p[i];
    return psi;
  }

 private:
  static constexpr double ridge_between = 1e-5;

  template <class F>
  void corners(size_t d, size_t x, F add) const {
    for (size_t b = d / 2; b <= (d + 1) / 2; ++b)
      for (size_t a = x / 2; a <= (x + 1) / 2; ++a) add(b * n_ + a, (d % 2 ? 0.5 : 1.0) * (x % 2 ? 0.5 : 1.0));
  }

  // The squared error at one place of the finer grid, and its derivatives by the numbers there.
  double sample(const std::vector<double>& p, size_t d, size_t x, double* out) const {
    const size_t C = size_t(sh_count(order_)), from = size_t(sh_count(first_));
    std::vector<double> at(entry_values()), residual(C), y(lobes_ * C), step(C);
    corners(d, x, [&](size_t entry, double weight) {
      for (size_t k = 0; k < at.size(); ++k) at[k] += weight * p[entry * entry_values() + k];
    });
    const float* t = &targets_[(d * fine_ + x) * C];
    for (size_t k = from; k < C; ++k) residual[k] = -double(t[k]);
    std::vector<Vec3d> axes(lobes_);
    for (size_t i = 0; i < lobes_; ++i) {
      const double* v = &at[i * lobe_values()];
      axes[i] = normalize(Vec3d(v[0], v[1], v[2]));
      evaluate_sh(order_, axes[i], {&y[i * C], C});
      for (int l = first_; l < order_; ++l)
        for (size_t k = size_t(l * l); k < size_t((l + 1) * (l + 1)); ++k)
          residual[k] += v[3 + l - first_] * y[i * C + k];
    }
    double psi = 0;
    for (size_t k = from; k < C; ++k) psi += residual[k] * residual[k];
    for (size_t i = 0; i < lobes_; ++i) {
      const double* v = &at[i * lobe_values()];
      double* g = out + i * lobe_values();
      const double length = lambent::length(Vec3d(v[0], v[1], v[2]));
      // Along two tangents, by differences; the normalisation leaves nothing along the axis itself (eq. 21).
      const Vec3d u = normalize(std::abs(axes[i].x) < 0.7 ? cross(axes[i], {1, 0, 0}) : cross(axes[i], {0, 1, 0}));
      Vec3d slope(0.0);
      for (const Vec3d& tangent : {u, cross(axes[i], u)}) {
        constexpr double h = 1e-5;
        double change = 0;
        for (double side : {h, -h}) {
          evaluate_sh(order_, normalize(axes[i] + side * tangent), step);
          for (int l = first_; l < order_; ++l)
            for (size_t k = size_t(l * l); k < size_t((l + 1) * (l + 1)); ++k)
              change += residual[k] * v[3 + l - first_] * step[k] / (2 * side);
        }
        slope += tangent * change;
      }
      for (int k = 0; k < 3; ++k) g[k] = 2 * slope[k] / length;
      for (int l = first_; l < order_; ++l) {
        double sum = 0;
        for (size_t k = size_t(l * l); k < size_t((l + 1) * (l + 1)); ++k) sum += residual[k] * y[i * C + k];
        g[3 + l - first_] = 2 * sum;
      }
    }
    return psi;
  }

  int order_, first_, bands_;
  size_t lobes_, n_, fine_;
  std::vector<float> targets_;
};

double dot_product(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum;
}

// Quasi-Newton steps with a short memory (L-BFGS; Nocedal and Wright, "Numerical Optimization", algorithm 7.4), which
// scale axes against coefficients by themselves; the paper took conjugate gradients.
void minimise(const TableFit& f, std::vector<double>& p, int iterations, ProgressStage& stage) {
  constexpr size_t memory = 12;
  struct Step {
    std::vector<double> s, y;
    double rho;
  };
  std::vector<Step> steps;
  std::vector<double> g, next_g, next(p.size());
  double psi = f(p, g);
  for (int i = 0; i < iterations && !stage.cancelled(); ++i) {
    stage.advance();
    std::vector<double> q = g, alpha(steps.size());
    for (size_t k = steps.size(); k-- > 0;) {
      alpha[k] = steps[k].rho * dot_product(steps[k].s, q);
      for (size_t j = 0; j < q.size(); ++j) q[j] -= alpha[k] * steps[k].y[j];
    }
    const double scale = steps.empty() ? 0.1 / std::sqrt(dot_product(g, g) + 1e-30)
                                       : 1 / (steps.back().rho * dot_product(steps.back().y, steps.back().y));
    for (double& v : q) v *= scale;
    for (size_t k = 0; k < steps.size(); ++k) {
      const double beta = steps[k].rho * dot_product(steps[k].y, q);
      for (size_t j = 0; j < q.size(); ++j) q[j] += (alpha[k] - beta) * steps[k].s[j];
    }
    const double slope = dot_product(g, q);
    double length = 1, next_psi = psi;
    for (int halving = 0; halving < 30 && !stage.cancelled(); ++halving, length *= 0.5) {
      for (size_t j = 0; j < p.size(); ++j) next[j] = p[j] - length * q[j];
      next_psi = f(next, next_g);
      if (next_psi <= psi - 1e-4 * length * slope) break;
    }
    if (!(next_psi < psi)) break;
    Step step{std::vector<double>(p.size()), std::vector<double>(p.size()), 0};
    for (size_t j = 0; j < p.size(); ++j) step.s[j] = next[j] - p[j], step.y[j] = next_g[j] - g[j];
    const double curvature = dot_product(step.s, step.y);
    const bool settled = psi - next_psi < 1e-5 * psi;
    p.swap(next), g.swap(next_g), psi = next_psi;
    if (settled) break;
    if (curvature <= 0) continue;
    step.rho = 1 / curvature;
    steps.push_back(std::move(step));
    if (steps.size() > memory) steps.erase(steps.begin());
  }
}

}  // namespace

std::vector<float> simulate_wrinkle(int order, int count, float depth, float albedo) {
  const size_t C = size_t(sh_count(order)), n = size_t(count);
  std::vector<double> direct(n * C), B(n * n);
  const std::vector<QuadratureNode> around = gauss_legendre(order + 8, 0, pi_d);
  parallel_for(n, 1, [&](size_t begin, size_t end) {
    std::vector<double> y(C);
    for (size_t r = begin; r < end; ++r) {
      const double x = double(r) / (count - 1) - 0.5, slope = depth * pi_d * std::sin(2 * pi_d * x);
      const double normal = std::atan2(1.0, -slope);  // its angle in the cross-section
      // Visible and before the surface: an interval of angles about the groove's axis.
      const double from = std::max(horizon(x, depth, 1), normal - pi_d / 2),
                   to = std::min(pi_d - horizon(x, depth, -1), normal + pi_d / 2);
      if (to > from)
        for (const QuadratureNode& psi : gauss_legendre(order + 8, from, to))
          for (const QuadratureNode& theta : around) {
            // theta from the groove's axis y.
            const double s = std::sin(theta.x),
                         weight = psi.weight * theta.weight * s * s * std::cos(psi.x - normal) / pi_d;
            evaluate_sh(order, Vec3d(s * std::cos(psi.x), std::cos(theta.x), s * std::sin(psi.x)), y);
            for (size_t k = 0; k < C; ++k) direct[r * C + k] += weight * y[k];
          }
      // A long strip seen under d psi fills the share 1/2 cos d psi of a diffuse surface's view.
      for (int a = 0; a < angles; ++a) {
        const double psi = normal + std::asin(2 * (a + 0.5) / angles - 1);
        if (psi > from && psi < to) continue;
        const double hit = meet(x, depth, psi);
        if (std::isnan(hit)) continue;
        // Between the two nearest places.
        const double place = std::clamp((hit + 0.5) * (count - 1), 0.0, count - 1.0);
        const size_t i = std::min(size_t(place), n - 1), j = std::min(i + 1, n - 1);
        const double share = albedo / angles, f = place - double(i);
        B[r * n + i] += share * (1 - f), B[r * n + j] += share * f;
      }
    }
  });
  std::vector<double> X = direct, next;
  for (int bounce = 0; bounce < 64 && albedo > 0; ++bounce) {
    next = direct;
    double change = 0;
    for (size_t r = 0; r < n; ++r)
      for (size_t i = 0; i < n; ++i)
        if (B[r * n + i] != 0)
          for (size_t k = 0; k < C; ++k) next[r * C + k] += B[r * n + i] * X[i * C + k];
    for (size_t k = 0; k < next.size(); ++k) change = std::max(change, std::abs(next[k] - X[k]));
    std::swap(X, next);
    if (change < 1e-9) break;
  }
  return {X.begin(), X.end()};
}

namespace {

Result<void> check_options(const WrinkleOptions& o) {
  if (o.order < 3 || o.order > max_sh_order)
    return Error{"order", "must lie between 3 and " + std::to_string(max_sh_order)};
  if (o.lobes < 3 || o.lobes > max_zonal_lobes)
    return Error{"lobes", "must lie between 3 and " + std::to_string(max_zonal_lobes)};
  if (o.size < 3 || o.size > 256) return Error{"size", "must lie between 3 and 256"};
  if (!(o.max_depth > 0 && o.max_depth <= 10)) return Error{"depth", "must be above 0 and at most 10"};
  if (!(o.albedo >= 0 && o.albedo < 1)) return Error{"albedo", "must lie from 0 to below 1"};
  return {};
}

using Axes = std::vector<Vec3d>;

// The linear lobe, and others symmetric about it in the cross-section and along the groove.
std::vector<Axes> first_axes(const std::vector<float>& t, size_t lobes) {
  const Vec3d axis(linear_axis(t)), along(0, 1, 0), across = normalize(cross(along, axis));
  std::vector<Axes> all;
  for (double angle = 0.2; angle < 1.5; angle += 0.1)
    for (const Vec3d& side : {across, along}) {
      Axes& from = all.emplace_back(Axes{axis});
      for (size_t i = 1; i < lobes; ++i) {
        const double a = angle * double((i + 1) / 2) * (i % 2 ? 1 : -1);
        from.push_back(normalize(axis * std::cos(a) + side * std::sin(a)));
      }
    }
  return all;
}

// [depth][place][order^2], twice as fine as the table. Errors: cancelled.
Result<std::vector<float>> simulate_all(const WrinkleOptions& o, Progress* progress) {
  const int fine = 2 * o.size - 1;
  std::vector<float> all;
  ProgressStage stage(progress, "grooves", size_t(fine));
  for (int d = 0; d < fine && !stage.cancelled(); ++d) {
    const std::vector<float> row = simulate_wrinkle(o.order, fine, o.max_depth * float(d) / float(fine - 1), o.albedo);
    all.insert(all.end(), row.begin(), row.end());
    stage.advance();
  }
  if (stage.cancelled()) return Error{"", "cancelled"};
  return all;
}

}  // namespace

Result<WrinkleTable> make_wrinkle_table(const WrinkleOptions& o, Progress* progress) {
  if (auto ok = check_options(o); !ok) return ok.error();
  const size_t n = size_t(o.size), C = size_t(sh_count(o.order)), N = size_t(o.lobes);
  WritableZonalTransfer out = make_zonal_transfer(o.order, o.lobes, 1, n * n, Precision::single);
  const int exact = out.transfer.exact_bands();
  ZonalBatch batch = make_zonal_batch(o.order, exact, 1, o.lobes);  // all lanes alike
  std::vector<Axes> above(n), row(n);
  auto refine = [&](const std::vector<float>& t, const Axes& from, int iterations, Axes& to, std::vector<float>& g) {
    for (size_t k = 0; k < C; ++k) std::fill_n(batch.target(0, int(k)), zonal_lanes, double(t[k]));
    for (size_t i = 0; i < N; ++i)
      for (int k = 0; k < 3; ++k) std::fill_n(batch.axis(int(i), k), zonal_lanes, from[i][k]);
    refine_zonal(batch, {iterations, 1e-8, ridge});
    to.resize(N), g.clear();
    for (size_t i = 0; i < N; ++i) {
      for (int k = 0; k < 3; ++k) to[i][k] = batch.axis(int(i), k)[0];
      for (int l = exact; l < o.order; ++l) g.push_back(float(batch.coefficient(0, l, int(i))[0]));
    }
    return batch.psi[0];
  };
  // Fits of their own first, each going on from its neighbours', from the deepest groove up.
  const size_t fine = 2 * n - 1;
  auto simulated = simulate_all(o, progress);
  if (!simulated) return simulated.error();
  auto target = [&](size_t d, size_t x) {  // of an entry
    const auto at = simulated->begin() + ptrdiff_t((2 * d * fine + 2 * x) * C);
    return std::vector<float>(at, at + ptrdiff_t(C));
  };
  const size_t lobe = 3 + size_t(o.order - exact);
  std::vector<double> p(n * n * N * lobe);
  std::optional<ProgressStage> stage(std::in_place, progress, "fitting lobes", n * n);
  for (size_t d = n; d-- > 0;) {
    for (size_t x = 0; x < n; ++x) {
      if (stage->cancelled()) return Error{"", "cancelled"};
      stage->advance();
      const std::vector<float> t = target(d, x);
      double best = INFINITY;
      std::vector<float> g, best_g;
      Axes found;
      auto attempt = [&](const Axes& from) {
        const double psi = refine(t, from, d == 0 ? 0 : 60, found, g);
        if (psi < best) best = psi, row[x] = found, best_g = g;
      };
      if (!above[x].empty()) attempt(Axes(above[x]));
      else if (x > 0) attempt(Axes(row[x - 1]));
      else
        for (const Axes& from : first_axes(t, N)) attempt(from);
      for (size_t i = 0; i < N; ++i) {
        double* v = &p[((d * n + x) * N + i) * lobe];
        for (int k = 0; k < 3; ++k) v[k] = row[x][i][k];
        for (size_t k = 3; k < lobe; ++k) v[k] = best_g[i * (lobe - 3) + k - 3];
      }
    }
    above = row;
  }
  stage.emplace(progress, "fitting the table", size_t(o.iterations));
  if (exact < o.order) minimise(TableFit(o.order, exact, N, n, *simulated), p, o.iterations, *stage);
  if (stage->cancelled()) return Error{"", "cancelled"};
  stage.reset();

  double error = 0, total = 0;
  for (size_t d = 0; d < n; ++d)
    for (size_t x = 0; x < n; ++x) {
      const std::vector<float> t = target(d, x);
      std::vector<float> values(t.begin(), t.begin() + sh_count(exact));
      values.insert(values.end(), p.begin() + ptrdiff_t((d * n + x) * N * lobe),
                    p.begin() + ptrdiff_t((d * n + x + 1) * N * lobe));
      store_receiver(out, d * n + x, values);
      const std::vector<float> fit = zonal_harmonics(out.transfer, values);
      for (size_t k = 0; k < C; ++k) error += std::pow(double(fit[k]) - t[k], 2), total += double(t[k]) * t[k];
    }
  return WrinkleTable{{o.size, o.size, std::move(out.transfer), o.max_depth}, std::sqrt(error / total)};
}

}  // namespace lambent
