// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "framework/plugins/plugin_file.h"

namespace diorama {

/// Folders of equal rank. Earlier levels win over later ones.
struct SearchLevel {
  std::string name;  ///< For messages: "--plugin-dir", "DIORAMA_PLUGIN_PATH" ...
  std::vector<std::filesystem::path> folders;
  bool must_exist = false;  ///< A missing folder is a rejected one.
};

/// A folder, file or component that was found and not taken.
struct RejectedPlugin {
  std::filesystem::path file;
  std::string reason;  ///< A whole message; begins with the file.
};

struct FoundPlugin {
  PluginFile plugin;
  int level = 0;  ///< Index into PluginSearch::levels.
};

struct PluginSearch {
  std::vector<SearchLevel> levels;
  std::vector<FoundPlugin> plugins;  ///< By level, then by path.
  std::vector<RejectedPlugin> rejected;
};

/// Looks up an environment variable; null when it is not set.
using Environment = std::function<const char*(const char* name)>;

/// The levels in the order of the design: command line, DIORAMA_PLUGIN_PATH,
/// $XDG_DATA_HOME/diorama/plugins-<abi> (else below ~/.local/share) and what is installed below
/// ~/.local, `local`, the bundled plugins.
std::vector<SearchLevel> plugin_search_levels(
    const std::vector<std::filesystem::path>& command_line, const Environment& environment,
    const std::filesystem::path& bundled,
    const std::optional<std::filesystem::path>& local = std::nullopt);

/// Looks through the folders for *.so files. Throws nothing for bad plugins: they are rejected with
/// a reason and the rest goes on. Folders and files that others may change, or exchange through a
/// folder above them, are refused unless `allow_unsafe_folders` (file_safety.h).
PluginSearch search_plugins(std::vector<SearchLevel> levels, bool allow_unsafe_folders);

/// Where the plugins of this program are: <build>/plugins in a build tree, else
/// <libdir>/diorama/plugins-<abi> seen from the program's folder.
std::filesystem::path bundled_plugin_folder(const std::filesystem::path& program);

/// Where plugins that are installed below /usr/local are; nothing for a program in a build tree.
std::optional<std::filesystem::path> local_plugin_folder(const std::filesystem::path& program);

/// The sample pack that belongs to this program, in a build tree or installed; may not exist.
std::filesystem::path sample_pack_folder(const std::filesystem::path& program);

/// Where the program lies that was installed, or built, with this library.
std::filesystem::path program_beside(const std::filesystem::path& library);

/// The running program, links resolved.
std::filesystem::path program_file();

}  // namespace diorama
