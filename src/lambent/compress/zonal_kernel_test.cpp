#include <lambent/basis/zonal.h>
#include <lambent/compress/zonal_kernel.h>
#include <lambent/core/random.h>

#include "sanitizers.h"

#include <gtest/gtest.h>

namespace lambent {
namespace {

// Random targets and axes, others in each lane.
ZonalBatch random_batch(int order, int first_band, int channels, int lobes, uint64_t key) {
  ZonalBatch b = make_zonal_batch(order, first_band, channels, lobes);
  Random random(key);
  for (double& t : b.t) t = 2 * random.next() - 1;
  for (size_t lane = 0; lane < zonal_lanes; ++lane)
    for (int i = 0; i < lobes; ++i) {
      const float z = 2 * random.next() - 1, phi = 2 * pi * random.next(), r = std::sqrt(1 - z * z);
      const Vec3d s = normalize(Vec3d(r * std::cos(phi), r * std::sin(phi), z));
      for (int k = 0; k < 3; ++k) b.axis(i, k)[lane] = s[k];
    }
  return b;
}

// The squared error of what the batch stands for (eq. 17), from its harmonics.
double squared_error(ZonalBatch& b, size_t lane) {
  std::vector<double> r(b.t.size());
  zonal_residual(b, r.data());
  double sum = 0;
  for (int c = 0; c < b.channels; ++c)
    for (int k = sh_count(b.first_band); k < sh_count(b.order); ++k) {
      const double v = r[size_t(c * sh_count(b.order) + k) * zonal_lanes + lane];
      sum += v * v;
    }
  return sum;
}

void turn_axis(ZonalBatch& b, size_t lane, int angle, double by) {
  Vec3d s(b.axis(angle / 2, 0)[lane], b.axis(angle / 2, 1)[lane], b.axis(angle / 2, 2)[lane]);
  // frame_about in double.
  const double sign = std::copysign(1.0, s.z), a = -1 / (sign + s.z), c = s.x * s.y * a;
  const Vec3d tangent = angle % 2 ? Vec3d(c, sign + s.y * s.y * a, -s.y)
                                  : Vec3d(1 + sign * s.x * s.x * a, sign * c, -sign * s.x);
  s = normalize(s * std::cos(by) + tangent * std::sin(by));
  for (int k = 0; k < 3; ++k) b.axis(angle / 2, k)[lane] = s[k];
}

struct Shape {
  int order, first_band, channels, lobes;
};
const Shape shapes[] = {{2, 1, 1, 1}, {3, 1, 1, 2}, {6, 1, 1, 1}, {6, 2, 1, 4},
                        {6, 2, 3, 3}, {6, 0, 1, 2}, {9, 2, 2, 5}, {16, 2, 1, 8}};

TEST(ZonalKernel, SolvesForTheBestCoefficients) {
  for (const Shape& s : shapes) {
    ZonalBatch b = random_batch(s.order, s.first_band, s.channels, s.lobes, 1);
    refine_zonal(b, {0, 0, 0});
    for (size_t lane = 0; lane < zonal_lanes; ++lane) {
      const double best = squared_error(b, lane);
      EXPECT_NEAR(best, b.psi[lane], 1e-8) << s.order << ' ' << s.lobes;
      // Equation 19: the error is flat in every coefficient, so to both sides it grows alike.
      for (int c = 0; c < s.channels; ++c)
        for (int l = s.first_band; l < s.order; ++l)
          for (int i = 0; i < s.lobes; ++i) {
            double& g = b.coefficient(c, l, i)[lane];
            const double at = g;
            g = at + 0.01;
            const double more = squared_error(b, lane);
            g = at - 0.01;
            const double less = squared_error(b, lane);
            g = at;
            // With coefficients of up to 1e3 where axes nearly coincide.
            EXPECT_NEAR(more, less, 1e-7);
            EXPECT_GT(more, best - 1e-12);
          }
    }
  }
}

TEST(ZonalKernel, OneLobeIsTheClosedForm) {
  ZonalBatch b = random_batch(6, 0, 1, 1, 3);
  refine_zonal(b, {0, 0, 0});
  for (size_t lane = 0; lane < zonal_lanes; ++lane) {
    std::vector<float> t(36);
    for (size_t k = 0; k < 36; ++k) t[k] = float(b.target(0, int(k))[lane]);
    const std::vector<float> g = closest_lobe(t, Vec3(b.axis(0, 0)[lane], b.axis(0, 1)[lane], b.axis(0, 2)[lane]));
    for (int l = 0; l < 6; ++l) EXPECT_NEAR(g[size_t(l)], b.coefficient(0, l, 0)[lane], 1e-5);
  }
}

// Equations 20 and 21, and the second derivatives, against central differences.
TEST(ZonalKernel, DerivativesAreThoseOfDifferences) {
  SKIP_UNDER_SANITIZERS();
  for (const Shape& s : shapes)
    for (double ridge : {0.0, 0.03}) {
      if (ridge == 0 && s.lobes > 2 * s.first_band + 1)
        continue;  // more lobes than the first band has dimensions: singular
      ZonalBatch b = random_batch(s.order, s.first_band, s.channels, s.lobes, 2);
      const ZonalDerivatives exact = differentiate_zonal(b, ridge);
      const size_t n = 2 * size_t(s.lobes);
      const double step = 1e-5;
      for (size_t lane = 0; lane < zonal_lanes; ++lane) {
        double size = 1;
        for (size_t a = 0; a < n * n; ++a) size = std::max(size, std::abs(exact.hessian[a * zonal_lanes + lane]));
        for (size_t a = 0; a < n; ++a) {
          ZonalBatch moved = b;
          turn_axis(moved, lane, int(a), step);
          const double up = differentiate_zonal(moved, ridge).psi[lane];
          moved = b;
          turn_axis(moved, lane, int(a), -step);
          const double down = differentiate_zonal(moved, ridge).psi[lane];
          // The difference's own error: rounding of psi over the step, and the third derivative, of the size of order x
          // Hessian.
          EXPECT_NEAR(exact.gradient[a * zonal_lanes + lane], (up - down) / (2 * step), 1e-8 * size * s.order * s.order)
              << s.order << ' ' << s.lobes << ' ' << a;
          // Diagonal of the Hessian.
          EXPECT_NEAR(exact.hessian[(a * n + a) * zonal_lanes + lane],
                      (up + down - 2 * exact.psi[lane]) / (step * step), 2e-4 * size)
              << s.order << ' ' << s.lobes << ' ' << a;
        }
        // Mixed second derivatives of different lobes, and of one.
        for (size_t a = 1; a < n; ++a) {
          double sum = 0;
          for (int sa : {-1, 1})
            for (int sb : {-1, 1}) {
              ZonalBatch moved = b;
              const double far = 1e-4;
              if (a == 1) {  // two angles of one axis: the frame turns with the first, so go along their diagonal
                const Vec3d axis(b.axis(0, 0)[lane], b.axis(0, 1)[lane], b.axis(0, 2)[lane]);
                const double sign = std::copysign(1.0, axis.z), q = -1 / (sign + axis.z), c = axis.x * axis.y * q;
                const Vec3d u(1 + sign * axis.x * axis.x * q, sign * c, -sign * axis.x),
                    v(c, sign + axis.y * axis.y * q, -axis.y);
                const Vec3d along = (u * double(sa) + v * double(sb)) * (far);
                const double length = lambent::length(along);
                const Vec3d to = axis * std::cos(length) + along / length * std::sin(length);
                for (int k = 0; k < 3; ++k) moved.axis(0, k)[lane] = to[k];
              } else {
                turn_axis(moved, lane, 0, sa * far), turn_axis(moved, lane, int(a), sb * far);
              }
              sum += sa * sb * differentiate_zonal(moved, ridge).psi[lane] / (4 * far * far);
            }
          EXPECT_NEAR(exact.hessian[(0 * n + a) * zonal_lanes + lane], sum, 3e-4 * size * s.order * s.order)
              << s.order << ' ' << s.lobes << ' ' << a;
        }
      }
    }
}

TEST(ZonalKernel, FindsMinimaFromWhereverItBegins) {
  for (const Shape& s : shapes) {
    ZonalBatch b = random_batch(s.order, s.first_band, s.channels, s.lobes, 4);
    ZonalBatch before = b;
    refine_zonal(before, {0, 0, 1e-9});
    refine_zonal(b, {200, 1e-12, 1e-9});
    const ZonalDerivatives at = differentiate_zonal(b, 1e-9);
    for (size_t lane = 0; lane < zonal_lanes; ++lane) {
      EXPECT_LE(b.psi[lane], before.psi[lane]);
      double slope = 0, size = 0;
      for (size_t a = 0; a < 2 * size_t(s.lobes); ++a) {
        slope = std::max(slope, std::abs(at.gradient[a * zonal_lanes + lane]));
        size = std::max(size, std::abs(at.hessian[(a * 2 * size_t(s.lobes) + a) * zonal_lanes + lane]));
      }
      EXPECT_LT(slope, 1e-4 * std::max(size, 1e-3)) << s.order << ' ' << s.lobes;
    }
  }
}

TEST(ZonalKernel, StartsFromTheBestOfItsDirections) {
  const ZonalStarts starts = make_zonal_starts(6, 6);
  ZonalBatch b = random_batch(6, 1, 2, 1, 5);
  choose_start(b, starts);
  refine_zonal(b, {0, 0, 0});
  const std::vector<double> chosen(b.psi.begin(), b.psi.end());
  bool attained[zonal_lanes] = {};
  auto compare = [&] {
    refine_zonal(b, {0, 0, 0});
    for (size_t lane = 0; lane < zonal_lanes; ++lane) {
      EXPECT_GE(b.psi[lane], chosen[lane] - 1e-12);
      attained[lane] = attained[lane] || b.psi[lane] < chosen[lane] + 1e-12;
    }
  };
  for (size_t i = 0; i < starts.directions.size() / 3; ++i) {
    for (int k = 0; k < 3; ++k) std::fill_n(b.axis(0, k), zonal_lanes, starts.directions[3 * i + size_t(k)]);
    compare();
  }
  for (size_t lane = 0; lane < zonal_lanes; ++lane) {
    Vec3d axis(0.0);
    for (int c = 0; c < 2; ++c) axis += Vec3d(-b.target(c, 3)[lane], -b.target(c, 1)[lane], b.target(c, 2)[lane]);
    axis = normalize(axis);
    for (int k = 0; k < 3; ++k) b.axis(0, k)[lane] = axis[k];
  }
  compare();
  for (bool a : attained) EXPECT_TRUE(a);
}

TEST(ZonalKernel, NothingIsFittedByNothing) {
  ZonalBatch b = make_zonal_batch(6, 2, 1, 4);
  refine_zonal(b, {});
  for (double g : b.g) EXPECT_EQ(g, 0);
  for (double p : b.psi) EXPECT_EQ(p, 0);
}

}  // namespace
}  // namespace lambent
