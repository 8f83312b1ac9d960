// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "framework/conformance/check_run.h"
#include "framework/conformance/isolated.h"
#include "framework/host/log.h"

namespace diorama {

/// Tries what every plugin must hold: descriptor and ABI, loading, parameters, and what the kind of
/// each component promises (kinds.h). Each component runs in a process and an empty folder of its
/// own, so that a crash, a hang, a leak (in builds with sanitizers) and files left behind are
/// failed checks; then in a second process with other surroundings, where the same must come out.
/// Throws nothing for faults of the plugin.
std::vector<conformance::CheckResult> check_plugin(const std::filesystem::path& file,
                                                   const Log& log,
                                                   const conformance::CheckLimits& limits = {});

}  // namespace diorama
