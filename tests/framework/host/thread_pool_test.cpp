// SPDX-License-Identifier: Apache-2.0
#include "framework/host/thread_pool.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "diorama/error.h"
#include "support/catch.h"

using namespace diorama;

TEST_CASE("every index is run exactly once, for any thread count", "[host]") {
  for (const int threads : {1, 2, 7}) {
    ThreadPool pool(threads);
    CHECK(pool.thread_count() == threads);
    for (const std::size_t count : {0, 1, 2, 1000}) {
      std::vector<std::atomic<int>> runs(count);
      pool.parallel_for(count, [&](std::size_t i) { ++runs[i]; });
      CHECK(std::all_of(runs.begin(), runs.end(), [](const auto& n) { return n == 1; }));
    }
  }
}

TEST_CASE("the error with the lowest index is thrown, whatever the timing", "[host]") {
  for (const int threads : {1, 2, 7}) {
    ThreadPool pool(threads);
    for (int repeat = 0; repeat < 200; ++repeat) {
      std::vector<std::atomic<int>> runs(64);
      try {
        pool.parallel_for(64, [&](std::size_t i) {
          ++runs[i];
          if (i == 11 || i == 12 || i == 40) throw std::runtime_error(std::to_string(i));
        });
        FAIL("no error");
      } catch (const std::runtime_error& error) {
        CHECK(std::string(error.what()) == "11");
      }
      for (std::size_t i = 0; i <= 11; ++i) CHECK(runs[i] == 1);
    }
  }
}

TEST_CASE("loops inside of loops and from several threads all end", "[host]") {
  ThreadPool pool(3);
  std::atomic<int> inner = 0;
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 4; ++caller) {
    callers.emplace_back([&] {
      pool.parallel_for(20,
                        [&](std::size_t) { pool.parallel_for(10, [&](std::size_t) { ++inner; }); });
    });
  }
  for (std::thread& caller : callers) caller.join();
  CHECK(inner == 4 * 20 * 10);
}

TEST_CASE("a pool needs at least one thread", "[host]") {
  CHECK_THROWS_WITH(ThreadPool(0), "expected 1 to 1024 threads, found 0");
  CHECK_THROWS_WITH(ThreadPool(-4), "expected 1 to 1024 threads, found -4");
  CHECK(ThreadPool::available_threads() >= 1);
}

TEST_CASE("no more threads have a seat than the pool has, by rank and then in order", "[host]") {
  ThreadPool pool(2);
  std::atomic<int> seated = 0;
  std::atomic<int> most = 0;
  std::mutex mutex;
  std::vector<int> order;
  std::vector<std::thread> threads;
  std::atomic<int> waiting = 0;
  std::atomic<bool> is_full = false;
  std::atomic<bool> may_leave = false;
  std::thread busy([&] {  // with this thread's own, both seats
    const ThreadPool::Seat seat(pool, 0);
    is_full = true;
    while (!may_leave) std::this_thread::yield();
  });
  while (!is_full) std::this_thread::yield();
  for (const int rank : {5, 3, 9, 1}) {
    threads.emplace_back([&, rank] {
      ++waiting;
      const ThreadPool::Seat seat(pool, rank);
      most = std::max(most.load(), ++seated);
      {
        const std::lock_guard lock(mutex);
        order.push_back(rank);
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      --seated;
    });
  }
  while (waiting < 4) std::this_thread::yield();
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  {
    const std::lock_guard lock(mutex);
    CHECK(order.empty());
  }
  may_leave = true;
  busy.join();
  for (std::thread& thread : threads) thread.join();
  CHECK(order == std::vector<int>{1, 3, 5, 9});
  CHECK(most == 1);
}

TEST_CASE("a thread that rests lends its seat to another and to helpers of loops", "[host]") {
  ThreadPool pool(1);
  std::atomic<bool> had_seat = false;
  std::thread other([&] {
    const ThreadPool::Seat seat(pool, 1);
    had_seat = true;
    std::atomic<int> runs = 0;
    pool.parallel_for(10, [&](std::size_t) { ++runs; });
    CHECK(runs == 10);
  });
  {
    const ThreadPool::Rest rest(pool);
    const ThreadPool::Rest again(pool);  // has nothing to lend
    other.join();
  }
  CHECK(had_seat);
}

TEST_CASE("loops are shared only with threads that find a free seat", "[host]") {
  ThreadPool pool(3);
  const auto threads_of_loop = [&] {
    std::mutex mutex;
    std::set<std::thread::id> threads;
    pool.parallel_for(300, [&](std::size_t) {
      std::this_thread::sleep_for(std::chrono::microseconds(100));
      const std::lock_guard lock(mutex);
      threads.insert(std::this_thread::get_id());
    });
    return threads.size();
  };
  std::atomic<bool> is_over = false;
  std::atomic<int> seated = 0;
  std::vector<std::thread> busy;
  for (int i = 0; i < 2; ++i) {
    busy.emplace_back([&, i] {
      const ThreadPool::Seat seat(pool, i);
      ++seated;
      while (!is_over) std::this_thread::yield();
    });
  }
  while (seated < 2) std::this_thread::yield();
  CHECK(threads_of_loop() == 1);
  is_over = true;
  for (std::thread& thread : busy) thread.join();
  CHECK(threads_of_loop() > 1);
}
