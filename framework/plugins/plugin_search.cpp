// SPDX-License-Identifier: Apache-2.0
#include "framework/plugins/plugin_search.h"

#include <algorithm>
#include <string_view>
#include <system_error>

#include "framework/plugins/file_safety.h"

namespace diorama {
namespace {

namespace fs = std::filesystem;

constexpr const char* kAbiFolder = "plugins-" DIORAMA_DETAIL_TEXT(DIORAMA_SDK_ABI);

std::vector<fs::path> split_folders(std::string_view list) {
  std::vector<fs::path> folders;
  while (!list.empty()) {
    const std::size_t colon = list.find(':');
    if (colon != 0) folders.emplace_back(list.substr(0, colon));
    list.remove_prefix(colon == std::string_view::npos ? list.size() : colon + 1);
  }
  return folders;
}

/// As an installation below `prefix` has it.
fs::path plugin_folder_below(const fs::path& prefix) {
  return (prefix / "bin" / DIORAMA_LIB_FROM_BIN / "diorama" / kAbiFolder).lexically_normal();
}

bool is_build_tree(const fs::path& program) {
  return fs::exists(program.parent_path().parent_path() / "CMakeCache.txt");
}

class Searcher {
 public:
  Searcher(PluginSearch& search, bool allow_unsafe_folders)
      : search_(search), allow_unsafe_folders_(allow_unsafe_folders), safety_(program_file()) {}

  void look_through(const fs::path& folder, int level) {
    const SearchLevel& rank = search_.levels[std::size_t(level)];
    std::error_code failed;
    const fs::file_status status = fs::status(folder, failed);
    if (!fs::is_directory(status)) {
      if (!rank.must_exist && !fs::exists(status)) return;
      reject(folder, "given by " + rank.name + ", but it is no folder");
      return;
    }
    if (is_dangerous(folder, true)) return;
    for (const fs::path& file : libraries_in(folder)) take(file, level);
  }

 private:
  bool is_dangerous(const fs::path& place, bool is_plugin_folder) {
    if (allow_unsafe_folders_) return false;
    const std::string danger = safety_.danger(place, is_plugin_folder);
    if (danger.empty()) return false;
    reject(place, danger + ", or give --allow-unsafe-plugin-dir");
    return true;
  }

  std::vector<fs::path> libraries_in(const fs::path& folder) {
    std::vector<fs::path> files;
    std::error_code failed;
    for (fs::directory_iterator entry(folder, failed), end; !failed && entry != end;
         entry.increment(failed)) {
      if (entry->path().extension() == ".so") files.push_back(entry->path());
    }
    if (failed) reject(folder, "the plugin folder cannot be listed: " + failed.message());
    std::sort(files.begin(), files.end());
    return files;
  }

  void take(const fs::path& file, int level) {
    std::error_code failed;
    const fs::path real = fs::canonical(file, failed);
    if (failed) {
      reject(file, fs::is_symlink(file)
                       ? "is a symbolic link to a file that is not there; remove it "
                         "or install its target"
                       : "cannot be found: " + failed.message());
      return;
    }
    if (!fs::is_regular_file(real, failed)) {
      reject(file, "is no regular file; a plugin is an ELF file that ends in .so");
      return;
    }
    // A folder that stands on two levels, or a link beside its target, is one plugin.
    if (std::find(seen_.begin(), seen_.end(), real) != seen_.end()) return;
    seen_.push_back(real);
    if (is_dangerous(file, false)) return;
    try {
      search_.plugins.push_back({read_plugin_file(file), level});
    } catch (const Error& error) {
      search_.rejected.push_back({file, error.what()});
    }
  }

  void reject(const fs::path& file, const std::string& reason) {
    search_.rejected.push_back({file, file.string() + ": " + reason});
  }

  PluginSearch& search_;
  bool allow_unsafe_folders_;
  FileSafety safety_;
  std::vector<fs::path> seen_;
};

}  // namespace

std::vector<SearchLevel> plugin_search_levels(const std::vector<fs::path>& command_line,
                                              const Environment& environment,
                                              const fs::path& bundled,
                                              const std::optional<fs::path>& local) {
  std::vector<SearchLevel> levels;
  levels.push_back({"--plugin-dir", command_line, true});
  if (const char* list = environment("DIORAMA_PLUGIN_PATH")) {
    levels.push_back({"DIORAMA_PLUGIN_PATH", split_folders(list), true});
  }
  const char* data = environment("XDG_DATA_HOME");
  const char* home = environment("HOME");
  // The XDG specification says that relative paths are to be ignored.
  const bool has_data = data && fs::path(data).is_absolute();
  if (has_data || (home && fs::path(home).is_absolute())) {
    const fs::path share = has_data ? fs::path(data) : fs::path(home) / ".local/share";
    std::vector<fs::path> folders{share / "diorama" / kAbiFolder};
    // Where `cmake --install --prefix ~/.local` puts plugins.
    if (share.filename() == "share") folders.push_back(plugin_folder_below(share.parent_path()));
    levels.push_back({has_data ? "XDG_DATA_HOME" : "the home folder", folders, false});
  }
  if (local && *local != bundled) levels.push_back({"the local system", {*local}, false});
  levels.push_back({"bundled", {bundled}, false});
  return levels;
}

PluginSearch search_plugins(std::vector<SearchLevel> levels, bool allow_unsafe_folders) {
  PluginSearch search;
  search.levels = std::move(levels);
  Searcher searcher(search, allow_unsafe_folders);
  for (std::size_t level = 0; level < search.levels.size(); ++level) {
    for (const fs::path& folder : search.levels[level].folders) {
      searcher.look_through(folder, int(level));
    }
  }
  return search;
}

fs::path bundled_plugin_folder(const fs::path& program) {
  if (is_build_tree(program)) return program.parent_path().parent_path() / "plugins";
  return plugin_folder_below(program.parent_path().parent_path());
}

std::optional<fs::path> local_plugin_folder(const fs::path& program) {
  if (is_build_tree(program)) return std::nullopt;
  return plugin_folder_below("/usr/local");
}

fs::path sample_pack_folder(const fs::path& program) {
  return program.parent_path().parent_path() / "share/diorama/assets";
}

fs::path program_beside(const fs::path& library) {
  const fs::path folder = library.parent_path();
  // Build trees have programs and libraries side by side.
  if (is_build_tree(library)) return folder.parent_path() / "bin/diorama";
  return (folder / DIORAMA_BIN_FROM_LIB / "diorama").lexically_normal();
}

fs::path program_file() {
  std::error_code failed;
  fs::path program = fs::read_symlink("/proc/self/exe", failed);
  if (failed) {
    throw Error(ErrorKind::Internal, "/proc/self/exe: " + failed.message() + "; is /proc mounted?");
  }
  return program;
}

}  // namespace diorama
