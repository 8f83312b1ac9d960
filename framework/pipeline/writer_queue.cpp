// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/writer_queue.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <iterator>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "framework/plugins/fatal_end.h"

namespace diorama {
namespace {

// Before all visits: what is written frees memory.
constexpr int kSeatRank = 0;

// Captures, and as many for each thread: what all threads make while one visit takes long. More
// under way serve nobody, and where they are small memory would grow for thousands of them before
// the limit in bytes is met.
constexpr int kMostWaiting = 64;

/// What a transaction holds that is not on disk yet.
std::size_t transaction_bytes(const Transaction& transaction) {
  std::size_t bytes = 0;
  for (const StagedFile& file : transaction.files) bytes += file.bytes.size();
  for (const auto& [writer, line] : transaction.records) bytes += line.size();
  return bytes;
}

}  // namespace

struct WriterQueue::State {
  /// Captures by turn and, within, in the order in which they came.
  struct Place {
    int turn = 0;
    std::uint64_t number = 0;
    friend auto operator<=>(const Place&, const Place&) = default;
  };
  struct Encoded {
    int capture = 0;
    Transaction transaction;
  };

  State(const Options& given, Work consume)
      : options(given),
        work(std::move(consume)),
        least_bytes(given.max_bytes / std::size_t(kMostWaiting * (1 + given.threads))) {}

  void run() {
    std::unique_lock lock(mutex);
    while (true) {
      changed.wait(lock, [&] { return is_closing || can_commit() || can_encode(); });
      if (can_commit()) {
        commit_first(lock);
      } else if (can_encode()) {
        encode_first(lock);
      } else {
        return;
      }
    }
  }

  // All of these are called, and return, with the mutex held.

  /// What a capture is counted for, waiting or encoded.
  std::size_t counted(const PendingCapture& pending) const {
    return std::max(capture_bytes(pending), least_bytes);
  }
  std::size_t counted(const Transaction& transaction) const {
    return std::max(transaction_bytes(transaction), least_bytes);
  }

  bool is_let_through(const Place& place) const { return place.turn <= open_turn; }
  bool can_commit() const { return !encoded.empty() && is_let_through(encoded.begin()->first); }
  bool can_encode() const {
    if (waiting.empty()) return false;
    return options.encodes_ahead || is_let_through(waiting.begin()->first);
  }

  void encode_first(std::unique_lock<std::mutex>& lock) {
    std::optional<ThreadPool::Seat> seat;
    if (options.pool) {
      // Who has a seat takes the first capture, so they are begun in their order.
      lock.unlock();
      seat.emplace(*options.pool, kSeatRank);
      lock.lock();
      if (!can_encode()) return;
    }
    auto node = waiting.extract(waiting.begin());
    PendingCapture pending = std::move(node.mapped());
    const std::size_t bytes = counted(pending);
    Encoded made{pending.capture.index, {}};
    ++in_work;
    ++encoding;
    lock.unlock();
    const std::exception_ptr error =
        attempt(made.capture, [&] { made.transaction = work.encode(pending); });
    pending = PendingCapture();
    seat.reset();
    lock.lock();
    --in_work;
    --encoding;
    bytes_under_way -= bytes;
    if (error) {
      keep_error(made.capture, error);
    } else if (errors.empty()) {
      bytes_under_way += counted(made.transaction);
      encoded.emplace(node.key(), std::move(made));
    }
    count_out_if_gone(node.key());
    changed.notify_all();
  }

  void commit_first(std::unique_lock<std::mutex>& lock) {
    auto node = encoded.extract(encoded.begin());
    Encoded& made = node.mapped();
    const std::size_t bytes = counted(made.transaction);
    ++in_work;
    lock.unlock();
    const std::exception_ptr error =
        attempt(made.capture, [&] { work.commit(made.capture, made.transaction); });
    made.transaction = Transaction();
    lock.lock();
    --in_work;
    bytes_under_way -= bytes;
    if (error) keep_error(made.capture, error);
    count_out_if_gone(node.key());
    changed.notify_all();
  }

  template <class Attempt>
  static std::exception_ptr attempt(int capture, Attempt&& what) {
    try {
      const AtCapture at_capture(capture);
      what();
    } catch (...) {
      return std::current_exception();
    }
    return nullptr;
  }

  void keep_error(int capture, std::exception_ptr error) {
    errors.emplace(capture, std::move(error));
    drop_after(-1);
  }

  void count_out_if_gone(const Place& place) {
    if (!encoded.contains(place)) --under_way[place.turn];
    if (under_way[place.turn] == 0) under_way.erase(place.turn);
  }

  /// Forgets what waits, and what is encoded, of all turns behind this one.
  void drop_after(int turn) {
    const Place first{turn + 1, 0};
    for (auto at = waiting.lower_bound(first); at != waiting.end(); at = waiting.erase(at)) {
      bytes_under_way -= counted(at->second);
      count_out_if_gone(at->first);
    }
    while (!encoded.empty() && std::prev(encoded.end())->first >= first) {
      const auto node = encoded.extract(std::prev(encoded.end()));
      bytes_under_way -= counted(node.mapped().transaction);
      count_out_if_gone(node.key());
    }
    changed.notify_all();
  }

  /// A turn that is let through always has room for one capture, however large it is, or it might
  /// wait for later ones, which wait for it. Those get half of the memory; one that is larger comes
  /// in when no other is to be encoded.
  bool has_room(int turn, std::size_t bytes) const {
    if (turn <= open_turn) {
      const bool is_first = under_way.empty() || under_way.begin()->first > open_turn;
      return is_first || bytes_under_way + bytes <= options.max_bytes;
    }
    const std::size_t half = options.max_bytes / 2;
    if (bytes_under_way + bytes <= half) return true;
    const bool is_idle = waiting.empty() && encoding == 0;
    return options.encodes_ahead && is_idle && bytes_under_way <= half;
  }

  /// Waits until `is_over()`; whoever makes `has_to_stop` true cannot notify.
  template <class IsOver>
  void wait(std::unique_lock<std::mutex>& lock, const HasToStop& has_to_stop, IsOver is_over) {
    constexpr std::chrono::milliseconds kLook{100};
    if (!has_to_stop) return changed.wait(lock, is_over);
    while (!changed.wait_for(lock, kLook, is_over) && !has_to_stop()) {
    }
  }

  void rethrow() {
    if (!errors.empty()) std::rethrow_exception(errors.begin()->second);
  }

  const Options options;
  const Work work;
  const std::size_t least_bytes;  // of a capture, however small
  std::mutex mutex;
  std::condition_variable changed;
  int open_turn = 0;
  std::uint64_t next_number = 0;
  std::map<Place, PendingCapture> waiting;
  std::map<Place, Encoded> encoded;  // waiting to be written
  std::map<int, int> under_way;      // captures by turn: waiting, in work and encoded
  std::size_t bytes_under_way = 0;
  int in_work = 0;
  int encoding = 0;  // of those
  bool is_closing = false;
  std::map<int, std::exception_ptr> errors;
  std::vector<std::thread> threads;
};

std::size_t capture_bytes(const PendingCapture& pending) {
  // Too much for most channels: that covers what else a capture holds and what encoding needs.
  constexpr std::size_t kWidestPixel = sizeof(Vec3f);
  std::size_t bytes = pending.overview.pixels().size_bytes();
  for (const Frame& frame : pending.capture.frames) {
    const std::size_t pixels = std::size_t(frame.camera.width) * std::size_t(frame.camera.height);
    bytes += pixels * frame.channels().size() * kWidestPixel;
    bytes += frame.instances.size() * sizeof(Instance);
    for (const Instance& instance : frame.instances) {
      if (instance.visibility) bytes += instance.visibility->amodal_mask.bits.size();
    }
  }
  return bytes;
}

WriterQueue::WriterQueue(const Options& options, Work work)
    : state_(std::make_unique<State>(options, std::move(work))) {
  for (int i = 0; i < options.threads; ++i) {
    state_->threads.emplace_back([state = state_.get()] { state->run(); });
  }
}

WriterQueue::~WriterQueue() {
  std::optional<ThreadPool::Rest> rest;
  if (state_->options.pool) rest.emplace(*state_->options.pool);
  {
    const std::lock_guard lock(state_->mutex);
    state_->drop_after(-1);
    state_->is_closing = true;
  }
  state_->changed.notify_all();
  for (std::thread& thread : state_->threads) thread.join();
}

bool WriterQueue::push(PendingCapture pending, const HasToStop& has_to_stop) {
  // Writers that wait for a seat get this one.
  std::optional<ThreadPool::Rest> rest;
  if (state_->options.pool) rest.emplace(*state_->options.pool);
  const std::size_t bytes = state_->counted(pending);
  const int turn = pending.turn;
  std::unique_lock lock(state_->mutex);
  const auto has_room = [&] { return state_->has_room(turn, bytes); };
  state_->wait(lock, has_to_stop, [&] { return !state_->errors.empty() || has_room(); });
  state_->rethrow();
  if (!has_room()) return false;
  state_->bytes_under_way += bytes;
  ++state_->under_way[turn];
  state_->waiting.emplace(State::Place{turn, state_->next_number++}, std::move(pending));
  state_->changed.notify_all();
  return true;
}

void WriterQueue::let_through(int turn) {
  const std::lock_guard lock(state_->mutex);
  state_->open_turn = turn;
  state_->changed.notify_all();
}

void WriterQueue::drop_later_turns() {
  const std::lock_guard lock(state_->mutex);
  state_->drop_after(state_->open_turn);
}

void WriterQueue::drop_waiting() {
  const std::lock_guard lock(state_->mutex);
  state_->drop_after(-1);
}

bool WriterQueue::drain(const HasToStop& has_to_stop) {
  std::optional<ThreadPool::Rest> rest;
  if (state_->options.pool) rest.emplace(*state_->options.pool);
  std::unique_lock lock(state_->mutex);
  const auto is_settled = [&] { return !state_->can_commit() && !state_->can_encode(); };
  const auto is_idle = [&] { return is_settled() && state_->in_work == 0; };
  state_->wait(lock, has_to_stop, is_idle);
  // What is begun is written all the same.
  if (is_settled()) state_->changed.wait(lock, is_idle);
  state_->rethrow();
  return is_idle();
}

}  // namespace diorama
