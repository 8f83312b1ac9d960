// SPDX-License-Identifier: Apache-2.0
#include "framework/app/command_diff.h"

#include <algorithm>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "diorama/error.h"
#include "framework/app/standard_output.h"
#include "framework/datasets/dataset_difference.h"
#include "framework/datasets/dataset_origin.h"
#include "framework/datasets/dataset_readers.h"
#include "framework/jobs/assemble.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

/// Those that are compared: the only one of each side, else those of the same name.
struct Pairs {
  std::vector<std::pair<FoundDataset, FoundDataset>> pairs;
  std::vector<std::string> alone;  ///< Lines about the others.
};

Pairs pairs_of(const std::vector<FoundDataset>& first, const std::vector<FoundDataset>& second) {
  Pairs result;
  if (first.size() == 1 && second.size() == 1) {
    result.pairs.emplace_back(first[0], second[0]);
    return result;
  }
  const auto partner_in = [](const std::vector<FoundDataset>& list, const FoundDataset& of) {
    return std::ranges::find_if(list, [&](const FoundDataset& each) {
      return each.folder.filename() == of.folder.filename();
    });
  };
  for (const FoundDataset& each : first) {
    const auto partner = partner_in(second, each);
    if (partner == second.end()) {
      result.alone.push_back(each.folder.filename().string() + ": only in the first");
    } else {
      result.pairs.emplace_back(each, *partner);
    }
  }
  for (const FoundDataset& each : second) {
    if (partner_in(first, each) == first.end()) {
      result.alone.push_back(each.folder.filename().string() + ": only in the second");
    }
  }
  return result;
}

std::vector<FoundDataset> datasets_in(const fs::path& folder, DatasetReaders& readers,
                                      const std::string& reader) {
  std::vector<FoundDataset> found = find_datasets(folder, readers, reader);
  if (found.empty()) {
    throw Error(ErrorKind::Usage, folder.string() +
                                      ": holds no dataset that a reader knows, nor do its "
                                      "folders; 'diorama plugins' lists the readers");
  }
  return found;
}

/// Pages of runs are the same for all of their datasets.
void print_once(const std::vector<std::string>& lines, std::set<std::string>& printed) {
  for (const std::string& line : lines) {
    if (printed.insert(line).second) print_text(line + "\n");
  }
}

}  // namespace

int command_diff(const GlobalOptions& global, const DiffOptions& options, ConsoleLog& log) {
  const JobServices services = make_services(global, log.sink());
  DatasetReaders readers(*services.registry, *services.host);
  const Pairs pairs = pairs_of(datasets_in(options.first, readers, options.reader),
                               datasets_in(options.second, readers, options.reader));
  bool is_same = pairs.alone.empty();
  std::set<std::string> printed;
  print_once(pairs.alone, printed);
  for (const auto& [first, second] : pairs.pairs) {
    const auto a = readers.open(first.folder, first.reader);
    const auto b = readers.open(second.folder, second.reader);
    const DatasetDifference difference = dataset_difference({first.folder, *a}, {second.folder, *b},
                                                            options.tolerance, *services.host);
    is_same = is_same && difference.is_empty();
    print_once(difference.pages, printed);
    const std::string name = first.folder.filename().string();
    for (const std::string& line : difference.contents) {
      print_text(name + ": " + line + "\n");
    }
    if (!difference.differing.empty()) {
      print_text(name + ": " + std::to_string(difference.differing.size()) + " of " +
                 std::to_string(difference.captures) + " captures differ\n");
    }
  }
  return is_same ? 0 : 1;
}

}  // namespace diorama
