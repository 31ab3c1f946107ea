#include <lambent/basis/sh_rotation_zyz-inl.h>
#include <lambent/basis/sh_rotation_zyz.h>
#include <lambent/core/random.h>

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <array>

namespace lambent {
namespace {

// Float rounding over a few sums of up to 31 terms of size ~1, angles multiplied up to 15 times.
constexpr double float_rounding = 1e-5;
// The same in double.
constexpr double double_rounding = 1e-13;

std::vector<float> random_coefficients(int order, uint64_t seed = 5) {
  Random random(seed);
  std::vector<float> c(size_t(sh_count(order)));
  for (float& x : c) x = 2 * random.next() - 1;
  return c;
}

Mat3d about_z(double t) {
  return {Vec3d(std::cos(t), std::sin(t), 0), Vec3d(-std::sin(t), std::cos(t), 0), Vec3d(0, 0, 1)};
}
Mat3d about_y(double t) {
  return {Vec3d(std::cos(t), 0, -std::sin(t)), Vec3d(0, 1, 0), Vec3d(std::sin(t), 0, std::cos(t))};
}

// Skew ones, and those where Euler angles are awkward: the identity, half turns, b next to 0 and 180 degrees.
std::vector<Mat3d> rotations() {
  std::vector<Mat3d> all{Mat3d(1.0),
                         about_z(1.1),
                         about_y(std::numbers::pi),
                         about_y(std::numbers::pi) * about_z(0.7),
                         about_y(std::numbers::pi / 2),
                         about_z(-2.0) * about_y(-1.2) * about_z(0.3)};
  for (double b : {1e-3, 1e-5, 3e-8, 1e-20, std::numbers::pi - 1e-5})
    all.push_back(about_z(0.8) * about_y(b) * about_z(-2.3));
  Random random(11);
  for (int i = 0; i < 8; ++i) {
    const double a = 6.28 * random.next(), b = 3.14 * random.next(), c = 6.28 * random.next();
    all.push_back(about_z(a) * about_y(b) * about_z(c));
  }
  return all;
}

TEST(ShRotationZyz, EulerAnglesGiveTheMatrixBack) {
  for (const Mat3d& R : rotations()) {
    const EulerZyz e = euler_zyz(Mat3(R));
    const double a = std::atan2(e.sin_a, e.cos_a), b = std::atan2(e.sin_b, e.cos_b), c = std::atan2(e.sin_c, e.cos_c);
    const Mat3d again = about_z(a) * about_y(b) * about_z(c);
    EXPECT_NEAR(double(e.sin_c) * e.sin_c + double(e.cos_c) * e.cos_c, 1, float_rounding);
    EXPECT_GE(e.sin_b, 0);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) EXPECT_NEAR(again[i][j], R[i][j], float_rounding) << i << j;
  }
}

TEST(ShRotationZyz, AgreesWithTheDenseRotationAtEveryOrderAndSimdTarget) {
  for (int order = 1; order <= max_sh_order; ++order)
    for (const Mat3d& R : rotations()) {
      const std::vector<float> f = random_coefficients(order);
      std::vector<float> dense(f.size());
      rotate_sh(make_sh_rotation(order, Mat3(R)), f, dense);
      for (int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        std::vector<float> fast = f;
        rotate_sh_zyz(Mat3(R), fast, fast);  // in place
        hwy::SetSupportedTargetsForTest(0);
        for (size_t i = 0; i < f.size(); ++i)
          ASSERT_NEAR(fast[i], dense[i], float_rounding)
              << hwy::TargetName(target) << " order " << order << " coefficient " << i;
      }
    }
}

TEST(ShRotationZyz, AgreesWithResampling) {
  const int order = 7;
  const std::vector<float> f = random_coefficients(order);
  const Mat3d R = rotations().back(), back = transpose(R);
  const auto expected = project_sh(
      order,
      [&](Vec3d d) {
        double y[sh_count(order)], sum = 0;
        evaluate_sh(order, back * d, y);
        for (size_t i = 0; i < f.size(); ++i) sum += f[i] * y[i];
        return sum;
      },
      order);
  std::vector<float> fast(f.size());
  rotate_sh_zyz(Mat3(R), f, fast);
  for (size_t i = 0; i < f.size(); ++i) EXPECT_NEAR(fast[i], expected[i], float_rounding) << i;
}

TEST(ShRotationZyz, RotatesColours) {
  const int order = 5;
  std::vector<Vec3> f, out(25);
  for (int i = 0; i < 25; ++i) f.emplace_back(float(i), 3.0f - float(i), 0.5f * float(i % 4));
  const Mat3 R(rotations()[5]);
  const std::vector<Vec3> dense = rotate_sh(make_sh_rotation(order, R), f);
  rotate_sh_zyz(R, f, out);
  for (size_t i = 0; i < f.size(); ++i)
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(out[i][c], dense[i][c], 25 * float_rounding) << i;
}

// A double that counts its multiplications.
struct Counted {
  double value = 0;
  static inline int multiplications = 0;
  Counted() = default;
  explicit Counted(double v) : value(v) {}
};
Counted operator*(Counted a, Counted b) { return ++Counted::multiplications, Counted(a.value * b.value); }
Counted operator+(Counted a, Counted b) { return Counted(a.value + b.value); }
Counted operator-(Counted a, Counted b) { return Counted(a.value - b.value); }
Counted operator-(Counted a) { return Counted(-a.value); }
bool operator<(Counted a, Counted b) { return a.value < b.value; }

// Rotates f in double; angles go in directly. Returns the multiplications made.
int count_rotation(int order, double a, double b, double c, std::vector<double>& f) {
  const Mat3d R = about_z(a) * about_y(b) * about_z(c);
  Counted rows[9], angles[6] = {Counted(std::cos(a)), Counted(std::sin(a)), Counted(std::cos(b)),
                                Counted(std::sin(b)), Counted(std::cos(c)), Counted(std::sin(c))};
  for (int i = 0; i < 9; ++i) rows[i] = Counted(R[i % 3][i / 3]);
  std::vector<Counted> blocks, values, scratch(f.size());
  for (double x : zyz::quarter_turn_blocks()) blocks.emplace_back(x);
  for (double x : f) values.emplace_back(x);
  Counted::multiplications = 0;
  zyz::rotate(order, rows, angles, blocks.data(), values.data(), scratch.data());
  for (size_t i = 0; i < f.size(); ++i) f[i] = values[i].value;
  return Counted::multiplications;
}

TEST(ShRotationZyz, NeedsNoMoreMultiplicationsThanPublished) {
  const int published[] = {53, 121, 217, 345, 509, 713, 961};  // n = 3 .. 9, local-deformable-prt
  for (int order = 3; order <= 9; ++order)
    for (auto [a, b, c] : {std::array{0.4, 1.1, -2.0}, std::array{1.5, 0.1, 3.0}}) {
      std::vector<double> f(size_t(sh_count(order)), 1.0);
      const int count = count_rotation(order, a, b, c, f);
      EXPECT_LE(count, published[order - 3]) << order;
      EXPECT_EQ(count, published[order - 3] - (order == 3 ? 6 : 8))
          << "the blocks that are +-1: three in band 2, one in band 3, twice";
    }
}

TEST(ShRotationZyz, CountedCodeIsExactToDoublePrecision) {
  const int order = max_sh_order;
  Random random(3);
  std::vector<double> f(size_t(sh_count(order)));
  for (double& x : f) x = 2 * random.next() - 1;
  for (auto [a, b, c] : {std::array{0.4, 1.1, -2.0}, std::array{1.57, 1e-4, 3.1415}}) {
    std::vector<double> g = f, y(f.size()), turned(f.size());
    count_rotation(order, a, b, c, g);
    const Mat3d R = about_z(a) * about_y(b) * about_z(c);
    for (int i = 0; i < 20; ++i) {
      const Vec3d d = normalize(Vec3d(random.next(), random.next() - 0.3, 0.5 - random.next()));
      evaluate_sh(order, d, y);
      evaluate_sh(order, transpose(R) * d, turned);
      double before = 0, after = 0;
      for (size_t k = 0; k < f.size(); ++k) before += f[k] * turned[k], after += g[k] * y[k];
      EXPECT_NEAR(after, before, f.size() * double_rounding);
    }
  }
}

}  // namespace
}  // namespace lambent
