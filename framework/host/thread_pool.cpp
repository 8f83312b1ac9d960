// SPDX-License-Identifier: Apache-2.0
#include "framework/host/thread_pool.h"

#include <sched.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <limits>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "diorama/error.h"
#include "framework/host/machine_limits.h"

namespace diorama {
namespace {

/// True in threads that run a body, where loops run in place.
bool& is_inside_body() {
  thread_local bool is_inside = false;
  return is_inside;
}

/// One parallel_for call. Indices are handed out in ascending order.
class Loop {
 public:
  Loop(std::size_t count, const std::function<void(std::size_t)>& body)
      : count_(count), body_(body) {}

  bool has_work() const { return next_.load() < std::min(count_, first_error_.load()); }

  void work() {
    const bool was_inside = std::exchange(is_inside_body(), true);
    for (;;) {
      const std::size_t i = next_.fetch_add(1);
      if (i >= count_ || i > first_error_.load()) break;
      try {
        body_(i);
      } catch (...) {
        keep_error(i);
      }
    }
    is_inside_body() = was_inside;
  }

  void rethrow() const {
    if (error_) std::rethrow_exception(error_);
  }

  int helpers = 0;  // guarded by the pool's mutex

 private:
  void keep_error(std::size_t index) {
    const std::lock_guard lock(error_mutex_);
    if (index >= first_error_.load()) return;
    first_error_ = index;
    error_ = std::current_exception();
  }

  const std::size_t count_;
  const std::function<void(std::size_t)>& body_;
  std::atomic<std::size_t> next_{0};
  std::atomic<std::size_t> first_error_{std::numeric_limits<std::size_t>::max()};
  std::mutex error_mutex_;
  std::exception_ptr error_;
};

}  // namespace

struct ThreadPool::State {
  std::mutex mutex;
  std::condition_variable has_loop;
  std::condition_variable helper_left;
  std::deque<Loop*> loops;
  bool is_ending = false;
  std::vector<std::thread> threads;

  int free_seats = 0;
  std::map<std::thread::id, int> seated;  // rank, of threads that are not the pool's own
  std::map<std::pair<int, std::uint64_t>, std::thread::id> waiting;  // by rank and order
  std::uint64_t next_in_line = 0;
  std::condition_variable seat_taken;

  void help_until_end() {
    std::unique_lock lock(mutex);
    for (;;) {
      has_loop.wait(lock, [&] { return is_ending || (!loops.empty() && free_seats > 0); });
      if (is_ending) return;
      Loop* loop = loops.front();
      if (!loop->has_work()) {
        loops.pop_front();
        continue;
      }
      ++loop->helpers;
      --free_seats;
      lock.unlock();
      loop->work();
      lock.lock();
      --loop->helpers;
      helper_left.notify_all();
      give_back_seat();
    }
  }

  // These three are called with the mutex held.

  void take_seat(std::unique_lock<std::mutex>& lock, int rank) {
    const std::thread::id self = std::this_thread::get_id();
    waiting.emplace(std::pair(rank, next_in_line++), self);
    hand_out_seats();
    seat_taken.wait(lock, [&] { return seated.contains(self); });
  }

  void give_back_seat() {
    ++free_seats;
    hand_out_seats();
  }

  void hand_out_seats() {
    bool is_taken = false;
    for (; free_seats > 0 && !waiting.empty(); --free_seats) {
      const auto first = waiting.begin();
      seated.emplace(first->second, first->first.first);
      waiting.erase(first);
      is_taken = true;
    }
    if (is_taken) seat_taken.notify_all();
    if (free_seats > 0 && !loops.empty()) has_loop.notify_all();
  }
};

ThreadPool::ThreadPool(int threads) : state_(std::make_unique<State>()) {
  if (threads < 1 || threads > 1024) {
    throw Error(ErrorKind::Usage, "expected 1 to 1024 threads, found " + std::to_string(threads));
  }
  state_->seated.emplace(std::this_thread::get_id(), std::numeric_limits<int>::max());
  state_->free_seats = threads - 1;
  for (int i = 1; i < threads; ++i) {
    state_->threads.emplace_back([state = state_.get()] { state->help_until_end(); });
  }
}

ThreadPool::~ThreadPool() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->is_ending = true;
  }
  state_->has_loop.notify_all();
  for (std::thread& thread : state_->threads) thread.join();
}

ThreadPool::Seat::Seat(ThreadPool& pool, int rank) : pool_(pool) {
  std::unique_lock lock(pool_.state_->mutex);
  pool_.state_->take_seat(lock, rank);
}

ThreadPool::Seat::~Seat() {
  const std::lock_guard lock(pool_.state_->mutex);
  pool_.state_->seated.erase(std::this_thread::get_id());
  pool_.state_->give_back_seat();
}

ThreadPool::Rest::Rest(ThreadPool& pool) : pool_(pool) {
  const std::lock_guard lock(pool_.state_->mutex);
  const auto own = pool_.state_->seated.find(std::this_thread::get_id());
  had_seat_ = own != pool_.state_->seated.end();
  if (!had_seat_) return;
  rank_ = own->second;
  pool_.state_->seated.erase(own);
  pool_.state_->give_back_seat();
}

ThreadPool::Rest::~Rest() {
  if (!had_seat_) return;
  std::unique_lock lock(pool_.state_->mutex);
  pool_.state_->take_seat(lock, rank_);
}

void ThreadPool::parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) {
  Loop loop(count, body);
  if (count < 2 || state_->threads.empty() || is_inside_body()) {
    loop.work();
    loop.rethrow();
    return;
  }
  {
    const std::lock_guard lock(state_->mutex);
    state_->loops.push_back(&loop);
    if (state_->free_seats > 0) state_->has_loop.notify_all();
  }
  loop.work();
  {
    std::unique_lock lock(state_->mutex);
    std::erase(state_->loops, &loop);
    state_->helper_left.wait(lock, [&] { return loop.helpers == 0; });
  }
  loop.rethrow();
}

int ThreadPool::thread_count() const { return int(state_->threads.size()) + 1; }

int ThreadPool::available_threads() {
  int count = int(std::thread::hardware_concurrency());
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof set, &set) == 0) count = CPU_COUNT(&set);
  const int quota = quota_cpus();
  if (quota > 0) count = std::min(count, quota);
  return std::max(count, 1);
}

}  // namespace diorama
