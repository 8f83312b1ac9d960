// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "diorama/host.h"
#include "framework/images/image_codecs.h"

namespace diorama {

/// What holds for whatever is done: where plugins and assets are, and how much may be used.
struct GlobalOptions {
  std::filesystem::path program;  ///< The running executable, links resolved.
  LogLevel log_level = LogLevel::Info;
  int threads = 0;  ///< 0: as many as the machine offers.
  int picture_mib = int(kPictureBudget >> 20);
  int asset_cache_mib = 1024;
  std::vector<std::filesystem::path> plugin_dirs;
  bool allow_unsafe_plugin_dir = false;
  std::optional<std::filesystem::path> assets_root;
};

/// Which job, and what is changed in it.
struct JobOptions {
  std::filesystem::path job;      ///< Empty: the built-in one.
  std::vector<std::string> sets;  ///< "key=value", in order.
  std::optional<std::uint64_t> seed;
  std::optional<std::string> output;  ///< Output folder.
};

}  // namespace diorama
