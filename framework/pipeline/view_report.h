// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <vector>

/// What became of the views that a job's section `views` speaks of.
namespace diorama {

/// How the view of one camera in one capture came about.
struct ViewOutcome {
  std::string camera;
  int draws = 0;                             ///< The one that stayed included.
  std::map<std::string, int> refused;        ///< Draws by the first condition that failed.
  std::vector<std::string> unmet;            ///< What the view that stayed does not hold.
  std::map<std::string, std::string> parts;  ///< Per quota ("seen.label") where it had to fall.
};

/// Of many views.
struct ViewCounts {
  struct Unmet {
    int capture = 0;
    std::string camera;
    std::vector<std::string> conditions;
  };
  std::int64_t views = 0;
  std::int64_t draws = 0;
  std::map<std::string, std::int64_t> refused;
  /// Views that hold, per quota and part of it.
  std::map<std::string, std::map<std::string, std::int64_t>> parts;
  std::vector<Unmet> unmet;

  void add(int capture, const std::vector<ViewOutcome>& outcomes);
  std::int64_t refused_draws() const;
};

std::int64_t refused_draws(const std::vector<ViewOutcome>& outcomes);

/// One line of JSON.
std::string outcomes_json(const std::vector<ViewOutcome>& outcomes);
/// Throws Error(Output) when it is none.
std::vector<ViewOutcome> outcomes_from_json(std::string_view text);

/// Of the whole dataset, for views.json.
std::string views_json(const ViewCounts& counts);
/// Lines for people, out of the text of views.json; empty when it is none.
std::string views_text(std::string_view json);
/// The same of a run.
std::string views_text(const ViewCounts& counts);

/// Name of the file beside dataset.json.
inline constexpr const char* kViewsFile = "views.json";

}  // namespace diorama
