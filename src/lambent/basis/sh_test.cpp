#include <lambent/basis/sh.h>
#include <lambent/basis/sh_convert.h>
#include <lambent/basis/sh_fixed.h>
#include <lambent/core/aligned.h>
#include <lambent/core/random.h>
#include <lambent/core/sampling.h>

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <bit>

namespace lambent {
namespace {

// Float rounding over sums of up to 256 terms of size ~1.
constexpr double float_rounding = 2e-5;

Mat3 skew_rotation(uint64_t seed) {
  Random random(seed);
  return rotation_from_yaw_pitch_roll({360 * random.next(), 180 * random.next() - 90, 360 * random.next()});
}

std::vector<float> asymmetric_coefficients(int order, uint64_t seed = 7) {
  Random random(seed);
  std::vector<float> c(size_t(sh_count(order)));
  for (float& x : c) x = 2 * random.next() - 1;
  return c;
}

TEST(Sh, LowBandsAreTheKnownPolynomials) {
  Vec3d d = normalize(Vec3d(0.3, -0.7, 0.55));
  double y[9];
  evaluate_sh(3, d, y);
  const double k0 = 0.28209479177387814, k1 = 0.48860251190291992, k2 = 1.0925484305920792, k20 = 0.31539156525252005,
               k22 = 0.54627421529603959;
  const double expected[9] = {k0,
                              -k1 * d.y,
                              k1 * d.z,
                              -k1 * d.x,
                              k2 * d.x * d.y,
                              -k2 * d.y * d.z,
                              k20 * (3 * d.z * d.z - 1),
                              -k2 * d.x * d.z,
                              k22 * (d.x * d.x - d.y * d.y)};
  for (int i = 0; i < 9; ++i) EXPECT_NEAR(y[i], expected[i], 1e-14) << i;
}

// No symmetry, and the poles, the axes, the equator and zeros of either sign.
std::vector<Vec3> awkward_directions() {
  std::vector<Vec3> all{{0, 0, 1},     {0, 0, -1},     {1, 0, 0},     {-1, 0, 0},       {0, 1, 0},           {0, -1, 0},
                        {-0.0f, 0, 1}, {0, -0.0f, -1}, {1, -0.0f, 0}, {0.6f, -0.8f, 0}, {-0.8f, 0.6f, -0.0f}};
  for (uint32_t k = 0; k < 32; ++k) all.push_back(square_to_sphere(sobol_owen(k, 23)));
  return all;
}

// The recurrence as a loop: what every faster form must equal to the last bit.
template <class T>
std::vector<T> plain_harmonics(int order, Vector<T, 3> d) {
  std::vector<T> out(size_t(sh_count(order)));
  const ShTables& t = sh_tables();
  T c = 1, s = 0;
  for (int m = 0; m < order; ++m) {
    T q1 = T(t.diagonal[m]), q2 = 0;
    for (int l = m; l < order; ++l) {
      if (l > m) {
        const T q = d.z * T(t.a[l][m]) * q1 + T(t.b[l][m]) * q2;
        q2 = q1, q1 = q;
      }
      out[size_t(sh_index(l, m))] = q1 * c;
      if (m > 0) out[size_t(sh_index(l, -m))] = q1 * s;
    }
    const T next = c * d.x - s * d.y;
    s = c * d.y + s * d.x, c = next;
  }
  return out;
}
template <class T>
bool same_bits(T a, T b) {
  using Bits = std::conditional_t<sizeof(T) == 4, uint32_t, uint64_t>;
  return (a == 0 && b == 0) || std::bit_cast<Bits>(a) == std::bit_cast<Bits>(b);
}

TEST(Sh, TablesAreRoundedAsSquareRootsAre) {
  const ShTables& t = sh_tables();
  double q = std::sqrt(1 / (4 * std::numbers::pi));
  for (int m = 0; m < max_sh_order; ++m) {
    EXPECT_EQ(t.diagonal[m], q * (m > 0 ? std::numbers::sqrt2 : 1.0) * (m % 2 ? -1.0 : 1.0)) << m;
    q *= std::sqrt((2.0 * m + 3) / (2.0 * m + 2));
    for (int l = m + 1; l < max_sh_order; ++l) {
      const double l2 = double(l) * l, m2 = double(m) * m, k = double(l - 1) * (l - 1);
      EXPECT_EQ(t.a[l][m], std::sqrt((4 * l2 - 1) / (l2 - m2))) << l << " " << m;
      if (l > m + 1) {
        EXPECT_EQ(t.b[l][m], -std::sqrt((2.0 * l + 1) * (k - m2) / ((2.0 * l - 3) * (l2 - m2))));
      }
    }
  }
}

TEST(Sh, AgreesWithAssociatedLegendreFunctionsInDouble) {
  // Values from the standard library's P_l^m (which has no Condon-Shortley sign) and angles.
  for (Vec3 single : awkward_directions()) {
    const Vec3d d = normalize(Vec3d(single));
    const double theta = std::acos(std::clamp(d.z, -1.0, 1.0)), phi = std::atan2(d.y, d.x);
    std::vector<double> exact(size_t(sh_count(max_sh_order)));
    std::vector<float> rounded(exact.size());
    evaluate_sh(max_sh_order, d, exact), evaluate_sh(max_sh_order, Vec3(d), rounded);
    for (int l = 0; l < max_sh_order; ++l)
      for (int m = -l; m <= l; ++m) {
        const unsigned k = unsigned(std::abs(m));
        const double legendre = std::sph_legendre(unsigned(l), k, theta);  // with its (-1)^m
        const double y = m == 0 ? legendre
                       : m > 0  ? std::numbers::sqrt2 * legendre * std::cos(k * phi)
                                : std::numbers::sqrt2 * legendre * std::sin(k * phi);
        const size_t i = size_t(sh_index(l, m));
        ASSERT_NEAR(exact[i], y, 1e-7) << l << " " << m;  // acos next to the poles
        ASSERT_NEAR(rounded[i], exact[i], float_rounding) << l << " " << m;
      }
  }
}

TEST(Sh, EveryOrderGivesTheBitsOfTheLoop) {
  for (int order = 0; order <= max_sh_order; ++order)
    for (Vec3 d : awkward_directions()) {
      const size_t count = size_t(sh_count(order));
      std::vector<float> y(count + 1, 7);
      std::vector<double> exact(count + 1, 7);
      evaluate_sh(order, d, std::span(y)), evaluate_sh(order, Vec3d(d), std::span(exact));
      const auto plain = plain_harmonics<float>(order, d);
      const auto plain_exact = plain_harmonics<double>(order, Vec3d(d));
      for (size_t i = 0; i < count; ++i) {
        ASSERT_TRUE(same_bits(y[i], plain[i])) << order << " " << i << ": " << y[i] << " " << plain[i];
        ASSERT_TRUE(same_bits(exact[i], plain_exact[i])) << order << " " << i;
      }
      EXPECT_EQ(y[count], 7) << "nothing is written beyond the last";
      EXPECT_EQ(exact[count], 7);
    }
}

template <int order>
void inlined_as_called() {
  constexpr size_t count = size_t(sh_count(order));
  for (Vec3 d : awkward_directions()) {
    float y[count + 1], called[count];
    double exact[count + 1], exact_called[count];
    y[count] = 7, exact[count] = 7;
    evaluate_sh<order>(d, std::span<float, count>(y, count)), evaluate_sh(order, d, called);
    evaluate_sh<order>(Vec3d(d), std::span<double, count>(exact, count)), evaluate_sh(order, Vec3d(d), exact_called);
    for (size_t i = 0; i < count; ++i) {
      ASSERT_TRUE(same_bits(y[i], called[i])) << order << " " << i;
      ASSERT_TRUE(same_bits(exact[i], exact_called[i])) << order << " " << i;
    }
    EXPECT_EQ(y[count], 7) << "nothing is written beyond the last";
    EXPECT_EQ(exact[count], 7);
  }
}
TEST(Sh, InlinedGivesTheBitsOfTheCall) {
  inlined_as_called<1>(), inlined_as_called<2>(), inlined_as_called<3>();
  inlined_as_called<4>(), inlined_as_called<5>(), inlined_as_called<6>();
}

TEST(Sh, ManyDirectionsGiveTheBitsOfOneOnEverySimdTarget) {
  const std::vector<Vec3> all = awkward_directions();
  for (int order : {0, 1, 2, 3, 4, 5, 6, 9, 16})
    for (size_t count : {size_t(0), size_t(1), size_t(16), all.size()})
      for (int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        std::vector<float> x, y, z;
        for (size_t i = 0; i < count; ++i) x.push_back(all[i].x), y.push_back(all[i].y), z.push_back(all[i].z);
        const size_t stride = count + 3, values = size_t(sh_count(order));
        std::vector<float> out(values * stride, 7);
        evaluate_sh(order, x, y, z, stride, out);
        hwy::SetSupportedTargetsForTest(0);
        for (size_t i = 0; i < count; ++i) {
          const auto plain = plain_harmonics<float>(order, all[i]);
          for (size_t k = 0; k < values; ++k)
            ASSERT_TRUE(same_bits(out[k * stride + i], plain[k]))
                << hwy::TargetName(target) << " " << order << " " << k;
        }
        for (size_t k = 0; k < values; ++k)
          for (size_t i = count; i < stride; ++i) ASSERT_EQ(out[k * stride + i], 7);
      }
}

TEST(Sh, IsOrthonormalAtEveryOrder) {
  const int order = max_sh_order, n = sh_count(order);
  // Project every harmonic in one pass: the result must be the identity.
  for (int i : {0, 1, 3, 6, 35, 36, 77, 143, 144, 200, n - 1}) {
    std::vector<double> y(static_cast<size_t>(n));
    auto c = project_sh(
        order, [&](Vec3d d) { return evaluate_sh(order, d, y), y[size_t(i)]; }, 2 * order);
    for (int j = 0; j < n; ++j) EXPECT_NEAR(c[size_t(j)], i == j ? 1 : 0, 1e-12) << i << " " << j;
  }
}

TEST(Sh, SatisfiesTheAdditionTheorem) {
  Vec3 a = normalize(Vec3(1, 2, -0.5f));
  float y[sh_count(max_sh_order)];
  evaluate_sh(max_sh_order, a, y);
  for (int l = 0; l < max_sh_order; ++l) {
    double sum = 0;
    for (int m = -l; m <= l; ++m) sum += double(y[sh_index(l, m)]) * y[sh_index(l, m)];
    EXPECT_NEAR(sum, (2 * l + 1) / (4 * pi), (2 * l + 1) * float_rounding);
  }
}

TEST(Sh, ProjectsAndReconstructsABandLimitedFunction) {
  for (int order = 1; order <= max_sh_order; ++order) {
    auto c = asymmetric_coefficients(order);
    auto back = project_sh(
        order, [&](Vec3d d) { return reconstruct_sh(c, Vec3(d)); }, 2 * order);
    for (size_t i = 0; i < c.size(); ++i) EXPECT_NEAR(back[i], c[i], 10 * float_rounding);
  }
}

TEST(Sh, RotationAgreesWithResampling) {
  for (int order : {1, 2, 3, 6, 9, 12, 16})
    for (uint64_t seed = 1; seed <= 5; ++seed) {
      Mat3 R = skew_rotation(seed);
      auto c = asymmetric_coefficients(order, seed);
      std::vector<float> turned(c.size());
      rotate_sh(make_sh_rotation(order, R), c, turned);
      for (int k = 0; k < 20; ++k) {
        Vec3 s = square_to_sphere(sobol_owen(uint32_t(k), 3));
        EXPECT_NEAR(reconstruct_sh(turned, s), reconstruct_sh(c, transpose(R) * s), order * order * float_rounding);
      }
    }
}

TEST(Sh, ZyzRotatorAgreesWithDenseBlocks) {
  for (int order : {1, 4, 6, 12, 16}) {
    float a = 0.7f, b = 1.9f, g = -2.3f;
    auto Rz = [](float t) {
      return Mat3(Vec3(std::cos(t), std::sin(t), 0), Vec3(-std::sin(t), std::cos(t), 0), Vec3(0, 0, 1));
    };
    auto Ry = [](float t) {
      return Mat3(Vec3(std::cos(t), 0, -std::sin(t)), Vec3(0, 1, 0), Vec3(std::sin(t), 0, std::cos(t)));
    };
    auto c = asymmetric_coefficients(order);
    std::vector<float> expected(c.size());
    rotate_sh(make_sh_rotation(order, Rz(a) * Ry(b) * Rz(g)), c, expected);
    ShZyzRotator(order).rotate(a, b, g, c);
    for (size_t i = 0; i < c.size(); ++i) EXPECT_NEAR(c[i], expected[i], 2 * order * float_rounding);
  }
}

TEST(Sh, RotatesLinearBandAsAVector) {
  // The linear part of a function points along (-f11, -f1-1, f10).
  Mat3 R = skew_rotation(11);
  Vec3 v = normalize(Vec3(0.2f, -0.9f, 0.4f)), w = R * v;
  std::vector<float> c{0, -v.y, v.z, -v.x}, turned(4);
  rotate_sh(make_sh_rotation(2, R), c, turned);
  EXPECT_NEAR(-turned[3], w.x, 1e-6);
  EXPECT_NEAR(-turned[1], w.y, 1e-6);
  EXPECT_NEAR(turned[2], w.z, 1e-6);
}

TEST(Sh, ClampedCosineMatchesQuadrature) {
  const double known[] = {
      std::numbers::pi,     2 * std::numbers::pi / 3, std::numbers::pi / 4, 0, -std::numbers::pi / 24, 0,
      std::numbers::pi / 64};
  for (int l = 0; l < 7; ++l) EXPECT_NEAR(clamped_cosine(l), known[l], 1e-14);
  // The kink at the horizon limits the quadrature: 400 nodes leave about 1e-4.
  auto c = project_sh(
      12, [](Vec3d d) { return std::max(0.0, d.z); }, 400);
  for (int l = 0; l < 12; ++l)
    EXPECT_NEAR(c[size_t(sh_index(l, 0))], clamped_cosine(l) * std::sqrt((2 * l + 1) / (4 * std::numbers::pi)), 1e-4)
        << l;
}

TEST(ShWindow, FixedWindowsFallFromOne) {
  for (ShWindow kind : {ShWindow::hann, ShWindow::lanczos}) {
    auto w = sh_window(kind, 6);
    EXPECT_EQ(w[0], 1.0f);
    for (size_t l = 1; l < w.size(); ++l) {
      EXPECT_LT(w[l], w[l - 1]);
      EXPECT_GT(w[l], 0);
    }
  }
  EXPECT_NEAR(sh_window(ShWindow::hann, 6)[3], 0.5f, 1e-6);
  EXPECT_NEAR(sh_window(ShWindow::lanczos, 6)[3], 2 / pi, 1e-6);
}

TEST(ShWindow, AutomaticLiftsNegativeIrradianceAndLeavesSmoothLightAlone) {
  // A delta light's order-6 irradiance dips below zero.
  Vec3 sun = normalize(Vec3(0.4f, 0.8f, -0.2f));
  std::vector<float> y(36);
  evaluate_sh(6, sun, y);
  std::vector<Vec3> light;
  for (float v : y) light.push_back(Vec3(v, 0.8f * v, 0.5f * v));
  auto irradiance_min = [](std::span<const Vec3> c) {
    float lowest = INFINITY;
    std::vector<Vec3> e(c.begin(), c.end());
    for (size_t i = 0; i < e.size(); ++i) e[i] *= float(clamped_cosine(sh_band(int(i))));
    for (uint32_t k = 0; k < 4000; ++k)
      lowest = std::min(lowest, luminance(reconstruct_sh(e, square_to_sphere(sobol_owen(k, 1)))));
    return lowest;
  };
  ASSERT_LT(irradiance_min(light), -0.01f);
  auto w = apply_sh_window(ShWindow::automatic, light);
  EXPECT_GT(irradiance_min(light), -1e-3f);
  EXPECT_GT(w[1], 0.5f);  // no stronger than it has to be

  std::vector<Vec3> smooth(36, Vec3(0.0f));
  smooth[0] = Vec3(1), smooth[2] = Vec3(0.2f);
  for (float f : apply_sh_window(ShWindow::automatic, smooth)) EXPECT_EQ(f, 1.0f);
}

TEST(ShConvert, ScalesAsTheTablesSay) {
  std::vector<Vec3> light(9, Vec3(1.0f));
  auto three = convert_sh(light, ShConvention::three);
  const float sign[9] = {1, -1, 1, -1, 1, -1, 1, -1, 1};
  for (size_t i = 0; i < 9; ++i) EXPECT_EQ(three[i].x, sign[i]) << i;
  auto unity = convert_sh(light, ShConvention::unity);
  const float unity_scale[9] = {0.282095f, 0.325735f, 0.325735f, 0.325735f, 0.273137f,
                                0.273137f, 0.078848f, 0.273137f, 0.136569f};
  for (size_t i = 0; i < 9; ++i) EXPECT_NEAR(unity[i].x, sign[i] * unity_scale[i], 2e-6) << i;
  // Constant white radiance 1 has the single coefficient sqrt(4 pi); Unity's first coefficient is then 1.
  EXPECT_NEAR(convert_sh(std::vector<Vec3>{Vec3(std::sqrt(4 * pi))}, ShConvention::unity)[0].x, 1.0f, 1e-6);
  EXPECT_NEAR(convert_sh(light, ShConvention::godot)[2].x, 1 / pi, 1e-6);
  EXPECT_NEAR(convert_sh(light, ShConvention::gltf_ibl)[6].x, pi / 4, 1e-6);
}

TEST(ShConvert, MirrorsFunctions) {
  for (int order : {3, 8}) {
    auto c = asymmetric_coefficients(order);
    std::vector<Vec3> light;
    for (float x : c) light.push_back(Vec3(x));
    auto mx = mirror_sh_x(light), mz = mirror_sh_z(light);
    for (uint32_t k = 0; k < 20; ++k) {
      Vec3 s = square_to_sphere(sobol_owen(k, 5));
      float tolerance = float(order * order * float_rounding);
      EXPECT_NEAR(reconstruct_sh(mx, s).x, reconstruct_sh(light, Vec3(-s.x, s.y, s.z)).x, tolerance);
      EXPECT_NEAR(reconstruct_sh(mz, s).x, reconstruct_sh(light, Vec3(s.x, s.y, -s.z)).x, tolerance);
    }
  }
}

}  // namespace
}  // namespace lambent
