// SPDX-License-Identifier: Apache-2.0
#include "framework/conformance/run_together.h"

#include <exception>
#include <latch>
#include <thread>
#include <vector>

namespace diorama::conformance {

void run_together(int threads, const std::function<void(int)>& work) {
  std::latch all_run(threads);
  std::vector<std::exception_ptr> errors(static_cast<std::size_t>(threads));
  {
    std::vector<std::jthread> running;
    for (int thread = 0; thread < threads; ++thread) {
      running.emplace_back([&, thread] {
        all_run.arrive_and_wait();
        try {
          work(thread);
        } catch (...) {
          errors[std::size_t(thread)] = std::current_exception();
        }
      });
    }
  }
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

}  // namespace diorama::conformance
