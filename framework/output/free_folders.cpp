// SPDX-License-Identifier: Apache-2.0
#include "framework/output/free_folders.h"

#include <algorithm>
#include <set>
#include <string>
#include <system_error>
#include <vector>

#include "diorama/error.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

fs::path plain(const fs::path& path) {
  std::error_code ignored;
  const fs::path normal = fs::absolute(path.empty() ? "." : path, ignored).lexically_normal();
  return normal.has_filename() ? normal : normal.parent_path();
}

bool is_below(const fs::path& path, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first ==
         folder.end();
}

std::vector<std::string> names_in(const fs::path& folder) {
  std::error_code failed;
  std::vector<std::string> names;
  for (fs::directory_iterator entry(folder, failed), end; !failed && entry != end;
       entry.increment(failed)) {
    names.push_back(entry->path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

bool is_of_dataset(const std::string& name) {
  return name == "dataset.json" || name.starts_with(".diorama");
}

}  // namespace

void check_folders_are_free(const OutputFolders& folders) {
  const auto is_known = [&] {
    const std::vector<std::string> names = names_in(folders.records_path());
    return std::any_of(names.begin(), names.end(), is_of_dataset);
  };
  if (is_known()) return;
  std::set<fs::path> claimed{plain(folders.records_path())};
  for (const auto& writer : folders.writers) claimed.insert(plain(folders.base / writer.folder));
  for (const fs::path& folder : claimed) {
    for (const std::string& name : names_in(folder)) {
      const fs::path path = folder / name;
      const bool is_own = std::any_of(claimed.begin(), claimed.end(),
                                      [&](const fs::path& own) { return is_below(own, path); });
      // File systems have one of these at their root.
      if (is_own || name.starts_with('.') || name == "lost+found") continue;
      // Another worker may have begun the dataset since the first look.
      if (is_known()) return;
      throw Error(ErrorKind::Output, folder.string() + ": holds '" + name +
                                         "', which is of no dataset; choose a new or empty "
                                         "folder by '--output', or move it away");
    }
  }
}

}  // namespace diorama
