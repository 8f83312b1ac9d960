// SPDX-License-Identifier: Apache-2.0
#include "framework/app/heap.h"

#include <malloc.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace diorama {

void give_large_blocks_back() {
#ifdef __GLIBC__
  constexpr int kLargeBlock = 512 << 10;
  mallopt(M_MMAP_THRESHOLD, kLargeBlock);
  mallopt(M_TRIM_THRESHOLD, 2 * kLargeBlock);
#endif
}

void share_heaps([[maybe_unused]] int threads) {
#ifdef __GLIBC__
  const char* tunables = std::getenv("GLIBC_TUNABLES");
  const bool is_chosen = std::getenv("MALLOC_ARENA_MAX") != nullptr ||
                         (tunables && std::strstr(tunables, "glibc.malloc.arena_max="));
  if (!is_chosen) mallopt(M_ARENA_MAX, std::max(2, threads / 2));
#endif
}

std::chrono::nanoseconds give_free_pages_back() {
  // Not the time of the wall: on a busy machine it is that of others.
  const auto used = [] {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
  };
  const auto begin = used();
#ifdef __GLIBC__
  malloc_trim(0);
#endif
  return used() - begin;
}

void keep_large_blocks() {
#ifdef __GLIBC__
  constexpr int kLargeBlock = 32 << 20;  // the largest that glibc takes
  mallopt(M_MMAP_THRESHOLD, kLargeBlock);
  mallopt(M_TRIM_THRESHOLD, 4 * kLargeBlock);
#endif
}

}  // namespace diorama
