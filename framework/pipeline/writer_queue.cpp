// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/writer_queue.h"

#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "framework/plugins/fatal_end.h"

namespace diorama {

struct WriterQueue::State {
  State(std::size_t max, Work consume) : max_bytes(max), work(std::move(consume)) {}

  void run() {
    std::unique_lock lock(mutex);
    while (true) {
      changed.wait(lock, [&] { return is_closing || !waiting.empty(); });
      if (waiting.empty()) return;
      PendingCapture pending = std::move(waiting.front());
      waiting.pop_front();
      ++in_work;
      lock.unlock();
      finish_one(std::move(pending), lock);
    }
  }

  /// Returns with the lock held.
  void finish_one(PendingCapture pending, std::unique_lock<std::mutex>& lock) {
    const std::size_t bytes = capture_bytes(pending);
    const int index = pending.capture.index;
    std::exception_ptr error;
    try {
      const AtCapture at_capture(index);
      work(pending);
    } catch (...) {
      error = std::current_exception();
    }
    pending = PendingCapture();
    lock.lock();
    if (error) {
      errors.emplace(index, error);
      drop_waiting();
    }
    bytes_under_way -= bytes;
    --in_work;
    changed.notify_all();
  }

  void drop_waiting() {
    for (const PendingCapture& pending : waiting) bytes_under_way -= capture_bytes(pending);
    waiting.clear();
  }

  /// Waits until `is_over()`; whoever sets `stop` cannot notify.
  template <class IsOver>
  void wait(std::unique_lock<std::mutex>& lock, const std::atomic<bool>* stop, IsOver is_over) {
    constexpr std::chrono::milliseconds kLook{100};
    if (!stop) return changed.wait(lock, is_over);
    while (!changed.wait_for(lock, kLook, is_over) && !*stop) {
    }
  }

  void rethrow() {
    if (!errors.empty()) std::rethrow_exception(errors.begin()->second);
  }

  const std::size_t max_bytes;
  const Work work;
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<PendingCapture> waiting;
  std::size_t bytes_under_way = 0;
  int in_work = 0;
  bool is_closing = false;
  std::map<int, std::exception_ptr> errors;
  std::vector<std::thread> threads;
};

std::size_t capture_bytes(const PendingCapture& pending) {
  constexpr std::size_t kWidestPixel = sizeof(Vec3f);
  std::size_t bytes = pending.overview.pixels().size_bytes();
  for (const Frame& frame : pending.capture.frames) {
    const std::size_t pixels = std::size_t(frame.camera.width) * std::size_t(frame.camera.height);
    bytes += pixels * frame.channels().size() * kWidestPixel;
    for (const Instance& instance : frame.instances) {
      if (instance.visibility) bytes += instance.visibility->amodal_mask.bits.size();
    }
  }
  return bytes;
}

WriterQueue::WriterQueue(int threads, std::size_t max_bytes, Work work)
    : state_(std::make_unique<State>(max_bytes, std::move(work))) {
  for (int i = 0; i < threads; ++i) {
    state_->threads.emplace_back([state = state_.get()] { state->run(); });
  }
}

WriterQueue::~WriterQueue() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->drop_waiting();
    state_->is_closing = true;
  }
  state_->changed.notify_all();
  for (std::thread& thread : state_->threads) thread.join();
}

bool WriterQueue::push(PendingCapture pending, const std::atomic<bool>* stop) {
  const std::size_t bytes = capture_bytes(pending);
  std::unique_lock lock(state_->mutex);
  // One capture always has room, however large it is.
  const auto has_room = [&] {
    return state_->bytes_under_way == 0 || state_->bytes_under_way + bytes <= state_->max_bytes;
  };
  state_->wait(lock, stop, [&] { return !state_->errors.empty() || has_room(); });
  state_->rethrow();
  if (!has_room()) return false;
  state_->bytes_under_way += bytes;
  state_->waiting.push_back(std::move(pending));
  state_->changed.notify_all();
  return true;
}

void WriterQueue::drop_waiting() {
  const std::lock_guard lock(state_->mutex);
  state_->drop_waiting();
  state_->changed.notify_all();
}

bool WriterQueue::drain(const std::atomic<bool>* stop) {
  std::unique_lock lock(state_->mutex);
  const auto is_idle = [&] { return state_->waiting.empty() && state_->in_work == 0; };
  state_->wait(lock, stop, is_idle);
  // What is begun is written all the same.
  if (state_->waiting.empty()) state_->changed.wait(lock, is_idle);
  state_->rethrow();
  return is_idle();
}

}  // namespace diorama
