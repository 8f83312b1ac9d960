// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "framework/output/dataset_status.h"
#include "framework/pipeline/view_report.h"

namespace diorama {

/// What the files of a run tell of how it goes, or went: which views were refused and why, how
/// objects came to rest. Reads each file, and each capture's record, once. For one thread at a
/// time.
class RunRecords {
 public:
  /// `folder` holds dataset.json.
  explicit RunRecords(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// Reads what is new. `status` of the folder; `has_views`: its job's section `views` asks for
  /// something.
  void refresh(const DatasetStatus& status, bool has_views);
  /// Members `views`, `settle`, `stages` (seconds of all workers that live) and `last` (captures
  /// that came last), each as far as there is something.
  nlohmann::ordered_json json() const;

 private:
  /// What became of objects or cameras for one reason.
  struct Verdict {
    int count = 0;
    std::string first;  ///< "visit 3: /Assets/cup_2 moves at 0.6 m/s"
  };
  void read_journals(int captures, bool has_views);
  void read_times(const std::vector<DatasetStatus::Worker>& workers);
  void read_settling();
  void add_visit(const nlohmann::ordered_json& visit);

  std::filesystem::path folder_;
  std::set<int> counted_;  ///< Captures.
  ViewCounts views_;
  std::map<std::string, double> stages_;
  std::vector<int> last_;         ///< Captures, the last one first.
  std::set<std::string> visits_;  ///< Names of files.
  int resting_visits_ = 0;
  int falling_objects_ = 0;
  std::optional<double> longest_rest_s_;
  std::map<std::string, std::map<std::string, Verdict>>
      verdicts_;  ///< By kind, then reason without its numbers.
};

}  // namespace diorama
