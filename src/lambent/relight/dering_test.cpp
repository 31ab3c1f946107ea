// A sun over a soft sky, seen by surfaces that nothing shadows: all of it has a closed form.
#include <lambent/basis/sh.h>
#include <lambent/relight/dering.h>
#include <lambent/relight/relighter.h>

#include <gtest/gtest.h>

namespace lambent {
namespace {

constexpr int order = 6, planes = 64;

Vec3 normal_of(int i) {
  const float angle = pi * float(i) / (planes - 1);
  return {std::sin(angle), std::cos(angle), 0};
}

// Open planes from facing +Y to facing away: t_lm = A_l y_lm(n) / pi.
Field open_planes() {
  const WritableTransfer t = make_transfer({.order = order}, 1, 1, planes, Precision::single);
  for (int i = 0; i < planes; ++i) {
    std::vector<float> y(size_t(sh_count(order)));
    evaluate_sh(order, normal_of(i), y);
    for (size_t k = 0; k < y.size(); ++k) y[k] *= float(clamped_cosine(sh_band(int(k))) / std::numbers::pi);
    store_receiver(t, size_t(i), y);
  }
  VertexPlacement at;
  for (uint32_t i = 0; i < planes; ++i) at.front.push_back(i);
  return {at, t.transfer, DiffuseRows{}};
}

// Irradiance E at +Y from a point, and radiance `even` from everywhere.
std::vector<Vec3> sun(float E) {
  std::vector<float> y(size_t(sh_count(order)));
  evaluate_sh(order, {0, 1, 0}, y);
  std::vector<Vec3> light;
  for (float v : y) light.push_back(Vec3(E * v));
  return light;
}
std::vector<Vec3> plus_even(std::vector<Vec3> light, float even) {
  light[0] += Vec3(even * 2 * std::sqrt(pi));
  return light;
}

Relit relit(const Field& field, std::span<const Vec3> light) {
  auto relighter = Relighter::make(field);
  EXPECT_TRUE(relighter && relighter->set_light(light));
  Relit out;
  EXPECT_TRUE(relighter->relight({}, out));
  return out;
}

// sum_l A_l / pi (2l + 1) / 4 pi P_l(cos), the bands of a sun's clamped cosine.
double banded_cosine(double cosine) {
  double below = 1, P = cosine, sum = 1.0 / (4 * std::numbers::pi);
  for (int l = 1; l < order; ++l) {
    sum += clamped_cosine(l) / std::numbers::pi * (2 * l + 1) / (4 * std::numbers::pi) * P;
    const double above = ((2 * l + 1) * cosine * P - l * below) / (l + 1);
    below = P, P = above;
  }
  return sum;
}

TEST(Dering, KeepsTheSkyWhereTheSunsBandsGoBelowZero) {
  const Field field = open_planes();
  const std::vector<Vec3> peaks = sun(10);
  Relit out = relit(field, plus_even(peaks, 0.25f));
  const Relit of_peaks = relit(field, peaks);
  dering(out, of_peaks);
  int rang = 0;
  for (int i = 0; i < planes; ++i) {
    const double cosine = normal_of(i).y, s = 10 * banded_cosine(cosine);
    rang += s < -1e-3;
    EXPECT_NEAR(out.at(size_t(i)).x, 0.25 + std::max(s, 0.0), 2e-5) << "cosine " << cosine;
  }
  EXPECT_GT(rang, 5);
}

TEST(Dering, IsNothingToTheBitWhereNothingIsNegative) {
  const Field field = open_planes();
  for (float E : {0.0f, 0.01f}) {
    const std::vector<Vec3> peaks = sun(E);
    const Relit plain = relit(field, plus_even(peaks, 1)), of_peaks = relit(field, peaks);
    Relit out = plain;
    dering(out, of_peaks);
    for (size_t i = 0; i < planes; ++i)
      if (of_peaks.at(i).x >= 0) {
        EXPECT_EQ(out.at(i), plain.at(i)) << i;
      }
  }
}

TEST(Dering, PartsAreHeldApart) {
  EXPECT_EQ(dering(3.0f, 1.0f), 3.0f);
  EXPECT_EQ(dering(0.25f, -0.5f), 0.75f);  // the rest alone
  EXPECT_EQ(dering(0.5f, 0.75f), 0.75f);   // the peaks alone
  EXPECT_EQ(dering(-1.0f, -0.5f), 0.0f);
}

}  // namespace
}  // namespace lambent
