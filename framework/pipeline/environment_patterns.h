// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "diorama/scene.h"
#include "framework/pipeline/pattern_check.h"

namespace diorama {

/// Patterns of a job that speak of environments, tried in these as visits load them. One that fits
/// nothing in an environment is told once; one that fits nothing in any environment of the job is
/// an error. For all visits of a run; any thread may call it.
class EnvironmentPatterns {
 public:
  /// With `are_errors` false, what fits nothing anywhere is told like all else.
  EnvironmentPatterns(std::vector<EnvironmentPattern> patterns, bool are_errors);

  /// Shown one environment after the other, with the node that stands for it, until it says false.
  using Look = std::function<bool(const Scene&, NodeId environment)>;
  /// Tries them in the scene of a visit. `show_others` loads the job's other environments; it is
  /// called when none has had what a pattern speaks of. Throws Error(Config) with the place of each
  /// such pattern and the nearest path.
  void try_in(const Scene& scene, NodeId environment, const std::string& asset, Host& host,
              const std::function<void(const Look&)>& show_others);

 private:
  std::vector<EnvironmentPattern> patterns_;
  bool are_errors_;
  std::mutex mutex_;
  std::set<std::size_t> met_;  ///< Those that fitted somewhere.
  std::set<std::pair<std::size_t, std::string>> told_;
};

}  // namespace diorama
