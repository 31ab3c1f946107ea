// Follows: general-prt (directional and custom bases). A lobe g(cos t) has Legendre moments I_l = integral over [-1, 1]
// of g P_l; then (Funk-Hecke) the integral of y_lm against the lobe about a is 2 pi I_l y_lm(a), and that of two lobes
// at an angle c is pi sum_l (2l+1) I_l I'_l P_l(cos c).
#include <lambent/basis/directional.h>
#include <lambent/basis/quadrature.h>
#include <lambent/basis/symmetric.h>
#include <lambent/core/check.h>

namespace lambent {

const char* const lobe_names[4] = {"cosine_power", "von_mises_fisher", "compact", "band_limited"};

bool is_lobe(LobeKind kind, const Lobe& lobe) {
  const float s = lobe.sharpness;
  const bool unit = std::abs(length(lobe.axis) - 1) < 1e-4f;
  switch (kind) {
    case LobeKind::cosine_power: return unit && s >= 1 && s <= max_sharpness;
    case LobeKind::von_mises_fisher: return unit && s >= 1e-3f && s <= max_sharpness;
    case LobeKind::compact: return unit && s >= 1.5f && s <= 1024;
    case LobeKind::band_limited: return unit && s >= 1 && s <= float(max_sh_order) && s == std::floor(s);
  }
  return false;
}

double lobe_value(LobeKind kind, double s, double cosine) {
  switch (kind) {
    case LobeKind::cosine_power: return cosine > 0 ? std::pow(cosine, s) : 0;
    case LobeKind::von_mises_fisher: return std::exp(s * (cosine - 1));
    case LobeKind::compact: {
      const double inside = std::max(0.0, 1 - s * (1 - cosine) / 3);
      return inside * inside * inside;
    }
    case LobeKind::band_limited: {
      double series[max_sh_order];
      for (int l = 0; l < int(s); ++l) series[l] = (2 * l + 1) / (s * s);
      return evaluate_legendre(std::span(series, size_t(s)), cosine);
    }
  }
  return 0;
}

double lobe_scale(LobeKind kind, double s) {
  const double two_pi = 2 * std::numbers::pi;
  switch (kind) {
    case LobeKind::cosine_power: return std::sqrt((2 * s + 1) / two_pi);
    case LobeKind::von_mises_fisher: return std::sqrt(2 * s / (two_pi * -std::expm1(-4 * s)));
    case LobeKind::compact: return std::sqrt(7 * s / (3 * two_pi));
    case LobeKind::band_limited: return s / std::sqrt(2 * two_pi);
  }
  return 0;
}

double lobe_reach(LobeKind kind, double s) {
  switch (kind) {
    case LobeKind::cosine_power: return std::acos(std::exp(-30 / s));
    case LobeKind::von_mises_fisher: return std::acos(std::max(-1.0, 1 - 30 / s));
    case LobeKind::compact: return std::acos(std::max(-1.0, 1 - 3 / s));
    case LobeKind::band_limited: break;
  }
  return std::numbers::pi;
}

namespace {

// Terms of the sum over l for two lobes. Those of the broadest cosine, s = 1, fall as l^-4 and leave 1e-9; those of
// sharp ones fall as exp(-l^2 / s). Compact ones bend at their edge, and terms fall as (l^2 / s)^-4.
int moments_needed(LobeKind kind, double sharpest) {
  if (kind == LobeKind::band_limited) return max_sh_order;
  return 640 + int((kind == LobeKind::compact ? 30 : 6) * std::sqrt(sharpest));
}

// A float's rounding of a unit axis would show in sharp lobes.
Vec3d axis_of(const Lobe& lobe) { return normalize(Vec3d(lobe.axis)); }

// I_l of the unscaled lobe, l < count.
std::vector<double> moments(LobeKind kind, double s, int count) {
  std::vector<double> I(size_t(count), 0.0);
  if (kind == LobeKind::band_limited) {
    std::fill_n(I.begin(), std::min(count, int(s)), 2 / (s * s));
    return I;
  }
  if (kind == LobeKind::compact) {
    for (const QuadratureNode& node : gauss_legendre(count / 2 + 2, 1 - 3 / s, 1)) {  // exact
      const double value = node.weight * lobe_value(kind, s, node.x);
      double p0 = 1, p1 = node.x;
      for (int l = 0; l < count; ++l) {
        I[size_t(l)] += value * p0;
        const double next = ((2 * l + 3) * node.x * p1 - (l + 1) * p0) / (l + 2);
        p0 = p1, p1 = next;
      }
    }
    return I;
  }
  if (kind == LobeKind::cosine_power) {
    // The integral over [0, 1] of t^s P_l.
    I[0] = 1 / (s + 1);
    if (count > 1) I[1] = 1 / (s + 2);
    for (int l = 2; l < count; ++l) I[size_t(l)] = I[size_t(l - 2)] * (s - l + 2) / (s + l + 1);
    return I;
  }
  // 2 exp(-s) times the modified spherical Bessel functions i_l(s): downwards, from where they are negligible (Miller).
  double above = 0, at = 1e-280;
  for (int l = std::max(count, int(s)) + 40 + int(8 * std::sqrt(s)); l > 0; --l) {
    const double below = above + (2 * l + 1) / s * at;
    above = at, at = below;
    if (l - 1 < count) I[size_t(l - 1)] = at;
    if (at > 1e200) {
      above *= 1e-200, at *= 1e-200;
      for (int k = l - 1; k < count; ++k) I[size_t(k)] *= 1e-200;
    }
  }
  const double scale = -std::expm1(-2 * s) / s / I[0];
  for (double& x : I) x *= scale;
  return I;
}

// The integral of the product of two unscaled lobes.
double lobe_product(LobeKind kind, const Lobe& p, const Lobe& q, std::span<const double> Ip,
                    std::span<const double> Iq) {
  const Vec3d a = axis_of(p), b = axis_of(q);
  if (kind == LobeKind::von_mises_fisher) {
    // exp((s a + s' b).d - s - s') is a lobe about the sum.
    const double sum = double(p.sharpness) + q.sharpness, k = length(double(p.sharpness) * a + double(q.sharpness) * b);
    return k < 1e-6 ? 4 * std::numbers::pi * std::exp(-sum)
                    : 2 * std::numbers::pi * std::exp(k - sum) * -std::expm1(-2 * k) / k;
  }
  const double x = std::clamp(dot(a, b), -1.0, 1.0);
  if (kind == LobeKind::compact && std::acos(x) >= lobe_reach(kind, p.sharpness) + lobe_reach(kind, q.sharpness))
    return 0;
  double p0 = 1, p1 = x, result = Ip[0] * Iq[0] + 3 * Ip[1] * Iq[1] * x;
  for (size_t l = 2; l < Ip.size(); ++l) {
    const double k = double(l), next = ((2 * k - 1) * x * p1 - (k - 1) * p0) / k;
    p0 = p1, p1 = next;
    result += (2 * k + 1) * Ip[l] * Iq[l] * next;
  }
  return std::numbers::pi * result;
}

// The moments of each; lobes of one sharpness, side by side, share them. None of those that need none.
std::vector<std::vector<double>> moments_of(LobeKind kind, std::span<const Lobe> lobes) {
  std::vector<std::vector<double>> I(lobes.size());
  if (kind == LobeKind::von_mises_fisher) return I;
  float sharpest = 1;
  for (const Lobe& lobe : lobes) sharpest = std::max(sharpest, lobe.sharpness);
  for (size_t k = 0; k < lobes.size(); ++k)
    I[k] = k > 0 && lobes[k].sharpness == lobes[k - 1].sharpness
             ? I[k - 1]
             : moments(kind, lobes[k].sharpness, moments_needed(kind, double(sharpest)));
  return I;
}

// Coefficients of the scaled lobe in spherical harmonics.
void lobe_to_sh(LobeKind kind, const Lobe& lobe, int order, std::span<double> out) {
  const std::vector<double> I = moments(kind, lobe.sharpness, order);
  const double scale = 2 * std::numbers::pi * lobe_scale(kind, lobe.sharpness);
  evaluate_sh(order, axis_of(lobe), out);
  for (int i = 0; i < sh_count(order); ++i) out[size_t(i)] *= scale * I[size_t(sh_band(i))];
}

}  // namespace

double lobe_integral(LobeKind kind, double s) {
  const double scale = 2 * std::numbers::pi * lobe_scale(kind, s);
  switch (kind) {
    case LobeKind::cosine_power: return scale / (s + 1);
    case LobeKind::von_mises_fisher: return scale * -std::expm1(-2 * s) / s;
    case LobeKind::compact: return scale * 0.75 / s;
    case LobeKind::band_limited: return scale * 2 / (s * s);
  }
  return 0;
}

double lobe_overlap(LobeKind kind, const Lobe& a, const Lobe& b) {
  std::vector<double> I, J;
  if (kind != LobeKind::von_mises_fisher) {
    const int count = moments_needed(kind, double(std::max(a.sharpness, b.sharpness)));
    I = moments(kind, a.sharpness, count), J = moments(kind, b.sharpness, count);
  }
  return lobe_scale(kind, a.sharpness) * lobe_scale(kind, b.sharpness) * lobe_product(kind, a, b, I, J);
}

Vec3 sample_lobe(LobeKind kind, float sharpness, Vec2 u) {
  // By inversion; v = 1 - cos t keeps its digits in sharp lobes.
  LAMBENT_CHECK(kind != LobeKind::band_limited);
  const double s = sharpness, x = 1 - double(u.x);
  const double v = kind == LobeKind::cosine_power ? -std::expm1(std::log(x) / (s + 1))
                 : kind == LobeKind::compact      ? 3 * -std::expm1(std::log(x) / 4) / s
                                                  : -std::log(x + (1 - x) * std::exp(-2 * s)) / s;
  const double r = std::sqrt(std::max(0.0, v * (2 - v))), phi = 2 * std::numbers::pi * double(u.y);
  return Vec3(r * std::cos(phi), r * std::sin(phi), 1 - v);
}

std::vector<double> lobe_irradiance(LobeKind kind, double s) {
  const int count = moments_needed(kind, s);
  std::vector<double> series = moments(kind, s, count);
  const std::vector<double> cosine = moments(LobeKind::cosine_power, 1, count);
  for (size_t l = 0; l < series.size(); ++l)
    series[l] *= std::numbers::pi * lobe_scale(kind, s) * double(2 * l + 1) * cosine[l];
  return series;
}

double evaluate_legendre(std::span<const double> c, double x) {
  double p0 = 1, p1 = x, sum = 0;
  for (size_t l = 0; l < c.size(); ++l) {
    sum += c[l] * p0;
    const double k = double(l + 1), next = ((2 * k + 1) * x * p1 - k * p0) / (k + 1);
    p0 = p1, p1 = next;
  }
  return sum;
}

std::vector<Vec3> even_directions(int count) {
  LAMBENT_CHECK(count >= 0);
  std::vector<Vec3> directions;
  const double golden_angle = std::numbers::pi * (3 - std::sqrt(5.0));
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2.0 * i + 1) / count, r = std::sqrt(1 - z * z), phi = golden_angle * i;
    directions.emplace_back(r * std::cos(phi), r * std::sin(phi), z);
  }
  return directions;
}

std::vector<Lobe> even_lobes(int count, LobeKind kind) {
  LAMBENT_CHECK(kind == LobeKind::von_mises_fisher || kind == LobeKind::compact);
  std::vector<Lobe> lobes;
  for (Vec3 axis : even_directions(count)) lobes.push_back({axis, 0.15f * float(count)});
  return lobes;
}

std::vector<Lobe> steerable_lobes(int bands) {
  LAMBENT_CHECK(bands >= 1 && bands <= max_sh_order);
  constexpr int steps = 20;  // leave a condition of at most 25; twice as many, 20
  const size_t count = size_t(sh_count(bands));
  std::vector<Vec3d> axes;
  for (Vec3 axis : even_directions(int(count))) axes.push_back(normalize(Vec3d(axis)));
  // The lobe K, its slope by the cosine, and the greatest slope, K'(1): the sum of (2 l + 1) l (l + 1) / 2.
  std::vector<double> gram(count * count), slope(count * count);
  double steepest = 0;
  for (int l = 0; l < bands; ++l) steepest += (2 * l + 1) * l * (l + 1) / 2.0 / double(count);
  for (int step = 0; step < steps && bands > 1; ++step) {
    for (size_t i = 0; i < count; ++i)
      for (size_t j = 0; j < count; ++j) {
        const double x = dot(axes[i], axes[j]);
        double p0 = 1, p1 = x, q0 = 0, q1 = 1, value = 0, rise = 0;
        for (int l = 0; l < bands; ++l) {
          value += (2 * l + 1) * p0, rise += (2 * l + 1) * q0;
          const double p = ((2 * l + 3) * x * p1 - (l + 1) * p0) / (l + 2),
                       q = ((2 * l + 3) * (p1 + x * q1) - (l + 1) * q0) / (l + 2);
          p0 = p1, p1 = p, q0 = q1, q1 = q;
        }
        gram[i * count + j] = value / double(count), slope[i * count + j] = rise / double(count);
      }
    const PseudoInverse inverse = pseudo_inverse(gram, int(count), 1e-14);
    std::vector<Vec3d> moved = axes;
    for (size_t i = 0; i < count; ++i) {
      // Half of the gradient of log det G by axis i, along the sphere; a step of at most a small part of the spacing.
      Vec3d uphill(0);
      for (size_t j = 0; j < count; ++j)
        if (j != i)
          uphill += inverse.values[i * count + j] * slope[i * count + j] * (axes[j] - dot(axes[j], axes[i]) * axes[i]) /
                    (2 * steepest);
      const double most = 0.15 / bands, far = length(uphill);
      moved[i] = normalize(axes[i] + (far > most ? most / far : 1.0) * uphill);
    }
    axes = std::move(moved);
  }
  std::vector<Lobe> lobes;
  for (const Vec3d& axis : axes) lobes.push_back({normalize(Vec3(axis)), float(bands)});
  return lobes;
}

namespace {

// G of harmonics and scaled lobes.
std::vector<double> gram_matrix(int sh_order, LobeKind kind, std::span<const Lobe> lobes,
                                std::span<const std::vector<double>> I) {
  const size_t harmonics = size_t(sh_count(sh_order)), n = harmonics + lobes.size();
  std::vector<double> gram(n * n, 0.0), projected(harmonics);
  auto set = [&](size_t i, size_t j, double value) { gram[i * n + j] = gram[j * n + i] = value; };
  for (size_t i = 0; i < harmonics; ++i) set(i, i, 1);
  for (size_t p = 0; p < lobes.size(); ++p) {
    if (sh_order > 0) {
      lobe_to_sh(kind, lobes[p], sh_order, projected);
      for (size_t i = 0; i < harmonics; ++i) set(i, harmonics + p, projected[i]);
    }
    set(harmonics + p, harmonics + p, 1);
    for (size_t q = 0; q < p; ++q) {
      const double scale = lobe_scale(kind, lobes[p].sharpness) * lobe_scale(kind, lobes[q].sharpness);
      set(harmonics + p, harmonics + q, scale * lobe_product(kind, lobes[p], lobes[q], I[p], I[q]));
    }
  }
  return gram;
}

double squared_norm(std::span<const double> gram, std::span<const double> c) {
  double sum = 0;
  for (size_t i = 0; i < c.size(); ++i)
    for (size_t j = 0; j < c.size(); ++j) sum += c[i] * gram[i * c.size() + j] * c[j];
  return sum;
}

}  // namespace

DirectionalBasis make_directional_basis(int sh_order, LobeKind kind, std::vector<Lobe> lobes, double cutoff) {
  LAMBENT_CHECK(sh_order >= 0 && sh_order <= max_sh_order && (sh_order > 0 || !lobes.empty()));
  for (const Lobe& lobe : lobes) LAMBENT_CHECK(is_lobe(kind, lobe));
  DirectionalBasis basis{sh_order, kind, std::move(lobes), {}, {}, 0, 1};
  basis.gram = gram_matrix(sh_order, kind, basis.lobes, moments_of(kind, basis.lobes));
  PseudoInverse inverse = pseudo_inverse(basis.gram, int(basis.count()), cutoff);
  basis.dual = std::move(inverse.values), basis.rank = inverse.rank, basis.condition = inverse.condition;
  return basis;
}

void evaluate_directional(const DirectionalBasis& basis, Vec3d d, std::span<double> out) {
  LAMBENT_CHECK(out.size() >= basis.count());
  size_t i = size_t(sh_count(basis.sh_order));
  if (basis.sh_order > 0) evaluate_sh(basis.sh_order, d, out);
  for (const Lobe& lobe : basis.lobes)
    out[i++] = lobe_scale(basis.kind, lobe.sharpness) * lobe_value(basis.kind, lobe.sharpness, dot(axis_of(lobe), d));
}

std::vector<double> apply_directional_dual(const DirectionalBasis& basis, std::span<const double> integrals) {
  const size_t n = basis.count();
  LAMBENT_CHECK(integrals.size() == n);
  std::vector<double> result(n);
  for (size_t i = 0; i < n; ++i)
    for (size_t j = 0; j < n; ++j) result[i] += basis.dual[i * n + j] * integrals[j];
  return result;
}

void evaluate_directional_dual(const DirectionalBasis& basis, Vec3d d, std::span<double> out) {
  std::vector<double> values(basis.count());
  evaluate_directional(basis, d, values);
  const std::vector<double> dual = apply_directional_dual(basis, values);
  LAMBENT_CHECK(out.size() >= dual.size());
  std::copy(dual.begin(), dual.end(), out.begin());
}

std::vector<double> project_directional(const DirectionalBasis& basis, const std::function<double(Vec3d)>& f,
                                        int exact_order) {
  std::vector<double> integrals(basis.count()), values(basis.count());
  for (const DirectionNode& node : direction_quadrature(std::max(basis.sh_order, exact_order))) {
    evaluate_directional(basis, node.direction, values);
    const double value = f(node.direction) * node.weight;
    for (size_t i = 0; i < values.size(); ++i) integrals[i] += value * values[i];
  }
  return apply_directional_dual(basis, integrals);
}

double reconstruct_directional(const DirectionalBasis& basis, std::span<const double> coefficients, Vec3d d) {
  LAMBENT_CHECK(coefficients.size() == basis.count());
  std::vector<double> values(basis.count());
  evaluate_directional(basis, d, values);
  double sum = 0;
  for (size_t i = 0; i < values.size(); ++i) sum += coefficients[i] * values[i];
  return sum;
}

std::vector<double> directional_to_sh(const DirectionalBasis& basis, std::span<const double> coefficients, int order) {
  LAMBENT_CHECK(coefficients.size() == basis.count() && order >= 1 && order <= max_sh_order);
  std::vector<double> result(size_t(sh_count(order))), projected(result.size());
  const size_t harmonics = size_t(sh_count(basis.sh_order));
  std::copy_n(coefficients.begin(), std::min(harmonics, result.size()), result.begin());
  for (size_t p = 0; p < basis.lobes.size(); ++p) {
    lobe_to_sh(basis.kind, basis.lobes[p], order, projected);
    for (size_t i = 0; i < result.size(); ++i) result[i] += coefficients[harmonics + p] * projected[i];
  }
  return result;
}

TurnedCoefficients turn_directional(const DirectionalBasis& basis, std::span<const double> c, const Mat3& rotation) {
  std::vector<Vec3> axes;
  for (const Lobe& lobe : basis.lobes) axes.push_back(normalize(rotation * lobe.axis));
  MovedCoefficients moved = move_directional(basis, c, rotation, axes);
  return {std::move(moved.coefficients), moved.lost};
}

MovedCoefficients move_directional(const DirectionalBasis& basis, std::span<const double> c, const Mat3& rotation,
                                   std::span<const Vec3> axes) {
  const size_t n = basis.count(), harmonics = size_t(sh_count(basis.sh_order)), lobes = basis.lobes.size();
  LAMBENT_CHECK(c.size() == n && axes.size() == lobes);
  std::vector<Lobe> moved = basis.lobes;
  for (size_t p = 0; p < lobes; ++p) moved[p].axis = axes[p];
  // The moved function against each of the basis: its harmonics, then its lobes.
  std::vector<double> integrals(n, 0.0), projected(harmonics), there(c.begin(), c.end());
  if (basis.sh_order > 0) {
    const std::vector<float> still(c.begin(), c.begin() + ptrdiff_t(harmonics));
    std::vector<float> sh(harmonics);
    rotate_sh(make_sh_rotation(basis.sh_order, rotation), still, sh);
    std::copy(sh.begin(), sh.end(), there.begin());
    for (size_t i = 0; i < n; ++i)
      for (size_t j = 0; j < harmonics; ++j) integrals[i] += basis.gram[i * n + j] * there[j];
  }
  const std::vector<std::vector<double>> I = moments_of(basis.kind, basis.lobes);
  for (size_t p = 0; p < lobes; ++p) {
    const double strength = c[harmonics + p], scale = lobe_scale(basis.kind, moved[p].sharpness);
    if (strength == 0) continue;
    if (basis.sh_order > 0) {
      lobe_to_sh(basis.kind, moved[p], basis.sh_order, projected);
      for (size_t i = 0; i < harmonics; ++i) integrals[i] += strength * projected[i];
    }
    for (size_t q = 0; q < lobes; ++q)
      integrals[harmonics + q] += strength * scale * lobe_scale(basis.kind, basis.lobes[q].sharpness) *
                                  lobe_product(basis.kind, moved[p], basis.lobes[q], I[p], I[q]);
  }
  MovedCoefficients out{apply_directional_dual(basis, integrals), 0,
                        squared_norm(gram_matrix(basis.sh_order, basis.kind, moved, I), there)};
  out.lost = out.whole;
  for (size_t i = 0; i < n; ++i) out.lost -= out.coefficients[i] * integrals[i];
  out.lost = std::max(out.lost, 0.0);
  return out;
}

}  // namespace lambent
