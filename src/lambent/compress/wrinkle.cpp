// Follows: local-deformable-prt, section 4.2.
#include <lambent/basis/quadrature.h>
#include <lambent/basis/zonal.h>
#include <lambent/compress/wrinkle.h>
#include <lambent/compress/zonal_kernel.h>
#include <lambent/core/parallel.h>

namespace lambent {
namespace {

constexpr double pi_d = std::numbers::pi;
constexpr int angles = 256;         // rays in the cross-section for bounces
constexpr int profile = 512;        // pieces of the groove's outline
constexpr double ridge = 1e-4;         // shallow grooves need one lobe: keeps the others from growing against each other, and entries alike

double groove_height(double x, double depth) { return std::abs(x) < 0.5 ? -depth * std::cos(pi_d * x) * std::cos(pi_d * x) : 0; }

// Angle of the direction (cos, sin) to the right of which, or left, the groove hides the sky, from (x, h(x)): in (-pi/2, pi/2).
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
  const double h = groove_height(x, depth), side = std::cos(psi) < 0 ? -1 : 1, slope = std::tan(psi), reach = 0.5 - side * x;
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

}  // namespace

std::vector<float> simulate_wrinkle(int order, int count, float depth, float albedo) {
  const size_t C = size_t(sh_count(order)), n = size_t(count);
  std::vector<double> direct(n * C), B(n * n);
  const std::vector<QuadratureNode> around = gauss_legendre(order + 8, 0, pi_d);
  parallel_for(n, 1, [&](size_t begin, size_t end) {
    std::vector<double> y(C);
    for (size_t r = begin; r < end; ++r) {
      const double x = (double(r) + 0.5) / count - 0.5, slope = depth * pi_d * std::sin(2 * pi_d * x);
      const double normal = std::atan2(1.0, -slope);  // its angle in the cross-section
      // Visible and before the surface: an interval of angles about the groove's axis.
      const double from = std::max(horizon(x, depth, 1), normal - pi_d / 2), to = std::min(pi_d - horizon(x, depth, -1), normal + pi_d / 2);
      if (to > from)
        for (const QuadratureNode& psi : gauss_legendre(order + 8, from, to))
          for (const QuadratureNode& theta : around) {
            // theta from the groove's axis y.
            const double s = std::sin(theta.x), weight = psi.weight * theta.weight * s * s * std::cos(psi.x - normal) / pi_d;
            evaluate_sh(order, glm::dvec3(s * std::cos(psi.x), std::cos(theta.x), s * std::sin(psi.x)), y);
            for (size_t k = 0; k < C; ++k) direct[r * C + k] += weight * y[k];
          }
      // A long strip seen under d psi fills the share 1/2 cos d psi of a diffuse surface's view.
      for (int a = 0; a < angles; ++a) {
        const double psi = normal + std::asin(2 * (a + 0.5) / angles - 1);
        if (psi > from && psi < to) continue;
        const double hit = meet(x, depth, psi);
        if (std::isnan(hit)) continue;
        // Between the two nearest places.
        const double place = std::clamp((hit + 0.5) * count - 0.5, 0.0, count - 1.0);
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

Result<WrinkleTable> make_wrinkle_table(const WrinkleOptions& o) {
  if (o.order < 3 || o.order > max_sh_order) return Error{"order", "must lie between 3 and " + std::to_string(max_sh_order)};
  if (o.lobes < 3 || o.lobes > max_zonal_lobes) return Error{"lobes", "must lie between 3 and " + std::to_string(max_zonal_lobes)};
  if (o.size < 2 || o.size > 256) return Error{"size", "must lie between 2 and 256"};
  if (!(o.max_depth > 0 && o.max_depth <= 10)) return Error{"depth", "must be above 0 and at most 10"};
  if (!(o.albedo >= 0 && o.albedo < 1)) return Error{"albedo", "must lie between 0 and 1"};
  const size_t n = size_t(o.size), C = size_t(sh_count(o.order)), N = size_t(o.lobes);
  WritableZonalTransfer out = make_zonal_transfer(o.order, o.lobes, 1, n * n, Precision::single);
  const int exact = out.transfer.exact_bands();
  ZonalBatch batch = make_zonal_batch(o.order, exact, 1, o.lobes);  // all lanes alike
  using Axes = std::vector<glm::dvec3>;
  std::vector<Axes> above(n), row(n);
  auto refine = [&](const std::vector<float>& t, const Axes& from, Axes& to, std::vector<float>& g) {
    for (size_t k = 0; k < C; ++k) std::fill_n(batch.target(0, int(k)), zonal_lanes, double(t[k]));
    for (size_t i = 0; i < N; ++i)
      for (int k = 0; k < 3; ++k) std::fill_n(batch.axis(int(i), k), zonal_lanes, from[i][k]);
    refine_zonal(batch, {60, 1e-8, ridge});
    to.resize(N), g.clear();
    for (size_t i = 0; i < N; ++i) {
      for (int k = 0; k < 3; ++k) to[i][k] = batch.axis(int(i), k)[0];
      for (int l = exact; l < o.order; ++l) g.push_back(float(batch.coefficient(0, l, int(i))[0]));
    }
    return batch.psi[0];
  };
  double error = 0, total = 0;
  for (size_t d = n; d-- > 0;) {
    const std::vector<float> simulated = simulate_wrinkle(o.order, o.size, o.max_depth * float(d + 1) / float(n), o.albedo);
    for (size_t x = 0; x < n; ++x) {
      const std::vector<float> t(simulated.begin() + ptrdiff_t(x * C), simulated.begin() + ptrdiff_t((x + 1) * C));
      double best = INFINITY;
      std::vector<float> g, best_g;
      Axes found;
      auto attempt = [&](const Axes& from, double advantage) {
        const double psi = refine(t, from, found, g);
        if (psi < best * advantage) best = psi, row[x] = found, best_g = g;
      };
      if (!above[x].empty()) attempt(Axes(above[x]), 1);
      else if (x > 0) attempt(Axes(row[x - 1]), 1);
      else {
        // The linear lobe, and others symmetric about it in the cross-section and along the groove.
        const glm::dvec3 axis(linear_axis(t)), along(0, 1, 0), across = glm::normalize(glm::cross(along, axis));
        for (double angle = 0.2; angle < 1.5; angle += 0.1)
          for (const glm::dvec3& side : {across, along}) {
            Axes from{axis};
            for (size_t i = 1; i < N; ++i) {
              const double a = angle * double((i + 1) / 2) * (i % 2 ? 1 : -1);
              from.push_back(glm::normalize(axis * std::cos(a) + side * std::sin(a)));
            }
            attempt(from, 1);
          }
      }
      std::vector<float> values(t.begin(), t.begin() + sh_count(exact));
      for (size_t i = 0; i < N; ++i) {
        for (int k = 0; k < 3; ++k) values.push_back(float(row[x][i][k]));
        values.insert(values.end(), best_g.begin() + ptrdiff_t(i * size_t(o.order - exact)), best_g.begin() + ptrdiff_t((i + 1) * size_t(o.order - exact)));
      }
      store_receiver(out, d * n + x, values);
      const std::vector<float> fit = zonal_harmonics(out.transfer, values);
      for (size_t k = 0; k < C; ++k) error += std::pow(double(fit[k]) - t[k], 2), total += double(t[k]) * t[k];
    }
    above = row;
  }
  return WrinkleTable{o.size, o.max_depth, std::move(out.transfer), std::sqrt(error / total)};
}

std::vector<float> sample_wrinkle(const WrinkleTable& table, float x, float depth) {
  const ZonalTransfer& t = table.transfer;
  auto place = [&](float u) { return std::clamp(u, 0.0f, float(table.size - 1)); };
  const float px = place((x + 0.5f) * float(table.size) - 0.5f), pd = place(depth / table.max_depth * float(table.size) - 1);
  const int i = std::min(int(px), table.size - 2), j = std::min(int(pd), table.size - 2);
  std::vector<float> sum(t.receiver_values());
  for (int b = 0; b < 2; ++b)
    for (int a = 0; a < 2; ++a) {
      const float weight = (a ? px - float(i) : 1 - px + float(i)) * (b ? pd - float(j) : 1 - pd + float(j));
      const std::vector<float> v = load_receiver(t, size_t((j + b) * table.size + i + a));
      for (size_t k = 0; k < sum.size(); ++k) sum[k] += weight * v[k];
    }
  for (int l = 0; l < t.lobes; ++l) {
    const Vec3 axis = lobe_axis(t, sum, l);
    for (size_t k = 0; k < 3; ++k) sum[t.exact_values() + size_t(l) * t.lobe_values() + k] = axis[int(k)];
  }
  return sum;
}

}  // namespace lambent
