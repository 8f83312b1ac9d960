// SPDX-License-Identifier: Apache-2.0
#include "framework/pipeline/writer_queue.h"

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include "diorama/error.h"
#include "support/catch.h"

using namespace diorama;

namespace {

PendingCapture capture_of(int index, int pixels, int turn = 0) {
  PendingCapture pending;
  pending.capture.index = index;
  pending.turn = turn;
  pending.overview = Image<Rgba8>(pixels, 1, Rgba8{});
  return pending;
}

WriterQueue::Options with(int threads, std::size_t max_bytes) {
  WriterQueue::Options options;
  options.threads = threads;
  options.max_bytes = max_bytes;
  return options;
}

/// Work that is all in the encoding.
WriterQueue::Work encoding(std::function<void(const PendingCapture&)> work) {
  return {[work = std::move(work)](const PendingCapture& pending) {
            work(pending);
            return Transaction();
          },
          [](int, Transaction&) {}};
}

/// Notes what is encoded and what is committed.
struct QueueLog {
  std::mutex mutex;
  std::vector<int> encoded;
  std::vector<int> committed;

  WriterQueue::Work work() {
    return {[this](const PendingCapture& pending) {
              const std::lock_guard lock(mutex);
              encoded.push_back(pending.capture.index);
              return Transaction();
            },
            [this](int capture, Transaction&) {
              const std::lock_guard lock(mutex);
              committed.push_back(capture);
            }};
  }
  std::size_t encoded_count() {
    const std::lock_guard lock(mutex);
    return encoded.size();
  }
};

}  // namespace

TEST_CASE("Every capture that was pushed is worked on once", "[queue]") {
  std::mutex mutex;
  std::multiset<int> seen;
  {
    WriterQueue queue(with(3, 1000), encoding([&](const PendingCapture& pending) {
                        const std::lock_guard lock(mutex);
                        seen.insert(pending.capture.index);
                      }));
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
  WriterQueue queue(with(8, 100), encoding([&](const PendingCapture&) {
                      std::this_thread::sleep_for(std::chrono::milliseconds(1));
                      --under_way;
                    }));
  for (int i = 0; i < 50; ++i) {
    // Counted when push() returns, so never below what the queue holds less one.
    REQUIRE(queue.push(capture_of(i, 10)));
    most = std::max(most.load(), ++under_way);
  }
  REQUIRE(queue.push(capture_of(50, 1000)));
  queue.drain();
  CHECK(most <= 3);
}

TEST_CASE("However small captures are, not many of them wait", "[queue]") {
  std::atomic<bool> may_encode = false;
  WriterQueue queue(with(2, std::size_t(1) << 30), encoding([&](const PendingCapture&) {
                      while (!may_encode) std::this_thread::yield();
                    }));
  int pushed = 0;
  while (pushed < 1000 && queue.push(capture_of(pushed, 1), [] { return true; })) ++pushed;
  CHECK(pushed >= 64);
  CHECK(pushed <= 200);
  may_encode = true;
  CHECK(queue.drain());
}

TEST_CASE("An error in the work comes out of the queue and ends it", "[queue]") {
  std::atomic<int> worked = 0;
  WriterQueue queue(with(2, 1 << 20), encoding([&](const PendingCapture& pending) {
                      ++worked;
                      if (pending.capture.index >= 3) {
                        throw Error(ErrorKind::Output,
                                    "no room for " + std::to_string(pending.capture.index));
                      }
                    }));
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
  const auto has_to_stop = [&] { return stop.load(); };
  WriterQueue queue(with(1, 80), encoding([&](const PendingCapture&) {
                      ++worked;
                      is_disk_back.wait(false);
                    }));
  REQUIRE(queue.push(capture_of(0, 10), has_to_stop));
  REQUIRE(queue.push(capture_of(1, 10), has_to_stop));
  while (worked == 0) std::this_thread::yield();
  stop = true;
  CHECK_FALSE(queue.push(capture_of(2, 10), has_to_stop));
  CHECK_FALSE(queue.drain(has_to_stop));
  queue.drop_waiting();
  is_disk_back = true;
  is_disk_back.notify_all();
  CHECK(queue.drain(has_to_stop));
  CHECK(worked == 1);
}

TEST_CASE("What is encoded before its turn is written when it is let through", "[queue]") {
  QueueLog log;
  WriterQueue queue(with(2, 1000), log.work());
  REQUIRE(queue.push(capture_of(4, 1, 2)));
  REQUIRE(queue.push(capture_of(2, 1, 1)));
  REQUIRE(queue.push(capture_of(3, 1, 1)));
  while (log.encoded_count() < 3) std::this_thread::yield();
  CHECK(queue.drain());
  CHECK(log.committed.empty());
  REQUIRE(queue.push(capture_of(0, 1, 0)));
  CHECK(queue.drain());
  CHECK(log.committed == std::vector<int>{0});
  queue.let_through(1);
  CHECK(queue.drain());
  CHECK(std::set<int>(log.committed.begin(), log.committed.end()) == std::set<int>{0, 2, 3});
  queue.drop_later_turns();
  queue.let_through(2);
  CHECK(queue.drain());
  CHECK(log.committed.size() == 3);
}

TEST_CASE("Where writers want order, nothing is encoded before its turn", "[queue]") {
  QueueLog log;
  WriterQueue::Options options = with(1, 1000);
  options.encodes_ahead = false;
  WriterQueue queue(options, log.work());
  REQUIRE(queue.push(capture_of(9, 1, 2)));
  REQUIRE(queue.push(capture_of(5, 1, 1)));
  REQUIRE(queue.push(capture_of(6, 1, 1)));
  REQUIRE(queue.push(capture_of(0, 1, 0)));
  CHECK(queue.drain());
  CHECK(log.encoded == std::vector<int>{0});
  queue.let_through(2);
  CHECK(queue.drain());
  CHECK(log.encoded == std::vector<int>{0, 5, 6, 9});
  CHECK(log.committed == log.encoded);
}

TEST_CASE("Later turns that fill the memory leave room for the one whose turn it is", "[queue]") {
  QueueLog log;
  std::atomic<bool> gives_up = false;
  WriterQueue::Options options = with(2, 100);
  options.encodes_ahead = false;
  WriterQueue queue(options, log.work());
  REQUIRE(queue.push(capture_of(7, 10, 1)));  // 40 of the 50 bytes for later turns
  std::thread later(
      [&] { CHECK(queue.push(capture_of(8, 10, 1), [&] { return gives_up.load(); })); });
  // However large it is, and whatever else waits.
  REQUIRE(queue.push(capture_of(0, 1000, 0)));
  REQUIRE(queue.push(capture_of(1, 1000, 0)));
  queue.let_through(1);
  later.join();
  CHECK(queue.drain());
  CHECK(log.committed.size() == 4);
}

TEST_CASE("A capture of a later turn that is larger than the memory is encoded by itself",
          "[queue]") {
  QueueLog log;
  WriterQueue queue(with(2, 100), log.work());
  REQUIRE(queue.push(capture_of(7, 1000, 1)));
  REQUIRE(queue.push(capture_of(8, 1000, 2)));  // when the first is encoded
  while (log.encoded_count() < 2) std::this_thread::yield();
  CHECK(log.encoded == std::vector<int>{7, 8});
  CHECK(log.committed.empty());
}

TEST_CASE("Encoding takes a seat of the pool, which visits give away while they wait", "[queue]") {
  ThreadPool pool(1);  // this thread has the only seat
  std::atomic<int> worked = 0;
  WriterQueue::Options options = with(3, 40);
  options.pool = &pool;
  WriterQueue queue(options, encoding([&](const PendingCapture&) { ++worked; }));
  REQUIRE(queue.push(capture_of(0, 10)));
  REQUIRE(queue.push(capture_of(1, 10)));  // waits for room, and so for the writing of the first
  CHECK(worked >= 1);
  CHECK(queue.drain());
  CHECK(worked == 2);
}
