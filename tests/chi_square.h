#pragma once
// Pearson's chi-square test of counts against expectations.
#include <gtest/gtest.h>

#include <cmath>
#include <span>

namespace lambent::test {

// Fails where the counts of independent draws are unlikely under the expectations. Cells of which fewer than 5 are
// expected are taken together, for the statistic is chi-square only where counts are nearly normal. For k degrees of
// freedom it has mean k and variance 2 k; six standard deviations are passed by chance less than once in a million
// runs, and draws are keyed anyway.
inline void expect_chi_square(std::span<const double> counts, std::span<const double> expected) {
  constexpr double least = 5, sigmas = 6;
  ASSERT_EQ(counts.size(), expected.size());
  double chi2 = 0, rare_count = 0, rare_expected = 0, cells = 0;
  auto add = [&](double count, double mean) { chi2 += (count - mean) * (count - mean) / mean, ++cells; };
  for (size_t i = 0; i < counts.size(); ++i) {
    if (expected[i] >= least) add(counts[i], expected[i]);
    else rare_count += counts[i], rare_expected += expected[i];
  }
  if (rare_expected >= least) add(rare_count, rare_expected);
  else EXPECT_LE(rare_count, rare_expected + sigmas * std::sqrt(rare_expected) + 1);
  ASSERT_GE(cells, 2);
  EXPECT_LT(chi2, cells - 1 + sigmas * std::sqrt(2 * (cells - 1)));
}

}  // namespace lambent::test
