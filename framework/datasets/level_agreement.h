// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "diorama/reader.h"

namespace diorama {

/// Whether levels go with shares: "largely occluded" may begin wherever a writer likes, but there
/// is some share from which on it begins. Remembers a few objects of each level.
class LevelAgreement {
 public:
  /// An object of `level` by the one dataset and of `share` by the other.
  void add(double level, double share, const std::function<Finding()>& make);
  /// What stands on the wrong side of the best limit between two levels, if that is rare.
  void finish(ReadLog& log);

 private:
  using Example = std::pair<double, Finding>;  ///< By share.
  struct Level {
    std::vector<Example> lowest;   ///< Ascending.
    std::vector<Example> highest;  ///< Descending.
  };
  void judge(std::vector<const Example*> below, std::vector<const Example*> above, std::size_t most,
             ReadLog& log) const;

  std::map<double, Level> levels_;
  std::int64_t count_ = 0;
};

}  // namespace diorama
