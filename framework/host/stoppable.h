// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>

namespace diorama {

/// While it lives, its thread works on something that may be thrown away half made: a visit. What
/// the thread asks of the host stops when the job does, as on the main thread, and also when this
/// flag becomes true.
class Stoppable {
 public:
  explicit Stoppable(const std::atomic<bool>& stop);
  ~Stoppable();
  Stoppable(const Stoppable&) = delete;
  Stoppable& operator=(const Stoppable&) = delete;

  /// The flag of the innermost one on this thread; null without one.
  static const std::atomic<bool>* flag_of_this_thread();

 private:
  const std::atomic<bool>* before_;
};

}  // namespace diorama
