// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace diorama::loader_assimp {

struct ChildLimits {
  int cpu_seconds = 10;
  std::uint64_t added_bytes = 0;  ///< Memory beyond what the process has.
  int clock_seconds = 240;        ///< For a child that waits or gets no processor.
};

/// Runs `body` in a child process and returns what it returned; text that begins with "crashes" or
/// "takes more than" when it did not get that far. A child that sleeps for a second or two is given
/// up and replaced, twice at most: threads of the parent may have held locks that the body needs.
/// Nothing that the body does to memory is seen here. If no child can be made, the body does not
/// run and the result is empty.
std::string run_in_child(const ChildLimits& limits, const std::function<std::string()>& body);

}  // namespace diorama::loader_assimp
