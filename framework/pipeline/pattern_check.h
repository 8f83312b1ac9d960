// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "diorama/config.h"
#include "diorama/host.h"
#include "framework/pipeline/capture_plan.h"
#include "framework/pipeline/job.h"

/// Patterns of node paths in a job, tried before anything is loaded.
namespace diorama {

/// A pattern that may fit something in an environment, and the key that gives it.
struct EnvironmentPattern {
  std::string text;
  std::string key;  ///< "randomizers[2].surfaces"
  SourceLocation place;
  bool is_path = true;                 ///< Else a text as in EnvironmentRules.
  std::string otherwise;               ///< What becomes of an environment in which it fits nothing.
  LogLevel level = LogLevel::Warning;  ///< How such an environment is told.
};

/// Complains about every pattern in the job's randomizers (parameters of the unit kNodePattern) and
/// views that can fit no object, light or camera of any visit, with the nearest path. Defaults that
/// the job does not spell out are no complaint. Returns those about environments, which nobody
/// knows yet, the texts of the job's environment rules among them.
std::vector<EnvironmentPattern> check_patterns(const Job& job, const CapturePlan& plan,
                                               const DescribeComponent& describe,
                                               Diagnostics& diagnostics);

/// About labels in the job's `views` that none of its objects gets, with the nearest one. Assets
/// and randomizers may know more, so these are no errors.
std::vector<std::string> unknown_view_labels(const Job& job, const CapturePlan& plan);

/// Whether the pattern fits the path or may fit a node below it or above it.
bool may_fit(std::string_view pattern, std::string_view path);

/// The nearest of some texts to one that none of them holds.
class NearestText {
 public:
  /// `shown` is what hint() names.
  void add(std::string_view wanted, std::string_view candidate, std::string_view shown);
  void add(const NearestText& other);
  /// "; did you mean 'Table_01'?", "; the nearest is 'Chair'"; empty without candidates.
  std::string hint() const;

 private:
  std::string shown_;
  std::size_t distance_ = 0;
  bool is_near_ = false;
};

/// The pattern with its first name that fits none of the paths replaced by the nearest one that
/// does; empty when none is near.
std::string nearest_pattern(std::string_view pattern, const std::vector<std::string>& paths);

}  // namespace diorama
