#include <lambent/basis/wigner.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace lambent {
namespace {

// Errors of a recurrence of some eighty steps in double, over symbols of size at most 1.
constexpr double recurrence_rounding = 2e-13;

int sign(int exponent) { return exponent % 2 ? -1 : 1; }
double log_factorial(int n) { return std::lgamma(n + 1.0); }

// Racah's finite sum, in long double: exact enough while its terms are small.
double racah(int j1, int j2, int j3, int m1, int m2, int m3) {
  auto f = [](int n) {
    long double product = 1;
    for (int i = 2; i <= n; ++i) product *= i;
    return product;
  };
  const int t1 = j2 - m1 - j3, t2 = j1 + m2 - j3, t3 = j1 + j2 - j3, t4 = j1 - m1, t5 = j2 + m2;
  long double sum = 0;
  for (int t = std::max({0, t1, t2}); t <= std::min({t3, t4, t5}); ++t)
    sum += sign(t) / (f(t) * f(t - t1) * f(t - t2) * f(t3 - t) * f(t4 - t) * f(t5 - t));
  const long double triangle = f(j1 + j2 - j3) * f(j1 - j2 + j3) * f(-j1 + j2 + j3) / f(j1 + j2 + j3 + 1);
  const long double rest = f(j1 + m1) * f(j1 - m1) * f(j2 + m2) * f(j2 - m2) * f(j3 + m3) * f(j3 - m3);
  return double(sign(j1 - j2 - m3) * sum * std::sqrt(triangle * rest));
}

TEST(Wigner, KnownValues) {
  EXPECT_NEAR(wigner_3j(0, 0, 0, 0, 0, 0), 1, recurrence_rounding);
  EXPECT_NEAR(wigner_3j(1, 1, 0, 0, 0, 0), -std::sqrt(1.0 / 3), recurrence_rounding);
  EXPECT_NEAR(wigner_3j(2, 1, 1, 0, 0, 0), std::sqrt(2.0 / 15), recurrence_rounding);
  EXPECT_NEAR(wigner_3j(2, 1, 1, 0, 1, -1), std::sqrt(1.0 / 30), recurrence_rounding);
  EXPECT_NEAR(wigner_3j(1, 1, 1, 0, 1, -1), std::sqrt(1.0 / 6), recurrence_rounding);
  EXPECT_NEAR(wigner_3j(2, 2, 3, 1, 1, -2), 0, recurrence_rounding);
  EXPECT_EQ(wigner_3j(1, 1, 3, 0, 0, 0), 0);
  EXPECT_EQ(wigner_3j(1, 1, 1, 1, 1, 1), 0);
}

TEST(Wigner, AgreesWithRacahsSumAtSmallDegrees) {
  for (int j1 = 0; j1 <= 6; ++j1)
    for (int j2 = 0; j2 <= 5; ++j2)
      for (int j3 = std::abs(j1 - j2); j3 <= j1 + j2; ++j3)
        for (int m1 = -j1; m1 <= j1; ++m1)
          for (int m2 = -j2; m2 <= j2; ++m2)
            if (std::abs(m1 + m2) <= j3) {
              EXPECT_NEAR(wigner_3j(j1, j2, j3, m1, m2, -m1 - m2), racah(j1, j2, j3, m1, m2, -m1 - m2),
                          recurrence_rounding)
                  << j1 << j2 << j3 << " " << m1 << " " << m2;
            }
}

// (a b c; 0 0 0) and (a b a+b; m n -m-n) in closed form.
TEST(Wigner, ClosedFormsAtDegreeForty) {
  for (int a : {40, 39, 21})
    for (int b : {40, 17})
      for (int c = std::abs(a - b); c <= std::min(a + b, 60); ++c) {
        const int s = a + b + c;
        double expected = 0;
        if (s % 2 == 0) {
          const int g = s / 2;
          const double triangle = log_factorial(s - 2 * a) + log_factorial(s - 2 * b) + log_factorial(s - 2 * c) -
                                  log_factorial(s + 1);
          expected = sign(g) * std::exp(0.5 * triangle + log_factorial(g) - log_factorial(g - a) -
                                        log_factorial(g - b) - log_factorial(g - c));
        }
        EXPECT_NEAR(wigner_3j(a, b, c, 0, 0, 0), expected, recurrence_rounding) << a << " " << b << " " << c;
      }
  for (int m : {-40, -13, 0, 7, 40})
    for (int n : {-30, -2, 5, 30}) {
      const int a = 40, b = 30, c = a + b;
      const double above = log_factorial(2 * a) + log_factorial(2 * b) + log_factorial(c + m + n) +
                           log_factorial(c - m - n);
      const double below = log_factorial(2 * c + 1) + log_factorial(a + m) + log_factorial(a - m) +
                           log_factorial(b + n) + log_factorial(b - n);
      const double expected = sign(a - b + m + n) * std::exp(0.5 * (above - below));
      EXPECT_NEAR(wigner_3j(a, b, c, m, n, -m - n), expected, recurrence_rounding) << m << " " << n;
    }
}

// sum over m1, m2 of the squares is 1 / (2 j3 + 1), and different j3 are orthogonal.
TEST(Wigner, IsOrthogonal) {
  const int j1 = 40, j2 = 37, m3 = -11;
  for (int j3 : {11, 40, 77})
    for (int other : {11, 41, 77}) {
      double sum = 0;
      for (int m1 = -j1; m1 <= j1; ++m1)
        if (std::abs(m1 + m3) <= j2)
          sum += wigner_3j(j1, j2, j3, m1, -m1 - m3, m3) * wigner_3j(j1, j2, other, m1, -m1 - m3, m3);
      EXPECT_NEAR(sum, j3 == other ? 1.0 / (2 * j3 + 1) : 0, recurrence_rounding) << j3 << " " << other;
    }
}

TEST(Wigner, HasItsSymmetries) {
  for (int j1 : {3, 12, 40})
    for (int j2 : {5, 38})
      for (int j3 : {6, 8, 41})
        for (int m1 : {-3, 0, 2})
          for (int m2 : {-4, 1}) {
            const int m3 = -m1 - m2, s = sign(j1 + j2 + j3);
            const double w = wigner_3j(j1, j2, j3, m1, m2, m3);
            EXPECT_NEAR(w, wigner_3j(j2, j3, j1, m2, m3, m1), recurrence_rounding);
            EXPECT_NEAR(w, s * wigner_3j(j2, j1, j3, m2, m1, m3), recurrence_rounding);
            EXPECT_NEAR(w, s * wigner_3j(j1, j2, j3, -m1, -m2, -m3), recurrence_rounding);
          }
}

}  // namespace
}  // namespace lambent
