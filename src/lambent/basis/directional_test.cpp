#include <lambent/basis/directional.h>
#include <lambent/basis/quadrature.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

// Double rounding, magnified by condition numbers of up to some thousand, and quadrature with 96 nodes across the edge
// of a cosine lobe at 90 degrees, where its s-th derivative jumps: s >= 9 here. At the edge of compact ones the third
// does.
constexpr double tolerance = 1e-8;
double tolerance_of(const DirectionalBasis& basis) { return basis.kind == LobeKind::compact ? 2e-6 : tolerance; }

std::vector<Lobe> uneven_lobes(int count, float least, float most) {
  std::vector<Lobe> lobes;
  for (Vec3 axis : even_directions(count))
    lobes.push_back({axis, least + (most - least) * float(lobes.size()) / float(count)});
  return lobes;
}

std::vector<DirectionalBasis> bases() {
  return {make_directional_basis(0, LobeKind::von_mises_fisher, uneven_lobes(20, 8, 12)),
          make_directional_basis(0, LobeKind::cosine_power, uneven_lobes(20, 9, 12)),
          make_directional_basis(4, LobeKind::von_mises_fisher, uneven_lobes(5, 20, 60)),
          make_directional_basis(3, LobeKind::cosine_power, uneven_lobes(4, 16, 30)),
          make_directional_basis(5, LobeKind::cosine_power, {}),
          make_directional_basis(0, LobeKind::compact, even_lobes(24, LobeKind::compact)),
          make_directional_basis(3, LobeKind::compact, uneven_lobes(4, 9, 16)),
          make_directional_basis(0, LobeKind::band_limited, steerable_lobes(5)),
          make_directional_basis(2, LobeKind::band_limited, {{Vec3(0, 1, 0), 6}, {Vec3(1, 0, 0), 7}})};
}

TEST(Directional, DirectionsAreSpreadEvenly) {
  const auto directions = even_directions(200);
  Vec3 mean(0.0f);
  double nearest = 4, second[3] = {};
  for (size_t i = 0; i < directions.size(); ++i) {
    mean += directions[i] / 200.0f;
    for (int c = 0; c < 3; ++c) second[c] += double(directions[i][c]) * directions[i][c] / 200;
    for (size_t j = 0; j < i; ++j) nearest = std::min(nearest, double(distance(directions[i], directions[j])));
  }
  EXPECT_LT(length(mean), 0.01f);
  for (double s : second) EXPECT_NEAR(s, 1.0 / 3, 0.005);
  EXPECT_GT(nearest, 0.75 * std::sqrt(4 * std::numbers::pi / 200));  // against the side of a square of equal share
}

TEST(Directional, GramMatrixIsTheIntegralOfProducts) {
  for (const DirectionalBasis& basis : bases()) {
    const size_t n = basis.count();
    std::vector<double> gram(n * n), values(n);
    for (const DirectionNode& node : direction_quadrature(96)) {
      evaluate_directional(basis, node.direction, values);
      for (size_t i = 0; i < n; ++i)
        for (size_t j = 0; j < n; ++j) gram[i * n + j] += node.weight * values[i] * values[j];
    }
    for (size_t i = 0; i < n * n; ++i)
      EXPECT_NEAR(gram[i], basis.gram[i], tolerance_of(basis)) << i / n << " " << i % n;
  }
}

TEST(Directional, BroadCosineLobesMatchTheirClosedForm) {
  // Of two clamped cosines at an angle c: the integral is 2/3 (sin c + (pi - c) cos c); each has the square 2 pi / 3.
  const double c = 0.9;
  const Vec3 tilted(float(std::sin(c)), 0, float(std::cos(c)));
  const auto basis = make_directional_basis(0, LobeKind::cosine_power, {{Vec3(0, 0, 1), 1}, {tilted, 1}});
  EXPECT_NEAR(basis.gram[1], (std::sin(c) + (std::numbers::pi - c) * std::cos(c)) / std::numbers::pi, 1e-7);
}

TEST(Directional, SharpLobesMatchTheirLimit) {
  // Near its axis cos^s t is exp(-s t^2 / 2); two such at a small angle c overlap by exp(-s c^2 / 4), to a few parts in
  // s.
  const double s = 2e4, c = 0.01;
  const Vec3 tilted(float(std::sin(c)), 0, float(std::cos(c)));
  for (LobeKind kind : {LobeKind::cosine_power, LobeKind::von_mises_fisher}) {
    const auto basis = make_directional_basis(0, kind, {{Vec3(0, 0, 1), float(s)}, {tilted, float(s)}});
    EXPECT_NEAR(basis.gram[1], std::exp(-s * c * c / 4), 5 / s);
  }
}

TEST(Directional, DualsAreBiorthogonal) {
  for (const DirectionalBasis& basis : bases()) {
    const size_t n = basis.count();
    EXPECT_EQ(basis.rank, int(n));
    std::vector<double> products(n * n), values(n), duals(n);
    for (const DirectionNode& node : direction_quadrature(96)) {
      evaluate_directional(basis, node.direction, values);
      evaluate_directional_dual(basis, node.direction, duals);
      for (size_t i = 0; i < n; ++i)
        for (size_t j = 0; j < n; ++j) products[i * n + j] += node.weight * duals[i] * values[j];
    }
    for (size_t i = 0; i < n; ++i)
      for (size_t j = 0; j < n; ++j)
        EXPECT_NEAR(products[i * n + j], i == j ? 1 : 0, 5 * tolerance_of(basis)) << i << " " << j;
  }
}

TEST(Directional, ReproducesTheSpan) {
  for (const DirectionalBasis& basis : bases()) {
    Random random(3);
    std::vector<double> c(basis.count());
    for (double& x : c) x = 2 * random.next() - 1;
    const auto again = project_directional(
        basis, [&](Vec3d d) { return reconstruct_directional(basis, c, d); }, 96);
    for (size_t i = 0; i < c.size(); ++i) EXPECT_NEAR(again[i], c[i], 5 * tolerance_of(basis)) << i;
  }
}

// Harmonics alone blur a lamp; with the lamp in the basis the sky stays as good and the lamp becomes exact.
TEST(Directional, HarmonicsAndLampsHoldASkyWithALamp) {
  const Vec3 lamp = normalize(Vec3(0.3f, -0.5f, 0.8f));
  const auto mixed = make_directional_basis(4, LobeKind::von_mises_fisher, {{lamp, 200}});
  auto sky = [&](Vec3d d) {
    return 1 + 0.5 * d.z - 0.3 * d.x * d.y + 30 * std::exp(200 * (dot(normalize(Vec3d(lamp)), d) - 1));
  };
  const auto c = project_directional(mixed, sky), harmonics = project_sh(4, sky);
  double worst = 0, worst_harmonics = 0;
  for (Vec3 v : even_directions(500)) {
    const Vec3d d = normalize(Vec3d(v));
    double y[16], sum = 0;
    evaluate_sh(4, d, y);
    for (size_t i = 0; i < 16; ++i) sum += harmonics[i] * y[i];
    worst = std::max(worst, std::abs(reconstruct_directional(mixed, c, d) - sky(d)));
    worst_harmonics = std::max(worst_harmonics, std::abs(sum - sky(d)));
  }
  EXPECT_LT(worst, 1e-5);
  EXPECT_GT(worst_harmonics, 5);
  // The harmonics' share of it all is what projecting to harmonics gives.
  const auto share = directional_to_sh(mixed, c, 4);
  for (size_t i = 0; i < 16; ++i) EXPECT_NEAR(share[i], harmonics[i], 1e-6) << i;
}

TEST(Directional, EqualLobesShareTheirCoefficient) {
  const Lobe lobe{Vec3(0, 1, 0), 10};
  const auto basis = make_directional_basis(0, LobeKind::von_mises_fisher, {lobe, lobe, {Vec3(1, 0, 0), 10}});
  EXPECT_EQ(basis.rank, 2);
  const auto c = project_directional(basis, [&](Vec3d d) { return std::exp(10 * (d.y - 1)); });
  EXPECT_NEAR(c[0], c[1], tolerance);
  EXPECT_NEAR(c[2], 0, tolerance);
  EXPECT_NEAR(reconstruct_directional(basis, c, Vec3d(0, 1, 0)), 1, 1e-6);
}

TEST(Directional, SamplesHaveTheDensityOfTheLobe) {
  // The mean of y_lm over the samples is its coefficient of the lobe over the lobe's integral. 4,096 stratified points:
  // errors are some 1e-3, and less for sharp lobes.
  constexpr double stratified = 3e-3;
  for (LobeKind kind : {LobeKind::cosine_power, LobeKind::von_mises_fisher, LobeKind::compact})
    for (float s : {1.0f, 5.0f, 80.0f, 1000.0f, 1e5f}) {
      if (!is_lobe(kind, {Vec3(0, 0, 1), s})) continue;
      const auto basis = make_directional_basis(0, kind, {{Vec3(0, 0, 1), s}});
      const std::vector<double> one{1.0}, expected = directional_to_sh(basis, one, 6);
      std::vector<double> mean(36), y(36);
      for (uint32_t i = 0; i < 4096; ++i) {
        const Vec3 d = sample_lobe(kind, s, sobol_owen(i, 7));
        ASSERT_NEAR(length(d), 1, 1e-6);
        evaluate_sh(6, normalize(Vec3d(d)), y);
        for (size_t k = 0; k < 36; ++k) mean[k] += y[k] / 4096;
      }
      for (size_t k = 0; k < 36; ++k)
        EXPECT_NEAR(mean[k], expected[k] / lobe_integral(kind, s), stratified) << int(kind) << " " << s << " " << k;
    }
  // Sharp lobes spread as their limit, a normal distribution of variance 1/s in each direction across.
  double spread = 0;
  for (uint32_t i = 0; i < 4096; ++i) {
    const Vec3 d = sample_lobe(LobeKind::von_mises_fisher, 1e5f, sobol_owen(i, 8));
    spread += double(d.x) * d.x / 4096;
  }
  EXPECT_NEAR(spread * 1e5, 1, 0.02);
}

TEST(Directional, LobesMatchQuadrature) {
  const Vec3 a = normalize(Vec3(0.2f, -0.7f, 0.4f));
  for (LobeKind kind : {LobeKind::cosine_power, LobeKind::von_mises_fisher, LobeKind::compact, LobeKind::band_limited})
    for (float s : {2.0f, 7.0f, 17.0f, 60.0f}) {
      if (!is_lobe(kind, {a, s})) continue;
      double integral = 0, square = 0;
      for (const DirectionNode& node : direction_quadrature(128)) {
        const double value = lobe_scale(kind, s) * lobe_value(kind, s, dot(normalize(Vec3d(a)), node.direction));
        integral += node.weight * value, square += node.weight * value * value;
      }
      constexpr double edge = 1e-5;  // of a squared cosine at 90 degrees, where its second derivative jumps
      EXPECT_NEAR(integral, lobe_integral(kind, s), edge) << s;
      EXPECT_NEAR(square, 1, edge) << s;
      const auto series = lobe_irradiance(kind, s);
      for (double x : {-0.97, -0.4, -0.05, 0.0, 0.1, 0.6, 1.0}) {
        // The zone above the plane alone, so that the cosine's kink is no node's business.
        const Vec3d axis(std::sqrt(1 - x * x) * 0.6, std::sqrt(1 - x * x) * 0.8, x);
        double irradiance = 0;
        for (const DirectionNode& node : direction_quadrature(128, 0, 1))
          irradiance += node.weight * node.direction.z * lobe_scale(kind, s) *
                        lobe_value(kind, s, dot(axis, node.direction));
        EXPECT_NEAR(evaluate_legendre(series, x), irradiance, edge) << int(kind) << " " << s << " " << x;
      }
    }
  // The sharpest is as good as a beam.
  const auto beam = lobe_irradiance(LobeKind::von_mises_fisher, max_sharpness);
  const double strength = lobe_integral(LobeKind::von_mises_fisher, max_sharpness);
  for (double x : {-0.5, -0.05, 0.05, 0.3, 0.9})
    EXPECT_NEAR(evaluate_legendre(beam, x) / strength, std::max(0.0, x), 1e-4) << x;
}

TEST(Directional, OverlapIsTheGramMatrix) {
  for (LobeKind kind :
       {LobeKind::cosine_power, LobeKind::von_mises_fisher, LobeKind::compact, LobeKind::band_limited}) {
    const bool bands = kind == LobeKind::band_limited;
    const Lobe a{Vec3(0, 0, 1), bands ? 5.0f : 30.0f}, b{normalize(Vec3(0.1f, 0.2f, 1)), bands ? 7.0f : 50.0f};
    EXPECT_NEAR(lobe_overlap(kind, a, b), make_directional_basis(0, kind, {a, b}).gram[1], 1e-12);
    EXPECT_NEAR(lobe_overlap(kind, a, a), 1, 1e-9);
  }
}

// Root of the mean squared error with which random functions of `order` bands are projected onto COUNT lobes, as a
// share of their norm: 1 - tr(G^-1 Q) / order^2, where Q sums the products of the lobes' coefficients. `dual` gets the
// greatest norm of a dual.
double misfit(LobeKind kind, int count, float factor, int order, double& dual) {
  std::vector<Lobe> lobes = even_lobes(count, kind);
  for (Lobe& lobe : lobes) lobe.sharpness *= factor;
  const auto basis = make_directional_basis(0, kind, lobes);
  std::vector<std::vector<double>> sh;
  for (size_t k = 0; k < size_t(count); ++k) {
    std::vector<double> unit(size_t(count), 0.0);
    unit[k] = 1;
    sh.push_back(directional_to_sh(basis, unit, order));
  }
  double caught = 0;
  dual = 0;
  for (size_t i = 0; i < size_t(count); ++i) {
    dual = std::max(dual, std::sqrt(basis.dual[i * size_t(count) + i]));
    for (size_t j = 0; j < size_t(count); ++j)
      for (size_t k = 0; k < sh[i].size(); ++k) caught += basis.dual[i * size_t(count) + j] * sh[i][k] * sh[j][k];
  }
  return std::sqrt(std::max(0.0, 1 - caught / sh_count(order)));
}

TEST(Directional, EvenLobesSuitSmoothFunctions) {
  // Half the bands that as many harmonics would hold are held to a few percent; twice as sharp leaves gaps, and half as
  // sharp makes the duals several times larger.
  for (LobeKind kind : {LobeKind::von_mises_fisher, LobeKind::compact})
    for (int count : {25, 36, 64, 144}) {
      const int order = int(std::sqrt(count)) / 2;
      double dual = 0, dual_sharp = 0, dual_broad = 0;
      const double error = misfit(kind, count, 1, order, dual), sharp = misfit(kind, count, 2, order, dual_sharp);
      misfit(kind, count, 0.5f, order, dual_broad);
      EXPECT_LT(error, 0.03) << count;
      EXPECT_GT(sharp, 3 * error) << count;
      EXPECT_LT(dual, 6) << count;
      EXPECT_GT(dual_broad, 4 * dual) << count;
    }
}

TEST(Directional, CompactLobesThatDoNotMeetAreOrthogonal) {
  const Lobe a{Vec3(0, 0, 1), 12};  // to 41.4 degrees
  const double reach = lobe_reach(LobeKind::compact, 12);
  EXPECT_NEAR(reach, std::acos(0.75), 1e-12);
  EXPECT_EQ(lobe_value(LobeKind::compact, 12, std::cos(reach + 1e-9)), 0);
  EXPECT_GT(lobe_value(LobeKind::compact, 12, std::cos(reach - 1e-3)), 0);
  auto overlap = [&](double angle) {
    return lobe_overlap(LobeKind::compact, a, {Vec3(float(std::sin(angle)), 0, float(std::cos(angle))), 12});
  };
  EXPECT_EQ(overlap(2.001 * reach), 0);
  EXPECT_GT(overlap(1.7 * reach), 1e-6);
  EXPECT_GT(overlap(1.9 * reach), 0);
  EXPECT_LT(overlap(1.9 * reach), 1e-6);
  EXPECT_FALSE(is_lobe(LobeKind::compact, {Vec3(0, 0, 1), 1.4f}));
  EXPECT_FALSE(is_lobe(LobeKind::compact, {Vec3(0, 0, 1), 1025}));
  for (float s : {0.0f, 2.5f, 17.0f, NAN}) EXPECT_FALSE(is_lobe(LobeKind::band_limited, {Vec3(0, 0, 1), s})) << s;
}

std::vector<double> uneven_coefficients(size_t count) {
  Random random(11);
  std::vector<double> c(count);
  for (double& x : c) x = 2 * random.next() - 1;
  return c;
}

TEST(Directional, SteerableLobesSpanTheirBands) {
  for (int bands : {1, 2, 3, 6, 9, 16}) {
    const auto basis = make_directional_basis(0, LobeKind::band_limited, steerable_lobes(bands));
    EXPECT_EQ(basis.rank, sh_count(bands));
    EXPECT_LT(basis.condition, 26) << bands;
    // Any function of the bands comes back, from its integrals against the lobes.
    const std::vector<double> sh = uneven_coefficients(size_t(sh_count(bands)));
    std::vector<double> integrals;
    for (size_t k = 0; k < basis.count(); ++k) {
      std::vector<double> unit(basis.count(), 0.0);
      unit[k] = 1;
      const std::vector<double> of_lobe = directional_to_sh(basis, unit, bands);
      integrals.push_back(0);
      for (size_t i = 0; i < sh.size(); ++i) integrals.back() += sh[i] * of_lobe[i];
    }
    const std::vector<double> again = directional_to_sh(basis, apply_directional_dual(basis, integrals), bands);
    for (size_t i = 0; i < sh.size(); ++i) EXPECT_NEAR(again[i], sh[i], 1e-10) << bands << " " << i;
  }
}

// Of the turned function less what its coefficients make up, by quadrature.
double lost_by_quadrature(const DirectionalBasis& basis, std::span<const double> c, const TurnedCoefficients& turned,
                          const Mat3& R) {
  double sum = 0;
  for (const DirectionNode& node : direction_quadrature(96)) {
    const double was = reconstruct_directional(basis, c, transpose(Mat3d(R)) * node.direction),
                 is = reconstruct_directional(basis, turned.coefficients, node.direction);
    sum += node.weight * (was - is) * (was - is);
  }
  return sum;
}

TEST(Directional, SteerableLobesTurnExactlyAndOthersTellWhatTheyLose) {
  const Mat3 R = rotation_from_yaw_pitch_roll({40, 25, -70});
  for (const DirectionalBasis& basis : bases()) {
    const std::vector<double> c = uneven_coefficients(basis.count());
    const TurnedCoefficients turned = turn_directional(basis, c, R);
    const bool exact = basis.lobes.empty() || (basis.kind == LobeKind::band_limited && basis.sh_order == 0);
    double all = 0;
    for (size_t i = 0; i < c.size(); ++i)
      for (size_t j = 0; j < c.size(); ++j) all += c[i] * basis.gram[i * c.size() + j] * c[j];
    // A rotation has the rounding of floats.
    if (exact) EXPECT_LT(turned.lost, 1e-6 * all);
    else EXPECT_GT(turned.lost, 1e-3 * all);
    EXPECT_NEAR(turned.lost, lost_by_quadrature(basis, c, turned, R), 1e-5 * all) << int(basis.kind);
  }
}

// Of one lobe beside harmonics: h are its harmonics about z, o what the moved lobe and the one that stands have in
// common. Fitting takes the harmonics' part whole, and of the rest what lies along the rest of the lobe that stands.
TEST(Directional, ALampThatMovesLosesWhatTheClosedFormSays) {
  const Vec3 still(0, 1, 0);
  for (int order : {2, 5})
    for (double s : {6.0, 80.0, 3000.0})
      for (double angle : {0.0, 0.02, 0.15, 0.7, 2.5}) {
        const auto basis = make_directional_basis(order, LobeKind::von_mises_fisher, {{still, float(s)}});
        std::vector<double> lamp(basis.count());
        lamp.back() = 1;
        const Vec3 there(float(std::sin(angle)), float(std::cos(angle)), 0);
        const MovedCoefficients moved = move_directional(basis, lamp, Mat3(1.0f), {&there, 1});
        const double c = std::cos(angle), scale2 = 2 * s / (2 * std::numbers::pi * -std::expm1(-4 * s));
        double all = 0, apart = 0;
        for (int l = 0; l < order; ++l) {
          double I = 0;
          for (const QuadratureNode& node : gauss_legendre(400, -1, 1))
            I += node.weight * std::exp(s * (node.x - 1)) * std::legendre(unsigned(l), node.x);
          const double power = scale2 * std::numbers::pi * (2 * l + 1) * I * I;
          all += power, apart += power * std::legendre(unsigned(l), c);
        }
        const double k = s * std::sqrt(2 + 2 * c),
                     common = scale2 * 2 * std::numbers::pi * (std::exp(k - 2 * s) - std::exp(-k - 2 * s)) / k;
        const double held = all + (common - apart) * (common - apart) / (1 - all);
        EXPECT_NEAR(moved.whole, 1, 1e-9);
        EXPECT_NEAR(moved.lost, 1 - held, 2e-5) << order << " " << s << " " << angle;  // axes are floats
      }
}

// Harmonics turned, each lobe elsewhere.
TEST(Directional, LampsThatMoveApartTellWhatTheyLose) {
  const Mat3 R = rotation_from_yaw_pitch_roll({40, 25, -70});
  for (const DirectionalBasis& basis : bases()) {
    if (basis.lobes.empty() || basis.kind == LobeKind::band_limited) continue;
    const std::vector<double> c = uneven_coefficients(basis.count());
    std::vector<Vec3> axes;
    std::vector<Lobe> there = basis.lobes;
    for (size_t k = 0; k < there.size(); ++k)
      axes.push_back(there[k].axis = normalize(there[k].axis + 0.2f * Vec3(float(k % 3) - 1, 0.4f, float(k % 2))));
    const MovedCoefficients moved = move_directional(basis, c, R, axes);
    const DirectionalBasis elsewhere = make_directional_basis(basis.sh_order, basis.kind, there);
    const size_t harmonics = size_t(sh_count(basis.sh_order));
    std::vector<double> sky(c), lamps(c);
    std::fill(sky.begin() + ptrdiff_t(harmonics), sky.end(), 0), std::fill_n(lamps.begin(), harmonics, 0);
    double lost = 0, whole = 0;
    for (const DirectionNode& node : direction_quadrature(96)) {
      const double is = reconstruct_directional(elsewhere, lamps, node.direction) +
                        reconstruct_directional(basis, sky, transpose(Mat3d(R)) * node.direction),
                   fit = reconstruct_directional(basis, moved.coefficients, node.direction);
      lost += node.weight * (is - fit) * (is - fit), whole += node.weight * is * is;
    }
    EXPECT_NEAR(moved.lost, lost, 1e-5 * whole) << int(basis.kind);
    EXPECT_NEAR(moved.whole, whole, 1e-5 * whole) << int(basis.kind);
    EXPECT_GT(lost, 1e-3 * whole);
  }
}

}  // namespace
}  // namespace lambent
