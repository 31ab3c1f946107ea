// Follows: K. Schulten and R. Gordon, "Exact recursive evaluation of 3j- and 6j-coefficients for quantum-mechanical
// coupling of angular momenta", J. Math. Phys. 16 (1975): their three-term recurrence in one degree, sum rule and sign
// convention.
#include <lambent/basis/wigner.h>
#include <lambent/core/check.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace lambent {

Wigner3jFamily wigner_3j_family(int j2, int j3, int m2, int m3) {
  LAMBENT_CHECK(std::abs(m2) <= j2 && std::abs(m3) <= j3);
  const int m1 = -m2 - m3, first = std::max(std::abs(j2 - j3), std::abs(m1)), last = j2 + j3, count = last - first + 1;
  // up(j) f(j+1) + at(j) f(j) + down(j) f(j-1) = 0. For j2 = j3 and m1 = 0 everything has the factor j (j + 1), which
  // is divided out so that j = 0 is no exception.
  const bool reduced = first == 0 && j2 == j3 && m1 == 0;
  auto A = [&](double j) {
    const double a = j * j - double(j2 - j3) * (j2 - j3), b = double(j2 + j3 + 1) * (j2 + j3 + 1) - j * j;
    return reduced ? j * std::sqrt(b) : std::sqrt(a * b * (j * j - double(m1) * m1));
  };
  auto up = [&](int j) { return reduced ? A(j + 1) : j * A(j + 1); };
  auto down = [&](int j) { return reduced ? A(j) : (j + 1) * A(j); };
  auto at = [&](int j) {
    if (reduced) return (2.0 * j + 1) * (m3 - m2);
    return -(2.0 * j + 1) * ((double(j2) * (j2 + 1) - double(j3) * (j3 + 1)) * m1 - double(j) * (j + 1) * (m3 - m2));
  };
  Wigner3jFamily family{first, std::vector<double>(size_t(count), 1.0)};
  std::vector<double>& f = family.values;
  if (count > 1) {
    // Where the middle term is least beside the others the solutions oscillate most, far from where either end's
    // decays: the two runs meet there.
    int meet = first;
    double least = INFINITY;
    for (int j = first; j < last; ++j) {
      const double outer = std::sqrt(up(j) * std::max(down(j), 1e-300)) +
                           std::sqrt(std::max(up(j + 1), 1e-300) * down(j + 1));
      const double ratio = (std::abs(at(j)) + std::abs(at(j + 1))) / outer + 1e-9 * std::abs(2 * j - first - last + 1);
      if (ratio < least) least = ratio, meet = j;
    }
    std::vector<double> b(f.size(), 1.0);
    auto rescale = [](double* begin, double* end, double latest) {
      if (std::abs(latest) > 1e100)
        for (double* p = begin; p != end; ++p) *p *= 1e-100;
    };
    for (int j = first; j <= meet; ++j) {
      const size_t i = size_t(j - first);
      f[i + 1] = -(at(j) * f[i] + (i > 0 ? down(j) * f[i - 1] : 0)) / up(j);
      rescale(f.data(), f.data() + i + 2, f[i + 1]);
    }
    for (int j = last; j > meet; --j) {
      const size_t i = size_t(j - first);
      b[i - 1] = -(at(j) * b[i] + (j < last ? up(j) * b[i + 1] : 0)) / down(j);
      rescale(b.data() + i - 1, b.data() + b.size(), b[i - 1]);
    }
    const size_t k = size_t(meet - first);  // both runs have the values k and k + 1
    const double scale = (f[k] * b[k] + f[k + 1] * b[k + 1]) / (b[k] * b[k] + b[k + 1] * b[k + 1]);
    for (size_t i = k + 1; i < f.size(); ++i) f[i] = scale * b[i];
  }
  double sum = 0;  // sum of (2j + 1) f(j)^2 is 1; the sign of the last one is (-1)^(j2 - j3 - m1)
  for (size_t i = 0; i < f.size(); ++i) sum += (2.0 * (first + int(i)) + 1) * f[i] * f[i];
  const bool negative = (j2 - j3 - m1) % 2 != 0;
  const double factor = ((f.back() < 0) != negative ? -1 : 1) / std::sqrt(sum);
  for (double& x : f) x *= factor;
  return family;
}

double wigner_3j(int j1, int j2, int j3, int m1, int m2, int m3) {
  LAMBENT_CHECK(j1 >= 0 && j2 >= 0 && j3 >= 0);
  if (std::abs(m1) > j1 || std::abs(m2) > j2 || std::abs(m3) > j3 || m1 + m2 + m3 != 0) return 0;
  if (j1 < std::abs(j2 - j3) || j1 > j2 + j3) return 0;
  const Wigner3jFamily family = wigner_3j_family(j2, j3, m2, m3);
  return family.values[size_t(j1 - family.first)];
}

}  // namespace lambent
