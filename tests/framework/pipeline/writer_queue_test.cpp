// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/writer_queue.h"

#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <thread>

#include "diorama/error.h"
#include "support/catch.h"

using namespace diorama;

namespace {

PendingCapture capture_of(int index, int pixels) {
  PendingCapture pending;
  pending.capture.index = index;
  pending.overview = Image<Rgba8>(pixels, 1, Rgba8{});
  return pending;
}

}  // namespace

TEST_CASE("Every capture that was pushed is worked on once", "[queue]") {
  std::mutex mutex;
  std::multiset<int> seen;
  {
    WriterQueue queue(3, 1000, [&](const PendingCapture& pending) {
      const std::lock_guard lock(mutex);
      seen.insert(pending.capture.index);
    });
    for (int i = 0; i < 200; ++i) CHECK(queue.push(capture_of(i, 10)));
    queue.drain();
  }
  CHECK(seen.size() == 200);
  CHECK(std::set<int>(seen.begin(), seen.end()).size() == 200);
}

TEST_CASE("No more bytes are under way than allowed, but one capture always is", "[queue]") {
  // 40 bytes each, 100 allowed: two at a time.
  std::atomic<int> under_way = 0;
  std::atomic<int> most = 0;
  WriterQueue queue(8, 100, [&](const PendingCapture&) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    --under_way;
  });
  for (int i = 0; i < 50; ++i) {
    // Counted when push() returns, so never below what the queue holds less one.
    REQUIRE(queue.push(capture_of(i, 10)));
    most = std::max(most.load(), ++under_way);
  }
  REQUIRE(queue.push(capture_of(50, 1000)));
  queue.drain();
  CHECK(most <= 3);
}

TEST_CASE("An error in the work comes out of the queue and ends it", "[queue]") {
  std::atomic<int> worked = 0;
  WriterQueue queue(2, 1 << 20, [&](const PendingCapture& pending) {
    ++worked;
    if (pending.capture.index >= 3) {
      throw Error(ErrorKind::Output, "no room for " + std::to_string(pending.capture.index));
    }
  });
  const auto push_all = [&] {
    for (int i = 0; i < 1000; ++i) static_cast<void>(queue.push(capture_of(i, 1)));
    queue.drain();
  };
  CHECK_THROWS_WITH(push_all(), ContainsSubstring("no room for"));
  CHECK_THROWS_WITH(queue.drain(), ContainsSubstring("no room for"));
  CHECK(worked < 1000);
}

TEST_CASE("Who asks a run to stop does not wait for captures whose writing has not begun",
          "[queue]") {
  std::atomic<bool> stop = false;
  std::atomic<bool> is_disk_back = false;
  std::atomic<int> worked = 0;
  // One in work, which the disk holds up, and one waiting: no room for a third.
  WriterQueue queue(1, 80, [&](const PendingCapture&) {
    ++worked;
    is_disk_back.wait(false);
  });
  REQUIRE(queue.push(capture_of(0, 10), &stop));
  REQUIRE(queue.push(capture_of(1, 10), &stop));
  while (worked == 0) std::this_thread::yield();
  stop = true;
  CHECK_FALSE(queue.push(capture_of(2, 10), &stop));
  CHECK_FALSE(queue.drain(&stop));
  queue.drop_waiting();
  is_disk_back = true;
  is_disk_back.notify_all();
  CHECK(queue.drain(&stop));
  CHECK(worked == 1);
}
