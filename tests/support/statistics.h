// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <vector>

namespace diorama::test {

/// Sum of (observed - expected)^2 / expected over ten equal bins of [lo, hi]. For uniform numbers
/// it exceeds 27.9 once in a thousand samples (nine degrees of freedom).
inline double chi_square(const std::vector<double>& numbers, double lo, double hi) {
  std::vector<double> bins(10, 0.0);
  for (const double number : numbers) {
    const double share = (number - lo) / (hi - lo);
    bins[std::size_t(std::clamp(share * 10.0, 0.0, 9.0))] += 1.0;
  }
  const double expected = double(numbers.size()) / 10.0;
  double sum = 0.0;
  for (const double count : bins) sum += (count - expected) * (count - expected) / expected;
  return sum;
}

struct Extent {
  double lo;
  double hi;
};

inline Extent extent_of(const std::vector<double>& numbers) {
  const auto [lo, hi] = std::minmax_element(numbers.begin(), numbers.end());
  return {*lo, *hi};
}

/// Uniform on [lo, hi]: inside, reaching within 2 % of both ends, and flat. The seeds are fixed, so
/// a true generator passes always, not nine hundred and ninety-nine times in a thousand.
inline bool fills(const std::vector<double>& numbers, double lo, double hi) {
  const Extent extent = extent_of(numbers);
  const double slack = 0.02 * (hi - lo);
  return extent.lo >= lo && extent.hi <= hi && extent.lo < lo + slack && extent.hi > hi - slack &&
         chi_square(numbers, lo, hi) < 27.9;
}

constexpr int kSeeds = 500;

}  // namespace diorama::test
