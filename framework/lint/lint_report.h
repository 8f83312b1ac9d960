// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diorama/reader.h"

namespace diorama {

/// Something in a dataset that cannot be right.
struct LintFinding {
  std::string check;    ///< "box = extent of mask", the rule that is broken.
  std::string file;     ///< Relative to the dataset.
  std::string message;  ///< What was found and what would be right.
  // What of it is known apart; formats without a reader leave these empty.
  std::optional<int> capture{};
  std::string camera{};
  std::string object{};
  std::string found{};
  std::string expected{};
};

/// With a message: "capture 3, cam_0, /Assets/mug: its box is ...; right would be: ...".
LintFinding lint_finding(Finding finding);

/// What `diorama lint` says of one dataset (one writer's folder).
struct LintReport {
  std::string dataset;     ///< The folder.
  std::string format;      ///< As its reader calls it.
  std::size_t files = 0;   ///< Read.
  std::size_t checks = 0;  ///< Comparisons made.
  std::vector<LintFinding> findings;
};

/// For people, one line per finding, at most `most` of them per check.
std::string lint_text(const LintReport& report, std::size_t most = 5);
/// A JSON list with everything.
std::string lint_json(const std::vector<LintReport>& reports);

}  // namespace diorama
