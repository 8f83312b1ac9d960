// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "diorama/frame.h"

namespace diorama {

/// A capture on its way to the writers.
struct PendingCapture {
  Capture capture;
  Image<Rgba8> overview;    ///< Empty unless this capture carries the visit's overview picture.
  std::string settle_json;  ///< Empty unless this capture is the visit's last.
  std::string views_json;   ///< Empty unless the job has conditions for its views.
};

/// Memory that a capture's pictures hold, from above.
std::size_t capture_bytes(const PendingCapture& pending);

/// Hands captures to threads that encode and write them while the next one is rendered. push()
/// waits while more than a number of bytes is under way, so memory stays bounded whatever the speed
/// of the disk. One thread pushes.
class WriterQueue {
 public:
  using Work = std::function<void(const PendingCapture&)>;

  /// `work` is called from several threads at once; it must outlive nothing but the queue.
  WriterQueue(int threads, std::size_t max_bytes, Work work);
  /// Waits for the captures under way, drops the waiting ones.
  ~WriterQueue();
  WriterQueue(const WriterQueue&) = delete;
  WriterQueue& operator=(const WriterQueue&) = delete;

  /// Whether the queue took it: not when it had no room yet as `stop` (may be null) became true.
  /// Rethrows what a worker threw, that of the lowest capture first; afterwards the queue takes no
  /// more.
  [[nodiscard]] bool push(PendingCapture pending, const std::atomic<bool>* stop = nullptr);
  /// Forgets captures whose writing has not begun.
  void drop_waiting();
  /// Returns true when all that was pushed is written, false when captures still waited as `stop`
  /// (may be null) became true; rethrows like push().
  bool drain(const std::atomic<bool>* stop = nullptr);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace diorama
