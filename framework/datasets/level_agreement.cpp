// SPDX-License-Identifier: Apache-2.0
#include "framework/datasets/level_agreement.h"

#include <algorithm>
#include <limits>

namespace diorama {
namespace {

/// Of each level, from either end.
constexpr std::size_t kMostOfLevel = 50;
/// What is as frequent as this is another way of measuring, not a fault.
constexpr double kRarelyWrong = 0.2;

}  // namespace

void LevelAgreement::add(double level, double share, const std::function<Finding()>& make) {
  ++count_;
  Level& own = levels_[level];
  const auto keep = [&](std::vector<Example>& list, auto is_before) {
    const auto place = std::ranges::upper_bound(list, share, is_before, &Example::first);
    if (place == list.end() && list.size() >= kMostOfLevel) return;
    list.insert(place, {share, make()});
    if (list.size() > kMostOfLevel) list.pop_back();
  };
  keep(own.lowest, std::less<>());
  keep(own.highest, std::greater<>());
}

void LevelAgreement::finish(ReadLog& log) {
  const std::size_t most = std::size_t(std::max(1.0, kRarelyWrong * double(count_)));
  for (auto above = levels_.begin(); above != levels_.end(); ++above) {
    if (above == levels_.begin()) continue;
    ++log.checks;
    std::vector<const Example*> low, high;
    for (auto it = levels_.begin(); it != above; ++it) {
      for (const Example& example : it->second.highest) low.push_back(&example);
    }
    for (const Example& example : above->second.lowest) high.push_back(&example);
    judge(std::move(low), std::move(high), std::min(most, kMostOfLevel - 1), log);
  }
}

void LevelAgreement::judge(std::vector<const Example*> below, std::vector<const Example*> above,
                           std::size_t most, ReadLog& log) const {
  const auto share = [](const Example* example) { return example->first; };
  std::ranges::sort(below, std::greater<>(), share);
  std::ranges::sort(above, std::less<>(), share);
  // With the n highest of the lower levels on the wrong side of the limit, those of the higher
  // level are wrong that do not lie above all others.
  std::size_t best = std::numeric_limits<std::size_t>::max();
  std::size_t best_below = 0;
  std::size_t best_above = 0;
  for (std::size_t n = 0; n <= below.size() && n <= most; ++n) {
    const double limit =
        n < below.size() ? below[n]->first : -std::numeric_limits<double>::infinity();
    const std::size_t wrong =
        std::size_t(std::ranges::upper_bound(above, limit, std::less<>(), share) - above.begin());
    if (n + wrong >= best) continue;
    best = n + wrong;
    best_below = n;
    best_above = wrong;
  }
  if (best > most) return;
  for (std::size_t i = 0; i < best_below; ++i) log.findings.push_back(below[i]->second);
  for (std::size_t i = 0; i < best_above; ++i) log.findings.push_back(above[i]->second);
}

}  // namespace diorama
