// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <array>
#include <csignal>
#include <map>
#include <set>
#include <string>

namespace diorama::conformance {

/// What belongs to the whole process and is no component's to change.
class ProcessState {
 public:
  ProcessState();  ///< As it is now.
  /// Throws Error(Plugin) with what differs from then.
  void require_unchanged() const;

 private:
  std::string folder_;
  mode_t mask_ = 0;
  std::string locale_;
  int rounding_ = 0;
  bool keeps_tiny_numbers_ = true;
  std::map<std::string, std::string> environment_;
  std::multiset<std::string> files_;
  std::array<void (*)(int), NSIG> handlers_{};
  sigset_t blocked_{};  ///< Of the calling thread.
};

}  // namespace diorama::conformance
