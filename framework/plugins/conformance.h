// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "framework/host/log.h"

namespace diorama {

/// One thing that was tried with a plugin.
struct CheckResult {
  std::string subject;  ///< The file's name, or "writer/boxes".
  std::string check;    ///< "unknown keys are refused"
  std::string failure;  ///< Empty: passed.
};

/// Tries what every plugin must hold: descriptor and ABI, loading, documented parameters, defaults
/// that are valid, complaints about unknown keys, wrong types and values out of range, and per kind
/// the calls that must survive empty input. Throws nothing for faults of the plugin.
std::vector<CheckResult> check_plugin(const std::filesystem::path& file, const Log& log);

}  // namespace diorama
