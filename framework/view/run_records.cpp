// SPDX-License-Identifier: Apache-2.0
#include "framework/view/run_records.h"

#include <algorithm>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include "diorama/error.h"
#include "framework/config/json_text.h"
#include "framework/output/file_system.h"
#include "framework/output/journal.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

/// The run's own records are those of no writer.
constexpr const char* kOfTheRun = "";
/// Larger files are not the run's.
constexpr std::uint64_t kMostBytes = std::uint64_t(64) << 20;
constexpr std::uint64_t kMostTimesBytes = std::uint64_t(64) << 10;
/// Captures that are shown as the last ones.
constexpr std::size_t kMostLast = 8;

/// "moves at 0.65 m/s" and the same at another speed are one reason.
std::string without_numbers(std::string_view why) {
  std::string text;
  for (std::size_t i = 0; i < why.size();) {
    const std::size_t end = std::min(why.find_first_not_of("0123456789.", i), why.size());
    const bool is_number = end > i && why.find_first_of("0123456789", i) < end;
    text += is_number ? "…" : std::string(why.substr(i, std::max(end, i + 1) - i));
    i = std::max(end, i + 1);
  }
  return text;
}

}  // namespace

void RunRecords::refresh(const DatasetStatus& status, bool has_views) {
  read_journals(status.captures, has_views);
  read_settling();
  read_times(status.workers);
}

void RunRecords::read_journals(int captures, bool has_views) {
  LocalFileSystem file_system;
  Journals journals(file_system, folder_ / ".diorama" / "journal", captures);
  journals.refresh();
  std::map<std::string, std::vector<int>> made;  // by worker, in the order of its journal
  journals.visit_entries([&](const std::string& worker, const EntryPlace& place) {
    const bool is_capture = place.is_published && place.entry >= 0 && place.entry < captures;
    if (!is_capture) return;
    made[worker].push_back(place.entry);
    if (!has_views || counted_.contains(place.entry)) return;
    const auto content = journals.files_of(worker, place);
    if (!content) return;
    counted_.insert(place.entry);
    for (const auto& [writer, line] : content->records) {
      if (writer == kOfTheRun) views_.add(place.entry, outcomes_from_json(line));
    }
  });
  // Journals say no times: the last ones of each worker, in turn.
  last_.clear();
  for (std::size_t i = 0; i < kMostLast && last_.size() < kMostLast; ++i) {
    for (const auto& [worker, entries] : made) {
      if (i < entries.size() && last_.size() < kMostLast) {
        last_.push_back(entries[entries.size() - 1 - i]);
      }
    }
  }
}

void RunRecords::read_times(const std::vector<DatasetStatus::Worker>& workers) {
  LocalFileSystem file_system;
  const fs::path stages = folder_ / ".diorama" / "stage";
  // What was read before stays when a file goes while it is read.
  std::map<std::string, double> seconds_of;
  for (const DatasetStatus::Worker& worker : workers) {
    if (!worker.is_alive) continue;  // nobody takes its file away
    const fs::path file = stages / worker.name / kTimesFile;
    const auto found = file_system.status(file);
    if (!found || found->kind != FileStatus::Kind::File || found->size > kMostTimesBytes) continue;
    const OrderedJson times = parse_json_or_nothing<OrderedJson>(file_system.read(file));
    if (!times.is_object()) continue;
    for (const auto& [stage, seconds] : times.items()) {
      if (seconds.is_number()) seconds_of[stage] += seconds.get<double>();
    }
  }
  stages_ = std::move(seconds_of);
}

void RunRecords::read_settling() {
  LocalFileSystem file_system;
  const fs::path folder = folder_ / "settle";
  for (const std::string& name : file_system.list(folder)) {
    if (!name.ends_with(".json") || visits_.contains(name)) continue;
    const auto found = file_system.status(folder / name);
    if (!found || found->kind != FileStatus::Kind::File || found->size > kMostBytes) continue;
    const OrderedJson visit = parse_json_or_nothing<OrderedJson>(file_system.read(folder / name));
    try {
      add_visit(visit);
      visits_.insert(name);
    } catch (const std::exception&) {
      // Somebody else's file.
    }
  }
}

void RunRecords::add_visit(const OrderedJson& visit) {
  const std::string at = "visit " + std::to_string(whole_of_json<int>(visit.at("visit"))) + ": ";
  const int falling = whole_of_json<int>(visit.at("falling_objects"));
  std::optional<double> rest_s;
  if (!visit.at("rest_after_s").is_null()) rest_s = visit.at("rest_after_s").get<double>();
  std::vector<std::pair<const char*, std::pair<std::string, std::string>>> found;
  for (const char* kind : {"unsettled", "dropped", "respawned", "born_inside", "blocked_cameras"}) {
    const char* const who = std::string_view(kind) == "blocked_cameras" ? "camera" : "object";
    for (const OrderedJson& one : visit.at(kind)) {
      found.push_back({kind, {one.at("why").get<std::string>(), one.at(who).get<std::string>()}});
    }
  }
  falling_objects_ += falling;
  if (rest_s) {
    ++resting_visits_;
    longest_rest_s_ = std::max(longest_rest_s_.value_or(0.0), *rest_s);
  }
  for (const auto& [kind, incident] : found) {
    const auto& [why, who] = incident;
    Verdict& verdict = verdicts_[kind][without_numbers(why)];
    if (verdict.count++ == 0) verdict.first = at + who + " " + why;
  }
}

OrderedJson RunRecords::json() const {
  OrderedJson json = OrderedJson::object();
  if (views_.views > 0) {
    json["views"] = {{"views", views_.views},
                     {"draws", views_.draws},
                     {"refused", views_.refused},
                     {"unmet", views_.unmet.size()}};
  }
  if (!stages_.empty()) json["stages"] = stages_;
  if (!last_.empty()) json["last"] = last_;
  if (visits_.empty()) return json;
  OrderedJson& settle = json["settle"];
  settle = {{"visits", visits_.size()},
            {"at_rest", resting_visits_},
            {"falling_objects", falling_objects_},
            {"longest_rest_s", nullptr},
            {"verdicts", OrderedJson::array()}};
  if (longest_rest_s_) settle["longest_rest_s"] = *longest_rest_s_;
  for (const auto& [kind, reasons] : verdicts_) {
    for (const auto& [why, verdict] : reasons) {
      settle["verdicts"].push_back(
          {{"kind", kind}, {"why", why}, {"count", verdict.count}, {"first", verdict.first}});
    }
  }
  return json;
}

}  // namespace diorama
