// SPDX-License-Identifier: Apache-2.0
#include "framework/output/dataset_status.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <system_error>

#include "diorama/error.h"
#include "framework/config/clean_text.h"
#include "framework/config/json_text.h"
#include "framework/output/journal.h"
#include "framework/output/workers.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

void read_description(FileSystem& file_system, const fs::path& file, DatasetStatus& status) {
  if (!file_system.exists(file)) {
    throw Error(ErrorKind::Output, file.string() + ": no dataset here: no such file");
  }
  const OrderedJson json = parse_json_or_nothing<OrderedJson>(file_system.read(file));
  const bool is_dataset = json.is_object() && json.contains("captures") &&
                          json["captures"].is_number_integer() && json.contains("job") &&
                          json["job"].is_string();
  const std::int64_t captures = is_dataset ? json["captures"].get<std::int64_t>() : -1;
  if (captures < 0 || captures > INT32_MAX) {
    throw Error(ErrorKind::Output,
                file.string() + ": expected a dataset's description with 'captures' and 'job'");
  }
  status.captures = int(captures);
  status.job = json["job"].get<std::string>();
}

/// The output folder above the folder of dataset.json.
fs::path base_of(const fs::path& folder, const std::string& records) {
  fs::path base = fs::absolute(folder).lexically_normal();
  if (!base.has_filename()) base = base.parent_path();
  if (records == ".") return base;
  for (const fs::path& part : fs::path(records)) {
    if (!part.empty()) base = base.parent_path();
  }
  return base;
}

/// Resident memory of the process that holds a lease. Its number alone may be that of another one,
/// in a container or on another machine: the lease must be among the files that it has open.
std::uint64_t memory_of_holder(FileSystem& file_system, const fs::path& lease) {
  const OrderedJson content =
      parse_json_or_nothing<OrderedJson>(file_system.read_part(lease, 0, 4096));
  if (!content.is_object() || !content.contains("process") ||
      !content["process"].is_number_integer()) {
    return 0;
  }
  const fs::path process =
      fs::path("/proc") / std::to_string(content["process"].get<std::int64_t>());
  std::error_code error;
  const fs::path file = fs::canonical(lease, error);
  bool is_holder = false;
  for (fs::directory_iterator at(process / "fd", error), end; !error && at != end && !is_holder;
       at.increment(error)) {
    std::error_code ignored;
    is_holder = fs::read_symlink(at->path(), ignored) == file;
  }
  std::ifstream statm(process / "statm");
  std::uint64_t size = 0;
  std::uint64_t resident = 0;
  if (!is_holder || !(statm >> size >> resident)) return 0;
  return resident * std::uint64_t(::sysconf(_SC_PAGESIZE));
}

void add_workers(FileSystem& file_system, const fs::path& folder, const Journals& journals,
                 DatasetStatus& status) {
  // A reader takes no part: it has no lease, and no role.
  Workers leases(file_system, folder, this_worker(), std::chrono::seconds(120));
  std::map<std::string, DatasetStatus::Worker> workers;
  for (const auto& [name, index] : journals.workers()) {
    if (index.published > 0) workers[name] = {name, "", "", false, index.published};
  }
  for (const Workers::Lease& lease : leases.others()) {
    DatasetStatus::Worker& worker = workers[lease.worker];
    worker.name = lease.worker;
    worker.role = lease.role;
    worker.description = leases.describe(lease);
    worker.is_alive = leases.is_alive(lease);
    if (worker.is_alive) {
      worker.memory_bytes = memory_of_holder(file_system, folder / "workers" / lease.file_name());
    }
  }
  for (auto& [name, worker] : workers) status.workers.push_back(std::move(worker));
}

void verify(FileSystem& file_system, const Journals& journals, const std::string& records,
            DatasetStatus& status) {
  journals.visit_entries([&](const std::string& worker, const EntryPlace& place) {
    if (!place.is_published || place.entry >= status.captures) return;
    const auto content = journals.files_of(worker, place);
    if (!content) {
      status.faults.push_back(entry_name(place.entry) + ": its journal entry is torn");
      return;
    }
    for (const JournalledFile& file : content->files) {
      if (status.is_finished && is_kept_path(records, file.path)) continue;
      const fs::path path = status.base / file.path;
      const auto found = file_system.status(path);
      if (!found || found->kind != FileStatus::Kind::File) {
        status.faults.push_back(file.path + ": missing");
      } else if (found->size != file.size) {
        status.faults.push_back(file.path + ": expected " + std::to_string(file.size) +
                                " bytes, found " + std::to_string(found->size));
      } else if (digest_of(file_system, path) != file.digest) {
        status.faults.push_back(file.path + ": not what was written");
      }
    }
  });
}

std::string ranges_text(const std::vector<std::pair<int, int>>& ranges) {
  constexpr std::size_t kMost = 20;
  std::string text;
  for (std::size_t i = 0; i < std::min(ranges.size(), kMost); ++i) {
    text += (i > 0 ? ", " : "") + std::to_string(ranges[i].first);
    if (ranges[i].second > ranges[i].first) text += "-" + std::to_string(ranges[i].second);
  }
  if (ranges.size() > kMost)
    text += " and " + std::to_string(ranges.size() - kMost) + " ranges more";
  return text;
}

}  // namespace

DatasetStatus read_status(FileSystem& file_system, const fs::path& folder, bool verifies) {
  DatasetStatus status;
  read_description(file_system, folder / "dataset.json", status);
  Journals journals(file_system, folder / ".diorama" / "journal", status.captures);
  journals.refresh();
  status.done = journals.published_captures();
  status.is_finished = status.done == status.captures && journals.is_published(kBeginEntry) &&
                       journals.is_published(kFinishEntry);
  const std::string records = journals.records_folder().value_or(".");
  status.base = base_of(folder, records);
  for (int capture = 0; capture < status.captures; ++capture) {
    if (journals.is_published(capture)) continue;
    if (!status.missing.empty() && status.missing.back().second == capture - 1) {
      status.missing.back().second = capture;
    } else {
      status.missing.emplace_back(capture, capture);
    }
  }
  add_workers(file_system, folder / ".diorama", journals, status);
  if (verifies) verify(file_system, journals, records, status);
  return status;
}

std::string status_text(const DatasetStatus& status, const fs::path& folder) {
  std::string text = folder.string() + ": " + std::to_string(status.done) + " of " +
                     std::to_string(status.captures) + " captures, " +
                     (status.is_finished ? "finished" : "not finished") + "\n";
  if (!status.missing.empty()) text += "missing: " + ranges_text(status.missing) + "\n";
  int ended = 0;
  int captures_of_ended = 0;
  for (const DatasetStatus::Worker& worker : status.workers) {
    if (worker.role.empty()) {
      ++ended;
      captures_of_ended += worker.captures;
      continue;
    }
    text += (worker.is_alive ? "at work: " : "dead: ") + worker.role + " (" + worker.description +
            "), " + std::to_string(worker.captures) + " captures\n";
  }
  if (ended > 0) {
    text += "ended: " + std::to_string(ended) + (ended == 1 ? " worker, " : " workers, ") +
            std::to_string(captures_of_ended) + " captures\n";
  }
  for (const std::string& fault : status.faults) text += "fault: " + clean_name(fault) + "\n";
  if (!status.faults.empty()) text += "'diorama run --resume --verify' makes them anew\n";
  return text;
}

std::string status_json(const DatasetStatus& status) {
  OrderedJson json{{"captures", status.captures},     {"done", status.done},
                   {"finished", status.is_finished},  {"missing", OrderedJson::array()},
                   {"workers", OrderedJson::array()}, {"faults", status.faults}};
  for (const auto& [first, last] : status.missing) json["missing"].push_back({first, last});
  for (const DatasetStatus::Worker& worker : status.workers) {
    const char* const state = worker.role.empty() ? "ended" : worker.is_alive ? "alive" : "dead";
    json["workers"].push_back({{"name", worker.name},
                               {"role", worker.role},
                               {"state", state},
                               {"description", worker.description},
                               {"captures", worker.captures}});
  }
  return json.dump(1, ' ', false, OrderedJson::error_handler_t::replace) + "\n";
}

}  // namespace diorama
