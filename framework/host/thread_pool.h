// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace diorama {

/// Threads that share loops out among themselves. parallel_for() may be called from several threads
/// at once; the calls then share the pool's threads.
class ThreadPool {
 public:
  /// `threads` >= 1 counts the calling thread, so 1 starts none. Throws Error(Usage) when < 1.
  explicit ThreadPool(int threads);
  ~ThreadPool();

  /// See Host::parallel_for. After an error at index i, indices above i may be left out; all below
  /// are run, so the error that is rethrown does not depend on timing.
  void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body);
  int thread_count() const;

  /// What the machine offers to this process (its CPU affinity and cgroup quota), at least 1.
  static int available_threads();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace diorama
