// Follows: general-prt (directional and custom bases). A lobe g(cos t) has Legendre moments I_l = integral over [-1, 1]
// of g P_l; then (Funk-Hecke) the integral of y_lm against the lobe about a is 2 pi I_l y_lm(a), and that of two lobes
// at an angle c is pi sum_l (2l+1) I_l I'_l P_l(cos c).
#include <lambent/basis/directional.h>
#include <lambent/basis/symmetric.h>
#include <lambent/basis/quadrature.h>
#include <lambent/core/check.h>

namespace lambent {

bool is_lobe(LobeKind kind, const Lobe& lobe) {
  return std::abs(length(lobe.axis) - 1) < 1e-4f && lobe.sharpness >= min_sharpness(kind) &&
         lobe.sharpness <= max_sharpness;
}

double lobe_value(LobeKind kind, double s, double cosine) {
  return kind == LobeKind::cosine_power ? (cosine > 0 ? std::pow(cosine, s) : 0) : std::exp(s * (cosine - 1));
}

double lobe_scale(LobeKind kind, double s) {
  const double two_pi = 2 * std::numbers::pi;
  return kind == LobeKind::cosine_power ? std::sqrt((2 * s + 1) / two_pi)
                                        : std::sqrt(2 * s / (two_pi * -std::expm1(-4 * s)));
}

namespace {

// Terms of the sum over l for two cosine lobes. Those of the broadest, s = 1, fall as l^-4 and leave 1e-9; those of
// sharp ones fall as exp(-l^2 / s).
int moments_needed(float sharpest) { return 640 + int(6 * std::sqrt(sharpest)); }

// A float's rounding of a unit axis would show in sharp lobes.
Vec3d axis_of(const Lobe& lobe) { return normalize(Vec3d(lobe.axis)); }

// I_l of the unscaled lobe, l < count.
std::vector<double> moments(LobeKind kind, double s, int count) {
  std::vector<double> I(size_t(count), 0.0);
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
  double p0 = 1, p1 = x, result = Ip[0] * Iq[0] + 3 * Ip[1] * Iq[1] * x;
  for (size_t l = 2; l < Ip.size(); ++l) {
    const double k = double(l), next = ((2 * k - 1) * x * p1 - (k - 1) * p0) / k;
    p0 = p1, p1 = next;
    result += (2 * k + 1) * Ip[l] * Iq[l] * next;
  }
  return std::numbers::pi * result;
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
  const double unscaled = kind == LobeKind::cosine_power ? 1 / (s + 1) : -std::expm1(-2 * s) / s;
  return 2 * std::numbers::pi * lobe_scale(kind, s) * unscaled;
}

double lobe_overlap(LobeKind kind, const Lobe& a, const Lobe& b) {
  std::vector<double> I, J;
  if (kind == LobeKind::cosine_power) {
    const int count = moments_needed(std::max(a.sharpness, b.sharpness));
    I = moments(kind, a.sharpness, count), J = moments(kind, b.sharpness, count);
  }
  return lobe_scale(kind, a.sharpness) * lobe_scale(kind, b.sharpness) * lobe_product(kind, a, b, I, J);
}

Vec3 sample_lobe(LobeKind kind, float sharpness, Vec2 u) {
  // By inversion; v = 1 - cos t keeps its digits in sharp lobes.
  const double s = sharpness, x = 1 - double(u.x);
  const double v = kind == LobeKind::cosine_power ? -std::expm1(std::log(x) / (s + 1))
                                                  : -std::log(x + (1 - x) * std::exp(-2 * s)) / s;
  const double r = std::sqrt(std::max(0.0, v * (2 - v))), phi = 2 * std::numbers::pi * double(u.y);
  return Vec3(r * std::cos(phi), r * std::sin(phi), 1 - v);
}

std::vector<double> lobe_irradiance(LobeKind kind, double s) {
  const int count = moments_needed(float(s));
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

std::vector<Lobe> even_lobes(int count) {
  std::vector<Lobe> lobes;
  for (Vec3 axis : even_directions(count)) lobes.push_back({axis, 0.15f * float(count)});
  return lobes;
}

DirectionalBasis make_directional_basis(int sh_order, LobeKind kind, std::vector<Lobe> lobes, double cutoff) {
  LAMBENT_CHECK(sh_order >= 0 && sh_order <= max_sh_order && (sh_order > 0 || !lobes.empty()));
  float sharpest = 0;
  for (const Lobe& lobe : lobes) {
    sharpest = std::max(sharpest, lobe.sharpness);
    LAMBENT_CHECK(is_lobe(kind, lobe));
  }
  DirectionalBasis basis{sh_order, kind, std::move(lobes), {}, {}, 0, 1};
  const size_t n = basis.count(), harmonics = size_t(sh_count(sh_order));
  basis.gram.assign(n * n, 0.0);
  auto set = [&](size_t i, size_t j, double value) { basis.gram[i * n + j] = basis.gram[j * n + i] = value; };
  for (size_t i = 0; i < harmonics; ++i) set(i, i, 1);
  std::vector<std::vector<double>> I;
  if (kind == LobeKind::cosine_power)
    for (const Lobe& lobe : basis.lobes) I.push_back(moments(kind, lobe.sharpness, moments_needed(sharpest)));
  else I.resize(basis.lobes.size());
  std::vector<double> projected(harmonics);
  for (size_t p = 0; p < basis.lobes.size(); ++p) {
    const Lobe& lobe = basis.lobes[p];
    if (sh_order > 0) {
      lobe_to_sh(kind, lobe, sh_order, projected);
      for (size_t i = 0; i < harmonics; ++i) set(i, harmonics + p, projected[i]);
    }
    set(harmonics + p, harmonics + p, 1);
    for (size_t q = 0; q < p; ++q) {
      const double scale = lobe_scale(kind, lobe.sharpness) * lobe_scale(kind, basis.lobes[q].sharpness);
      set(harmonics + p, harmonics + q, scale * lobe_product(kind, lobe, basis.lobes[q], I[p], I[q]));
    }
  }
  PseudoInverse inverse = pseudo_inverse(basis.gram, int(n), cutoff);
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

}  // namespace lambent
