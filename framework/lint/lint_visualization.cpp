// SPDX-License-Identifier: Apache-2.0
#include <set>
#include <stdexcept>
#include <string>

#include "framework/lint/lint_formats.h"

namespace diorama::lint {

void lint_visualization(Dataset& dataset) {
  std::set<std::string> folders, kinds, numbers;
  for (const std::string& file : dataset.files()) {
    if (!file.ends_with(".png")) continue;
    dataset.picture(file);
    const std::size_t slash = file.rfind('/') + 1;  // 0 without a folder
    const std::size_t cut = file.rfind('_');
    if (cut == std::string::npos || cut < slash) continue;
    folders.insert(file.substr(0, slash));
    kinds.insert(file.substr(slash, cut - slash));
    numbers.insert(file.substr(cut));
  }
  if (folders.size() * kinds.size() * numbers.size() > 1000 + 100 * dataset.files().size()) {
    throw std::runtime_error("its files are not those of one dataset");
  }
  for (const std::string& folder : folders) {
    for (const std::string& kind : kinds) {
      for (const std::string& number : numbers) {
        const std::string file = folder + kind + number;
        dataset.check(dataset.has(file), "nothing is missing", file,
                      "other pictures of this frame are there");
      }
    }
  }
}

}  // namespace diorama::lint
