// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace diorama {

/// Threads that share loops out among themselves. parallel_for() may be called from several threads
/// at once; the calls then share the pool's threads.
///
/// The pool has as many seats as threads, and its own threads help with a loop only while a seat is
/// free. Threads of others that work for long (visits, writers) sit down as well, so that all
/// together keep as many cores busy as the job may use, however many threads there are.
class ThreadPool {
 public:
  /// `threads` >= 1 counts the calling thread, which has a seat from now on; so 1 starts none.
  /// Throws Error(Usage) when < 1.
  explicit ThreadPool(int threads);
  ~ThreadPool();

  /// While it lives, its thread has a seat. Whoever waits with the lowest rank gets the next one,
  /// those of equal rank in the order in which they came, and helpers of loops what is left. Not
  /// for threads that have one.
  class Seat {
   public:
    Seat(ThreadPool& pool, int rank);
    ~Seat();
    Seat(const Seat&) = delete;
    Seat& operator=(const Seat&) = delete;

   private:
    ThreadPool& pool_;
  };

  /// While it lives, others may have its thread's seat: around everything that waits for them.
  /// Nothing happens in a thread without one.
  class Rest {
   public:
    explicit Rest(ThreadPool& pool);
    ~Rest();
    Rest(const Rest&) = delete;
    Rest& operator=(const Rest&) = delete;

   private:
    ThreadPool& pool_;
    int rank_ = 0;
    bool had_seat_ = false;
  };

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
