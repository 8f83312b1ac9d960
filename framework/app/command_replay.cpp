// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_replay.h"

#include <algorithm>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <set>
#include <system_error>

#include "diorama/error.h"
#include "diorama/rng.h"
#include "framework/app/command_run.h"
#include "framework/app/standard_output.h"
#include "framework/host/regular_file.h"
#include "framework/host/scratch_folder.h"
#include "framework/output/dataset_status.h"
#include "framework/output/journal.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

bool is_missing(const DatasetStatus& status, int capture) {
  return std::ranges::any_of(status.missing, [&](const auto& range) {
    return capture >= range.first && capture <= range.second;
  });
}

std::set<int> chosen_captures(const ReplayOptions& options, const DatasetStatus& status) {
  std::set<int> chosen;
  for (const int capture : options.captures) {
    if (capture < 0 || capture >= status.captures || is_missing(status, capture)) {
      throw Error(ErrorKind::Usage, options.dataset.string() + ": has no capture " +
                                        std::to_string(capture) + "; of " +
                                        std::to_string(status.captures) + " captures, " +
                                        std::to_string(status.done) + " are there");
    }
    chosen.insert(capture);
  }
  if (!chosen.empty()) return chosen;
  std::vector<std::pair<std::uint64_t, int>> order;
  const Rng stream = Rng(options.seed).fork("captures to verify");
  for (int i = 0; i < status.captures; ++i) {
    if (!is_missing(status, i)) order.emplace_back(stream.fork(std::uint64_t(i)).bits(), i);
  }
  std::ranges::sort(order);
  for (std::size_t i = 0; i < order.size() && int(i) < options.sample; ++i) {
    chosen.insert(order[i].second);
  }
  return chosen;
}

std::string digest_of_file(const fs::path& path) {
  std::ifstream in = open_regular_file(path);
  if (!in) return {};
  Digest digest;
  std::vector<char> piece(std::size_t(1) << 20);
  while (in) {
    in.read(piece.data(), std::streamsize(piece.size()));
    digest.add(std::as_bytes(std::span(piece.data(), std::size_t(in.gcount()))));
  }
  return digest.text();
}

struct Comparison {
  std::size_t files = 0;
  std::vector<std::string> differences;
};

/// All that the journals of a dataset say of captures.
void visit_files(const fs::path& folder, const DatasetStatus& status, const std::set<int>& captures,
                 const std::function<void(const std::string& records, int capture,
                                          const JournalledFile& file)>& visit) {
  LocalFileSystem file_system;
  Journals journals(file_system, folder / ".diorama" / "journal", status.captures);
  journals.refresh();
  const std::string records = journals.records_folder().value_or(".");
  journals.visit_entries([&](const std::string& worker, const EntryPlace& place) {
    if (!place.is_published || !captures.contains(place.entry)) return;
    const auto content = journals.files_of(worker, place);
    if (!content) return;
    for (const JournalledFile& file : content->files) visit(records, place.entry, file);
  });
}

/// The files of the captures that were made again against those of the dataset. What captures kept
/// went into files that they share: its digest is in the dataset's journals.
Comparison compare(const fs::path& again, const DatasetStatus& again_status,
                   const fs::path& dataset, const DatasetStatus& status,
                   const std::set<int>& captures) {
  std::map<std::string, std::string> kept;
  visit_files(dataset, status, captures, [&](const auto& records, int, const auto& file) {
    if (is_kept_path(records, file.path)) kept[file.path] = file.digest;
  });
  Comparison result;
  visit_files(
      again, again_status, captures, [&](const auto& records, int capture, const auto& file) {
        ++result.files;
        const std::string there = is_kept_path(records, file.path)
                                      ? kept[file.path]
                                      : digest_of_file(status.base / file.path);
        if (there == file.digest) return;
        result.differences.push_back("capture " + std::to_string(capture) + ": " + file.path +
                                     (there.empty() ? " is missing" : " differs"));
      });
  return result;
}

}  // namespace

int command_replay(const GlobalOptions& global, const ReplayOptions& options, ConsoleLog& log) {
  LocalFileSystem file_system;
  const DatasetStatus status = read_status(file_system, options.dataset, false);
  const std::set<int> captures = chosen_captures(options, status);
  std::optional<ScratchFolder> scratch;
  if (!options.output) scratch.emplace("replay");
  const fs::path records =
      make_captures_again(global, options.dataset, status,
                          scratch ? scratch->path() : *options.output, captures, options.sets, log);
  const Comparison result =
      compare(records, read_status(file_system, records, false), options.dataset, status, captures);
  for (const std::string& difference : result.differences) {
    print_text(difference + "\n");
  }
  std::cout << captures.size() << " captures made again, " << result.files << " files compared, "
            << result.differences.size() << " differ\n";
  return result.differences.empty() || !options.sets.empty() ? 0 : kReplayDiffers;
}

}  // namespace diorama
