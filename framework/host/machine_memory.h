// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

namespace diorama {

/// Bytes that this process may still take without others being swapped out: what the system says
/// is available, or what is left of the limits of its cgroups (version 2) if that is less. `root`
/// is where /proc and /sys are, for tests. The largest number when nothing is known.
std::uint64_t available_memory(const std::filesystem::path& root = "/");

}  // namespace diorama
