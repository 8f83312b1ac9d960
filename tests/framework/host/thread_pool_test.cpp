// SPDX-License-Identifier: Apache-2.0
#include "framework/host/thread_pool.h"

#include <algorithm>
#include <atomic>
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
