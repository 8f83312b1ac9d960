// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "diorama/frame.h"
#include "framework/host/thread_pool.h"
#include "framework/output/output_store.h"

namespace diorama {

/// A capture on its way to the writers.
struct PendingCapture {
  Capture capture;
  int turn = 0;             ///< See WriterQueue; those of one turn come in capture order.
  Image<Rgba8> overview;    ///< Empty unless this capture carries the visit's overview picture.
  std::string settle_json;  ///< Empty unless this capture is the visit's last.
  std::string views_json;   ///< Empty unless the job has conditions for its views.
};

/// Memory that a capture's pictures hold, from above.
std::size_t capture_bytes(const PendingCapture& pending);

/// Hands captures to threads that encode and write them while the next one is rendered. push()
/// waits while more than a number of bytes, or of captures, is under way, so memory stays bounded
/// whatever the speed of the disk.
///
/// Captures of later turns may come before those of earlier ones. Nothing of a turn is written
/// before it is let through, so that the dataset never holds what an error before it would have
/// left out. Several threads push, each turn one.
class WriterQueue {
 public:
  struct Options {
    int threads = 1;
    std::size_t max_bytes = 0;
    ThreadPool* pool = nullptr;  ///< Encoding takes a seat in it; null: it takes none.
    /// Whether captures are encoded before their turn. If not, encoding begins in capture order.
    bool encodes_ahead = true;
  };
  /// Both are called from several threads at once.
  struct Work {
    std::function<Transaction(const PendingCapture&)> encode;
    std::function<void(int capture, Transaction&)> commit;
  };
  using HasToStop = std::function<bool()>;

  /// Turn 0 is let through.
  WriterQueue(const Options& options, Work work);
  /// Waits for the captures under way, drops the waiting ones.
  ~WriterQueue();
  WriterQueue(const WriterQueue&) = delete;
  WriterQueue& operator=(const WriterQueue&) = delete;

  /// Whether the queue took it: not when it had no room yet as `has_to_stop` (may be empty) became
  /// true. Rethrows what a worker threw, that of the lowest capture first; afterwards the queue
  /// takes no more.
  [[nodiscard]] bool push(PendingCapture pending, const HasToStop& has_to_stop = {});
  /// Captures of this turn and of those before it may be written from now on.
  void let_through(int turn);
  /// Forgets captures whose turn was not let through.
  void drop_later_turns();
  /// Forgets captures whose writing has not begun.
  void drop_waiting();
  /// Returns true when all that was pushed and let through is written, false when captures still
  /// waited as `has_to_stop` (may be empty) became true; rethrows like push().
  bool drain(const HasToStop& has_to_stop = {});

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace diorama
